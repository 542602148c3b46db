"""Rival ``mpc``: model-predictive control of the joints' dynamics, up to the predicted catch.

A quadratic programme over the accelerations at even instants until the catch, linear between
them: least cost (22), torques linearised along the quintic that would do the same, bounds on the
drives' torques (soft, so that an answer is always there) and on speeds and ranges, and the
meeting with the ball at the end. One Gauss-Newton step each time (real-time iteration, Diehl and
others 2005), condensed onto the accelerations, solved by DAQP (Arnstroem and others 2022).

Accelerations a at M + 1 even instants, m = (M + 1) n of them, decide angles and speeds there:
q = drift + P a, dq = drift + D a joint by joint (:func:`mitt.lab.rivals.paths.responses`).

| here      | meaning                                           | unit    | shape        |
|-----------|---------------------------------------------------|---------|--------------|
| ``a``     | accelerations, instant by instant                 | rad/s^2 | (m,)         |
| ``rows``  | ends, torques, angles, speeds per acceleration    |         | (4 n + K, m) |
| ``low``   | their lower bounds; ``high``, their upper ones    |         | (4 n + K,)   |
| ``price`` | joints' torques, then speeds, over their limits   | s^2/rad | (2 m, m)     |
| ``at``    | the same at no acceleration                       | 1       | (2 m,)       |

K = (M + 1) N + 2 (M - 1) n.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import daqp
import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import STOP_GAP
from mitt.core.arm.dynamics import torque_slopes
from mitt.core.arm.limits import bound_of, drive_asked, drives_of
from mitt.core.catcher.generators import Generator
from mitt.core.kernels import kernel
from mitt.core.map.demand import ArmNumbers, Work, arm_numbers, work_of
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Array
from mitt.lab.rivals.intercept import Intercept
from mitt.lab.rivals.paths import PathMotion, quintic, responses
from mitt.lab.rivals.planned import Plan, Planned
from mitt.lab.rivals.pursuit import SPEED, rival

#: Kinds of DAQP's rows: an equality, an inequality that may give way.
_EQUAL = 5
_SOFT = 8


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MpcSettings:
    """How the programme is set up.

    Attributes:
        parts: Parts M of the horizon.
        share: Share of the torque limits.
        speed: Share of the speed limits.
        gap: Gap to a joint stop that is kept [rad].
        damping: Weight that keeps the programme strictly convex.
    """

    parts: int = 10
    share: float = 0.9
    speed: float = SPEED
    gap: float = STOP_GAP
    damping: float = 1e-7


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quadratic:
    """min a' H a / 2 + f' a, low <= A a <= high; ``kind`` as DAQP names its rows."""

    H: Array
    f: Array
    A: Array
    low: Array
    high: Array
    kind: NDArray[np.int32]


class Horizon(NamedTuple):
    """From where to where in which instants.

    Attributes:
        start: q, dq, ddq now, shape (3, n).
        end: The same at the catch.
        step: Time between two instants [s].
        D, P: How speeds and angles at the instants follow from the accelerations
            (:func:`mitt.lab.rivals.paths.responses`), shape (M + 1, M + 1) each.
    """

    start: Array
    end: Array
    step: float
    D: Array
    P: Array


class Rows(NamedTuple):
    """The programme as the kernels write it; see the module's table."""

    rows: Array
    low: Array
    high: Array
    price: Array
    at: Array


