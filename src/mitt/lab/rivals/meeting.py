"""Rivals that meet what moves within reach, with the filter, times and way down of the map.

All are one generator, :class:`MeetingRival`; they differ in their :class:`Way` alone.

``quintic``, ``ruckig`` and ``mpc`` plan to where the target will be at the meeting, again and
again: each plan goes on from where the last one has brought the arm, in position, velocity and
acceleration, to those of the target as it is foreseen for the end: the target as the map follows
it, so that the plan alone differs. Shortly before the meeting, and while the tool stays with the
target, the end of a plan lies ``AHEAD`` before it: a plan without time left would ask for any
acceleration.

``ds`` is a dynamical system of second order in the joints that the moving target attracts, its rate
rising towards the meeting, as that of :mod:`mitt.lab.rivals.servo`.

``line`` is what belts are served with: the camera tells once where the part is, the belt's encoder
how far it has travelled since. ``line`` takes the encoder's value at the instant at which the
camera's answer came, and of now; ``line-compensated`` that of the exposure, and of the instant at
which the command acts.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf
from typing import Final, Protocol, Self, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.ball.belt import BeltTravel
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.meeting import Meeting
from mitt.core.errors import InputError, UnknownNameError
from mitt.core.fields import brief
from mitt.core.map.prediction import flown
from mitt.core.signals import Array, BallState, JointReference, MapStatus
from mitt.core.verdict.feasibility import Verdict
from mitt.core.verdict.pieces import Pieces
from mitt.lab.rivals.intercept import Intercept
from mitt.lab.rivals.mpc import MpcPlanner
from mitt.lab.rivals.planned import Plan, Planner, RuckigPlanner, plan_quintic
from mitt.lab.rivals.pursuit import coasting
from mitt.lab.rivals.servo import Bounds, close_gap, pursuit_bandwidth, pursuit_bounds

AHEAD: Final = 0.1
"""Least time from a plan to its end [s]."""

#: Smallest rate of ``ds`` [rad/s], and its largest: that with which the map follows a target.
_SLOWEST = 6.0
_RATE = 30.0
#: Largest acceleration with which ``ruckig`` plans [rad/s^2]: it goes as hard as it may.
_MOST = 20.0


class Way(Protocol):
    """One rival's way to a target; begun anew at each start of the arm."""

    def begin(self, state: Array, ball: BallState) -> Self:
        """Return the way that starts in q, dq, ddq (3, n) at the time of an estimate."""
        ...

    def target(self, ball: BallState) -> BallState:
        """Return where it believes the target to be, at the time of an estimate."""
        ...

    def motion(self, meeting: Meeting, ball: BallState, followed: JointReference) -> Array | None:
        """Return q, dq, ddq at a time, (3, n); None where there is no way.

        Args:
            meeting: What chose the time, and knows way down and inverse.
            ball: The target as it is believed to move.
            followed: What the map does.
        """
        ...


