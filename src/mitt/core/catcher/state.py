"""What a catcher knows and remembers, and what a tick brings about.

Both are named tuples of arrays that Python and compiled code share: each reads and writes them in
place, by the same names (:mod:`mitt.core.kernels`). Single numbers are fields of one record,
``scalars``; what a stage knows is a tuple of its own. No type holds the number of joints, heads or
coefficients, so one compilation serves every arm.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, final

import numpy as np

from mitt.core.arm.arm import Arm, Tables
from mitt.core.arm.kinematics import joint_records, tip_motion
from mitt.core.ball.filter import fresh_filter
from mitt.core.catcher.settings import (
    BRAKE,
    PHASES,
    REFUSED,
    STOPPED,
    WATCH,
    CatcherSettings,
    Phase,
)
from mitt.core.control.closing import fingers_of
from mitt.core.control.encoders import Monitor, faulty, monitor_of
from mitt.core.control.envelope import bounds_of, speeds_of
from mitt.core.control.health import (
    ENCODER_REASONS,
    Reason,
    State,
    StoppedBy,
    fresh_health,
    hint_of,
)
from mitt.core.control.stop import MassWork, mass_work
from mitt.core.control.tracking import Tracked, Tracking, tracking_of
from mitt.core.control.viability import Safety, safety_of
from mitt.core.errors import ShapeError
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.localization import EyesMemory, eyes_handle
from mitt.core.fields import brief, line
from mitt.core.kernels import Handle, Record, copy, define, kernel, record_of
from mitt.core.map.mapping import DirectMap
from mitt.core.map.tangent import MapArrays
from mitt.core.signals import (
    TICK,
    ArmState,
    Array,
    BallState,
    Command,
    JointReference,
    reference_of,
)
from mitt.core.verdict.feasibility import waiting_height

#: States and reasons in the order of their numbers.
STATES = tuple(State)
REASONS = tuple(Reason)
#: Time for which command and arm have to have been at rest until the arm is taken to stay there
#: [s]: four time constants of the tracking error.
DWELL = 0.05

#: Single numbers of a state, with what they begin as.
_STATE = {
    "phase": WATCH,
    "passed": TICK,  # time since the tick before [s]
    "ahead": 0.0,  # by how much ``last`` is ahead of the tick, in ticks
    "t_read": -np.inf,  # when the newest reading was made [s]
    "lag": 0.0,  # how old it was in its tick [s]
    "stamp": np.nan,  # of the last reading, new or old [s]
    "stale": False,  # whether the last reading was an old one
    "age_told": 0.0,  # how much earlier than the tick it was stamped [s]
    "waited": 0.0,  # how long the first of ``waiting`` has acted, in ticks
    "surrogate": False,  # whether the ball's surrogate target is followed
    "begun": False,  # whether each joint was read
    "stop_requested": False,
    "braked": False,  # whether the brakes have engaged
    "t_brake": 0.0,  # when braking began [s]
    "t_rest": -np.inf,  # when it ends [s]
    "halted": False,  # whether the command is at rest, and no motion of it is left
    "t_moved": np.inf,  # when command or arm moved last; infinite once a motion is to begin [s]
    "t_brakes_on": np.inf,  # when the brakes were commanded to engage [s]
    "brake_delay": 0.0,  # how long they take [s]
    "clock_fault": 0,  # of :func:`mitt.core.control.health.pass_time`
    "encoder_fault": 0,  # of the worst encoder, of :mod:`mitt.core.control.encoders`
    "failures": 0,  # ticks in a row in which the generator failed; enough where a thought did
    "t_reviewed": -np.inf,  # when what is followed was reviewed last [s]
    "t_look": -np.inf,  # before it there is no verdict: one that refuses a far ball waits [s]
    "ponders": False,  # whether a verdict is being worked out
    "lags": False,  # whether the reference had left the arm behind in the tick before
    "was_led": False,  # whether the ball was led in the tick before
    "kicks": 0,  # how often its velocity was forgotten by then
    "t_flight": -np.inf,  # when it was let go, or was kicked, last [s]
    "t_refused": np.inf,  # when the flight began that is refused [s]
    "t_gone": np.inf,  # when it will have passed by: the refusal is for good [s]
    "t_ahead": np.inf,  # when a catch was ahead last, or a wait for one began [s]
    "heads": 0,
    "t_exposed": 0.0,  # instant of the newest image [s]
    "waiting_height": 0.0,  # of :func:`mitt.core.verdict.feasibility.level` [m]
    "flight_sigma": np.inf,  # 1-sigma of the ball's position if it flies on as it did [m]
    "sigma_ready": np.inf,  # of ``CatcherSettings``; infinite where the generator predicts it
    # As of ``CatcherSettings``:
    "tolerance": 0.0,
    "max_tracking_error": 0.0,
    "review": 0.0,
    "watch": 0.0,
    "bandwidth": 0.0,
    "adapt_q": 0.0,
    "adapt_dq": 0.0,
    "adapt_until": 0.0,
    "torque_lead": 0.0,
}

#: Single numbers of a result, with what they begin as.
_RESULT = {
    "t": 0.0,  # time of the tick [s]
    "phase": WATCH,  # in which it was made
    "t_ball": 0.0,  # of which instant the estimate of the ball is [s]
    "tracked": False,  # this and the next ones as of ``BallState``
    "led": False,
    "drag": 0.0,
    "lift_x": 0.0,  # of ``BallState.lift`` [1/s]
    "lift_y": 0.0,
    "lift_z": 0.0,
    "t_seen": -np.inf,
    "t_first": -np.inf,
    "following": False,  # whether the generator was evaluated
    "inside": False,  # whether its reference is a motion
    "time_to_catch": np.inf,  # infinite where none is in sight [s]
    "hand": 0.0,  # closing angle of the fingers commanded [rad]
    "saturated": False,  # whether a torque limit was met
    "health": 0,  # state and reason as in :mod:`mitt.core.control.health`
    "reason": 0,
    "age": np.inf,  # of the last good measurement; infinite without a track [s]
    "sigma": np.inf,  # 1-sigma of the ball's position, which may have bounced unseen [m]
    "brakes": False,  # whether the brakes are to be engaged
    # Whether the eyes found the ball, and when it was exposed [s]. The filter is given its
    # position, but for that of a ball which the braking hand holds.
    "sighted": False,
    "t_sighted": 0.0,
}


LIFT = ("lift_x", "lift_y", "lift_z")
"""Names of the components of a lift in a result."""


class CatcherState(NamedTuple):
    """What a catcher knows and remembers."""

    eyes: EyesMemory  # what the eyes know, shared with them; kernels get its handle
    scalars: Record  # single numbers, fields as of ``_STATE``, shape (1,)
    health: Record  # of :func:`mitt.core.control.health.fresh_health`
    ball_filter: Record  # of :func:`mitt.core.ball.filter.fresh_filter`
    fingers: Record  # of :func:`mitt.core.control.closing.fingers_of`
    monitor: Monitor
    safety: Safety
    arm: Tables  # the arm as it is now, with the ball or without: what torques are computed with
    tracking: Tracking
    mass: MassWork
    estimated: Array  # q, dq of the joints, by the monitor [rad, rad/s], shape (2, n)
    desired: Array  # q_d, dq_d, ddq_d of the last tick [rad ...], shape (3, n)
    last: Array  # q, dq, ddq of the last command within limits [rad ...], shape (3, n)
    before: Array  # the one a tick before it
    taken: Array  # q, dq of the reading as the monitor takes it; NaN for an old one, shape (2, n)
    waiting: Array  # accelerations that commands will cause once they act, oldest first, (k, n)
    z: Array  # position of a sighting [m], shape (3,)
    R: Array  # its covariance [m^2], shape (3, 3)
    refused: Array  # r_o, dr_o of the flight that is refused, as foreseen for now, shape (2, 3)
    followed: Array  # the ball that is followed, or its surrogate, shape (3, 3)
    hand: Array  # while the arm brakes: catch point, velocity, place at the exposure, (3, 3)
    look_at: Array  # where the heads look: the ball's position and velocity [m, m/s], (2, 3)
    bounce: Array  # scratch, shape (3,)
    gap: Array  # from the catch point to the ball, and its rate [m, m/s], shape (2, 3)
    pose: Array  # scratch, shape (n,)
    rest: Array  # where the arm has been since ``t_moved`` [rad], shape (n,)
    chain: Record  # of :func:`mitt.core.arm.kinematics.joint_records`
    palm: Array  # the palm's normal in the last frame, shape (3,)
    palm_now: Array  # and in the base frame
    jump: Array  # change of the joint speeds by the ball, where it may come [rad/s], shape (n,)
    impact_dq: Array  # change of the joint speeds that it may cause now [rad/s], shape (n,)
    limits: Array  # largest torques [N m], lower and upper ends of the ranges [rad], (3, n)
    map: MapArrays

    def __repr__(self) -> str:
        """Return one line."""
        return line("CatcherState", self._asdict().items())


class Result(NamedTuple):
    """What a tick brought about, and the next one starts from.

    Those of k ticks are kept in one as well, with k rows in each array.
    """

    scalars: Record  # single numbers, fields as of ``_RESULT``, shape (1,)
    encoders: Array  # q, dq as read [rad, rad/s], shape (2, n)
    ball: Array  # r_o, dr_o, ddr_o of the ball at ``t_ball``; zero without an estimate, (3, 3)
    covariance: Array  # of r_o, dr_o, shape (6, 6)
    reference: Array  # q_d, q_o and their derivatives, shape (6, n)
    command: Array  # q, dq, ddq, tau of the command, shape (4, n)
    gaze: Array  # where the heads are to look, as of ``Command``, shape (heads, 4)
    sighting: Array  # what the eyes said last: position [m], its covariance [m^2], shape (4, 3)

    def __repr__(self) -> str:
        """Return one line."""
        return line("Result", self._asdict().items())


class StateHandle(Handle):
    """A state, for kernels."""


class ResultHandle(Handle):
    """A result, for kernels."""


define(StateHandle, CatcherState)
define(ResultHandle, Result)


@kernel
def state_handle(state: CatcherState) -> Any:  # noqa: ANN401
    """Return the handle of a state."""
    return StateHandle(eyes_handle(state.eyes), *state[1:])


@kernel
def result_handle(result: Result) -> Any:  # noqa: ANN401
    """Return the handle of a result."""
    return ResultHandle(*result)


@kernel
def flight_begun(t_flight: float, t_first: float) -> float:
    """Return when the flight began that an estimate is of [s].

    Args:
        t_flight: When the ball was let go or kicked last, as of ``_STATE`` [s].
        t_first: When it was seen first, as of ``BallState`` [s].
    """
    return float(max(t_flight, t_first))


@kernel
def store(result: Any, ticks: Any, k: int) -> None:  # noqa: ANN401
    """Write a result into row ``k`` of room for many, both handles."""
    ticks.scalars[k] = result.scalars[0]
    copy(result.encoders, ticks.encoders[k])
    copy(result.ball, ticks.ball[k])
    copy(result.covariance, ticks.covariance[k])
    copy(result.reference, ticks.reference[k])
    copy(result.command, ticks.command[k])
    copy(result.gaze, ticks.gaze[k])
    copy(result.sighting, ticks.sighting[k])


def fresh_state(
    arm: Arm,
    eyes: Eyes,
    settings: CatcherSettings,
    f: DirectMap | None,
    *,
    sigma_ready: float = np.inf,
) -> CatcherState:
    """Return what a catcher knows and remembers at the start of a throw.

    Args:
        arm: The arm.
        eyes: Its eyes, whose arrays the state shares; all others are its own.
        settings: Of the catcher.
        f: The map, if the generator is one.
        sigma_ready: As of ``_STATE``.
    """
    s, n, of = settings, arm.n, tick_numbers(arm)
    scalars = _STATE | {
        "sigma_ready": sigma_ready,
        "heads": eyes.heads,
        "brake_delay": max(brake.delay for brake in arm.brakes),
        "waiting_height": 0.0 if f is None else waiting_height(f),
        "tolerance": s.tolerance,
        "max_tracking_error": s.max_tracking_error,
        "review": s.review,
        "watch": s.watch,
        "bandwidth": s.bandwidth,
        "adapt_q": s.adapt_q,
        "adapt_dq": s.adapt_dq,
        "adapt_until": s.adapt_until,
        "torque_lead": s.torque_lead,
    }
    ready = np.array([arm.q_ready, np.zeros(n), np.zeros(n)])
    return CatcherState(
        scalars=record_of(scalars, _STATE),
        health=fresh_health(),
        ball_filter=fresh_filter(s.flight),
        fingers=fingers_of(arm.model.hand, s.ball_radius, s.ball_restitution).copy(),
        monitor=monitor_of(arm, s.encoders),
        safety=deepcopy(safety_of(arm, s.around, s.ball_mass)),
        arm=deepcopy(of.tables),
        tracking=tracking_of(arm),
        mass=mass_work(arm),
        estimated=ready[:2].copy(),
        desired=ready.copy(),
        last=ready.copy(),
        before=ready.copy(),
        taken=np.zeros((2, n)),
        waiting=np.zeros((s.setpoint_delay + 1, n)),
        z=np.zeros(3),
        R=np.zeros((3, 3)),
        refused=np.zeros((2, 3)),
        followed=np.zeros((3, 3)),
        hand=np.zeros((3, 3)),
        look_at=np.zeros((2, 3)),
        bounce=np.zeros(3),
        gap=np.zeros((2, 3)),
        pose=np.zeros(n),
        rest=ready[0].copy(),
        chain=joint_records(arm.chain),
        palm=palm_of(arm),
        palm_now=np.zeros(3),
        jump=np.zeros(n),
        impact_dq=np.zeros(n),
        limits=of.limits.copy(),
        map=map_arrays(f),
        eyes=eyes.memory,
    )


def palm_of(arm: Arm) -> Array:
    """Return the palm's normal in the frame of the last active joint, shape (3,)."""
    q = arm.q_ready
    frame = np.reshape(tip_motion(joint_records(arm.chain), q, q, np.zeros((2, 3))), (3, 3))
    normal: Array = frame.T @ arm.orientation(q)[:, 2]
    return normal


