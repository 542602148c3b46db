"""What an MJCF file may ask for: no file outside its folder, and not more than an arm has.

MuJoCo opens files and makes copies while it parses, so that this is looked at before.
"""

from math import prod
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from mitt.errors import FileError

#: What opens other files, or runs code, as MuJoCo parses it.
_REFUSED = ("model", "attach", "plugin", "extension", "include")
#: Attributes that name a folder.
_FOLDERS = ("assetdir", "meshdir", "texturedir")
#: Most elements once copies are made.
_MOST = 100_000


def check_files(path: Path, root: Element) -> None:
    """Refuse files that are not below the file's own folder, and copies without number.

    Raises:
        FileError: Of what is refused.
    """
    for element in root.iter():
        if element.tag in _REFUSED:
            raise FileError(str(path), "one file, without others and plugins", f"<{element.tag}>",
                            do="join the files into one")  # fmt: skip
        if element.tag == "flexcomp" and "file" in element.attrib:
            raise FileError(str(path), "an arm without flexible bodies from files", "<flexcomp>",
                            do="take it out")  # fmt: skip
        for key, name in element.attrib.items():
            if (key in _FOLDERS or key.startswith("file")) and _outside(name):
                raise FileError(str(path), "meshes below its own folder", f"{key}={name[:60]!r}")
    if _size(path, root) > _MOST:
        raise FileError(str(path), f"at most {_MOST} elements with all copies", "more",
                        do="take out <replicate> and <composite>")  # fmt: skip


def _outside(name: str) -> bool:
    """Say whether a path leads out of the folder that it is seen from."""
    parts = PurePosixPath(name.replace("\\", "/"))
    return parts.is_absolute() or name.startswith("~") or ":" in name or ".." in parts.parts


def _size(path: Path, element: Element) -> int:
    """Return the number of elements in one, copies included."""
    inner = 1 + sum(_size(path, child) for child in element)
    if element.tag not in ("replicate", "composite", "flexcomp"):
        return inner
    given = element.get("count", "1")
    try:
        counts = [int(x) for x in given.split()]
    except ValueError:
        counts = []
    if not counts or not all(1 <= x <= _MOST for x in counts):
        wanted = f"whole numbers in 1..{_MOST} for count"
        raise FileError(f"{path} <{element.tag}>", wanted, repr(given[:60]))
    return min(prod(counts) * inner, _MOST + 1)
