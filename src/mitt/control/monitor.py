"""The estimate of joint positions and velocities, and whether the encoders can be trusted.

Positions alone are used: encoders count, and a velocity that is a difference of counts is wrong by
up to a count in a tick. Each joint has a Kalman filter of position and velocity that is driven by
the acceleration that the command's torques cause by the model. Its process noise is a third of the
model's largest error (unknown torque, a fifth of the acceleration, its change since the tick
before), its measurement noise that of rounding, so it trusts the counts as far as they go.

An encoder has a fault only where no admissible plant explains what it reads:

* SILENT: no number for ``SILENT_TICKS``. Shorter gaps are bridged by the prediction, and
  up to ``LOSSY_TICKS`` where the encoder has had gaps of late, or has only been read for 0.1 s:
  with 30 % of the readings lost, fifteen in a row are lost once in 7e7 ticks;
* JUMPED: three readings in a row lie where no motion within the limits leads, impacts included: an
  impact changes the velocity, not the place;
* STUCK: the reading stands still while the joint must have moved on by more than five counts. How
  the other joints move is measured, so only a torque at this joint itself can hold it: friction and
  model error have to be larger than is known of them;
* REVERSED: a steady velocity turns round at once to its mirror image; or for some ticks the reading
  moves against the torques, and faster than the joint was of late. What is passive does not do
  that: a wall gives back no more speed than it took. While the ball may strike, a change of
  velocity that its impact explains is none;
* FAST: the joint is half as fast again as its limit.

All of it goes by time, not by calls: the filter by the time between two readings, and so do the
counts, in units of ``TICK``. After a late call nobody knows what the joint did in between, so what
looks at readings in a row begins anew, and after one so late that it stops the arm the filter does.

Then the joint is *unmeasured*: nothing that is read of it reaches the controller. It is predicted
by the model from the last state that was trusted. Good readings end that once a person recovers.

What is remembered is in :mod:`mitt.control.encoder_memory`, the filter in
:mod:`mitt.control.joint_filter`, the tests in :mod:`mitt.control.encoder_faults`.
"""

from collections.abc import Sequence

import numpy as np

from mitt.control import encoder_memory as at
from mitt.control.encoder_faults import (
    EXCESS,
    TRIFLE,
    explain_refused,
    moves_against,
    stands_still,
)
from mitt.control.encoder_memory import BRIDGED, COLUMNS, FAST, FINE, REVERSED, SILENT, STUCK
from mitt.control.health import BRIDGED_TIME, IN_TIME
from mitt.control.joint_filter import IN_A_ROW, correct, predict, restart
from mitt.control.rows import DDQ_BY_TAU, DDQ_MAX, DQ_MAX, Q_MAX, Q_MIN
from mitt.errors import InputError
from mitt.jit import kernel
from mitt.signals import TICK, Array
from mitt.views import view

#: Ticks without a number after which an encoder is silent, for one that has read well and for one
#: that loses readings or has not been read yet; first readings that no joint of the arm can have.
SILENT_TICKS, LOSSY_TICKS, _IMPOSSIBLE = 6, 15, 3
#: Share of a gap that is forgotten in a tick, of one that still counts, and of a new encoder.
_HEALS, _GAP, _NEW = 0.002, 0.3, 0.37
#: How far outside a joint's range a first reading may lie [rad].
BEYOND = 0.5
#: Share of the modelled acceleration that may be wrong.
_MODEL = 0.2
#: Sigmas of an innovation beyond which a reading is refused.
_GATE = 6.0
#: Ticks for which readings in a row have to be refused at least before they are explained.
_APART = 1.5
#: Share of the unevenness of readings that may be their stamps', the most that may be [s], and what
#: of it is forgotten in a tick.
_STAMPED, _MOST_STAMPED, _CALMS = 0.25, 2e-4, 0.02
#: Ticks of good readings after which a faulty encoder counts as good again, how near they have
#: to be to where the joint is predicted [rad], and counts that a stuck one has to move.
GOOD_TICKS, _NEAR, _MOVES = 50, 0.1, 3.0


def faulty(memory: Array) -> list[int]:
    """Return the joints whose encoders have a fault, by their indices."""
    return [int(k) for k in np.flatnonzero(memory[:, at.FAULT])]


def recovered(memory: Array) -> Array:
    """Say of each encoder whether it is trusted, or has read well since its fault, shape (n,)."""
    fine = (memory[:, at.FAULT] == FINE) & (memory[:, at.GONE] == 0.0)
    moved = (memory[:, at.FAULT] != STUCK) | (memory[:, at.MOVED] > 0.0)
    out: Array = fine | ((memory[:, at.GOOD] >= GOOD_TICKS) & moved)
    return out


def check_recovered(names: Sequence[str], memory: Array) -> None:
    """Refuse encoders of which one has a fault and has not read well since; name the joints."""
    pairs = zip(names, recovered(memory), strict=True)
    if bad := ", ".join(name for name, fine in pairs if not fine):
        raise InputError("recover", "encoders that read well", f"doubt about {bad}",
                         do="check the encoder, then recover(checked=True)")  # fmt: skip


