"""The offset between the clocks of eyes and arm, as a catch says it.

The hand's path is known by the arm's clock, that of the ball by the eyes'. With offset d the ball
seen at t is where the hand was at t + d. After a catch the ball rides on the braking hand, at a
place c that does not change in the hand, seen(t) = l(q(t + d)) + R(q(t + d)) c. d and c are fitted
by weighted least squares, from when the ball has come to rest in the hand until the arm has. A
place that drifts must not be fitted beside d: under constant braking it imitates d. In flight alone
d does not show: a flight that is shifted in time is a flight. ``LearnedClock`` collects what the
catches say. A ball that the hand carries about for a calibration is another record of the kind:
:mod:`mitt.robot.cameras.hand_calibration`.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.dynamics import solve_positive
from mitt.core.arm.kinematics import joint_records, tip_motion
from mitt.core.ball.motion_models import LOOSE
from mitt.core.fields import brief
from mitt.core.kernels import Record, kernel
from mitt.core.signals import TICK, Array

FEWEST = 20
"""Fewest sightings that say something."""
FARTHEST = 0.05
"""Largest offset that is looked for after a catch [s]."""
SETTLES = 0.02
"""Time from the catch until the ball lies still in the hand [s]."""
GATE = 0.003
HAND = 0.06
"""Residual above which a fit tells nothing, as of a ball that slips: dropped ones leave 5 mm, and
above twice of it the ball was lost; distance from the catch point beyond which it is in no hand
[m]."""
UNSURE = 0.001
WARNED = 0.002
"""Standard deviation above which the hand has moved too little to tell, and least difference from
which an offset can be another one; offset that costs catches [s]."""
TRIAL = 0.007
"""Offset that is tried where no ball was held [s]: up to 8 ms either way the ball is held for long
enough to tell."""
LEAST = 1e-4
"""What a sighting is off at least, whatever it says [m]."""
FLIES = 0.25
STRIKES = 0.05
STRUCK = 0.01
"""Time before the braking from which a flight is fitted, until and around which a hand may strike
the ball [s], and how far off its flight a ball was struck [m]."""
_STEPS = 15
_NEAR = 1e-7
"""Most Gauss-Newton steps to the offset of a catch, and the step that ends them [s]."""
_STRUCK_COUNT = 10
"""Sightings from the blow on that say where a struck ball went."""
_SYSTEMATIC = 3e-4
_DRIFT = 1e-4
"""What a catch may be off beyond its own sigma, and what a clock drifts from throw to throw, one
sigma [s]."""
_ALONE = 5e-4
"""Standard deviation above which a first catch is believed only once the next one agrees [s]."""
_OTHER = 4.0
"""Sigmas from which an offset is another one: a clock was set, or the catch was none. The next
catch says which."""
_UNSEEN = "the ball was hardly seen in the braking hand"


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockOffset:
    """What one catch says of the clocks.

    Attributes:
        offset: Arm's clock minus the eyes' [s]: negative where images are older than their stamps.
        sigma: Its standard deviation [s].
        residual: Root mean square of what the fit leaves, an axis [m].
        count: Sightings that it rests on.
        unknown: Why the offset is not known, in words; nothing where it is.
        side: Where the ball was seen to be lost, and was struck out of its flight: -1 where it went
            off the palm, which it meets early if images are older than their stamps; 1 where it
            went aside, as the fingers push it that comes late, if they are newer. Else 0.
    """

    offset: float = 0.0
    sigma: float = np.inf
    residual: float = np.inf
    count: int = 0
    unknown: str = ""
    side: int = 0

    __repr__ = brief


@kernel
def _between(rows: Array, t_arm: Array, t: float, out: Array) -> bool:
    """Interpolate rows in time; False before the first row or after the last."""
    k = np.searchsorted(t_arm, t)
    if k == 0 or k >= len(t_arm):
        return False
    share = (t - t_arm[k - 1]) / (t_arm[k] - t_arm[k - 1])
    out[:] = rows[k - 1] + share * (rows[k] - rows[k - 1])
    return True


@kernel
def _in_hand(seen: Array, pose: Array, place: Array) -> None:
    """Write a place in the hand [m]; ``pose`` is of :func:`_poses`."""
    p, R = pose[0], pose[1:]
    for i in range(3):
        place[i] = 0.0
        for j in range(3):
            place[i] += R[j, i] * (seen[j] - p[j])


@kernel
def _poses(chain: Record, q: Array) -> Array:
    """Return the catch point, then the rows of the hand's rotation, at each reading, (m, 4, 3)."""
    poses, motion, still = np.empty((len(q), 4, 3)), np.empty((2, 3)), np.zeros(q.shape[1])
    for k in range(len(q)):
        R = tip_motion(chain, q[k], still, motion)
        poses[k, 0] = motion[0]
        poses[k, 1] = R[0], R[1], R[2]
        poses[k, 2] = R[3], R[4], R[5]
        poses[k, 3] = R[6], R[7], R[8]
    return poses