class TickNumbers(NamedTuple):
    """What changes when the arm holds the ball."""

    tables: Tables
    encoder_bounds: Record
    drives: Array
    limits: Array


@lru_cache(maxsize=32)
def tick_numbers(arm: Arm) -> TickNumbers:
    """Return what the tick knows of an arm; worked out once, not to be written to."""
    limits = np.array([arm.tau_max, arm.q_min, arm.q_max])
    encoder_bounds = bounds_of(arm, commanded=False)
    return TickNumbers(arm.tables, encoder_bounds, arm.limits.packed, limits)


def exchange_arm(state: CatcherState, arm: Arm) -> None:
    """Let a state go on with an arm that begins to hold a ball, or lets it go.

    What a stop rests on stays (:mod:`mitt.core.control.viability`); speeds that were kept low for
    the ball to strike are free again.

    Args:
        state: Whose model, limits and bounds of encoders are overwritten.
        arm: The arm, with the ball's mass in its last link or without.
    """
    of = state.arm, state.monitor.bounds, state.tracking.drives, state.limits
    overwrite(of, tick_numbers(arm))
    state.safety.bounds["dq_max"] = speeds_of(arm)


def overwrite(old: tuple[Any, ...], new: tuple[Any, ...]) -> None:
    """Overwrite arrays by those of another tuple, and of the tuples in it."""
    for mine, value in zip(old, new, strict=True):
        if isinstance(mine, tuple):
            overwrite(mine, value)
        else:
            mine[...] = value


