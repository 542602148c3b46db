"""Pages of studies of tasks: each figure is that of trials whose outcomes are known."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from small_study import written

from mitt.lab.report import study_figures, study_page
from mitt.lab.report.style import BAND, Plot, plot
from mitt.lab.trials.bat_study import AXES, read_bat_study
from mitt.lab.trials.meet_study import read_meet_study
from mitt.lab.trials.study import Study
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.study_results import StudyResult, columns_of, study_summary, write_rows

BAT = """
task = "bat"
name = "small"
trials = 4
generators = ["direct", "ik"]

[[conditions]]
name = "usual"

[map]
offsets = [-0.5, 0.5]
speeds = [5.0, 6.0, 7.0]
trials = 8
"""
MEET = """
task = "meet"
name = "small"
trials = 4
rates = [50.0, 200.0]
generators = ["direct", "mpc", "line"]

[[conditions]]
name = "belt"
target = "belt"
speed = 0.3

[[conditions]]
name = "hand"
target = "hand"
speed = 0.8
"""
Trials = Sequence[dict[str, Any]]


def _hit(miss: float, **more: Any) -> dict[str, Any]:  # noqa: ANN401 (a field of a trial)
    """Return a ball that landed so far from the target [m]."""
    return {
        "status": "returned" if miss <= 0.25 else "wide",
        "landing_m": miss,
        "miss_m": miss,
        "off_middle_mm": 4.0,
        "peak_contact_force_n": 30.0,
        "peak_acceleration": [10.0, 20.0],
        "limit_violations": 0,
    } | more


def _met(error: float, **more: Any) -> dict[str, Any]:  # noqa: ANN401 (a field of a trial)
    """Return a meeting that was off by so much [mm]."""
    return {
        "status": "met",
        "in_sync_s": 0.2,
        "position_error_mm": error,
        "placed": True,
        "velocity_error_m_s": 0.012,
        "peak_acceleration": [3.0, 8.0],
        "limit_violations": 0,
        "peak_contact_force_n": 7.0,
    } | more


LOST: dict[str, Any] = {"status": "missed", "peak_acceleration": [1.0, 2.0], "limit_violations": 0}


def _refused(why: str) -> dict[str, Any]:
    """Return a trial that was refused by a limit."""
    return {
        "status": "unreachable",
        "binding_limit": why,
        "peak_acceleration": [],
        "limit_violations": 0,
    }


def _result(study: Study, trials: Mapping[tuple[str, str], Trials], folder: Path) -> StudyResult:
    """Return what a study of trials by condition and generator comes to, from a table of them."""
    out, columns = Folder(folder), columns_of(study.kind.trial, study.kind.extra)
    rows = [
        dict.fromkeys(columns.names)
        | {"generator": generator, "condition": condition, "index": k}
        | trial
        for (condition, generator), of in trials.items()
        for k, trial in enumerate(of)
    ]
    out.trials.write_bytes(write_rows(rows, {}, columns))
    return StudyResult(study=study, folder=out, rows=study_summary(study, out))


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Take the figures that a page draws."""
    out = list[Figure]()

    def drawing(name: str, size: tuple[float, float], draw: Callable[[Figure], None]) -> Plot:
        def kept(figure: Figure) -> None:
            out.append(figure)
            draw(figure)

        return plot(name, size, kept)

    monkeypatch.setattr(study_figures, "plot", drawing)
    return out


def _table(page: str) -> list[list[str]]:
    """Return the table of all numbers of a page: rows of cells."""
    table = page[page.index("Show all") :]
    return [
        re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL)
        for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)[1:]
    ]


