"""The page that a run leaves behind: one file that opens anywhere and loads nothing."""

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from mitt.generator.learn import Step
from mitt.link.files import write_text
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.study import page
from mitt.study.digest import digest
from mitt.study.report_figures import figures, replay
from mitt.study.report_numbers import (
    cards,
    comparison,
    every_trial,
    failures,
    headline,
    settings,
    specification,
    story,
)
from mitt.study.trial import Outcome
from mitt.world.scene import Scene

#: What the links at the top call the sections.
_SHORT = {
    "summary": "Summary",
    "failures": "Failures",
    "replay": "3-D replay",
    "figures": "Figures",
    "rivals": "Comparison",
    "table-1": "Table 1",
    "trials": "All throws",
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
        releases: Ball centre at the release of each trial [m], shape (trials, 3).
        shares: Share of feedback in the torque with alpha = 0 and after each step of learning.
        rivals: Results of the same throws with other generators or settings.
        pictures: Whether to draw fig. 12; it takes some seconds.
        replay: Whether to put in the 3-D replay; it weighs 1 MB.
    """

    result: dict[str, Any]
    arm: Arm
    scene: Scene
    steps: tuple[Step, ...] | None = None
    direct: Outcome | None = None
    unoptimised: Outcome | None = None
    releases: Array | None = None
    shares: tuple[float, ...] | None = None
    rivals: tuple[dict[str, Any], ...] = ()
    pictures: bool = True
    replay: bool = True


def write_report(path: Path, content: ReportContent) -> None:
    """Write the page whole or not at all.

    Raises:
        FileError: The file cannot be written.
    """
    write_text(path, report(content))


def report(content: ReportContent) -> str:
    """Return the page."""
    result, log = content.result, content.direct.log if content.direct else None
    short = digest(result)
    parts = [
        ("summary", "What happened", story(short, content.direct, content.unoptimised)
         + cards(short)),
        ("failures", "Throws that failed", failures(result)),
        ("replay", "One throw in 3-D", replay(content)),
        ("figures", "Figures, by the paper's numbers", figures(content)),
        ("rivals", "Beside other generators", comparison(result, content.rivals)),
        ("table-1", "The system beside the paper's Table 1",
         specification(content.arm, log, str(result["vision"]))),
        ("trials", "All throws", every_trial(result)),
    ]  # fmt: skip
    shown = [(name, title, html) for name, title, html in parts if html]
    links = page.navigation([(name, _SHORT[name]) for name, _, _ in shown])
    top = (
        f'<p class="eyebrow">mitt catch</p>\n<h1>{escape(headline(short))}</h1>\n'
        f"{settings(result)}\n{links}"
    )
    return page.page(
        f"mitt: {headline(short)}",
        header=top,
        sections=[page.section(*part) for part in shown],
        footer=_footer(result),
    )


def _footer(result: dict[str, Any]) -> str:
    """Return where the method and the page come from."""
    return (
        f"mitt {escape(str(result['version']))}, result {escape(str(result['schema']))}. Method: "
        "A. Namiki, M. Ishikawa, Vision-Based Online Trajectory Generation and Its Application "
        "to Catching, ISER 2002; equation and figure numbers are that paper&rsquo;s. All throws "
        "are simulated. This file loads nothing from the network."
    )
