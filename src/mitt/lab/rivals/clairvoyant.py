"""Generator ``clairvoyant``: the optimum for an arm that knows the flight; an oracle, no rival.

THE ONLY GENERATOR THAT IS GIVEN WHAT NO CATCHER CAN KNOW. Before each throw it gets the true
flight of the ball, as it will be if nothing touches it (:meth:`Clairvoyant.with_flight`). It plans
once and follows the plan by the clock; of the estimate it uses the time alone. What it cannot catch
within the limits counts as out of reach.

The plan is the least-cost catch as a nonlinear programme, free time and place, all limits kept:
min (22) over q(t), t_c subject to eq. (14) within the drives' torques, speeds and ranges, the
start, the meeting with the ball at t_c, and room for the brake after it. Accelerations are linear
between M + 1 even instants, so the motion between them is exact. Solved by IPOPT; CasADi comes with
the extra ``mitt[rivals]``.

| here   | meaning                                                | unit    | shape    |
|--------|--------------------------------------------------------|---------|----------|
| ``a``  | accelerations at the instants                          | rad/s^2 | (n, M+1) |
| ``c``  | the ball's flight around a time: r = sum c_k (t-t_m)^k | m/s^k   | (3, 7)   |
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import ModuleType
from typing import Any, TypeAlias, final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.description import Link
from mitt.core.catcher.generators import Generator
from mitt.core.errors import MissingPackageError
from mitt.core.map.demand import demand
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import GRAVITY, TICK, Array, BallState, JointReference, MapStatus
from mitt.core.verdict.feasibility import Outcome, Verdict
from mitt.lab.rivals.intercept import (
    APPROACH,
    FOLLOW,
    SOONEST,
    STRIDE,
    Chooser,
    Intercept,
    hand_numbers,
)
from mitt.lab.rivals.paths import PathMotion, quintic
from mitt.lab.rivals.pursuit import at_rest, resting

#: What CasADi makes, expressions and functions; CasADi is untyped.
Expression: TypeAlias = Any


def casadi() -> ModuleType:
    """Import CasADi, or say in one line how to get it.

    Raises:
        InputError: It is not installed.
    """
    try:
        import casadi as found  # noqa: PLC0415 (heavy, and an extra)
    except ImportError:
        raise MissingPackageError("generator clairvoyant", "CasADi", "rivals") from None
    module: ModuleType = found
    return module


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Symbolic:
    """Functions of one arm, CasADi's.

    Attributes:
        torque: (q, dq, ddq) to the torques of all N links [N m], shape (N,).
        tip: (q, dq, ddq) to catch point, velocity, acceleration [m ...], shape (3, 3) by column.
        normal: q to the palm's normal in the world, shape (3,).
    """

    torque: Expression
    tip: Expression
    normal: Expression


def symbolic(arm: Arm) -> Symbolic:
    """Return kinematics and dynamics of an arm as CasADi expressions.

    Recursive Newton-Euler over the links of :class:`ArmModel`, in each link's own frame (Luh,
    Walker and Paul 1980); held joints stay at their angle.
    """
    ca = casadi()
    q, dq, ddq = (ca.SX.sym(name, arm.n) for name in ("q", "dq", "ddq"))
    R, p = _tip(ca, arm, q)
    J = ca.jacobian(p, q)
    velocity = ca.mtimes(J, dq)
    fastening = ca.mtimes(J, ddq) + ca.jtimes(velocity, q, dq)
    point = ca.horzcat(p, velocity, fastening)
    tool = ca.mtimes(R, ca.DM(arm.model.tool[:3, 2]))
    return Symbolic(
        torque=ca.Function("torque", [q, dq, ddq], [_torque(ca, arm, q, dq, ddq)]),
        tip=ca.Function("tip", [q, dq, ddq], [point]),
        normal=ca.Function("normal", [q], [tool]),
    )


def _placed(ca: ModuleType, link: Link, x: Expression) -> tuple[Expression, Expression]:
    """Return rotation and position of a link's moved frame in the frame of the link before."""
    R, p, axis = ca.DM(link.placement[:3, :3]), ca.DM(link.placement[:3, 3]), ca.DM(link.axis)
    if link.prismatic:
        return R, p + ca.mtimes(R, axis) * x
    K = ca.skew(axis)
    turned = ca.DM.eye(3) + ca.sin(x) * K + (1.0 - ca.cos(x)) * ca.mtimes(K, K)
    return ca.mtimes(R, turned), p


