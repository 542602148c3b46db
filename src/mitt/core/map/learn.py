"""Learning the coefficients over a neighbourhood of flights, eq. (22).

One alpha cannot start every flight where the arm is (eq. (12) holds C and d of one flight), so
each flight f has its own alpha_f, the projection of the common alpha* onto C_f alpha = d_f in
the norm of H. The cost is that of the alpha_f; its Gauss-Newton step in alpha* is a small
quadratic programme with the torque, speed, range and acceleration rows (18), (20) of all flights.
A map with ``match_weight`` adds that weight times the squared relative velocity at the catch, which
is linear in alpha.

| here           | meaning                                                   | shape          |
|----------------|-----------------------------------------------------------|----------------|
| ``t, ball``    | instants from t_0 to a little past t_c; r_o, dr_o, ddr_o  | (K,), (K, 3, 3)|
| ``seen``       | the same at t_0, as the filter believed                   | (3, 3)         |
| ``slope``      | d tau/dq, d tau/d dq, M at each instant                   | (K, 3, N, n)   |
| ``J``          | d residual / d alpha of the cost (22)                     | (2 K n, m n)   |
| ``rows, room`` | linearised limits: rows @ step <= room                    | (R, m n), (R,) |
| ``P``          | I - W C, the part of alpha* that a flight keeps           | (m n, m n)     |
| ``W``          | answer of alpha to a gap in d                             | (m n, 2n)      |
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError
from mitt.core.fields import Range, Settings, brief
from mitt.core.map.demand import demand
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import (
    DirectMap,
    answer_to_gap,
    basis_of,
    coordinates,
    initial_gap,
    initial_matrix,
    unlearned,
)
from mitt.core.map.prediction import root_time
from mitt.core.signals import Array

#: Share of the trace of a Hessian that is added to its diagonal.
_RIDGE = 1e-9
#: Halvings of a step that does not help, and weight of the mean squared excess over the instants.
_HALVINGS = 6
_PENALTY = 300.0
#: Newton steps of the soft programme, and the relative step at which it has converged.
_NEWTON_STEPS = 30
_SMALL = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LearnSettings(Settings):
    """How to learn.

    Attributes:
        steps: Most Gauss-Newton steps.
        tolerance: Relative change of the cost at which to stop.
        share: Share of each limit that the learned motions may use.
        near: Share of a limit from which a row enters the programme.
    """

    steps: Annotated[int, Range(0, 10**4)] = 20
    tolerance: Annotated[float, Range(0.0, 1.0)] = 1e-3
    share: Annotated[float, Range(0.01, 100.0)] = 0.92
    near: Annotated[float, Range(0.0, 100.0)] = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """State before one step: mean cost of torque and speed (fig. 7), largest share of a limit."""

    cost_torque: float
    cost_speed: float
    worst: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Learned:
    """A learned map and how it came about.

    Attributes:
        map: The map with alpha* and H.
        maps: The map at each of those steps; only the last where it was read from a file.
        steps: Cost of alpha = 0 as it is, of alpha = 0 projected onto each flight's start, and
            after each Gauss-Newton step.
        flights: Flights used.
        left_out: Flights that leave the domain of l_c^-1.
        status: ``converged`` where the cost has settled and every flight keeps every limit;
            ``limits`` where one asks for more; ``domain`` where fewer than half of the flights are
            inside the domain of l_c^-1; ``steps`` where their number was the end; ``solver`` where
            no sound step was found: the map is the last sound one.
    """

    map: DirectMap
    maps: tuple[DirectMap, ...]
    steps: tuple[Step, ...]
    flights: int
    left_out: int
    status: str

    __repr__ = brief


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """One flight to learn from or to judge."""

    t: Array
    ball: Array
    seen: Array

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the arrays to each other."""
        t = checks.array("t", self.t, (None,), finite=True)
        ball = checks.array("ball", self.ball, (len(t), 3, 3))
        arrays = {"t": t, "ball": ball, "seen": checks.array("seen", self.seen, (3, 3))}
        for name, value in arrays.items():
            object.__setattr__(self, name, value)


