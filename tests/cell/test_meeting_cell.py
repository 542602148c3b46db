"""The cell that meets parts on a belt: taken, put down, recorded, replayed; and what may fail."""

import json
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from local_cell import LocalCell

from mitt.core.catcher.catcher import Phase
from mitt.core.catcher.meeting import Meeting
from mitt.core.errors import FileError, InputError
from mitt.core.signals import TICK, Command, Sighting
from mitt.io.cell import cell_of
from mitt.io.reading import read_toml, shipped_path
from mitt.io.recordings import Recorded
from mitt.io.schema import in_words_of
from mitt.lab.trials.replayed import replay
from mitt.lab.world.scene import Ball, Belt, Tray
from mitt.robot.cell import live
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import cell_about, cell_map, prepare, scene_of_cell
from mitt.robot.cell.ticks import Ticks

NAME = "ur5e-belt-sim"
#: Relative error of the time between two stamps that are times of the day.
STAMPS = 1e-3


def followed(cell: LocalCell) -> LocalCell:
    """Go on until a part is followed."""
    cell.begin()
    cell.until(lambda: cell.loop._ticks.catcher.phase is Phase.FOLLOW)
    return cell


@pytest.fixture(scope="module")
def met(tmp_path_factory: pytest.TempPathFactory) -> tuple[LocalCell, Path]:
    """Lose a part out of sight, meet it nevertheless, and put it down; recorded."""
    file = tmp_path_factory.mktemp("met") / "met.mcap"
    cell = LocalCell(throws=1, seed=1, name=NAME, record=file)
    assert cell.recorder is not None
    with cell.recorder:
        followed(cell)
        cell.robot.on_points = lambda _: []
        cell.until(lambda: cell.loop.mode is Mode.MOVING)
        cell.robot.on_points = lambda x: x
        cell.until(lambda: cell.simulated.done and cell.loop.idle, ticks=30_000)
    return cell, file


def test_a_part_is_met_and_put_down_though_it_was_lost(met: tuple[LocalCell, Path]) -> None:
    """By speeds at 500 Hz. A stream that is lost stops no arm: the part is held by its belt."""
    cell, _ = met
    assert cell.simulated.statuses == ["met"]
    assert (cell.simulated.placed, cell.simulated.violations) == (1, 0)
    counts = cell.loop.counts
    assert (counts.stopped, counts.lost, counts.empty, counts.stops) == (0, 0, 0, [])


def test_all_of_it_is_replayed_to_the_bit(met: tuple[LocalCell, Path]) -> None:
    recorded = Recorded(met[1])
    assert isinstance(recorded.about.made_of, Meeting)
    assert len(recorded.calls) >= 2  # a fresh catcher for each part
    assert replay(recorded).identical


@pytest.mark.thorough
def test_a_tool_that_does_not_answer_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The part is seen on the belt, not at the tool: nothing is put down, and the loop stops."""
    monkeypatch.setattr(live, "_EMPTY", 1)
    cell = followed(LocalCell(throws=1, seed=1, name=NAME))
    write = cell.robot._inner.write
    cell.robot._inner.write = lambda command, answers: write(command._replace(hand=0.0), answers)  # type: ignore[method-assign]
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert "does the tool answer?" in cell.loop.why
    assert cell.loop.counts.empty == 1
    assert cell.robot.braked[-1]
    assert cell.simulated.violations == 0


@pytest.mark.thorough
def test_torques_keep_their_rates_from_one_catcher_to_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A Panda's, after a stop and in the ready pose; on its way no part is looked at. Replayed."""
    raw, own = (read_toml(shipped_path("cells", name)) for name in (NAME, "franka-panda-sim"))
    belt = raw["task"]["belt"] | {"middle": [0.5, 0.0], "height": 0.19}
    task = raw["task"] | {"belt": belt, "put": [0.0, 0.5, 0.21]}
    panda = {"arm": own["arm"], "robot": own["robot"], "floor": -1.0, "task": task}
    prepared, file = prepare(cell_of(raw | panda, place="a cell")), tmp_path / "panda.mcap"
    cell, told = LocalCell(throws=1, seed=1, prepared=prepared, record=file), list[Command]()

    def note(command: Command) -> bool:
        told.append(command)
        return True

    def seen(_: object) -> list[Sighting]:
        return [
            Sighting(
                t=cell.simulated.t,
                found=True,
                r_o=cell.simulated.truth.r_o,
                covariance=1e-6 * np.eye(3),
            )
        ]

    cell.robot.on_write = note
    assert cell.recorder is not None
    with cell.recorder:
        followed(cell)
        cell.robot.on_points = lambda _: []
        cell.until(lambda: cell.loop.mode is Mode.MOVING)
        cell.robot.on_points = seen
        with monkeypatch.context() as patch:  # as where the arm has yet to come to rest
            patch.setattr(Ticks, "told_to_rest", property(lambda _: False))
            for _ in range(40):
                cell.loop.cycle()
        assert cell.loop.mode is Mode.MOVING
        assert not cell.loop._ticks.catcher.result.scalars[0]["tracked"]
        cell.until(lambda: cell.loop.mode is Mode.CATCHING)
        for _ in range(20):
            cell.loop.cycle()
    rate = prepared.arm.limits.torque_rate
    assert rate is not None
    change = np.abs(np.diff([x.tau for x in told], axis=0)) / TICK
    assert np.all(change <= (1.0 + STAMPS) * prepared.arm.active(rate))
    assert any(name.startswith("torques") for x in Recorded(file).calls.values() for name in x)
    assert replay(Recorded(file)).identical


