"""The page that a run leaves behind: one file that opens anywhere and loads nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.arm.description import Hand
from mitt.core.arm.hands import HandModel
from mitt.core.eyes.camera import fixed_rig
from mitt.core.map.learn import Step
from mitt.core.signals import TICK, Array
from mitt.io.writing import write_text
from mitt.lab.report.page import NONE, Section, made_with, page, shown_number
from mitt.lab.report.pictures import picture_strip, still
from mitt.lab.report.replay_3d import BOX, replay_page
from mitt.lab.report.run_figures import (
    catching_trajectory,
    contact_errors,
    feedback_share,
    joint_angles,
    joint_torques,
    learning_cost,
    releases,
    target_and_hand,
)
from mitt.lab.report.style import STATUS, Plot
from mitt.lab.trials.log import TrialLog
from mitt.lab.trials.runner import LoggedTrial
from mitt.lab.trials.score import STATUSES, reason_of
from mitt.lab.trials.statistics import spread_of
from mitt.lab.world.scene import Scene

#: Width of the window over which the hand's acceleration is averaged [ticks].
_WINDOW = 5
_BY = "\u00d7"


Table1Row = tuple[str, str, str, str]
"""One line of the table: part, property, the paper's figure, ours."""


def table_1(arm: Arm, log: TrialLog | None, *, vision: str) -> tuple[Table1Row, ...]:
    """Return Table 1, the paper's figures beside ours.

    The log is of a throw, for what the arm reached in it; vision is ``pixels`` or ``points``.
    """
    return (*_vision_rows(vision), *_arm_rows(arm, log), *_hand_rows(arm.model.hand, log))


def _vision_rows(vision: str) -> tuple[Table1Row, ...]:
    """Return the lines on vision."""
    cameras = fixed_rig().cameras
    width, height = cameras[0].width, cameras[0].height
    pixels = vision == "pixels"
    return (
        ("Vision", "heads", f"2 {_BY} 2 DOF (pan, tilt)", f"{len(cameras)}, fixed"),
        ("Vision", "speed of a joint", "525 rad/s (so printed)", f"{NONE} (fixed)"),
        (
            "Vision",
            "resolution",
            f"128 {_BY} 128",
            f"{width} {_BY} {height}" if pixels else "points instead of images",
        ),
        ("Vision", "density", "8 bit", "8 bit" if pixels else NONE),
        ("Vision", "rate", "1 kHz", f"{1e-3 / TICK:.0f} kHz"),
    )


def _arm_rows(arm: Arm, log: TrialLog | None) -> tuple[Table1Row, ...]:
    """Return the lines on the arm."""
    held = len(arm.model.links) - arm.n
    used = f"{len(arm.model.links)}, of which {arm.n} used" if held else f"{arm.n}"
    speed, acceleration = NONE, NONE
    if log is not None and log.following.any():
        v, a = _reached(log)
        speed, acceleration = f"{v:.1f} m/s reached", f"{a:.0f} m/s² reached"
    return (
        ("Arm", "degrees of freedom", "4 (axis 3 held)", used),
        ("Arm", "speed of the tip, at most", "6 m/s", speed),
        ("Arm", "acceleration of the tip, at most", "30 m/s²", acceleration),
        ("Arm", "force of the tip", "26 N, at most", f"{_force(arm):.0f} N in any direction"),
        ("Arm", "length, upright, to the tool plate", "0.9 m", f"{_length(arm):.2f} m"),
        ("Arm", "torque limits", NONE, _listed(arm.tau_max, "N m", arm.limits.name)),
        ("Arm", "speed limits", NONE, _listed(arm.dq_max, "rad/s", arm.limits.name)),
    )


def _hand_rows(hand: Hand | None, log: TrialLog | None) -> tuple[Table1Row, ...]:
    """Return the lines on the hand."""
    if hand is None:
        return (("Hand", "fingers", "3, with 3 DOF", "none"),)
    if isinstance(hand, Basket):
        size = f"none: a basket, opening {2e3 * hand.ring_radius:.0f} mm, depth"
        return (("Hand", "fingers", "3, with 3 DOF", f"{size} {1e3 * hand.depth:.0f} mm"),)
    if not isinstance(hand, HandModel):
        return ()
    length = hand.finger.proximal + hand.finger.distal
    return (
        ("Hand", "fingers", "3, with 3 DOF", f"{hand.fingers}, with {hand.fingers} DOF"),
        ("Hand", "closing", "90° in 20 ms", _closing(log, hand)),
        ("Hand", "length of a finger", "0.1 m", f"{length:.1f} m"),
    )


