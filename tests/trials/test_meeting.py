"""Trials of `mitt meet`: what is met is put away, and what goes wrong ends at rest."""

from functools import cache
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import thorough

from mitt.core.arm.tools import TOOLS
from mitt.io.recordings import Recorded, write_recording
from mitt.lab.trials.meeting import MeetRunner, MeetTrial
from mitt.lab.trials.replayed import replay
from mitt.lab.trials.station import Target, station
from mitt.lab.world.flights import RecordedFlight
from mitt.lab.world.scene import scene_of

#: Largest speed of a tool near a person [m/s].
NEAR = 0.25
SCENE = {"base": "lab", "sensing": {"latency": 30, "point_noise": 0.002, "frame_rate": 60.0}}


@cache
def runner_of(
    tool: str, target: Target, fault: str = "", arm: str = "ur5e", **keys: float
) -> MeetRunner:
    """Return a runner of trials, one fault in each of them at most."""
    faults = [{"kind": fault, **keys}] if fault else []
    scene = scene_of({**SCENE, "faults": faults}, place="scene")
    at = station(arm, TOOLS[tool], target, scene, speed=inf if target == "belt" else NEAR)
    return MeetRunner(at, seed=2, speed=0.3)


@pytest.mark.parametrize(
    ("arm", "tool", "target"),
    [
        pytest.param("ur5e", "suction", "hand", marks=pytest.mark.thorough),
        ("franka-panda", "suction", "belt"),  # whose torques have rates
        # whose tray is out of reach at the height of the hand
        pytest.param("franka-fr3", "jaw", "hand", marks=pytest.mark.thorough),
    ],
)
def test_what_is_met_is_put_away(arm: str, tool: str, target: Target, tmp_path: Path) -> None:
    """Held by contact, put on the tray, the arm back where it waits.

    Replayed to the bit: with each tool and at each target once.
    """
    runner = runner_of(tool, target, arm=arm)
    trial = runner.trial(0)
    assert (trial.status, trial.placed, trial.at_rest) == ("met", True, True)
    assert trial.limit_violations == 0
    assert trial.over_force is False
    assert (trial.hand_force_n is None) == (target == "belt")
    assert target == "belt" or trial.tool_speed_m_s <= 1.05 * NEAR
    course = runner.course
    assert course is not None
    assert course.t_met == trial.t_met_s
    assert trial.peak_contact_force_n == pytest.approx(course.force.max())
    if (tool, target) != ("suction", "hand"):
        write_recording(tmp_path / "trial.mcap", runner.recording(trial))
        assert replay(Recorded(tmp_path / "trial.mcap")).identical


#: Where the belt of a UR5e is where the scene says nothing [m], and how far its area goes along it,
#: where parts come from and where they go [m].
MIDDLE = (0.5527, 0.0)
HEIGHT = 0.0225
FROM = 0.4843
TO = 0.3737


@pytest.mark.parametrize("direction", [None, 1.57, -1.57])
def test_a_work_area_is_cut_where_the_belt_leads(direction: float | None) -> None:
    """Alone there, by what leaves the tool no way to lift the part."""
    belt = {"middle": MIDDLE, "height": HEIGHT, "direction": direction}
    scene = scene_of({**SCENE, **({} if direction is None else {"belt": belt})}, place="scene")
    at = station("ur5e", TOOLS["suction"], "belt", scene)
    assert at.place == pytest.approx([*MIDDLE, 0.0425], abs=1e-4)
    before, beyond = at.place - at.settings.low, at.settings.high - at.place
    along = np.sin(np.pi / 2 if direction is None else direction)
    sides = [TO if along < 0.0 else FROM, TO if along > 0.0 else FROM]
    assert before == pytest.approx([0.08, sides[0], 0.07], abs=1e-4)
    assert beyond == pytest.approx([0.08, sides[1], 0.07], abs=1e-4)


def test_a_part_that_is_not_in_step_when_it_leaves_is_not_taken() -> None:
    """A belt of 1.5 m/s, seen so that the tool comes late: given up, within all limits."""
    at = station("ur5e", TOOLS["suction"], "belt", scene_of(SCENE, place="scene"))
    trial = MeetRunner(at, seed=777001, speed=1.5).trial(1)
    assert trial.limit_violations == 0
    error = trial.position_error_mm
    assert trial.status != "met" or (error is not None and error < 10.0)
    assert trial.status == "met" or trial.binding_limit == "window"
    assert trial.at_rest


@pytest.mark.thorough
def test_a_recorded_thing_is_taken() -> None:
    """It comes as it was recorded, is held by the person until then, and put away."""
    t = np.linspace(0.0, 2.0, 121)
    x = np.clip(t / 1.5, 0.0, 1.0)
    way = 0.5 * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    r = np.array([1.0, 2.0, 0.5]) + np.outer(way, [0.6, -0.8, 0.1])
    scene = scene_of(SCENE, place="scene")
    at = station("ur5e", TOOLS["jaw"], "hand", scene)
    runner = MeetRunner(at, seed=2, speed=0.3, recordings=(RecordedFlight(name="a", t=t, r=r),))
    path = runner.target(0)
    ends = np.array([path.at(s)[0] for s in (0.0, 2.0)])
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(0.5 * np.hypot(1.0, 0.1), abs=2e-3)
    trial = runner.trial(0)
    assert (trial.status, trial.placed) == ("met", True)


FAULTS: list[dict[str, Any]] = [
    {"fault": "belt", "magnitude": -1.0, "start": 1.1},  # the arm is led to the end of its reach
    {"fault": "taken", "start": 0.6},
]
MORE: list[dict[str, Any]] = [
    {"fault": "belt", "magnitude": 0.0, "start": 0.9},
    {"fault": "dropout", "start": 0.9},
    {"fault": "turned", "start": 0.9},
]


@pytest.mark.parametrize(
    "fault", thorough(FAULTS, MORE), ids=lambda x: f"{x['fault']} {x.get('magnitude', '')}"
)
def test_what_goes_wrong_ends_at_rest(fault: dict[str, Any]) -> None:
    """Within all limits, nothing is crushed, and what was not met has a reason."""
    trial: MeetTrial = runner_of("suction", "belt", **fault).trial(0)
    assert trial.at_rest
    assert not trial.over_force
    assert trial.limit_violations == 0
    assert trial.status == "met" or trial.binding_limit
    if fault["fault"] == "dropout":
        assert trial.stopped_by is None


@pytest.mark.parametrize("encoder", thorough([True], [False]))
def test_a_part_that_the_tool_hides_is_taken(encoder: bool, tmp_path: Path) -> None:
    """By a camera above the belt, which does not see it in the last half second.

    Within 5 mm where the belt's encoder is read, its scale off by up to 1 %; replayed to the bit.
    """
    seen: dict[str, Any] = {**SCENE["sensing"], "viewpoint": "above"}  # type: ignore[dict-item]
    if encoder:
        seen["belt"] = {"scale": 0.01, "clock": 0.002}
    scene = scene_of({**SCENE, "sensing": seen}, place="scene")
    at = station("ur5e", TOOLS["suction"], "belt", scene)
    runner = MeetRunner(at, seed=5801, speed=0.3)
    trial = runner.trial(0)
    assert (trial.status, trial.placed, trial.limit_violations) == ("met", True, 0)
    if encoder:
        assert trial.position_error_mm is not None
        assert trial.position_error_mm < 5.0
        write_recording(tmp_path / "trial.mcap", runner.recording(trial))
        assert replay(Recorded(tmp_path / "trial.mcap")).identical
