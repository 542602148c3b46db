"""The same problem solved by IPOPT in three set-ups; the best of them is the rival.

``exact``: one expression over all instants (CasADi's map), its exact Hessian. ``supplied``: first
derivatives of each instant and the Gauss-Newton Hessian handed over. ``lbfgs``: IPOPT's own
limited-memory Hessian.
"""

from types import ModuleType

import numpy as np

from mitt.bench.problem import Answer, LearningProblem, judged
from mitt.rivals.clairvoyant import Expression, casadi, symbolic

SETUPS = ("exact", "supplied", "lbfgs")

#: Most processor time of one set-up [s], and tolerance of IPOPT.
_LONGEST, _TOLERANCE = 60.0, 1e-6


def solver(problem: LearningProblem, setup: str) -> Expression:
    """Build the solver of a set-up; see the module."""
    ca = casadi()
    x = ca.MX.sym("alpha", problem.size)
    cost, torque = _expressions(ca, problem, x)
    options: dict[str, object] = {
        "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False,
        "ipopt.tol": _TOLERANCE, "ipopt.max_cpu_time": _LONGEST, "ipopt.max_iter": 300,
    }  # fmt: skip
    if setup == "lbfgs":
        options["ipopt.hessian_approximation"] = "limited-memory"
    if setup == "supplied":
        options |= _supplied(ca, problem)
    return ca.nlpsol("problem", "ipopt", {"x": x, "f": cost, "g": torque}, options)


def run(problem: LearningProblem, solver: Expression) -> Answer:
    """Solve from alpha* = 0."""
    count = len(problem.base) * problem.arm.n
    bound = np.full(count, problem.bound)
    found = solver(x0=np.zeros(problem.size), lbg=-bound, ubg=bound)
    good = bool(solver.stats()["success"])
    return judged(problem, np.asarray(found["x"], np.float64).ravel(), good=good)


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
        "grad_f": ca.Function("nlp_grad_f", [alpha, p], [ca.sum2(f) / count, ca.sum2(g) / count],
                              ["x", "p"], ["f", "grad_f_x"]),
        "jac_g": ca.Function("nlp_jac_g", [alpha, p], [ca.vec(torque), stacked],
                             ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function("nlp_hess_l", [alpha, p, lam_f, lam_g], [ca.triu(lam_f * H)],
                                ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]),
    }  # fmt: skip
