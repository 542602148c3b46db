"""What a catcher knows and remembers.

It is a named tuple of arrays that Python and compiled code share: each reads and writes them in
place, by the same names (:mod:`mitt.structs`). Single numbers are fields of one record,
``scalars``. No type holds the number of joints, heads or coefficients, so one compilation serves
every arm.
"""

from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.ball import memory
from mitt.ball.filter import settings_of
from mitt.catcher.settings import WATCH, CatcherSettings
from mitt.control import encoder_memory, health
from mitt.control.envelope import bounds_of
from mitt.control.hand import pack_grip
from mitt.control.tracking import SCRATCH, slew_of
from mitt.control.viability import SafetyFilter
from mitt.fields import line
from mitt.generator.feasibility import trusted, waiting_height
from mitt.generator.mapping import DirectMap
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import slopes_work
from mitt.robot.kinematics import packed_chain, tip_motion
from mitt.robot.shapes import Surroundings
from mitt.signals import TICK, Array
from mitt.structs import Handle, Record, define, record_of
from mitt.vision.eyes import Eyes

Fields: TypeAlias = dict[str, NDArray[Any]]

#: Single numbers of a state, with what they begin as.
_STATE = {
    "phase": WATCH, "passed": TICK, "ahead": 0.0, "t_read": -np.inf, "lag": 0.0, "stamp": np.nan,
    "stale": False, "age_told": 0.0, "waited": 0.0,
    "surrogate": False, "begun": False, "several": False, "stop_requested": False,
    "braked": False, "t_brake": 0.0, "t_brakes_on": np.inf, "brake_delay": 0.0, "clock_fault": 0,
    "encoder_fault": 0, "failures": 0, "tolerance": 0.0, "max_tracking_error": 0.0, "review": 0.0,
    "t_reviewed": -np.inf, "watch": 0.0, "t_look": -np.inf, "t_ahead": np.inf,
    "t_rest": -np.inf,
    "heads": 0, "t_exposed": 0.0, "bandwidth": 0.0, "adapt_q": 0.0, "adapt_dq": 0.0,
    "adapt_until": 0.0, "torque_lead": 0.0, "sigma_ready": np.inf, "waiting_height": 0.0,
    "flight_sigma": np.inf,
}  # fmt: skip


