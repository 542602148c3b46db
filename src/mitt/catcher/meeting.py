"""Meeting what moves within reach, as a generator: the map whose distance to go is a clock.

The catcher asks it as it asks any generator. Its verdict chooses the time of the meeting: the
shortest that keeps every limit, by the motion that the target is believed to go on with. From the
start on nothing rests on that belief: the tool follows where the target *is*
(:mod:`mitt.map.meeting`).

The tool comes to a place ``above`` the target first, and goes down on it along its own axis in the
last part of the time: so it does not touch it from the side. From the meeting on it stays with the
target while the tool closes, which may take long; that is when the catch is over for the catcher,
whose ``time_to_catch`` counts to the end of the closing.
"""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Annotated, final

import numpy as np

from mitt.arm.arm import Arm
from mitt.catcher.generators import Generator
from mitt.fields import Range, brief, check
from mitt.map.demand import Tolerance, shares_of
from mitt.map.meeting import MeetingMap
from mitt.map.prediction import flown, spread
from mitt.signals import TICK, Array, BallState, JointReference, MapStatus
from mitt.verdict.feasibility import Approach, Outcome, Verdict

#: Instants at which a motion is held against its limits.
_INSTANTS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetingSettings:
    """Where and how a target is met.

    Attributes:
        low: Lowest corner of the work area, where a target may be met [m], shape (3,).
        high: Its highest corner [m], shape (3,).
        above: How far before the target, against the tool's axis, the tool is when its way down
            begins [m].
        down: Time of the way down [s].
        settle: Time from the meeting until the tool begins to close [s].
        closing: Time that it takes [s]; with ``settle``, the window in which the tool stays with
            the target.
        shortest: Shortest time from start to meeting [s].
        longest: Longest time that is tried [s].
        speed: Largest speed of the tool on its way, relative to the base [m/s]; infinite for none.
    """

    low: tuple[float, float, float] = (-2.0, -2.0, -2.0)
    high: tuple[float, float, float] = (2.0, 2.0, 2.0)
    above: Annotated[float, Range(0.0, 1.0)] = 0.0
    down: Annotated[float, Range(0.02, 5.0)] = 0.25
    settle: Annotated[float, Range(0.0, 5.0)] = 0.0
    closing: Annotated[float, Range(0.0, 5.0)] = 0.02
    shortest: Annotated[float, Range(0.05, 10.0)] = 0.3
    longest: Annotated[float, Range(0.05, 10.0)] = 3.0
    speed: Annotated[float, Range(1e-3, inf)] = inf

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        check(self)

    @property
    def window(self) -> float:
        """How long the tool stays with the target [s]."""
        return self.settle + self.closing


@final
class Glide:
    """The target as the tool follows it: an estimate jumps with each sighting, a tool cannot.

    What an estimate has jumped by is closed as by a critically damped spring; a motion that is
    estimated rightly is followed without a lag.
    """

    def __init__(self, rate: float) -> None:
        """Begin nowhere; ``rate`` is the spring's angular frequency [rad/s]."""
        self._rate, self._t, self._motion = rate, inf, np.zeros((3, 3))

    def to(self, ball: BallState) -> Array:
        """Return r_o, dr_o, ddr_o of the followed target at the time of an estimate, (3, 3)."""
        given, w = np.array([ball.r_o, ball.dr_o, ball.ddr_o]), self._rate
        if not 0.0 <= ball.t - self._t < 0.1:
            self._t, self._motion = ball.t, given
        while ball.t - self._t > 0.5 * TICK:
            r, dr, ddr = self._motion
            at = given[0] - (ball.t - self._t) * given[1]
            ddr = given[2] + 2.0 * w * (given[1] - dr) + w * w * (at - r)
            self._motion = np.array([r + TICK * dr + 0.5 * TICK**2 * ddr, dr + TICK * ddr, ddr])
            self._t += TICK
        return self._motion