@final
@dataclass(frozen=True)
class MpcPlanner:
    """Plans for one arm."""

    arm: Arm
    settings: MpcSettings = MpcSettings()

    def __call__(self, motion: Array, t: float, catch: Intercept) -> Plan | None:
        """Return the plan that ends at the catch; None where the programme has no answer."""
        step = (catch.t_c - t) / self.settings.parts
        if not step > 1e-4:
            return None
        a = solve(self.problem(motion, catch.end, step))
        return None if a is None else self._read(a, motion, t, step)

    def problem(self, motion: Array, end: Array, step: float) -> Quadratic:
        """Return the programme from q, dq, ddq (3, n) to ``end`` in M steps of ``step`` [s]."""
        s, size, kind = self.settings, (self.settings.parts + 1) * self.arm.n, self._kind
        out = Rows(
            np.zeros((len(kind), size)),
            np.empty(len(kind)),
            np.empty(len(kind)),
            np.zeros((2 * size, size)),
            np.empty(2 * size),
        )
        h = Horizon(motion, end, step, *responses(s.parts, step))
        condense(*self._scales, self._ranges, h, (s.share, s.speed), out)
        H = 2.0 * (out.price.T @ out.price)
        H.ravel()[:: size + 1] += s.damping
        f = 2.0 * (out.at @ out.price)
        return Quadratic(H=H, f=f, A=out.rows, low=out.low, high=out.high, kind=kind)

    @cached_property
    def _scales(self) -> tuple[ArmNumbers, Work]:
        """The arm as the kernel takes it, and buffers."""
        return arm_numbers(self.arm), work_of(self.arm)

    @cached_property
    def _ranges(self) -> Array:
        """Smallest and largest angles allowed [rad], shape (2, n)."""
        return np.array([self.arm.q_min + self.settings.gap, self.arm.q_max - self.settings.gap])

    @cached_property
    def _kind(self) -> NDArray[np.int32]:
        """Kinds of the rows: the ends; torques, angles and speeds, which may give way."""
        M, n, links = self.settings.parts, self.arm.n, len(self.arm.model.links)
        soft = (M + 1) * links + 2 * (M - 1) * n
        return np.array([_EQUAL] * (4 * n) + [_SOFT] * soft, np.int32)

    def _read(self, a: Array, motion: Array, t: float, step: float) -> PathMotion:
        """Return the answer as a motion."""
        M, n = self.settings.parts, self.arm.n
        D, P = responses(M, step)
        rows = a.reshape(M + 1, n)
        ticks = step * np.arange(M + 1)[:, None]
        q, dq = motion[0] + ticks * motion[1] + P @ rows, motion[1] + D @ rows
        q, dq, ddq = (np.ascontiguousarray(x.T) for x in (q, dq, rows))
        return PathMotion(t=t, step=step, q=q, dq=dq, ddq=ddq, cost=0.0)


def solve(problem: Quadratic) -> Array | None:
    """Return the minimiser; None where DAQP finds none, or says so and is wrong."""
    parts = (problem.H, problem.f, problem.A, problem.low, problem.high)
    if not all(np.isfinite(x).all() for x in parts):
        return None
    a, _, flag, _ = daqp.solve(
        problem.H, problem.f, problem.A, problem.high, problem.low, problem.kind
    )
    a = np.asarray(a, np.float64)
    if flag < 1 or not np.all(np.isfinite(a)):
        return None
    must = np.count_nonzero(problem.kind == _EQUAL)  # the first rows
    left = np.abs(problem.A[:must] @ a - problem.low[:must]).max()
    return a if left < 1e-4 else None  # at the intercept [rad, rad/s]


def mpc_path(arm: Arm) -> Planned:
    """Return the pursuit by plans that are made anew whenever 10 ms have gone by."""
    return Planned(planner=MpcPlanner(arm), dead_q=0.0, dead_dq=0.0, every=0.01)


def make_mpc(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, mpc_path(f.arm))


