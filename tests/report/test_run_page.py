"""The page holds every figure and every number, stands alone, and survives hostile names."""

import re
from dataclasses import asdict, replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from mitt.clock import Stopwatch
from mitt.core.arm.arm import Arm
from mitt.core.map.learn import Learned
from mitt.lab.report.catch_blocks import CatchShown, blocks_of_catches
from mitt.lab.report.run_page import cards_of, run_page
from mitt.lab.trials.result import result
from mitt.lab.trials.runner import LoggedTrial
from mitt.lab.trials.score import CATCH
from mitt.lab.trials.statistics import wilson
from mitt.lab.world.scene import Scene

#: Elements that never close, and the attributes that make a browser load something.
_VOID = {"meta", "img", "link", "br", "hr", "input"}
_LOADING = ("src", "href", "srcset", "data", "poster", "action")
_HOSTILE = "<script>alert('x')</script>\"&'"
_HEAD: dict[str, object] = {
    "version": "0.1.0",
    "arm": "wam",
    "limits": "paper",
    "generator": "direct",
    "vision": "points",
    "seed": 7,
}


class _Reader(HTMLParser):
    """Reads a page, holding that every element closes in the order in which it opened."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.loads: list[str] = []
        self.frames: list[str] = []
        self.tags: set[str] = set()
        self.text: list[str] = []
        self.bad: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in _LOADING and not (value or "").startswith(("#", "data:")):
                self.loads.append(f"{tag} {name}={(value or '')[:60]}")
            if name == "srcdoc":
                self.frames.append(value or "")
        if tag not in _VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in _VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.bad.append(tag)

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "script"):
            self.text.append(data)


def _read(page: str) -> _Reader:
    reader = _Reader()
    reader.feed(page)
    reader.close()
    return reader


def _result(direct: LoggedTrial, **head: object) -> dict[str, Any]:
    """Return a result of three throws: caught, dropped, missed."""
    caught = replace(
        direct.trial,
        status="caught",
        position_error_mm=3.25,
        velocity_error_m_s=0.875,
        peak_contact_force_n=41.0,
        limit_violations=0,
    )
    dropped = replace(
        caught,
        index=1,
        status="dropped",
        binding_limit="torque:j2",
        position_error_mm=9.5,
        limit_violations=17,
    )
    missed = replace(
        caught,
        index=2,
        status="missed",
        binding_limit="domain",
        position_error_mm=None,
        velocity_error_m_s=None,
        peak_contact_force_n=None,
    )
    return result(CATCH, [caught, dropped, missed], Stopwatch(), {**_HEAD, **head})


def _page(result: dict[str, Any], content: CatchShown) -> str:
    """Return the page of throws."""
    return run_page(CATCH, result, blocks_of_catches(result, content))


@pytest.fixture(scope="module")
def content(
    arm: Arm, scene: Scene, learned: Learned, direct: LoggedTrial, unoptimised: LoggedTrial
) -> CatchShown:
    """Everything that a page of throws can hold."""
    return CatchShown(
        arm=arm,
        scene=scene,
        steps=learned.steps,
        direct=direct,
        unoptimised=unoptimised,
        releases=np.array([[3.5, 0.1, 0.2], [3.9, -0.1, 0.4], [3.6, 0.0, 0.0]]),
    )


@pytest.fixture(scope="module")
def page(content: CatchShown, direct: LoggedTrial) -> str:
    """The whole page, made once."""
    return _page(_result(direct), content)


def test_the_page_is_well_formed(page: str) -> None:
    """Every element closes where it should, and no id is given twice."""
    reader = _read(page)
    assert page.startswith("<!doctype html>")
    assert reader.bad == []
    assert reader.open == []
    assert len(reader.ids) == len(set(reader.ids))


def test_the_page_holds_every_figure(page: str) -> None:
    """Figs. 7 to 12 of the paper, ours, the replay and Table 1 are all there."""
    wanted = {
        "fig7",
        "fig8",
        "fig9",
        "fig10",
        "fig11",
        "fig12",
        "errors",
        "releases",
        "replay-3d",
        "table-1",
        "failures",
        "trials",
        "summary",
    }
    assert wanted <= set(_read(page).ids)


def test_the_page_loads_nothing(page: str) -> None:
    """No element, style or rule of the page names a place to load from."""
    reader = _read(page)
    assert reader.loads == []
    outside = page[: page.index("<iframe")] + page[page.index("</iframe>") :]
    assert not re.findall(r"@import|url\((?!#|data:)", outside)
    assert "://" not in outside
    assert "default-src 'none'" in page
    assert not re.search(r"https?:", page[page.index("Content-Security") :][:400])


def test_the_replay_stands_alone_in_its_frame(page: str) -> None:
    """The one frame carries a whole page of its own, in a sandbox, and loads nothing either."""
    (inner,) = _read(page).frames
    assert inner.startswith("<!doctype html>")
    assert "__VISER_EMBED_DATA__" in inner
    assert _read(inner.split("<script")[0]).loads == []
    assert 'sandbox="allow-scripts"' in page


def test_numbers_of_the_page_are_those_of_the_result(page: str) -> None:
    """Counts, rate, interval, errors and force in the page are the result's."""
    text = " ".join("".join(_read(page).text).split())
    low, high = wilson(1, 3)
    for wanted in (
        "1 of 3 balls caught",
        "Of 3 throws 1 was caught, 1 was dropped, 1 was missed.",
        f"{100 / 3:.1f}",
        f"{100 * low:.1f} to {100 * high:.1f} %",
        f"{np.median([3.25, 9.5]):.1f} mm from the catch point",
        "0.88 m/s",
        "In 1 of 3 throws a limit was exceeded",
        "(17 in all)",
    ):
        assert wanted in text, wanted