def prepare_holding(arm: Arm, settings: CatcherSettings) -> None:
    """Work out now what is kept of the arm with the ball, not in the middle of a catch.

    Args:
        arm: The arm.
        settings: Of the catcher.
    """
    tick_numbers(arm.holding(settings.ball_mass))
    if arm.limits.smooth:  # the verdict plans the brake for the heaviest ball
        bounds_of(arm.holding(settings.caught.heaviest))


def map_arrays(f: DirectMap | None) -> MapArrays:
    """Return a map as kernels take it, arrays of the caller's own."""
    if f is not None:
        return MapArrays._make(np.array(x, order="C") for x in f.arrays)
    none, pair = np.zeros(0), np.zeros((0, 0))
    return MapArrays(none, np.zeros((0, 0), np.int64), pair, pair, none, pair, none)


def begun_with(state: CatcherState, eyes: Eyes) -> CatcherState:
    """Return a copy of a state that shares the arrays of other eyes."""
    own = {name: deepcopy(x) for name, x in state._asdict().items() if name != "eyes"}
    return CatcherState(eyes=eyes.memory, **own)


def fresh_result(n: int, heads: int = 1) -> Result:
    """Return the result of no tick for ``n`` joints."""
    shapes = (2, n), (3, 3), (6, 6), (6, n), (4, n), (heads, 4), (4, 3)
    return Result(record_of(_RESULT, _RESULT), *(np.zeros(shape) for shape in shapes))


