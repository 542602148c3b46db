"""Runs each command of the README, of the start and of the tutorials without any extra.

    python tests/bare_run.py [PART OF A LINE]

Packages that only extras have cannot be imported, neither here nor in the processes that are
started, so that it tells the truth in any environment. Each line of a page stands in
:data:`RUNS`, with what is said where it is run; a line that does not is an error. Throws are few,
and the search of ``mitt design`` is interrupted once its workers have answered.
"""

import contextlib
import glob
import io
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

from documents import ROOT, lines_of, write_metadata

PAGES = [ROOT / x for x in ("README.md", "docs/start.md", "docs/commands.md")]
PAGES += sorted((ROOT / "docs/tutorials").glob("*.md"))
#: Longest that one command may take [s]: the first compiles.
PATIENCE = 600.0
#: Answers of candidates after which a search is interrupted.
ANSWERS = 12
#: Lines that are not run here: others install, test or start what is tried beside them.
ELSEWHERE = re.compile(r"^(make test|pip install .*|mitt sim .* &)$")
#: Lines whose page is drawn: of the WAM, and of an arm that has shapes of its own.
DRAWN = ("make catch", "mitt catch --arm ur5e")
TUTORIALS = "examples/tutorials"
#: Status and a part of what is said, by line; words that are added.
RUNS: dict[str, tuple[int, str, str]] = {
    "make catch": (0, "caught 1 of 1", ""),
    "mitt catch": (0, "caught 1 of 1", ""),
    "mitt catch --throws 100 --seed 1": (0, "caught 1 of 1", ""),
    "mitt catch --throws 20 --seed 1": (0, "caught 1 of 1", ""),
    "mitt catch --scene rough --limits wam-48v": (0, "limits wam-48v", ""),
    "mitt arms": (0, "ur5e", ""),
    "mitt catch --arm ur5e": (0, "written: ", ""),
    "mitt catch --arm ur5e --scene ur.toml --vision points": (0, "written: ", ""),
    "mitt design ur5e --hand basket --aim 0.6,0.2,0.3 --effort quick --out mine.toml": (
        0,
        "the input is good",
        "--check",
    ),
    "mitt catch --arm mine.toml": (0, "written: ", ""),
    "mitt sim ur5e-sim --throws 5 --seed 1": (2, "mitt[ros2]", ""),
    "mitt run ur5e-sim --throws 5 --yes": (2, "mitt[ros2]", ""),
    "mitt run CELL.toml --check": (2, "mitt[ur]", ""),
    "mitt catch --flights FLIGHTS.csv": (0, "written: runs/0-direct", ""),
    "mitt catch --generator quintic": (0, "quintic", ""),
    "mitt learn --out MAP.json": (0, "written: MAP.json", ""),
    "mitt catch --map MAP.json --throws-file THROWS.csv --record all": (
        0,
        "written: runs/0-direct",
        "",
    ),
    "mitt track POINTS.csv --out TRACK.csv --ahead 0.1": (0, "written: TRACK.csv", ""),
    "mitt sim wam-sim": (2, "mitt[ros2]", ""),
    "mitt run wam-sim --yes": (2, "mitt[ros2]", ""),
    "mitt replay RUN/recordings/*.mcap --out why": (0, "identical", ""),
    "mitt view runs": (0, "open http://127.0.0.1:", "--seconds 0.1"),
    "mitt bench": (0, "the input is good", "--check"),
    f"python {TUTORIALS}/cameras.py": (1, "cv2", ""),
    "mitt calibrate --left left/ --right right/ --square 0.03 --marker 0.022 --out cameras.toml": (
        2,
        "mitt[cameras]",
        "",
    ),
    "mitt calibrate --rig cameras.toml --hand hand.csv --hand-left l/ --hand-right r/"
    " --out RIG.toml": (2, "mitt[cameras]", ""),
    "mitt see left.mkv right.mkv --rig RIG.toml --out track.csv": (2, "mitt[cameras]", ""),
    f"python {TUTORIALS}/own_loop.py": (0, "", ""),
    "mitt catch --generator cubic --throws 10 --seed 300 --vision points --out tuning": (
        0,
        "caught 1 of 1",
        "",
    ),
    "mitt catch --generator careful --throws 10 --seed 300 --vision points --out careful": (
        0,
        "written: careful",
        "",
    ),
    f"mitt study {TUTORIALS}/planner/study.toml --out runs/cubic --workers 2": (
        2,
        "mitt[study]",
        "",
    ),
    "mitt report runs/cubic": (2, "mitt[study]", ""),
    f"mitt run {TUTORIALS}/robot/cell.toml --check": (0, "the input is good", ""),
    f"mitt run {TUTORIALS}/robot/cell.toml --throws 3": (0, "the input is good", "--check"),
    f"mitt run {TUTORIALS}/robot/first-moves.toml --check": (0, "the input is good", ""),
    f"mitt run {TUTORIALS}/robot/first-moves.toml": (0, "the input is good", "--check"),
    f"python {TUTORIALS}/robot/try_driver.py": (0, "", ""),
    f"python {TUTORIALS}/robot/watch_joints.py {TUTORIALS}/robot/cell.toml 60": (0, "", ""),
    "mitt design examples/own_arm.urdf --tip palm --joints yaw,pitch,elbow --effort quick"
    " --out arm.toml --check": (0, "the input is good", ""),
    "mitt design examples/own_arm.urdf --tip palm --joints yaw,pitch,elbow --effort quick"
    " --out arm.toml": (130, "--resume goes on", ""),
    f"mitt catch --arm {TUTORIALS}/arm/arm.toml --throws 20 --seed 80000 --vision points": (
        0,
        "caught 1 of 1",
        "",
    ),
    f"mitt catch --arm {TUTORIALS}/arm/arm.toml --scene rough --throws 20": (0, "written: ", ""),
    f"mitt learn --arm {TUTORIALS}/arm/arm.toml --out MAP.json": (
        0,
        "written: MAP.json",
        "--overwrite",
    ),
    "mitt meet": (0, "met 1 of 1", "--trials 1"),
    "mitt meet --target hand": (0, "written: ", "--trials 1"),
    "mitt meet --target hand --tool-speed 0.5": (0, "written: ", "--trials 1"),
    "mitt meet --target MOTIONS.csv --gripper-delay 0.2": (0, "written: ", ""),
    "mitt meet --tool jaw --gripper-delay 0.3": (0, "the input is good", "--check"),
    "mitt sim ur5e-belt-sim --throws 3": (2, "mitt[ros2]", ""),
    "mitt run ur5e-belt-sim --throws 3 --yes": (2, "mitt[ros2]", ""),
}