@pytest.mark.parametrize("target", ["belt", "hand"])
def test_what_keeps_people_safe_acts_in_a_cell(target: str) -> None:
    """The tool's speed; giving up what the arm is kept from; a person is followed gently."""
    raw = read_toml(shipped_path("cells", NAME))
    belt = {"belt": raw["task"]["belt"]} if target == "belt" else {}
    task = {key: x for key, x in raw["task"].items() if key not in ("belt", "area")}
    prepared = prepare(
        cell_of(raw | {"task": task | belt | {"target": target, "tool_speed": 0.2}}, place="a cell")
    )
    about = cell_about(prepared, cell_map(prepared))
    assert about.settings.adapt_q < inf
    assert isinstance(about.made_of, Meeting)
    assert about.made_of.settings.speed == 0.2
    assert (about.made_of.settings.gentle > 0.0) == (target == "hand")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"put": [3.0, 0.0, 0.0]}, "task.put"),
        ({"belt": None}, "the belt that brings the parts"),
        ({"gripper_delay": 9.0}, "gripper_delay"),
        ({"area": {"low": [0.5, 0.2, 0.0], "high": [0.7, -0.2, 0.2]}}, "low below high"),
    ],
)
def test_what_a_task_cannot_be_is_refused(change: dict[str, object], said: str) -> None:
    """A place out of reach, a belt that is missing, a gripper that is too slow."""
    raw = read_toml(shipped_path("cells", NAME))
    task = {key: x for key, x in (raw["task"] | change).items() if x is not None}
    with pytest.raises((InputError, FileError), match=said):
        prepare(cell_of(raw | {"task": task}, place="a cell"))


#: Least and largest values that the file of a cell may say, by the address of the key.
EXTREMES = {
    "task.mass": (0.001, 50.0),
    "task.sides.0": (0.005, 0.5),
    "task.sides.2": (0.005, 0.5),
    "task.belt.height": (-5.0, 5.0),
    "task.belt.width": (0.0201, 10.0),
    "task.belt.length": (0.2, 100.0),
    "task.belt.direction": (-7.0, 7.0),
    "ball.mass": (0.001, 2.0),
    "ball.radius": (0.005, 0.06),
    "ball.drag": (0.0, 1.0),
    "source.sigma": (1e-6, 0.1),
}


@pytest.mark.parametrize("key", EXTREMES)
def test_what_the_file_of_a_cell_may_say_its_world_may_be(key: str) -> None:
    """No value that its schema takes is refused by that of a scene, which has other keys."""
    for value in EXTREMES[key]:
        raw: Any = json.loads(json.dumps(read_toml(shipped_path("cells", NAME))))
        raw.setdefault("ball", {})
        *tables, last = key.split(".")
        at = raw
        for part in tables:
            at = at[part]
        at[int(last) if last.isdigit() else last] = value
        cell = cell_of(raw, place="a cell")
        assert cell.task is not None
        scene = scene_of_cell(cell, None)
        assert scene.ball.mass == cell.task.mass
        alone = scene_of_cell(cell.model_copy(update={"task": None}), None)
        assert alone.ball.mass == cell.ball.mass


def test_what_a_scene_refuses_is_told_by_the_key_of_the_file() -> None:
    """Whatever the scene calls it."""
    raw = read_toml(shipped_path("cells", NAME))
    cell = cell_of(raw, place="a cell")
    assert cell.task is not None
    heavy = cell.model_copy(update={"task": cell.task.model_copy(update={"mass": 80.0})})
    with pytest.raises(InputError, match=rf"^{NAME} key task\.mass: wanted .*50, got 80"):
        scene_of_cell(heavy, None)
    with (
        pytest.raises(InputError, match=r"a file key belt\.width"),
        in_words_of("a file", Belt="belt"),
    ):
        Belt(width=0.0)
    with pytest.raises(InputError, match=r"^Tray\.side"), in_words_of("a file", Belt="belt"):
        Tray(side=0.0)


def test_a_ball_that_is_thrown_is_no_heavier_than_2_kg() -> None:
    """A part with sides may be."""
    assert Ball(sides=(0.1, 0.1, 0.1), mass=20.0).mass == 20.0
    with pytest.raises(InputError, match="2 kg, or the sides of a part"):
        Ball(mass=3.0)