@final
@dataclass(frozen=True, slots=True, eq=False)
class MeetingRival(Generator):
    """A rival that meets a target within reach.

    Attributes:
        meeting: What chooses the time, and knows way down and inverse.
        way: How the arm goes there.
        q_hold: Where it rests without a way [rad], shape (n,).
    """

    meeting: Meeting
    way: Way
    q_hold: Array

    __repr__ = brief

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that it was made for."""
        return self.meeting.arms

    def sharpness(self, ball: BallState) -> float:
        """Return what the meeting map says."""
        return self.meeting.sharpness(ball)

    def horizon(self) -> float:
        """Return what the meeting map says."""
        return self.meeting.horizon()

    @property
    def certificate(self) -> Verdict | None:
        """Nothing is refined."""
        return None

    def verdict(self, ball: BallState, q: Array, dq: Array | None = None) -> Verdict:
        """Return what the meeting map says."""
        return self.meeting.verdict(ball, q, dq)

    def consider(
        self, ball: BallState, q: Array, dq: Array | None, pieces: Pieces
    ) -> tuple[Verdict, "MeetingRival"]:
        """Return what the meeting map says, in the same pieces, and the rival with its choice."""
        said, meeting = self.meeting.consider(ball, q, dq, pieces)
        return said, replace(self, meeting=meeting)

    def astray(self, ball: BallState) -> bool:  # noqa: ARG002
        """Know of nothing else that could meet it."""
        return False

    def wait(self, ball: BallState, q: Array, dq: Array) -> "MeetingRival":
        """Adapt: no verdict is to wait."""
        return self.adapt(ball, q, dq)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "MeetingRival":
        """Choose the time of the meeting, and set out from where the arm is.

        What is under way goes on: a plan starts from the one before it, not from a drive's lag.
        """
        if self.meeting.start < inf:
            return self
        begun = self.way.begin(np.array([q, 0.0 * q, 0.0 * q]), ball)
        return replace(self, meeting=self.meeting.adapt(ball, q, dq), way=begun, q_hold=q.copy())

    def afresh(self) -> "MeetingRival":
        """Return the rival before any target; the time of its belt begins anew."""
        encoder = encoder_of(self)
        if encoder is not None:
            encoder.forget()
        return replace(self, meeting=self.meeting.afresh())

    def pause(self) -> float:
        """Return what the meeting map says."""
        return self.meeting.pause()

    def leaving(self, motion: Array) -> Array | None:
        """Return what the meeting map says."""
        return self.meeting.leaving(motion)

    def reference(self, ball: BallState) -> JointReference:
        """Return the motion of the way; the tool closes by the rules of the map."""
        target = self.way.target(ball)
        followed = self.meeting.follow(target)
        motion = self.way.motion(self.meeting, target, followed)
        q, dq, ddq = np.array([self.q_hold] + [0.0 * self.q_hold] * 2) if motion is None else motion
        return JointReference(
            t=ball.t,
            status=MapStatus.DOMAIN if motion is None else MapStatus.INSIDE,
            q_d=q,
            dq_d=dq,
            ddq_d=ddq,
            q_o=q,
            dq_o=dq,
            time_to_catch=inf if motion is None else self.meeting.time_left(target, motion[:2]),
        )


class _Memory:
    """What a way remembers of the last tick."""

    def __init__(self, t: float, motion: Array) -> None:
        """Begin with a motion (3, n) at a time, and no plan."""
        self.t, self.motion = t, motion
        self.plan: Plan | None = None
        self.planned = self.end = -inf


def _nothing() -> _Memory:
    """Return the memory of what has not begun."""
    return _Memory(-inf, np.zeros((3, 0)))


@final
@dataclass(frozen=True, slots=True, eq=False)
class Replanned:
    """Plans to where the target will be, made again and again.

    Attributes:
        planner: Makes the plans; where it finds none, a quintic is taken.
        rate: Plans a second [Hz].
        memory: The plan under way.
    """

    planner: Planner
    rate: float = 100.0
    memory: _Memory = field(default_factory=_nothing)

    def begin(self, state: Array, ball: BallState) -> "Replanned":
        """Forget the plan."""
        return replace(self, memory=_Memory(ball.t, state))

    def target(self, ball: BallState) -> BallState:
        """Return the estimate."""
        return ball

    def motion(self, meeting: Meeting, ball: BallState, followed: JointReference) -> Array | None:
        """Follow the plan, after a new one if it is due."""
        w = self.memory
        if ball.t - w.planned >= 1.0 / self.rate - 1e-9:
            self._plan(meeting, ball, followed.q_o)
        return None if w.plan is None else self._at(ball.t)

    def _at(self, t: float) -> Array:
        """Return the motion of the plan at a time; past its end it goes on at its speed."""
        w = self.memory
        if w.plan is None:
            return w.motion
        motion, late = w.plan.at(min(t, w.end)), max(t - w.end, 0.0)
        return coasting(motion, late) if late > 0.0 else motion

    def _plan(self, meeting: Meeting, ball: BallState, branch: Array) -> None:
        """Plan from where the last plan has brought the arm; that one stays out of reach.

        The end is on the branch of a pose, that of the map: a plan on its way may point elsewhere.
        """
        w, t_c = self.memory, meeting.start + meeting.after
        above = meeting.start + meeting.approach(meeting.after)
        T = max(above - ball.t, AHEAD, 1.0 / self.rate)
        r_o, dr_o, ddr_o = meeting.glide.motion
        ahead = flown(replace(ball, r_o=r_o, dr_o=dr_o, ddr_o=ddr_o), np.array([T]))[0]
        start = self._at(ball.t)
        inside, end = meeting.map.virtual(meeting.placed(ahead, t_c - ball.t - T), branch)
        if not inside:
            return
        to = Intercept(
            t_c=ball.t + T, end=end, r_c=ahead[0], binding_limit="", utilization=0.0, low=False
        )
        w.plan = self.planner(start, ball.t, to) or plan_quintic(start, ball.t, to)
        w.planned, w.end = ball.t, ball.t + T


@final
@dataclass(frozen=True, slots=True, eq=False)
class Attracted:
    """A dynamical system that the target attracts.

    Attributes:
        most: Bounds of the joints.
        memory: The motion of the tick before.
    """

    most: Bounds
    memory: _Memory = field(default_factory=_nothing)

    def begin(self, state: Array, ball: BallState) -> "Attracted":
        """Start from a motion."""
        return replace(self, memory=_Memory(ball.t, state))

    def target(self, ball: BallState) -> BallState:
        """Return the estimate."""
        return ball

    def motion(self, meeting: Meeting, ball: BallState, followed: JointReference) -> Array | None:
        """Advance the joints to the time of the estimate."""
        w, t_c = self.memory, meeting.start + meeting.after
        here = meeting.placed(meeting.known(ball), t_c - ball.t)
        inside, goal = meeting.map.virtual(here, followed.q_o)
        if not inside:
            return None
        left = t_c - meeting.settings.descent - ball.t
        if ball.t > w.t:
            rows = w.motion.copy()
            close_gap(self.most, goal, pursuit_bandwidth(left, _SLOWEST, _RATE), ball.t - w.t, rows)
            w.t, w.motion = ball.t, rows
        return w.motion


class _Latch:
    """Where the camera saw the part, and the encoder's value that belongs to it."""

    def __init__(self, seen: float) -> None:
        """Wait for the first answer of the camera after the start."""
        self.seen, self.travel = seen, 0.0
        self.r: Array | None = None