@kernel
def _row(
    poses: Array, t_arm: Array, t: float, seen: Array, x: Array, work: Array, A: Array
) -> Array:
    """Write the derivative of a sighting's error into ``A``; return the error [m], and the pose.

    Args:
        poses: As of :func:`_poses`.
        t_arm: Their times [s].
        t: Time of the sighting by the arm's clock [s].
        seen: Ball [m], shape (3,).
        x: Offset and place.
        work: Scratch, shape (3, 3).
        A: Result, shape (3, 4).

    Returns:
        Error in the hand, then the rows of the hand's rotation, shape (4, 3); empty where the arm
        was not read about then.
    """
    pose = np.empty((4, 3))
    for k in range(3):
        if not _between(poses, t_arm, t + (k - 1) * TICK, pose):
            return pose[:0]
        _in_hand(seen, pose, work[k])
    _between(poses, t_arm, t, pose)
    for i in range(3):
        A[i, 0] = (work[2, i] - work[0, i]) / (2.0 * TICK)
        pose[0, i] = work[1, i] - x[1 + i]
    return pose


@kernel
def fit_caught(
    chain: Record, t_arm: Array, q: Array, t_seen: Array, seen: Array, weights: Array
) -> tuple[float, float, float, float, int]:
    """Fit offset and place by Gauss-Newton steps, with Huber's weights from the second on.

    Args:
        chain: As of :func:`mitt.core.arm.kinematics.joint_records`.
        t_arm: Times of the readings, rising [s], shape (m,).
        q: Joint angles [rad], shape (m, n).
        t_seen: Times of the sightings [s], shape (k,).
        seen: Ball [m], shape (k, 3).
        weights: Inverse of each covariance [1/m^2], shape (k, 3, 3).

    Returns:
        Offset, its standard deviation [s], residual, distance from the catch point [m], count.
    """
    poses, size, count, knee = _poses(chain, q), np.zeros(len(t_seen)), 0, np.inf
    x, A, work, row = np.zeros(4), np.zeros((3, 4)), np.empty((3, 3)), np.empty((3, 5))
    N, system = np.zeros((4, 5)), np.empty((4, 6))
    along, spread, total = np.zeros(len(t_seen)), 0.0, 0.0
    for i in range(3):
        A[i, 1 + i] = -1.0
    for step in range(_STEPS):
        count, spread, total = 0, 0.0, 1e-300
        N[:, :], size[:], along[:] = 0.0, np.nan, 0.0
        for k in range(len(t_seen)):
            pose = _row(poses, t_arm, t_seen[k] + x[0], seen[k], x, work, A)
            if len(pose) == 0:
                continue
            _turn(pose, A, row)
            size[k], count = np.sqrt(_product(row, weights[k], row, 4, 4)), count + 1
            w = 1.0 if size[k] <= knee else knee / size[k]
            spread += w * size[k] ** 2
            total += w * (weights[k, 0, 0] + weights[k, 1, 1] + weights[k, 2, 2])
            along[k] = _product(row, weights[k], row, 0, 4)
            for i in range(4):
                for j in range(4):
                    N[i, j] += w * _product(row, weights[k], row, i, j)
                N[i, 4] -= w * _product(row, weights[k], row, i, 4)
        system[:, :5], system[:, 5] = N, 0.0
        system[0, 5] = 1.0
        for i in range(4):
            system[i, i] *= 1.0 + 1e-12
        if count < FEWEST or not solve_positive(system):
            return x[0], np.inf, np.inf, np.inf, count
        knee = 2.0 * 1.4826 / np.sqrt(3.0) * max(np.nanmedian(size), 1e-12)
        if step == _STEPS - 1 or (step > 2 and abs(system[0, 4]) < _NEAR):
            break
        x += system[:, 4]
        if not abs(x[0]) < FARTHEST:
            return x[0], np.inf, np.inf, np.inf, count
    scale = spread / max(3 * count - 4, 1)
    sigma = np.sqrt(scale * system[0, 5] * _alike(along))
    return x[0], sigma, np.sqrt(spread / total), np.sqrt(np.sum(x[1:] ** 2)), count


