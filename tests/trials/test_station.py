"""Where an arm meets things: all over its work area it can; what it cannot it does not begin."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from support import thorough

from mitt.core.arm.description import Capsule
from mitt.core.arm.shapes import MARGIN, Surroundings, clearance, shapes_of
from mitt.core.arm.tools import TOOLS
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.catcher.meeting import Meeting
from mitt.core.errors import InputError, ModelError
from mitt.core.signals import TICK, ArmState, Array, Senses, Sighting
from mitt.core.verdict.feasibility import Outcome
from mitt.lab.trials.meeting import MeetRunner
from mitt.lab.trials.station import PARTS_SCENE, Station, Target, check_seen_in_time, station
from mitt.lab.world.scene import Belt, Scene, named_scene, scene_of

#: Ticks from one sighting to the next, and time for which a hand is looked at [s].
SEEN_EVERY = 16
LOOKED_AT = 1.0


@cache
def station_of(arm: str, tool: str, target: Target) -> Station:
    """Return a station whose tool is slow near a person."""
    speed = 0.25 if target == "hand" else np.inf
    return station(arm, TOOLS[tool], target, named_scene("lab"), speed=speed)


@pytest.mark.parametrize(
    ("latency", "speed", "encoder", "refused"),
    [
        (300, 0.3, False, False),
        (150, 1.0, False, True),
        (300, 1.0, True, False),
    ],
)
def test_what_is_seen_too_late_for_its_belt_is_refused_before_the_arm_moves(
    latency: int, speed: float, encoder: bool, refused: bool
) -> None:
    """With the number, and what to do; with the belt's encoder it is in time."""
    at = station_of("ur5e", "suction", "belt")
    sensing: dict[str, Any] = {
        "latency": latency,
        "frame_rate": 60.0,
        "belt": {} if encoder else None,
    }
    scene = scene_of({"base": "lab", "sensing": sensing}, place="scene")
    at = replace(at, scene=scene.model_copy(update={"belt": at.scene.belt}))
    if refused:
        with pytest.raises(InputError, match=r"at most 118 ms old.*got 167 ms.*encoder"):
            check_seen_in_time(at, speed)
    else:
        check_seen_in_time(at, speed)


def test_a_belt_out_of_reach_says_what_else_to_try() -> None:
    scene = named_scene("lab").model_copy(update={"belt": Belt(middle=(9.0, 0.0), height=0.3)})
    with pytest.raises(
        ModelError, match=r"no pose that brings the tool there.*; name other joints.*\[belt\]"
    ):
        station("ur5e", TOOLS["suction"], "belt", scene)


@pytest.mark.parametrize(
    ("arm", "tool", "target"),
    thorough(
        [("ur5e", "jaw", "hand"), ("franka-panda", "suction", "belt")],
        [
            ("franka-fr3", "jaw", "hand"),
            ("franka-panda", "jaw", "hand"),
            ("kinova-gen3", "suction", "belt"),
            ("kuka-iiwa7", "jaw", "hand"),
        ],
    ),
)
def test_wherever_a_thing_is_met_the_arm_is_clear_and_not_singular(
    arm: str, tool: str, target: Target
) -> None:
    """Anywhere in the work area, and above: in the range, and no joint turns fast for the tool."""
    at, rng = station_of(arm, tool, target), np.random.default_rng(0)
    a, low, high = at.arm, np.array(at.settings.low), np.array(at.settings.high)
    shapes = shapes_of(a, Surroundings(floor=at.scene.floor))
    along = np.zeros(3) if at.settings.along is None else np.abs(at.settings.along)
    for _ in range(200):
        place = rng.uniform(low + 0.02 * (1.0 - along), high - 0.02 * (1.0 - along))
        place -= rng.uniform(0.0, at.settings.above) * at.map.frame[:, 2]
        speed = rng.standard_normal(3)
        speed /= np.linalg.norm(speed)
        inside, (q, dq, _) = at.map.virtual(np.array([place, speed, np.zeros(3)]))
        assert inside
        assert np.all((q > a.q_min) & (q < a.q_max))
        assert np.abs(dq).max() < 12.0
        assert clearance(a.bodies, q, shapes.table, shapes.pairs, shapes.ends) > MARGIN


