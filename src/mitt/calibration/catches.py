"""The offset of the cameras' clock from recorded catches: the ball that rides on the hand."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mitt.calibration.stage import Stage
from mitt.catcher.settings import BRAKE
from mitt.errors import InputError
from mitt.files.messages import Rows
from mitt.files.recorded import Recorded
from mitt.files.recording_rows import clock_in
from mitt.files.rig import CalibratedRig
from mitt.signals import Sighting
from mitt.vision.calibration.caught import Catch, LearnedClock, caught_offset

#: Commanded speed below which an arm is told to rest [rad/s].
_REST = 1e-9
#: Standard deviation of the offset above which more catches are asked for [s].
_CLOCK = 5e-4


def catches_in(recorded: Recorded) -> Iterator[tuple[float, Catch]]:
    """Yield what the stamps of each catch were corrected by [s], and the catch."""
    rows, numbers = recorded.ticks, recorded.numbers.tolist()
    begins = [k for k, n in enumerate(numbers) if "again" in recorded.calls.get(n, ())]
    ends = [*begins, len(rows)]
    for first, last in zip([0, *begins], ends, strict=True):
        calls = [name for n in numbers[first:last] for name in recorded.calls.get(n, ())]
        found = _catch(rows[first:last], [recorded.points(n) for n in numbers[first:last]])
        if found is not None:
            yield clock_in(calls), found


def _catch(rows: Rows, points: Sequence[tuple[Sighting, ...]]) -> Catch | None:
    """Return what arm and eyes said of a throw's catch; None where the arm never braked for one."""
    braked = np.flatnonzero(rows["out_phase"] == BRAKE)
    if len(braked) == 0:
        return None
    n = rows["q"].shape[1]
    told = np.abs(rows["command"].reshape(len(rows), 4, n)[:, 1]).max(axis=1)
    rests = braked[told[braked] < _REST]
    seen = rows["out_sighted"].astype(bool)
    t, table = rows["out_t_sighted"][seen], rows["sighting"][seen].reshape(-1, 4, 3)
    given = [p for several in points for p in several if p.found]
    if given:
        t = np.array([p.t for p in given])
        table = np.array([np.vstack([p.r_o, p.covariance]) for p in given])
    return Catch(
        t_arm=rows["t_arm"], q=rows["q"], t_seen=t, seen=table[:, 0], covariance=table[:, 1:],
        t_brake=float(rows["t"][braked[0]]),
        t_rest=float(rows["t"][rests[0] if len(rests) else braked[-1]]),
    )  # fmt: skip


def calibrate_by_catches(rig: CalibratedRig, paths: Sequence[Path]) -> tuple[CalibratedRig, Stage]:
    """Return the rig with the offset of its clock, and what to say about it.

    Raises:
        InputError: No catch of the recordings says anything of the clocks.
    """
    clock, tried, left = LearnedClock(), 0, list[float]()
    for path in paths:
        recorded = Recorded(path)
        for used, catch in catches_in(recorded):
            found = caught_offset(recorded.about.arm, catch)
            tried += 1
            clock.take(found, used)
            left += [] if found.unknown else [found.residual]
    if clock.count == 0:
        raise InputError("--catches", "recordings in which a ball rides on the braking hand",
                         f"{tried} catches that say nothing of the clocks")  # fmt: skip
    numbers = {
        "catches": clock.count, "tried": tried, "offset_ms": 1e3 * clock.offset,
        "sigma_ms": 1e3 * clock.sigma, "rms_mm": 1e3 * float(np.sqrt(np.mean(np.square(left)))),
    }  # fmt: skip
    weak = clock.sigma > _CLOCK
    warnings = ("offset is uncertain: record more catches",) if weak else ()
    known = replace(rig, clock_offset=clock.offset, clock_sigma=clock.sigma)
    return known, Stage("clock", "converged", numbers, warnings)
