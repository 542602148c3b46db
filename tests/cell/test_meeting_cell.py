"""The cell that meets parts on a belt: taken, put down, recorded, replayed; and what may fail."""

from pathlib import Path

import pytest
from local_cell import LocalCell

from mitt.catcher.catcher import Phase
from mitt.cell import live
from mitt.cell.live import Mode
from mitt.cell.prepare import prepare
from mitt.errors import FileError, InputError
from mitt.files.cell import cell_of
from mitt.files.recordings import Recorded
from mitt.reading import read_toml, shipped_path
from mitt.trials.replayed import replay

NAME = "ur5e-belt-sim"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Meet two parts, put them down, and record it."""
    file = tmp_path_factory.mktemp("met") / "met.mcap"
    cell = LocalCell(throws=2, seed=1, name=NAME, record=file)
    assert cell.recorder is not None
    with cell.recorder:
        cell.begin()
        cell.until(lambda: cell.simulated.done and cell.loop.idle)
    assert cell.simulated.statuses == ["met", "met"]
    assert (cell.simulated.placed, cell.simulated.violations) == (2, 0)
    counts = cell.loop.counts
    assert (counts.throws, counts.refused, counts.stopped) == (2, 0, 0)
    assert (counts.lost, counts.empty, counts.stops) == (0, 0, [])
    return file


def test_parts_are_met_one_after_another_and_replayed_to_the_bit(file: Path) -> None:
    """By speeds at 500 Hz; each is put down; the recording makes the same commands."""
    recorded = Recorded(file)
    assert recorded.about.meeting is not None
    found = replay(recorded)
    assert found.identical
    assert len(recorded.calls) >= 2  # a fresh catcher for each part


def followed() -> LocalCell:
    """Return a cell in which a part is followed."""
    cell = LocalCell(throws=3, seed=1, name=NAME)
    cell.begin()
    cell.until(lambda: cell.loop._ticks.catcher.phase is Phase.FOLLOW)
    return cell


def test_a_part_that_is_not_seen_any_more_ends_in_a_stop_and_the_next_is_met() -> None:
    """A stream that is lost is no fault of the arm: it stops, goes back, and waits."""
    cell = followed()
    cell.robot.on_points = lambda _: []
    cell.until(lambda: cell.loop.mode is Mode.MOVING)
    cell.robot.on_points = lambda x: x
    assert (cell.loop.counts.stopped, cell.loop.counts.stops) == (1, [])
    cell.until(lambda: "met" in cell.simulated.statuses, ticks=30_000)
    assert cell.simulated.violations == 0


def test_a_tool_that_does_not_answer_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The part is seen on the belt, not at the tool: nothing is put down, and the loop stops."""
    monkeypatch.setattr(live, "_EMPTY", 1)
    cell = followed()
    write = cell.robot._inner.write
    cell.robot._inner.write = lambda command, answers: write(command._replace(hand=0.0), answers)  # type: ignore[method-assign]
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert "does the tool answer?" in cell.loop.why
    assert cell.loop.counts.empty == 1
    assert cell.robot.braked[-1]
    assert cell.simulated.violations == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"put": [3.0, 0.0, 0.0]}, "task.put"),
        ({"belt": None}, "the belt that brings the parts"),
        ({"gripper_delay": 9.0}, "gripper_delay"),
    ],
)
def test_what_a_task_cannot_be_is_refused(change: dict[str, object], said: str) -> None:
    """A place out of reach, a belt that is missing, a gripper that is too slow."""
    raw = read_toml(shipped_path("cells", NAME))
    task = {key: x for key, x in (raw["task"] | change).items() if x is not None}
    with pytest.raises((InputError, FileError), match=said):
        prepare(cell_of(raw | {"task": task}, place="a cell"))