@final
@dataclass(frozen=True, slots=True)
class Meeting(Generator):
    """The meeting map as a generator.

    Attributes:
        map: The map; while a target is followed, adapted to it.
        settings: Where and how targets are met.
        tolerance: Share of each limit at which a target is refused.
        start: Time at which the arm started [s]; infinite before.
        after: Time from there to the meeting [s].
        glide: The target as it is followed.
    """

    map: MeetingMap
    settings: MeetingSettings = field(default_factory=MeetingSettings)
    tolerance: Tolerance = field(
        default_factory=lambda: Tolerance(torque=0.8, speed=0.9, acceleration=0.7)
    )
    start: float = inf
    after: float = inf
    glide: Glide = field(default_factory=lambda: Glide(30.0))

    __repr__ = brief

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that the map was made for."""
        return (self.map.arm,)

    def sharpness(self, ball: BallState) -> float:
        """Return the 1-sigma of the target's position now: nothing rests on a forecast [m]."""
        return spread(ball, 0.0)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Return the verdict: the shortest time within the work area and all limits.

        What is under way is not refused any more: the catcher's commands keep the limits.
        """
        if self.start < inf:
            return Verdict(outcome=Outcome.FEASIBLE, binding_limit="", share=0.0,
                           t_catch=self.start + self.after, sigma=spread(ball, 0.0))  # fmt: skip
        return self._planned(ball, q, np.zeros(len(q)))[0]

    def horizon(self) -> float:
        """Return the longest time to a meeting [s]."""
        return self.settings.longest

    def _planned(self, ball: BallState, q: Array, dq: Array) -> tuple[Verdict, float]:
        """Return the verdict for an arm in ``q`` that moves at ``dq``, and the time to meet."""
        s, best, why = self.settings, np.inf, "domain"
        said = Verdict(outcome=Outcome.UNSETTLED, binding_limit="domain", share=np.inf,
                       t_catch=np.inf, sigma=np.inf)  # fmt: skip
        for T in np.geomspace(s.shortest, s.longest, 12).tolist():
            ends = flown(ball, np.array([T, T + s.window]))[:, 0]
            if not np.all((ends >= s.low) & (ends <= s.high)):
                why = "area"
                continue
            tried = self._tried(ball, np.array([q, dq, 0.0 * q]), T)
            if tried is None:
                continue
            motion, dr_o = tried
            shares = shares_of(self.map.arm, motion, self.tolerance)
            if np.isfinite(s.speed):
                shares["tool"] = self._tool_speed(motion) / s.speed
            binding = max(shares, key=lambda name: shares[name])
            if shares[binding] < best:
                best, why = shares[binding], binding
                ok = best <= 1.0
                said = Verdict(
                    outcome=Outcome.FEASIBLE if ok else Outcome.UNSETTLED, binding_limit=why,
                    share=best, t_catch=ball.t + T, sigma=spread(ball, 0.0),
                    approach=Approach(motion=motion, step=T / (_INSTANTS - 1), dr_o=dr_o),
                )  # fmt: skip
                if ok:
                    return said, T
        return (said if np.isfinite(best) else replace(said, binding_limit=why)), inf

    def _tried(self, ball: BallState, state: Array, T: float) -> tuple[Array, Array] | None:
        """Return the motion to a meeting after a time, and the target's velocity then.

        None where the target, or the tool on its way, leaves the domain.
        """
        times = np.linspace(0.0, T, _INSTANTS)
        path = flown(ball, times)
        targets = [self.placed(target, T - t) for target, t in zip(path, times, strict=True)]
        f = self.map.adapt(targets[0], state, self.approach(T))
        if f is None:
            return None
        motion = []
        for target, t in zip(targets, times, strict=True):
            rows = f.motion(target, self._clock(t, T), self.approach(T))
            if rows is None:
                return None
            motion.append(rows[:3])
        return np.array(motion), path[-1, 1]

    def _tool_speed(self, motion: Array) -> float:
        """Return the largest speed of the tool along a motion [m/s]."""
        arm = self.map.arm
        return max(float(np.linalg.norm(arm.jacobian(q) @ dq)) for q, dq, _ in motion)

    def approach(self, T: float) -> float:
        """Return the time from the start until the tool is above the target [s]."""
        return T - self.settings.down if self.settings.above > 0.0 else T

    def _clock(self, since: float, T: float) -> float:
        """Return s, the share of the time to go, so long after the start."""
        return max(1.0 - since / self.approach(T), 0.0)

    def placed(self, target: Array, left: float) -> Array:
        """Return the target with the tool's way down before it, so long before the meeting.

        Along the tool's axis, by a polynomial whose speed and acceleration vanish at both ends.
        """
        s = self.settings
        if s.above == 0.0 or left <= 0.0:
            return target
        x = min(left / s.down, 1.0)
        inside = 0.0 < x < 1.0
        height = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        rate = -30.0 * (x * (1.0 - x)) ** 2 / s.down if inside else 0.0
        bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / s.down**2 if inside else 0.0
        back = -s.above * self.map.frame[:, 2]
        return target + np.outer((height, rate, bend), back)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Meeting":
        """Start from where the arm is, eq. (12), to meet the target as soon as limits allow.

        Once under way the time of the meeting stays; shortly before it nothing changes any more.
        """
        fresh = self.start == inf
        after = self._planned(ball, q, dq)[1] if fresh else self.start + self.after - ball.t
        least = 0.1 + (self.settings.down if self.settings.above > 0.0 else 0.0)
        if not np.isfinite(after) or after < least:
            return self
        target = self.placed(self.glide.to(ball), after)
        f = self.map.adapt(target, np.array([q, dq, 0.0 * q]), self.approach(after))
        return self if f is None else replace(self, map=f, start=ball.t, after=after)

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map at the target as it is, and at the time to go."""
        since = ball.t - self.start
        target = self.placed(self.glide.to(ball), self.after - since)
        rows = self.map.motion(target, self._clock(since, self.after), self.approach(self.after))
        inside = rows is not None
        if rows is None:
            rows = np.zeros((6, self.map.arm.n))
            rows[0] = rows[3] = self.map.arm.q_ready
        left = self.after - since + self.settings.window
        return JointReference(
            t=ball.t, status=MapStatus.INSIDE if inside else MapStatus.DOMAIN, q_d=rows[0],
            dq_d=rows[1], ddq_d=rows[2], q_o=rows[3], dq_o=rows[4],
            time_to_catch=left if inside else inf,
        )  # fmt: skip
