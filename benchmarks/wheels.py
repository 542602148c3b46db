"""The wheel in fresh environments: does ``mitt catch`` work, after how long, and how much is it?

    python benchmarks/wheels.py --build DIR                      build the wheel alone
    python benchmarks/wheels.py --pythons python3.11,python3.13  the default install in each
    python benchmarks/wheels.py --extras study,cameras,dev       and each of these extras, alone

Each Python has a fresh environment, made from the wheel and ``constraints.txt``, and an empty home
folder; each extra is added to a copy of it. The packages come from where pip takes them.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

ROOT = Path(__file__).parents[1]
#: What the wheel is made of.
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "src")
#: Variables that would let an environment see another one, or our compiled kernels.
FOREIGN = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
HEAD = (
    "Python",
    "extra",
    "install [s]",
    "installed [MB]",
    "opened by `mitt catch` [MB]",
    "first catch [s] (of a processor)",
    "next [s]",
    "`--help` [s]",
    "heaviest [MB]",
)
CATCH = ("catch", "--throws", "1", "--overwrite", "--out", "run")
#: Runs a command of mitt, then says how many bytes of the packages it has opened or mapped.
OPENED = """
import os, sys
seen = set()
sys.addaudithook(lambda event, given: event == "open" and isinstance(given[0], str)
                 and seen.add(given[0]))
from mitt.cli.main import main
status = main(sys.argv[2:])
with open("/proc/self/maps") as maps:
    seen.update(line.split(maxsplit=5)[5].strip() for line in maps if len(line.split()) > 5)
