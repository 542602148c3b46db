"""What link, servo and load of a robot are, from a motion and what was sent meanwhile.

With a delay d, a bandwidth w, and L a filter that all signals go through alike (a Gaussian and its
derivatives, so that nothing is differentiated twice), of each joint:

    torque:    L tau(t - d) = L (M ddq + c + g)(q; load) + friction
    velocity:  L ddq = 2 w L (v_s(t - d) - dq) + friction
    position:  L ddq = w^2 L (q_s(t - d) - q) + 2 w L (dq_s(t - d) - dq) + friction

Commands are held from one to the next, and dq_s is the difference of two setpoints, as in
:mod:`mitt.core.control.setpoints`. What is linear (friction, inertia of the drives, the load's mass
and its first moment) is solved for exactly at each d and w, which are found by Gauss-Newton steps
from the best of a grid (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973)).

How sure a figure is follows from the motion itself: it is worked out again without each eighth of
the time, and without each joint, in turn (the jackknife: Efron and Stein, Ann. Stat. 9 (1981)). So
what the arm's model lacks, which shows itself as joints that disagree, is in the figure. Delay and
bandwidth of a joint control are the medians of the joints.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi, sqrt
from typing import TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError
from mitt.core.signals import Array
from mitt.io.cell import Takes
from mitt.robot.cell.excitation import MotionLog

#: Step of the signals [s], and every how many of them is a row of the equations.
_STEP = 5e-4
_EVERY = 12
#: Width of the filter, one sigma [s], and how many sigmas of it are kept.
_WIDTH = 0.005
_TAILS = 4
#: Speed over which dry friction turns its sign [rad/s].
_SLIPS = 0.01
#: Where delays [s] and bandwidths [Hz] are looked for first.
_DELAYS = np.arange(0.0, 0.0501, 0.002)
_SERVOS = np.geomspace(0.7, 90.0, 15)
#: Most steps from there, the step that ends them, and for delay [s] and logarithm of a bandwidth
#: the step of differences and the longest.
_STEPS = 30
_NEAR = 1e-6
_APART_DELAY = 1e-4
_APART = 1e-3
_FAR_DELAY = 0.004
_FAR = 0.5
#: Delays that are taken for one [s].
_LOW = -0.005
_HIGH = 0.08
#: What is left over of a joint at the least: a signal without noise.
_LEAST = 1e-9
#: Parts of the motion of which each is left out in turn.
_PARTS = 8
#: First moment that a load hardly has [kg m]: 1 kg, its centre at 0.1 m. It stands for
#: what the motion does not show; rows of model errors that last this long count as one [s].
_MOMENT = 0.1
_LIKE = 0.25
#: Standard deviation of the median of many, in units of their median deviation over the root of how
#: many there are: 1.4826 sqrt(pi / 2), of normal ones.
_OF_MEDIAN = 1.858
#: Readings, and commands, that are needed at least.
_FEWEST = 500

Kept: TypeAlias = NDArray[np.bool_]
"""Which rows are kept, shape (k, n)."""


@final
@dataclass(frozen=True, slots=True)
class Figure:
    """A figure and how sure it is.

    Attributes:
        value: The figure.
        sigma: Its standard deviation.
    """

    value: float
    sigma: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Identified:
    """What a motion showed.

    Attributes:
        delay: Time from reading the joints until the command made then ceases to act [s].
        servo: Bandwidth of the robot's own joint control [Hz]; None where it takes torques.
        load: Mass at the tool plate beside the arm's model with its hand [kg]; None where no
            torques are sent.
        load_at: Its centre in the frame of the tool plate [m], each coordinate; empty without load.
    """

    delay: Figure
    servo: Figure | None = None
    load: Figure | None = None
    load_at: tuple[Figure, ...] = ()

    @property
    def values(self) -> dict[str, dict[str, float | list[float]]]:
        """What a cell's file says of this, by table and key."""
        robot: dict[str, float | list[float]] = {"delay": round(max(self.delay.value, 0.0), 4)}
        if self.servo is not None:
            robot["servo"] = round(self.servo.value, 2)
        if self.load is None:
            return {"robot": robot}
        arm: dict[str, float | list[float]] = {"load": 0.0}
        if self.load_at:
            arm["load"] = round(self.load.value, 3)
            arm["load_at"] = [round(x.value, 3) for x in self.load_at]
        return {"robot": robot, "arm": arm}

    @property
    def figures(self) -> dict[str, object]:
        """The figures and their standard deviations; null for what was not measured."""
        out: dict[str, object] = {}
        for name, of in (("delay_s", self.delay), ("servo_hz", self.servo), ("load_kg", self.load)):
            out[name] = None if of is None else {"value": of.value, "sigma": of.sigma}
        out["load_at_m"] = [{"value": x.value, "sigma": x.sigma} for x in self.load_at] or None
        return out

    @property
    def words(self) -> tuple[str, ...]:
        """The figures for a person, a line each, with twice the standard deviation."""
        delay = self.delay
        lines = [f"delay {1e3 * delay.value:.2f} +- {2e3 * delay.sigma:.2f} ms"]
        if self.servo is not None:
            w, sigma = self.servo.value, self.servo.sigma
            lines.append(f"bandwidth of the joint control {w:.2f} +- {2.0 * sigma:.2f} Hz")
        if self.load is None:
            lines.append("load not measured: the robot is sent no torques")
            return tuple(lines)
        said = f"load {self.load.value:.2f} +- {2.0 * self.load.sigma:.2f} kg"
        at = ", ".join(f"{x.value:.3f} +- {2.0 * x.sigma:.3f}" for x in self.load_at)
        lines.append(f"{said}, its centre at {at} m" if at else f"{said}: none is certain")
        return tuple(lines)


