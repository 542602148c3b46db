"""Rivals that meet what moves within reach: each gets there, by the same times and limits."""

from dataclasses import replace

import numpy as np
import pytest
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import TOOLS
from mitt.core.catcher.meeting import Meeting, MeetingSettings
from mitt.core.errors import InputError, UnknownNameError
from mitt.core.map.meeting import unlearned_meeting
from mitt.core.signals import TICK, BallState, MapStatus
from mitt.io.arm_file import load_arm
from mitt.lab.rivals.meeting import MEETERS, encoder_of, make_meeter
from mitt.lab.trials.meeting import MeetRunner
from mitt.lab.trials.station import Station, station
from mitt.lab.world.scene import scene_of

ALONG = np.array([0.0, 1.0, 0.0])
#: At the end of the way: what is left [m, m/s].
NEAR = 1e-3
SLOW = 1e-2


@pytest.fixture(scope="module")
def meeting() -> Meeting:
    """A map of a WAM of three joints."""
    arm = load_arm("wam")
    arm = Arm(replace(arm.model, q_ready=np.array([0.2, 0.5, 1.5])), arm.limits)
    f = unlearned_meeting(arm, (0, 1, 2))
    return Meeting(f, MeetingSettings(shortest=0.6, closing=0.3, along=(0.0, 1.0, 0.0)))


@pytest.fixture(scope="module")
def exact() -> Station:
    """A belt before a UR5e, seen exactly and at once."""
    scene = scene_of(
        {"sensing": {"latency": 0, "point_noise": 0.0, "frame_rate": 100.0}}, place="scene"
    )
    return station("ur5e", TOOLS["suction"], "belt", scene)


@pytest.mark.parametrize("name", MEETERS)
def test_the_tool_moves_as_the_target_at_the_end(name: str, meeting: Meeting) -> None:
    """Position and velocity, where the target goes on as it was foreseen."""
    arm, dr = meeting.map.arm, 0.15 * ALONG
    r = arm.position(arm.q_ready) + np.array([0.05, -0.1, 0.0])
    generator = make_meeter(name, meeting, rate=50.0)
    encoder, started = encoder_of(generator), False
    for t in (TICK * np.arange(1000)).tolist():
        if encoder is not None:
            encoder.read(t, 0.15 * t)
        ball = BallState(t=t, r_o=r + t * dr, dr_o=dr, ddr_o=np.zeros(3), led=True)
        if not started and t >= 0.02:
            generator, started = generator.adapt(ball, arm.q_ready, np.zeros(3)), True
        if started:
            answer = generator.reference(ball)
            assert answer.status is MapStatus.INSIDE
    assert answer.time_to_catch < meeting.settings.closing
    assert np.linalg.norm(arm.position(answer.q_d) - ball.r_o) < NEAR
    assert np.linalg.norm(arm.jacobian(answer.q_d) @ answer.dq_d - dr) < SLOW


@pytest.mark.parametrize(
    "name",
    thorough(
        ["line-compensated"],
        [x for x in MEETERS if x not in ("direct", "line", "line-compensated")],
    ),
)
def test_each_takes_a_part_from_a_belt_that_is_seen_exactly(name: str, exact: Station) -> None:
    """Within all limits; the map and a straight line do so in ``trials/test_meet_study.py``."""
    generator = exact.generator(name, rate=20.0)
    trial = MeetRunner(exact, seed=3, speed=0.3, generator=generator).trial(0)
    assert trial.status == "met"
    assert trial.position_error_mm is not None
    assert trial.position_error_mm < 5.0
    assert trial.limit_violations == 0


def test_a_rival_that_follows_an_encoder_needs_a_belt(meeting: Meeting) -> None:
    """And a rival needs a name that is known."""
    with pytest.raises(InputError, match="belt"):
        make_meeter("line", replace(meeting, settings=replace(meeting.settings, along=None)))
    with pytest.raises(UnknownNameError):
        make_meeter("another", meeting)