class Lifted(NamedTuple):
    """A flight in virtual joints: all that q_d along it depends on besides alpha."""

    virtual: Array  # (K, 3, n) q_o, dq_o, ddq_o
    phi: Array  # (K, 3, m) monomials and their two time derivatives
    phi_0: Array  # (2, m) monomials and their rate at t_0; more rows where more is held
    gap: Array  # (2n,) d of eq. (12) for the arm at t_0; n more a row of phi_0
    relative: Array  # (3,) velocity of the ball relative to the hand at the catch, alpha = 0 [m/s]
    slope: Array  # (3, m n) of that in alpha; (0,) and (0, m n) where the map does not weigh it

    def motion(self, alpha: Array) -> Array:
        """Return q_d, dq_d, ddq_d along the flight, shape (K, 3, n)."""
        out: Array = self.virtual + self.phi @ alpha
        return out

    def relative_velocity(self, alpha: Array) -> Array:
        """Return the velocity of the ball relative to the hand at the catch [m/s], shape (3,)."""
        out: Array = self.relative + self.slope @ alpha.ravel()
        return out


def lift_flight(
    f: DirectMap, flight: Flight, start: tuple[Array, Array] | None = None
) -> Lifted | None:
    """Return the flight in virtual joints; None where it leaves the domain of l_c^-1.

    Args:
        f: The map.
        flight: The flight.
        start: q, dq of the arm at t_0 [rad, rad/s], shape (n,) each; at rest in its ready pose if
            left out.
    """
    rows = [f.virtual(ball) for ball in (flight.seen, *flight.ball)]
    if not all(inside for inside, _ in rows):
        return None
    virtual = np.array([row for _, row in rows])
    phi = np.array([f.basis.jets(*coordinates(f.tangent, row)) for row in virtual])
    q, dq = (f.arm.q_ready, np.zeros(f.arm.n)) if start is None else start
    gap = initial_gap(q, dq, virtual[0])
    return Lifted(virtual[1:], phi[1:], phi[0, :2], gap, *_met(f, flight, virtual[-1]))


def _met(f: DirectMap, flight: Flight, last: Array) -> tuple[Array, Array]:
    """Return the relative velocity at the catch [m/s], (3,), and its slope in alpha, (3, m n).

    There b vanishes, so the pose is l_c^-1(r_o), and the velocity of the hand is linear in alpha.
    Nothing where the map does not weigh it, or where the flight ends far from its catch.

    Args:
        f: The map.
        flight: The flight, which ends a little past the catch.
        last: Virtual joints and two derivatives at its end, shape (3, n).
    """
    size = f.alpha.size
    nothing = np.zeros(0), np.zeros((0, size))
    if f.design.match_weight == 0.0:
        return nothing
    s, ds, dds = coordinates(f.tangent, last)[:, f.tangent.catch] - [f.design.q_catch, 0.0, 0.0]
    after, before = root_time(s, ds, dds), root_time(s, -ds, dds)
    dt, (r, dr, ddr) = after if after < before else -before, flight.ball[-1]
    if not abs(dt) <= 0.05:  # the motion at the end tells the catch no farther off [s]
        return nothing
    ball = np.array([r + dt * dr + 0.5 * dt * dt * ddr, dr + dt * ddr, ddr])
    inside, rows = f.virtual(ball)
    if not inside:
        return nothing
    J = f.arm.jacobian(rows[0])
    rate = f.basis.jets(*coordinates(f.tangent, rows))[1]
    slope = -np.einsum("cj,a->caj", J, rate).reshape(3, size)
    return ball[1] - J @ rows[1], slope


class _Starts(NamedTuple):
    """How each flight's coefficients follow from alpha*, in one metric; see the module."""

    C: Array  # (F, 2n, m n)
    W: Array  # (F, m n, 2n)
    gap: Array  # (F, 2n)

    def projected(self, alpha: Array) -> Array:
        """Return alpha_f of each flight [rad], shape (F, m, n)."""
        flat = alpha.ravel()
        step = np.einsum("fak,fk->fa", self.W, self.gap - self.C @ flat)
        return np.asarray((flat + step).reshape(-1, *alpha.shape))


def _starts_of(f: DirectMap, lifted: Sequence[Lifted]) -> _Starts:
    """Return how flights start in the metric of a map."""
    C = initial_matrix(np.array([x.phi_0 for x in lifted]), f.arm.n)
    return _Starts(C, answer_to_gap(C, f.H_inverse), np.array([x.gap for x in lifted]))


