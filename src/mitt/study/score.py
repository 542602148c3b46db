"""How a trial is scored, by the rules of the contract, from the true states of the world."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mitt.generator.certificate import Verdict
from mitt.generator.demand import demand
from mitt.records import Phase, Record
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.study.drives import rms_ratio, with_held
from mitt.world.contacts import ARM_FLOOR, SELF
from mitt.world.simulation import World
from mitt.world.truth import Trace, Truth

#: Caught: the ball's centre so near the catch point beyond its radius [m], touched by so many
#: geoms of the hand, so long after first contact [s].
HELD_GAP, HELD_GEOMS, HELD_AFTER = 0.020, 2, 0.5

#: Limit violations: commanded beyond a limit by more than this, and the plant beyond by a share.
_COMMANDED, _MEASURED = 1e-9, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One trial, field by field as in ``result.json``.

    Attributes:
        index: Number of the throw.
        status: ``caught``, ``dropped``, ``missed``, ``unreachable`` or ``aborted``.
        t_catch_s: From release to q_o,i = q_alpha [s].
        position_error_mm: Distance of ball and catch point at first contact [mm].
        velocity_error_m_s: Difference of their velocities then [m/s].
        peak_torque_ratio: Largest share of each active joint's torque limit.
        peak_speed_ratio: Largest share of each active joint's speed limit.
        limit_violations: Ticks with a limit exceeded, commanded or true, or with the arm
            touching itself or the floor; and one for each drive beyond its continuous torque.
        demand_cost: Mean cost (22) of the reference before saturation.
        peak_contact_force_n: Largest single contact force on the ball [N].
        binding_limit: The limit that the verdict found asked most, or what ended the trial.
        saturated_ticks: Ticks in which a torque limit was met.
        range_excess_rad: Largest reference angle beyond a joint's range [rad].
        rms_torque_ratio: Share of each drive's continuous torque, as root mean square over the
            trial; 0 where the limit set has none.
        certificate: The verdict before moving: outcome, binding limit, margin and probability.
        certificate_last: The same of the last online step before the catch; None where nothing was
            refined in flight.
    """

    index: int
    status: str
    t_catch_s: float | None
    position_error_mm: float | None
    velocity_error_m_s: float | None
    peak_torque_ratio: list[float]
    peak_speed_ratio: list[float]
    limit_violations: int
    demand_cost: float
    peak_contact_force_n: float | None
    binding_limit: str | None
    saturated_ticks: int
    range_excess_rad: float
    rms_torque_ratio: list[float] = field(default_factory=list)
    certificate: dict[str, str | float | None] | None = None
    certificate_last: dict[str, str | float | None] | None = None


def certificate_of(verdict: Verdict | None) -> dict[str, str | float | None] | None:
    """Return a verdict as it stands in ``result.json``; numbers that are not finite are None."""
    if verdict is None:
        return None
    return {
        "outcome": verdict.outcome.value,
        "binding_limit": verdict.binding_limit,
        "margin": verdict.margin if np.isfinite(verdict.margin) else None,
        "probability": verdict.probability if np.isfinite(verdict.probability) else None,
    }


def held(truth: Truth, radius: float) -> bool:
    """Say whether the ball is held: near the catch point and touched by two geoms or more."""
    gap = float(np.linalg.norm(truth.r_o - truth.position)) - radius
    return gap <= HELD_GAP and len(truth.touching) >= HELD_GEOMS