@pytest.mark.parametrize("direction", thorough([0.75 * np.pi], [0.0]))
def test_the_work_area_goes_along_the_belt_wherever_it_leads(direction: float) -> None:
    """For at least 0.3 m, all of it in reach; a part that comes along is met and put away."""
    belt = Belt(middle=(0.55, 0.0), direction=direction)
    scene = PARTS_SCENE.model_copy(update={"belt": belt})
    at = station("ur5e", TOOLS["suction"], "belt", scene)
    low, high = np.array(at.settings.low), np.array(at.settings.high)
    steps = np.linspace(-0.4, 0.4, 81)
    on = [
        x
        for x in (at.place + step * belt.along for step in steps)
        if np.all((x >= low) & (x <= high))
    ]
    assert len(on) > 30
    for place in on:
        inside, (q, _, _) = at.map.virtual(np.array([place, 0.3 * belt.along, np.zeros(3)]))
        assert inside
        assert np.all((q > at.arm.q_min) & (q < at.arm.q_max))
    trial = MeetRunner(at, seed=1, speed=0.3).trial(0)
    assert (trial.status, trial.placed, trial.limit_violations) == ("met", True, 0)


def test_a_part_that_stops_before_it_is_in_reach_leads_no_arm_out_of_it() -> None:
    """On a belt that comes straight at the arm; the way began because the part was coming."""
    stops = Scene.model_validate({"faults": [{"kind": "belt", "magnitude": 0.0, "start": 0.6}]})
    belt = Belt(middle=(0.6, 0.0), direction=np.pi)
    scene = PARTS_SCENE.model_copy(update={"belt": belt, "faults": stops.faults})
    at = station("ur5e", TOOLS["suction"], "belt", scene)
    trial = MeetRunner(at, seed=0, speed=0.3).trial(0)
    assert (trial.status, trial.binding_limit) == ("missed", "domain")
    assert trial.limit_violations == 0
    assert trial.at_rest


def test_what_is_given_up_while_the_tool_closes_is_let_go() -> None:
    """A thing that is pulled away from a slow jaw: the jaw opens again, and the arm brakes."""
    at = station("ur5e", replace(TOOLS["jaw"], delay=1.0), "hand", named_scene("lab"))
    catcher, place, told = offered(at, at.place), at.place.copy(), list[float]()
    first = round(catcher.result.scalars[0]["t"] / TICK) + 1
    for k in range(first, first + 6000):
        q, dq = catcher.result.command[:2].copy()
        if told and told[-1] > 0.0:
            place = place + np.array([TICK * 0.6, 0.0, 0.0])
        point = Sighting(t=k * TICK, found=True, r_o=place, covariance=1e-6 * np.eye(3))
        arm = ArmState(t=k * TICK, q=q, dq=dq)
        points = () if k % SEEN_EVERY else (point,)
        told.append(catcher.step(Senses(t=k * TICK, arm=arm, points=points)).hand)
        catcher.think()
        if catcher.phase is Phase.BRAKE:
            break
    assert max(told) > 0.0
    assert told[-1] == 0.0
    assert catcher.phase is Phase.BRAKE
    assert catcher.verdict is not None
    assert catcher.verdict.binding_limit in ("tool", "taken", "area")


def offered(at: Station, r_o: Array, zones: tuple[Capsule, ...] = ()) -> Catcher:
    """Return the catcher of an arm that rests and is offered a thing in a place, among zones."""
    settings = at.catcher
    settings = replace(settings, around=replace(settings.around, zones=zones))
    catcher = Catcher(at.arm, Meeting(at.map, at.settings), settings=settings)
    q = at.arm.q_ready
    for k in range(round(LOOKED_AT / TICK)):
        point = Sighting(t=k * TICK, found=True, r_o=r_o, covariance=1e-6 * np.eye(3))
        arm = ArmState(t=k * TICK, q=q, dq=0.0 * q)
        points = () if k % SEEN_EVERY else (point,)
        catcher.step(Senses(t=k * TICK, arm=arm, points=points))
        catcher.think()
        if catcher.phase is not Phase.WATCH:
            break
    return catcher


def test_an_arm_does_not_begin_a_way_on_which_its_safety_filter_would_stop_it() -> None:
    """A zone about what is offered is named before the arm moves; without it the arm goes."""
    at = station_of("ur5e", "jaw", "hand")
    free = offered(at, at.place)
    assert free.phase is Phase.FOLLOW
    x, y, z = at.place.tolist()
    zone = Capsule(start=(x, y, z), end=(x, y, z), radius=0.02)
    refused = offered(at, at.place, (zone,))
    assert refused.phase is Phase.WATCH
    assert refused.verdict is not None
    assert refused.verdict.outcome is Outcome.UNSETTLED
    assert refused.verdict.binding_limit == "clearance"