class Cost(NamedTuple):
    """Least-squares form of eq. (22) for one motion: residual and its derivative."""

    torque: Array  # (K, n) tau / tau_max
    speed: Array  # (K, n) omega / omega_max
    J: Array  # (2 K n, m n)


class LimitRows(NamedTuple):
    """Linearised limits: rows @ step <= room, and the largest share of any limit."""

    rows: Array
    room: Array
    worst: float


class Sensitivity(NamedTuple):
    """A motion, its torques and how they answer to alpha."""

    motion: Array  # (K, 3, n)
    tau: Array  # (K, N)
    J_tau: Array  # (K, N, m n) d tau / d alpha
    J_dq: Array  # (K, n, m n)
    J_q: Array  # (K, n, m n)
    J_ddq: Array  # (K, n, m n)


def sensitivity(arm: Arm, motion: Array, phi: Array) -> Sensitivity:
    """Return d tau/d alpha = tau_q Phi + tau_qdot Phi-dot + M Phi-ddot and its companions."""
    tau, slope = arm.torques_and_slopes(motion)
    count, n = len(motion), arm.n
    J_tau = np.einsum("tdrk,tda->trak", slope, phi).reshape(count, tau.shape[1], -1)
    eye = np.eye(n)
    J_q = np.einsum("ta,jk->tjak", phi[:, 0], eye).reshape(count, n, -1)
    J_dq = np.einsum("ta,jk->tjak", phi[:, 1], eye).reshape(count, n, -1)
    J_ddq = np.einsum("ta,jk->tjak", phi[:, 2], eye).reshape(count, n, -1)
    return Sensitivity(motion, tau, J_tau, J_dq, J_q, J_ddq)


def cost(arm: Arm, s: Sensitivity) -> Cost:
    """Return the residual of eq. (22), K_tau = 1/tau_max^2 and K_omega = 1/omega_max^2."""
    torque, speed = arm.active(s.tau) / arm.tau_max, s.motion[:, 1] / arm.dq_max
    active = s.J_tau[:, arm.model.active] / arm.tau_max[:, None]
    size = s.J_tau.shape[-1]
    J = np.concatenate([active.reshape(-1, size), (s.J_dq / arm.dq_max[:, None]).reshape(-1, size)])
    return Cost(torque, speed, J)


def limit_rows(arm: Arm, s: Sensitivity, *, share: float, near: float) -> LimitRows:
    """Return the limits (18), (20), ranges and accelerations as rows, those above ``near`` of one.

    Their values are the shares of :func:`mitt.core.map.demand.reckon` with their signs.

    Args:
        arm: The arm.
        s: Motion and sensitivities.
        share: Share of each limit that may be used.
        near: Share from which a limit gets a row.
    """
    limits, count = arm.limits, len(s.motion)
    dq = np.zeros((count, len(arm.model.links)))
    dq[:, arm.model.active] = s.motion[:, 1]
    drive_tau, drive_dq = limits.drive_torque(s.tau), limits.drive_speed(dq)
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    torque, speed = drive_tau / limits.tau_peak, drive_dq / limits.dq_max
    J_torque = limits.to_drive @ s.J_tau
    J_speed = limits.transmission[:, arm.model.active] / limits.dq_max[:, None] @ s.J_dq
    values = [torque, speed, (s.motion[:, 0] - middle) / half]
    slopes = [J_torque / limits.tau_peak[:, None], J_speed, s.J_q / half[:, None]]
    if limits.no_load:
        driving = drive_tau * drive_dq > 0.0
        values.append(np.where(driving, drive_tau / limits.tau_stall + speed, 0.0))
        slopes.append(J_torque / limits.tau_stall[:, None] + J_speed)
    if limits.acceleration is not None:
        most = arm.active(limits.acceleration)
        values.append(s.motion[:, 2] / most)
        slopes.append(s.J_ddq / most[:, None])
    rows, room = [], []
    for value, slope in zip(values, slopes, strict=True):
        at = np.abs(value) > near
        sign = np.sign(value[at])
        rows.append(sign[:, None] * slope[at])
        room.append(share - np.abs(value[at]))
    worst = max(float(np.abs(value).max()) for value in values)
    return LimitRows(np.concatenate(rows), np.concatenate(room), worst)