class CatcherState(NamedTuple):
    """What a catcher knows and remembers.

    Attributes:
        scalars: Single numbers, shape (1,):
            phase, surrogate: Phase, and whether the ball's surrogate target is followed.
            passed: Time since the tick before [s].
            ahead: By how much ``last`` is ahead of the tick, in ticks.
            t_read, lag, stamp: When the newest reading was made [s], how old it was in its tick
            [s], and the stamp of the last reading, new or old [s].
            stale, age_told: Whether the last reading was an old one, and how much earlier than the
            tick it was stamped [s].
            waited: How long the first of ``encoder_waiting`` has acted, in ticks.
            begun: Whether each joint was read.
            several: Whether there are several maps to choose from; review, t_reviewed: how often
            the choice is reviewed, and when it was last [s].
            stop_requested: Whether a stop was requested.
            t_brakes_on, braked, brake_delay: When the brakes were commanded to engage [s], whether
            they have, and how long they take [s].
            failures: Ticks in a row in which the generator failed; enough at once where what is
            thought between ticks did.
            clock_fault, encoder_fault, tolerance: As in :mod:`mitt.control.health`;
            max_tracking_error: as of ``CatcherSettings`` [rad].
            t_brake, t_rest: Time at which braking began, and at which it ends [s].
            watch: Longest time from first sight to the verdict [s].
            t_ahead: When a catch was ahead last, or a wait for one began [s]; infinite before.
            t_look: Time before which there is no verdict: one that refuses a far ball waits [s].
            sigma_ready: As of ``CatcherSettings``; infinite where the generator predicts it.
            flight_sigma: 1-sigma of the ball's position if it flies on as it did [m].
            heads: Number of heads; t_exposed: instant of the newest image [s].
            bandwidth, adapt_...: As of ``CatcherSettings``; torque_lead: see
            :mod:`mitt.control.margin`.
            waiting_height: Of :func:`mitt.generator.feasibility.level` [m].
        estimated: q, dq of the joints as the monitor estimates them [rad, rad/s], shape (2, n).
        desired: q_d, dq_d, ddq_d of the last tick, shape (3, n).
        last: Last command within limits, as in :mod:`mitt.control.viability`, shape (3, n);
            before: the one a tick before it.
        health_memory: As in :mod:`mitt.control.health`.
        taken: q, dq of the reading as the monitor takes it; NaN for an old one, shape (2, n).
        encoder_memory: As in :mod:`mitt.control.encoder_memory`; encoder_table,
            encoder_ddq_unknown, encoder_coupling, encoder_work: as in :mod:`mitt.control.encoders`;
            encoder_waiting: accelerations that commands will cause once they act, oldest first,
            shape (k, n).
        z, R, target: Position of a sighting, its covariance, and the ball to be followed; while
            the arm brakes the catch point, its velocity, and where it was at the exposure.
        chain: As of :func:`mitt.robot.kinematics.packed_chain`.
        ball_memory, ball_settings, ball_work: Of :mod:`mitt.ball.estimator`.
        closing, grip, gap: As in :mod:`mitt.control.hand`; palm: its normal in the last frame,
            ``palm_now`` in the base frame, shape (3,).
        slew, track_scratch: For the tracking; see :func:`mitt.control.tracking.slew_of`.
        jump: As in :mod:`mitt.control.margin`.
        impact_dq: Change of the joint speeds that the ball may cause now [rad/s], shape (n,).
        eyes_...: Arrays of :func:`mitt.vision.localization.localize` and of the gaze.
        bounds, shapes, pairs, filter_...: As in :mod:`mitt.control.viability`; encoder_bounds: the
            same for the encoders' monitor, without room for an impact.
        drives, drives_now: Drives as of :mod:`mitt.control.margin`.
        bodies, active: The arm's links, and which of them are active joints.
        room, room_...: For :func:`mitt.control.stop.short_of_room`.
        packed, powers, window, alpha, start, trusted, map_work: The map, as the kernels of
            :mod:`mitt.generator.evaluation` take it; empty where the generator is no map.
    """

    scalars: Record
    estimated: Array
    desired: Array
    last: Array
    before: Array
    health_memory: Array
    taken: Array
    encoder_memory: Array
    encoder_table: Array
    encoder_ddq_unknown: Array
    encoder_coupling: Array
    encoder_waiting: Array
    encoder_work: Array
    z: Array
    R: Array
    target: Array
    chain: Array
    ball_memory: Array
    ball_settings: Array
    ball_work: Array
    closing: Array
    grip: Array
    gap: Array
    palm: Array
    palm_now: Array
    slew: Array
    track_scratch: Array
    jump: Array
    impact_dq: Array
    eyes_memory: Array
    eyes_settings: Array
    eyes_boxes: NDArray[np.int64]
    eyes_cameras: Array
    eyes_ball: Array
    eyes_work: Array
    eyes_heads: Array
    eyes_angles: Array
    eyes_gaze: Array
    eyes_gaze_work: Array
    bounds: Array
    encoder_bounds: Array
    shapes: Array
    pairs: NDArray[np.int64]
    filter_known: Array
    filter_work: Array
    filter_reserve: Array
    drives: Array
    drives_now: Array
    bodies: Array
    active: NDArray[np.int64]
    room: Array
    room_tau: Array
    room_mass: Array
    room_work: Array
    packed: Array
    powers: NDArray[np.int64]
    window: Array
    alpha: Array
    start: Array
    trusted: Array
    map_work: Array

    def __repr__(self) -> str:
        """Return one line."""
        return line("CatcherState", self._asdict().items())


class StateHandle(Handle):
    """A state, for kernels."""


define(StateHandle, CatcherState)


@kernel
def state_handle(state: CatcherState) -> Any:  # noqa: ANN401
    """Return the handle of a state."""
    return StateHandle(*state)