def extras() -> list[str]:
    """Return the modules of packages that no installation without extras has."""
    import tomllib  # noqa: PLC0415

    from packaging.requirements import Requirement  # noqa: PLC0415 (of the core: Matplotlib's)
    from packaging.utils import canonicalize_name  # noqa: PLC0415

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    todo, inside = [Requirement(x) for x in project["dependencies"]], {"mitt"}
    while todo:
        needed = todo.pop()
        name = canonicalize_name(needed.name)
        if name in inside:
            continue
        inside.add(name)
        with contextlib.suppress(PackageNotFoundError):
            for further in map(Requirement, requires(needed.name) or ()):
                kinds = [{"extra": extra} for extra in ("", *needed.extras)]
                if further.marker is None or any(map(further.marker.evaluate, kinds)):
                    todo.append(Requirement(str(further).split(";")[0]))
    return sorted(
        module
        for module, names in packages_distributions().items()
        if not inside & {canonicalize_name(name) for name in names}
    )


def few(words: list[str]) -> list[str]:
    """Return the words of ``mitt catch`` with one throw, seen as points."""
    for name, value in (("--throws", "1"), ("--vision", "points")):
        if name in words:
            words[words.index(name) + 1] = value
        else:
            words += [name, value]
    return words


def prepared(folder: Path) -> None:
    """Put the files that the lines name into a folder."""
    from throws_on_film import calibrated  # noqa: PLC0415 (once extras are out of the way)

    from mitt.io.rig import write_rig  # noqa: PLC0415

    (folder / "examples").symlink_to(ROOT / "examples")
    data = ROOT / "src/mitt/data"
    shutil.copy(data / "designs" / "ur5e.toml", folder / "mine.toml")
    (folder / "ur.toml").write_text('base = "lab"\n[actuation]\ntakes = "velocity"\ndelay = 3\n')
    sim = (data / "cells" / "ur5e-sim.toml").read_text()
    before, after = sim.split("[robot.options]")
    own = '[robot.options]\naddress = "192.0.2.1"\n\n[motion]' + after.split("[motion]")[1]
    (folder / "CELL.toml").write_text(before.replace('driver = "ros2"', 'driver = "ur"') + own)
    flights = (data / "flights" / "tennicam.csv").read_text()
    (folder / "FLIGHTS.csv").write_text(flights)
    (folder / "THROWS.csv").write_text("x,y,z,vx,vy,vz\n3.5,0.1,0.2,-6,0,1.5\n")
    rows = [f"a,{0.01 * k:.2f},0.6,{0.002 * k:.4f},0.3" for k in range(300)]
    (folder / "MOTIONS.csv").write_text("\n".join(["flight,t_s,x_m,y_m,z_m", *rows]))
    rows = [f"{0.002 * k:.3f},{3.0 - 0.01 * k:.3f},0.1,{0.3 + 0.005 * k:.3f}" for k in range(40)]
    (folder / "POINTS.csv").write_text("\n".join(["t_s,x_m,y_m,z_m", *rows]))
    head = "x_m,y_m,z_m,u_left_px,v_left_px,u_right_px,v_right_px"
    (folder / "hand.csv").write_text("\n".join([head, *["0.7,0.1,0.3,60,60,64,60"] * 12]))
    for name in ("left", "right", "l", "r", "runs/cubic"):
        (folder / name).mkdir(parents=True)
    for name in ("left", "right"):
        (folder / f"{name}.mkv").write_bytes(b"")
    for name in ("RIG", "cameras"):
        write_rig(folder / f"{name}.toml", calibrated(), version="0")