def _values(arm: Arm, x: Expression, *, held: bool) -> list[Expression]:
    """Return active joints' values spread over all links; held ones' own, or zero."""
    own, given = [], iter(x[k] for k in range(arm.n))
    for link in arm.model.links:
        rest = link.held if held else 0.0
        own.append(next(given) if link.held is None else rest)
    return own


def _tip(ca: ModuleType, arm: Arm, q: Expression) -> tuple[Expression, Expression]:
    """Return the last link's rotation and the catch point in the world."""
    R, p = ca.SX(ca.DM(arm.model.mount[:3, :3])), ca.SX(ca.DM(arm.model.mount[:3, 3]))
    for link, x in zip(arm.model.links, _values(arm, q, held=True), strict=True):
        turn, way = _placed(ca, link, x)
        p = p + ca.mtimes(R, way)
        R = ca.mtimes(R, turn)
    return R, p + ca.mtimes(R, ca.DM(arm.model.catch_point))


def _torque(ca: ModuleType, arm: Arm, q: Expression, dq: Expression, ddq: Expression) -> Expression:
    """Return the torques of eq. (14) for all links."""
    links = arm.model.complete().links
    at, by, up = (_values(arm, x, held=k == 0) for k, x in enumerate((q, dq, ddq)))
    mount = arm.model.mount[:3, :3]
    w, dw, a = ca.SX(3, 1), ca.SX(3, 1), ca.SX(ca.DM(mount.T @ np.array([0.0, 0.0, GRAVITY])))
    frames, loads = [], []
    for k, link in enumerate(links):
        R, p = _placed(ca, link, at[k])
        axis, slide = ca.DM(link.axis), float(link.prismatic)
        a = a + ca.cross(dw, p) + ca.cross(w, ca.cross(w, p))
        w, dw, a = (ca.mtimes(R.T, x) for x in (w, dw, a))
        spin, run = (1.0 - slide) * by[k] * axis, slide * by[k] * axis
        a = a + slide * up[k] * axis + 2.0 * ca.cross(w, run)
        dw = dw + (1.0 - slide) * up[k] * axis + ca.cross(w, spin)
        w = w + spin
        com, inertia = ca.DM(link.com), ca.DM(link.inertia)
        force = link.mass * (a + ca.cross(dw, com) + ca.cross(w, ca.cross(w, com)))
        moment = ca.mtimes(inertia, dw) + ca.cross(w, ca.mtimes(inertia, w))
        frames.append((R, p))
        loads.append((force, moment + ca.cross(com, force)))
    f, n = ca.SX(3, 1), ca.SX(3, 1)
    tau: list[Expression] = []
    for k in reversed(range(len(links))):  # from the tip to the base
        f, n = f + loads[k][0], n + loads[k][1]
        along = ca.dot(ca.DM(links[k].axis), f if links[k].prismatic else n)
        tau.insert(0, along + links[k].armature * up[k])
        R, p = frames[k]
        f = ca.mtimes(R, f)
        n = ca.mtimes(R, n) + ca.cross(p, f)
    return ca.vertcat(*tau)


#: Degree of the polynomial that stands for the ball's flight around the catch.
DEGREE = 6
#: Parts M of the motion.
PARTS = 16
#: Share of torque and speed limits that may be used; between the instants and in feedback a
#: little more is needed.
_SHARE = 0.95
#: Gap to a joint stop that is kept [rad].
_GAP = 0.08