def solve_step(
    H: Array, gradient: Array, limits: tuple[Array, Array], *, weight: float
) -> Array | None:
    """Return the step that minimises the quadratic plus weighted squares of the excess.

    x'Hx/2 + g'x + weight sum max(rows x - room, 0)^2 is convex and piecewise quadratic: Newton's
    method on the rows in excess, with halved steps where the set of rows changes too much. A
    soft form, because some limits cannot be kept: the catch itself fixes the last instants.

    Returns:
        The step, shape (m n,); None where the problem or the answer is not finite.
    """
    rows, room = limits
    if not all(np.all(np.isfinite(x)) for x in (H, gradient, rows, room)):
        return None

    def value(x: Array) -> float:
        over = np.maximum(rows @ x - room, 0.0)
        return float(0.5 * x @ H @ x + gradient @ x + weight * (over @ over))

    x = np.zeros(len(gradient))
    for _ in range(_NEWTON_STEPS):
        over = rows @ x - room
        active = rows[over > 0.0]
        slope = H @ x + gradient + 2.0 * weight * active.T @ over[over > 0.0]
        newton = -np.linalg.solve(H + 2.0 * weight * active.T @ active, slope)
        if np.linalg.norm(newton) <= _SMALL * (1.0 + np.linalg.norm(x)):
            break
        share, here = 1.0, value(x)
        while value(x + share * newton) > here and share > _SMALL:
            share *= 0.5
        x = x + share * newton
    return x if np.all(np.isfinite(x)) else None


def learn_from(
    arm: Arm,
    design: MapDesign,
    flights: Sequence[Flight],
    *,
    settings: LearnSettings | None = None,
) -> Learned:
    """Learn alpha* and H for an arm over flights; see the module."""
    start, lifted = _scaled(unlearned(arm, design), flights)
    left_out = len(flights) - len(lifted)
    return learn_lifted(start, lifted, left_out=left_out, settings=settings or LearnSettings())


def learn_lifted(
    start: DirectMap, lifted: Sequence[Lifted], *, left_out: int, settings: LearnSettings
) -> Learned:
    """Learn alpha* and H over flights in virtual joints.

    Args:
        start: The map with alpha = 0.
        lifted: The flights; what their ``phi_0`` and ``gap`` hold alpha to may be more than the
            start: a row of monomials for each n rows of C.
        left_out: Flights that left the domain.
        settings: How to learn.
    """
    history, maps = [_unoptimised(start, lifted)], [start]
    f, status, last = _with_metric(start, _kinetic(start.arm, lifted)), "steps", np.inf
    starts = _starts_of(f, lifted)
    for _ in range(settings.steps):
        parts = _linearised(f, lifted, settings, starts)
        history.append(_mean([part.step for part in parts]))
        maps.append(f)
        now = float(np.mean([part.cost for part in parts]))
        if abs(last - now) <= settings.tolerance * now:
            status = "converged"
            break
        last = now
        further = _advanced(f, parts, lifted, settings, starts)
        if further is None:
            status = "solver"
            break
        f, starts = further
    else:
        history.append(_mean([part.step for part in _linearised(f, lifted, settings, starts)]))
        maps.append(f)
    return Learned(
        map=f,
        maps=tuple(maps),
        steps=tuple(history),
        flights=len(lifted),
        left_out=left_out,
        status=_status_of(status, history[-1].worst, len(lifted) / (len(lifted) + left_out)),
    )


def _status_of(status: str, worst: float, usable: float) -> str:
    """Return the status of a map: a cost that has settled is not enough.

    Args:
        status: How the steps ended.
        worst: Largest share of a limit over all flights.
        usable: Share of the flights that the map was learned from; half of them are the least of
            a map that is called converged, a choice of this project.
    """
    if status == "solver":
        return status
    if usable < 0.5:
        return "domain"
    return status if worst <= 1.0 else "limits"


