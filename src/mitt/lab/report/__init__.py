"""What a run and a study look like: pages, figures, replays.

Matplotlib keeps settings and a list of fonts in folders of the user's. Where these cannot be
written it would say so in lines of its own, so it gets a folder that goes with the process.
"""

import atexit
import os
import shutil
import tempfile
from pathlib import Path


def _writable(folder: Path) -> bool:
    """Say whether a folder can be written, or made."""
    there = next(x for x in (folder, *folder.parents) if x.exists())
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def _folders() -> list[Path]:
    """Return the folders that Matplotlib uses."""
    home = os.path.expanduser("~")
    roots = (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache"))
    return [Path(os.environ.get(x) or os.path.join(home, y)) / "matplotlib" for x, y in roots]


if "MPLCONFIGDIR" not in os.environ and not all(map(_writable, _folders())):
    os.environ["MPLCONFIGDIR"] = tempfile.mkdtemp(prefix="mitt-matplotlib-")
    atexit.register(shutil.rmtree, os.environ["MPLCONFIGDIR"], ignore_errors=True)
