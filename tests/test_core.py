"""What runs on the robot needs NumPy, Numba and the standard library, and no more."""

import subprocess
import sys
from pathlib import Path

CORE = Path(__file__).parents[1] / "src" / "mitt" / "core"
#: Refuses every package but those of the core, then imports each of its modules.
PROGRAM = """
import importlib, sys

ALLOWED = {"mitt", "numpy", "numba", "llvmlite"} | sys.stdlib_module_names


class Refuses:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        core = not name.startswith("mitt.") or name.startswith(("mitt.core", "mitt.version"))
        if core and (top in ALLOWED or top.startswith("_")):
            return None
        raise ImportError(f"{name} is no part of the core")


sys.meta_path.insert(0, Refuses())
for name in sys.argv[1:]:
    importlib.import_module(name)
print(len(sys.argv) - 1)
"""


def test_the_core_is_imported_where_nothing_else_is() -> None:
    """In a process in which any other package, and the rest of mitt, cannot be imported."""
    names = [
        "mitt.core." + ".".join(path.relative_to(CORE).with_suffix("").parts)
        for path in sorted(CORE.rglob("*.py"))
        if path.name != "__init__.py"
    ]
    run = [sys.executable, "-c", PROGRAM]
    done = subprocess.run([*run, *names], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) == len(names) > 40
    refused = subprocess.run([*run, "mitt.io.load"], capture_output=True, text=True, check=False)
    assert "is no part of the core" in refused.stderr