def run(line: str, env: dict[str, str]) -> tuple[int, str]:
    """Run a line and return its status and what it says."""
    from mitt.cli.main import main  # noqa: PLC0415 (once extras are out of the way)

    program, *words = shlex.split(f"{line} {RUNS[line][2]}")
    if program == "python":
        words = ["1" if word == "60" else word for word in words]
        done = subprocess.run(
            [sys.executable, *words],
            env=env,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        return done.returncode, done.stdout + done.stderr
    words = [x for word in words for x in (sorted(glob.glob(word)) if "*" in word else [word])]
    if words[0] == "catch":
        words = few(words)
    elif words[0] == "replay":
        words = [words[0], words[1], *words[words.index("--out") :]]
    elif words[0] == "design" and RUNS[line][0] == 130:
        return interrupted(words, env)
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main(words)
    return status, said.getvalue()


def interrupted(words: list[str], env: dict[str, str]) -> tuple[int, str]:
    """Begin a search, interrupt it once its workers have answered, and return what it says."""
    out = Path(words[words.index("--out") + 1])
    answers, end = out.with_suffix(".search.jsonl"), time.monotonic() + PATIENCE
    process = subprocess.Popen(
        [sys.executable, "-m", "mitt", *words],
        env=env,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    while process.poll() is None and time.monotonic() < end:
        if answers.exists() and answers.read_bytes().count(b"\n") > ANSWERS:
            process.send_signal(signal.SIGINT)
            break
        time.sleep(0.2)
    said, _ = process.communicate(timeout=PATIENCE)
    return process.returncode, said


@contextlib.contextmanager
def without_extras(folder: Path) -> Iterator[dict[str, str]]:
    """Let extras be missing here and in processes that are started; yield their environment."""
    missing = extras()
    for name in missing:
        sys.modules[name] = None  # type: ignore[assignment]  # so it cannot be imported
    (folder / "sitecustomize.py").write_text(
        f"import sys\nsys.modules.update(dict.fromkeys({missing!r}))\n"
    )
    robot, planner = ROOT / TUTORIALS / "robot", ROOT / TUTORIALS / "planner"
    for package in (robot, planner):
        write_metadata(package, folder)
    path = [str(x) for x in (folder, robot, planner)]
    sys.path[:0] = path
    given = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join([*path, *([given] if given else [])])
    yield dict(os.environ)


def tried(line: str, env: dict[str, str]) -> str:
    """Run a line; return what is wrong with it, nothing where all is well."""
    status, wanted, _ = RUNS[line]
    try:
        found, said = run(line, env)
    except (Exception, SystemExit) as error:
        return f"{type(error).__name__}: {error}"
    if found == status and wanted in said:
        return ""
    return f"status {found} and {said[-500:]!r}, not {status} and {wanted!r}"


def blank(*_: object) -> object:
    """Return what a page without figures shows besides what all show."""
    from mitt.lab.report.run_page import Blocks  # noqa: PLC0415 (once extras are out of the way)

    return Blocks()


def main(part: str = "") -> int:
    """Run the lines that have some part, all if none is said; return the exit status."""
    lines = list(dict.fromkeys(line for page in PAGES for line in lines_of(page)))
    unknown = [x for x in lines if x not in RUNS and not ELSEWHERE.match(x)]
    wrong = [f"{line}: stands in no line of RUNS" for line in unknown]
    wrong += [f"{line}: stands on no page" for line in RUNS if line not in lines]
    with tempfile.TemporaryDirectory() as name, without_extras(Path(name)) as env:
        import mitt.lab.report.outputs as outputs  # noqa: PLC0415 (once extras are out of the way)

        blocks_of, folder = vars(outputs)["blocks_of"], Path(name) / "here"
        folder.mkdir()
        os.chdir(folder)
        prepared(folder)
        for line in (x for x in lines if x in RUNS and (part in x or x == "make catch")):
            start = time.monotonic()
            vars(outputs)["blocks_of"] = blocks_of if line in DRAWN else blank
            for old in Path("runs").glob("[01]-direct") if " catch" in line else ():
                shutil.rmtree(old)  # each is tried as the first of its kind
            said = tried(line, env)
            wrong += [f"{line}: {said}"] if said else []
            took = f"{time.monotonic() - start:6.1f} s"
            print(took, line, f": {said}" if said else "", flush=True)  # noqa: T201
            if line == "make catch" and not said:
                Path("runs/0-direct").rename("RUN")
        os.chdir(ROOT)
    for text in wrong:
        print(text, file=sys.stderr)  # noqa: T201
    return int(bool(wrong))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background
    sys.exit(main(*sys.argv[1:2]))
