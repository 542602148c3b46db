"""How a trial is scored, by the rules of the contract, from the true states of the world.

A locked joint stands still because its drives balance what the moving ones do to it. Where motors
share joints, as in the WAM's differential, the holding torque of joint 3 loads the motors of
joint 2: a torque limit is one of motors, so the holding torques count.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm, Tables
from mitt.core.arm.description import Hand
from mitt.core.arm.dynamics import bias_and_mass, slopes_work, solve_positive
from mitt.core.catcher.settings import Phase
from mitt.core.catcher.state import Result
from mitt.core.control.health import Plain, StoppedBy
from mitt.core.kernels import Record, kernel
from mitt.core.map.demand import demand
from mitt.core.signals import TICK, Array
from mitt.core.verdict.feasibility import Verdict
from mitt.lab.trials.scored_task import Measure, ScoredTask
from mitt.lab.trials.statistics import spread_of
from mitt.lab.world.engine import ARM_FLOOR, BALL_HAND, SELF
from mitt.lab.world.simulation import World
from mitt.lab.world.truth import Trace, Truth

#: Limit violations: commanded beyond a limit by more than this, and the plant beyond by a share.
COMMANDED = 1e-9
MEASURED = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriveLoads:
    """Loads of N drives at k instants, shape (k, N) each.

    Attributes:
        torque: Torque of each drive [N m].
        bound: Largest torque of the drive in that direction at its speed [N m].
        share: How much of the drive is asked for (:mod:`mitt.core.arm.limits`); 1 is the limit.
    """

    torque: Array
    bound: Array
    share: Array

    def over(self, slack: Array | float) -> NDArray[np.bool_]:
        """Say of each instant whether a drive exceeds its bound by a share, shape (k,) or ()."""
        most = self.bound * (1.0 + np.reshape(slack, (-1, 1))) + COMMANDED
        return np.asarray(np.any(np.abs(self.torque) > most, axis=1))


def drive_loads(arm: Arm, q: Array, dq: Array, tau: Array) -> DriveLoads:
    """Return the loads of all drives, eq. (14) solved for those of locked joints.

    Args:
        arm: The arm.
        q: Positions of the active joints [rad], shape (k, n).
        dq: Their speeds [rad/s], shape (k, n).
        tau: Their torques [N m], shape (k, n).
    """
    links, limits = link_torques(arm, q, dq, tau), arm.limits
    speeds = np.zeros_like(links)
    speeds[:, arm.model.active] = dq
    torque = limits.drive_torque(links)
    bound = limits.torque_bound(torque, limits.drive_speed(speeds))
    return DriveLoads(torque=torque, bound=bound, share=limits.torque_ratio(links, speeds))


def link_torques(arm: Arm, q: Array, dq: Array, tau: Array) -> Array:
    """Return the torques of all links while the active ones are driven [N m], shape (k, N)."""
    out = np.zeros((len(tau), len(arm.bodies)))
    rows = (np.ascontiguousarray(x) for x in (q, dq, tau))
    _hold(arm.tables, *rows, slopes_work(len(arm.bodies)), out)
    return out


@kernel
def _hold(arm: Tables, q: Array, dq: Array, tau: Array, work: Record, out: Array) -> None:
    """Write what :func:`link_torques` returns.

    Eq. (14) is linear in the acceleration: tau = bias + M ddq. The active rows give ddq, the
    others are what it takes to hold the rest. Contact with a ball is not in the model.
    """
    bodies, index = arm.bodies, arm.active
    n, links = len(index), len(bodies)
    motion, mass, system = np.zeros((3, n)), np.zeros((links, n)), np.zeros((n, n + 1))
    for t in range(len(tau)):
        if n < links:
            motion[0], motion[1] = q[t], dq[t]
            bias_and_mass(bodies, motion, out[t], mass, work)
            for i in range(n):
                for j in range(n):
                    system[i, j] = mass[index[i], j]
                system[i, n] = tau[t, i] - out[t, index[i]]
            solve_positive(system)
            for k in range(links):
                for j in range(n):
                    out[t, k] += mass[k, j] * system[j, n]
        for i in range(n):
            out[t, index[i]] = tau[t, i]


#: Caught: the ball's centre so near the catch point beyond its radius [m], touched by so many
#: geoms of the hand, so long after first contact [s].
HELD_GAP = 0.020
HELD_GEOMS = 2
HELD_AFTER = 0.5
#: Caught in a basket: the last ticks of that time in which the ball is inside and touched.
LYING = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One trial, field by field as in ``result.json``; what is not known there is null.

    Attributes:
        index: Number of the throw, from 0.
        status: ``caught``; ``dropped``: touched, not caught; ``missed``: never touched;
            ``unreachable``: refused before the arm moved; ``stopped``: a controlled stop for a
            fault; ``aborted``: the physics diverged.
        t_catch_s: From release to q_o,i = q_alpha [s].
        position_error_mm: Distance of ball and catch point at first contact [mm].
        velocity_error_m_s: Difference of their velocities then [m/s].
        peak_torque_ratio: Largest share of each active joint's torque limit; of a drive with a
            torque-speed line tau / tau_stall + omega / omega_0.
        peak_speed_ratio: Largest share of each active joint's speed limit.
        limit_violations: Ticks with a command beyond a limit by more than 1e-9, or the true plant
            by more than 1 %, or with the arm touching itself or the floor; and one for each drive
            whose rms torque exceeds its continuous torque. Acceleration, jerk and torque rate are
            those commanded, where the limit set has them.
        demand_cost: Mean cost (22) of the reference, before any limit.
        peak_contact_force_n: Largest single contact force on the ball [N].
        binding_limit: The limit that the verdict found most used, or what ended the trial.
        saturated_ticks: Ticks in which a torque limit was met.
        range_excess_rad: Largest reference angle beyond a joint's range [rad].
        effort_s: Sum over the drives of the squared share of their largest torque, integrated up
            to the first contact, or to the end without one [s].
        jerk_rad_s3: Root mean square of the commanded jerk while the ball was followed, of the
            joint with the largest [rad/s^3].
        rms_torque_ratio: Share of each drive's continuous torque, as root mean square over the
            trial; 0 where the limit set has none.
        certificate: The verdict before moving: ``outcome``, ``binding_limit``, ``margin``, and
            ``probability`` of a catch where it is computed.
        certificate_last: With ``--adapt refine`` that of the map as it was refined last.
        stopped_by: Why the catcher stopped: ``state``, ``reason``, ``joint`` (whose encoder
            failed), ``t_s``, ``brakes``, and at that tick ``q``, ``dq`` as estimated, ``q_read``,
            ``dq_read`` as read, ``command_q``, ``command_dq``, ``command_ddq``, ``command_tau``.
        over_force: Whether the contacts together, or one of them, are more than hand and arm take;
            None without a contact, or where nothing is known of what they take.
        clock: With ``--learn-clock``: what stamps were corrected by in this throw
            (``offset_s``), what it says of the whole offset (``found_s``, ``sigma_s``), or why
            nothing (``unknown``). Left out of results where it is not learned.
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
    effort_s: float = 0.0
    jerk_rad_s3: float = 0.0
    rms_torque_ratio: list[float] = field(default_factory=list)
    certificate: dict[str, str | float | None] | None = None
    certificate_last: dict[str, str | float | None] | None = None
    stopped_by: dict[str, Plain] | None = None
    over_force: bool | None = None
    clock: dict[str, float | str | None] | None = None


STATUSES: Final = ("caught", "dropped", "missed", "unreachable", "stopped", "aborted")
"""How throws end."""
MAP: Final = "map.json"
"""What the map is called in the folder of a run."""
STATE_AXES: Final = ("x", "y", "z", "vx", "vy", "vz")
"""Parts of position and velocity, as columns are called after them."""

CATCH: Final = ScoredTask(
    name="catch",
    schema="mitt.study/1",
    trial=Trial,
    trials="throws",
    doing="throwing",
    in_result="throws",
    statuses=STATUSES,
    rate="catch_rate",
    counted="balls caught",
    measures={
        "force_n": Measure("contact force [N]", "peak_contact_force_n", 0, percent=95),
    },
    medians={
        "position_error_mm": Measure("position error [mm]", "position_error_mm", 1),
        "velocity_error_m_s": Measure("velocity error [m/s]", "velocity_error_m_s", 2),
        "peak_contact_force_n": Measure("contact force [N]", "peak_contact_force_n", None),
        "energy_j": Measure("work [J]", "energy_j", 0),
        "demand_cost": Measure("cost (22)", "demand_cost", None),
        "peak_torque_ratio": Measure("share of a torque limit", "peak_torque_ratio", None),
        "peak_speed_ratio": Measure("share of a speed limit", "peak_speed_ratio", None),
        "effort_s": Measure("effort [s]", "effort_s", None),
        "jerk_rad_s3": Measure("jerk [rad/s^3]", "jerk_rad_s3", None),
    },
    more=lambda trials: {
        "force_n": spread_of([t.peak_contact_force_n for t in trials]),
        "over_force": sum(t.over_force is True for t in trials),
    },
    keeps=(MAP,),
    extra=("energy_j", *(f"{x}_{axis}" for x in ("release", "passing") for axis in STATE_AXES)),
)
"""The task: ``energy_j`` is the work of the joints, counted positive both ways [J]; ``release`` and
``passing`` are position and velocity [m, m/s] at release, and where the undisturbed ball is nearest
to the waiting hand."""


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


def reason_of(stopped_by: Mapping[str, object] | None) -> str:
    """Return why a throw was stopped, in a few words; nothing where it was not."""
    if stopped_by is None:
        return ""
    joint = stopped_by["joint"]
    return f"{stopped_by['reason']}" + ("" if joint is None else f" {joint}")


def stop_as_json(stopped_by: StoppedBy | None) -> dict[str, Plain] | None:
    """Return why a catcher stopped as it stands in ``result.json``; None where it did not."""
    if stopped_by is None:
        return None
    plain = stopped_by.plain()
    return {"t_s" if name == "t" else name: value for name, value in plain.items()}


def was_held(arm: Arm, world: World) -> bool:
    """Say whether the ball is held at the end of a trial, by the rule for the arm's hand."""
    hand = arm.model.hand
    if hand is not None and hand.loose:
        return lies_in(arm, hand, world.trace())
    return held(world.truth(), world.radius)


