"""The figures of ``mitt arms``: 200 throws that no search has seen, at each arm by name.

    python benchmarks/shipped_arms.py                 # measure what has changed, and write them
    python benchmarks/shipped_arms.py --all ur5e      # measure the UR5e anew whatever has changed

Each row is ``mitt catch --arm NAME --throws 200 --seed 40`` in the scene lab, with images. What it
measured is written after each arm into ``src/mitt/data/figures.json``, which is shipped.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mitt.core.arm.basket import Basket
from mitt.interrupts import tell
from mitt.io.shipped_arms import FIGURES, SCHEMA, Figures, ShippedArm, arm_digest, shipped_arms
from mitt.io.writing import write_text

#: Number of throws, and their seed: none that a search or another benchmark throws.
THROWS = 200
SEED = 40


def measured(arm: ShippedArm) -> Figures:
    """Return what comes of the throws."""
    chosen = arm.spec.read()
    with TemporaryDirectory() as folder:
        words = [
            "catch",
            "--arm",
            arm.name,
            "--limits",
            arm.limits,
            "--throws",
            str(THROWS),
            "--seed",
            str(SEED),
            "--record",
            "none",
            "--json",
            "--out",
            str(Path(folder) / "run"),
        ]
        out = subprocess.run(  # noqa: S603 (ours)
            [sys.executable, "-m", "mitt", *words],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
    trials = json.loads(out)["trials"]
    met = [t for t in trials if t["peak_contact_force_n"] is not None]
    beyond = sum(t["limit_violations"] + bool(t["over_force"]) for t in trials)
    hand = "basket" if isinstance(chosen.arm.model.hand, Basket) else "three-finger"
    return Figures(
        digest=arm_digest(chosen),
        joints=tuple(chosen.arm.names),
        hand=hand,
        throws=len(trials),
        caught=sum(t["status"] == "caught" for t in trials),
        beyond=beyond,
        relative_speed_m_s=_median([t["velocity_error_m_s"] for t in met]),
        force_n=_median([t["peak_contact_force_n"] for t in met]),
    )


def _median(values: Sequence[float]) -> float:
    """Return the median, to three digits."""
    return float(f"{np.median(values):.3g}")


def main() -> None:
    """Measure arms and write the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", help="arms; all if left out")
    parser.add_argument("--all", action="store_true", help="measure what has not changed as well")
    options = parser.parse_args()
    arms = [x for x in shipped_arms() if x.designed]
    rows = {(x.name, x.limits): x.figures for x in arms}
    for arm in arms:
        known = arm.figures is not None and arm.figures.digest == arm_digest(arm.spec.read())
        if (known and not options.all) or arm.name not in (options.names or [arm.name]):
            continue
        rows[arm.name, arm.limits] = found = measured(arm)
        _write(rows)
        tell(
            f"{arm.name}, {arm.limits}: caught {found.caught} of {found.throws},"
            f" {found.relative_speed_m_s} m/s, {found.force_n} N, {found.beyond} beyond a limit"
        )


def _write(rows: Mapping[tuple[str, str], Figures | None]) -> None:
    """Write what is known."""
    said = [
        {"name": name, "limits": limits, **asdict(x)}
        for (name, limits), x in rows.items()
        if x is not None
    ]
    write_text(FIGURES, json.dumps({"schema": SCHEMA, "rows": said}, indent=1) + "\n")


if __name__ == "__main__":
    main()