def identify(arm: Arm, takes: Takes, log: MotionLog, *, period: float) -> Identified:
    """Return what a motion shows of a robot.

    Args:
        arm: The arm with its hand, without a load.
        takes: What its drives were sent.
        log: The motion.
        period: Time from one command to the next [s].

    Raises:
        InputError: Too little was read or sent.
    """
    if min(len(log.read), len(log.sent)) < _FEWEST:
        given = f"{len(log.read)} readings, {len(log.sent)} commands"
        raise InputError("the motion", f"{_FEWEST} of each at least", given)
    if takes != "torque":
        return _servo_found(_servo(takes, log), period)
    equations = _torques(arm, log)
    every = np.ones(equations.shape, dtype=bool)
    best = equations.solved(every, None)
    parts = [equations.solved(keep, best[: equations.free]) for keep in equations.parts()]
    joints = [equations.solved(keep, best[: equations.free]) for keep in equations.joints()]
    sigma = np.hypot(_jackknife(parts), _jackknife(joints))
    delay = Figure(float(best[0] + period), float(sigma[0]))
    mass, moment = best[1], best[2:5]
    load = Figure(float(mass), float(sigma[1]))
    if mass < 2.0 * sigma[1]:
        return Identified(delay=delay, load=load)
    at = [Figure(float(x / mass), float(s / mass)) for x, s in zip(moment, sigma[2:5], strict=True)]
    return Identified(delay=delay, load=load, load_at=tuple(at))


def _servo_found(equations: "_Equations", period: float) -> Identified:
    """Return delay and bandwidth as most joints have them: dry friction hides those of some.

    Each joint is solved alone, and the median is taken: where friction holds a light joint against
    its control, that joint alone would say a smaller bandwidth.
    """
    only = [~keep for keep in equations.joints()] or [np.ones(equations.shape, dtype=bool)]
    alone = np.array([equations.solved(keep, None) for keep in only])
    best = np.median(alone, axis=0)
    parts = [
        np.median(
            [equations.solved(keep & x, near) for x, near in zip(only, alone, strict=True)], axis=0
        )
        for keep in equations.parts()
    ]
    scatter = _OF_MEDIAN * np.median(np.abs(alone - best), axis=0) / sqrt(len(alone))
    sigma = np.hypot(scatter, _jackknife(parts))
    w = float(np.exp(best[1])) / (2.0 * pi)
    return Identified(
        delay=Figure(float(best[0] + period), float(sigma[0])),
        servo=Figure(w, w * float(sigma[1])),
    )


