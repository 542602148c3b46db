"""What the first commands compile, one after the other, from an empty cache.

Each command runs twice: what the first run takes more than the second is compiling. Printed are the
kernels that are kept, their size, and the processor time of compiling.

Usage: python benchmarks/compile.py [COMMAND ...], each a command line of mitt; without any, a catch
from positions, then one from images.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

#: Commands in their order; OUT is a new folder.
COMMANDS = ("catch --throws 1 --vision points --out OUT", "catch --throws 1 --out OUT")


def processor_time(command: str, home: Path) -> float:
    """Return the processor time of a command of mitt with a cache of its own [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as out:
        words = command.replace("OUT", f"{out}/out").split()
        subprocess.run(  # noqa: S603 (our own command)
            [sys.executable, "-m", "mitt", *words],
            env=os.environ | {"NUMBA_CACHE_DIR": str(home)},
            stdout=subprocess.DEVNULL,
            check=True,
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def kept(home: Path) -> list[int]:
    """Return the size of each kernel that is kept [bytes]."""
    return [path.stat().st_size for path in home.rglob("*.nbc")]


def main(commands: tuple[str, ...]) -> None:
    """Print a line for each command."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        for command in commands:
            before = len(kept(home))
            cold = processor_time(command, home)
            compiled = cold - processor_time(command, home)
            sizes = kept(home)
            print(
                f"{command}: {len(sizes) - before} kernels in {compiled:.0f} s of processor time, "
                f"{len(sizes)} kept, {sum(sizes) / 1e6:.0f} MB"
            )


if __name__ == "__main__":
    main(tuple(sys.argv[1:]) or COMMANDS)
