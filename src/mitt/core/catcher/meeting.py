"""Meeting what moves within reach, as a generator: the map whose distance to go is a clock.

The catcher asks it as it asks any generator. Its verdict chooses the time of the meeting: the
shortest that keeps every limit, by the motion that the target is believed to go on with. From the
start on nothing rests on that belief: the tool follows where the target *is*
(:mod:`mitt.core.map.meeting`).

The tool comes to a place ``above`` the target first, and goes down on it along its own axis in the
last part of the time: so it does not touch it from the side. From the meeting on it stays with the
target while the tool closes, which may take long; that is when the catch is over for the catcher,
whose ``time_to_catch`` counts to the end of the closing. It closes in step or not at all: a target
that leaves the work area first is given up, and what is given up while the tool closes is let go.

Under way the tool keeps its largest ``speed``, whatever the target does: what its way does not take
of it is left to the followed target. What runs away, leaves the work area, falls or jumps is given
up, and the arm comes to rest.
"""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Annotated, NamedTuple, final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from mitt.core.arm.arm import Arm, tool_speeds
from mitt.core.catcher.generators import Generator, Memory
from mitt.core.catcher.glide import Glide
from mitt.core.control.envelope import bounds_of
from mitt.core.errors import InputError
from mitt.core.fields import Range, Settings, brief
from mitt.core.map.demand import Tolerance, shares_of, uniform
from mitt.core.map.meeting import MeetingMap, interpolate_motion
from mitt.core.map.polynomial import CatchBasis
from mitt.core.map.prediction import flown, spread
from mitt.core.signals import TICK, Array, BallState, JointReference, MapStatus, reference_of
from mitt.core.verdict.feasibility import Approach, Outcome, Verdict
from mitt.core.verdict.pieces import Pieces