def _jackknife(without: list[Array]) -> Array:
    """Return standard deviations from solutions that lack one part each; infinite from one."""
    k = len(without)
    if k < 2:
        return np.zeros(0 if not without else len(without[0]))
    out: Array = np.sqrt((k - 1) * np.var(np.array(without), axis=0))
    return out


@dataclass(slots=True, kw_only=True)
class _Equations:
    """The equations of a motion, a row each ``_EVERY`` steps and joint.

    Attributes:
        told: The command, smoothed, shape (m, n), each step.
        rate: For positions its difference; else empty.
        rows: Steps at which the rows are.
        q: Joint positions, smoothed, and their derivatives, shape (3, k, n).
        fixed: What is taken from the left side: for torques those of the model, shape (k, n).
        linear: What is linear, shape (k, n, c).
        shared: How many of its columns are of the load, the first ones.
        takes: What the drives are sent.
    """

    told: Array
    rate: Array
    rows: Array
    q: Array
    fixed: Array
    linear: Array
    shared: int
    takes: Takes

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and joints."""
        return self.q.shape[1], self.q.shape[2]

    @property
    def free(self) -> int:
        """How many unknowns are not linear: delay, and the logarithm of w [rad/s]."""
        return 1 if self.takes == "torque" else 2

    def parts(self) -> list[Kept]:
        """Return what is kept without each part of the time, shape (k, n) each."""
        k, n = self.shape
        part = np.arange(k) * _PARTS // k
        return [np.repeat((part != p)[:, None], n, axis=1) for p in range(_PARTS)]

    def joints(self) -> list[Kept]:
        """Return what is kept without each joint, shape (k, n) each; nothing of a single joint."""
        k, n = self.shape
        return [np.tile(np.arange(n) != j, (k, 1)) for j in range(n)] if n > 1 else []

    def left(self, p: Array) -> Array:
        """Return what friction, and load, have to explain at delay and bandwidth, shape (k, n)."""
        told = self._late(self.told, float(p[0]))
        if self.takes == "torque":
            return told - self.fixed
        w, (q, dq, ddq) = float(np.exp(p[1])), self.q
        if self.takes == "velocity":
            by_speed: Array = ddq - 2.0 * w * (told - dq)
            return by_speed
        rate = self._late(self.rate, float(p[0]))
        by_place: Array = ddq - w**2 * (told - q) - 2.0 * w * (rate - dq)
        return by_place

    def _late(self, x: Array, d: float) -> Array:
        """Return a signal at the rows, a delay ago [s]."""
        at = self.rows - d / _STEP
        k = np.clip(at.astype(np.int64), 0, len(x) - 2)
        out: Array = x[k] + (at - k)[:, None] * (x[k + 1] - x[k])
        return out

    def solved(self, keep: Kept, near: Array | None) -> Array:
        """Return delay, logarithm of w, then what of the load is linear, from some rows.

        Args:
            keep: Which rows, shape (k, n).
            near: Where to begin; looked for if left out.
        """
        if near is None:  # what is left over says how far to trust a joint
            near = self._fitted(keep, np.ones(self.shape[1]), None)[0]
        p, load = self._fitted(keep, self._scale(keep, near), near)
        return np.concatenate([p, load])

    def _fitted(self, keep: Kept, scale: Array, near: Array | None) -> tuple[Array, Array]:
        """Return delay and logarithm of w, and what of the load is linear; see :meth:`solved`.

        Each joint is held to what is left over of it, one sigma, shape (n,).
        """
        A, prior = self._columns(keep, scale)
        basis = np.linalg.qr(A)[0]

        def asked(p: Array) -> Array:
            """Return what is to be explained, with rows of what is known beforehand."""
            return np.concatenate([(self.left(p) / scale)[keep], np.zeros(prior)])

        def rest(p: Array) -> Array:
            """Return what is left over."""
            y = asked(p)
            out: Array = y - basis @ (basis.T @ y)
            return out

        p = self._refined(rest, self._first(rest) if near is None else near)
        linear = np.linalg.lstsq(A, asked(p), rcond=None)[0]
        return p, np.array(linear[: self.shared], dtype=np.float64)

    def _refined(self, rest: Callable[[Array], Array], p: Array) -> Array:
        """Return delay, and logarithm of w, after Gauss-Newton steps."""
        sizes = np.array([_APART_DELAY, _APART])[: self.free]
        most = np.array([_FAR_DELAY, _FAR])[: self.free]
        for _ in range(_STEPS):
            J = np.stack(
                [(rest(p + m) - rest(p - m)) / (2.0 * np.sum(m)) for m in np.diag(sizes)], axis=1
            )
            change = np.clip(-np.linalg.lstsq(J, rest(p), rcond=None)[0], -most, most)
            p = p + change
            p[0] = min(max(p[0], _LOW), _HIGH)
            if np.all(np.abs(change) < _NEAR):
                break
        return p

    def _first(self, rest: Callable[[Array], Array]) -> Array:
        """Return the best of a grid."""
        best, least = np.zeros(self.free), inf
        for d in _DELAYS:
            for f in _SERVOS if self.free == 2 else (1.0,):
                p = np.array([d, np.log(2.0 * pi * f)])[: self.free]
                if (cost := float(np.sum(rest(p) ** 2))) < least:
                    best, least = p, cost
        return best

    def _scale(self, keep: Kept, p: Array) -> Array:
        """Return what is left over of each joint, one sigma, shape (n,)."""
        n = self.shape[1]
        out, left = np.ones(n), self.left(p)
        for j in range(n):
            rows = keep[:, j]
            if np.any(rows):
                A, y = self.linear[rows, j], left[rows, j]
                y = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
                out[j] = max(float(np.sqrt(np.mean(y**2))), _LEAST)
        return out

    def _columns(self, keep: Kept, scale: Array) -> tuple[Array, int]:
        """Return the columns of what is linear, of the rows that are kept, and how many are prior.

        Those of the load are shared by all joints; friction is each joint's own.
        """
        k, n = self.shape
        own = self.linear.shape[2] - self.shared
        A = np.zeros((k, n, self.shared + n * own))
        scaled = self.linear / scale[None, :, None]
        A[:, :, : self.shared] = scaled[:, :, : self.shared]
        for j in range(n):
            first = self.shared + j * own
            A[:, j, first : first + own] = scaled[:, j, self.shared :]
        kept = A[keep]
        if not self.shared:
            return self._present(kept), 0
        weight = sqrt(_LIKE / (_EVERY * _STEP)) / _MOMENT
        prior = np.zeros((3, kept.shape[1]))
        prior[np.arange(3), 1 + np.arange(3)] = weight
        return self._present(np.concatenate([kept, prior])), 3

    def _present(self, A: Array) -> Array:
        """Return columns without those of friction that no row has, which QR would make up."""
        there = np.any(A != 0.0, axis=0)
        there[: self.shared] = True
        return A[:, there]


def _smooth(x: Array, order: int) -> Array:
    """Return a signal of rows ``_STEP`` apart, smoothed, or its derivative of an order."""
    half = round(_TAILS * _WIDTH / _STEP)
    t = np.arange(-half, half + 1) * _STEP
    g = np.exp(-0.5 * (t / _WIDTH) ** 2)
    g /= np.sum(g)
    if order == 1:
        g = -g * t / _WIDTH**2
        g /= -np.sum(g * t)
    elif order == 2:
        g = g * (t**2 / _WIDTH**4 - 1.0 / _WIDTH**2)
        g -= np.mean(g)
        g *= 2.0 / np.sum(g * t**2)
    out: Array = np.stack([np.convolve(x[:, j], g, mode="same") for j in range(x.shape[1])], axis=1)
    return out


def _held(t: Array, sent: Array, told: Array) -> Array:
    """Return the means, over a step about each time, of commands that hold until the next one."""
    total = np.concatenate(
        [np.zeros((1, told.shape[1])), np.cumsum(np.diff(sent)[:, None] * told[:-1], axis=0)]
    )
    edges = np.append(t - 0.5 * _STEP, t[-1] + 0.5 * _STEP)
    sums = np.stack([np.interp(edges, sent, total[:, j]) for j in range(told.shape[1])], axis=1)
    out: Array = np.diff(sums, axis=0) / _STEP
    return out


def _signals(log: MotionLog) -> tuple[Array, Array, Array]:
    """Return times of the steps, joints with their derivatives (3, k, n), and the rows."""
    begin, end = max(log.read[0], log.sent[0]), min(log.read[-1], log.sent[-1])
    t = np.arange(begin + _STEP, end - _STEP, _STEP)
    q = np.stack([np.interp(t, log.read, log.q[:, j]) for j in range(log.q.shape[1])], axis=1)
    edge = round((_TAILS * _WIDTH + _DELAYS[-1]) / _STEP) + 2
    rows = np.arange(edge, len(t) - edge, _EVERY)
    return t, np.array([_smooth(q, k)[rows] for k in range(3)]), rows


def _slip(dq: Array) -> Array:
    """Return the sign of a speed, smooth about rest."""
    out: Array = np.tanh(dq / _SLIPS)
    return out


def _servo(takes: Takes, log: MotionLog) -> _Equations:
    """Return the equations of a robot with a joint control of its own."""
    t, q, rows = _signals(log)
    told = _smooth(_held(t, log.sent, log.told), 0)
    rate = np.zeros((0, log.told.shape[1]))
    if takes == "position":
        steps = np.diff(log.told, axis=0) / np.diff(log.sent)[:, None]
        rate = _smooth(_held(t, log.sent, np.concatenate([steps[:1], steps])), 0)
    k, n = q.shape[1], q.shape[2]
    linear = np.ones((k, n, 2 * n + 1))
    # Friction of one joint, and weight that its maker's model lacks, act on all by their inertia.
    linear[:, :, 1 : n + 1] = _slip(q[1])[:, None, :]
    linear[:, :, n + 1 :] = (q[0] - np.mean(q[0], axis=0))[:, None, :]
    return _Equations(
        told=told,
        rate=rate,
        rows=rows,
        q=q,
        fixed=np.zeros((k, n)),
        linear=linear,
        shared=0,
        takes=takes,
    )


def _torques(arm: Arm, log: MotionLog) -> _Equations:
    """Return the equations of a robot that takes torques."""
    t, q, rows = _signals(log)
    motion = np.moveaxis(q, 0, 1)
    fixed = _model(arm, motion)
    none = np.zeros((3, 3))
    columns = [
        _model(Arm(arm.model.loaded(1.0, at=np.zeros(3), inertia=none), arm.limits), motion) - fixed
    ]
    for at in 0.1 * np.eye(3):
        loaded = [
            _model(Arm(arm.model.loaded(1.0, at=side * at, inertia=none), arm.limits), motion)
            for side in (1.0, -1.0)
        ]
        columns.append((loaded[0] - loaded[1]) / 0.2)
    columns += [_slip(q[1]), q[1], q[2]]
    return _Equations(
        told=_smooth(_held(t, log.sent, log.told), 0),
        rate=np.zeros((0, arm.n)),
        rows=rows,
        q=q,
        fixed=fixed,
        linear=np.stack(columns, axis=2),
        shared=4,
        takes="torque",
    )


def _model(arm: Arm, motion: Array) -> Array:
    """Return the torques of the active joints along a motion [N m], shape (k, n)."""
    return np.array([arm.inverse_dynamics(*row) for row in motion])
