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
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm, Tables
from mitt.core.arm.dynamics import bias_and_mass
from mitt.core.control.envelope import bounds_of
from mitt.core.control.stop import MassWork
from mitt.core.errors import InputError
from mitt.core.fields import Range, Settings
from mitt.core.kernels import Fields, Record, copy, kernel
from mitt.core.signals import TICK, Array

#: What is wrong with an encoder; the first two are not a fault yet.
FINE, BRIDGED, SILENT, JUMPED, STUCK, REVERSED, FAST = range(7)

#: What is known of a joint's encoder, and remembered from tick to tick. Ticks that are counted are
#: times, in units of ``TICK``: a call adds what has passed since the last one. A late call adds
#: what one in time may at most, because nothing is known of what lay between.
ENCODER = np.dtype(
    [
        ("step", float),  # resolution [rad]
        ("unknown", float),  # largest torque that no model knows [N m]
        # Accelerations that the unknown torques of all joints can cause, and that the joint's own
        # can while the others move as they do [rad/s^2].
        ("ddq_unknown", float),
        ("ddq_own", float),
        ("q", float),  # the estimate [rad, rad/s]; NaN before the first reading
        ("dq", float),
        ("variance_q", float),  # its covariance
        ("covariance", float),
        ("variance_dq", float),
        ("gone", float),  # ticks without a number
        ("refused", float),  # refused readings in a row
        ("first", float),  # the first of them [rad]
        ("span", float),  # ticks since then
        ("q0", float),  # estimate at the last reading that was taken
        ("dq0", float),
        ("since", float),  # ticks since then, late ones wholly
        ("held", float),  # reading that the encoder has not left [rad]
        ("still", float),  # ticks in a row in which the joint must have moved since then
        ("least", float),  # its least speed in them [rad/s]
        ("due", float),  # and its least way [rad]
        ("rests", float),  # ticks since the reading last changed
        ("against", float),  # ticks in which the joint moved against the torques
        ("speed_before", float),  # largest speed of late before them [rad/s]
        ("shadow_q", float),  # the joint predicted since then
        ("shadow_dq", float),
        ("recent_speed", float),  # largest speed in the last few ticks [rad/s]
        ("fasts", float),  # readings too fast in a row
        ("push", float),  # acceleration by the command before [rad/s^2]
        ("corrected", float),  # by how much readings corrected dq in this tick [rad/s]
        ("corrected_before", float),  # and in the tick before
        ("dt", float),  # time that the last step took [s]
        ("stamp_error", float),  # by how much stamps may be off, by how evenly they came [s]
        ("gaps", float),  # gaps in the readings of late
        ("fault", int),  # what is wrong
        ("good", float),  # good readings since then
        ("last", float),  # the last one [rad]
        ("moved", bool),  # whether it has moved since then
    ],
    align=True,
)

