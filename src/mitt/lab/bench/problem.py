"""Learning as one problem that two solvers can be given: Gauss-Newton with DAQP, and IPOPT.

min over alpha* of the mean of (22) over all instants of all flights, each flight with its own
alpha_f = keep_f alpha* + W_f d_f, the projection of alpha* onto its start, eq. (12), in a fixed
metric; subject to eq. (18), |tau| <= bound at every instant, hard. The bound is a share of the
torque that the optimum without it asks for, so that rows bind.

| here     | meaning                                          | shape         |
|----------|--------------------------------------------------|---------------|
| ``base`` | q, dq, ddq at alpha* = 0, instant by instant     | (S, 3 n)      |
| ``slope``| their slope in alpha*                            | (S, 3 n, m n) |
| ``bound``| share of tau_max that may be asked               |               |
"""

from dataclasses import dataclass, replace
from types import ModuleType

import daqp
import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.dynamics import slopes_work, torque_slopes
from mitt.core.kernels import Record, kernel
from mitt.core.map.demand import ArmNumbers, arm_numbers
from mitt.core.map.learn import LearnSettings, learn_from, lift_flight
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import answer_to_gap, initial_matrix, unlearned
from mitt.core.map.neighbourhood import Neighbourhood, neighbourhood
from mitt.core.signals import Array
from mitt.lab.rivals.clairvoyant import Expression, casadi, symbolic

#: Share of the bound from which an instant gets a row; relative gain, and excess, at which a solver
#: has converged.
_NEAR = 0.7
_SMALL = 1e-7
_EXCESS = 1e-6