class _Part(NamedTuple):
    """One flight's share of a step, in alpha*."""

    hessian: Array  # (m n, m n) of alpha_f
    reduced: Array  # (m n, m n) P' hessian P
    gradient: Array  # (m n,) P' gradient
    limits: LimitRows
    step: Step
    cost: float  # of eq. (22), and of the relative velocity at the catch


def _scaled(start: DirectMap, flights: Sequence[Flight]) -> tuple[DirectMap, list[Lifted]]:
    """Scale the basis to the virtual joints that occur, and lift all flights into it.

    Flights end a little past the catch; their last virtual joints mark the region of the map.
    """
    inside = _inside(start, flights)
    q_o = np.concatenate([coordinates(start.tangent, x.virtual[:, 0]) for x in inside])
    basis = start.basis
    centre = 0.5 * (q_o.min(axis=0) + q_o.max(axis=0))
    centre[basis.catch_joint] = start.design.q_catch
    scale = np.maximum(np.abs(q_o - centre).max(axis=0), 1e-3)
    ends = np.array([x.virtual[-1, 0] for x in inside])
    scaled = replace(
        start,
        basis=basis_of(start.design, centre, scale),
        region=np.array([ends.min(axis=0), ends.max(axis=0)]),
    )
    return scaled, _inside(scaled, flights)


def _inside(f: DirectMap, flights: Sequence[Flight]) -> list[Lifted]:
    """Return the flights that stay in the domain of a map; InputError where none does."""
    lifted = [x for x in (lift_flight(f, flight) for flight in flights) if x is not None]
    if not lifted:
        raise InputError(
            "flights to learn from",
            "at least one inside the map's domain",
            f"none of {len(flights)}",
            do="give another design: mitt design looks for one",
        )
    return lifted


def _kinetic(arm: Arm, lifted: Sequence[Lifted]) -> Array:
    """Return a first metric: the cost with the inertia of the ready pose and nothing else."""
    M = arm.mass_matrix(arm.q_ready) / arm.tau_max[:, None]
    torque, speed = M.T @ M, np.diag(arm.dq_max**-2.0)
    H = np.zeros((len(lifted[0].phi_0[0]) * arm.n,) * 2)
    for x in lifted:
        H += np.kron(x.phi[:, 2].T @ x.phi[:, 2], torque)
        H += np.kron(x.phi[:, 1].T @ x.phi[:, 1], speed)
    H /= len(lifted)
    return H


def _with_metric(f: DirectMap, H: Array) -> DirectMap:
    """Return the map with metric H, made safely positive definite."""
    size = len(H)
    return replace(f, H=0.5 * (H + H.T) + _RIDGE * np.trace(H) / size * np.eye(size))


def _linearised(
    f: DirectMap, lifted: Sequence[Lifted], settings: LearnSettings, starts: _Starts
) -> list[_Part]:
    """Return each flight's share of a step."""
    kept = np.eye(f.alpha.size) - starts.W @ starts.C
    alphas = starts.projected(f.alpha)
    return [_linearise(f, *of, settings) for of in zip(lifted, alphas, kept, strict=True)]


def _linearise(
    f: DirectMap, x: Lifted, alpha: Array, keep: Array, settings: LearnSettings
) -> _Part:
    """Return gradient, Gauss-Newton Hessian and limit rows of one flight in alpha*."""
    s = sensitivity(f.arm, x.motion(alpha), x.phi)
    torque, speed, J = cost(f.arm, s)
    residual, count = np.concatenate([torque.ravel(), speed.ravel()]), len(torque)
    limits = limit_rows(f.arm, s, share=settings.share, near=settings.near)
    weight, relative = f.design.match_weight, x.relative_velocity(alpha)
    J_star, slope = J @ keep, x.slope @ keep
    return _Part(
        hessian=J.T @ J / count + weight * x.slope.T @ x.slope,
        reduced=J_star.T @ J_star / count + weight * slope.T @ slope,
        gradient=J_star.T @ residual / count + weight * slope.T @ relative,
        limits=limits._replace(rows=limits.rows @ keep),
        step=(step := _step_of(torque, speed, limits.worst)),
        cost=step.cost_torque + step.cost_speed + weight * float(relative @ relative),
    )