@final
@dataclass(frozen=True, eq=False)
class Programme:
    """The programme of one arm; built once, solved for each throw."""

    arm: Arm

    def solve(
        self, t: float, motion: Array, guess: Intercept, *, flight: Array, window: float
    ) -> PathMotion | None:
        """Return the least-cost catch near a guessed one; None where IPOPT finds none.

        Args:
            t: Time of the start [s].
            motion: q, dq, ddq then, shape (3, n).
            guess: Catch to start from.
            flight: Polynomial of the ball's flight about the guess's time, shape (3, 7).
            window: How far the catch may move from the guess in time [s].
        """
        n, M, span = self.arm.n, PARTS, guess.t_c - t
        rows = np.empty((M + 1, 3, n))
        for k in range(M + 1):
            quintic(motion, guess.end, span, span * k / M, rows[k])
        rows[:, 0] = np.clip(rows[:, 0], self.arm.q_min, self.arm.q_max)
        start = np.concatenate([rows[:, d].ravel() for d in range(3)])
        soft, hard = APPROACH
        x0 = np.concatenate([start, [span, soft]])
        low = np.concatenate([self._bounds[0], [max(span - window, 0.05), soft]])
        high = np.concatenate([self._bounds[1], [span + window, hard]])
        p = np.concatenate([motion[0], motion[1], flight.ravel(order="F"), [span, guess.closing]])
        lbg, ubg = self._parts[4:]
        answer = self._solver(x0=x0, lbx=low, ubx=high, p=p, lbg=lbg, ubg=ubg)
        if not self._solver.stats()["success"]:
            return None
        x = np.asarray(answer["x"]).ravel()
        if not np.all(np.isfinite(x)):
            return None
        q, dq, ddq = x[: 3 * n * (M + 1)].reshape(3, M + 1, n).transpose(0, 2, 1)
        step = float(x[-2]) / M
        return PathMotion(t=t, step=step, q=q, dq=dq, ddq=ddq, cost=float(answer["f"]))

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        """Bounds of angles, speeds and accelerations at the instants, each (3 n (M + 1),)."""
        arm, many = self.arm, PARTS + 1
        free = np.full(arm.n * many, np.inf)
        speed = np.tile(_SHARE * arm.dq_max, many)
        low = np.concatenate([np.tile(arm.q_min + _GAP, many), -speed, -free])
        return low, np.concatenate([np.tile(arm.q_max - _GAP, many), speed, free])

    @cached_property
    def _solver(self) -> Expression:
        """IPOPT on the programme, silent."""
        ca, (x, p, cost, g) = casadi(), self._parts[:4]
        options = {
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "print_time": False,
            "ipopt.max_iter": 120,
            "ipopt.tol": 1e-5,
            "ipopt.acceptable_tol": 1e-4,
            "ipopt.mu_strategy": "adaptive",
            "expand": True,
        }
        return ca.nlpsol("catch", "ipopt", {"x": x, "p": p, "f": cost, "g": g}, options)

    @cached_property
    def _parts(self) -> tuple[Expression, Expression, Expression, Expression, Array, Array]:
        """Variables, parameters, cost, constraints and their bounds."""
        ca, arm, n, M = casadi(), self.arm, self.arm.n, PARTS
        model = symbolic(arm)
        q, dq, a = (ca.MX.sym(name, n, M + 1) for name in ("q", "dq", "a"))
        span, approach = ca.MX.sym("span"), ca.MX.sym("approach")
        q_0, dq_0, mid = ca.MX.sym("q_0", n), ca.MX.sym("dq_0", n), ca.MX.sym("mid")
        closing = ca.MX.sym("closing")
        c = ca.MX.sym("c", 3, DEGREE + 1)
        h = span / M
        tau = model.torque.map(M + 1)(q, dq, a)
        rows = _Rows()
        rows.equal(q[:, 0] - q_0, dq[:, 0] - dq_0)
        rows.equal(*steps(q, dq, a, h))
        ball = _flight(ca, c, span - mid)
        tip = model.tip(q[:, -1], dq[:, -1], a[:, -1])
        met, normal = tip - ball, model.normal(q[:, -1])
        rows.equal(met[:, 0], 0.1 * (met[:, 1] - closing * normal))
        rows.equal(0.01 * (met[:, 2] + approach * normal))
        for value, low, high in drive_rows(arm, tau, dq, share=_SHARE):
            rows.within(value, np.full(M + 1, low), np.full(M + 1, high))
        rows.within(
            pose_after_braking(arm, q[:, -1], dq[:, -1]), arm.q_min + _GAP, arm.q_max - _GAP
        )
        active = tau[list(arm.model.active), :] / ca.DM(arm.tau_max)
        cost = (ca.sumsqr(active) + ca.sumsqr(dq / ca.DM(arm.dq_max))) / (M + 1)
        x = ca.vertcat(ca.vec(q), ca.vec(dq), ca.vec(a), span, approach)
        p = ca.vertcat(q_0, dq_0, ca.vec(c), mid, closing)
        return x, p, cost, ca.vertcat(*rows.values), np.array(rows.low), np.array(rows.high)


