"""Description files by their names: a URDF (``.urdf``) or an MJCF (``.xml``, ``.mjcf``)."""

from pathlib import Path

from mitt import checks
from mitt.errors import UnknownNameError
from mitt.robot.mjcf import read_mjcf
from mitt.robot.stated import Stated
from mitt.robot.urdf import read_urdf
from mitt.robot.xml_files import check_suffix

_READERS = {".urdf": read_urdf, ".xml": read_mjcf, ".mjcf": read_mjcf}
#: What may be named as an arm; an arm file is read by :func:`mitt.load_arm`.
_ARMS = ("wam", "an arm file (.toml)", "a URDF (.urdf)", "an MJCF (.xml)")


def is_described(path: Path) -> bool:
    """Say whether a name is that of a description file."""
    return path.suffix.lower() in _READERS


def check_described(path: Path) -> None:
    """Refuse a name that is not that of a description file.

    Raises:
        UnknownNameError: It is neither a URDF nor an MJCF.
        FileError: It is another kind of description.
    """
    check_suffix(path)
    if not is_described(path):
        known = [x for x in _ARMS if path.suffix != ".toml" or ".toml" not in x]
        raise UnknownNameError("arm", str(path), known, do="a file is named by its path")


def read_described(path: Path) -> Stated:
    """Read a description file.

    Raises:
        UnknownNameError: It is neither a URDF nor an MJCF by its name.
        FileError: It cannot be read.
    """
    path = checks.path("path", path)
    check_described(path)
    return _READERS[path.suffix.lower()](path)