def lies_in(arm: Arm, hand: Hand, truth: Trace) -> bool:
    """Say whether the ball lies in a hand: inside at each tick at the end, and touched in them.

    A ball that rolls about in a net touches it now and then.
    """
    rows = slice(-min(LYING, len(truth.t)), None)
    places = zip(truth.q[rows], truth.r_o[rows] - truth.position[rows], strict=True)
    inside = all(hand.contains(arm.orientation(q).T @ away) for q, away in places)
    return inside and bool(np.any(truth.seen[rows] & BALL_HAND))


def held(truth: Truth, radius: float) -> bool:
    """Say whether the ball is held: near the catch point and touched by two geoms or more."""
    gap = float(np.linalg.norm(truth.r_o - truth.position)) - radius
    return gap <= HELD_GAP and len(truth.touching) >= HELD_GEOMS


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Reference and commands of a trial, fields as in :class:`Trial`."""

    peak_torque_ratio: list[float]
    peak_speed_ratio: list[float]
    rms_torque_ratio: list[float]
    limit_violations: int
    demand_cost: float
    range_excess_rad: float
    effort_s: float
    jerk_rad_s3: float
    saturated_ticks: int


def measure(arm: Arm, ticks: Result, truth: Trace) -> Measured:
    """Return what a trial was by the numbers, from k ticks and the k + 1 rows of its truth."""
    drives = drive_loads(arm, truth.q[:-1], truth.dq[:-1], truth.tau[1:])
    bad = ticks_beyond(arm, truth, drives, ticks.command, driven=~ticks.scalars["brakes"])
    rms = continuous_shares(arm, np.sum(drives.torque**2, axis=0), len(drives.torque))
    demanded = demand(arm, ticks.reference[ticks.scalars["following"], :3])
    following = len(demanded.excess) > 0
    touched = np.flatnonzero(truth.seen & BALL_HAND)
    before = slice(0, int(touched[0]) if len(touched) else None)
    return Measured(
        peak_torque_ratio=arm.by_joint(np.max(drives.share, axis=0, initial=0.0)).tolist(),
        peak_speed_ratio=np.max(np.abs(truth.dq) / arm.dq_max, axis=0).tolist(),
        rms_torque_ratio=rms.tolist(),
        limit_violations=int(np.sum(bad)) + overheated(rms),
        demand_cost=demanded.cost if following else 0.0,
        range_excess_rad=float(demanded.excess.max()) if following else 0.0,
        effort_s=TICK * float(np.sum(drives.share[before] ** 2)),
        jerk_rad_s3=_jerk(ticks.command[ticks.scalars["following"], 1]),
        saturated_ticks=int(np.sum(ticks.scalars["saturated"])),
    )


def _jerk(dq: Array) -> float:
    """Return the largest root mean square of the jerk of speeds a tick apart, (k, n).

    Of speeds, not of the accelerations that are sent beside them: those do not show a step of the
    speed.
    """
    if len(dq) < 3:
        return 0.0
    return float(np.max(np.sqrt(np.mean(np.diff(dq, n=2, axis=0) ** 2, axis=0)))) / TICK**2


def ticks_beyond(
    arm: Arm,
    truth: Trace,
    drives: DriveLoads,
    commanded: Array,
    *,
    driven: NDArray[np.bool_],
    before: Array | None = None,
    rounded: float = 1e-6,
) -> NDArray[np.bool_]:
    """Say of each tick whether a limit was exceeded, by a command or by the plant, shape (k,).

    One in which the arm touches itself or the floor counts: its range is where it can be.

    Args:
        arm: The arm.
        truth: True states, whose last k + 1 rows are looked at.
        drives: Loads of the drives by the torques that they gave, k rows.
        commanded: q, dq, ddq, tau and more of each tick, shape (k, ROWS, n); NaN where a command
            does not say them.
        driven: Whether each command is carried out: not once the brakes are engaged, shape (k,).
        before: Command of the tick before the first, where that was carried out as well.
        rounded: Relative error that rounding may bring into a rate.
    """
    k = len(commanded)
    q, dq, given = truth.q[-k - 1 :], truth.dq[-k - 1 :], truth.tau[-k:]
    same = np.all(commanded[:, 3] == given, axis=1)
    bad = drives.over(np.where(same, COMMANDED, MEASURED))
    other = ~same & np.all(np.isfinite(commanded[:, 3]), axis=1)
    loads = drive_loads(arm, q[:-1][other], dq[:-1][other], commanded[other, 3])
    bad[other] |= loads.over(COMMANDED)
    bad |= _beyond(arm, q[1:], dq[1:], MEASURED)
    bad |= _beyond(arm, commanded[:, 0], commanded[:, 1], COMMANDED)
    bad |= _rates_beyond(arm, commanded, driven, before, rounded)
    bad |= truth.seen[-k:] & (SELF | ARM_FLOOR) != 0
    return bad


def continuous_shares(arm: Arm, squares: Array, ticks: int) -> Array:
    """Return how much of its continuous torque each drive used, as root mean square.

    ``squares`` is the sum of the squares of each drive's torque over some ticks [N^2 m^2].
    """
    shares: Array = np.sqrt(squares / max(ticks, 1)) / arm.limits.tau_rms
    return shares


def overheated(shares: Array) -> int:
    """Return how many drives went beyond their continuous torque."""
    return int(np.sum(shares > 1.0 + MEASURED))


def _beyond(arm: Arm, q: Array, dq: Array, slack: float) -> NDArray[np.bool_]:
    """Say of each tick whether positions or speeds exceed their limits by a share."""
    span = slack * (arm.q_max - arm.q_min)
    out = (q < arm.q_min - span) | (q > arm.q_max + span) | (abs(dq) > arm.dq_max * (1.0 + slack))
    return np.asarray(np.any(out, axis=1))


def _rates_beyond(
    arm: Arm, commanded: Array, driven: NDArray[np.bool_], before: Array | None, rounded: float
) -> NDArray[np.bool_]:
    """Say of each tick whether the command's acceleration, jerk or torque rate exceeds its limit.

    Jerk and torque rate are those from the tick before, a tick apart. Args as of
    :func:`ticks_beyond`.
    """
    limits, out = arm.limits, np.zeros(len(commanded), dtype=np.bool_)
    slack = 1.0 + rounded
    if limits.acceleration is not None:
        most = arm.active(limits.acceleration)
        out |= driven & np.any(np.abs(commanded[:, 2]) > most * slack, axis=1)
    both = driven & np.concatenate([[before is not None], driven[:-1]])
    rows = commanded if before is None else np.concatenate([before[None], commanded])
    for row, bound in ((2, limits.jerk), (3, limits.torque_rate)):
        if bound is not None:
            rate = np.abs(np.diff(rows[:, row], axis=0)) / TICK
            over = np.any(rate > arm.active(bound) * slack, axis=1)
            out |= both & (over if before is not None else np.concatenate([[False], over]))
    return out


def trial_status(world: World, phase: Phase, *, refused: bool, was_held: bool) -> str:
    """Return the status of a finished trial.

    Args:
        world: The world at its end.
        phase: What the catcher was about then.
        refused: Whether it refused the flight, as ``Catcher.refused``.
        was_held: Whether the ball is held.
    """
    if world.diverged:
        return "aborted"
    if phase is Phase.STOPPED:
        return "stopped"
    if refused:
        return "unreachable"
    if world.first_contact is None:
        return "missed"
    return "caught" if was_held else "dropped"