#: Readings in a row that decide: refused ones after which the filter begins anew or the encoder has
#: a fault, too fast ones, and first ones that no joint of the arm can have.
IN_A_ROW = 3
#: Ticks without a number after which an encoder is silent, for one that has read well and for one
#: that loses readings or has not been read yet.
SILENT_TICKS = 6
LOSSY_TICKS = 15
#: Share of a gap that is forgotten in a tick, of one that still counts, and of a new encoder.
_HEALS = 0.002
_GAP = 0.3
_NEW = 0.37
#: How far outside a joint's range a first reading may lie [rad].
BEYOND = 0.5
#: Share of the modelled acceleration that may be wrong.
_MODEL = 0.2
#: Sigmas within which an estimate, and those of an innovation within which a reading, is believed;
#: the model's largest error is as many.
SIGMAS = 3.0
_GATE = 6.0
#: Ticks for which readings in a row have to be refused at least before they are explained.
_APART = 1.5
#: Share of the unevenness of readings that may be their stamps', the most that may be [s], and what
#: of it is forgotten in a tick.
_STAMPED = 0.25
_MOST_STAMPED = 2e-4
_CALMS = 0.02
#: Ticks of good readings after which a faulty encoder counts as good again, how near they have
#: to be to where the joint is predicted [rad], and counts that a stuck one has to move.
GOOD_TICKS = 50
_NEAR = 0.1
_MOVES = 3.0
#: What a sum of ticks may be off by because it was rounded.
TRIFLE = 1e-6
#: Excess over a speed limit that is none of the joint.
EXCESS = 1.5
#: Counts of least motion after which a still encoder is stuck.
_COUNTS = 5.0
#: Ticks for which a model error lasts at least, which the process noise allows for, and after which
#: a still encoder must have moved: a torque may act some ticks after its command.
_LASTING = 5.0
#: Room before the end of a joint's range in which the end stop may hold it [rad].
_STOP = 0.03
#: Mirror image of a velocity: smallest speed [rad/s], and how alike the two have to be.
_MIRROR = 0.3
_ALIKE = 0.05
#: Share of the speed a few ticks ago that a joint still has whose sign turns at once: one that a
#: wall throws back has lost its speed by then.
_STEADY = 0.8
#: Multiple of the unknown acceleration from which torques give a sign, ticks that the speed has to
#: grow against them, and by how much [rad/s].
_SURE = 2.0
_TICKS_AGAINST = 10
_GAINED = 0.1
#: Share of the largest speed of late that is forgotten in a tick: what gave way then gives it back.
_FORGETS = 0.005
#: Share of the largest speed of late that is kept in a tick.
_KEEPS = 0.85
#: Share of a joint's largest torque that friction and contact may always take, and the largest.
_LEAST_UNKNOWN = 0.1
_MOST_UNKNOWN = 0.3
#: Longest tick that counts as in time, and longest that is bridged at all [s].
IN_TIME = 0.005
BRIDGED_TIME = 0.020


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Encoders(Settings):
    """What is known of the encoders.

    Attributes:
        step: Resolution of each joint's encoder [rad], one number for all or one a joint; None:
            the arm's own.
        unknown: Torque by friction, payload or contact that no model knows and that must raise no
            alarm [N m]; of each joint at least a tenth and at most three tenths of its largest
            torque. The default is a choice of this project.
    """

    step: float | tuple[float, ...] | None = None
    unknown: Annotated[float, Range(0.0, 1e6)] = 2.0

    def steps(self, own: Array) -> Array:
        """Return the resolution of each joint's encoder [rad], shape (n,).

        Args:
            own: The arm's, shape (n,).

        Raises:
            InputError: Not one number above 0 for each joint.
        """
        given = own
        if self.step is not None:
            scalar = isinstance(self.step, int | float)
            given = checks.array("encoder step", [self.step] if scalar else self.step, (None,))
        if given.shape not in ((1,), own.shape) or not np.all((given > 0.0) & (given < 0.1)):
            wanted = f"one number or {len(own)}, above 0 and below 0.1 rad"
            raise InputError("encoder step", wanted, self.step)
        return np.array(np.broadcast_to(given, own.shape))

    def of(self, arm: Arm) -> Record:
        """Return what is known of an arm's encoders before the first reading, shape (n,).

        Raises:
            InputError: A number that cannot be used.
        """
        joints = np.zeros(arm.n, ENCODER)
        unknown = np.clip(self.unknown, _LEAST_UNKNOWN * arm.tau_max, _MOST_UNKNOWN * arm.tau_max)
        joints["step"], joints["unknown"] = self.steps(arm.encoder_step), unknown
        own = unknown / np.diag(arm.mass_matrix(arm.q_ready))
        joints["ddq_unknown"] = joints["ddq_own"] = own
        joints["q"] = np.nan
        return joints


class Monitor(NamedTuple):
    """What is known of all encoders of an arm.

    Attributes:
        joints: Records of type :data:`ENCODER`, shape (n,).
        bounds: Limits, as of :func:`mitt.core.control.envelope.bounds_of`, shape (n,).
        ddq_by_tau: Acceleration that the torques cause by the model that act now [rad/s^2], (n,).
        coupling: M_kj / M_kk, shape (n, n).
        motion, left, inverse: Scratch, shapes (3, n), (n, n), (n, n).
    """

    joints: Record
    bounds: Record
    ddq_by_tau: Array
    coupling: Array
    motion: Array
    left: Array
    inverse: Array


def monitor_of(arm: Arm, encoders: Encoders) -> Monitor:
    """Return what is known before the first reading."""
    n = arm.n
    return Monitor(
        encoders.of(arm),
        bounds_of(arm, commanded=False),
        np.zeros(n),
        np.zeros((n, n)),
        np.zeros((3, n)),
        np.zeros((n, n)),
        np.zeros((n, n)),
    )


