"""The page that ``mitt design`` leaves behind: what the arm can catch, and what would help."""

from pathlib import Path

from mitt.design.design import Design, softer
from mitt.design.evaluation import Evaluation
from mitt.design.faster_joints import FasterJoint, faster_joints, longer_arm
from mitt.files.writing import write_text
from mitt.report.figures.design import pose_picture, rate_by_speed, region_picture, region_plot
from mitt.report.page import Section, number, page
from mitt.robot.arm import Arm
from mitt.trials.statistics import wilson
from mitt.world.scene import Scene

_SECTIONS = (
    Section("summary", "Summary", "What the arm can catch"),
    Section("poses", "Poses", "How it waits, and how it catches"),
    Section("region", "Region", "Where balls may come"),
    Section("speeds", "Speeds", "Rate against the speed of the throws"),
    Section("choice", "Choice", "What it was chosen from"),
    Section("help", "What would help", "What would help"),
)
#: Gain in relative speed that is worth a word [m/s].
_GAIN = 0.1


def write_design_page(path: Path, found: Design, scene: Scene, *, command: str) -> None:
    """Write the page of a design.

    Args:
        path: The file.
        found: What was found.
        scene: The world in which it was tried.
        command: The command that found it.
    """
    best = found.best
    arm = None if best is None else best.candidate.arm(found.whole)
    pictures = [] if best is None or arm is None else _pictures(arm, scene, found, best)
    helps, advice = list[FasterJoint](), list[str]()
    if best is not None:
        of = found.whole, best.candidate, found.task.balls
        helps = faster_joints(*of)
        advice = advice_of(found, helps, longer_arm(*of))
    write_text(
        path,
        page(
            "design", _SECTIONS, title=f"What {found.whole.model.name} can catch",
            command=command, found=found, best=best, pictures=pictures, helps=_rows(helps),
            advice=advice, limits=found.whole.limits.name,
            choice=_choice(found), interval=_interval(best),
            plot=rate_by_speed(found.rows).svg if found.rows else "",
            region=None if found.region is None else region_plot(found.region).svg,
        ),
    )  # fmt: skip


def _pictures(arm: Arm, scene: Scene, found: Design, best: Evaluation) -> list[tuple[str, str]]:
    """Return pictures of the arm, by name: PNG in base64."""
    c, region = best.candidate, found.region
    out = [
        ("ready", pose_picture(arm, scene, c.q_ready, catch=False)),
        ("catch", pose_picture(arm, scene, c.q_catch, catch=True)),
    ]
    if region is not None and len(region.hand):
        out.append(("region", region_picture(arm, scene, c.q_catch, region)))
    return [(name, picture.png) for name, picture in out]


def _interval(best: Evaluation | None) -> str:
    """Return the Wilson 95 % interval of the share that was caught, in words."""
    if best is None:
        return ""
    low, high = wilson(best.clean, best.thrown)
    return f"{number(100.0 * low, 1)} to {number(100.0 * high, 1)} %"


def _choice(found: Design) -> list[tuple[str, ...]]:
    """Return the rows of the designs to choose from, the softest first."""
    return [
        (
            "taken" if w is found.confirmed[0] else "",
            f"{w.clean} of {w.thrown}",
            number(w.speed, 2),
            number(w.force, 0),
            str(len(w.candidate.active)),
        )
        for w in sorted(found.confirmed, key=lambda w: w.hardness)
    ]


def advice_of(found: Design, helps: list[FasterJoint], longer: float) -> list[str]:
    """Return in words what would help.

    Args:
        found: What was found.
        helps: What each joint's speed is worth.
        longer: Least relative speed with longer links [m/s].
    """
    out = []
    gains = [x for x in helps if x.relative_m_s - x.quicker_m_s > _GAIN]
    if gains:
        most = max(gains, key=lambda x: x.relative_m_s - x.quicker_m_s)
        out.append(
            f"If {most.joint} were 50 % faster, the ball could meet the hand at"
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
        row for row in found.rows
        if row.binding_limit and (row.feasible < row.throws or row.throws == 0)
    ]  # fmt: skip
    if lost:
        first = lost[0]
        kind, _, joint = (first.binding_limit or "").partition(":")
        what = _WHAT.get(kind, "{0}").format(joint if kind in _WHAT else first.binding_limit)
        lost_or_not = "the first balls are lost" if first.throws else "no ball was thrown"
        out.append(f"At {first.speed_m_s:g} m/s {lost_or_not}: {what}.")
    return out


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


def _rows(helps: list[FasterJoint]) -> list[tuple[str, ...]]:
    """Return the rows of the table."""
    return [
        (x.joint, number(100.0 * x.share, 0), number(x.relative_m_s, 2), number(x.quicker_m_s, 2))
        for x in helps
    ]
