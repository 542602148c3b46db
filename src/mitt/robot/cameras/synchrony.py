"""Whether two cameras are in step: what their images say of the time between them.

A right image that was taken later than its time says shows the ball further along its path. What
of that shift lies across the epipolar line keeps the lines of sight from meeting; what lies along
it moves the ball in depth, and a flight of wrong depths does not fall as a ball does. Both are
linear in the time offset d for one instant, and so is a small error of the right camera's pose:

    e_k = s_k d + c_k xi + noise,   a_w = g - drag |v| v + b_w d + noise

They are solved by weighted least squares, Huber's weights in the second to last steps, with an
offset of its own for each window, so that a frame lost on the way shows, and one pose error xi for
all, whose prior is what a good calibration leaves.

| here  | meaning                                                     | unit         | shape  |
|-------|-------------------------------------------------------------|--------------|--------|
| ``e`` | reprojection error across the epipolar line                 | px           | (n,)   |
| ``s`` | its change with the offset: speed of the right image across | px/s         | (n,)   |
| ``c`` | its change with turn and shift of the right camera          | px/rad, px/m | (n, 6) |
| ``a`` | acceleration of the triangulated points of a window         | m/s^2        | (3,)   |
| ``b`` | its change with the offset                                  | m/s^3        | (3,)   |
"""

from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.eyes.camera import Rig
from mitt.core.fields import brief
from mitt.core.signals import GRAVITY, Array

Indices: TypeAlias = NDArray[np.int64]

#: Duration and fewest instants of a window [s, 1]; a longer pause begins another window.
_WINDOW = 0.1
_FEWEST = 8
_PAUSE = 5.0
"""Gap that begins another window, in median gaps between instants."""
#: Instants on either side from which the speed of an image is taken.
_SIDE = 4
#: What a good calibration leaves, one sigma: turn of a camera [rad] and its shift [m].
_TURN = 1.0e-3
_SHIFT = 2.0e-3
#: What is believed of an offset before anything was seen, one sigma [s]: some lost frames.
_BEFORE = 0.03
#: Least noise of a centroid [px], and steps of Huber's weights with their knee [sigmas].
_NOISE = 0.02
_STEPS = 6
_KNEE = 2.0
#: Drag of a ball and what of it, and of spin, is not known, one sigma [1/m]; other accelerations
#: that a flight has, as of a bounce that a window cuts off [m/s^2].
_DRAG = 0.08
_UNSURE = 0.08
_PUSH = 1.0
#: Sigmas from which a record's offset is one, and a window's, of which there are many.
_SURE = 4.0
_SURE_WINDOW = 5.0
#: Errors in noise, and instants in a row with such, that a lost frame may leave in a window; what
#: they may differ from a whole number of frames, in it.
_STRAY = 3.0
_STRAYS = 4
#: Instants for which a track remembers one that is off.
_REMEMBERED = 5
_WHOLE = 0.3
#: Times the prior's pose error that a wrong rig may have, and errors that offsets may leave, in
#: those that such a rig leaves and in noise, to be believed.
_WRONG = 30.0
_BESIDE_RIG = 2.0
_BESIDE_NOISE = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Synchrony:
    """What images say of the time between two cameras.

    Attributes:
        t: Times of the instants [s], shape (n,).
        slope: What one second of offset moves the ball by [m/s], shape (n, 3).
        offset: Right camera's delay behind its stamps at each instant [s], shape (n,): that of its
            window, or the mean where no window is certain to differ from it.
        sigma: Its standard deviation [s], shape (n,).
        mean: The same for all instants together [s].
        mean_sigma: Its standard deviation [s].
        shifted: Whether an offset is certain that explains what the lines of sight are apart, and
            better than a rig that is another's.
    """

    t: Array
    slope: Array
    offset: Array
    sigma: Array
    mean: float
    mean_sigma: float
    shifted: bool

    __repr__ = brief

    @property
    def speed(self) -> float:
        """What one second of offset moves the ball by, in the median [m/s]."""
        return float(np.median(np.linalg.norm(self.slope, axis=1)))

    @property
    def worst(self) -> int:
        """The instant with the largest certain offset."""
        return int(np.argmax(np.abs(self.offset) - self.sigma))

    def moved(self, k: int) -> float:
        """Return what the offset of an instant moves the ball by [m]."""
        return float(np.linalg.norm(self.slope[k])) * abs(float(self.offset[k]))

    def error(self, t: float) -> Array:
        """Return what the position at a time is off, one sigma an axis [m], shape (3,)."""
        k = int(np.argmin(np.abs(self.t - t)))
        return np.asarray(np.abs(self.slope[k]) * np.hypot(self.offset[k], self.sigma[k]))


