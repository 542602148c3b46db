"""Learning the coefficients over a neighbourhood of flights, eq. (22).

One alpha cannot start every flight where the arm is (eq. (12) holds C and d of one flight), so
each flight f has its own alpha_f, the projection of the common alpha* onto C_f alpha = d_f in
the norm of H. The cost is that of the alpha_f; its Gauss-Newton step in alpha* is a small
quadratic programme with the torque, speed, range and acceleration rows (18), (20) of all flights.
A map with ``match_weight`` adds that weight times the squared relative velocity at the catch, which
is linear in alpha.

| here            | meaning                                        | shape        |
|-----------------|------------------------------------------------|--------------|
| ``P``           | I - W C, the part of alpha* that a flight keeps | (m n, m n)  |
| ``W``           | answer of alpha to a gap in d                  | (m n, 2n)    |
| ``rows, room``  | linearised limits: rows @ step <= room         | (R, m n), (R,)|
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mitt import fields
from mitt.errors import InputError
from mitt.fields import brief
from mitt.generator.constraints import initial_matrix, project, shift
from mitt.generator.coordinates import basis_of, coordinates
from mitt.generator.demand import demand
from mitt.generator.design import MapDesign
from mitt.generator.flights import Flight, Lifted, lift_flight
from mitt.generator.mapping import DirectMap, unlearned
from mitt.generator.program import Rows, cost, limit_rows, sensitivity, solve
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Share of the trace of a Hessian that is added to its diagonal.
_RIDGE = 1e-9
#: Halvings of a step that does not help, and weight of the mean squared excess over the instants.
_HALVINGS, _PENALTY = 6, 300.0
#: Least share of usable flights of a map that is called converged; a choice of this project.
_FEWEST = 0.5
#: Least and largest number of each setting; choices of this project.
_RANGES = {"steps": (0, 10**4), "tolerance": (0.0, 1.0), "share": (0.01, 100.0),
           "near": (0.0, 100.0)}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnSettings:
    """How to learn.

    Attributes:
        steps: Most Gauss-Newton steps.
        tolerance: Relative change of the cost at which to stop.
        share: Share of each limit that the learned motions may use.
        near: Share of a limit from which a row enters the programme.
    """

    steps: int = 20
    tolerance: float = 1e-3
    share: float = 0.92
    near: float = 0.6

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        fields.check(self, _RANGES)


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


def learn(
    arm: Arm,
    design: MapDesign,
    flights: Sequence[Flight],
    *,
    settings: LearnSettings | None = None,
) -> Learned:
    """Learn alpha* and H for an arm over flights; see the module."""
    settings = settings or LearnSettings()
    start, lifted = _scaled(unlearned(arm, design), flights)
    history, maps = [_unoptimised(start, lifted)], [start]
    f, status, last = _with_metric(start, _kinetic(arm, lifted)), "steps", np.inf
    for _ in range(settings.steps):
        parts = [_linearise(f, flight, settings) for flight in lifted]
        history.append(_mean([part.step for part in parts]))
        maps.append(f)
        now = float(np.mean([part.cost for part in parts]))
        if abs(last - now) <= settings.tolerance * now:
            status = "converged"
            break
        last = now
        further = _advanced(f, parts, lifted, settings)
        if further is None:
            status = "solver"
            break
        f = further
    else:
        history.append(_mean([_linearise(f, x, settings).step for x in lifted]))
        maps.append(f)
    return Learned(
        map=f,
        maps=tuple(maps),
        steps=tuple(history),
        flights=len(lifted),
        left_out=len(flights) - len(lifted),
        status=_status_of(status, history[-1].worst, len(lifted) / len(flights)),
    )


def _status_of(status: str, worst: float, usable: float) -> str:
    """Return the status of a map: a cost that has settled is not enough.

    Args:
        status: How the steps ended.
        worst: Largest share of a limit over all flights.
        usable: Share of the flights that the map was learned from.
    """
    if status == "solver":
        return status
    if usable < _FEWEST:
        return "domain"
    return status if worst <= 1.0 else "limits"


class _Part(NamedTuple):
    """One flight's share of a step, in alpha*."""

    hessian: Array  # (m n, m n) of alpha_f
    reduced: Array  # (m n, m n) P' hessian P
    gradient: Array  # (m n,) P' gradient
    limits: Rows
    step: Step
    cost: float  # of eq. (22), and of the relative velocity at the catch


