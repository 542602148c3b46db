"""The figures of the report with their captions, and the replay."""

from typing import TYPE_CHECKING

import numpy as np

from mitt.signals import Array
from mitt.study import page
from mitt.study.figures.learning import (
    feedback_by_step,
    feedback_pair,
    feedback_share,
    learning_cost,
)
from mitt.study.figures.pictures import Picture, picture_strip
from mitt.study.figures.response import joint_angles, joint_torques, target_and_hand
from mitt.study.figures.style import Plot
from mitt.study.figures.throws import contact_errors, releases
from mitt.study.figures.trajectory import catching_trajectory
from mitt.study.log import TrialLog
from mitt.study.replay import replay_page

if TYPE_CHECKING:
    from mitt.study.report import ReportContent

_LEARNING = (
    "Means over all flights that were learned from and over their instants, eq. (22), each torque "
    "and speed as a share of its limit. The open point is &alpha; = 0, which need not start where "
    "the arm is; from step 1 on every flight starts in the arm&rsquo;s pose, eq. (12), which may "
    "cost more than &alpha; = 0 before it costs less."
)
_TRAJECTORY = (
    "Points each millisecond, the arm each 50 ms, darker as time goes on, until 0.1 s after the "
    "catch. The ball comes from the right. Look at the last stretch: the hand swings into the "
    "ball&rsquo;s way along its tangent and moves on with it."
)
_TRAJECTORY_PLAIN = (
    " With &alpha; = 0 the arm starts somewhere else than the map asks and hurries after it."
)
_RESPONSE = (
    "True ball (broad), the catcher&rsquo;s estimate of it, the catch point that the map asks for, "
    "l(q<sub>d</sub>), and where the hand truly was. Right: the 0.1 s around the catch, in which "
    "position and slope of hand and ball must come together, eq. (3)."
)
_ANGLES = (
    "Dotted: learned map, as the encoders read it; the shaded band is the joint&rsquo;s range."
)
_ANGLES_PLAIN = (
    " Solid, as in the paper: &alpha; = 0. The thin line is what the map with &alpha; = 0 asks for "
    "before anything is clipped; where it leaves the band, the arm could not follow if it would."
)
_TORQUES = (
    "Dotted: learned map. The shaded band is the torque limit, eq. (18), at which commands are cut "
    "off. After the catch the arm brakes with the ball in the hand."
)
_TORQUES_PLAIN = (
    " Solid: &alpha; = 0. The thin line is the torque that the motion it asks for would take by "
    "itself, eq. (16); most of what the solid line adds is feedback."
)
_PICTURES = (
    "Drawn in software from the simulated states, a picture every 33 ms, the one at the catch "
    "framed. Small dots trail the ball by 8 ms each."
)
_FEEDBACK = (
    "Root mean square of the commanded torque less the feedforward over that of the whole, while "
    "the ball is followed. The paper (section 3.6) expects the controller&rsquo;s load to fall as "
    "the map nears its optimum."
)
_ERRORS = (
    "Distance of the ball&rsquo;s centre from the catch point, and difference of their velocities, "
    "in the first simulation step in which ball and hand touch. A mark below the bars is a throw."
)
_RELEASES = "Where each ball left the thrower, by what became of it. The arm stands at the origin."
_REPLAY = (
    "Plays five times slower than life. Drag to turn, scroll to come nearer; the bar below stops, "
    "scrubs and sets the speed. Blue: the way of the catch point; small dots: the ball&rsquo;s."
)


def figures(content: "ReportContent") -> str:
    """Return all figures for which there are data."""
    out = [] if content.steps is None else [
        _shown(learning_cost(content.steps), "Fig. 7 \u00b7 Costs over learning", _LEARNING)
    ]  # fmt: skip
    out += _of_throw(content)
    trials = content.result["trials"]
    out.append(_shown(contact_errors(trials), "Errors at first contact, all throws", _ERRORS))
    if content.releases is not None and len(trials):
        at = None if content.direct is None else _catch_point(content.direct.log)
        drawn = releases(trials, content.releases[: len(trials)], at)
        out.append(_shown(drawn, "Releases, all throws", _RELEASES))
    return "\n".join(out)


def _of_throw(content: "ReportContent") -> list[str]:
    """Return the figures of the one throw: 8 to 12, and the share of feedback."""
    learned = None if content.direct is None else content.direct.log
    plain = None if content.unoptimised is None else content.unoptimised.log
    if learned is None:
        return []
    arm, paired = content.arm, plain is not None
    out = [
        _shown(catching_trajectory(arm, learned, plain), "Fig. 8 \u00b7 Catching trajectory",
               _TRAJECTORY + _TRAJECTORY_PLAIN * paired),
        _shown(target_and_hand(arm, learned), "Fig. 9 \u00b7 Target and hand over time", _RESPONSE),
        _shown(joint_angles(arm, learned, plain), "Fig. 10 \u00b7 Joint angles",
               _ANGLES + _ANGLES_PLAIN * paired),
        _shown(joint_torques(arm, learned, plain), "Fig. 11 \u00b7 Command torques",
               _TORQUES + _TORQUES_PLAIN * paired),
    ]  # fmt: skip
    if content.pictures:
        strip = _strip(picture_strip(arm, content.scene, learned))
        title = "Fig. 12 \u00b7 The throw in pictures"
        out.append(page.figure("fig12", strip, title=title, caption=_PICTURES))
    drawn = _feedback(content.shares, learned, plain)
    if drawn is not None:
        out.append(_shown(drawn, "Share of feedback in the torque", _FEEDBACK))
    return out


def _feedback(
    shares: tuple[float, ...] | None, learned: TrialLog, plain: TrialLog | None
) -> Plot | None:
    """Return the drawing of the share of feedback, over learning where that is known."""
    if shares:
        return feedback_by_step(shares)
    if plain is None:
        return None
    return feedback_pair(feedback_share(plain), feedback_share(learned))


def _shown(drawn: Plot, title: str, caption: str) -> str:
    """Return a drawing as a figure."""
    return page.figure(drawn.name, page.plotted(drawn.svg), title=title, caption=caption)


def _strip(pictures: tuple[Picture, ...]) -> str:
    """Return the pictures in rows, each with its time."""
    cells = []
    for shot in pictures:
        when = f"{1e3 * shot.t:.0f} ms" + (" \u00b7 catch" if shot.catch else "")
        mark = ' class="now"' if shot.catch else ""
        cells.append(f"<div{mark}>{page.image(shot.png, text=when)}<span>{when}</span></div>")
    return f'<div class="strip">{"".join(cells)}</div>'


def _catch_point(log: TrialLog | None) -> Array | None:
    """Return where the hand was at the catch [m], shape (3,); None without a catch."""
    if log is None or not np.isfinite(log.t_catch):
        return None
    at: Array = log.truth.position[int(np.argmin(np.abs(log.truth.t - log.t_catch)))]
    return at


def replay(content: "ReportContent") -> str:
    """Return the replay of the one throw; nothing where there is no log or none is wanted."""
    if not content.replay or content.direct is None or content.direct.log is None:
        return ""
    document = replay_page(content.arm, content.scene, content.direct.log)
    html = page.frame(document, title="3-D replay of one throw")
    return page.figure("replay-3d", html, title="The throw of the figures", caption=_REPLAY)