#: Times that are tried, and instants at which a motion is held against its limits.
_TIMES = 24
_INSTANTS = 24
#: A target out of reach at the start is met where its way to the meeting is shorter [m], where it
#: would be in the work area then at the first share of its speed, and reached by then at the
#: second; instants looked at. It is given up where the tool would leave its reach within so long.
_COMES = 0.8
_SLOWER = 0.8
_SLOWEST = 0.6
_LOOKS = 8
_LED = 0.15
#: Halvings of the times between the longest and the shortest.
_HALVINGS = 3
#: Least time from one verdict to the next with nothing to meet [s].
_PAUSE = 0.0075
#: Times in which the tool lifts what it has grasped and comes to rest [s].
_LEAVES = (0.2, 0.3, 0.4, 0.6, 0.9, 1.4, 2.0)
#: Times in which it comes to rest straight on [s], and the shares of the limits that this may take.
_STOPS = (0.05, 0.07, 0.1, 0.2, 0.4)
_HARD = replace(uniform(0.9), speed=1.0)
#: Share of ``above`` by which it then lifts a part off its belt all the same.
_HOP = 0.25
#: Least time from the start until the way down begins [s].
_LEAST = 0.1
#: Jump of an estimate that is to be closed within the arm's jerks [m].
_JUMP = 0.01
#: Tool and estimate are in step if no farther apart [m, m/s].
_NEAR = 0.003
_SLOW = 0.035
#: How long they are so at least before the tool closes [s]: the command goes a delay before.
_FIRM = 0.02
#: A target is given up that is so far from where it is followed [m], that moves across its belt so
#: fast, or along the tool's axis away from it, as what falls [m/s].
_ASTRAY = 0.1
_STRAYS = 0.25
_FALLS = 0.6
#: How far it may be from there before the way down of a slow tool begins [m].
_AHEAD = 0.25
#: Speed of a belt that rests, for how fast it may start unseen [m/s], and acceleration of a hand
#: [m/s^2]; the multiple of its 1-sigma as seen from which a place counts as hidden, and the least
#: 1-sigma [m].
_CREEPS = 0.1
_PUSHED = 1.5
_HIDDEN = 3.0
_NOTICED = 0.01
#: How far outside the work area, and how fast outwards, a target is given up [m, m/s].
_OUTSIDE = 0.03
_OUTWARDS = 0.1
#: Share of the tool's largest speed that is used, and at which what is followed is given up; how
#: much faster than planned the way may be, and how long what is followed lags [s].
_USED = 0.97
_OVER = 1.03
_ROUGH = 1.1
_LAG = 0.4


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class MeetingSettings(Settings):
    """Where and how a target is met.

    Attributes:
        low: Lowest corner of the work area, where a target may be met [m], shape (3,).
        high: Its highest corner [m], shape (3,).
        above: How far before the target, against the tool's axis, the tool is when its way down
            begins [m].
        down: Time of the way down [s].
        settle: Time from the meeting until the tool begins to close [s].
        closing: Time that it takes [s]: the tool stays with the target until then.
        shortest: Shortest time from start to meeting [s].
        longest: Longest time that is tried [s].
        speed: Largest speed of the tool on its way, relative to the base [m/s]; infinite for none.
        along: Direction of the belt that carries targets, a unit vector; None without one.
        gentle: Rate at which the tool closes up to the target from the meeting on [1/s], where tool
            and what holds the target push each other; 0 where it does as before.
        varies: 1-sigma of a belt's speed some time on, as share of its speed now: by it a part is
            known that is hidden.
        unsure: 1-sigma of the target's place from which it is given up [m]; along its belt, where
            it is on one.
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
    along: tuple[float, float, float] | None = None
    gentle: Annotated[float, Range(0.0, 40.0)] = 0.0
    varies: Annotated[float, Range(0.0, 1.0)] = 0.17
    unsure: Annotated[float, Range(1e-3, inf)] = 0.05

    @property
    def window(self) -> float:
        """How long the tool stays with the target [s]."""
        return self.settle + self.closing

    @property
    def descent(self) -> float:
        """How long before the meeting the tool is above the target [s]."""
        return self.down if self.above > 0.0 else 0.0


def _rise(x: Array, T: float) -> Array:
    """Return a way from 0 to 1 whose speed and acceleration vanish at both ends, shape (K, 3).

    Args:
        x: Share of the time gone, shape (K,).
        T: That time [s]; negative where ``x`` falls.
    """
    rate, bend = 30.0 * (x * (1.0 - x)) ** 2, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
    return np.stack([x**3 * (10.0 - 15.0 * x + 6.0 * x * x), rate / T, bend / T**2], axis=1)


class _Plan(NamedTuple):
    """A verdict, and the generator that is to begin by it; None where none does."""

    verdict: Verdict
    begun: "Meeting | None"


class _Way(NamedTuple):
    """How a target would be met after a time.

    Attributes:
        T: That time [s].
        map: The map, adapted.
        rows: What it makes of the target at some instants [rad ...], shape (K, 6, n).
        path: Motion of the target then [m ...], shape (K, 3, 3).
        down: Velocity of the way down [m/s], shape (K, 3).
        step: Time from one to the next [s].
    """

    T: float
    map: MeetingMap
    rows: Array
    path: Array
    down: Array
    step: float


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeetingParts:
    """What makes a way of meeting again; as of :class:`MeetingMap` and :class:`Meeting`."""

    free: tuple[int, ...]
    frame: Array
    basis: CatchBasis
    alpha: Array
    H: Array
    coupling: Array | None
    settings: MeetingSettings
    tolerance: Tolerance

    def made(self, arm: Arm) -> "Meeting":
        """Return the generator of an arm; InputError where it has no such joints."""
        if not all(0 <= k < arm.n for k in self.free):
            raise InputError("meeting.free", f"joints in 0..{arm.n - 1}", self.free)
        f = MeetingMap(
            arm=arm,
            free=self.free,
            frame=self.frame,
            basis=self.basis,
            alpha=self.alpha,
            H=self.H,
            coupling=self.coupling,
        )
        return Meeting(f, self.settings, self.tolerance)


@final
@dataclass(frozen=True, slots=True)
class Meeting(Generator):
    """The meeting map as a generator.

    Attributes:
        map: The map; while a target is followed, adapted to it.
        settings: Where and how targets are met.
        tolerance: Share of each limit at which a target is refused.
        start: Time at which the arm started [s]; infinite before.
        after: Time from there to the meeting [s]; infinite before it is chosen.
        left: What its way leaves of the tool's speed to the target in each tick from the start on
            [m/s], shape (k,); None where the tool may be as fast as it likes.
        pull: How far from the target the tool's way begins, towards the work area [m], shape (3,):
            where the target is out of reach at the start. It dies away until the way down.
        glide: The target as it is followed.
        memory: What was planned last.
    """

    map: MeetingMap
    settings: MeetingSettings = field(default_factory=MeetingSettings)
    tolerance: Tolerance = field(
        default_factory=lambda: replace(uniform(0.8), speed=0.9, acceleration=0.7)
    )
    start: float = inf
    after: float = inf
    left: Array | None = None
    pull: Array = field(default_factory=lambda: np.zeros(3))
    glide: Glide = field(default_factory=Glide)
    memory: Memory[_Plan] = field(default_factory=Memory, repr=False, compare=False)

    __repr__ = brief

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that the map was made for."""
        return (self.map.arm,)

    @property
    def parts(self) -> MeetingParts:
        """What makes it again, before any target."""
        f = self.map
        return MeetingParts(
            free=f.free,
            frame=f.frame,
            basis=f.basis,
            alpha=f.alpha,
            H=f.H,
            coupling=f.coupling,
            settings=self.settings,
            tolerance=self.tolerance,
        )

    def sharpness(self, ball: BallState) -> float:
        """Return the 1-sigma of the target's position now: nothing rests on a forecast [m]."""
        return spread(ball, 0.0)

    def afresh(self) -> "Meeting":
        """Return the generator before any target."""
        return replace(self, glide=Glide(), memory=Memory())

    def pause(self) -> float:
        """Return the time from one verdict to the next [s]."""
        return _PAUSE

    @property
    def certificate(self) -> Verdict | None:
        """Nothing is refined."""
        return None

    def verdict(self, ball: BallState, q: Array, dq: Array | None = None) -> Verdict:
        """Return the verdict: the shortest time within the work area and all limits.

        What is under way is refused where it was given up: the catcher's commands keep the limits.
        """
        return self.consider(ball, q, dq, Pieces())[0]

    def consider(
        self,
        ball: BallState,
        q: Array,
        dq: Array | None,  # noqa: ARG002 (of an arm at rest it is noise)
        pieces: Pieces,
    ) -> tuple[Verdict, "Meeting"]:
        """Return that verdict, worked out in pieces, and the generator with what it chose."""
        if self.start == inf:
            plan = self._planned(ball, q, pieces)
            return plan.verdict, plan.begun or self
        if self.glide.ended:
            return self._refused(ball, self.glide.ended), self
        verdict = Verdict(
            outcome=Outcome.FEASIBLE,
            binding_limit="",
            share=0.0,
            t_catch=self.start + self.after,
            sigma=spread(ball, 0.0),
        )
        return verdict, self

    def astray(self, ball: BallState) -> bool:  # noqa: ARG002
        """Know of nothing else that could meet it."""
        return False

    def wait(self, ball: BallState, q: Array, dq: Array) -> "Meeting":
        """Adapt: no verdict of this generator is to wait."""
        return self.adapt(ball, q, dq)

    def horizon(self) -> float:
        """Return the longest time to a meeting [s]."""
        return self.settings.longest

    @property
    def _across(self) -> Array:
        """Projection on the directions in which nothing moves: those across a belt."""
        along = self.settings.along
        return np.zeros((3, 3)) if along is None else np.eye(3) - np.outer(along, along)

    def known(self, ball: BallState) -> Array:
        """Return r_o, dr_o, ddr_o of an estimate, as far as it can move, shape (3, 3).

        Across its belt a part is where it was seen last: it has not moved since.
        """
        across = self._across
        beside = across @ ball.dr_o
        r_o = ball.r_o - (ball.t - ball.t_seen) * beside if ball.tracked else ball.r_o
        return np.array([r_o, ball.dr_o - beside, ball.ddr_o - across @ ball.ddr_o])

    def _pulled(self, target: BallState) -> "Meeting":
        """Return the generator whose way to a target begins within reach."""
        s, r_o, still = self.settings, target.r_o, np.zeros((2, 3))
        if self.map.virtual(np.array([r_o - s.above * self.map.frame[:, 2], *still]))[0]:
            return self
        return replace(self, pull=np.clip(r_o, s.low, s.high) - r_o)

    def _times(self, ball: BallState) -> tuple[Array, str]:
        """Return the times within the work area from the meeting to the end of the window [s].

        Where there are none, the text says why: the target is not met in the ``area``, or leaves
        it before the ``window`` is over; or it is faster than the ``tool``. What is out of reach
        now may become slower on its way.
        """
        s, least = self.settings, _LEAST + self.settings.descent
        times = np.geomspace(max(s.shortest, least), max(s.longest, least), _TIMES)
        ends = flown(ball, np.concatenate([times, times + s.window]))[:, 0]
        within = np.all((ends >= s.low) & (ends <= s.high), axis=1)
        met, kept = within[:_TIMES], within[_TIMES:]
        if np.any(self.pull):
            ends = flown(replace(ball, dr_o=_SLOWER * ball.dr_o), times)[:, 0]
            near = times * np.linalg.norm(ball.dr_o) < _COMES
            met = met & near & np.all((ends >= s.low) & (ends <= s.high), axis=1)
        times, why = times[met & kept], "window" if met.any() else "area"
        if np.linalg.norm(ball.dr_o) > _USED * s.speed:
            return times[:0], "tool" if len(times) else why
        return times, why

    def _planned(self, ball: BallState, q: Array, pieces: Pieces) -> _Plan:
        """Return the verdict for an arm that rests in ``q``, and the generator that begins.

        The shortest time is tried at first, then the longest, then times in between: the longer it
        takes, the less is asked of the arm.
        """
        target = self._target(ball)
        g = pieces.whole("pulled", self._pulled, target)
        times, why = pieces.whole("times", g._times, target)
        tried = [g._tried(target, q, T, pieces) for T in times[:1].tolist()]
        if not tried:
            return self.memory.keep(ball, _Plan(self._refused(ball, why), None))
        if tried[0][0].share > 1.0 and len(times) > 1:
            tried.append(g._tried(target, q, float(times[-1]), pieces))
            low, high = 0, len(times) - 1
            for _ in range(_HALVINGS if tried[-1][0].share <= 1.0 else 0):
                k = (low + high) // 2
                tried.append(g._tried(target, q, float(times[k]), pieces))
                low, high = (low, k) if tried[-1][0].share <= 1.0 else (k, high)
        within = [(said, way) for said, way in tried if way is not None and said.share <= 1.0]
        if not within:
            best = min((said for said, _ in tried), key=lambda said: said.share)
            return self.memory.keep(ball, _Plan(best, None))
        verdict, way = min(within, key=lambda x: x[0].t_catch)
        left = pieces.of("left", g._left_speeds, target, way)
        return self.memory.keep(ball, _Plan(verdict, replace(g, after=way.T, left=left)))

    def _target(self, ball: BallState) -> BallState:
        """Return an estimate of what moves only as far as it can."""
        r_o, dr_o, ddr_o = self.known(ball)
        return replace(ball, r_o=r_o, dr_o=dr_o, ddr_o=ddr_o)

    def _refused(self, ball: BallState, why: str) -> Verdict:
        """Return the verdict on a target that no motion was found for."""
        return Verdict(
            outcome=Outcome.UNSETTLED,
            binding_limit=why,
            share=inf,
            t_catch=inf,
            sigma=spread(ball, 0.0),
        )

    def _tried(
        self, ball: BallState, q: Array, T: float, pieces: Pieces
    ) -> tuple[Verdict, _Way | None]:
        """Return the verdict on meeting a target after a time [s], and the way to it, if any."""
        way = pieces.of(f"way {T!r}", self._way, ball, q, T)
        if way is None:
            return self._refused(ball, "domain"), None
        return pieces.of(f"asked {T!r}", self._judged, way, ball), way

    def _way(self, ball: BallState, q: Array, T: float) -> _Way | None:
        """Return the way to meet a target after a time [s]; None outside the map's domain."""
        times = np.linspace(0.0, T + self.settings.window, _INSTANTS)
        path = flown(ball, times)
        targets = self._placed(path, T - times, T)
        f = self.map.adapt(targets[0], np.array([q, 0.0 * q, 0.0 * q]), self.approach(T))
        rows = None if f is None else f.motion_along(targets, *self._clock(times, T))
        if f is None or rows is None or not self._reaches_slower(f, ball, T):
            return None
        return _Way(T, f, rows, path, targets[:, 1] - path[:, 1], float(times[1]))

    def _judged(self, way: _Way, ball: BallState) -> Verdict:
        """Return the verdict on a way, by all limits up to the grasp."""
        motion = way.rows[:, :3].copy()
        shares = self.shares(motion, way.step)
        if np.isfinite(self.settings.speed):
            bent, lever = self._way_speeds(way.rows, way.down)
            asked = bent + lever * np.linalg.norm(way.path[:, 1], axis=1)
            shares["tool"] = float(asked.max()) / (_USED * self.settings.speed)
        binding = max(shares, key=lambda name: shares[name])
        return Verdict(
            outcome=Outcome.FEASIBLE if shares[binding] <= 1.0 else Outcome.UNSETTLED,
            binding_limit=binding,
            share=shares[binding],
            t_catch=ball.t + way.T,
            sigma=spread(ball, 0.0),
            approach=Approach(motion=motion, step=way.step, dr_o=way.path[-1, 1]),
        )

    def _reaches_slower(self, f: MeetingMap, ball: BallState, T: float) -> bool:
        """Say whether a way that begins within reach stays there if its target slows down."""
        if not np.any(self.pull):
            return True
        times = np.linspace(0.0, T, _LOOKS)
        path = flown(replace(ball, dr_o=_SLOWEST * ball.dr_o), times)
        placed = self._placed(path, T - times, T)
        return f.motion_along(placed, *self._clock(times, T)) is not None

    def shares(self, motion: Array, step: float) -> dict[str, float]:
        """Return the shares of all limits of the arm that a motion asks for, in tolerances.

        Those of :func:`mitt.core.map.demand.shares_of`, and by differences the jerk in shares of
        what the catcher's commands keep: ``jerk:NAME``, or ``torque_rate:NAME`` where that comes
        from the torque rates.

        Args:
            motion: q, dq, ddq at K instants, shape (K, 3, n).
            step: Time from one to the next [s].
        """
        arm, tolerance = self.map.arm, self.tolerance
        found, most = shares_of(arm, motion, tolerance), bounds_of(arm)["jerk"]
        own = np.full(arm.n, inf) if arm.limits.jerk is None else arm.active(arm.limits.jerk)
        by_rate = (most < own) & (arm.limits.torque_rate is not None)
        jerk = np.abs(np.diff(motion[:, 2], axis=0)).max(axis=0) / step
        for k in np.flatnonzero(np.isfinite(most)).tolist():
            kind = "torque_rate" if by_rate[k] else "jerk"
            found[f"{kind}:{arm.names[k]}"] = float(jerk[k] / most[k] / tolerance.acceleration)
        return found

    def _way_speeds(self, rows: Array, down: Array) -> tuple[Array, Array]:
        """Return what the tool's speed at K instants is made of.

        Its speed on the way to a target that rests [m/s], shape (K,), and what each 1 m/s of a
        target adds to it, at least 1, shape (K,).

        Args:
            rows: What the map makes of the target, shape (K, 6, n).
            down: Velocity of the way down [m/s], shape (K, 3).
        """
        q, dq, q_o, dq_o = rows[:, 0], rows[:, 1], rows[:, 3], rows[:, 4]
        virtual = self._speeds(q_o, dq_o)
        lever = np.maximum(self._speeds(q, dq_o) / np.maximum(virtual, 1e-3), 1.0)
        bent = _ROUGH * self._speeds(q, dq - dq_o)
        return bent + lever * np.linalg.norm(down, axis=1), lever

    def _speeds(self, q: Array, dq: Array) -> Array:
        """Return the tool's speeds at K instants [m/s], shape (K,), of q, dq, shapes (K, n)."""
        return tool_speeds(self.map.arm, np.stack([q, dq, np.zeros_like(q)], axis=1))

    def _left_speeds(self, ball: BallState, way: _Way) -> Array | None:
        """Return what a way leaves of the tool's speed to the target in each tick [m/s], (k,).

        None where the tool may be as fast as it likes.
        """
        if not np.isfinite(self.settings.speed):
            return None
        T = way.T
        times = np.linspace(0.0, T + self.settings.window, 4 * _INSTANTS)
        path = flown(ball, times)
        targets = self._placed(path, T - times, T)
        rows = way.map.motion_along(targets, *self._clock(times, T))
        if rows is None:
            return np.zeros(1)
        bent, lever = self._way_speeds(rows, targets[:, 1] - path[:, 1])
        left = np.maximum(_USED * self.settings.speed - bent, 0.0) / lever
        ticks = np.interp(np.arange(0.0, times[-1], TICK), times, left)
        later = np.append(ticks, np.full(round(_LAG / TICK) - 1, inf))
        least: Array = sliding_window_view(later, round(_LAG / TICK)).min(axis=1)
        return least

    def approach(self, T: float) -> float:
        """Return the time from the start until the tool is above the target [s]."""
        return T - self.settings.descent

    def _clock(self, since: Array, T: float) -> tuple[Array, float]:
        """Return s, the share of the time to go, so long after the start, and that time [s]."""
        whole = self.approach(T)
        return np.maximum(1.0 - since / whole, 0.0), whole

    def placed(self, target: Array, left: float) -> Array:
        """Return the target with the tool's way down before it, so long before the meeting.

        Along the tool's axis, by a polynomial whose speed and acceleration vanish at both ends.
        """
        out: Array = self._placed(target[None], np.array([left]), self.after)[0]
        return out

    def _placed(self, path: Array, left: Array, T: float) -> Array:
        """Return the same of K instants of a way that takes a time T [s], shape (K, 3, 3)."""
        s, moved, whole = self.settings, path, self.approach(T)
        if s.above > 0.0:
            height = _rise(np.clip(left / s.down, 0.0, 1.0), -s.down)
            moved = moved + height[:, :, None] * (-s.above * self.map.frame[:, 2])
        if np.any(self.pull):
            away = _rise(np.clip((left - s.descent) / whole, 0.0, 1.0), -whole)
            moved = moved + away[:, :, None] * self.pull
        return moved

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Meeting":  # noqa: ARG002
        """Start from where the arm rests, eq. (12), to meet the target as soon as limits allow.

        What the encoders say of the speed of an arm at rest is noise. Under way nothing changes.
        """
        if self.start < inf:
            return self
        begun: Meeting | None = self
        if self.after == inf:
            begun = (self.memory.of(ball) or self._planned(ball, q, Pieces())).begun
        if begun is None:
            return self
        glide = Glide(begun.left, self._rate)
        followed = begun.placed(glide.to(ball.t, self.known(ball), self._across), begun.after)
        still = np.array([q, 0.0 * q, 0.0 * q])
        f = self.map.adapt(followed, still, self.approach(begun.after))
        return self if f is None else replace(begun, map=f, glide=glide, start=ball.t)

    @property
    def _rate(self) -> float:
        """Rate at which an estimate that jumps may be followed within the arm's jerks [1/s]."""
        arm = self.map.arm
        asked = np.abs(np.linalg.pinv(arm.jacobian(arm.q_ready))).max(axis=1)
        slowness = _JUMP * float(np.max(asked / bounds_of(arm)["jerk"]))
        return inf if slowness == 0.0 else float(np.cbrt(1.0 / slowness))

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map at the target as it is, and at the time to go."""
        said = self.follow(ball)
        moves = said.status is MapStatus.INSIDE
        left = self.time_left(ball, np.array([said.q_d, said.dq_d])) if moves else inf
        return replace(said, time_to_catch=left)

    def follow(self, ball: BallState) -> JointReference:
        """Return the same without a time to the catch, which depends on what moves the tool.

        What is given up has no meeting ahead: its followed target comes to rest. Out of the map's
        domain the motion goes on as it was, until the arm brakes.
        """
        since, glide = ball.t - self.start, self.glide
        gentle = self.settings.gentle if since > self.after else 0.0
        followed = glide.to(ball.t, self.known(ball), self._across, gentle)
        target = self.placed(followed, self.after - since)
        clock, whole = self._clock(np.array([since]), self.after)
        known = glide.onwards()
        start = None if known is None else known[3]
        found = self.map.motion_along(target[None], clock, whole, start)
        glide.ended = glide.ended or self._lost(ball, followed)
        if not glide.ended and self._led_out(target, since, start):
            glide.ended = "domain"
        if found is not None and not glide.ended and self._too_fast(found, _OVER):
            glide.ended = "tool"
        inside = found is not None or known is not None
        if found is not None:
            rows = glide.rows = found[0]
        elif known is not None:  # it goes on for a tick, in which a brake is planned
            glide.ended, rows = glide.ended or "domain", known
        else:
            rows = np.zeros((6, self.map.arm.n))
            rows[0] = rows[3] = self.map.arm.q_ready
        return reference_of(ball.t, rows, inside=inside, time_to_catch=inf)

    def _too_fast(self, motion: Array, share: float) -> bool:
        """Say whether the tool is faster than a share of its largest speed, (k, 3 or more, n)."""
        most = share * self.settings.speed
        return most < inf and bool(tool_speeds(self.map.arm, motion[:, :3]).max() > most)

    def _lost(self, ball: BallState, followed: Array) -> str:
        """Return why a target is to be given up; nothing where it is not.

        ``taken``: it leaves its belt sideways, falls, or is far from where it is followed; that is
        ``tool`` where the tool's speed is limited, which it may have run away from. ``area``: it
        leaves the work area, or turns round before it has come there. ``hidden``: it was hidden for
        so long that its place is not known well enough.
        """
        s, v = self.settings, ball.dr_o
        if self._sigma(ball) > s.unsure:
            return "hidden"
        spare = 3.0 * float(np.sqrt(np.max(np.diag(ball.covariance)[3:])))
        across = float(np.linalg.norm(self._across @ v))
        if across > _STRAYS + spare or float(self.map.frame[:, 2] @ v) > _FALLS + spare:
            return "taken"
        due, slow = ball.t - self.start > self.after - s.descent, s.speed < inf
        if np.linalg.norm(ball.r_o - followed[0]) > (_AHEAD if slow and not due else _ASTRAY):
            return "tool" if slow else "taken"
        out = ball.r_o - np.clip(ball.r_o, s.low, s.high)
        far = float(np.linalg.norm(out))
        leaves = float(out @ v) > (_OUTWARDS if due else _OUTWARDS + spare) * far
        return "area" if far > _OUTSIDE and leaves else ""

    def _sigma(self, ball: BallState) -> float:
        """Return the 1-sigma of a target's place [m], along its belt where it is on one.

        What is carried by a belt is held by it while it is hidden: its place is as uncertain as the
        belt's speed makes it. What is free is pushed. The motion models of the filter know of no
        belt, and of one sighting that does not fit they may expect anything.
        """
        s, glide, hidden = self.settings, self.glide, ball.t - ball.t_seen
        moves = np.eye(3) if s.along is None else np.outer(s.along, s.along)
        sigma = float(np.sqrt(np.max(np.linalg.eigvalsh(moves @ ball.covariance[:3, :3] @ moves))))
        if ball.t_seen > glide.seen:
            glide.seen, glide.sigma = ball.t_seen, sigma
        grown = 0.5 * _PUSHED * hidden * hidden
        if s.along is not None:
            grown = s.varies * max(abs(float(np.dot(s.along, ball.dr_o))), _CREEPS) * hidden
        return min(sigma, float(np.hypot(glide.sigma, grown)))

    def _led_out(self, target: Array, since: float, start: Array | None) -> bool:
        """Say whether a way that began within reach will soon lead out of it: its part is late.

        It is given up while joints are slow enough to stop: at the end of its reach an arm is
        straight, and its joints race.
        """
        if not np.any(self.pull) or since > self.approach(self.after):
            return False
        ahead = np.array([target[0] + _LED * target[1], *target[1:]])
        return not self.map.virtual(ahead, start)[0]

    def leaving(self, motion: Array) -> Array | None:
        """Return how the tool leaves while it comes to rest, with what it holds, (k, 3, n).

        It goes ``above`` back along its axis, where limits forbid that a little, or else straight
        on, in the shortest of a few times within all limits; None where none is.

        Args:
            motion: The command from which it goes on [rad ...], shape (3, n).
        """
        s, hard = self.settings, replace(self, tolerance=_HARD)
        tried = [(self, s.above, T) for T in _LEAVES]
        tried += [(hard, lift, T) for lift in (_HOP * s.above, 0.0) for T in _STOPS]
        for g, lift, T in tried if s.above > 0.0 else []:
            found = self._left_in(T, lift, motion)
            if found is None or self._too_fast(found, 1.0):
                continue
            if max(g.shares(found, T / (_INSTANTS - 1)).values()) <= 1.0:
                return interpolate_motion(found, T, round(T / TICK) + 1)
        return None

    def _left_in(self, T: float, lift: float, motion: Array) -> Array | None:
        """Return such a motion in a time [s] at even instants, shape (K, 3, n)."""
        arm, x = self.map.arm, np.linspace(0.0, 1.0, _INSTANTS)
        r, v = arm.position(motion[0]), arm.jacobian(motion[0]) @ motion[1]
        on = [T * (x - x**3 + 0.5 * x**4), 1.0 - x * x * (3.0 - 2.0 * x), -6.0 * x * (1.0 - x) / T]
        path = np.stack(on, axis=1)[:, :, None] * v
        path -= _rise(x, T)[:, :, None] * (lift * self.map.frame[:, 2])
        path[:, 0] += r
        f = self.map.adapt(path[0], motion, T)
        rows = None if f is None else f.motion_along(path, 1.0 - x, T, motion[0])
        return None if rows is None else rows[:, :3].copy()

    def time_left(self, ball: BallState, motion: Array) -> float:
        """Return the time until a tool has closed [s]; infinite where it does not.

        It begins to close once it has been in step with the target for ``settle``; sooner, but in
        step, where the target would leave the work area, or is hidden: to wait makes nothing surer
        then. What is not in step by then is given up.

        Args:
            ball: The target.
            motion: q, dq of the arm as desired [rad ...], shape (2, n).
        """
        s, glide, t, met = self.settings, self.glide, ball.t, self.start + self.after
        if glide.ended:
            return inf
        if glide.closes > t:
            if not self._in_step(ball, motion):
                glide.calm = t
            hidden = self._sigma(ball) > max(_HIDDEN * glide.sigma, _NOTICED)
            begin = max(met, glide.calm + _FIRM) + (0.0 if hidden else s.settle)
            soon, now = self._leaves() if t >= met else (False, False)
            if soon and glide.calm < t:
                begin = min(begin, t)
            if begin > t and (now or t - met > s.window + s.longest):
                glide.ended = "window"
                return inf
            if begin > t:
                return begin + s.closing - t
            glide.closes = max(begin, t - TICK)  # what has become due by now closes now
        return glide.closes + s.closing - t

    def _in_step(self, ball: BallState, motion: Array) -> bool:
        """Say whether a tool is where the target is, and as fast."""
        arm, (q, dq), (r_o, dr_o, _) = self.map.arm, motion, self.known(ball)
        near = float(np.linalg.norm(arm.position(q) - r_o)) <= _NEAR
        return near and float(np.linalg.norm(arm.jacobian(q) @ dq - dr_o)) <= _SLOW

    def _leaves(self) -> tuple[bool, bool]:
        """Say whether a target leaves the area before a tool has closed: 50 ms from now, or now."""
        s, (r_o, dr_o, _) = self.settings, self.glide.motion
        ahead = r_o + np.outer([s.closing + 0.05, s.closing], dr_o)
        out = ((ahead < s.low) & (dr_o < 0.0)) | ((ahead > s.high) & (dr_o > 0.0))
        soon, now = out.any(axis=1).tolist()
        return soon, now