class Reading(NamedTuple):
    """When encoders were read.

    Attributes:
        passed: Time since the tick before [s].
        dt: Time from what the filter knows to what is read [s]; ``passed`` where readings are no
            older than they were.
        lag: Age of the reading, by which the estimate is carried on [s].
    """

    passed: float
    dt: float
    lag: float


def faulty(joints: Record) -> list[int]:
    """Return the joints whose encoders have a fault, by their indices."""
    return [int(k) for k in np.flatnonzero(joints["fault"])]


def recovered(joints: Record) -> Array:
    """Say of each encoder whether it is trusted, or has read well since its fault, shape (n,)."""
    fine = (joints["fault"] == FINE) & (joints["gone"] == 0.0)
    moved = (joints["fault"] != STUCK) | joints["moved"]
    out: Array = fine | ((joints["good"] >= GOOD_TICKS) & moved)
    return out


def check_recovered(names: Sequence[str], joints: Record) -> None:
    """Refuse encoders of which one has a fault and has not read well since; name the joints."""
    pairs = zip(names, recovered(joints), strict=True)
    if bad := ", ".join(name for name, fine in pairs if not fine):
        raise InputError(
            "recover",
            "encoders that read well",
            f"doubt about {bad}",
            do="check the encoder, then recover(checked=True)",
        )


@kernel
def estimate_joints(
    monitor: Monitor, read: Array, held: bool, impact_dq: Array, when: Reading, estimated: Array
) -> int:
    """Estimate the joints' q and dq, and say what is wrong with the worst encoder.

    Args:
        monitor: What is known, overwritten.
        read: q, dq as read [rad, rad/s], shape (2, n); dq counts in the first tick alone.
        held: Whether brakes hold the joints: one that is not measured rests.
        impact_dq: Change of speed that the ball's impact may cause now [rad/s], shape (n,).
        when: Times of the reading.
        estimated: Result: q, dq, shape (2, n).
    """
    joints, b, lag, worst = monitor.joints, monitor.bounds, when.lag, FINE
    ticks, before = min(when.passed, IN_TIME) / TICK, max(abs(joints[0].dt), 0.5 * TICK)
    _let_pass(joints, b, when)
    for k in range(len(joints)):
        m, q, push = joints[k], read[0, k], _finite(monitor.ddq_by_tau[k])
        if np.isnan(m.q):
            found = _begin(m, b[k], q, read[1, k], ticks)
        elif m.fault != FINE:
            found = m.fault
            _dead_reckon(m, b[k].dq_max, q, push, ticks, held)
        else:
            alone = _held_alone(monitor, k, push, impact_dq, before)
            found = _observe(m, b[k], q, push, impact_dq[k], alone, (ticks, held))
            if found >= SILENT:  # what it read may have been taken for a motion that pushes others
                for j in range(len(joints)):
                    joints[j].still = joints[j].due = joints[j].least = 0.0
                m.fault, m.good, m.moved, m.last = found, 0.0, False, q
        m.push = push
        if not np.isnan(m.q):
            estimated[0, k] = m.q + lag * (m.dq + 0.5 * lag * push)
            estimated[1, k] = m.dq + lag * push
        worst = max(worst, found)
    return worst


@kernel
def _finite(x: float) -> float:
    """Return a number, or 0 where it is none."""
    return x if np.isfinite(x) else 0.0


@kernel
def _let_pass(joints: Record, b: Record, when: Reading) -> None:
    """Let time pass for all joints; after a tick so late that it stops the arm they begin anew."""
    for k in range(len(joints)):
        m = joints[k]
        m.corrected_before, m.corrected = m.corrected, 0.0
        uneven = abs(when.dt - m.dt) if m.dt != 0.0 else 0.0
        m.stamp_error *= 1.0 - _CALMS * (min(when.passed, IN_TIME) / TICK)
        m.stamp_error = max(m.stamp_error, min(_STAMPED * uneven, _MOST_STAMPED))
        m.dt = when.dt
        if when.passed > BRIDGED_TIME and m.fault == FINE:
            m.q, m.variance_dq = np.nan, b[k].dq_max ** 2


