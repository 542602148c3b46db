"""Generator ``clairvoyant``: the optimum for an arm that knows the flight; an oracle, no rival.

THE ONLY GENERATOR THAT IS GIVEN WHAT NO CATCHER CAN KNOW. Before each throw it gets the true
flight of the ball, as it will be if nothing touches it (:meth:`Clairvoyant.with_flight`). It plans
once, by :mod:`mitt.baselines.optimum`, and follows the plan by the clock; of the estimate it uses
the time alone. What it cannot catch within the limits counts as out of reach.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from mitt import checks
from mitt.baselines.choice import SOONEST, STRIDE, Chooser, Intercept
from mitt.baselines.intercept import meet
from mitt.baselines.optimum import DEGREE, Programme
from mitt.baselines.paths import Motion
from mitt.baselines.pursuit import resting, still
from mitt.baselines.symbolic import casadi
from mitt.generator.demand import demand
from mitt.generator.feasibility import Outcome, Verdict
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState, JointReference, MapStatus

#: The true flight: time since release [s] to position [m] and velocity [m/s], each (3,).
Flight = Callable[[float], tuple[Array, Array]]

#: How far a catch may move from the one it was looked for around [s], wide and narrow; samples of
#: the flight there; residual from which on the flight has a kink there [m].
_WINDOWS, _SAMPLES, _KINK = (0.08, 0.03), 25, 1e-3
#: Where else to start from: shifts of the guessed catch in time [s].
_SHIFTS = (0.0, -0.08, 0.08, 0.16)
#: Time after which a refusal is reconsidered [s], and difference of two rests that are one [rad].
_AGAIN, _SAME = 0.02, 1e-3
#: Step of the difference that gives the ball's acceleration [s].
_NUDGE = 1e-3


class _Last:
    """The newest plan and what it was made for."""

    def __init__(self) -> None:
        """Start without."""
        self.key: tuple[float, ...] = ()
        self.plan: Motion | None = None

    def refuses(self, t: float, motion: Array) -> bool:
        """Say whether there was no plan from the same rest a moment ago.

        The flight is known and the arm could have waited: a later start can do no more. It is
        tried anew from time to time all the same, for what IPOPT did not find.
        """
        if not self.key or self.plan is not None or not t - self.key[0] < _AGAIN:
            return False
        before = np.array(self.key[1:]).reshape(motion.shape)
        is_rest = not motion[1:].any() and not before[1:].any()
        return bool(is_rest and np.abs(motion[0] - before[0]).max() < _SAME)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Clairvoyant:
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
    plan: Motion | None = None
    last: _Last = field(default_factory=_Last)

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that it moves."""
        return (self.chooser.arm,)

    def with_flight(self, flight: Flight) -> "Clairvoyant":
        """Return the one that knows this flight."""
        return replace(self, flight=flight, plan=None, last=_Last())

    def sharpness(self, ball: BallState) -> float:
        """Return 0: there is nothing to wait for."""
        ball = checks.instance("ball", ball, BallState)
        return 0.0 if ball.tracked else np.inf

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Plan; where no plan keeps the limits, the throw is out of reach."""
        ball = checks.instance("ball", ball, BallState)
        q = checks.vector("q", q, self.chooser.arm.n, finite=True)
        plan = self._planned(ball.t, still(q))
        if plan is None:
            return Verdict(
                outcome=Outcome.UNREACHABLE, binding_limit="optimum", share=np.inf,
                t_catch=np.inf, sigma=0.0,
            )  # fmt: skip
        arm = self.chooser.arm
        motion = [plan.at(plan.t + k * plan.step) for k in range(plan.q.shape[1])]
        shares = arm.active(demand(arm, np.array(motion)).torque).max(axis=0)
        k = int(np.argmax(shares))
        return Verdict(
            outcome=Outcome.FEASIBLE, binding_limit=f"torque:{arm.names[k]}",
            share=float(shares[k]), t_catch=plan.t_c, sigma=0.0,
        )  # fmt: skip

    def unsettled(self, ball: BallState, q: Array) -> bool:  # noqa: ARG002
        """Wait for nothing: the flight is known."""
        return False

    def returns(self, ball: BallState) -> bool:  # noqa: ARG002
        """Wait for nothing: no verdict is open."""
        return True

    def waiting(self, ball: BallState) -> BallState:
        """Wait for nothing."""
        return ball

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Clairvoyant":
        """Plan from where the arm is."""
        ball = checks.instance("ball", ball, BallState)
        n = self.chooser.arm.n
        q, dq = (checks.vector(*x, n, finite=True) for x in (("q", q), ("dq", dq)))
        plan = self._planned(ball.t, np.array([q, dq, np.zeros(len(q))]))
        return replace(self, plan=plan or self.plan)

    def as_map(self) -> None:
        """Say that this is no map."""

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the plan; after the catch, stay on the ball."""
        ball = checks.instance("ball", ball, BallState)
        plan = self.plan
        if plan is None or self.flight is None:
            return resting(ball.t, self.chooser.arm.q_ready)
        rows, end = plan.at(min(ball.t, plan.t_c)), plan.at(plan.t_c)
        if ball.t > plan.t_c:
            f = self.chooser.map
            meet(f.packed, self.chooser.hand, (0.0, 0.0), self._ball(ball.t), rows, f.work)
        return JointReference(
            t=ball.t, status=MapStatus.INSIDE, q_d=rows[0], dq_d=rows[1], ddq_d=rows[2],
            q_o=end[0], dq_o=end[1], time_to_catch=plan.t_c - ball.t,
        )  # fmt: skip

    def _planned(self, t: float, motion: Array) -> Motion | None:
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

    def _plan(self, t: float, motion: Array) -> Motion | None:
        """Return the cheapest of the optima found from several starts; None without one."""
        after = np.arange(SOONEST, 1.2, STRIDE)
        balls = np.array([self._ball(t + x) for x in after.tolist()])
        first = self.chooser.best(after, balls, motion)
        if first is None:
            return None
        found: list[Motion] = []
        for shift in _SHIFTS:
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

    def _optimum(self, t: float, motion: Array, guess: Intercept) -> Motion | None:
        """Return the optimum about a guess; where the flight has a kink, close about it."""
        for window in _WINDOWS:
            flight, left = self._fitted(guess.t_c, window)
            if left < _KINK:
                return self.programme.solve(t, motion, guess, flight=flight, window=window)
        return None

    def _fitted(self, middle: float, window: float) -> tuple[Array, float]:
        """Return the flight's polynomial about a time, (3, 7), and the largest residual [m]."""
        s = window * np.cos(np.pi * (np.arange(_SAMPLES) + 0.5) / _SAMPLES)
        r = np.array([self._ball(middle + x)[0] for x in s.tolist()])
        powers = s[:, None] ** np.arange(DEGREE + 1)
        scale = window ** np.arange(DEGREE + 1)
        c = np.linalg.lstsq(powers / scale, r, rcond=None)[0] / scale[:, None]
        return c.T, float(np.abs(powers @ c - r).max())

    def _ball(self, t: float) -> Array:
        """Return r_o, dr_o, ddr_o of the true flight, shape (3, 3)."""
        if self.flight is None:
            raise RuntimeError("the clairvoyant was given no flight")
        (r, dr), ahead, back = self.flight(t), self.flight(t + _NUDGE), self.flight(t - _NUDGE)
        return np.array([r, dr, (ahead[1] - back[1]) / (2.0 * _NUDGE)])


def make_clairvoyant(f: DirectMap) -> Clairvoyant:
    """Return the optimum for the arm of a map.

    Raises:
        InputError: CasADi is not installed.
    """
    casadi()
    return Clairvoyant(chooser=Chooser(f), programme=Programme(f.arm))