def synchrony(points: Array, rig: Rig, *, radius: float, noise: float) -> Synchrony | None:
    """Return what the images of two cameras say of the time between them.

    Args:
        points: Time [s] and image point of the ball in the left and in the right image without
            distortion [px], of each instant at which both see it, times rising, shape (n, 5).
        rig: The two cameras.
        radius: Radius of the ball [m].
        noise: Error of a centroid and of the calibration, one sigma [px].

    Returns:
        The answer; None where there are fewer than eight instants in a row.
    """
    window = _windows(points[:, 0])
    kept = window >= 0
    if not np.any(kept):
        return None
    points, window = points[kept], window[kept]
    geometry = _Geometry(points, rig, radius)
    speed = _speeds(points, window)
    return _Offsets(points[:, 0], window, geometry, speed, noise).solved()


def _windows(t: Array) -> Indices:
    """Return the number of the window of each instant, -1 where there are too few in a row."""
    out = np.full(len(t), -1, dtype=np.int64)
    if len(t) < _FEWEST:
        return out
    gaps = np.diff(t)
    breaks = np.flatnonzero(gaps > _PAUSE * np.median(gaps)) + 1
    count = 0
    for run in np.split(np.arange(len(t)), breaks):
        span = float(t[run[-1]] - t[run[0]])
        parts = min(len(run) // _FEWEST, max(int(span / _WINDOW), 1))
        for part in np.array_split(run, parts) if parts else ():
            out[part] = count
            count += 1
    return out


def _speeds(points: Array, window: Indices) -> Array:
    """Return the speed of the right image point [px/s], shape (n, 2), by parabolas about each."""
    out = np.empty((len(points), 2))
    for k in range(len(points)):
        low = max(0, min(k - _SIDE, len(points) - 2 * _SIDE - 1))
        near = np.arange(low, min(low + 2 * _SIDE + 1, len(points)))
        near = near[np.abs(window[near] - window[k]) <= 1]
        tau = points[near, 0] - points[k, 0]
        scale = float(np.abs(tau).max())
        out[k] = np.polyfit(tau / scale, points[near, 3:5], 2)[1] / scale
    return out


@final
class _Geometry:
    """Triangulated points, and what errors of the right image move.

    Attributes:
        r: Points [m], shape (n, 3).
        e: Reprojection error across the epipolar line [px], shape (n,).
        across: Unit vector of that error in the right image, times its share, shape (n, 2).
        depth: Change of the point with the right image [m/px], shape (n, 3, 2).
        pose: Change of the right image with turn and shift of its camera, shape (n, 2, 6).
    """

    def __init__(self, points: Array, rig: Rig, radius: float) -> None:
        """Triangulate by Gauss-Newton steps from where the rays are nearest."""
        self._rig, self._radius = rig, radius
        seen = points[:, 1:5]
        r = _nearest(rig, seen)
        for _ in range(4):
            uv, J = self._projected(r)
            r = r + np.einsum("nij,nj->ni", np.linalg.pinv(J), seen - uv)
        uv, J = self._projected(r)
        normal = np.linalg.svd(J)[0][:, :, 3]
        self.r = r
        self.e = np.einsum("ni,ni->n", normal, seen - uv)
        self.across = normal[:, 2:4]
        self.depth = np.linalg.pinv(J)[:, :, 2:4]
        # The camera's own pose: a turn w of it moves what it sees by -w x p, a shift by its own.
        right = rig.cameras[1]
        p = (r - right.centre) @ right.rotation
        D = _by_point(p, right.f_px)
        cross = np.zeros((len(p), 3, 3))
        for i, j, axis, sign in ((0, 1, 2, -1), (0, 2, 1, 1), (1, 2, 0, -1)):
            cross[:, i, j] = sign * p[:, axis]
            cross[:, j, i] = -sign * p[:, axis]
        self.pose = np.concatenate((D @ cross, -D), axis=2)

    def _projected(self, r: Array) -> tuple[Array, Array]:
        """Return centroids in both images [px], shape (n, 4), and their derivative, (n, 4, 3)."""
        uv, J = np.empty((len(r), 4)), np.empty((len(r), 4, 3))
        for k, camera in enumerate(self._rig.cameras):
            p = (r - camera.centre) @ camera.rotation
            z = np.maximum(p[:, 2:], 2.0 * self._radius)
            stretch = 1.0 / (1.0 - (self._radius / z) ** 2)
            middle = np.array((camera.cu, camera.cv))
            uv[:, 2 * k : 2 * k + 2] = middle + camera.f_px * stretch * p[:, :2] / z
            D = _by_point(np.column_stack((p[:, :2], z)), camera.f_px)
            J[:, 2 * k : 2 * k + 2] = D @ camera.rotation.T
        return uv, J


def _by_point(p: Array, f_px: float) -> Array:
    """Return the derivative of an image point by the point in the optical frame, (n, 2, 3)."""
    D = np.zeros((len(p), 2, 3))
    for i in range(2):
        D[:, i, i] = f_px / p[:, 2]
        D[:, i, 2] = -f_px * p[:, i] / p[:, 2] ** 2
    return D


def _nearest(rig: Rig, seen: Array) -> Array:
    """Return the points nearest to both rays [m], shape (n, 3)."""
    H, b = np.zeros((len(seen), 3, 3)), np.zeros((len(seen), 3))
    for k, camera in enumerate(rig.cameras):
        middle = np.array((camera.cu, camera.cv))
        xy = (seen[:, 2 * k : 2 * k + 2] - middle) / camera.f_px
        ray = np.column_stack((xy, np.ones(len(xy)))) @ camera.rotation.T
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        projector = np.eye(3) - ray[:, :, None] * ray[:, None, :]
        H += projector
        b += projector @ camera.centre
    return np.asarray(np.linalg.solve(H + 1e-9 * np.eye(3), b[:, :, None])[:, :, 0])


@final
class _Offsets:
    """The least-squares problem: an offset for each window, a pose error for all."""

    def __init__(
        self, t: Array, window: Indices, geometry: _Geometry, speed: Array, noise: float
    ) -> None:
        """Lay the rows out."""
        self._t, self._window, self._count = t, window, int(window.max()) + 1
        self.slope = np.einsum("nij,nj->ni", geometry.depth, speed)
        s = np.einsum("ni,ni->n", geometry.across, speed)
        c = np.einsum("ni,nij->nj", geometry.across, geometry.pose)
        sigma = max(_roughness(t, window, geometry.e), _NOISE)
        # Centroids whose ball moves by less than a pixel have errors in common.
        weight = np.empty(len(t))
        for w in range(self._count):
            mine = window == w
            way = float(np.linalg.norm(speed[mine], axis=1).mean() * np.ptp(t[mine]))
            weight[mine] = min(1.0, (1.0 + way) / np.sum(mine))
        self._e, self._sigma, self._noise = geometry.e, sigma / np.sqrt(weight), sigma
        self._rows = np.column_stack((s, c)) / self._sigma[:, None]
        self._right = geometry.e / self._sigma
        prior = np.array(3 * [_TURN] + 3 * [_SHIFT])
        self._prior = np.diag(1.0 / prior**2)
        self._falls = [self._fall(geometry, w, max(sigma, noise)) for w in range(self._count)]

    def _fall(self, geometry: _Geometry, w: int, noise: float) -> tuple[Array, Array]:
        """Return what gravity says of a window's offset: rows and right sides, shape (3,) each."""
        mine = self._window == w
        tau = self._t[mine] - self._t[mine].mean()
        scale = float(np.abs(tau).max())
        basis = np.vander(tau / scale, 3)
        second = 2.0 / scale**2 * np.linalg.pinv(basis)[0]
        r, v = geometry.r[mine], np.zeros(3)
        v = np.linalg.lstsq(basis, r, rcond=None)[0][1] / scale
        a, b = second @ r, second @ self.slope[mine]
        free = np.array((0.0, 0.0, -GRAVITY)) - _DRAG * np.linalg.norm(v) * v
        deep = np.einsum("nij,nkj->ik", geometry.depth[mine], geometry.depth[mine]) / np.sum(mine)
        spread = (_PUSH + _UNSURE * float(v @ v)) ** 2
        covariance = spread * np.eye(3) + 2.0 * noise**2 * float(second @ second) * deep
        L = np.linalg.inv(np.linalg.cholesky(covariance))
        return L @ b, L @ (a - free)

    def solved(self) -> Synchrony:
        """Solve, and say what follows."""
        huber, falls = np.ones(len(self._t)), np.ones(self._count)
        for _ in range(_STEPS):
            offset, variance, pose, total = self._step(huber, falls)
            left = self._right - self._rows[:, 0] * offset[self._window] - self._rows[:, 1:] @ pose
            huber = np.minimum(1.0, _KNEE / np.maximum(np.abs(left), 1e-12))
            for w, (rows, right) in enumerate(self._falls):
                off = float(np.linalg.norm(right - rows * offset[w]))
                falls[w] = min(1.0, _KNEE / max(off, 1e-12)) ** 2
        mean, mean_variance = total
        sigma = np.sqrt(variance)
        apart = np.sqrt(np.maximum(variance - mean_variance, 1e-12))
        certain = bool(np.any(np.abs(offset) > _SURE_WINDOW * sigma))
        if np.all(np.abs(offset - mean) <= _SURE_WINDOW * apart):  # one offset for all windows
            offset, sigma = np.full_like(offset, mean), np.full_like(sigma, np.sqrt(mean_variance))
            certain = abs(mean) > _SURE * float(np.sqrt(mean_variance))
        beside = self._right - self._rows[:, 0] * offset[self._window] - self._rows[:, 1:] @ pose
        here = offset[self._window] + self._lost(beside * self._sigma)
        certain = certain or bool(np.any(here != offset[self._window]))
        return Synchrony(
            t=self._t,
            slope=self.slope,
            offset=here,
            sigma=np.hypot(sigma[self._window], self._astray(beside * self._sigma)),
            mean=float(mean),
            mean_sigma=float(np.sqrt(mean_variance)),
            shifted=certain and self._explained(left * self._sigma),
        )

    def _lost(self, left: Array) -> Array:
        """Return offsets of less than a window that errors [px] show, whole frames [s], (n,)."""
        out, s = np.zeros(len(left)), self._rows[:, 0] * self._sigma
        side = np.sign(left) * (np.abs(left) > _STRAY * self._noise)
        period = float(np.median(np.diff(self._t)))
        for run in np.split(np.arange(len(left)), np.flatnonzero(np.diff(side)) + 1):
            if len(run) >= _STRAYS and side[run[0]] != 0.0:
                frames = float(left[run] @ s[run] / (s[run] @ s[run])) / period
                if round(frames) and abs(frames - round(frames)) < _WHOLE * abs(frames):
                    out[run] = round(frames) * period
        return out

    def _astray(self, left: Array) -> Array:
        """Return offsets that errors [px] of single instants may stand for [s], shape (n,).

        A frame or two that are off, or not the ball's, are no certain offset; the track that they
        were part of is unsure by it, and stays so for some instants.
        """
        s = np.maximum(np.abs(self._rows[:, 0] * self._sigma), 1e-12)
        own = np.where(np.abs(left) > _STRAY * self._noise, np.abs(left) / s, 0.0)
        own = np.minimum(own, _BEFORE)
        shifted = [np.concatenate((np.zeros(k), own[: len(own) - k])) for k in range(_REMEMBERED)]
        return np.asarray(np.max(shifted, axis=0))

    def _explained(self, left: Array) -> bool:
        """Say whether offsets leave little [px], shape (n,), also beside a rig of another pose."""
        rows = self._rows[:, 1:] * self._sigma[:, None]
        prior = np.diag(np.sqrt(np.diag(self._prior)) * self._noise / _WRONG)
        pose = np.linalg.lstsq(
            np.vstack((rows, prior)), np.append(self._e, np.zeros(6)), rcond=None
        )[0]
        of_time, of_rig = (float(np.median(np.abs(x))) for x in (left, self._e - rows @ pose))
        return of_time < max(_BESIDE_RIG * of_rig, _BESIDE_NOISE * self._noise)

    def _step(self, huber: Array, falls: Array) -> tuple[Array, Array, Array, tuple[float, float]]:
        """Return offsets, their variances, the pose error, and the mean offset with its own."""
        own, mixed = np.full(self._count, _BEFORE**-2), np.zeros((self._count, 6))
        rest, all_pose, right_pose = np.zeros(self._count), self._prior.copy(), np.zeros(6)
        for w, (rows, right) in enumerate(self._falls):
            own[w] += falls[w] * float(rows @ rows)
            rest[w] += falls[w] * float(rows @ right)
        weighted = self._rows * huber[:, None]
        np.add.at(own, self._window, weighted[:, 0] * self._rows[:, 0])
        np.add.at(mixed, self._window, weighted[:, :1] * self._rows[:, 1:])
        np.add.at(rest, self._window, weighted[:, 0] * self._right)
        all_pose += weighted[:, 1:].T @ self._rows[:, 1:]
        right_pose += weighted[:, 1:].T @ self._right
        share = mixed / own[:, None]
        S = np.linalg.inv(all_pose - mixed.T @ share)
        pose = S @ (right_pose - share.T @ rest)
        offset = (rest - mixed @ pose) / own
        variance = 1.0 / own + np.einsum("wi,ij,wj->w", share, S, share)
        total = np.block([[np.sum(own), mixed.sum(axis=0)], [mixed.sum(axis=0)[:, None], all_pose]])
        covariance = np.linalg.inv(total)
        mean = covariance[0] @ np.concatenate(([rest.sum()], right_pose))
        return offset, variance, pose, (float(mean), float(covariance[0, 0]))


def _roughness(t: Array, window: Indices, e: Array) -> float:
    """Return the noise of the errors [px]: what parabolas through them leave in each window."""
    left = []
    for w in range(int(window.max()) + 1):
        mine = window == w
        tau = t[mine] - t[mine].mean()
        basis = np.vander(tau / max(float(np.abs(tau).max()), 1e-12), 3)
        rest = e[mine] - basis @ np.linalg.lstsq(basis, e[mine], rcond=None)[0]
        left.append(rest * np.sqrt(len(rest) / (len(rest) - 3)))
    return float(1.4826 * np.median(np.abs(np.concatenate(left))))