def _step_of(torque: Array, speed: Array, worst: float) -> Step:
    """Return the two mean costs of one motion, eq. (22), and its largest share of a limit."""
    count = len(torque)
    return Step(
        cost_torque=float(np.sum(torque**2)) / count,
        cost_speed=float(np.sum(speed**2)) / count,
        worst=worst,
    )


def _mean(steps: Sequence[Step]) -> Step:
    """Return the mean costs and the largest share over the flights."""
    return Step(
        cost_torque=float(np.mean([s.cost_torque for s in steps])),
        cost_speed=float(np.mean([s.cost_speed for s in steps])),
        worst=max(s.worst for s in steps),
    )


def _unoptimised(f: DirectMap, lifted: Sequence[Lifted]) -> Step:
    """Return the cost of alpha = 0, which does not start where the arm is."""
    steps = []
    for x in lifted:
        asked = demand(f.arm, x.motion(np.zeros_like(f.alpha)))
        costs = float(asked.cost_torque.mean()), float(asked.cost_speed.mean())
        steps.append(
            Step(cost_torque=costs[0], cost_speed=costs[1], worst=float(asked.shares.max()))
        )
    return _mean(steps)


def _advanced(
    f: DirectMap,
    parts: Sequence[_Part],
    lifted: Sequence[Lifted],
    settings: LearnSettings,
    starts: _Starts,
) -> tuple[DirectMap, _Starts] | None:
    """Return the map one Gauss-Newton step further, and with the metric found there if it helps."""
    best = _stepped(f, parts, lifted, settings, starts)
    if best is None:
        return None
    metric = _with_metric(best, np.mean([p.hessian for p in parts], axis=0))
    both = (best, starts), (metric, _starts_of(metric, lifted))
    return min(both, key=lambda x: _merit(x[0], lifted, settings, x[1]))


def _stepped(
    f: DirectMap,
    parts: Sequence[_Part],
    lifted: Sequence[Lifted],
    settings: LearnSettings,
    starts: _Starts,
) -> DirectMap | None:
    """Return the map after the largest share of a Gauss-Newton step that helps; None if unsound."""
    size, instants = len(parts[0].reduced), sum(len(x.virtual) for x in lifted)
    H = np.mean([p.reduced for p in parts], axis=0)
    H = H + _RIDGE * np.trace(H) * np.eye(size)
    gradient = np.mean([p.gradient for p in parts], axis=0)
    rows = np.concatenate([p.limits.rows for p in parts])
    room = np.concatenate([p.limits.room for p in parts])
    step = solve_step(H, gradient, (rows, room), weight=_PENALTY / instants)
    if step is None:
        return None
    before = _merit(f, lifted, settings, starts)
    for k in range(_HALVINGS):
        tried = f.with_alpha(f.alpha + 0.5**k * step.reshape(f.alpha.shape))
        if _merit(tried, lifted, settings, starts) < before:
            return tried
    return f


def refined(f: DirectMap, lifted: Sequence[Lifted], settings: LearnSettings) -> DirectMap:
    """Return the map after some Gauss-Newton steps over flights, in the metric that it has."""
    starts = _starts_of(f, lifted)
    for _ in range(settings.steps):
        parts = _linearised(f, lifted, settings, starts)
        further = _stepped(f, parts, lifted, settings, starts)
        if further is None or further is f:
            break
        f = further
    return f


def _merit(
    f: DirectMap, lifted: Sequence[Lifted], settings: LearnSettings, starts: _Starts
) -> float:
    """Return the mean cost and a penalty on what exceeds the limits, each flight projected."""
    alphas = starts.projected(f.alpha)
    motions = [x.motion(alpha) for x, alpha in zip(lifted, alphas, strict=True)]
    asked = demand(f.arm, np.concatenate(motions))
    beyond = [np.maximum(x - settings.share, 0.0) for x in asked.of_limits]
    each = asked.cost_torque + asked.cost_speed
    each += _PENALTY * sum(np.sum(x**2, axis=1) for x in (*beyond, asked.excess))
    first = np.cumsum([0, *(len(x) for x in motions[:-1])])
    total = float(np.sum(np.add.reduceat(each, first) / [len(x) for x in motions]))
    for x, alpha in zip(lifted, alphas, strict=True):
        total += f.design.match_weight * float(np.sum(x.relative_velocity(alpha) ** 2))
    return total / len(lifted)
