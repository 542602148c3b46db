"""What the catcher would say of balls, and how they come in, without a simulated throw.

| here        | meaning                                                       | unit  | shape |
|-------------|---------------------------------------------------------------|-------|-------|
| ``share``   | share of the limit that binds; up to 1 the arm can follow     | 1     | (B,)  |
| ``speed``   | relative speed of ball and catch point at the catch           | m/s   | (B,)  |
| ``angle``   | between the way the ball comes in and the palm's normal       | rad   | (B,)  |
| ``place``   | where hand and ball meet                                      | m     | (B, 3) |
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitt.ball.flight import advance
from mitt.catcher.settings import CatcherSettings
from mitt.design.task import Task
from mitt.generator.demand import Tolerance
from mitt.generator.feasibility import Approach, Verdict, judge
from mitt.generator.mapping import DirectMap
from mitt.holding import CaughtBall
from mitt.impact import examined, relative_velocity, speed_caps
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState
from mitt.world.flights import CATCH_FRACTION, PlacedFlight
from mitt.world.throws import Throw

#: Share of each limit from which the arm's answer is worked out tick by tick: all of it. A map that
#: keeps the limits is to be told from one that the arm can only just follow.
_STRICT = Tolerance(torque=1.0, speed=1.0, acceleration=1.0)


#: Time after its release at which the arm starts [s]; of a recorded ball, time before it passes the
#: catch point.
START, _BEFORE = 0.05, 0.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdicts:
    """Verdicts on a set of balls; see the module's table.

    Attributes:
        share: Infinite where the ball does not come to the map's region; so are ``speed``,
            ``angle`` and ``place``, also where the map asks for no motion that an arm could make.
        speed: With joints no faster than limits, impact and brake allow.
        angle: Of that relative velocity, off the palm's normal.
        place: The catch point where the map brings it.
        binding: Name of the limit that binds, ball by ball.
    """

    share: Array
    speed: Array
    angle: Array
    place: Array
    binding: tuple[str, ...]

    @property
    def binds(self) -> str:
        """The limit that binds most often."""
        return Counter(self.binding).most_common(1)[0][0]


def balls_of(f: DirectMap, task: Task, *, count: int, seed: int) -> list[BallState]:
    """Return balls of a task as they are when the arm starts.

    Args:
        f: The map at which they are thrown.
        task: What is thrown.
        count: How many at most; a user's balls once each.
        seed: Seed of what is drawn.
    """
    source = task.source(f, throws=count, seed=seed)
    own = len(source.throws or source.recordings)
    drag = task.scene.ball.drag
    return [_started(source.ball(k), drag) for k in range(min(count, own or count))]


def _started(ball: Throw | PlacedFlight, drag: float) -> BallState:
    """Return a ball as it is when the arm starts.

    A recorded one may bounce: it comes as it would without a bounce to where it is to be caught.
    """
    if isinstance(ball, Throw):
        r, dr, since = ball.r, ball.dr, START
    else:
        (r, dr), since = ball.at(CATCH_FRACTION * ball.duration), -_BEFORE
    r, dr = r.copy(), dr.copy()
    advance(r, dr, drag, since)
    return BallState(t=0.0, r_o=r, dr_o=dr, drag=drag)


def verdicts(
    f: DirectMap, balls: Sequence[BallState], driven: Arm, settings: CatcherSettings
) -> Verdicts:
    """Return the verdicts on balls, the arm at rest in its ready pose.

    Args:
        f: A learned map.
        balls: The balls, as they are when the arm starts.
        driven: Its arm as the catcher drives it.
        settings: What the catcher knows.
    """
    q, caught = f.arm.q_ready, settings.caught
    said, ends = list[Verdict](), list[_End]()
    for ball in balls:
        verdict = judge(f, ball, q, tolerance=_STRICT)
        said.append(examined(driven, verdict, caught, bandwidth=settings.bandwidth))
        ends.append(_end(driven, verdict.approach, caught))
    return Verdicts(
        share=np.array([v.share for v in said]),
        speed=np.array([end.speed for end in ends]),
        angle=np.array([end.angle for end in ends]),
        place=np.array([end.place for end in ends]).reshape(-1, 3),
        binding=tuple(v.binding_limit for v in said),
    )


class _End(NamedTuple):
    """How a ball is met; see :class:`Verdicts`."""

    speed: float
    angle: float
    place: Array


def _end(arm: Arm, approach: Approach | None, ball: CaughtBall) -> _End:
    """Return how a ball is met.

    A map may ask for more speed than the joints have; the hand is then a little late, and the ball
    meets it faster than the map asks for.
    """
    if approach is None or not _possible(arm, approach.motion):
        return _End(np.inf, np.inf, np.full(3, np.inf))
    q = approach.motion[-1, 0]
    relative = relative_velocity(arm, approach, speed_caps(arm, approach, ball))
    speed = float(np.linalg.norm(relative))
    normal = arm.orientation(q)[:, 2]
    cosine = float(np.clip(-relative @ normal / max(speed, 1e-9), -1.0, 1.0))
    return _End(speed, float(np.arccos(cosine)), arm.position(q))


def _possible(arm: Arm, motion: Array) -> bool:
    """Say whether a motion is finite and ends in the joints' ranges, so that it can be braked."""
    q = motion[-1, 0]
    return bool(np.all(np.isfinite(motion)) and np.all((q >= arm.q_min) & (q <= arm.q_max)))