class Meter:
    """Reckons up what the arm was asked and told in a trial."""

    def __init__(self, arm: Arm, ticks: Record) -> None:
        """Take the results of all its ticks, fields as of ``fresh_result``, shape (k,)."""
        self._arm, self._told = arm, ticks["told"]
        self._asked: Array = ticks["asked"][ticks["following"], :3]
        self._all: Array | None = None
        self.saturated = int(np.sum(ticks["saturated"]))

    def demand_cost(self) -> float:
        """Return the mean cost (22) of the references before any limit; 0 without one."""
        return demand(self._arm, self._asked).cost if len(self._asked) else 0.0

    def excess(self) -> float:
        """Return how far the references went beyond a joint's range [rad]."""
        if not len(self._asked):
            return 0.0
        q = self._asked[:, 0]
        over = np.maximum(q - self._arm.q_max, self._arm.q_min - q)
        return max(float(over.max()), 0.0)

    def violations(self, truth: Trace) -> int:
        """Return the ticks with a limit exceeded by a command or by the plant.

        The arm touching itself or the floor counts as well: its range is where it can be.
        """
        q, dq, tau = (self._told[:, row] for row in (0, 1, 3))
        given = self._given(truth)
        told = self._whole(truth, tau) if not np.array_equal(tau, truth.tau[1:]) else given
        before = truth.dq[:-1]
        bad = self._exceed((q, dq), told, before, _COMMANDED)
        bad |= self._exceed((truth.q[1:], truth.dq[1:]), given, before, _MEASURED)
        bad |= (truth.seen[1:] & (SELF | ARM_FLOOR)) != 0
        hot = sum(share > 1.0 + _MEASURED for share in self.continuous(truth))
        return int(np.sum(bad)) + hot

    def continuous(self, truth: Trace) -> list[float]:
        """Return the share of each drive's continuous torque over the trial."""
        return rms_ratio(self._arm, self._given(truth))

    def _given(self, truth: Trace) -> Array:
        """Return the torques of all links in each tick, shape (k, N); reckoned once."""
        if self._all is None:
            self._all = self._whole(truth, truth.tau[1:])
        return self._all

    def _whole(self, truth: Trace, tau: Array) -> Array:
        """Return torques of the active joints with those that hold the others, (k, N)."""
        return with_held(self._arm, truth.q[:-1], truth.dq[:-1], tau)

    def peaks(self, truth: Trace) -> tuple[list[float], list[float]]:
        """Return the largest shares of torque and speed limits of the active joints."""
        arm = self._arm
        torque = arm.limits.torque_ratio(self._given(truth), _spread(arm, truth.dq[:-1]))
        speed = np.abs(truth.dq) / arm.dq_max
        # The largest over drives and ticks, ticks first: that is the cheaper way round.
        return arm.by_joint(torque.max(axis=0)).tolist(), speed.max(axis=0).tolist()

    def _exceed(
        self, motion: tuple[Array, Array], tau: Array, at: Array, slack: float
    ) -> NDArray[np.bool_]:
        """Say in which ticks position, speed or torque exceed their limits by a share.

        Args:
            motion: q and dq, shapes (k, n).
            tau: Torques of all links [N m], shape (k, N).
            at: Joint speeds when the torque was given, which bound it [rad/s], shape (k, n).
            slack: Share of a limit that is let pass.
        """
        arm, (q, dq) = self._arm, motion
        span = slack * (arm.q_max - arm.q_min)
        outside = np.any((q < arm.q_min - span) | (q > arm.q_max + span), axis=1)
        fast = np.any(np.abs(dq) > arm.dq_max * (1.0 + slack), axis=1)
        drive, speed = arm.limits.drive_torque(tau), _spread(arm, at)
        bound = arm.limits.torque_bound(drive, arm.limits.drive_speed(speed))
        strong = np.any(np.abs(drive) > bound * (1.0 + slack) + _COMMANDED, axis=1)
        bad: NDArray[np.bool_] = outside | fast | strong
        return bad


def _spread(arm: Arm, x: Array) -> Array:
    """Return active joints' rows, shape (k, n), among all links, shape (k, N)."""
    out = np.zeros((len(x), len(arm.model.links)))
    out[:, arm.model.active] = x
    return out


def status_of(world: World, phase: Phase, *, was_held: bool) -> str:
    """Return the status of a finished trial, after which the catcher was in a phase."""
    if world.diverged or phase is Phase.STOPPED:
        return "aborted"
    if phase is Phase.REFUSED:
        return "unreachable"
    if world.first_contact is None:
        return "missed"
    return "caught" if was_held else "dropped"
