"""What the page of a run shows of catching alone: the paper's figures, a replay, Table 1."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.arm.description import Hand
from mitt.core.arm.hands import HandModel
from mitt.core.eyes.camera import fixed_rig
from mitt.core.map.learn import Step
from mitt.core.signals import TICK, Array
from mitt.lab.report.page import NONE, OwnPicture, Replay, Strip
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
from mitt.lab.report.run_page import Blocks, spread_card
from mitt.lab.report.style import ALPHA_0, Plot
from mitt.lab.trials.explain import words_of_limit
from mitt.lab.trials.log import TrialLog
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.runs import Prepared, ThrownBalls, make_runner
from mitt.lab.trials.score import CATCH, Trial
from mitt.lab.trials.scored_task import Measure, Row
from mitt.lab.trials.source import release_of
from mitt.lab.trials.task_run import FinishedRun
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


#: A throw with fewer ticks has nothing to draw.
_FEWEST_TICKS: Final = 50
#: Generators that are the map.
_OF_THE_MAP: Final = ("direct", "single", "unoptimised")
_COST: Final = Measure("demand cost, eq. (22)", "demand_cost", 2, percent=95)
_REPLAY: Final = (
    "Plays five times slower than life. Drag to turn, scroll to come nearer; the bar below stops, "
    "scrubs and sets the speed. Blue: the path of the catch point; small dots: the ball\u2019s."
)
_LEARNING: Final = (
    "Means over all flights that were learned from and over their instants, eq. (22), each torque "
    "and speed as a share of its limit. The open point is \u03b1 = 0, which need not start where "
    "the arm is; from step 1 on every flight starts in the arm\u2019s pose, eq. (12), which may "
    "cost more than \u03b1 = 0 before it costs less."
)
#: Words below a figure, and what they say besides where alpha = 0 is drawn beside it.
_TRAJECTORY: Final = (
    "Points each millisecond, the arm each 50 ms, darker as time goes on, until 0.1 s after the "
    "catch. The ball comes from the right. In the last stretch the hand swings into the "
    "ball\u2019s path along its tangent and moves on with it.",
    "With \u03b1 = 0 the arm does not start where the map commands it, and has to catch up.",
)
_TARGET: Final = (
    "True ball (broad), the catcher\u2019s estimate of it, the catch point that the map commands, "
    "l(q_d), and where the hand truly was. Right: the 0.1 s around the catch, in which position "
    "and slope of hand and ball must come together, eq. (3)."
)
_ANGLES: Final = (
    "Dotted: learned map, as the encoders read it; the shaded band is the joint\u2019s range.",
    "Solid, as in the paper: \u03b1 = 0. The thin line is what the map with \u03b1 = 0 commands "
    "before anything is clipped; where it leaves the band, the arm cannot follow.",
)
_TORQUES: Final = (
    "Dotted: learned map. The shaded band is the torque limit, eq. (18), at which commands are cut "
    "off. After the catch the arm brakes with the ball in the hand.",
    "Solid: \u03b1 = 0. The thin line is the torque that the commanded motion takes by itself, "
    "eq. (16); most of what the solid line adds is feedback.",
)
_STRIP: Final = (
    "Drawn in software from the simulated states, a picture every 33 ms, the one at the catch "
    "framed. Small dots trail the ball by 8 ms each."
)
_ERRORS: Final = (
    "Distance of the ball\u2019s centre from the catch point, and difference of their velocities, "
    "in the first simulation step in which ball and hand touch, which fingers do before the ball "
    "is at the catch point. A mark is a throw."
)
_RELEASES: Final = (
    "Where each ball left the thrower, by what became of it. The arm stands at the origin."
)


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CatchShown:
    """What is shown of a run of throws; what is None or empty is left out of the page.

    Attributes:
        arm: The arm of the run.
        scene: The world's settings of the run.
        steps: Costs over the steps of learning; None where the map brought none with it.
        direct: One throw with the generator of the run, with its log.
        unoptimised: The same throw with alpha = 0, with its log.
        releases: Ball centre at the release of each trial [m], shape (trials, 3).
    """

    arm: Arm
    scene: Scene
    steps: tuple[Step, ...] | None = None
    direct: LoggedTrial | None = None
    unoptimised: LoggedTrial | None = None
    releases: Array | None = None


def catch_blocks(finished: FinishedRun, result: dict[str, Any]) -> Blocks:
    """Return what the page of a run of throws shows; alpha = 0 is thrown beside it."""
    prepared, throws = finished.run, finished.runner
    if not isinstance(prepared, Prepared) or not isinstance(throws, ThrownBalls):
        raise TypeError("a run of throws has a page of throws")
    learned, generator = throws.learned, prepared.settings.generator
    plain = None
    if generator != "unoptimised":
        plain = _shown(make_runner(prepared, learned, generator="unoptimised"), prepared)
    balls = [prepared.source.ball(trial.index) for trial in finished.trials]
    shown = CatchShown(
        arm=prepared.arm,
        scene=prepared.scene,
        steps=learned.steps if len(learned.maps) > 1 else None,
        direct=_shown(make_runner(prepared, learned, generator=generator), prepared),
        unoptimised=plain,
        releases=np.array([release_of(ball) for ball in balls]),
    )
    return blocks_of_catches(result, shown)


def _shown(runner: TrialRunner, prepared: Prepared) -> LoggedTrial | None:
    """Return the first throw with its log; None where it ended before it began."""
    outcome = runner.throw(prepared.source, 0, log=True)
    return outcome if outcome.log is not None and len(outcome.log.t) >= _FEWEST_TICKS else None


def blocks_of_catches(result: dict[str, Any], shown: CatchShown) -> Blocks:
    """Return what the page shows of throws, of what has been collected for it."""
    log = None if shown.direct is None else shown.direct.log
    return Blocks(
        is_=_what_it_is(result),
        shown="" if shown.direct is None else _what_happened(shown.direct.trial),
        lead=[*_clock_words(result), _contact_words(result["trials"]), *_map_words(shown)],
        cards=[spread_card(_COST, result["trials"])],
        failures="Domain and time mean that the map has no value for the flight, or that no "
        "verdict came in time. A throw that was stopped has the reason, and the joint whose "
        "encoder it was; result.json says what the catcher estimated, read and commanded then.",
        pictures=_pictures(result["trials"], shown),
        system=table_1(shown.arm, log, vision=str(result["vision"])),
    )


def _what_it_is(result: dict[str, Any]) -> str:
    """Return what is seen and what moves the arm."""
    seen = "two cameras see" if result["vision"] == "pixels" else "points with noise tell of"
    by = str(result["generator"])
    moves = (
        "a learned map turns that straight into motion of the joints"
        if by in _OF_THE_MAP
        else f"{by}, a method that the map is compared with, moves the arm"
    )
    is_to = f"An arm ({result['arm']}) is to catch balls that are thrown at it"
    return f"{is_to}: {seen} the ball, and {moves}."


def _what_happened(trial: Trial) -> str:
    """Return what became of a throw, in a sentence."""
    if trial.status != CATCH.success:
        limit = trial.binding_limit
        why = f": {words_of_limit(limit)}" if limit and trial.status == "unreachable" else ""
        return f"The ball was {trial.status}{why}."
    after = f" {trial.t_catch_s:.2f} s after it was thrown" if trial.t_catch_s else ""
    near = trial.position_error_mm
    where = "" if near is None else f", which it touched {near:.0f} mm from the middle of the grip"
    return f"The ball was caught{after}: the hand moved along with it{where}, and closed."


def _clock_words(result: dict[str, Any]) -> list[str]:
    """Return what was learned of the clock of the eyes."""
    clock = result.get("clock")
    if not clock or not clock["catches"]:
        return []
    older = "older" if clock["offset_s"] < 0 else "newer"
    return [
        f"The clock of the eyes is off by {1e3 * clock['offset_s']:.1f} ms "
        f"({1e3 * clock['sigma_s']:.1f} ms sigma, from {clock['catches']} catches): what they see "
        f"is {older} than its stamps say. Each throw was corrected by the catches before it."
    ]


def _contact_words(trials: Sequence[Row]) -> str:
    """Return how near ball and hand were, and how fast, when they first touched."""
    touched = [t for t in trials if t["position_error_mm"] is not None]
    if not touched:
        return "No ball touched the hand."
    (mm, most), (v, fastest) = (
        np.percentile([t[name] for t in touched], [50.0, 95.0])
        for name in ("position_error_mm", "velocity_error_m_s")
    )
    return (
        f"When a ball first touched the hand, its centre was {mm:.1f} mm from the catch point and "
        f"{v:.2f} m/s off the hand\u2019s own velocity (medians; 95 % of the throws stayed below "
        f"{most:.1f} mm and {fastest:.2f} m/s)."
    )


def _map_words(shown: CatchShown) -> list[str]:
    """Return what the learned map does otherwise than alpha = 0 in the throw that is drawn."""
    one, other = shown.direct, shown.unoptimised
    if one is None or other is None or one.log is None or other.log is None:
        return []
    a, b = one.trial, other.trial
    return [
        f"The throw that the figures show was {a.status} with the learned map, its demand cost "
        f"{a.demand_cost:.2f}. With {ALPHA_0} the same throw was {b.status} at a cost of "
        f"{b.demand_cost:.2f}, with a torque limit met in {b.saturated_ticks} ms (learned: "
        f"{a.saturated_ticks} ms) and joint angles commanded up to {b.range_excess_rad:.2f} rad "
        f"out of range. Feedback made up {100 * feedback_share(one.log):.0f} % of the torque "
        f"instead of {100 * feedback_share(other.log):.0f} %."
    ]


def _pictures(trials: Sequence[dict[str, Any]], shown: CatchShown) -> list[OwnPicture]:
    """Return all pictures for which there are data."""
    log, plain = (None if x is None else x.log for x in (shown.direct, shown.unoptimised))
    out = []
    if shown.steps is not None:
        out.append(
            _figure("Fig. 7 \u00b7 Costs over learning", learning_cost(shown.steps), _LEARNING)
        )
    caught_at = None
    if log is not None:
        out += _of_one_throw(shown.arm, shown.scene, log, plain)
        if np.isfinite(log.t_catch):
            caught_at = log.truth.position[int(np.argmin(np.abs(log.truth.t - log.t_catch)))]
    out.append(_figure("Errors at first contact, all throws", contact_errors(trials), _ERRORS))
    if shown.releases is not None and len(trials):
        drawn = releases(trials, shown.releases[: len(trials)], caught_at)
        out.append(_figure("Releases, all throws", drawn, _RELEASES))
    return out


def _figure(title: str, drawing: Plot | Strip, words: str) -> OwnPicture:
    """Return a picture of the section of figures."""
    return OwnPicture("figures", title, words, drawing)


def _of_one_throw(
    arm: Arm, scene: Scene, log: TrialLog, plain: TrialLog | None
) -> list[OwnPicture]:
    """Return the replay of a throw, and figs. 8 to 12."""
    replay = Replay("replay-3d", replay_page(arm, scene, log), still(arm, scene, log, BOX))
    trajectory, angles, torques = (
        words if plain is None else f"{words} {beside}"
        for words, beside in (_TRAJECTORY, _ANGLES, _TORQUES)
    )
    strip = picture_strip("fig12", arm, scene, log)
    return [
        OwnPicture("replay", "A throw in 3-D, that of the figures", _REPLAY, replay),
        _figure(
            "Fig. 8 \u00b7 Catching trajectory", catching_trajectory(arm, log, plain), trajectory
        ),
        _figure("Fig. 9 \u00b7 Target and hand over time", target_and_hand(arm, log), _TARGET),
        _figure("Fig. 10 \u00b7 Joint angles", joint_angles(arm, log, plain), angles),
        _figure("Fig. 11 \u00b7 Command torques", joint_torques(arm, log, plain), torques),
        _figure("Fig. 12 \u00b7 The throw in pictures", strip, _STRIP),
    ]