files = {os.path.realpath(name) for name in seen if os.path.isfile(name)}
print(sum(os.path.getsize(name) for name in files if name.startswith(sys.argv[1])))
sys.exit(status)
"""


@dataclass(frozen=True, kw_only=True)
class Row:
    """What an environment showed: seconds, of the processor too, and megabytes; None: not tried."""

    python: str
    extra: str
    install: float
    installed_mb: float
    opened_mb: float | None = None
    first: tuple[float, float] | None = None
    second: tuple[float, float] | None = None
    help: tuple[float, float] | None = None
    heaviest: str


def build(folder: Path) -> Path:
    """Build the wheel into a folder, from a copy of the sources and of nothing else."""
    with TemporaryDirectory() as copy:
        for name in SOURCES:
            if (ROOT / name).is_dir():
                forget = shutil.ignore_patterns("__pycache__", "*.egg-info")
                shutil.copytree(ROOT / name, Path(copy, name), ignore=forget)
            else:
                shutil.copy(ROOT / name, copy)
        run(
            [
                sys.executable,
                "-m",
                "pip",
                "wheel",
                "--quiet",
                "--no-deps",
                "--no-build-isolation",
                "--wheel-dir",
                str(folder),
                copy,
            ]
        )
    (wheel,) = folder.glob("mitt-*.whl")
    return wheel


def run(
    command: Sequence[str], *, cwd: Path = ROOT, home: Path | None = None
) -> tuple[str, tuple[float, float]]:
    """Return what a command prints, and its time, passed and of the processor [s]; or exit."""
    environment = {name: x for name, x in os.environ.items() if name not in FOREIGN}
    start, before = perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(  # noqa: S603 (our own commands)
        command,
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env=environment | ({} if home is None else {"HOME": str(home)}),
    )
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: status {done.returncode}\n{done.stderr[-2000:]}")
    passed, after = perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout, (passed, used)


def sizes(packages: Path) -> dict[str, float]:
    """Return the megabytes of each entry of a folder; what belongs to pip itself is left out."""
    return {
        entry.name: sum(x.lstat().st_size for x in (entry, *entry.rglob("*"))) / 1e6
        for entry in packages.iterdir()
        if entry.name.split("-")[0] not in ("pip", "setuptools", "pkg_resources", "_distutils_hack")
    }


def install(wheel: Path, own: str, extra: str = "") -> float:
    """Install the wheel from its file, with the pinned versions; return how long it took [s]."""
    name = f"mitt[{extra}] @ {wheel.as_uri()}" if extra else str(wheel)
    _, (passed, _) = run(
        [
            own,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--constraint",
            str(ROOT / "constraints.txt"),
            name,
        ]
    )
    run([own, "-m", "pip", "check"])
    return passed


def packages_of(own: str) -> Path:
    """Return where an interpreter has its packages."""
    place, _ = run([own, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"])
    return Path(place.strip())


def tried(
    wheel: Path, python: str, extras: Sequence[str], folder: Path, *, catch: bool
) -> Iterator[Row]:
    """Make an environment, catch in it where asked to; then add each extra to a copy of it."""
    version = run([python, "-c", "import sys; print(*sys.version_info[:3], sep='.')"])[0].strip()
    run([python, "-m", "venv", str(folder / "env")])
    own = str(folder / "env" / "bin" / "python")
    passed = install(wheel, own)
    base = sizes(packages_of(own))
    row = Row(
        python=version,
        extra="none",
        install=passed,
        installed_mb=sum(base.values()),
        heaviest=heaviest(base),
    )
    yield caught(row, own, folder) if catch else row
    for extra in extras:
        copy = folder / extra
        shutil.copytree(folder / "env", copy, symlinks=True)
        own = str(copy / "bin" / "python")
        passed = install(wheel, own, extra)
        found = sizes(packages_of(own))
        added = {name: size for name, size in found.items() if name not in base}
        yield Row(
            python=version,
            extra=extra,
            install=passed,
            installed_mb=sum(found.values()),
            heaviest=heaviest(added),
        )
        shutil.rmtree(copy)


def heaviest(found: dict[str, float]) -> str:
    """Return the names and megabytes of the six largest."""
    return ", ".join(f"{x} {found[x]:.0f}" for x in sorted(found, key=lambda x: -found[x])[:6])


def caught(row: Row, own: str, folder: Path) -> Row:
    """Return the row of an environment with the times of two catches and of ``--help``."""
    home, outside, command = folder / "home", folder / "outside", str(Path(own).with_name("mitt"))
    home.mkdir()
    outside.mkdir()
    _, first = run([command, *CATCH], cwd=outside, home=home)
    if not list((home / ".cache" / "mitt").rglob("*.nbc")):
        sys.exit(f"no compiled kernels in {home / '.cache' / 'mitt'}")
    _, second = run([command, *CATCH], cwd=outside, home=home)
    _, quick = run([command, "catch", "--help"], cwd=outside, home=home)
    within = str(packages_of(own).resolve())
    said, _ = run([own, "-c", OPENED, within, *CATCH], cwd=outside, home=home)
    opened = float(said.split()[-1]) / 1e6
    return replace(row, first=first, second=second, help=quick, opened_mb=opened)


def line(row: Row) -> str:
    """Return a row of the table."""
    times = [
        "-" if x is None else f"{x[0]:.{places}f} ({x[1]:.{places}f})"
        for x, places in ((row.first, 0), (row.second, 1), (row.help, 2))
    ]
    opened = "-" if row.opened_mb is None else f"{row.opened_mb:.0f}"
    cells = (row.python, row.extra, f"{row.install:.0f}", f"{row.installed_mb:.0f}", opened)
    return f"| {' | '.join((*cells, *times, row.heaviest))} |"


def main() -> None:
    """Build, install and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, metavar="DIR", help="build into DIR and end")
    parser.add_argument("--pythons", default=sys.executable, help="interpreters, by commas")
    parser.add_argument("--extras", default="", help="each added alone, by commas")
    parser.add_argument("--no-catch", action="store_true", help="install only")
    options = parser.parse_args()
    if options.build:
        print(build(options.build))
        return
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}", flush=True)
    with TemporaryDirectory() as made:
        wheel = build(Path(made))
        for python in options.pythons.split(","):
            extras = [x for x in options.extras.split(",") if x]
            with TemporaryDirectory() as folder:
                for row in tried(wheel, python, extras, Path(folder), catch=not options.no_catch):
                    print(line(row), flush=True)


if __name__ == "__main__":
    main()