SETUPS = ("exact", "supplied", "lbfgs")
"""How IPOPT is given the problem; the best of them is the rival. One expression over all instants
(CasADi's map) with its exact Hessian; first derivatives of each instant and the Gauss-Newton
Hessian handed over; IPOPT's own limited-memory Hessian."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LearningProblem:
    """The problem; see the module's table."""

    arm: Arm
    base: Array
    slope: Array
    bound: float

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return int(self.slope.shape[2])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What a solver found.

    Attributes:
        alpha: Coefficients [rad], shape (m n,).
        cost: Mean of (22).
        worst: Largest share of the bound.
        good: Whether the solver says that it has converged.
    """

    alpha: Array
    cost: float
    worst: float
    good: bool


def learning_problem(arm: Arm, *, flights: int, seed: int) -> LearningProblem:
    """Build the problem from a neighbourhood of default throws, 30 instants each."""
    design = default_design(arm)
    around = Neighbourhood(flights=flights, instants=30)
    drawn = neighbourhood(unlearned(arm, design), np.random.default_rng(seed), around)
    start = learn_from(arm, design, drawn, settings=LearnSettings(steps=1)).map
    lifted = [x for x in (lift_flight(start, flight) for flight in drawn) if x is not None]
    base, slope, n = [], [], arm.n
    for x in lifted:
        C = initial_matrix(x.phi_0, n)
        W = answer_to_gap(C, start.H_inverse)
        per = np.array([[np.kron(row, np.eye(n)) for row in phi] for phi in x.phi])
        per = per.reshape(len(x.phi), 3 * n, -1)
        slope.append(per @ (np.eye(C.shape[1]) - W @ C))
        base.append(x.virtual.reshape(len(x.phi), -1) + per @ (W @ x.gap))
    free = LearningProblem(
        arm=arm, base=np.concatenate(base), slope=np.concatenate(slope), bound=np.inf
    )
    return replace(free, bound=0.95 * solve_problem(free).worst)


def solve_problem(problem: LearningProblem) -> Answer:
    """Solve by Gauss-Newton steps, each a quadratic programme of DAQP with the rows near a bound.

    A step is halved while neither cost nor excess gets better.
    """
    p, alpha, bounded = arm_numbers(problem.arm), np.zeros(problem.size), np.isfinite(problem.bound)
    r, J = shares_and_slopes(problem, p, alpha)
    best, good = _merit(problem, r), False
    for _ in range(40):
        step = _step(problem, r, J, bounded=bounded)
        if step is None:
            break
        share, found = 1.0, np.inf
        while share > 1e-3:
            r, J = shares_and_slopes(problem, p, alpha + share * step)
            found = _merit(problem, r)
            if found < best:
                break
            share *= 0.5
        if not found < best:
            good = True
            break
        alpha, gain, best = alpha + share * step, best - found, found
        if gain < _SMALL * best:
            good = True
            break
    return judged_anew(problem, alpha, good=good)


def judged_anew(problem: LearningProblem, alpha: Array, *, good: bool) -> Answer:
    """Return an answer with cost and largest share of the bound reckoned anew."""
    n = problem.arm.n
    r, _ = shares_and_slopes(problem, arm_numbers(problem.arm), alpha)
    torque = float(np.abs(r[:, :n]).max())
    worst = torque / problem.bound if np.isfinite(problem.bound) else torque
    return Answer(
        alpha=alpha,
        cost=float(np.sum(r * r)) / len(r),
        worst=worst,
        good=good and (worst <= 1.0 + _EXCESS or not np.isfinite(problem.bound)),
    )


def shares_and_slopes(problem: LearningProblem, p: ArmNumbers, alpha: Array) -> tuple[Array, Array]:
    """Return torques and speeds over their bounds, (S, 2 n), and their slopes, (S, 2 n, m n)."""
    n, links = problem.arm.n, len(problem.arm.model.links)
    z = problem.base + problem.slope @ alpha
    r, R = np.empty((len(z), 2 * n)), np.zeros((len(z), 2 * n, 3 * n))
    work = np.zeros(links), np.zeros((3, links, n)), slopes_work(links)
    _respond(p, z.reshape(len(z), 3, n), work, r, R)
    return r, R @ problem.slope


@kernel
def _respond(
    p: ArmNumbers, z: Array, work: tuple[Array, Array, Record], r: Array, R: Array
) -> None:
    """Write torques and speeds over their bounds, and their slopes in q, dq, ddq."""
    tau, slope, links = work
    n = z.shape[2]
    for s in range(len(z)):
        torque_slopes(p.bodies, z[s], tau, slope, links)
        for j in range(n):
            r[s, j] = tau[p.joints[j]] / p.tau_max[j]
            r[s, n + j] = z[s, 1, j] / p.dq_max[j]
            R[s, n + j, n + j] = 1.0 / p.dq_max[j]
            for d in range(3):
                for i in range(n):
                    R[s, j, d * n + i] = slope[d, p.joints[j], i] / p.tau_max[j]


def _merit(problem: LearningProblem, r: Array) -> float:
    """Return the mean cost and a price of exceeding the bound, dear enough to be exact."""
    over = np.maximum(np.abs(r[:, : problem.arm.n]) - problem.bound, 0.0)
    return float(np.sum(r * r)) / len(r) + 10.0 * float(np.max(over))


def _step(problem: LearningProblem, r: Array, J: Array, *, bounded: bool) -> Array | None:
    """Return one Gauss-Newton step within the linearised bound; None where DAQP finds none."""
    size, n = problem.size, problem.arm.n
    flat = J.reshape(-1, size)
    H = 2.0 * flat.T @ flat / len(r)
    H += 1e-10 * np.trace(H) / size * np.eye(size)
    g = 2.0 * flat.T @ r.ravel() / len(r)
    torque = r[:, :n]
    near = np.abs(torque) > _NEAR * problem.bound
    if not bounded or not near.any():
        return np.asarray(-np.linalg.solve(H, g), np.float64)
    sign = np.sign(torque[near])
    rows = np.ascontiguousarray(sign[:, None] * J[:, :n][near])
    room = problem.bound - np.abs(torque[near])
    low, kind = np.full(len(room), -1e30), np.zeros(len(room), dtype=np.int32)
    x, _, flag, _ = daqp.solve(H, g, rows, room, low, kind)
    x = np.asarray(x, np.float64)
    return x if flag > 0 and np.all(np.isfinite(x)) else None


def ipopt_solver(problem: LearningProblem, setup: str) -> Expression:
    """Build the solver of a set-up; see :data:`SETUPS`."""
    ca = casadi()
    x = ca.MX.sym("alpha", problem.size)
    cost, torque = _expressions(ca, problem, x)
    options: dict[str, object] = {
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "print_time": False,
        "ipopt.tol": 1e-6,
        "ipopt.max_cpu_time": 60.0,
        "ipopt.max_iter": 300,
    }
    if setup == "lbfgs":
        options["ipopt.hessian_approximation"] = "limited-memory"
    if setup == "supplied":
        options |= _supplied(ca, problem)
    return ca.nlpsol("problem", "ipopt", {"x": x, "f": cost, "g": torque}, options)


def ipopt_run(problem: LearningProblem, solver: Expression) -> Answer:
    """Solve from alpha* = 0."""
    count = len(problem.base) * problem.arm.n
    bound = np.full(count, problem.bound)
    found = solver(x0=np.zeros(problem.size), lbg=-bound, ubg=bound)
    good = bool(solver.stats()["success"])
    return judged_anew(problem, np.asarray(found["x"], np.float64).ravel(), good=good)


def _instant(ca: ModuleType, problem: LearningProblem) -> tuple[Expression, Expression]:
    """Return q, dq, ddq of an instant, and torques and speeds over their bounds, as SX."""
    arm, n = problem.arm, problem.arm.n
    z = ca.SX.sym("z", 3 * n)
    tau = symbolic(arm).torque(z[:n], z[n : 2 * n], z[2 * n :])
    active = tau[list(arm.model.active)] / ca.DM(arm.tau_max)
    return z, ca.vertcat(active, z[n : 2 * n] / ca.DM(arm.dq_max))


def _expressions(
    ca: ModuleType, problem: LearningProblem, x: Expression
) -> tuple[Expression, Expression]:
    """Return cost and torques over all instants."""
    count, width = problem.base.shape
    z, r = _instant(ca, problem)
    respond = ca.Function("respond", [z], [r]).map(count)
    flat = ca.DM(problem.slope.reshape(count * width, -1))
    motion = ca.mtimes(flat, x) + ca.DM(problem.base.ravel())
    answer = respond(ca.reshape(motion, width, count))
    return ca.sumsqr(answer) / count, ca.vec(answer[: problem.arm.n, :])


def _supplied(ca: ModuleType, problem: LearningProblem) -> dict[str, object]:
    """Return gradient, Jacobian and Gauss-Newton Hessian, from derivatives of each instant."""
    (count, width), size, n = problem.base.shape, problem.size, problem.arm.n
    z, r = _instant(ca, problem)
    x, base = ca.SX.sym("x", size), ca.SX.sym("base", width)
    slope = ca.SX.sym("slope", width, size)
    point = ca.Function("point", [z], [r, ca.jacobian(r, z)])
    value, R = point(base + ca.mtimes(slope, x))
    J = ca.mtimes(R, slope)
    every = (x, base, slope)
    gradient = ca.Function("gradient", [*every], [ca.sumsqr(value), 2.0 * ca.mtimes(J.T, value)])
    rows = ca.Function("rows", [*every], [value[:n], J[:n, :]])
    square = ca.Function("square", [*every], [ca.vec(2.0 * ca.mtimes(J.T, J))])
    data = ca.DM(problem.base.T), ca.DM(np.hstack(list(problem.slope)))
    alpha, p = ca.MX.sym("alpha", size), ca.MX.sym("p", 0, 0)
    many = (ca.repmat(alpha, 1, count), *data)
    f, g = gradient.map(count)(*many)
    torque, J_all = rows.map(count)(*many)
    stacked = ca.vertcat(*ca.horzsplit(J_all, size))
    H = ca.reshape(ca.sum2(square.map(count)(*many)), size, size) / count
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", n * count)
    return {
        "grad_f": ca.Function(
            "nlp_grad_f",
            [alpha, p],
            [ca.sum2(f) / count, ca.sum2(g) / count],
            ["x", "p"],
            ["f", "grad_f_x"],
        ),
        "jac_g": ca.Function(
            "nlp_jac_g", [alpha, p], [ca.vec(torque), stacked], ["x", "p"], ["g", "jac_g_x"]
        ),
        "hess_lag": ca.Function(
            "nlp_hess_l",
            [alpha, p, lam_f, lam_g],
            [ca.triu(lam_f * H)],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
    }
