"""The page that ``mitt design`` leaves behind: what the arm can catch, and what would help."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from mitt.core.arm.arm import Arm
from mitt.core.signals import Array
from mitt.io.writing import write_text
from mitt.lab.design.arm_design import AtSpeed, Design, Region, softer
from mitt.lab.design.evaluation import Evaluation
from mitt.lab.design.interception import FasterJoint, faster_joints, longer_arm
from mitt.lab.report.page import Section, made_with, page, shown_number
from mitt.lab.report.painter import SIDE, painted, png_of, seen_from
from mitt.lab.report.pictures import body_faces, placed_faces
from mitt.lab.report.style import BLUE, GREEN, GREY, INK, ORANGE, PALE, PURPLE, YELLOW, Plot, plot
from mitt.lab.trials.statistics import wilson
from mitt.lab.world.build import build_scene
from mitt.lab.world.scene import Scene

#: Colours of the limits that bind most of the balls out of reach; all others are grey.
_LIMITS = (ORANGE, YELLOW, GREEN, PURPLE, GREY)


def rate_by_speed(rows: Sequence[AtSpeed]) -> Plot:
    """Draw the share caught within every limit against the speed of the throws, and why not."""
    speed = np.array([row.speed_m_s for row in rows])
    rate = np.array([row.feasible / max(row.throws, 1) for row in rows])
    ends = np.array([wilson(row.feasible, max(row.throws, 1)) for row in rows])

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.fill_between(speed, 100.0 * ends[:, 0], 100.0 * ends[:, 1], color=BLUE, alpha=0.15)
        axes.plot(speed, 100.0 * rate, "o-", color=BLUE)
        for row, share in zip(rows, rate, strict=True):
            name = "" if row.binding_limit is None else row.binding_limit.replace(":", "\n")
            axes.annotate(
                name if share < 1.0 else "",
                (row.speed_m_s, 100.0 * share),
                (0, 7),
                textcoords="offset points",
                ha="center",
                color=GREY,
                fontsize=7.5,
            )
        axes.set(xlabel="speed of the throws at release [m/s]", ylabel="caught within limits [%]")
        axes.set_ylim(-4.0, 122.0)
        axes.set_xlim(speed.min() - 0.6, speed.max() + 0.6)

    return plot("rate", (9.0, 3.4), draw)


def region_plot(region: Region) -> Plot:
    """Draw where balls may pass, and the limit that binds elsewhere; a frame is what is thrown."""
    names = Counter(np.array(region.binding)[region.caught == 0.0].tolist()).most_common()
    colours = {name: colour for (name, _), colour in zip(names, _LIMITS, strict=False)}
    half = 0.5 * float(region.across[1] - region.across[0])
    cells = [
        Rectangle((x - half, z - half), 2.0 * half, 2.0 * half)
        for z in region.height
        for x in region.across
    ]
    faces = [
        to_rgba(BLUE, 0.25 + 0.65 * share)
        if share > 0.0
        else to_rgba(colours.get(name, PALE), 0.45)
        for row, limits in zip(region.caught.tolist(), region.binding, strict=True)
        for share, name in zip(row, limits, strict=True)
    ]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.add_collection(PatchCollection(cells, facecolors=faces, edgecolors="white", lw=0.5))
        (across, up), middle = region.box, float(np.mean(region.height))
        axes.add_patch(
            Rectangle(
                (-across, middle - up), 2.0 * across, 2.0 * up, fill=False, edgecolor=INK, lw=1.4
            )
        )
        shown = [
            Patch(color=to_rgba(BLUE, 0.9), label="all caught"),
            Patch(color=to_rgba(BLUE, 0.45), label="some caught"),
        ]
        shown += [Patch(color=to_rgba(c, 0.45), label=name) for name, c in colours.items()]
        if len(names) > len(colours):
            shown.append(Patch(color=to_rgba(PALE, 0.45), label="other limits"))
        axes.legend(handles=shown, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
        axes.set(xlabel="across the balls' way, off the middle [m]", ylabel="height [m]")
        axes.set_xlim(region.across[0] - half, region.across[-1] + half)
        axes.set_ylim(region.height[0] - half, region.height[-1] + half)
        axes.set_aspect("equal")
        axes.grid(visible=False)

    return plot("region", (9.0, 4.4), draw)


def _pose_picture(
    arm: Arm,
    scene: Scene,
    q: Array,
    *,
    catch: bool,
    marks: Array | None = None,
    angles: tuple[float, float] = SIDE,
) -> str:
    """Return an arm in a pose, (n,) [rad], with marks, (k, 3) [m], in it: a PNG in base64."""
    model = build_scene(scene, arm.model).model
    bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
    qpos = model.qpos0.copy()
    for name, angle in zip(arm.names, q, strict=True):
        qpos[model.joint(name).qposadr[0]] = angle
    qpos[model.joint("ball").qposadr[0] :][:3] = arm.position(q) if catch else (9.0, 0.0, -0.5)
    reach = 0.5 * (arm.position(q) + arm.model.mount[:3, 3])
    corners, colours = placed_faces(
        model, bodies, qpos, np.zeros((0, 3)) if marks is None else marks
    )
    near = np.linalg.norm(corners.mean(axis=1) - reach, axis=1) < 3.0
    x, y, z = reach.tolist()
    view = seen_from(*angles, (x, y, z))
    return png_of(painted(corners[near], colours[near], scene.floor, view=view))


_SECTIONS = (
    Section("summary", "Summary", "What the arm can catch"),
    Section("poses", "Poses", "How it waits, and how it catches"),
    Section("region", "Region", "Where balls may come"),
    Section("speeds", "Speeds", "Rate against the speed of the throws"),
    Section("choice", "Choice", "What it was chosen from"),
    Section("help", "What would help", "What would help"),
    Section("repeat", "Repeat", "How to repeat it"),
)
#: What a limit that binds means.
_WHAT = {
    "speed": "{0} is too slow",
    "torque": "{0} is too weak",
    "range": "the range of {0} ends",
    "brake": "{0} has too little room to come to rest after the catch",
    "impact": "the impact would drive {0} beyond its speed",
    "acceleration": "{0} may not speed up quickly enough",
    "region": "the catch would be outside the region that the map was learned for ({0})",
    "domain": "the flights leave the domain of the map, throws from less far would help",
    "force": "the ball would press harder than hand or arm take",
    "hand": "the fingers would have too little time to close",
    "grip": "the fingers would not hold the ball",
    "palm": "the ball would come from behind the palm",
    "spill": "the ball would leave the basket while the arm brakes",
    "dropped": "they touch the hand and are not held",
    "missed": "they pass the hand",
    "stopped": "the catcher stopped ({0})",
    "beyond a limit": "they are caught, with a command or a motion beyond a limit",
    "no pose": "no typical flight is in the domain of the map with little torque and speed",
    "no map": "no map could be learned",
    "error": "the throws ended in an error",
    "lost": "the worker process ended",
}
#: Contact force from which the page speaks of it: more than people like to hold on a finger [N].
_MUCH = 150.0
#: Gain in relative speed that is worth a word [m/s].
_GAIN = 0.1


def write_design_page(path: Path, found: Design, scene: Scene, *, command: str) -> None:
    """Write the page of a design; the arm is called as its file is, ``path`` without suffix."""
    best = found.best
    arm = None if best is None else best.candidate.arm(found.whole)
    pictures = [] if best is None or arm is None else _pictures(arm, scene, found, best)
    helps, advice = list[FasterJoint](), list[str]()
    if best is not None:
        of = found.whole, best.candidate, found.task.balls
        helps = faster_joints(*of)
        advice = advice_of(found, helps, longer_arm(*of))
    rows = [
        (
            x.joint,
            shown_number(100.0 * x.share, 0),
            shown_number(x.relative_m_s, 2),
            shown_number(x.quicker_m_s, 2),
        )
        for x in helps
    ]
    write_text(
        path,
        page(
            "design",
            _SECTIONS,
            title=f"What {path.stem} can catch",
            command="design",
            typed=f"mitt {command}",
            made_with=made_with(),
            hard=force_in_words(found),
            found=found,
            best=best,
            pictures=pictures,
            helps=rows,
            advice=advice,
            limits=found.whole.limits.name,
            choice=_choice(found),
            interval=_interval(best),
            plot=rate_by_speed(found.rows).svg if found.rows else "",
            region=None if found.region is None else region_plot(found.region).svg,
        ),
    )


def _pictures(arm: Arm, scene: Scene, found: Design, best: Evaluation) -> list[tuple[str, str]]:
    """Return pictures of the arm, by name: PNG in base64."""
    c, region = best.candidate, found.region
    out = [
        ("ready", _pose_picture(arm, scene, c.q_ready, catch=False)),
        ("catch", _pose_picture(arm, scene, c.q_catch, catch=True)),
    ]
    if region is not None and len(region.hand):
        oblique = (18.0, -52.0)  # [deg], from the thrower's side
        places = _pose_picture(
            arm, scene, c.q_catch, catch=True, marks=region.hand[::2], angles=oblique
        )
        out.append(("region", places))
    return out


def force_in_words(found: Design) -> str:
    """Return what the contact force of a design is like, and what would lower it, if it is much."""
    best, hand = found.best, found.whole.model.hand
    if best is None or best.force < _MUCH:
        return ""
    said = f"{best.force:.0f} N is the weight of {best.force / 9.81:.0f} kg on one spot of the hand"
    if hand is not None and not hand.closes:
        return f"{said}."
    return f"{said}. A basket (--hand basket), whose net gives way, catches far more softly."


def _interval(best: Evaluation | None) -> str:
    """Return the Wilson 95 % interval of the share that was caught, in words."""
    if best is None:
        return ""
    low, high = wilson(best.clean, best.thrown)
    return f"{shown_number(100.0 * low, 1)} to {shown_number(100.0 * high, 1)} %"


def _choice(found: Design) -> list[tuple[str, ...]]:
    """Return the rows of the designs to choose from, the softest first."""
    return [
        (
            "taken" if w is found.confirmed[0] else "",
            f"{w.clean} of {w.thrown}",
            shown_number(w.speed, 2),
            shown_number(w.force, 0),
            str(len(w.candidate.active)),
        )
        for w in sorted(found.confirmed, key=lambda w: w.hardness)
    ]


def advice_of(found: Design, helps: list[FasterJoint], longer: float) -> list[str]:
    """Return in words what would help.

    ``longer`` is the least relative speed with longer links [m/s].
    """
    out = []
    gains = [x for x in helps if x.relative_m_s - x.quicker_m_s > _GAIN]
    if gains:
        most = max(gains, key=lambda x: x.relative_m_s - x.quicker_m_s)
        out.append(
            f"If {most.joint} were 50 % faster, a new design could let ball and hand meet at"
            f" {most.quicker_m_s:.1f} instead of {most.relative_m_s:.1f} m/s."
        )
    elif helps and helps[0].relative_m_s > 1.0:
        out.append(
            "No single joint that is 50 % faster would make the catch softer: several are at"
            " their limits at once. Faster drives altogether would."
        )
    if helps and helps[0].relative_m_s - longer > _GAIN:
        out.append(
            f"If all links were 20 % longer and the joints as fast, it could be {longer:.1f} m/s."
        )
    if found.best is not None and found.best.hard:
        best = found.best
        out.append(
            f"{best.hard} of {best.thrown} balls were caught with more force than is taken;"
            f" {softer(found.whole)}."
        )
    lost = [
        row
        for row in found.rows
        if row.binding_limit and (row.feasible < row.throws or row.throws == 0)
    ]
    if lost:
        first = lost[0]
        kind, _, joint = (first.binding_limit or "").partition(":")
        what = _WHAT.get(kind, "{0}").format(joint if kind in _WHAT else first.binding_limit)
        lost_or_not = "the first balls are lost" if first.throws else "no ball was thrown"
        out.append(f"At {first.speed_m_s:g} m/s {lost_or_not}: {what}.")
    return out
