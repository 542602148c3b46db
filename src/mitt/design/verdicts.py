"""What the catcher would say of balls, and how they come in, without a simulated throw.

| here        | meaning                                                       | unit  | shape |
|-------------|---------------------------------------------------------------|-------|-------|
| ``share``   | share of the limit that binds; up to 1 the arm can follow     | 1     | (B,)  |
| ``speed``   | relative speed of ball and catch point at the catch           | m/s   | (B,)  |
| ``angle``   | between the way the ball comes in and the palm's normal       | rad   | (B,)  |
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitt.catcher.settings import CatcherSettings
from mitt.generator.demand import Tolerance
from mitt.generator.feasibility import Approach, judge
from mitt.generator.mapping import DirectMap
from mitt.holding import CaughtBall
from mitt.impact import examined, speed_caps
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState

#: Share of each limit from which the arm's answer is worked out tick by tick: all of it. A map that
#: keeps the limits is to be told from one that the arm can only just follow.
_STRICT = Tolerance(torque=1.0, speed=1.0, acceleration=1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdicts:
    """Verdicts on a set of balls; see the module's table.

    Attributes:
        share: Infinite where the ball does not come to the map's region, as the next two.
        speed: With joints no faster than limits, impact and brake allow.
        angle: Of that velocity.
        binding: Name of the limit that binds, ball by ball.
    """

    share: Array
    speed: Array
    angle: Array
    binding: tuple[str, ...]

    @property
    def binds(self) -> str:
        """The limit that binds most often."""
        return Counter(self.binding).most_common(1)[0][0]


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
    q = f.arm.q_ready
    said = [
        examined(driven, judge(f, ball, q, tolerance=_STRICT), settings.caught,
                 bandwidth=settings.bandwidth)
        for ball in balls
    ]  # fmt: skip
    ends = [_end(driven, v.approach, settings.caught) for v in said]
    return Verdicts(
        share=np.array([v.share for v in said]),
        speed=np.array([speed for speed, _ in ends]),
        angle=np.array([angle for _, angle in ends]),
        binding=tuple(v.binding_limit for v in said),
    )


def _end(arm: Arm, approach: Approach | None, ball: CaughtBall) -> tuple[float, float]:
    """Return relative speed [m/s] and angle off the palm's normal [rad] at the catch.

    A map may ask for more speed than the joints have; the hand is then a little late, and the ball
    meets it faster than the map asks for.
    """
    if approach is None:
        return np.inf, np.inf
    q, dq = approach.motion[-1, :2]
    cap = speed_caps(arm, approach, ball)
    relative = approach.dr_o - arm.jacobian(q) @ np.clip(dq, -cap, cap)
    speed = float(np.linalg.norm(relative))
    normal = arm.orientation(q)[:, 2]
    cosine = float(np.clip(-relative @ normal / max(speed, 1e-9), -1.0, 1.0))
    return speed, float(np.arccos(cosine))