@kernel
def _turn(pose: Array, A: Array, row: Array) -> None:
    """Turn derivative and error from the hand's frame to the world's: the columns of ``row``."""
    error, R = pose[0], pose[1:]
    for i in range(3):
        for j in range(5):
            row[i, j] = 0.0
            for k in range(3):
                row[i, j] += R[i, k] * (A[k, j] if j < 4 else error[k])


@kernel
def _product(left: Array, W: Array, right: Array, i: int, j: int) -> float:
    """Return the product of two columns, weighted, shapes (3, m), (3, 3), (3, m)."""
    total = 0.0
    for a in range(3):
        for b in range(3):
            total += left[a, i] * W[a, b] * right[b, j]
    return total


@kernel
def _alike(along: Array) -> float:
    """Return by how much errors that follow one another are alike: 1 for white noise.

    The variance of a mean grows so for errors that decay by a constant share (Bayley and
    Hammersley 1946).
    """
    both, own = 0.0, 1e-300
    for k in range(1, len(along)):
        both += along[k] * along[k - 1]
        own += along[k] * along[k]
    share = min(max(both / own, 0.0), 0.98)
    return (1.0 + share) / (1.0 - share)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CatchSeen:
    """What arm and eyes said of a catch.

    Attributes:
        t_arm: Times of the readings, rising [s], shape (m,).
        q: Joint angles as read [rad], shape (m, n); rows that are not finite are left out.
        t_seen: Times of the sightings [s], shape (k,).
        seen: Ball [m], shape (k, 3).
        covariance: Of the sightings [m^2], shape (k, 3, 3).
        t_brake: When the arm began to brake [s].
        t_rest: When it came to rest [s].
    """

    t_arm: Array
    q: Array
    t_seen: Array
    seen: Array
    covariance: Array
    t_brake: float
    t_rest: float

    __repr__ = brief


def caught_offset(arm: Arm, of: CatchSeen) -> ClockOffset:
    """Return what a catch says of the clocks of eyes and arm."""
    read, seen = np.isfinite(of.q).all(axis=1), np.isfinite(of.seen).all(axis=1)
    use = seen & (of.t_seen >= of.t_brake + SETTLES) & (of.t_seen <= of.t_rest)
    count = int(np.sum(use))
    if arm.model.hand is not None and arm.model.hand.loose:
        return ClockOffset(count=count, unknown="a ball rolls about in a basket")
    if count < FEWEST or np.sum(read) < FEWEST:
        return ClockOffset(count=count, unknown=_UNSEEN)
    weights = np.linalg.inv(of.covariance[use] + LEAST**2 * np.eye(3))
    offset, sigma, residual, place, count = fit_caught(
        joint_records(arm.chain),
        of.t_arm[read],
        np.ascontiguousarray(of.q[read]),
        of.t_seen[use],
        np.ascontiguousarray(of.seen[use]),
        weights,
    )
    unknown, lost = "", count >= FEWEST and not (residual <= 2.0 * GATE and place <= HAND)
    if count < FEWEST:
        unknown = _UNSEEN
    elif not (residual <= GATE and place <= HAND):
        unknown = "the ball did not ride on the hand"
    elif not sigma <= UNSURE:
        unknown = "the hand moved too little"
    return ClockOffset(
        offset=float(offset),
        sigma=float(sigma),
        residual=float(residual),
        count=int(count),
        unknown=unknown,
        side=_side(arm, of) if lost else 0,
    )


def load_fit(arm: Arm) -> None:
    """Load what is compiled of :func:`caught_offset`, so that no later call waits for it."""
    t = np.linspace(0.0, 0.1, 100)
    caught_offset(
        arm,
        CatchSeen(
            t_arm=t,
            q=np.tile(arm.q_ready, (100, 1)),
            t_seen=t,
            seen=np.zeros((100, 3)),
            covariance=np.tile(np.eye(3), (100, 1, 1)),
            t_brake=0.0,
            t_rest=0.1,
        ),
    )


