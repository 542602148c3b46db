"""Optimising the map in flight: one real-time iteration of eq. (22) a millisecond.

From the present coefficients one Gauss-Newton step of the cost of the remaining flight, by a
quadratic programme (DAQP) with

- continuity of q_d and dq_d at the instant at which the new coefficients act, eq. (12): the step
  leaves them as they are, so that the reference never jumps;
- torque (18), speed (20) and joint ranges, the ball's way into the hand, and the arm's clearance
  of itself and of what stands around it, wherever the present motion is near them, softly: the
  catch itself fixes the last instants;
- a pull towards alpha* in the metric H of the learned cost, without which 0.5 mm of noise asks
  for many times the torque.

Afterwards the new motion is weighed with the exact torques. A step that is not finite, breaks the
continuity or does not help is halved, and dropped after that: the last good alpha stays, and the
next step is tried at a smaller share first.
"""

from dataclasses import dataclass
from enum import Enum
from math import inf, isfinite
from typing import Any, final

import daqp
import numpy as np

from mitt import checks, fields
from mitt.errors import InputError
from mitt.fields import brief
from mitt.generator.approach import palm_of
from mitt.generator.clearance import space_of
from mitt.generator.demand import Tolerance, acceleration_share
from mitt.generator.feasibility import Outcome, Verdict, trusted
from mitt.generator.horizon import INSTANTS, course_of
from mitt.generator.mapping import DirectMap
from mitt.generator.prediction import foresee
from mitt.generator.probability import KINDS, spread_ahead
from mitt.generator.qp import programme_of
from mitt.generator.qp_buffers import end, gather, opened, start, vouch
from mitt.generator.sqp_step import Buffers, Goal, Map
from mitt.generator.utilization import plant_of, work_of
from mitt.robot.arm import Arm
from mitt.robot.shapes import Surroundings
from mitt.signals import Array, BallState

#: Rows of DAQP: an equality, a limit that may be exceeded at a price.
_EQUAL, _SOFT = 5, 8
#: Most iterations of the solver.
_ITERATIONS = 100
#: Residual of the continuity that is let pass [rad, rad/s].
_RESIDUAL = 1e-6
#: By what the share of a step that is tried first changes after one that helped and after one
#: that did not, and its least value.
_BOLDER, _SHORTER, _LEAST = 4.0, 0.125, 1.0 / 64.0


class Refinement(Enum):
    """What became of a step."""

    REFINED = "refined"
    KEPT = "kept"  # no step helped
    LATE = "late"  # so near the catch that nothing can be changed
    OUTSIDE = "outside"  # the flight leaves the domain of the map
    FAILED = "failed"  # the solver's answer was not finite or broke the continuity


