"""A large dose of fuzzing: ``make soak COMMANDS=N TICKS=N FILES=N SEED=S``.

The last line is JSON; the status is 1 where anything was found.
"""

import argparse
import faulthandler
import json
import sys
import tempfile
from pathlib import Path

from mitt.core.map.neighbourhood import learn
from mitt.io.load import build_arm
from soak import arrays, commands, files, kills, runs, studies, swings, ticks

#: Where files that did harm are kept.
_HARMFUL = Path("runs/soak")


def main() -> int:
    """Run all parts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    for name, default in (
        ("commands", 20_000_000),
        ("ticks", 5_000),
        ("files", 300),
        ("calls", 20_000),
        ("processes", 6),
        ("kills", 3),
        ("run_kills", 2),
        ("swings", 70),
        ("run_signals", 4),
        ("study_kills", 2),
        ("seed", 1),
    ):
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=default, metavar="N")
    options = parser.parse_args()
    faulthandler.enable()  # a crash of the interpreter says where
    sent = commands.soak(options.commands, seed=options.seed)
    print(sent)  # noqa: T201
    made = ticks.soak(options.ticks, seed=options.seed, f=learn(build_arm("wam")).map)
    print(dict(made.phases), dict(made.states), f"{made.recovered} recoveries")  # noqa: T201
    swung = list(swings.soak(options.swings, seed=options.seed, maps={}))
    for line in swings.table(swung):
        print(line)  # noqa: T201
    told, strayed = swings.faults(swung)
    called = arrays.soak(options.calls, seed=options.seed)
    print(f"{called.calls} calls of {len(called.functions)} functions, {called.refused} refused")  # noqa: T201
    with tempfile.TemporaryDirectory() as folder:
        names = ("here", "apart", "dying", "runs", "studies")
        places = here, apart, dying, running, resumed = [Path(folder) / name for name in names]
        for place in places:
            place.mkdir()
        read = files.soak(options.files, seed=options.seed, folder=here, keep=_keep)
        alone = files.soak_processes(options.processes, seed=options.seed, folder=apart, keep=_keep)
        killed = kills.soak(options.kills, seed=options.seed, folder=dying)
        ended = runs.soak(options.run_kills, options.run_signals, seed=options.seed, folder=running)
        print(ended)  # noqa: T201
        again = studies.soak(options.study_kills, seed=options.seed, folder=resumed)
        print(dict(again))  # noqa: T201
    for fault in told + strayed + made.faults + called.faults[:20] + read.faults + alone.faults:
        print(fault)  # noqa: T201
    for fault in killed.unreadable + ended.faults:
        print(fault)  # noqa: T201
    result = {
        "commands": sent.commands,
        "violations": sent.violations,
        "non_finite": sent.non_finite + made.non_finite,
        "ticks": made.ticks,
        "tick_faults": made.fault_ticks,
        "swings": len(swung),
        "swing_command_faults": len(told),
        "swing_arm_faults": len(strayed),
        "calls": called.calls,
        "call_faults": len(called.faults),
        "files": read.files + alone.files,
        "file_faults": len(read.faults) + len(alone.faults),
        "kills": killed.kills,
        "unreadable": len(killed.unreadable),
        "runs_ended": ended.killed + ended.signalled,
        "run_faults": len(ended.faults),
        "study_kills": again.pop("kills"),
        "study_faults": int(again.pop("faults")),
    }
    print(json.dumps(result))  # noqa: T201
    bad = (
        "violations",
        "non_finite",
        "tick_faults",
        "call_faults",
        "file_faults",
        "unreadable",
        "swing_command_faults",
        "swing_arm_faults",
        "run_faults",
        "study_faults",
    )
    return int(any(result[key] for key in bad))


def _keep(name: str, data: bytes) -> None:
    """Keep a file that did harm."""
    _HARMFUL.mkdir(parents=True, exist_ok=True)
    (_HARMFUL / name).write_bytes(data)


if __name__ == "__main__":
    sys.exit(main())