def _listed(values: np.ndarray, unit: str, limits: str) -> str:
    """Return the limits of all joints with the name of their set."""
    return f"{', '.join(f'{x:.3g}' for x in values)} {unit} (set {limits})"


def _reached(log: TrialLog) -> tuple[float, float]:
    """Return the greatest speed [m/s] and acceleration [m/s^2] of the catch point on the way."""
    trace = log.truth
    way = (trace.t >= log.t_0) & (trace.t <= min(log.t_catch, trace.t[-1]))
    velocity = trace.velocity[way]
    if len(velocity) <= _WINDOW:
        return 0.0, 0.0
    change = (velocity[_WINDOW:] - velocity[:-_WINDOW]) / (_WINDOW * TICK)
    speed = np.linalg.norm(velocity, axis=1).max()
    return float(speed), float(np.linalg.norm(change, axis=1).max())


def _force(arm: Arm) -> float:
    """Return the force that the arm at rest can exert in any direction, in its ready pose [N].

    Joint j bears f J_j' u for a force f in direction u; worst where u lies along J_j.
    """
    q = arm.q_ready
    spare = arm.tau_max - np.abs(arm.inverse_dynamics(q, np.zeros(arm.n), np.zeros(arm.n)))
    levers = np.linalg.norm(arm.jacobian(q), axis=0)
    return float(np.min(spare / np.maximum(levers, 1e-9)))


def _length(arm: Arm) -> float:
    """Return the distance of the tool plate from the base at joint angles zero [m]."""
    offset = 0.0 if arm.model.hand is None else arm.model.hand.catch_offset
    upright = np.clip(np.zeros(arm.n), arm.q_min, arm.q_max)
    plate = arm.position(upright) - offset * arm.orientation(upright)[:, 2]
    return float(np.linalg.norm(plate - arm.model.mount[:3, 3]))


def _closing(log: TrialLog | None, hand: HandModel) -> str:
    """Return how far and how fast the fingers closed in the throw, to first touch."""
    if log is None or not (log.hand > 0.0).any() or not (log.truth.force > 0.0).any():
        return NONE
    trace = log.truth
    n = trace.tau.shape[1]
    fingers = trace.qpos[:, n : n + hand.fingers].mean(axis=1)
    start = float(log.t[np.flatnonzero(log.hand > 0.0)[0]])
    settled = np.flatnonzero((trace.t > start) & (fingers >= 0.95 * fingers.max()))[0]
    angle, took = np.rad2deg(fingers[settled]), 1e3 * (trace.t[settled] - start)
    return f"{angle:.0f}° in {took:.0f} ms, around the ball"


