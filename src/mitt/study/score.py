"""How a trial is scored, by the rules of the contract, from the true states of the world."""

from dataclasses import dataclass

import numpy as np

from mitt.robot.arm import Arm
from mitt.signals import Array, JointReference
from mitt.world.simulation import World
from mitt.world.truth import Truth

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
            touching itself or the floor.
        demand_cost: Mean cost (22) of the reference before saturation.
        peak_contact_force_n: Largest single contact force on the ball [N].
        binding_limit: The limit that the verdict found asked most, or what ended the trial.
        saturated_ticks: Ticks in which a torque limit was met.
        range_excess_rad: Largest reference angle beyond a joint's range [rad].
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


def held(truth: Truth, radius: float) -> bool:
    """Say whether the ball is held: near the catch point and touched by two geoms or more."""
    gap = float(np.linalg.norm(truth.r_o - truth.position)) - radius
    return gap <= HELD_GAP and len(truth.touching) >= HELD_GEOMS


class Meter:
    """Adds up what the arm is asked and what it does, tick by tick."""

    def __init__(self, arm: Arm) -> None:
        """Start at zero."""
        self._arm = arm
        self.torque, self.speed = np.zeros(arm.n), np.zeros(arm.n)
        self.violations, self.saturated = 0, 0
        self.excess = 0.0
        self._cost, self._asked = 0.0, 0

    @property
    def cost(self) -> float:
        """Mean cost of the reference, 0 where none was asked for."""
        return self._cost / max(self._asked, 1)

    def ask(self, reference: JointReference) -> None:
        """Take in what the generator asked for, before any limit."""
        arm = self._arm
        tau = arm.inverse_dynamics(reference.q_d, reference.dq_d, reference.ddq_d)
        torque, speed = tau / arm.tau_max, reference.dq_d / arm.dq_max
        self._cost += float(torque @ torque + speed @ speed)
        self._asked += 1
        over = np.maximum(reference.q_d - arm.q_max, arm.q_min - reference.q_d)
        self.excess = max(self.excess, float(over.max()))

    def command(self, q: Array, dq: Array, tau: Array) -> bool:
        """Take in a command; return whether it exceeds a limit."""
        return self._exceeds(q, dq, tau, _COMMANDED)

    def plant(self, truth: Truth) -> bool:
        """Take in what the plant did; return whether it exceeds a limit."""
        arm = self._arm
        torque = arm.limits.torque_ratio(arm.all_joints(truth.tau), arm.all_joints(truth.dq))
        self.torque = np.maximum(self.torque, arm.active(torque))
        self.speed = np.maximum(self.speed, np.abs(truth.dq) / arm.dq_max)
        beyond = self._exceeds(truth.q, truth.dq, truth.tau, _MEASURED)
        return beyond or truth.self_contact or truth.floor_contact

    def _exceeds(self, q: Array, dq: Array, tau: Array, slack: float) -> bool:
        """Say whether position, speed or torque exceed their limits by a share ``slack``."""
        arm = self._arm
        span = slack * (arm.q_max - arm.q_min)
        outside = bool(np.any(q < arm.q_min - span) or np.any(q > arm.q_max + span))
        fast = bool(np.any(np.abs(dq) > arm.dq_max * (1.0 + slack)))
        drive = arm.limits.drive_torque(arm.all_joints(tau))
        strong = bool(np.any(np.abs(drive) > arm.limits.tau_peak * (1.0 + slack)))
        return outside or fast or strong


def status_of(world: World, *, refused: bool, was_held: bool) -> str:
    """Return the status of a finished trial."""
    if world.diverged:
        return "aborted"
    if refused:
        return "unreachable"
    if world.first_contact is None:
        return "missed"
    return "caught" if was_held else "dropped"