class _Rows:
    """Constraints and their bounds, as they are collected."""

    def __init__(self) -> None:
        """Start empty."""
        self.values: list[Expression] = []
        self.low: list[float] = []
        self.high: list[float] = []

    def equal(self, *values: Expression) -> None:
        """Add what must be zero."""
        for value in values:
            flat = value.reshape((-1, 1))
            self.within(flat, np.zeros(flat.shape[0]), np.zeros(flat.shape[0]))

    def within(self, value: Expression, low: Array, high: Array) -> None:
        """Add what must lie between two bounds."""
        self.values.append(value)
        self.low.extend(low.tolist())
        self.high.extend(high.tolist())


def steps(
    q: Expression, dq: Expression, a: Expression, h: Expression
) -> tuple[Expression, Expression]:
    """Return what is zero where accelerations are linear between instants ``h`` s apart.

    Args:
        q: Angles at the instants, shape (n, M + 1).
        dq: Speeds there.
        a: Accelerations there.
        h: Time between them [s].
    """
    gained = dq[:, 1:] - dq[:, :-1] - 0.5 * h * (a[:, 1:] + a[:, :-1])
    moved = q[:, 1:] - q[:, :-1] - h * dq[:, :-1] - h**2 / 6 * (2 * a[:, :-1] + a[:, 1:])
    return gained, moved


def drive_rows(
    arm: Arm, tau: Expression, dq: Expression, *, share: float
) -> list[tuple[Expression, float, float]]:
    """Return the drives' torques and speeds with their bounds: peak, and stall to no load.

    Args:
        arm: The arm.
        tau: Torques of all N links at the instants [N m], shape (N, M + 1).
        dq: Speeds of the active joints there [rad/s], shape (n, M + 1).
        share: Part of each limit that may be used.
    """
    ca, limits = casadi(), arm.limits
    drive = ca.mtimes(ca.DM(limits.to_drive), tau)
    speed = ca.mtimes(ca.DM(limits.transmission[:, list(arm.model.active)]), dq)
    rows = list[tuple[Expression, float, float]]()
    for k, peak in enumerate(share * limits.tau_peak):
        run = speed[k, :].T / limits.dq_max[k]
        rows.append((drive[k, :].T / peak, -1.0, 1.0))
        rows.append((run, -share, share))
        if np.isfinite(limits.tau_stall[k]):
            rows.append((drive[k, :].T / (share * limits.tau_stall[k]) + run, -1.0, 1.0))
    return rows


def pose_after_braking(arm: Arm, q: Expression, dq: Expression) -> Expression:
    """Return about where the joints stand once the arm has braked after the catch, shape (n,).

    Args:
        arm: The arm.
        q: Angles at the catch, shape (n,).
        dq: Speeds there, shape (n,).
    """
    size, inertia = casadi().sqrt(dq**2 + 0.01), hand_numbers(arm).inertia
    return q + FOLLOW * dq + 0.5 * dq * size * inertia