@final
@dataclass(frozen=True, slots=True, eq=False)
class LineTracking:
    """The map's way to a part whose place the belt's encoder tells; the camera is asked once.

    Attributes:
        encoder: The belt's.
        compensated: Whether delays of sensing and drives are made up for.
        latch: What the camera told.
    """

    encoder: BeltTravel
    compensated: bool
    latch: _Latch = field(default_factory=lambda: _Latch(inf))

    def begin(self, state: Array, ball: BallState) -> "LineTracking":  # noqa: ARG002
        """Wait for the next answer of the camera."""
        return replace(self, latch=_Latch(ball.t_seen))

    def motion(self, meeting: Meeting, ball: BallState, followed: JointReference) -> Array | None:  # noqa: ARG002
        """Return what the map does at the part's place by the encoder."""
        inside = followed.status is MapStatus.INSIDE
        return np.array([followed.q_d, followed.dq_d, followed.ddq_d]) if inside else None

    def target(self, ball: BallState) -> BallState:
        """Return the part's motion by the encoder; as estimated until the camera has answered."""
        w, e = self.latch, self.encoder
        if w.r is None and ball.t_seen > w.seen:
            w.r = ball.r_o - (ball.t - ball.t_seen) * ball.dr_o
            w.travel = e.at(ball.t_seen if self.compensated else e.newest)[0]
        if w.r is None:
            return ball
        travel, speed, ddr = e.at(ball.t if self.compensated else e.newest)
        return replace(
            ball, r_o=w.r + (travel - w.travel) * e.along, dr_o=speed * e.along, ddr_o=ddr * e.along
        )


PLANNERS: Final[dict[str, Callable[[Arm], Planner]]] = {
    "quintic": lambda arm: plan_quintic,  # noqa: ARG005
    "ruckig": lambda arm: RuckigPlanner(arm, most=_MOST),
    "mpc": MpcPlanner,
}
"""Rivals that plan anew, by name."""

LINES: Final = {"line": False, "line-compensated": True}
"""Rivals that follow a belt's encoder, and whether they make up for delays."""

MEETERS: Final = ("direct", *PLANNERS, "ds", *LINES)
"""All that meet what moves, by name."""


def make_meeter(name: str, meeting: Meeting, *, rate: float = 100.0) -> Generator:
    """Return what meets a target, by name.

    Args:
        name: One of ``MEETERS``.
        meeting: The map.
        rate: Plans a second, of those that plan anew [Hz].

    Raises:
        UnknownNameError: There is none of that name.
        InputError: It follows a belt, and there is none.
    """
    if name == "direct":
        return meeting
    arm = meeting.map.arm
    if name in PLANNERS:
        return _rival(meeting, Replanned(PLANNERS[name](arm), rate))
    if name == "ds":
        return _rival(meeting, Attracted(pursuit_bounds(arm)))
    if name not in LINES:
        raise UnknownNameError("--generator", name, MEETERS)
    if meeting.settings.along is None:
        raise InputError(
            "--generator",
            f"a belt for {name}, which reads its encoder",
            "none",
            do="choose --target belt, or another generator",
        )
    return _rival(meeting, LineTracking(BeltTravel(np.array(meeting.settings.along)), LINES[name]))


def _rival(meeting: Meeting, way: Way) -> MeetingRival:
    """Return a rival that waits in the ready pose."""
    return MeetingRival(meeting, way, meeting.map.arm.q_ready)


def encoder_of(generator: Generator) -> BeltTravel | None:
    """Return the encoder that a generator reads; None of one that reads none."""
    way = generator.way if isinstance(generator, MeetingRival) else None
    return way.encoder if isinstance(way, LineTracking) else None