@kernel
def _begin(m: Fields, b: Fields, q: float, dq: float, ticks: float) -> int:
    """Take the first reading, if it can be one of this joint."""
    if not b.q_min - BEYOND <= q <= b.q_max + BEYOND:
        m.gone += ticks
        m.refused += 1.0 if np.isfinite(q) else 0.0
        silent = m.gone >= LOSSY_TICKS - TRIFLE or m.refused >= IN_A_ROW
        return SILENT if silent else BRIDGED
    known, unsure = abs(dq) <= EXCESS * b.dq_max, m.variance_dq
    _restart(m, q, dq if known else 0.0, TICK)
    m.variance_dq = max(m.variance_dq, unsure)
    m.gone, m.held, m.least, m.gaps, m.corrected = 0.0, q, 0.0, _NEW, 0.0
    return FINE


@kernel
def _dead_reckon(m: Fields, dq_max: float, q: float, push: float, ticks: float, held: bool) -> None:
    """Carry an unmeasured joint on by the model, and watch what its encoder reads."""
    dt = min(m.dt, BRIDGED_TIME)
    if held:
        m.dq = 0.0
    else:
        m.q += dt * (m.dq + 0.5 * dt * push)
        m.dq = min(max(m.dq + dt * push, -dq_max), dq_max)
    moved = abs(q - m.last) if np.isfinite(q) and np.isfinite(m.last) else np.inf
    likely = moved <= EXCESS * dq_max * abs(dt) + 2.0 * m.step and abs(q - m.q) <= _NEAR
    m.good = m.good + ticks if likely else 0.0
    if likely and abs(q - m.held) >= _MOVES * m.step:
        m.moved = True
    m.last = q


