"""The cells that ship: one for each arm by name, with the command that this arm takes."""

import pytest
from local_cell import LocalCell
from support import thorough

from mitt.io.cell import arm_of, around_of, read_cell
from mitt.io.load import arm_names
from mitt.io.reading import shipped
from mitt.io.shipped_arms import shipped_arms

CELLS = shipped("cells")
DESIGNED = {x.name for x in shipped_arms() if x.designed}


def test_each_arm_has_a_cell() -> None:
    """Called by its name."""
    assert {f"{name}-sim" for name in arm_names()} <= set(CELLS)


@pytest.mark.parametrize("name", CELLS)
def test_what_ships_fits_its_arm(name: str) -> None:
    """Arm, zones and floor; a vendor's limits."""
    cell = read_cell(name)
    assert cell.name == name
    if cell.arm.file in DESIGNED:
        arm = arm_of(cell)
        assert around_of(cell, arm).floor == (-1.0 if cell.task is None else 0.0)
        assert arm.limits.name == (cell.arm.limits or cell.arm.file)


@pytest.mark.parametrize("name", thorough(["ur5e-sim", "franka-panda-sim"], ["ur10e-sim"]))
def test_an_arm_by_name_catches_at_its_own_rate(name: str) -> None:
    """By speeds at 500 Hz, by torques at 1 kHz: no reading counts as lost, no limit is exceeded."""
    cell = LocalCell(throws=2, name=name)
    cell.begin()
    cell.until(lambda: cell.simulated.done)
    assert "caught" in cell.simulated.statuses
    assert cell.simulated.violations == 0
    assert (cell.loop.counts.lost, cell.loop.counts.stops) == (0, [])
    due = cell.simulated.t - 1.7e9
    assert cell.loop.counts.ticks == pytest.approx(due * cell.prepared.cell.robot.rate, rel=0.05)