def _flight(ca: ModuleType, c: Expression, s: Expression) -> Expression:
    """Return position, velocity, acceleration of the ball, shape (3, 3) by column."""
    columns = []
    for d in range(3):
        factor = [float(np.prod(np.arange(k - d + 1, k + 1))) for k in range(DEGREE + 1)]
        row = [
            factor[k] * s ** (k - d) if k > d else factor[k] * (k == d) for k in range(DEGREE + 1)
        ]
        columns.append(ca.mtimes(c, ca.vertcat(*row)))
    return ca.horzcat(*columns)


#: The true flight: time since release [s] to position [m] and velocity [m/s], each (3,).
Flight = Callable[[float], tuple[Array, Array]]

#: How far a catch may move from the one it was looked for around [s], wide and narrow.
_WINDOWS = 0.08, 0.03


class _Last:
    """The newest plan and what it was made for."""

    def __init__(self) -> None:
        """Start without."""
        self.key: tuple[float, ...] = ()
        self.plan: PathMotion | None = None

    def refuses(self, t: float, motion: Array) -> bool:
        """Say whether there was no plan from the same rest a moment ago.

        The flight is known and the arm could have waited: a later start can do no more. It is
        tried anew each 20 ms all the same, for what IPOPT did not find. Two rests are the same
        within 1 mrad.
        """
        if not self.key or self.plan is not None or not t - self.key[0] < 0.02:
            return False
        before = np.array(self.key[1:]).reshape(motion.shape)
        is_rest = not motion[1:].any() and not before[1:].any()
        return bool(is_rest and np.abs(motion[0] - before[0]).max() < 1e-3)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Clairvoyant(Generator):
    """The optimum that knows the flight; see the module's text.

    Attributes:
        chooser: Where to start the search.
        programme: The optimum of the arm.
        flight: The true flight; None until it is given.
        plan: The motion that is followed; None before ``adapt`` and where there is none.
    """

    chooser: Chooser
    programme: Programme
    flight: Flight | None = None
    plan: PathMotion | None = None
    last: _Last = field(default_factory=_Last)

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that it moves."""
        return (self.chooser.arm,)

    def with_flight(self, flight: Flight) -> "Clairvoyant":
        """Return the one that knows this flight."""
        return replace(self, flight=flight, plan=None, last=_Last())

    def afresh(self) -> "Clairvoyant":
        """Return the one that knows this flight and has planned nothing yet."""
        return replace(self, plan=None, last=_Last())

    def sharpness(self, ball: BallState) -> float:
        """Return 0: there is nothing to wait for."""
        ball = checks.instance("ball", ball, BallState)
        return 0.0 if ball.tracked else np.inf

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Plan; where no plan keeps the limits, the throw is out of reach."""
        ball = checks.instance("ball", ball, BallState)
        q = checks.vector("q", q, self.chooser.arm.n, finite=True)
        plan = self._planned(ball.t, at_rest(q))
        if plan is None:
            return Verdict(
                outcome=Outcome.UNREACHABLE,
                binding_limit="optimum",
                share=np.inf,
                t_catch=np.inf,
                sigma=0.0,
            )
        arm = self.chooser.arm
        motion = [plan.at(plan.t + k * plan.step) for k in range(plan.q.shape[1])]
        shares = arm.active(demand(arm, np.array(motion)).torque).max(axis=0)
        k = int(np.argmax(shares))
        return Verdict(
            outcome=Outcome.FEASIBLE,
            binding_limit=f"torque:{arm.names[k]}",
            share=float(shares[k]),
            t_catch=plan.t_c,
            sigma=0.0,
        )

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Clairvoyant":
        """Plan from where the arm is."""
        ball = checks.instance("ball", ball, BallState)
        n = self.chooser.arm.n
        q, dq = (checks.vector(*x, n, finite=True) for x in (("q", q), ("dq", dq)))
        plan = self._planned(ball.t, np.array([q, dq, np.zeros(len(q))]))
        return replace(self, plan=plan or self.plan)

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the plan; after the catch, stay on the ball."""
        ball = checks.instance("ball", ball, BallState)
        plan = self.plan
        if plan is None or self.flight is None:
            return resting(ball.t, self.chooser.arm.q_ready)
        rows, end = plan.at(min(ball.t, plan.t_c)), plan.at(plan.t_c)
        if ball.t > plan.t_c:
            arm, r = self.chooser.arm, self._ball(ball.t)
            faster = arm.jacobian(end[0]) @ end[1] - self._ball(plan.t_c)[1]
            closing = float(faster @ arm.orientation(end[0])[:, 2])
            self.chooser.beside(r, closing, ball.t - plan.t_c, rows)
        return JointReference(
            t=ball.t,
            status=MapStatus.INSIDE,
            q_d=rows[0],
            dq_d=rows[1],
            ddq_d=rows[2],
            q_o=end[0],
            dq_o=end[1],
            time_to_catch=plan.t_c - ball.t,
        )

    def _planned(self, t: float, motion: Array) -> PathMotion | None:
        """Return the plan from a state, kept for the next question about it."""
        if self.flight is None:
            return None
        key, last = (t, *motion.ravel().tolist()), self.last
        if last.key == key:
            return last.plan
        if last.refuses(t, motion):
            return None
        last.key, last.plan = key, self._plan(t, motion)
        return last.plan

    def _plan(self, t: float, motion: Array) -> PathMotion | None:
        """Return the cheapest of the optima found from several starts; None without one."""
        after = np.arange(SOONEST, 1.2, STRIDE)
        balls = np.array([self._ball(t + x) for x in after.tolist()])
        first = self.chooser.best(after, balls, motion)
        if first is None:
            return None
        found: list[PathMotion] = []
        for shift in (0.0, -0.08, 0.08, 0.16):  # of the guessed catch in time [s]
            guess = self._guess(first, shift, t, motion)
            plan = None if guess is None else self._optimum(t, motion, guess)
            if plan is not None:
                found.append(plan)
            if plan is not None and shift == 0.0 and abs(plan.t_c - t - first.t_c) < _WINDOWS[1]:
                break
        return min(found, key=lambda plan: plan.cost) if found else None

    def _guess(self, first: Intercept, shift: float, t: float, motion: Array) -> Intercept | None:
        """Return the catch so much later than the first [s]; None where there is none."""
        after = np.array([first.t_c + shift])
        if after[0] < SOONEST:
            return None
        found = self.chooser.best(after, self._ball(t + float(after[0]))[None], motion)
        return None if found is None else replace(found, t_c=t + found.t_c)

    def _optimum(self, t: float, motion: Array, guess: Intercept) -> PathMotion | None:
        """Return the optimum about a guess; where the flight has a kink, close about it."""
        for window in _WINDOWS:
            flight, left = self._fitted(guess.t_c, window)
            if left < 1e-3:  # [m]
                return self.programme.solve(t, motion, guess, flight=flight, window=window)
        return None

    def _fitted(self, middle: float, window: float) -> tuple[Array, float]:
        """Return the flight's polynomial about a time, (3, 7), and the largest residual [m].

        By 25 samples at Chebyshev's nodes.
        """
        s = window * np.cos(np.pi * (np.arange(25) + 0.5) / 25)
        r = np.array([self._ball(middle + x)[0] for x in s.tolist()])
        powers = s[:, None] ** np.arange(DEGREE + 1)
        scale = window ** np.arange(DEGREE + 1)
        c = np.linalg.lstsq(powers / scale, r, rcond=None)[0] / scale[:, None]
        return c.T, float(np.abs(powers @ c - r).max())

    def _ball(self, t: float) -> Array:
        """Return r_o, dr_o, ddr_o of the true flight, shape (3, 3)."""
        if self.flight is None:
            raise RuntimeError("the clairvoyant was given no flight")
        (r, dr), ahead, back = self.flight(t), self.flight(t + TICK), self.flight(t - TICK)
        return np.array([r, dr, (ahead[1] - back[1]) / (2.0 * TICK)])


def make_clairvoyant(f: DirectMap) -> Clairvoyant:
    """Return the optimum for the arm of a map.

    Raises:
        InputError: CasADi is not installed.
    """
    casadi()
    return Clairvoyant(chooser=Chooser(f), programme=Programme(f.arm))
