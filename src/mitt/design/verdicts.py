"""What the catcher would say of flights, and how their balls come in, without a throw.

| here        | meaning                                                       | unit  | shape |
|-------------|---------------------------------------------------------------|-------|-------|
| ``share``   | share of the limit that binds; up to 1 the arm can follow     | 1     | (F,)  |
| ``speed``   | relative speed of ball and catch point at the catch           | m/s   | (F,)  |
| ``angle``   | between the way the ball comes in and the palm's normal       | rad   | (F,)  |
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitt.catcher.settings import CatcherSettings
from mitt.generator.demand import Tolerance
from mitt.generator.feasibility import Approach, judge
from mitt.generator.flights import Flight
from mitt.generator.mapping import DirectMap
from mitt.impact import examined
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState

#: Share of each limit from which the arm's answer is worked out tick by tick: all of it. A map that
#: keeps the limits is to be told from one that the arm can only just follow.
_STRICT = Tolerance(torque=1.0, speed=1.0, acceleration=1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdicts:
    """Verdicts on a set of flights; see the module's table.

    Attributes:
        share: Infinite where the flight leaves the domain, as the next two.
        speed: Of a hand that is where the map wants it.
        angle: Of that hand.
        binding: Name of the limit that binds, flight by flight.
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
    f: DirectMap, flights: Sequence[Flight], driven: Arm, settings: CatcherSettings
) -> Verdicts:
    """Return the verdicts on flights, each begun from the ready pose at rest.

    Args:
        f: A learned map.
        flights: The flights.
        driven: Its arm as the catcher drives it.
        settings: What the catcher knows.
    """
    drag, q = settings.flight.drag_mean, f.arm.q_ready
    balls = [BallState(t=0.0, r_o=x.ball[0, 0], dr_o=x.ball[0, 1], drag=drag) for x in flights]
    said = [
        examined(driven, judge(f, ball, q, tolerance=_STRICT), settings.caught,
                 bandwidth=settings.bandwidth)
        for ball in balls
    ]  # fmt: skip
    ends = [_end(driven, v.approach) for v in said]
    return Verdicts(
        share=np.array([v.share for v in said]),
        speed=np.array([speed for speed, _ in ends]),
        angle=np.array([angle for _, angle in ends]),
        binding=tuple(v.binding_limit for v in said),
    )


def _end(arm: Arm, approach: Approach | None) -> tuple[float, float]:
    """Return relative speed [m/s] and angle off the palm's normal [rad] at the catch."""
    if approach is None:
        return np.inf, np.inf
    q, dq = approach.motion[-1, :2]
    relative = approach.dr_o - arm.jacobian(q) @ dq
    speed = float(np.linalg.norm(relative))
    normal = arm.orientation(q)[:, 2]
    cosine = float(np.clip(-relative @ normal / max(speed, 1e-9), -1.0, 1.0))
    return speed, float(np.arccos(cosine))
