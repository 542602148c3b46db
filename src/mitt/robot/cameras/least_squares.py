"""Nonlinear least squares: Levenberg-Marquardt with Huber's weights and a true covariance.

Each stage of a calibration is such a problem; it hands on numbers and warnings (``Stage``).

D. W. Marquardt, J. SIAM 11 (1963) 431-441; P. J. Huber, Ann. Math. Stat. 35 (1964) 73-101. The
columns of the Jacobian are scaled to length one, so that metres, radians and pixels compare.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, Self, TypeVar

import numpy as np

from mitt.core.errors import InputError
from mitt.core.signals import Array

POSE = ("turn_x", "turn_y", "turn_z", "x", "y", "z")
"""Names of the six numbers of a pose's step, w [rad] and v [m], as of ``camera.turned``."""
#: Share of the largest eigenvalue of the scaled normal equations below which nothing is known.
_BLIND = 1e-13
#: Part that a parameter has in an undetermined direction before it is named.
_PART = 0.05


class Problem(Protocol):
    """Measurements, and parameters that should explain them."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each parameter, in the order of a step."""

    def residuals(self) -> Array:
        """Return measured minus predicted, shape (n,)."""

    def jacobian(self) -> Array:
        """Return the derivative of what is predicted with respect to a step, shape (n, p)."""

    def moved(self, step: Array) -> Self:
        """Return the problem with its parameters moved by a step, shape (p,)."""


P = TypeVar("P", bound=Problem)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit(Generic[P]):
    """The parameters that explain the measurements best.

    Attributes:
        problem: The problem at its solution.
        sigma: Standard deviation of a measurement, as the residuals show it.
        rms: Root mean square of the residuals.
        covariance: Covariance of the parameters, shape (p, p); those undetermined have infinity
            on the diagonal.
        undetermined: Names of the parameters that the measurements say nothing about.
        status: "converged", or "stopped" after the greatest number of steps.
        outliers: Share of the residuals that Huber's weights hold down.
    """

    problem: P
    sigma: float
    rms: float
    covariance: Array
    undetermined: tuple[str, ...]
    status: str
    outliers: float

    def sigma_of(self, name: str) -> float:
        """Return the standard deviation of a parameter; infinite if it is undetermined."""
        k = self.problem.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))


def fit(problem: P, *, robust: bool = False) -> Fit[P]:
    """Return the least-squares solution of a problem.

    Args:
        problem: The problem at its first guess.
        robust: Whether residuals beyond 2 standard deviations count less.

    Raises:
        InputError: There are fewer measurements than parameters, or the guess is no guess.
    """
    r = problem.residuals()
    if len(r) < len(problem.names):
        raise InputError("calibration", f"{len(problem.names)} measurements or more", len(r))
    if not np.all(np.isfinite(r)):
        raise InputError("calibration", "finite measurements", "NaN or infinity")
    cost, w = _cost(r, robust=robust)
    damping, status = 1e-4, "stopped"
    for _ in range(100):
        A, scale = _scaled(problem, w)
        N, b = A.T @ A, A.T @ (r * np.sqrt(w))
        while damping < 1e8:
            step = np.linalg.solve(N + damping * np.eye(len(b)), b) / scale
            new = problem.moved(step)
            r_new = new.residuals()
            fine = bool(np.all(np.isfinite(r_new)))
            cost_new, w_new = _cost(r_new, robust=robust) if fine else (np.inf, w)
            if cost_new <= cost:
                break
            damping *= 10.0
        if damping >= 1e8:
            status = "converged"  # no step lowers the cost any more
            break
        gain = (cost - cost_new) / max(cost, 1e-300)
        problem, r, cost, w = new, r_new, cost_new, w_new
        damping = max(0.1 * damping, 1e-12)
        if gain < 1e-12:
            status = "converged"
            break
    return _concluded(problem, r, w, status)


def _scaled(problem: Problem, w: Array) -> tuple[Array, Array]:
    """Return the weighted Jacobian with columns scaled by their lengths, and these, shape (p,)."""
    J = problem.jacobian()
    length = np.linalg.norm(J, axis=0)
    scale = np.where(length > 0.0, length, 1.0)
    return (J / scale) * np.sqrt(w)[:, None], scale


def _cost(r: Array, *, robust: bool) -> tuple[float, Array]:
    """Return the cost, and the weight of each residual, shape (n,).

    The scale of a robust cost comes from the residuals themselves, and so does its value: the
    sum of Huber's function with that scale, which falls with either.
    """
    if not robust:
        return float(r @ r), np.ones_like(r)
    size = np.abs(r)
    knee = 2.0 * max(1.4826 * float(np.median(size)), 1e-12)
    w = np.minimum(1.0, knee / np.maximum(size, 1e-300))
    return float(np.sum(np.where(size <= knee, r * r, 2.0 * knee * size - knee * knee))), w


def _concluded(problem: P, r: Array, w: Array, status: str) -> Fit[P]:
    """Return the fit with its covariance and what it leaves undetermined."""
    A, scale = _scaled(problem, w)
    values, vectors = np.linalg.eigh(A.T @ A)
    blind = values < _BLIND * values[-1]
    freedom = max(float(w.sum()) - int(np.sum(~blind)), 1.0)
    sigma = float(np.sqrt((w * r) @ r / freedom))
    known = vectors[:, ~blind]
    covariance = sigma**2 * ((known / values[~blind]) @ known.T) / np.outer(scale, scale)
    lost = np.any(np.abs(vectors[:, blind]) > _PART, axis=1) | ~np.any(A != 0.0, axis=0)
    covariance[lost, lost] = np.inf
    return Fit(
        problem=problem,
        sigma=sigma,
        rms=float(np.sqrt(np.mean(r * r))),
        covariance=covariance,
        undetermined=tuple(name for name, no in zip(problem.names, lost, strict=True) if no),
        status=status,
        outliers=float(np.mean(w < 1.0)),
    )


def weak(fit: Fit[P], limits: Mapping[str, tuple[float, str]]) -> tuple[str, ...]:
    """Return a warning for each parameter that the measurements leave open.

    ``limits`` are, by its name, its largest standard deviation and the measurements that would
    bring it down.
    """
    said = []
    for name, (limit, advice) in limits.items():
        sigma = fit.sigma_of(name)
        if name in fit.undetermined:
            said.append(f"{name} is not determined: {advice}")
        elif not sigma <= limit:
            said.append(f"{name} is uncertain by {sigma:.2g} (wanted {limit:.2g}): {advice}")
    return tuple(said)


@dataclass(frozen=True, slots=True)
class CalibrationStage:
    """One stage of a calibration.

    Attributes:
        name: Its name: boards, heads, hand or clock.
        status: Of its fit, converged or stopped.
        numbers: What it found, by name with unit.
        warnings: What the measurements do not determine, and what would.
    """

    name: str
    status: str
    numbers: Mapping[str, float]
    warnings: tuple[str, ...]