def test_a_table_counts_trials_and_gives_medians_of_those_that_have_a_figure(
    tmp_path: Path, drawn: list[Figure]
) -> None:
    """Hits, their interval, median and 90th percentile, refusals and why, trials beyond a limit."""
    study = read_bat_study(written(tmp_path, BAT))
    usual = [_hit(0.01), _hit(0.03, limit_violations=5), _hit(0.02), _refused("torque")]
    result = _result(study, {("usual", "direct"): usual, ("usual", "ik"): [LOST] * 4}, tmp_path)
    page = study_page.study_page(result)
    first, second = _table(page)[:2]
    assert first[:6] == ["usual", "direct", "", "torque", "4", "3"]
    assert first[6:8] == ["75.0", "30.1\u201395.4"]
    assert first[8:12] == ["2.0 (2.8)", "4.0 (4.0)", "20 (20)", "30 (30)"]
    assert first[12:] == ["0", "0", "0", "1", "0", "0", "1"]
    assert second[:8] == ["usual", "ik", "", "", "4", "0", "0.0", "0.0\u201349.0"]
    assert second[8:12] == [*["\u2013"] * 2, "2 (2)", "\u2013"]
    assert "small: 2 generators, 15 conditions, 8 trials" in page
    assert "14 of 16 cells are not complete" in page
    titles = [figure.axes[0].get_title("left") for figure in drawn]
    assert len(titles) == 2  # the rates of the one condition, and the map
    assert "Target away" in titles


def test_a_map_shows_of_each_cell_what_became_of_its_balls(
    tmp_path: Path, drawn: list[Figure]
) -> None:
    """Its median miss, darker where it is larger, and of 100 balls those refused and those lost."""
    study = read_bat_study(written(tmp_path, BAT))
    cells = [c for c in study.conditions if c.moved is not None]
    known: dict[tuple[int, float, float], tuple[Trials, str, str]] = {
        (-1, 0.0, 5.0): ([_hit(0.02)] * 8, "2.0", ""),
        (-1, 0.0, 6.0): ([_hit(0.03), _hit(0.05)] * 4, "4.0", ""),
        (0, -0.5, 5.0): ([_hit(0.12)] * 6 + [LOST] * 2, "12", "25 lost"),
        (1, 0.5, 6.0): (
            [_hit(0.2)] * 2 + [_refused("torque")] * 4 + [LOST] * 2,
            "20",
            "50 ref., 25 lost",
        ),
        (2, -0.5, 5.0): ([_refused("speed")] * 8, "\u2013", "100 ref."),
    }
    trials = {}
    for c in cells:
        assert c.moved is not None
        assert c.speed is not None
        if (key := (*c.moved, c.speed[0])) in known:
            trials[c.name, "direct"] = known[key][0]
    page = study_page.study_page(_result(study, trials, tmp_path))
    assert "Median landing error [cm] by target and ball speed" in page
    counted = {row[0]: row[4:6] for row in _table(page)}
    for c in cells:
        of = trials.get((c.name, "direct"), ())
        assert counted[c.name] == [str(len(of)), str(sum(x["status"] == "returned" for x in of))]
    figure = next(x for x in drawn if "Target" in x.axes[0].get_title("left"))
    panels = figure.axes
    assert [axes.get_title("left") for axes in panels] == [f"Target {x}" for x in AXES]
    assert [x.get_text() for x in panels[0].get_yticklabels()] == ["5 to 6", "6 to 7"]
    for k, axes in enumerate(panels):
        assert [x.get_text() for x in axes.get_xticklabels()] == ["-0.5", "0", "+0.5"]
        wanted = {
            ([-0.5, 0.0, 0.5].index(off), [5.0, 6.0].index(low)): [miss, said]
            for (axis, off, low), (_, miss, said) in known.items()
            if axis in (k, -1)
        }
        assert _said(axes) == wanted
    shades = [
        _shade(panels[k], at) for k, at in ((0, (1, 0)), (0, (1, 1)), (0, (0, 0)), (1, (2, 1)))
    ]
    assert np.all(np.diff([sum(x) for x in shades]) < 0.0)
    assert _shade(panels[2], (0, 0)) == to_rgb(BAND)