@kernel
def estimate_joints(
    memory: Array,
    b: Array,
    steps: Array,
    ddq_unknown: Array,
    coupling: Array,
    read: Array,
    command: Array,
    held: bool,
    impact_dq: Array,
    passed: float,
    dt: float,
    lag: float,
    estimated: Array,
) -> int:
    """Estimate the joints' q and dq, and say what is wrong with the worst encoder.

    Args:
        memory: Overwritten, shape (n, COLUMNS).
        b: Limits, as of :mod:`mitt.control.envelope`, shape (>= 5, n).
        steps: Resolution of the encoders [rad], shape (n,).
        ddq_unknown: As of :func:`mitt.control.encoders.predict_acceleration`, shape (2, n).
        coupling: As of that function, shape (n, n).
        read: q, dq as read [rad, rad/s], shape (2, n); dq counts in the first tick alone.
        command: q, dq, ddq, tau of the tick before, and the acceleration that its torques cause
            by the model, shape (5, n).
        held: Whether brakes hold the joints: one that is not measured rests.
        impact_dq: Change of speed that the ball's impact may cause now [rad/s], shape (n,).
        passed: Time since the tick before [s].
        dt: Time from what the filter knows to what is read [s]; ``passed`` where readings are no
            older than they were.
        lag: Age of the reading, by which the estimate is carried on [s].
        estimated: Result: q, dq, shape (2, n).
    """
    worst, n, ticks = FINE, read.shape[1], min(passed, IN_TIME) / TICK
    before = max(abs(memory[0, at.STEP]), 0.5 * TICK)
    _let_pass(memory, b, passed, dt)
    for k in range(n):
        m, q = view(memory, k * COLUMNS, (COLUMNS,)), read[0, k]
        push = command[DDQ_BY_TAU, k] if np.isfinite(command[DDQ_BY_TAU, k]) else 0.0
        if np.isnan(m[at.Q]):
            found = _begin(m, b, k, steps[k], q, read[1, k], ticks)
        elif m[at.FAULT] != FINE:
            found = int(m[at.FAULT])
            _dead_reckon(m, b[DQ_MAX, k], steps[k], q, push, ticks, held)
        else:
            alone = _held_alone(memory, k, ddq_unknown, coupling, command, push, impact_dq, before)
            found = _observe(
                m, b, k, steps[k], ddq_unknown[0, k], q, push, impact_dq[k], alone, ticks, held
            )
            if found >= SILENT:  # what it read may have been taken for a motion that pushes others
                memory[:, at.STILL], memory[:, at.DUE], memory[:, at.LEAST] = 0.0, 0.0, 0.0
                m[at.FAULT], m[at.GOOD], m[at.MOVED], m[at.LAST] = found, 0.0, 0.0, q
        m[at.PUSH] = push
        if not np.isnan(m[at.Q]):
            estimated[0, k] = m[at.Q] + lag * (m[at.DQ] + 0.5 * lag * push)
            estimated[1, k] = m[at.DQ] + lag * push
        worst = max(worst, found)
    return worst


@kernel
def _note_unevenness(m: Array, dt: float, ticks: float) -> None:
    """Note by how much the stamps of readings may be off; see above."""
    uneven = abs(dt - m[at.STEP]) if m[at.STEP] != 0.0 else 0.0
    m[at.SHAKE] *= 1.0 - _CALMS * ticks
    m[at.SHAKE] = max(m[at.SHAKE], min(_STAMPED * uneven, _MOST_STAMPED))


@kernel
def _let_pass(memory: Array, b: Array, passed: float, dt: float) -> None:
    """Let time pass for all joints; after a tick so late that it stops the arm they begin anew."""
    for k in range(len(memory)):
        memory[k, at.BEFORE], memory[k, at.CORRECTED] = memory[k, at.CORRECTED], 0.0
        _note_unevenness(memory[k], dt, min(passed, IN_TIME) / TICK)
        memory[k, at.STEP] = dt
        if passed > BRIDGED_TIME and memory[k, at.FAULT] == FINE:
            memory[k, at.Q], memory[k, at.VARIANCE_DQ] = np.nan, b[DQ_MAX, k] ** 2


@kernel
def _begin(
    m: Array, b: Array, k: int, step: float, q: float, dq: float, ticks: float
) -> int:  # fmt: skip
    """Take the first reading, if it can be one of this joint."""
    if not b[Q_MIN, k] - BEYOND <= q <= b[Q_MAX, k] + BEYOND:
        m[at.GONE] += ticks
        m[at.REFUSED] += 1.0 if np.isfinite(q) else 0.0
        silent = m[at.GONE] >= LOSSY_TICKS - TRIFLE or m[at.REFUSED] >= _IMPOSSIBLE
        return SILENT if silent else BRIDGED
    known, unsure = abs(dq) <= EXCESS * b[DQ_MAX, k], m[at.VARIANCE_DQ]
    restart(m, q, dq if known else 0.0, step, TICK)
    m[at.VARIANCE_DQ] = max(m[at.VARIANCE_DQ], unsure)
    m[at.GONE], m[at.HELD], m[at.LEAST], m[at.GAPS], m[at.CORRECTED] = 0.0, q, 0.0, _NEW, 0.0
    return FINE