#: Least and largest number of each setting; choices of this project.
_RANGES = {
    "pull": (0.0, 1e12), "share": (0.01, 100.0), "near": (0.0, 100.0), "weight": (0.0, 1e12),
    "until": (0.0, 100.0), "lead": (0.0, 1.0), "halvings": (0, 100), "ball_radius": (1e-3, 1.0),
    "gap": (0.0, 1.0),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class OnlineSettings:
    """How to refine.

    Attributes:
        pull: Weight of the pull towards alpha*, in units of the learned cost's curvature.
        share: Share of each limit that may be used.
        near: Share of a limit from which it gets a row.
        weight: Weight of a squared excess over a limit.
        until: Time to the catch at which refining ends [s].
        lead: Time until the new coefficients act [s]: one tick.
        halvings: Halvings of a step that does not help.
        ball_radius: Radius of the ball, for the corridor between the fingers [m].
        gap: Gap that the arm keeps to itself and to what stands around it [m]: more than the
            controller's, which brakes where its own is not left.
    """

    pull: float = 3e-6
    share: float = 0.92
    near: float = 0.7
    weight: float = 10.0
    until: float = 0.04
    lead: float = 0.001
    halvings: int = 2
    ball_radius: float = 0.04
    gap: float = 0.02

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        fields.check(self, _RANGES)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Refined:
    """Coefficients and what they ask of the arm.

    Attributes:
        status: What became of the step.
        alpha: Coefficients [rad], shape (m, n).
        ahead: Time to the catch, from when they act [s].
        cost: Their cost over the rest of the flight, eq. (22).
        shares: Largest share of each drive's torque and speed and of each range, shape (3, N).
    """

    status: Refinement
    alpha: Array
    ahead: float
    cost: float
    shares: Array

    __repr__ = brief


@final
class Online:
    """Refines the coefficients of one map; keeps buffers, time of the catch, and last share."""

    def __init__(
        self,
        f: DirectMap,
        settings: OnlineSettings | None = None,
        *,
        around: Surroundings | None = None,
    ) -> None:
        """Take the learned map, whose alpha is alpha*, H the metric; and what stands around."""
        self._f = checks.instance("f", f, DirectMap)
        if f.design.match_weight > 0.0:  # eq. (22) alone would undo what the map has learned
            raise InputError("a map refined in flight", "match_weight 0", f.design.match_weight,
                             do="leave --adapt refine out")  # fmt: skip
        self.settings, self._around = settings or OnlineSettings(), around
        s, (m, n), links = self.settings, f.alpha.shape, len(f.arm.model.links)
        weights = np.array([s.pull, s.share, s.near, s.weight, s.gap])
        space = space_of(f.arm, around or Surroundings())
        self._known = gather(
            Map(f.packed, f.basis.powers, f.window, f.work), plant_of(f.arm),
            Goal(f.alpha, f.H, weights, palm_of(f, ball_radius=s.ball_radius), space),
            Buffers(
                course_of(n, m),
                programme_of(f.arm, instants=INSTANTS, size=m * n, pairs=len(space.pairs)),
                work_of(f.arm), np.zeros((3, links)), np.zeros((3, links)),
            ),
        )  # fmt: skip
        self._map, self._plant, self._goal, self._buffers = opened(*self._known)
        rows = len(self._buffers.programme.A)
        self._sense = np.full(rows, _SOFT, dtype=np.int32)
        self._sense[: 2 * n] = _EQUAL
        self._low = np.full(rows, -1e30)
        self._low[: 2 * n] = 0.0
        price, nothing = np.full(rows, 0.5 / s.weight), np.zeros(rows)
        self._prices = (price, price, nothing, nothing)
        self._solvers: dict[int, daqp.Model] = {}
        self._region = trusted(f)
        self._sigma = np.zeros((2, n))
        self._state = np.zeros(7)
        self._t_catch, self._share, self._laid = inf, 1.0, False

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how to build the same again; its solvers are made anew."""
        progress = (
            self._t_catch, self._share, self._laid, self._state.copy(), self._sigma.copy(),
            self._known[0].copy(),
        )  # fmt: skip
        return _built, (self._f, self.settings, self._around), progress

    def __setstate__(self, progress: tuple[float, float, bool, Array, Array, Array]) -> None:
        """Go on where the one that was copied is."""
        self._t_catch, self._share, self._laid, *arrays = progress
        self._state[:], self._sigma[:], self._known[0][:] = arrays

    @property
    def arm(self) -> Arm:
        """The arm whose map it refines."""
        return self._f.arm

    def on(self, arm: Arm) -> "Online":
        """Return one for the same arm with other limits."""
        return Online(self._f.on(arm), self.settings, around=self._around)

    def restart(self) -> None:
        """Forget the flight: the next ball is another, or its way has changed."""
        self._t_catch, self._share, self._laid = inf, 1.0, False

    def refine(self, alpha: Array, ball: BallState) -> Refined:
        """Return better coefficients for the rest of the flight.

        Args:
            alpha: Coefficients now in use [rad], shape (m, n).
            ball: Estimate of the ball at the time of this tick's command.
        """
        alpha = checks.array("alpha", alpha, self._f.alpha.shape, finite=True)
        ball = checks.instance("ball", ball, BallState)
        s, t = self.settings, ball.t + self.settings.lead
        if not isfinite(self._t_catch):
            self._t_catch = ball.t + foresee(self._f, ball).after
        ahead = self._t_catch - t
        if not s.until < ahead < inf:
            outside = ahead == inf
            status = Refinement.OUTSIDE if outside else Refinement.LATE
            return self._answer(status, alpha, ahead, inf)
        self._state[:3], self._state[3:6], self._state[6] = ball.r_o, ball.dr_o, ball.drag
        self._buffers.course.rows[0, 0] = self._f.start
        better, count, before = start(*self._known, self._state, (s.lead, ahead), alpha)
        self._t_catch, self._laid = (t + better, True) if isfinite(better) else (inf, False)
        step = self._solved(count) if count > 0 else None
        if step is None:
            status = Refinement.FAILED if isfinite(better) else Refinement.OUTSIDE
            return self._answer(status, alpha, ahead, before)
        moved = np.empty_like(alpha)
        trial = (before, self._share, s.halvings, _RESIDUAL)
        after = end(*self._known, trial, alpha, step, moved)
        if not isfinite(after):
            return self._answer(Refinement.FAILED, alpha, ahead, before)
        status = Refinement.REFINED if after < before else Refinement.KEPT
        change = _BOLDER if after < before else _SHORTER
        self._share = min(max(change * self._share, _LEAST), 1.0)
        return self._answer(status, moved, ahead, after)

    def certify(self, alpha: Array, ball: BallState, *, tolerance: Tolerance) -> Verdict | None:
        """Return the certificate of the course that was last refined; None without one.

        Args:
            alpha: Coefficients that came of it [rad], shape (m, n).
            ball: The estimate it was laid from.
            tolerance: Share of each limit at which a throw is refused.
        """
        arm, ball = self._f.arm, checks.instance("ball", ball, BallState)
        alpha = checks.array("alpha", alpha, self._f.alpha.shape, finite=True)
        if not self._laid:
            return None
        limit, probability, share = vouch(
            *self._known, alpha, ball.covariance, self._region,
            np.array([tolerance.torque, tolerance.speed, 1.0]), self._sigma,
        )  # fmt: skip
        ahead, binding = (
            self._t_catch - ball.t,
            f"{KINDS[limit[0]]}:{arm.model.links[limit[1]].name}",
        )
        most, joint = self._acceleration(alpha, tolerance)
        if most > share:
            share, binding = most, f"acceleration:{arm.names[joint]}"
        return Verdict(
            outcome=Outcome.FEASIBLE if share <= 1.0 else Outcome.UNREACHABLE,
            binding_limit=binding,
            share=share,
            t_catch=ball.t + ahead,
            sigma=float(spread_ahead(ball.covariance, ahead)),
            probability=probability,
        )

    def _acceleration(self, alpha: Array, tolerance: Tolerance) -> tuple[float, int]:
        """Return the largest share of an acceleration limit along the course, and its joint."""
        c = self._buffers.course
        ddq = c.rows[:, 2] + c.phi[:, 2] @ alpha
        shares = acceleration_share(self._f.arm, ddq).max(axis=0) / tolerance.acceleration
        joint = int(np.argmax(shares))
        return float(shares[joint]), joint

    def _solved(self, count: int) -> Array | None:
        """Return the step of the programme's first ``count`` rows, (m n,); None without one."""
        q, solver = self._buffers.programme, self._solvers.get(count)
        rows, room, sense = q.A[:count], q.room[:count], self._sense[:count]
        if solver is None or solver.update(H=q.h, f=q.g, A=rows, bupper=room, sense=sense) != 0:
            solver = daqp.Model()
            solver.settings = {"iter_limit": _ITERATIONS}
            flag, _ = solver.setup(q.h, q.g, rows, room, self._low[:count], sense)
            if flag < 0:
                return None
            solver.soft_weights(*(price[:count] for price in self._prices))
            self._solvers[count] = solver
        x, _, flag, _ = solver.solve()
        step: Array = x
        return step if flag > 0 else None

    def _answer(self, status: Refinement, alpha: Array, ahead: float, cost: float) -> Refined:
        """Return coefficients with what was found out about them."""
        return Refined(
            status=status, alpha=alpha, ahead=ahead, cost=cost, shares=self._buffers.shares.copy()
        )


def _built(f: DirectMap, settings: OnlineSettings, around: Surroundings | None) -> Online:
    """Return one that refines a map."""
    return Online(f, settings, around=around)