def test_failed_throws_are_listed_with_their_reason(page: str) -> None:
    """The table of failures has exactly the throws that were not caught."""
    part = page[page.index('<section id="failures">') :]
    part = part[: part.index("</section>")]
    rows = re.findall(r"<tr><td>(\d+)</td><td>(\w+)</td><td>([^<]+)</td>", part)
    assert rows == [
        ("1", "dropped", "j2 would need more torque than it has (torque:j2)"),
        ("2", "missed", "the ball flies outside the domain of the map (domain)"),
    ]


def test_the_page_opens_with_the_replay_and_three_sentences(page: str) -> None:
    """What it is, what is real, what happened in this throw; no number of all throws before."""
    first = page[page.index("<section") : page.index("</section>")]
    assert first.index("<iframe") < first.index("What it is.</b> An arm")
    said = re.findall(r'<p class="opening"><b>([^<]+)</b> [^<]+[.]</p>', first)
    assert said == ["What it is.", "What is real.", "In this throw."]
    assert page.index("</section>") < page.index('class="cards"')


def test_hostile_names_do_no_harm(content: CatchShown, direct: LoggedTrial) -> None:
    """Names of arms, limits, generators and reasons show as text, whatever is in them."""
    hostile = _result(direct, **dict.fromkeys(("arm", "limits", "generator", "version"), _HOSTILE))
    for trial in hostile["trials"]:
        trial["status"], trial["binding_limit"] = "dropped", _HOSTILE
    page = _page(hostile, replace(content, direct=None))  # what is drawn is given no names
    reader = _read(page)
    assert "script" not in reader.tags
    assert reader.bad == []
    assert _HOSTILE in "".join(reader.text)


def test_a_report_without_logs_still_stands(content: CatchShown, direct: LoggedTrial) -> None:
    """What was not run is left out: no empty section, no broken link."""
    page = _page(_result(direct), CatchShown(arm=content.arm, scene=content.scene))
    reader = _read(page)
    assert reader.bad == []
    assert {"fig7", "fig8", "replay"}.isdisjoint(reader.ids)
    for link in re.findall(r'href="#([^"]+)"', page[: page.index("<main>")]):
        assert link in reader.ids


def test_an_interrupted_run_without_throws_has_a_report(content: CatchShown) -> None:
    """Nothing thrown is a result too."""
    empty = result(CATCH, [], Stopwatch(), dict(_HEAD))
    page = _page(empty, CatchShown(arm=content.arm, scene=content.scene))
    assert "0 of 0 balls caught" in page
    assert "nan" not in page


def test_figures_of_the_page_are_taken_from_the_trials(direct: LoggedTrial) -> None:
    """Medians and percentiles are NumPy's, over the throws that have the figure."""
    trials = [asdict(replace(direct.trial, index=k, position_error_mm=float(k))) for k in range(9)]
    trials[4]["position_error_mm"] = None
    cards = {x.title: x for x in cards_of(CATCH, {**_result(direct), "trials": trials})}
    values = [0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 7.0, 8.0]
    card = cards["Position error"]
    assert (card.value, card.unit) == (f"{np.median(values):.1f}", "mm")
    assert card.note == f"median; 90 % below {np.percentile(values, 90.0):.1f}, largest 8.0"