_SECTIONS = (
    Section("summary", "Summary", "What happened"),
    Section("failures", "Failures", "Throws that failed"),
    Section("replay", "3-D replay", "One throw in 3-D"),
    Section("figures", "Figures", "Figures, by the paper's numbers"),
    Section("table_1", "Table 1", "The system beside the paper's Table 1"),
    Section("trials", "All throws", "All throws"),
    Section("repeat", "Repeat", "How to repeat it"),
)
#: What became of throws that were not caught, in words.
_FAILED = {
    "dropped": "it dropped",
    "missed": "it missed",
    "unreachable": "it refused before moving",
    "stopped": "ended in a stop",
    "aborted": "ended with physics that diverged",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportContent:
    """What a report is made from; what is None or empty is left out of the page.

    Attributes:
        result: The result, ``mitt.catch/1``.
        arm: The arm of the run.
        scene: The world's settings of the run.
        steps: Costs over the steps of learning; None where the map brought none with it.
        direct: One throw with the generator of the run, with its log.
        unoptimised: The same throw with alpha = 0, with its log.
        command: The command that made the run, as one types it; empty where none did.
        releases: Ball centre at the release of each trial [m], shape (trials, 3).
    """

    result: dict[str, Any]
    arm: Arm
    scene: Scene
    steps: tuple[Step, ...] | None = None
    direct: LoggedTrial | None = None
    unoptimised: LoggedTrial | None = None
    command: str = ""
    releases: Array | None = None


def write_report(path: Path, content: ReportContent) -> None:
    """Write the page whole or not at all.

    Raises:
        FileError: The file cannot be written.
    """
    write_text(path, report(content))


def report(content: ReportContent) -> str:
    """Return the page."""
    result, arm, scene = content.result, content.arm, content.scene
    log, plain = (
        None if outcome is None else outcome.log
        for outcome in (content.direct, content.unoptimised)
    )
    short = result_summary(result)
    counts, throws = short["counts"], short["throws"]
    failed = ", ".join(f"{counts[s]} {words}" for s, words in _FAILED.items() if counts[s])
    return page(
        "run",
        _SECTIONS,
        title=f"{counts['caught']} of {throws} {'ball' if throws == 1 else 'balls'} caught",
        command="catch",
        result=result,
        short=short,
        typed=content.command,
        made_with=made_with(),
        failed_words=f"; {failed}" if failed else "",
        failed_counts=", ".join(f"{counts[s]} {s}" for s in STATUSES[1:]),
        failed=[t for t in result["trials"] if t["status"] != "caught"],
        direct=content.direct if log else None,
        plain=content.unoptimised if plain else None,
        feedback_share=feedback_share,
        colour={status: colour for status, (colour, _) in STATUS.items()},
        rows_of=_trial_rows,
        replay=None if log is None else replay_page(arm, scene, log),
        still=None if log is None else still(arm, scene, log, BOX),
        drawn={plot.name: plot.svg for plot in _plots(content, log, plain)},
        strip=None if log is None else picture_strip(arm, scene, log),
        system=table_1(arm, log, vision=str(result["vision"])),
    )


def result_summary(result: dict[str, Any]) -> dict[str, Any]:
    """Return what people ask first of a result: its summary, counts and spreads over the throws.

    A spread is the median, the 95th percentile and the largest of a figure over the throws that
    have it, or None where none has: ``position_mm`` and ``velocity_m_s`` at first contact,
    ``force_n``, ``cost`` (eq. (22)).
    """
    summary, trials = result["summary"], result["trials"]
    violations = [int(t["limit_violations"]) for t in trials]
    return {
        **summary,
        "counts": {status: int(summary[status]) for status in STATUSES},
        "position_mm": _spread(trials, "position_error_mm"),
        "velocity_m_s": _spread(trials, "velocity_error_m_s"),
        "force_n": _spread(trials, "peak_contact_force_n"),
        "cost": _spread(trials, "demand_cost"),
        "violating_throws": sum(v > 0 for v in violations),
        "violations": sum(violations),
        "over_force": sum(t.get("over_force") is True for t in trials),
    }


def _spread(trials: Sequence[dict[str, Any]], key: str) -> dict[str, float] | None:
    """Return the spread of a field; None where no trial has it."""
    values = [float(t[key]) for t in trials if t[key] is not None]
    spread = spread_of(values)
    return None if spread is None else {**spread, "most": max(values)}


def _trial_rows(trials: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of the table a trial."""
    return [
        (
            str(t["index"]),
            str(t["status"]),
            str(t["binding_limit"] or NONE),
            reason_of(t.get("stopped_by")) or NONE,
            shown_number(t["position_error_mm"], 1),
            shown_number(t["velocity_error_m_s"], 2),
            shown_number(t["peak_contact_force_n"], 0),
            str(t["limit_violations"]),
        )
        for t in trials
    ]


def _plots(content: ReportContent, log: TrialLog | None, plain: TrialLog | None) -> list[Plot]:
    """Return all drawings for which there are data."""
    arm, trials = content.arm, content.result["trials"]
    out, caught_at = [], None
    if content.steps is not None:
        out.append(learning_cost(content.steps))
    if log is not None:
        out += [
            catching_trajectory(arm, log, plain),
            target_and_hand(arm, log),
            joint_angles(arm, log, plain),
            joint_torques(arm, log, plain),
        ]
        if np.isfinite(log.t_catch):
            caught_at = log.truth.position[int(np.argmin(np.abs(log.truth.t - log.t_catch)))]
    out.append(contact_errors(trials))
    if content.releases is not None and len(trials):
        out.append(releases(trials, content.releases[: len(trials)], caught_at))
    return out