def _side(arm: Arm, of: CatchSeen) -> int:
    """Return which part of the hand struck the ball out of its flight; see ``ClockOffset.side``."""
    since = of.t_seen - of.t_brake
    near = np.isfinite(of.seen).all(axis=1) & (np.trace(of.covariance, axis1=1, axis2=2) < LOOSE)
    free, after = near & (since > -FLIES) & (since < -STRIKES), near & (np.abs(since) < STRIKES)
    if np.sum(free) < FEWEST or not np.any(after):
        return 0
    t = since[free, None]
    flight = np.linalg.lstsq(t ** [0, 1, 2], of.seen[free], rcond=None)[0]
    t = since[after, None]
    off = of.seen[after] - t ** [0, 1, 2] @ flight
    struck = np.flatnonzero(np.linalg.norm(off, axis=1) > STRUCK)
    if len(struck) == 0:
        return 0
    k = int(np.argmin(np.abs(of.t_arm - of.t_brake - t[struck[0], 0])))
    way = arm.position(of.q[k]) - arm.position(of.q[max(k - 1, 0)])
    way = way / max(float(np.linalg.norm(way)), 1e-12)
    push = np.mean(off[struck[:_STRUCK_COUNT]], axis=0)
    push = push - way * (way @ push)  # along its way the hand brakes, and the ball does not
    out = float(push @ arm.orientation(of.q[k])[:, 2])
    return -1 if out > 0.0 and 2.0 * out**2 > push @ push else 1


@final
class LearnedClock:
    """The offset of the eyes' clock as the catches so far say it.

    Where nothing is known, and a ball was struck but did not ride on the hand, an offset is tried
    in the next throw, then the other way: the clock may be so far off that no ball is ever held.

    Attributes:
        offset: Arm's clock minus the eyes', or what is tried [s]; stamps are corrected by it.
        sigma: Its standard deviation [s]; infinite while nothing is known.
        count: Catches that it rests on.
        struck: Balls in a row that were struck and lost on one side, of the sign of that side
            (``ClockOffset.side``); 0 after one that was held.
    """

    def __init__(self) -> None:
        """Know nothing."""
        self.offset, self.sigma, self.count, self.struck = 0.0, np.inf, 0, 0
        self._doubtful: float | None = None
        self._tried = 0

    def take(self, found: ClockOffset, used: float) -> None:
        """Take what a catch has said.

        Args:
            found: What it said.
            used: What its stamps were corrected by [s].
        """
        if not found.unknown:
            self.struck = 0
        elif found.side != 0:
            self.struck = found.side + (self.struck if self.struck * found.side > 0 else 0)
        if found.unknown:
            if self.count == 0 and (found.side != 0 or self.offset != 0.0):
                self._try(found.side)
            return
        new, own = used + found.offset, float(np.hypot(found.sigma, _SYSTEMATIC))
        before = own if self.count == 0 else float(np.hypot(self.sigma, _DRIFT))
        gap = max(_OTHER * float(np.hypot(own, before)), UNSURE)
        if self.count == 0 and own <= _ALONE:
            self.offset, self.sigma, self.count = new, own, 1
        elif self.count > 0 and abs(new - self.offset) <= gap:
            gain = before**2 / (before**2 + own**2)
            self.offset += gain * (new - self.offset)
            self.sigma, self.count = float(np.sqrt(gain)) * own, self.count + 1
        elif self._doubtful is not None and abs(new - self._doubtful) <= gap:
            self.offset, self.sigma, self.count = 0.5 * (new + self._doubtful), own, 2
        else:
            self._doubtful = new
            return
        self._doubtful = None

    def _try(self, side: int) -> None:
        """Try an offset in the next throw: to a side, then to the other, then none."""
        self._tried = (self._tried + 1) % 3
        if self._tried == 1:
            self.offset = TRIAL * side
        else:
            self.offset = -self.offset if self._tried == 2 else 0.0

    @property
    def words(self) -> str:
        """What is known, for a person."""
        if self.count == 0:
            tried = f"; {1e3 * self.offset:+.0f} ms is tried" if self.offset else ""
            return f"the eyes' clock is not known yet{tried}"
        catches = "1 catch" if self.count == 1 else f"{self.count} catches"
        return (
            f"the eyes' clock is off by {1e3 * self.offset:+.1f} ms, {1e3 * self.sigma:.1f} ms"
            f" sigma, from {catches}"
        )

    @property
    def figures(self) -> dict[str, float | int | None]:
        """The same as JSON has it."""
        known = self.count > 0
        return {
            "offset_s": self.offset if known else None,
            "sigma_s": self.sigma if known else None,
            "catches": self.count,
        }

    @property
    def warning(self) -> str:
        """What a person should know of the clocks; nothing where they are well."""
        if self.count == 0 or not abs(self.offset) > WARNED:
            return ""
        side = "older" if self.offset < 0.0 else "newer"
        return (
            f"what the eyes see is {1e3 * abs(self.offset):.1f} ms {side} than its stamps say;"
            " corrected, but synchronise the clocks"
        )