def _said(axes: Axes) -> dict[tuple[int, int], list[str]]:
    """Return what stands in the cells of a panel, from above."""
    out: dict[tuple[int, int], list[str]] = {}
    for text in sorted(axes.texts, key=lambda x: -x.get_position()[1]):
        x, y = text.get_position()
        out.setdefault((round(x), round(y)), []).append(text.get_text())
    return out


def _shade(axes: Axes, at: tuple[int, int]) -> tuple[float, ...]:
    """Return the colour of a cell."""
    (cell,) = (
        x
        for x in axes.patches
        if isinstance(x, Rectangle) and x.get_xy() == (at[0] - 0.5, at[1] - 0.5)
    )
    return to_rgb(cell.get_facecolor())


def test_errors_stand_at_the_rates_of_those_that_plan(tmp_path: Path, drawn: list[Figure]) -> None:
    """Median, and up to the 90th percentile; a line across for others; none where none was met."""
    study = read_meet_study(written(tmp_path, MEET))
    trials = {
        ("belt", "direct"): [_met(1.0), _met(2.0), _met(9.0), _refused("area")],
        ("belt", "mpc 50 Hz"): [_met(x) for x in (4.0, 5.0, 6.0)] + [LOST],
        ("belt", "mpc 200 Hz"): [_met(3.0)] * 4,
        ("belt", "line"): [LOST] * 4,
        ("hand", "direct"): [_met(2.0, limit_violations=1, in_sync_s=0.1)] * 4,
        ("hand", "mpc 50 Hz"): [_refused("torque")] * 3 + [_refused("area")],
        ("hand", "mpc 200 Hz"): [_met(20.0)] * 4,
    }
    page = study_page.study_page(_result(study, trials, tmp_path))
    assert "Error at the grasp against the rate of planning" in page
    table = {(row[0], row[1]): row for row in _table(page)}
    belt_map, hand_map = table["belt", "direct"], table["hand", "direct"]
    assert [name for place, name in table if place == "belt"][1:3] == ["mpc 50 Hz", "mpc 200 Hz"]
    assert [name for place, name in table if place == "hand"] == [
        "direct",
        "mpc 50 Hz",
        "mpc 200 Hz",
    ]
    assert belt_map[3:8] == ["area", "4", "3", "75.0", "30.1\u201395.4"]
    assert belt_map[8:13] == ["2.0 (7.6)", "0.012 (0.012)", "8 (8)", "7 (7)", "0.200 (0.200)"]
    assert (hand_map[12], hand_map[-1]) == ("0.100 (0.100)", "4")
    assert table["hand", "mpc 50 Hz"][3:6] == ["torque", "4", "0"]
    belt, hand, unused = next(x for x in drawn if x.axes[0].get_xlabel() == "plans a second").axes
    assert [axes.get_title("left") for axes in (belt, hand)] == ["belt", "hand"]
    assert not unused.get_visible()
    assert _across(belt) == {"direct": 2.0}
    assert _by_rate(belt) == {"mpc": [(50.0, 5.0, 5.8), (200.0, 3.0, 3.0)]}
    assert _across(hand) == {"direct": 2.0}
    assert _by_rate(hand) == {"mpc": [(200.0, 20.0, 20.0)]}


def _across(axes: Axes) -> dict[str, float]:
    """Return the heights of lines across a panel, by name."""
    return {
        str(x.get_label()): float(np.asarray(x.get_ydata())[0])
        for x in axes.lines
        if list(np.asarray(x.get_xdata())) == [0, 1]
    }


def _by_rate(axes: Axes) -> dict[str, list[tuple[float, ...]]]:
    """Return rates, medians and upper ends of the bars of a panel, by name."""
    out = {}
    for bars in axes.containers:
        assert isinstance(bars, ErrorbarContainer)
        line, _, (ends,) = bars.lines
        tops = [segment[:, 1].max() for segment in ends.get_segments()]
        points = np.column_stack([np.asarray(line.get_xydata()), tops]).round(9)
        out[str(bars.get_label())] = [tuple(x) for x in points.tolist()]
    return out
