"""``mitt arms``: the arms that have a name, and how well each catches with the design it has."""

from typing import Any

from rich import box

from mitt.cli.options import ArmsOptions
from mitt.cli.screen import checked, print_json, show, table
from mitt.io.cell import RobotPart, read_cell
from mitt.io.shipped_arms import ShippedArm, shipped_arms
from mitt.version import __version__

#: Hands as the table calls them.
_HANDS = {"three-finger": "fingers"}


def arms_command(options: ArmsOptions) -> int:
    """Run ``mitt arms``; return its exit status."""
    found = shipped_arms()
    if options.check:
        return checked(f"{len(found)} arms")
    if options.json:
        print_json(
            {
                "schema": "mitt.arms/1",
                "version": __version__,
                "arms": [_as_json(arm) for arm in found],
            }
        )
        return 0
    rows = table(
        "",
        ("--arm", "arm", "joints", "hand", "caught", "m/s", "N"),
        left=("--arm", "arm", "hand"),
        no_wrap=True,
    )
    rows.title, rows.box, rows.show_edge = None, box.SIMPLE_HEAD, False
    rows.collapse_padding, rows.pad_edge = True, False
    for arm in found:
        rows.add_row(*_row(arm))
    show(rows, *_words(found))
    return 0


def _row(arm: ShippedArm) -> tuple[str, ...]:
    """Return an arm as cells of the table."""
    of = arm.figures
    if of is None:
        return _said(arm), arm.title, "", "?" if arm.designed else "none"
    return (
        _said(arm),
        arm.title,
        str(len(of.joints)),
        _HANDS.get(of.hand, of.hand),
        f"{100.0 * of.caught / of.throws:.1f} %",
        f"{of.relative_speed_m_s:.1f}",
        f"{of.force_n:.0f}",
    )


def _said(arm: ShippedArm) -> str:
    """Return what is said behind ``--arm``."""
    return f"wam --limits {arm.limits}" if arm.name == "wam" else arm.name


def _words(found: tuple[ShippedArm, ...]) -> list[str]:
    """Return what the columns are, and what to do about an arm that has no design."""
    throws = max((x.figures.throws for x in found if x.figures is not None), default=0)
    words = [
        f"caught: of {throws} throws that no search has seen, in the scene lab, by images",
        "m/s, N: of ball and hand when they meet, the largest contact force; medians",
        "limits: those of the vendor, but for the WAM's; --json has all",
    ]
    words += _commands(found)
    words += [
        f"{_said(x)}: {x.figures.beyond} beyond a limit of the arm, or of the force on it"
        for x in found
        if x.figures is not None and x.figures.beyond
    ]
    if not all(x.designed for x in found):
        words.append("hand none: no design yet; mitt design NAME --out NAME.toml looks for one")
    return words


def _commands(found: tuple[ShippedArm, ...]) -> list[str]:
    """Return which command each arm takes."""
    groups: dict[tuple[str, float], dict[str, None]] = {}
    for arm in found:
        robot = _robot(arm.arm)
        groups.setdefault((robot.takes, robot.rate), {})[arm.name] = None
    return [
        f"takes {takes} at {rate:g} Hz: {', '.join(names)}"
        for (takes, rate), names in groups.items()
    ]


def _robot(arm: str) -> RobotPart:
    """Return the robot of the cell that ships for an arm."""
    return read_cell(f"{arm}-sim").robot


def _as_json(arm: ShippedArm) -> dict[str, Any]:
    """Return an arm as the contract has it; null is what is not known of one without a design."""
    of, robot = arm.figures, _robot(arm.arm)
    return {
        "name": arm.name,
        "title": arm.title,
        "limits": arm.limits,
        "joints": [] if of is None else list(of.joints),
        "hand": None if of is None else of.hand,
        "source": arm.source,
        "takes": robot.takes,
        "command_hz": robot.rate,
        "rate": None if of is None else of.caught / of.throws,
        "throws": 0 if of is None else of.throws,
        "beyond": None if of is None else of.beyond,
        "relative_speed_m_s": None if of is None else of.relative_speed_m_s,
        "force_n": None if of is None else of.force_n,
    }