def _scaled(start: DirectMap, flights: Sequence[Flight]) -> tuple[DirectMap, list[Lifted]]:
    """Scale the basis to the virtual joints that occur, and lift all flights into it.

    Flights end a little past the catch; their last virtual joints mark the region of the map.
    """
    inside = [x for x in (lift_flight(start, flight) for flight in flights) if x is not None]
    if not inside:
        raise InputError("flights", "at least one inside the map's domain", f"{len(flights)}, none")
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
    lifted = [x for x in (lift_flight(scaled, flight) for flight in flights) if x is not None]
    if not lifted:
        raise InputError("flights", "at least one inside the map's domain", f"{len(flights)}, none")
    return scaled, lifted


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


def _linearise(f: DirectMap, x: Lifted, settings: LearnSettings) -> _Part:
    """Return gradient, Gauss-Newton Hessian and limit rows of one flight in alpha*."""
    C = initial_matrix(x.phi_0, f.arm.n)
    W = shift(C, f.H_inverse)
    keep = np.eye(C.shape[1]) - W @ C
    alpha = (keep @ f.alpha.ravel() + W @ x.gap).reshape(f.alpha.shape)
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
        shares = float(max(x.max() for x in (asked.torque, asked.speed, asked.acceleration)))
        steps.append(
            Step(
                cost_torque=float(asked.cost_torque.mean()),
                cost_speed=float(asked.cost_speed.mean()),
                worst=shares,
            )
        )
    return _mean(steps)


def _advanced(
    f: DirectMap, parts: Sequence[_Part], lifted: Sequence[Lifted], settings: LearnSettings
) -> DirectMap | None:
    """Return the map one Gauss-Newton step further, and with the metric found there if it helps."""
    size, instants = len(parts[0].reduced), sum(len(x.virtual) for x in lifted)
    H = np.mean([p.reduced for p in parts], axis=0)
    H = H + _RIDGE * np.trace(H) * np.eye(size)
    gradient = np.mean([p.gradient for p in parts], axis=0)
    rows = np.concatenate([p.limits.rows for p in parts])
    room = np.concatenate([p.limits.room for p in parts])
    step = solve(H, gradient, (rows, room), weight=_PENALTY / instants)
    if step is None:
        return None
    before, best = _merit(f, lifted, settings), f
    for k in range(_HALVINGS):
        tried = replace(f, alpha=f.alpha + 0.5**k * step.reshape(f.alpha.shape))
        if _merit(tried, lifted, settings) < before:
            best = tried
            break
    metric = _with_metric(best, np.mean([p.hessian for p in parts], axis=0))
    return min((best, metric), key=lambda x: _merit(x, lifted, settings))


def _merit(f: DirectMap, lifted: Sequence[Lifted], settings: LearnSettings) -> float:
    """Return the mean cost and a penalty on what exceeds the limits, each flight projected."""
    total = 0.0
    for x in lifted:
        alpha = project(f.alpha, f.H_inverse, x.phi_0, x.gap)
        asked = demand(f.arm, x.motion(alpha))
        shares = asked.torque, asked.speed, asked.acceleration
        over = np.concatenate([share.ravel() for share in shares]) - settings.share
        excess = float(np.sum(np.maximum(over, 0.0) ** 2) + np.sum(asked.excess**2))
        total += asked.cost + _PENALTY * excess / len(x.virtual)
        total += f.design.match_weight * float(np.sum(x.relative_velocity(alpha) ** 2))
    return total / len(lifted)