def fresh_state(
    arm: Arm, eyes: Eyes, settings: CatcherSettings, f: DirectMap | None, *, several: bool = False,
    sigma_ready: float = np.inf,
) -> CatcherState:  # fmt: skip
    """Return what a catcher knows and remembers at the start of a throw.

    Args:
        arm: The arm.
        eyes: Its eyes, whose arrays the state shares; all others are its own.
        settings: Of the catcher.
        f: The map, if the generator is one.
        several: Whether there are several maps to choose from.
        sigma_ready: As of :class:`CatcherState`.
    """
    s, n, table = settings, arm.n, settings.encoders.table(arm)
    still = np.zeros(n)
    own = {name: getattr(s, name) for name in _STATE if hasattr(s, name)}
    scalars = _STATE | own | {
        "several": several, "sigma_ready": sigma_ready, "heads": eyes.heads,
        "brake_delay": max(brake.delay for brake in arm.brakes),
        "waiting_height": 0.0 if f is None else waiting_height(f),
    }  # fmt: skip
    fields: Fields = {
        "scalars": record_of(scalars, _STATE),
        "estimated": np.array([arm.q_ready, still]),
        "desired": np.array([arm.q_ready, still, still]),
        "last": np.array([arm.q_ready, still, still]),
        "before": np.array([arm.q_ready, still, still]),
        "taken": np.zeros((2, n)),
        "health_memory": health.memory(), "encoder_memory": encoder_memory.memory_of(n),
        "encoder_table": table,
        "encoder_ddq_unknown": np.array([table[1] / np.diag(arm.mass_matrix(arm.q_ready))] * 2),
        "encoder_coupling": np.zeros((n, n)), "encoder_work": np.zeros((n + 2, 2 * n)),
        "encoder_waiting": np.zeros((s.setpoint_delay + 1, n)),
        "z": np.zeros(3), "R": np.zeros((3, 3)), "target": np.zeros((3, 3)),
        "chain": packed_chain(arm.chain),
        "ball_memory": memory.fresh(), "ball_settings": settings_of(s.flight),
        "ball_work": np.zeros(memory.WORK), "closing": np.full(3, np.inf),
        "gap": np.zeros((2, 3)),
        "palm": palm_of(arm), "palm_now": np.zeros(3),
        "grip": pack_grip(arm.model.hand, s.ball_radius, s.ball_restitution),
        "track_scratch": np.zeros((len(arm.model.links), SCRATCH)), "jump": np.zeros(n),
        "impact_dq": np.zeros(n), "slew": slew_of(arm),
    }  # fmt: skip
    fields |= arm_fields(arm, s.around) | map_fields(f)
    own_arrays = {name: np.array(value, order="C") for name, value in fields.items()}
    return CatcherState(**own_arrays, **eye_fields(eyes))


def palm_of(arm: Arm) -> Array:
    """Return the palm's normal in the frame of the last active joint, shape (3,)."""
    q = arm.q_ready
    frame = np.reshape(tip_motion(packed_chain(arm.chain), q, q, np.zeros((2, 3))), (3, 3))
    normal: Array = frame.T @ arm.orientation(q)[:, 2]
    return normal


@lru_cache(maxsize=32)
def arm_fields(arm: Arm, around: Surroundings) -> Fields:
    """Return what the tracking knows of an arm, which changes when it holds the ball.

    Worked out once, not to be written to. ``encoder_bounds`` are the bounds for the encoders'
    monitor, those of ``bounds`` without room for an impact; ``drives_now`` are the drives as of
    :mod:`mitt.control.margin`; ``room`` and what follows is for
    :func:`mitt.control.stop.short_of_room`.
    """
    safety_filter, links = SafetyFilter(arm, around), len(arm.bodies)
    return {
        "bounds": safety_filter.bounds,
        "encoder_bounds": bounds_of(arm, commanded=False),
        "shapes": safety_filter.shapes.table,
        "pairs": safety_filter.shapes.pairs,
        "filter_known": safety_filter.known,
        "filter_work": safety_filter.work,
        "filter_reserve": safety_filter.reserve,
        "drives": arm.limits.packed,
        "drives_now": arm.limits.packed,
        "bodies": arm.bodies,
        "active": np.array(arm.model.active),
        "room": np.array([arm.tau_max, arm.q_min, arm.q_max]),
        "room_tau": np.zeros(links),
        "room_mass": np.zeros((links, arm.n)),
        "room_work": slopes_work(links),
    }


def prepare_holding(arm: Arm, settings: CatcherSettings) -> None:
    """Work out now what is kept of the arm with the ball, not in the middle of a catch.

    Args:
        arm: The arm.
        settings: Of the catcher.
    """
    arm_fields(arm.holding(settings.ball_mass), settings.around)
    if arm.limits.smooth:  # the verdict plans the brake for the heaviest ball
        bounds_of(arm.holding(settings.caught.heaviest))


def map_fields(f: DirectMap | None) -> Fields:
    """Return a map as the kernels of :mod:`mitt.generator.evaluation` take it; empty without."""
    if f is None:
        empty = {name: np.zeros(0) for name in ("packed", "start", "map_work")}
        pairs = {name: np.zeros((0, 0)) for name in ("alpha", "window", "trusted")}
        return empty | pairs | {"powers": np.zeros((0, 0), np.int64)}
    return {
        "packed": f.packed,
        "powers": f.basis.powers,
        "window": f.window,
        "alpha": f.alpha,
        "start": f.start,
        "trusted": trusted(f),
        "map_work": f.work,
    }


def begun_with(state: CatcherState, eyes: Eyes) -> CatcherState:
    """Return a copy of a state that shares the arrays of other eyes."""
    fields = {name: x.copy() for name, x in state._asdict().items() if not name.startswith("eyes_")}
    return CatcherState(**fields, **eye_fields(eyes))


def eye_fields(eyes: Eyes) -> Fields:
    """Return the arrays of the eyes, which the state shares."""
    return {f"eyes_{name}": x for name, x in eyes.arrays().items()}