def room_for(result: Result, ticks: int) -> Result:
    """Return room for the results of ``ticks`` ticks."""
    scalars, *arrays = result
    return Result(np.repeat(scalars, ticks), *(np.zeros((ticks, *x.shape)) for x in arrays))


def copied(result: Result) -> Result:
    """Return a copy of a result."""
    return Result._make(x.copy() for x in result)


def ticks_between(ticks: Result, first: int, last: int) -> Result:
    """Return ticks ``first`` to before ``last`` of many, as views."""
    return Result._make(x[first:last] for x in ticks)


def gathered(results: Sequence[Result]) -> Result:
    """Return the results of single ticks, one or more, as one of many."""
    out = room_for(results[0], len(results))
    for whole, rows in zip(out, zip(*results, strict=True), strict=True):
        for k, row in enumerate(rows):
            whole[k] = row[0] if whole is out.scalars else row
    return out


@final
class CatcherMemory:
    """State and result of a catcher; one object a throw.

    Attributes:
        state: What the catcher knows and remembers, overwritten by the next tick.
        result: What the last tick brought about, overwritten by the next.
        scalars, out: Single numbers of both.
        q, dq: What the encoders read last [rad, rad/s], shape (n,).
        handles: State and result as kernels take them.
    """

    def __init__(self, blank: CatcherState, eyes: Eyes) -> None:
        """Begin as ``blank`` says, which is copied, with the arrays of the eyes."""
        self.state, self.result = _begun(blank, eyes)
        self._show()

    def __getstate__(self) -> dict[str, Any]:
        """Return state and result, without what only shows parts of them."""
        return {"state": self.state, "result": self.result}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what :meth:`__getstate__` returned, and show its parts again."""
        self.__dict__.update(state)
        self._show()

    def _show(self) -> None:
        """Keep views of what is often read."""
        self.q, self.dq = np.zeros((2, self.state.estimated.shape[1]))
        self.scalars, self.out = self.state.scalars[0], self.result.scalars[0]
        out = self.result.scalars
        self._clock, self._hand, self._brakes = out["t"], out["hand"], out["brakes"]
        self.handles: tuple[StateHandle, ResultHandle] = (
            state_handle(self.state),
            result_handle(self.result),
        )

    @property
    def t(self) -> float:
        """Time of the last tick [s]."""
        t: float = self._clock.item()
        return t

    @property
    def halted(self) -> bool:
        """Whether the last command leaves every joint at rest, and no motion of it is left."""
        return bool(self.scalars["halted"])

    @property
    def rests(self) -> bool:
        """Whether command and arm have been at rest for ``DWELL``, where the command is."""
        return bool(self.halted and self.t - self.scalars["t_moved"] >= DWELL - 0.5 * TICK)

    @property
    def held(self) -> bool:
        """Whether a throw is over and the arm rests, by its torques, or by its brakes by now."""
        phase, gone = self.scalars["phase"], self.t >= self.scalars["t_gone"]
        lost = phase == WATCH and not self.out["tracked"]  # it flew otherwise, and was lost
        over = phase in (BRAKE, STOPPED) or (gone and (phase == REFUSED or lost))
        return bool(over and self.rests and (self.scalars["braked"] or not self.out["brakes"]))

    def read(self, arm: Arm, given: ArmState) -> None:
        """Take the encoders over: compiled code sees buffers of one type and the right length.

        Raises:
            ShapeError: They are not those of this arm.
        """
        q, dq, n = given.q, given.dq, arm.n
        if q.shape != (n,) or dq.shape != (n,):
            raise ShapeError(
                "senses.arm.q, .dq",
                f"({n},)",
                q.shape if len(q) != n else dq.shape,
                do=f"give the active joints {', '.join(arm.names)}",
            )
        self.q[:], self.dq[:] = q, dq

    def command(self, gaze: Array | None) -> Command:
        """Return the command of the last tick, with where the heads are to look."""
        return Command(
            self.t, self.result.command.copy(), self._hand.item(), gaze, self._brakes.item()
        )

    def restart(self, blank: CatcherState, eyes: Eyes) -> None:
        """Overwrite both by a beginning, from where the encoders say the arm is and what holds it.

        The hand opens: a ball drops.
        """
        state, result = _begun(blank, eyes)
        state.estimated[:] = self.state.estimated
        state.tracking.before[:] = self.state.tracking.before
        state.health["t"] = self.state.health["t"]  # of these torques
        state.scalars["braked"] = self.scalars["braked"]
        overwrite((self.state, self.result), (state, result))

    def let_go(self, blank: CatcherState, arm: Arm) -> None:
        """Open the hand: the arm carries nothing from now on."""
        self.state.fingers[:] = blank.fingers
        exchange_arm(self.state, arm)


def _begun(blank: CatcherState, eyes: Eyes) -> tuple[CatcherState, Result]:
    """Return a copy of a state, and a result before any tick."""
    n = blank.estimated.shape[1]
    return begun_with(blank, eyes), fresh_result(n, max(eyes.heads, 1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tick:
    """All that one tick brought about.

    Attributes:
        phase: Phase in which it was made.
        ball: Estimate of the ball, carried to the time of the command.
        reference: The generator's reference, before any limit; None while there is none.
        tracked: Command and its parts.
        state: State of the catcher.
        reason: Why it is not nominal.
        age: Age of the last good measurement of the ball [s]; infinite without a track.
        sigma: 1-sigma of the ball's predicted position, which may have bounced unseen [m];
            infinite without a track.
    """

    phase: Phase
    ball: BallState
    reference: JointReference | None
    tracked: Tracked
    state: State
    reason: Reason
    age: float
    sigma: float

    __repr__ = brief


def tick_of(result: Result) -> Tick:
    """Return a result as what it means; it is copied."""
    result, numbers = copied(result), result.scalars[0].item()
    s = dict(zip(_RESULT, numbers, strict=True))
    command = Command(t=s["t"], joints=result.command, hand=s["hand"], brakes=s["brakes"])
    return Tick(
        phase=PHASES[s["phase"]],
        ball=ball_in(result),
        reference=_reference_of(result) if s["following"] else None,
        tracked=Tracked(command=command, saturated=s["saturated"]),
        state=STATES[s["health"]],
        reason=REASONS[s["reason"]],
        age=s["age"],
        sigma=s["sigma"],
    )


def ball_in(result: Result) -> BallState:
    """Return the estimate that a result holds now, a copy; none that is past all numbers."""
    s, P = result.scalars[0], result.covariance.copy()
    sound = bool(np.isfinite(P).all())
    return BallState(
        t=s["t_ball"].item(),
        tracked=s["tracked"].item() and sound,
        r_o=result.ball[0].copy(),
        dr_o=result.ball[1].copy(),
        ddr_o=result.ball[2].copy(),
        drag=s["drag"].item(),
        covariance=P if sound else np.zeros((6, 6)),
        t_seen=s["t_seen"].item(),
        t_first=s["t_first"].item(),
        led=s["led"].item(),
        lift=np.array([s[name].item() for name in LIFT]),
    )


def _reference_of(result: Result) -> JointReference:
    """Return the generator's reference in a copied result."""
    s = result.scalars[0]
    return reference_of(
        s["t"].item(),
        result.reference,
        inside=bool(s["inside"]),
        time_to_catch=s["time_to_catch"].item(),
    )


def stopped_by(
    arm: Arm, joints: Record, estimated: Array, result: Result, age: float | None
) -> StoppedBy:
    """Return why the tick just made has stopped the arm, and what the catcher knew then.

    Args:
        arm: The arm.
        joints: As of :class:`mitt.core.control.encoders.Monitor`.
        estimated: q, dq as estimated [rad, rad/s], shape (2, n).
        result: That of the tick.
        age: As of :func:`mitt.core.control.health.hint_of`.
    """
    s, encoders = result.scalars[0], result.encoders.copy()
    reason = REASONS[s["reason"]]
    bad = faulty(joints) if reason in ENCODER_REASONS else []
    return StoppedBy(
        state=STATES[s["health"]],
        reason=reason,
        joint=arm.names[bad[0]] if bad else None,
        t=s["t"].item(),
        q=estimated[0].copy(),
        dq=estimated[1].copy(),
        q_read=encoders[0],
        dq_read=encoders[1],
        command=result.command.copy(),
        brakes=s["brakes"].item(),
        hint=hint_of(arm, reason, encoders[0], age),
    )