@kernel
def condense(
    p: ArmNumbers, w: Work, ranges: Array, h: Horizon, shares: tuple[float, float], out: Rows
) -> None:
    """Write the programme; see the module's table.

    Args:
        p: The arm.
        w: Scratch.
        ranges: Smallest and largest angle allowed [rad], shape (2, n).
        h: From where to where.
        shares: Shares of the torque and of the speed limits.
        out: Result; zeros where the programme has none.
    """
    start, step, D, P = h.start, h.step, h.D, h.P
    n, links, M = start.shape[1], len(w.tau), len(D) - 1
    rows, low, high, price, at = out
    _pin_ends(h, out)
    first = 4 * n + (M + 1) * links
    half, size = (M - 1) * n, (M + 1) * n
    for k in range(M + 1):
        _load(p, w, h, k, shares[0], out)
        for j in range(n):
            own, top = k * n + j, p.dq_max[j]
            at[size + own] = start[1, j] / top
            for i in range(k + 1):
                price[size + own, i * n + j] = D[k, i] / top
            if not 0 < k < M:
                continue
            q, v = first + own - n, first + half + own - n
            drift = start[0, j] + k * step * start[1, j]
            low[q], high[q] = ranges[0, j] - drift, ranges[1, j] - drift
            low[v], high[v] = -shares[1] - at[size + own], shares[1] - at[size + own]
            for i in range(k + 1):
                rows[q, i * n + j], rows[v, i * n + j] = P[k, i], price[size + own, i * n + j]


@kernel
def _pin_ends(h: Horizon, out: Rows) -> None:
    """Write what must hold: both ends' accelerations, angles and speeds at the end."""
    rows, low, high = out.rows, out.low, out.high
    start, end, step, D, P = h
    n, M = start.shape[1], len(D) - 1
    for j in range(n):
        rows[j, j], rows[n + j, M * n + j] = 1.0, 1.0
        for i in range(M + 1):
            rows[2 * n + j, i * n + j], rows[3 * n + j, i * n + j] = P[M, i], D[M, i]
        low[j], low[n + j] = start[2, j], end[2, j]
        low[2 * n + j] = end[0, j] - (start[0, j] + M * step * start[1, j])
        low[3 * n + j] = end[1, j] - start[1, j]
    high[: 4 * n] = low[: 4 * n]


@kernel
def _load(p: ArmNumbers, w: Work, h: Horizon, k: int, share: float, out: Rows) -> None:
    """Write the torques of instant k: those of the drives as bounds, the joints' as a price."""
    rows, low, high, price, at = out
    start, end, step, D, P = h
    n, links, motion, slope = start.shape[1], len(w.tau), w.motion, w.slope
    quintic(start, end, (len(D) - 1) * step, k * step, motion)
    torque_slopes(p.bodies, motion, w.tau, slope, w.links)
    none, per = np.zeros(links), np.zeros((links, (k + 1) * n))
    for a in range(links):
        none[a] = w.tau[a]
        for j in range(n):
            drift = start[0, j] + k * step * start[1, j]
            none[a] += slope[0, a, j] * (drift - motion[0, j])
            none[a] += slope[1, a, j] * (start[1, j] - motion[1, j]) - slope[2, a, j] * motion[2, j]
            for i in range(k + 1):
                per[a, i * n + j] = slope[0, a, j] * P[k, i] + slope[1, a, j] * D[k, i]
            per[a, k * n + j] += slope[2, a, j]
    for j in range(n):
        w.dq[p.joints[j]] = motion[1, j]
    drives = drives_of(p.drives)
    for d in range(links):
        tau, omega = drive_asked(p.drives, d, w.tau, w.dq)
        bound = bound_of(p.drives, d, tau, omega, 0.0)
        bound = max(bound, 0.05 * drives.tau_peak[d])  # near its no-load speed it has none
        row, load = 4 * n + k * links + d, 0.0
        for a in range(links):
            scale = drives.to_drive[d, a] / bound
            load += scale * none[a]
            for c in range((k + 1) * n):
                rows[row, c] += scale * per[a, c]
        low[row], high[row] = -share - load, share - load
    for j in range(n):
        a, row = p.joints[j], k * n + j
        at[row] = none[a] / p.tau_max[j]
        for c in range((k + 1) * n):
            price[row, c] = per[a, c] / p.tau_max[j]
