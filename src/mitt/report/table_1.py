"""Table 1 of the paper beside the system simulated here."""

import numpy as np

from mitt.report.page import NONE
from mitt.robot.arm import Arm
from mitt.robot.basket import Basket
from mitt.robot.description import Hand
from mitt.robot.hands import HandModel
from mitt.signals import TICK
from mitt.trials.log import TrialLog
from mitt.vision.camera import fixed_rig

#: Width of the window over which the hand's acceleration is averaged [ticks].
_WINDOW = 5
_BY = "\u00d7"


Row = tuple[str, str, str, str]
"""One line of the table: part, property, the paper's figure, ours."""


def table_1(arm: Arm, log: TrialLog | None, *, vision: str) -> tuple[Row, ...]:
    """Return Table 1, the paper's figures beside ours.

    Args:
        arm: The arm with its limit set.
        log: Log of a throw, for what the arm reached in it.
        vision: ``pixels`` or ``points``.
    """
    return (*_vision_rows(vision), *_arm_rows(arm, log), *_hand_rows(arm.model.hand, log))


def _vision_rows(vision: str) -> tuple[Row, ...]:
    """Return the lines on vision."""
    cameras = fixed_rig().cameras
    width, height = cameras[0].width, cameras[0].height
    pixels = vision == "pixels"
    return (
        ("Vision", "heads", f"2 {_BY} 2 DOF (pan, tilt)", f"{len(cameras)}, fixed"),
        ("Vision", "speed of a joint", "525 rad/s (so printed)", f"{NONE} (fixed)"),
        ("Vision", "resolution", f"128 {_BY} 128",
            f"{width} {_BY} {height}" if pixels else "points instead of images"),
        ("Vision", "density", "8 bit", "8 bit" if pixels else NONE),
        ("Vision", "rate", "1 kHz", f"{1e-3 / TICK:.0f} kHz"),
    )  # fmt: skip


def _arm_rows(arm: Arm, log: TrialLog | None) -> tuple[Row, ...]:
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


def _hand_rows(hand: Hand | None, log: TrialLog | None) -> tuple[Row, ...]:
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
