"""What a tick brings about: arrays shared with compiled code, and what they mean."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mitt.catcher.settings import PHASES, WATCH, Phase
from mitt.control.health import ENCODER_REASONS, Reason, State
from mitt.control.monitor import faulty
from mitt.control.stopped import StoppedBy, hint_of
from mitt.control.tracking import Tracked
from mitt.fields import brief, line
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState, Command, JointReference, MapStatus
from mitt.structs import Handle, Record, define, record_of

#: States and reasons in the order of their numbers.
STATES, REASONS = tuple(State), tuple(Reason)

#: Single numbers of a result, with what they begin as.
_RESULT = {
    "t": 0.0, "phase": WATCH, "t_ball": 0.0, "tracked": False, "led": False, "drag": 0.0,
    "t_seen": -np.inf, "t_first": -np.inf, "following": False, "inside": False,
    "time_to_catch": np.inf, "hand": 0.0, "saturated": False, "health": 0, "reason": 0,
    "age": np.inf, "sigma": np.inf, "brakes": False, "sighted": False, "t_sighted": 0.0,
}  # fmt: skip


class Result(NamedTuple):
    """What a tick brought about, and the next one starts from.

    Those of k ticks are kept in one as well, with k rows in each array.

    Attributes:
        scalars: Single numbers, shape (1,):
            t, phase: Time of the tick [s], and the phase in which it was made.
            tracked, t_ball: Whether there is an estimate of the ball, and of which instant [s].
            led, drag, t_seen, t_first: As of ``BallState``.
            following, inside: Whether the generator was evaluated, and its reference is a motion.
            time_to_catch: Time to the catch [s]; infinite where none is in sight.
            hand: Closing angle of the fingers commanded [rad].
            saturated: Whether a torque limit was met.
            health, reason: State and reason as in :mod:`mitt.control.health`.
            age: Age of the last good measurement [s]; infinite without a track.
            sigma: 1-sigma of the ball's predicted position, which may have bounced unseen [m];
            infinite without a track.
            brakes: Whether the brakes are to be engaged.
            sighted, t_sighted: Whether the eyes found the ball, and when it was exposed [s]. The
            filter is given its position, but for that of a ball which the braking hand holds.
        encoders: q, dq as read [rad, rad/s], shape (2, n).
        ball: r_o, dr_o, ddr_o of the ball at ``t_ball``, shape (3, 3); zero without an estimate.
        covariance: Of r_o, dr_o, shape (6, 6).
        reference: q_d, q_o and their derivatives, shape (6, n).
        command: q, dq, ddq, tau of the command, and the acceleration that tau brings by the model,
            shape (5, n).
        gaze: Where the heads are to look, as of ``Command``, shape (heads, 4).
        sighting: What the eyes said last: position [m], then its covariance [m^2], shape (4, 3).
    """

    scalars: Record
    encoders: Array
    ball: Array
    covariance: Array
    reference: Array
    command: Array
    gaze: Array
    sighting: Array

    def __repr__(self) -> str:
        """Return one line."""
        return line("Result", self._asdict().items())


class ResultHandle(Handle):
    """A result, for kernels."""


define(ResultHandle, Result)


@kernel
def result_handle(result: Result) -> Any:  # noqa: ANN401
    """Return the handle of a result."""
    return ResultHandle(*result)


@kernel
def store(result: Any, ticks: Any, k: int) -> None:  # noqa: ANN401
    """Write a result into row ``k`` of room for many, both handles."""
    ticks.scalars[k] = result.scalars[0]
    ticks.encoders[k] = result.encoders
    ticks.ball[k] = result.ball
    ticks.covariance[k] = result.covariance
    ticks.reference[k] = result.reference
    ticks.command[k] = result.command
    ticks.gaze[k] = result.gaze
    ticks.sighting[k] = result.sighting


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


def fresh_result(n: int, heads: int = 1) -> Result:
    """Return the result of no tick for ``n`` joints."""
    shapes = (2, n), (3, 3), (6, 6), (6, n), (5, n), (heads, 4), (4, 3)
    return Result(record_of(_RESULT, _RESULT), *(np.zeros(shape) for shape in shapes))


def room_for(result: Result, ticks: int) -> Result:
    """Return room for the results of ``ticks`` ticks."""
    scalars, *arrays = result
    return Result(np.repeat(scalars, ticks), *(np.zeros((ticks, *x.shape)) for x in arrays))


def copied(result: Result) -> Result:
    """Return a copy of a result."""
    return Result._make(x.copy() for x in result)


def rows_of(ticks: Result, first: int, last: int) -> Result:
    """Return ticks ``first`` to before ``last`` of many, as views."""
    return Result._make(x[first:last] for x in ticks)


def gathered(results: Sequence[Result]) -> Result:
    """Return the results of single ticks, one or more, as one of many."""
    scalars, *arrays = zip(*results, strict=True)
    return Result(np.concatenate(scalars), *(np.stack(x) for x in arrays))


def tick_of(result: Result) -> Tick:
    """Return a result as what it means; it is copied."""
    result, numbers = copied(result), result.scalars[0].item()
    s = dict(zip(_RESULT, numbers, strict=True))
    command = Command(t=s["t"], joints=result.command[:4], hand=s["hand"], brakes=s["brakes"])
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
        t=s["t_ball"].item(), tracked=s["tracked"].item() and sound, r_o=result.ball[0].copy(),
        dr_o=result.ball[1].copy(), ddr_o=result.ball[2].copy(), drag=s["drag"].item(),
        covariance=P if sound else np.zeros((6, 6)), t_seen=s["t_seen"].item(),
        t_first=s["t_first"].item(), led=s["led"].item(),
    )  # fmt: skip


def _reference_of(result: Result) -> JointReference:
    """Return the generator's reference in a copied result."""
    s, rows = result.scalars[0], result.reference
    return JointReference(
        t=s["t"].item(),
        status=MapStatus.INSIDE if s["inside"] else MapStatus.DOMAIN,
        q_d=rows[0],
        dq_d=rows[1],
        ddq_d=rows[2],
        q_o=rows[3],
        dq_o=rows[4],
        time_to_catch=s["time_to_catch"].item(),
    )


def stopped_by(
    arm: Arm, encoder_memory: Array, estimated: Array, result: Result, age: float | None
) -> StoppedBy:
    """Return why the tick just made has stopped the arm, and what the catcher knew then.

    Args:
        arm: The arm.
        encoder_memory: As in :mod:`mitt.control.encoder_memory`.
        estimated: q, dq as estimated [rad, rad/s], shape (2, n).
        result: That of the tick.
        age: As of :func:`mitt.control.stopped.hint_of`.
    """
    s, encoders = result.scalars[0], result.encoders.copy()
    reason = REASONS[s["reason"]]
    joints = faulty(encoder_memory)
    by_encoder = reason in ENCODER_REASONS and len(joints) > 0
    return StoppedBy(
        state=STATES[s["health"]],
        reason=reason,
        joint=arm.names[joints[0]] if by_encoder else None,
        t=s["t"].item(),
        q=estimated[0].copy(),
        dq=estimated[1].copy(),
        q_read=encoders[0],
        dq_read=encoders[1],
        command=result.command[:4].copy(),
        brakes=s["brakes"].item(),
        hint=hint_of(arm, reason, encoders[0], age),
    )