@kernel
def _held_alone(
    monitor: Monitor, k: int, push: float, impact_dq: Array, before: float
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
    joints, coupling = monitor.joints, monitor.coupling
    low, high, own, moved, variance, struck = push, push, joints[k].ddq_own, 0.0, 0.0, 0.0
    for j in range(len(joints)):
        ratio, other = coupling[k, j], joints[j]
        struck += abs(ratio) * impact_dq[j]
        if other.fault != FINE:
            own = max(own, joints[k].ddq_unknown)
        elif j != k:
            pull = -ratio * other.corrected_before / before
            low += min(pull, 0.0) if other.rests > 0.0 else pull
            high += max(pull, 0.0) if other.rests > 0.0 else pull
            moved += ratio * _finite(monitor.ddq_by_tau[j])
            variance += ratio * ratio * other.variance_dq
    error = own + _MODEL * (abs(push) + abs(moved)) + abs(push - joints[k].push)
    return low, high, error, SIGMAS * np.sqrt(variance) + struck


@kernel
def _observe(
    m: Fields,
    b: Fields,
    q: float,
    push: float,
    impact_dq: float,
    alone: tuple[float, float, float, float],
    time: tuple[float, bool],
) -> int:
    """Predict a measured joint, correct it by its reading, and say what is wrong with that.

    ``alone`` is of :func:`_held_alone`, ``time`` the ticks that have passed, and whether brakes
    hold the joint.
    """
    error, dt, (ticks, held) = m.ddq_unknown + _MODEL * abs(push) + abs(push - m.push), m.dt, time
    _predict(m, push, error, dt)
    if not np.isfinite(q):
        m.gone += ticks
        most = LOSSY_TICKS if m.gaps > _GAP else SILENT_TICKS
        return SILENT if m.gone >= most - TRIFLE else BRIDGED
    m.gaps = (1.0 - _HEALS * ticks) * m.gaps + (1.0 if m.gone > 0.0 else 0.0)
    m.gone, anew = 0.0, not 0.0 < dt <= IN_TIME
    if not held and _stands_still(m, b, q, alone, ticks, anew):  # brakes hold as they do
        return STUCK
    off, span, stamped = q - m.q, max(abs(dt), TICK), m.stamp_error * m.dq
    r = m.step * m.step / 12.0 + stamped * stamped
    gate = _GATE * np.sqrt(m.variance_q + r) + m.step + EXCESS * b.ddq_max * span * span
    if abs(off) > gate:
        if m.refused == 0.0:
            m.first, m.span = q, 0.0
        m.refused += 1.0
        if m.refused < IN_A_ROW or m.span < _APART:
            return BRIDGED
        return int(_explain_refused(m, b, q, impact_dq))
    _correct(m, off, r, ticks)
    too_fast = abs(m.dq) - SIGMAS * np.sqrt(m.variance_dq) > EXCESS * b.dq_max
    m.fasts = m.fasts + 1.0 if too_fast else 0.0
    if m.fasts >= IN_A_ROW:
        return FAST
    return REVERSED if _moves_against(m, push, ticks, anew) else FINE


@kernel
def _restart(m: Fields, q: float, dq: float, apart: float) -> None:
    """Begin the filter from a reading and a velocity, of readings that are ``apart`` [s]."""
    r = m.step * m.step / 12.0
    m.corrected += dq - m.dq
    m.q, m.dq, m.q0, m.dq0, m.since = q, dq, q, dq, 0.0
    m.variance_q, m.covariance, m.variance_dq = r, r / apart, 2.0 * r / (apart * apart)
    m.refused, m.against, m.speed_before = 0.0, 0.0, max(m.speed_before, abs(dq))
    m.recent_speed = max(abs(dq), _KEEPS**IN_A_ROW * m.recent_speed)


@kernel
def _predict(m: Fields, push: float, error: float, dt: float) -> None:
    """Carry estimate and covariance on by a time [s]; back, where it is negative.

    Process noise is a third of the model's largest error, measurement noise that of rounding.

    What the model misses is white within the time. Were it constant there, a fine encoder would
    leave an error of the velocity undamped: its sign would change from tick to tick for ever.
    """
    sigma = (1.0 / SIGMAS) * error
    v = max(_LASTING, abs(dt) / TICK) * sigma * sigma * TICK * abs(dt)
    m.q += dt * (m.dq + 0.5 * dt * push)
    m.dq += dt * push
    m.variance_q += dt * (2.0 * m.covariance + dt * (m.variance_dq + v / 3.0))
    m.covariance += dt * (m.variance_dq + 0.5 * v)
    m.variance_dq += v
    m.since += dt / TICK
    m.span += dt / TICK


@kernel
def _correct(m: Fields, off: float, r: float, ticks: float) -> None:
    """Take a reading in that is off by so much [rad], with a variance [rad^2], after so long."""
    s = m.variance_q + r
    gain, rate = m.variance_q / s, m.covariance / s
    m.q += gain * off
    m.dq += rate * off
    m.corrected += rate * off
    m.variance_dq -= rate * m.covariance
    m.covariance *= 1.0 - gain
    m.variance_q *= 1.0 - gain
    m.q0, m.dq0, m.since, m.refused = m.q, m.dq, 0.0, 0.0
    m.recent_speed = max(abs(m.dq), _KEEPS**ticks * m.recent_speed)


@kernel
def _explain_refused(m: Fields, b: Fields, q: float, impact_dq: float) -> int:
    """Say what three readings in a row mean that the prediction does not explain.

    If the joint was struck at some instant since the last good reading, the line through the new
    readings meets the one that it was on then. A jump leaves a gap between them.
    """
    ticks, apart = m.since, m.span * TICK / (IN_A_ROW - 1)
    dq = (q - m.first) / ((IN_A_ROW - 1) * apart)
    change = abs(dq - m.dq0)
    gap = abs(q - dq * ticks * TICK - m.q0)
    bent = EXCESS * b.ddq_max * (ticks * TICK) ** 2
    if abs(dq) > EXCESS * b.dq_max or gap > change * ticks * TICK + bent + 4.0 * m.step:
        return JUMPED
    alike = abs(dq + m.dq0) < _ALIKE * abs(m.dq0) + 2.0 * m.step / apart
    alike &= change > impact_dq and abs(m.dq0) >= _STEADY * m.recent_speed
    if alike and abs(m.dq0) > max(_MIRROR, 10.0 * m.step / apart):
        return REVERSED
    _restart(m, q, dq, apart)
    return FINE


@kernel
def _stands_still(
    m: Fields,
    b: Fields,
    q: float,
    alone: tuple[float, float, float, float],
    ticks: float,
    anew: bool,
) -> bool:
    """Say whether a reading stands still that must have moved, whether or not the ball struck.

    ``ticks`` have passed; the look begins ``anew`` where nobody knows what the joint did in them.
    """
    (low, high, error, slack), dt = alone, m.dt
    if anew or abs(q - m.held) >= 0.5 * m.step:
        sure = max(abs(m.dq) - SIGMAS * np.sqrt(m.variance_dq) - slack, 0.0)
        m.held, m.still, m.due, m.rests = q, 0.0, 0.0, 0.0
        m.least = np.copysign(sure, m.dq)
        return False
    slowest, fastest = m.least + low * dt, m.least + high * dt
    speed = slowest if slowest > 0.0 else min(fastest, 0.0)
    m.still += ticks
    m.rests += ticks
    m.least = np.copysign(max(abs(speed) - error * dt, 0.0), speed)
    least = max(abs(m.least) - slack, 0.0)
    m.due += np.copysign(least, m.least) * dt
    if least == 0.0:
        m.due = m.still = 0.0
    above, below = q > b.q_max + _STOP, q < b.q_min - _STOP
    at_stop = (m.due > 0.0 and above) or (m.due < 0.0 and below)
    due = abs(m.due) > (_COUNTS + 1.0) * m.step and m.still >= _LASTING - TRIFLE
    if due and not at_stop and abs(m.dq) < abs(m.least):  # the reading has led it astray
        m.q, m.dq = m.held + m.due, m.least
    return bool(due and not at_stop)


@kernel
def _moves_against(m: Fields, push: float, ticks: float, anew: bool) -> bool:
    """Say whether a reading has gained speed against the torques for too long to be true.

    The state of the joint is then that of the beginning, carried on by the model. ``ticks`` and
    ``anew`` are as for :func:`_stands_still`.
    """
    speed, dt = abs(m.dq), m.dt
    if anew or not (abs(push) > _SURE * m.ddq_unknown and m.dq * push < 0.0):
        m.against, m.speed_before = 0.0, max(speed, (1.0 - _FORGETS * ticks) * m.speed_before)
        m.shadow_q, m.shadow_dq = m.q, m.dq
        return False
    m.shadow_q += dt * (m.shadow_dq + 0.5 * dt * push)
    m.shadow_dq += dt * push
    before = m.against
    m.against += ticks
    if before < _TICKS_AGAINST // 2 - TRIFLE <= m.against:  # an impact is over by now
        m.speed_before = max(m.speed_before, speed)
    least = _GAINED + SIGMAS * np.sqrt(m.variance_dq)
    if m.against < _TICKS_AGAINST - TRIFLE or speed - m.speed_before < least:
        return False
    m.q, m.dq = m.shadow_q, m.shadow_dq
    return True


@kernel
def predict_acceleration(
    monitor: Monitor, arm: Tables, estimated: Array, tau: Array, w: MassWork
) -> None:
    """Write the acceleration by a tick's torques, and what unknown torques can add to it.

    With M the mass matrix, a torque w_k at joint k that nobody knows, and accelerations a_j of the
    others that are measured, joint k moves by ddq_k = (tau_k - bias_k + w_k - sum M_kj a_j) / M_kk.

    Args:
        monitor: Its ``ddq_by_tau``, ``coupling`` and ``ddq_unknown`` are overwritten.
        arm: As of ``Arm.tables``.
        estimated: q, dq of the joints [rad, rad/s], shape (2, n).
        tau: Torques [N m], shape (n,).
        w: Scratch.
    """
    index, joints, mass, motion = arm.active, monitor.joints, w.mass, monitor.motion
    left, inverse, ddq = monitor.left, monitor.inverse, monitor.ddq_by_tau
    n = len(index)
    copy(estimated[:2], motion[:2])
    motion[2] = 0.0
    bias_and_mass(arm.bodies, motion, w.tau, mass, w.work)
    for i in range(n):
        for j in range(n):
            left[i, j], inverse[i, j] = mass[index[i], j], 1.0 if i == j else 0.0
    for i in range(n):  # Gauss-Jordan; a mass matrix is positive definite and needs no pivots
        scale = 1.0 / max(left[i, i], 1e-9)
        for c in range(n):
            left[i, c] *= scale
            inverse[i, c] *= scale
        for j in range(n):
            factor = left[j, i]
            if j != i:
                for c in range(n):
                    left[j, c] -= factor * left[i, c]
                    inverse[j, c] -= factor * inverse[i, c]
    for i in range(n):
        m, own = joints[i], max(mass[index[i], i], 1e-9)
        ddq[i], m.ddq_unknown, m.ddq_own = 0.0, 0.0, m.unknown / own
        for j in range(n):
            ddq[i] += inverse[i, j] * (tau[j] - w.tau[index[j]])
            m.ddq_unknown += abs(inverse[i, j]) * joints[j].unknown
            monitor.coupling[i, j] = mass[index[i], j] / own
