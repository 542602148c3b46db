"""What the compiled tick knows and what it brings about, as records, and what these mean.

A record is a structured array of shape (1,): compiled code reads and writes its fields in place,
and Python sees the same fields by the same names.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.ball import memory
from mitt.ball.filter import THROWN_BALL, FilterConfig, settings_of
from mitt.control import health, monitor
from mitt.control.encoders import Encoders
from mitt.control.hand import pack_grip
from mitt.control.health import Reason, State
from mitt.control.tracking import NOTES, ROWS, Tracked
from mitt.control.viability import Guard
from mitt.generator.feasibility import trusted, waiting_height
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.robot.shapes import Surroundings
from mitt.robot.slopes import slopes_work
from mitt.signals import BallState, Command, JointReference, MapStatus, ball_of
from mitt.vision.eyes import Eyes

Record: TypeAlias = NDArray[np.void]
Fields: TypeAlias = dict[str, NDArray[Any] | np.generic | float]

#: What the catcher is about, in the field ``phase``; the names are those of :class:`Phase`.
WATCH, FOLLOW, BRAKE, REFUSED, STOPPED = range(5)


class Phase(Enum):
    """What the catcher is about."""

    WATCH = "watch"
    FOLLOW = "follow"
    BRAKE = "brake"
    REFUSED = "refused"
    STOPPED = "stopped"


#: The phases in the order of their numbers.
PHASES = tuple(Phase)
#: States and reasons in the order of their numbers.
STATES, REASONS = tuple(State), tuple(Reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class CatcherSettings:
    """Settings of the catcher.

    Attributes:
        bandwidth: Bandwidth of the tracking error [rad/s].
        sigma_ready: Predicted 1-sigma at the catch at which the arm starts to move [m].
        watch: Longest time from first sight to the verdict [s].
        adapt_q: Gap between desired and true joint angles at which to adapt anew [rad].
        adapt_dq: The same for joint speeds [rad/s].
        adapt_until: Time to the catch below which the map is left as it is [s].
        review: Time between two reviews of the choice among several maps [s].
        ball_mass: Mass of the ball, carried by the model while it is held [kg].
        ball_radius: Radius of the ball [m]; the eyes are told the same.
        ball_restitution: Share of its speed with which the ball springs back from the palm.
        ball_friction: Coefficient of friction of ball and hand.
        ball_doubt: Relative error that its mass may have.
        flight: What the filter believes of the ball's flight.
        around: What stands around the arm and is not to be touched.
        encoders: What is known of the joint encoders.
        tolerance: 1-sigma of the ball's position beyond which an unseen ball is lost [m]; a hand
            needs about 2 cm (Baeuml and others, ICRA 2011).
        stray: Gap between told and true joint angles at which the arm is stopped if it lasts
            20 ms [rad]; infinite for the map with alpha = 0, which saturates for longer.
        torque_lead: Time from the reading of the joints until the torque that is commanded then
            ceases to act [s]: a tick, and what the drives take to answer.
    """

    bandwidth: float = 80.0
    sigma_ready: float = 0.02
    watch: float = 0.08
    adapt_q: float = 0.06
    adapt_dq: float = 1.2
    adapt_until: float = 0.05
    review: float = 0.02
    ball_mass: float = 0.07
    ball_radius: float = 0.04
    ball_restitution: float = 0.2
    ball_friction: float = 1.0
    ball_doubt: float = 0.1
    flight: FilterConfig = field(default_factory=lambda: THROWN_BALL)
    around: Surroundings = field(default_factory=Surroundings)
    encoders: Encoders = field(default_factory=Encoders)
    tolerance: float = 0.02
    stray: float = 0.8
    torque_lead: float = 0.001


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tick:
    """All that one tick brought about.

    Attributes:
        phase: Phase in which it was made.
        ball: Estimate of the ball, carried to the time of the command.
        reference: What the generator asked for, before any limit; None while it is not asked.
        tracked: Command and its parts.
        state: State of the catcher.
        reason: Why it is not nominal.
        age: Age of the last good measurement of the ball [s]; infinite without a track.
        sigma: 1-sigma of the ball's predicted position [m]; infinite without a track.
    """

    phase: Phase
    ball: BallState
    reference: JointReference | None
    tracked: Tracked
    state: State
    reason: Reason
    age: float
    sigma: float


def record_of(fields: Fields) -> Record:
    """Return a record, shape (1,), with these fields and values."""
    values = {name: np.asarray(value) for name, value in fields.items()}
    layout = tuple((name, value.dtype.str, value.shape) for name, value in values.items())
    record = np.zeros(1, _layout(layout))
    for name, value in values.items():
        record[name][0] = value
    return record


def known_layout(record: Record) -> Record:
    """Return a record with the layout that others of its fields have, as after unpickling."""
    layout = tuple((name, sub[0].str, sub[1]) for name, sub in _fields(record.dtype))
    return record.view(_layout(layout))


def _fields(kind: np.dtype[np.void]) -> Iterator[tuple[str, tuple[np.dtype[Any], tuple[int, ...]]]]:
    """Return name, base type and shape of each field of a layout."""
    for name in kind.names or ():
        part = kind[name]
        yield name, part.subdtype or (part, ())


@lru_cache(maxsize=64)
def _layout(fields: tuple[tuple[str, str, tuple[int, ...]], ...]) -> np.dtype[np.void]:
    """Return the layout of a record; the same object for the same fields.

    Numba knows a type by the object, and compares field by field where it is another: 7 us a call.
    """
    return np.dtype(list(fields), align=True)


def fresh_result(n: int, heads: int = 1) -> Record:
    """Return the result of no tick for ``n`` joints.

    Fields:
        t: Time of the tick [s].
        phase: Phase in which it was made.
        encoders: q, dq as read [rad, rad/s], shape (2, n).
        tracked: Whether there is an estimate of the ball.
        ball: r_o, dr_o, ddr_o of the ball at ``t_ball``, shape (3, 3), zero if not ``tracked``;
            with them ``covariance``, ``drag``, ``t_seen``, ``t_first``, ``led`` of ``BallState``.
        following: Whether the generator was asked.
        inside: Whether its answer is a motion.
        asked: q_d, q_o and their derivatives, shape (6, n).
        time_to_catch: Time to the catch [s]; infinite where none is in sight.
        told: q, dq, ddq, tau of the command, and the acceleration that tau brings by the model,
            shape (5, n).
        hand: Closing angle of the fingers commanded [rad].
        saturated: Whether a torque limit was met.
        state, reason: As in :mod:`mitt.control.health`.
        age: Age of the last good measurement [s]; infinite without a track.
        sigma: 1-sigma of the ball's predicted position [m]; infinite without a track.
        gaze: Where the heads are to look, as of ``Command``, shape (heads, 4).
        brakes: Whether the brakes are to be engaged.
    """
    fields: Fields = {
        "t": 0.0, "phase": np.int64(WATCH), "encoders": np.zeros((2, n)),
        "ball": np.zeros((3, 3)), "t_ball": 0.0, "tracked": np.bool_(False),
        "led": np.bool_(False),
        "covariance": np.zeros((6, 6)), "drag": 0.0, "t_seen": -np.inf, "t_first": -np.inf,
        "following": np.bool_(False), "inside": np.bool_(False), "asked": np.zeros((6, n)),
        "time_to_catch": np.inf, "told": np.zeros((ROWS, n)), "hand": 0.0,
        "saturated": np.bool_(False), "state": np.int64(0), "reason": np.int64(0),
        "age": np.inf, "sigma": np.inf,
        "gaze": np.zeros((heads, 4)), "brakes": np.bool_(False),
    }  # fmt: skip
    return record_of(fields)


def catcher_fields(arm: Arm, eyes: Eyes, settings: CatcherSettings) -> Fields:
    """Return what a catcher knows and remembers at the start of a throw.

    Fields:
        phase, open: Phase, and whether the ball's stand-in is followed.
        believed: q, dq of the joints as the monitor believes them [rad, rad/s], shape (2, n).
        begun: Whether there was a tick.
        encoder_memory: As in :mod:`mitt.control.monitor`; encoder_table, encoder_doubt,
            encoder_coupling, encoder_work: as in :mod:`mitt.control.encoders`.
        t_brakes, braked, brake_delay: When the brakes were told to engage [s], whether they have,
            and how long they take [s].
        condition, clock, encoders, tolerance, stray: As in :mod:`mitt.control.health`.
        shapes, pairs, guard_..., last: As in :mod:`mitt.control.viability`.
        wanted: q_d, dq_d, ddq_d of the last tick, shape (3, n).
        t_brake: Time at which braking began [s].
        watch: Longest time from first sight to the verdict [s].
        t_look: Time before which there is no verdict: one that refuses a far ball waits [s].
        review, t_reviewed: How often the choice of the map is reviewed, and when it was last [s].
        eyes_...: Arrays of :func:`mitt.vision.localization.localize`; z, R: its results.
        ball_...: Memory, settings and scratch of :mod:`mitt.ball.estimator`.
        closing, grip: As in :mod:`mitt.control.hand`.
        adapt_...: As in :class:`CatcherSettings`.
        bandwidth, track_notes, target: For the tracking, and scratch.
        jump, torque_lead: As in :mod:`mitt.control.margin`.
        blow: Change of the joint speeds that the ball may bring now, shape (n,) [rad/s].
    """
    s, n, table = settings, arm.n, settings.encoders.table(arm)
    still = np.zeros(n)
    fields: Fields = {
        "phase": np.int64(WATCH), "open": np.bool_(False),
        "believed": np.array([arm.q_ready, still]), "wanted": np.array([arm.q_ready, still, still]),
        "t_brake": 0.0, "z": np.zeros(3), "R": np.zeros((3, 3)), "target": np.zeros((3, 3)),
        "ball_memory": memory.fresh(), "ball_settings": settings_of(s.flight),
        "ball_work": np.zeros(memory.WORK), "closing": np.array([np.inf]),
        "grip": pack_grip(arm.model.hand, s.ball_radius, s.ball_restitution),
        "adapt_q": s.adapt_q,
        "adapt_dq": s.adapt_dq, "adapt_until": s.adapt_until, "bandwidth": s.bandwidth,
        "track_notes": np.zeros((len(arm.model.links), NOTES)), "begun": np.bool_(False),
        "encoder_memory": monitor.memory_of(n), "encoder_table": table,
        "encoder_doubt": np.array([table[1] / np.diag(arm.mass_matrix(arm.q_ready))] * 2),
        "encoder_coupling": np.zeros((n, n)),
        "encoder_work": np.zeros((n + 2, 2 * n)),
        "t_brakes": np.inf, "braked": np.bool_(False),
        "brake_delay": max(brake.delay for brake in arm.brakes),
        "condition": health.memory(), "clock": np.int64(0), "encoders": np.int64(0),
        "tolerance": s.tolerance, "stray": s.stray, "asked_to_stop": np.bool_(False),
        "review": s.review, "t_reviewed": -np.inf, "watch": s.watch, "t_look": -np.inf,
        "heads": np.int64(eyes.heads), "t_exposed": 0.0,
        "last": np.array([arm.q_ready, still, still]),
        "jump": np.zeros(n), "blow": np.zeros(n), "torque_lead": s.torque_lead,
    }  # fmt: skip
    return fields | {f"eyes_{name}": value for name, value in eyes.parts().items()}


@lru_cache(maxsize=32)
def arm_fields(arm: Arm, around: Surroundings) -> Fields:
    """Return what the tracking knows of an arm, which changes when it holds the ball.

    Worked out once, not to be written to. ``encoder_bounds`` are the bounds for the encoders'
    monitor, those of ``bounds`` without room for an impact; ``drives_now`` are the drives as of
    :mod:`mitt.control.margin`; ``room`` and what follows is for
    :func:`mitt.control.stop.short_of_room`.
    """
    guard, links = Guard(arm, around), len(arm.bodies)
    return {
        "bounds": guard.bounds,
        "encoder_bounds": guard.bounds,
        "shapes": guard.shapes.table,
        "pairs": guard.shapes.pairs,
        "guard_known": guard.known,
        "guard_work": guard.work,
        "guard_reserve": guard.reserve,
        "drives": arm.limits.packed,
        "drives_now": arm.limits.packed,
        "bodies": arm.bodies,
        "index": np.array(arm.model.active),
        "room": np.array([arm.tau_max, arm.q_min, arm.q_max]),
        "room_tau": np.zeros(links),
        "room_mass": np.zeros((links, arm.n)),
        "room_work": slopes_work(links),
    }


def map_fields(f: DirectMap) -> Fields:
    """Return a map as the kernels of :mod:`mitt.generator.evaluation` take it."""
    return {
        "packed": f.packed,
        "powers": f.basis.powers,
        "window": f.window,
        "alpha": f.alpha,
        "start": f.start,
        "trusted": trusted(f),
        "map_work": f.work,
        "waiting_height": waiting_height(f),
    }


def tick_of(row: Record) -> Tick:
    """Return a copied result as what it means."""
    told, brakes = row["told"][0, :4], row["brakes"].item()
    command = Command(t=row["t"].item(), told=told, hand=row["hand"].item(), brakes=brakes)
    return Tick(
        phase=PHASES[row["phase"].item()],
        ball=ball_in(ball_parts(row)),
        reference=_reference_of(row) if row["following"].item() else None,
        tracked=Tracked(command=command, saturated=row["saturated"].item()),
        state=STATES[row["state"].item()],
        reason=REASONS[row["reason"].item()],
        age=row["age"].item(),
        sigma=row["sigma"].item(),
    )


def ball_parts(row: Record) -> tuple[NDArray[Any], ...]:
    """Return where a result keeps its estimate of the ball, as :func:`ball_in` reads it."""
    names = ("t_ball", "tracked", "ball", "drag", "covariance", "t_seen", "t_first", "led")
    return tuple(row[name] for name in names)


def ball_in(parts: tuple[NDArray[Any], ...]) -> BallState:
    """Return the estimate that a result holds now, a copy."""
    t, tracked, ball, drag, covariance, t_seen, t_first, led = parts
    return ball_of(
        t.item(), tracked.item(), *ball[0].copy(), drag.item(), covariance[0].copy(),
        t_seen.item(), t_first.item(), led.item(),
    )  # fmt: skip


def _reference_of(row: Record) -> JointReference:
    """Return what the generator asked for in a copied result."""
    asked = row["asked"][0]
    return JointReference(
        t=row["t"].item(),
        status=MapStatus.INSIDE if row["inside"].item() else MapStatus.DOMAIN,
        q_d=asked[0],
        dq_d=asked[1],
        ddq_d=asked[2],
        q_o=asked[3],
        dq_o=asked[4],
        time_to_catch=row["time_to_catch"].item(),
    )
