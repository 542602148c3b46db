"""A loop that is late sends one command for many readings: what nobody sent, the arm was not told.

In one process, without a clock: all readings of a stall come together, and the arm has obeyed the
last command all the while. The benchmark of the same name tries every phase.
"""

import numpy as np
import pytest
from local_cell import LocalCell, Readings

from mitt.core.catcher.catcher import Phase
from mitt.core.signals import TICK
from mitt.robot.cell.live import Mode

#: Stalls [ms], one after another.
STALLS = (3, 6, 9, 12, 15, 18)


def stall(cell: LocalCell, ticks: int) -> None:
    """Let the loop be late by so many ticks."""
    end = cell.simulated.t + (ticks - 0.5) * TICK

    def late(got: Readings) -> Readings:
        found = list(got)
        while cell.simulated.t < end:
            found += cell.robot._inner.read(0.02)
        cell.robot.on_read = lambda x: x
        return found

    cell.robot.on_read = late


@pytest.mark.parametrize(
    ("name", "throws", "after"),
    [
        ("wam-sim", 6, 0),
        pytest.param("ur5e-sim", 3, 0, marks=pytest.mark.thorough),
        pytest.param("ur5e-belt-sim", 1, 1, marks=pytest.mark.thorough),
        pytest.param("wam-sim", 6, 1, marks=pytest.mark.thorough),
        pytest.param("wam-sim", 6, 3, marks=pytest.mark.thorough),
        pytest.param("ur5e-belt-sim", 3, 1, marks=pytest.mark.thorough),
    ],
)
def test_a_stall_as_the_arm_begins_to_move_is_no_fault(name: str, throws: int, after: int) -> None:
    """Of up to 18 ms: no encoder is called silent, no reading repeated, nothing is stopped."""
    cell, stalls = LocalCell(throws=throws, name=name, seed=2), list[int]()
    cell.begin()
    since, count = -1, 0
    while not cell.simulated.done and cell.loop.mode is not Mode.STOPPED:
        moves = cell.loop._ticks.catcher.phase is Phase.FOLLOW and cell.loop.mode is Mode.CATCHING
        since = since + 1 if moves else -1
        if since == after:
            stalls.append(STALLS[(len(stalls) + after) % len(STALLS)])
            stall(cell, stalls[-1])
        cell.loop.cycle()
        count += 1
        assert count < 100_000
    assert cell.loop.why == ""
    assert len(stalls) >= throws
    assert cell.loop.counts.repeated == 0
    assert cell.loop.counts.late > 0
    assert "readings" not in cell.loop.notes
    assert cell.simulated.violations == 0


def test_a_stall_beyond_the_robots_watchdog_is_a_protective_stop() -> None:
    """What stops it is what happened; the reason says no more than that."""
    cell = LocalCell(throws=1, seed=2)
    cell.begin()
    cell.until(lambda: cell.fastest > 1.5)
    stall(cell, 30)
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert "no command for 20 ms" in cell.loop.why or "this loop was late" in cell.loop.why
    assert "encoder" not in cell.loop.why
    assert "repeat" not in cell.loop.why
    assert np.all(np.abs(cell.simulated.truth.dq) < 0.05)