@kernel
def _dead_reckon(
    m: Array, dq_max: float, step: float, q: float, push: float, ticks: float, held: bool
) -> None:
    """Carry an unmeasured joint on by the model, and watch what its encoder reads."""
    dt = min(m[at.STEP], BRIDGED_TIME)
    if held:
        m[at.DQ] = 0.0
    else:
        m[at.Q] += dt * (m[at.DQ] + 0.5 * dt * push)
        m[at.DQ] = min(max(m[at.DQ] + dt * push, -dq_max), dq_max)
    moved = abs(q - m[at.LAST]) if np.isfinite(q) and np.isfinite(m[at.LAST]) else np.inf
    likely = moved <= EXCESS * dq_max * abs(dt) + 2.0 * step and abs(q - m[at.Q]) <= _NEAR
    m[at.GOOD] = m[at.GOOD] + ticks if likely else 0.0
    if likely and abs(q - m[at.HELD]) >= _MOVES * step:
        m[at.MOVED] = 1.0
    m[at.LAST] = q


@kernel
def _held_alone(
    memory: Array,
    k: int,
    ddq_unknown: Array,
    coupling: Array,
    command: Array,
    push: float,
    impact_dq: Array,
    before: float,
) -> tuple[float, float, float, float]:
    """Return what a torque at this joint has to overcome to hold it while the others move as read.

    A reading that stands still may be a stuck one: then its joint moves as it is read, or as the
    model says, or in between. A joint with a faulty encoder may do anything that unknown torques
    explain.

    Returns:
        The least and the largest acceleration that the commanded torques would cause then, their
        error [rad/s^2], and by how much the speed may be wrong because those of the others are,
        or because the ball struck [rad/s].
    """
    low, high, own, moved, variance, struck = push, push, ddq_unknown[1, k], 0.0, 0.0, 0.0
    for j in range(len(memory)):
        ratio, other = coupling[k, j], memory[j]
        struck += abs(ratio) * impact_dq[j]
        if other[at.FAULT] != FINE:
            own = max(own, ddq_unknown[0, k])
        elif j != k:
            pull = -ratio * other[at.BEFORE] / before
            low += min(pull, 0.0) if other[at.RESTS] > 0.0 else pull
            high += max(pull, 0.0) if other[at.RESTS] > 0.0 else pull
            moved += ratio * command[DDQ_BY_TAU, j] if np.isfinite(command[DDQ_BY_TAU, j]) else 0.0
            variance += ratio * ratio * other[at.VARIANCE_DQ]
    error = own + _MODEL * (abs(push) + abs(moved)) + abs(push - memory[k, at.PUSH])
    return low, high, error, 3.0 * np.sqrt(variance) + struck


@kernel
def _observe(
    m: Array, b: Array, k: int, step: float, ddq_unknown: float, q: float, push: float,
    impact_dq: float, alone: tuple[float, float, float, float], ticks: float, held: bool,
) -> int:  # fmt: skip
    """Predict a measured joint, correct it by its reading, and say what is wrong with that."""
    error, dt = ddq_unknown + _MODEL * abs(push) + abs(push - m[at.PUSH]), m[at.STEP]
    predict(m, push, error, dt)
    if not np.isfinite(q):
        m[at.GONE] += ticks
        most = LOSSY_TICKS if m[at.GAPS] > _GAP else SILENT_TICKS
        return SILENT if m[at.GONE] >= most - TRIFLE else BRIDGED
    m[at.GAPS] = (1.0 - _HEALS * ticks) * m[at.GAPS] + (1.0 if m[at.GONE] > 0.0 else 0.0)
    m[at.GONE], anew = 0.0, not 0.0 < dt <= IN_TIME
    if not held and stands_still(m, b, k, step, q, alone, ticks, anew):  # brakes hold as they do
        return STUCK
    off, span, stamped = q - m[at.Q], max(abs(dt), TICK), m[at.SHAKE] * m[at.DQ]
    r = step * step / 12.0 + stamped * stamped
    gate = _GATE * np.sqrt(m[at.VARIANCE_Q] + r) + step + EXCESS * b[DDQ_MAX, k] * span * span
    if abs(off) > gate:
        if m[at.REFUSED] == 0.0:
            m[at.FIRST], m[at.SPAN] = q, 0.0
        m[at.REFUSED] += 1.0
        if m[at.REFUSED] < IN_A_ROW or m[at.SPAN] < _APART:
            return BRIDGED
        return int(explain_refused(m, b[DQ_MAX, k], b[DDQ_MAX, k], step, q, impact_dq))
    correct(m, off, r, ticks)
    too_fast = abs(m[at.DQ]) - 3.0 * np.sqrt(m[at.VARIANCE_DQ]) > EXCESS * b[DQ_MAX, k]
    m[at.FASTS] = m[at.FASTS] + 1.0 if too_fast else 0.0
    if m[at.FASTS] >= IN_A_ROW:
        return FAST
    return REVERSED if moves_against(m, ddq_unknown, push, ticks, anew) else FINE
