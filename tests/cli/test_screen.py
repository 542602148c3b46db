"""What commands say on stderr besides their work."""

import contextlib
import html
import io
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from rich.console import Console

from mitt.cli.catching import catch_command, shortfalls
from mitt.cli.main import main
from mitt.cli.measuring import _show_study as show_study
from mitt.cli.screen import checked, progress, show, table, tell_of_kernels, warn
from mitt.core import kernels
from mitt.core.errors import printable
from mitt.interrupts import tell
from mitt.io.shipped_arms import shipped_arms
from mitt.lab.report.style import GENERATORS, legend_above, plot
from mitt.lab.trials.score import CATCH, STATUSES, Trial
from mitt.lab.trials.study_folder import Folder


class Full:
    """A stream that cannot be written to."""

    def write(self, text: str) -> int:
        """Refuse."""
        raise OSError(28, "No space left on device", None if text else "")

    def flush(self) -> None:
        """Do nothing."""


def test_the_table_of_throws_fits_80_columns() -> None:
    """The longest that each column can hold: nothing is cut, only the last column breaks."""
    trial = Trial(
        index=9999,
        status="unreachable",
        t_catch_s=1.234,
        position_error_mm=123.4,
        velocity_error_m_s=12.34,
        peak_torque_ratio=[1.0],
        peak_speed_ratio=[1.0],
        limit_violations=0,
        demand_cost=1.0,
        peak_contact_force_n=1234.0,
        over_force=True,
        binding_limit="acceleration:panda_joint2",
        saturated_ticks=0,
        range_excess_rad=0.0,
    )
    console = Console(width=80, file=io.StringIO())
    with console.capture() as captured:
        console.print(catch_command.table("a", [trial, replace(trial, binding_limit=None)]))
    lines = captured.get().splitlines()
    assert all(len(line) <= 80 for line in lines)
    text = "".join("".join(lines).split())
    assert "\u2026" not in text
    for word in ("unreachable", "1.234", "123.4", "12.34", "1234!", "100", "acceleration:panda"):
        assert word in text
    counts = dict.fromkeys(STATUSES, 0) | {"caught": 1, "dropped": 2}
    assert shortfalls(counts, [trial]) == ["2 dropped"]
    beyond = [trial, replace(trial, limit_violations=3)]
    assert shortfalls(counts, beyond) == ["2 dropped", "1 beyond a limit"]


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_nothing_of_a_table_is_cut_off(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], columns: int
) -> None:
    """In a narrow terminal cells break into lines, as of ``mitt arms``."""
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TTY_COMPATIBLE", "1")  # for rich: a terminal
    assert main(["arms"]) == 0
    rows = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).partition("caught: of")[0]
    assert all(len(x) <= columns for x in rows.splitlines())
    for arm in shipped_arms():
        of = arm.figures
        assert of is not None
        for word in (*arm.title.split(), arm.limits, f"{of.force_n:.0f}"):
            assert word in rows


@pytest.mark.parametrize(
    ("folder", "cold", "said"),
    [
        (None, True, ""),
        (Path("kernels"), True, "compiling, once"),
        (Path("kernels"), False, ""),
    ],
)
def test_compiling_is_said_in_one_line_where_it_is_due(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    folder: Path | None,
    cold: bool,
    said: str,
) -> None:
    """That they are compiled once, or nothing: that they cannot be kept is a warning of its own."""
    monkeypatch.setattr(kernels, "cache_folder", lambda: folder)
    monkeypatch.setattr(kernels, "is_cold", lambda: cold)
    tell_of_kernels()
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == bool(said)


def test_nobody_who_hears_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk behind stderr does not end a run."""
    monkeypatch.setattr("sys.stderr", Full())
    tell("something")


#: Names that are markup, escapes or formulas to somebody.
HOSTILE = (
    "m[a].json",
    "[/red]",
    "[bold]x[/bold]",
    "[link=http://x]y[/link]",
    ":smile:",
    "$\\frac$",
    "a\x1b[31mb",
    "line\nend",
    "tab\tend",
    "\u202eevil",
    "<b>&amp;",
    "{x}",
    "%s",
    "\\[x]",
    "\ud800",
    "caf\u00e9",
)


@given(name=st.sampled_from(HOSTILE) | st.text(max_size=30))
def test_a_name_is_printed_as_it_is(name: str) -> None:
    """In lines, tables, their titles and heads, on both streams: no markup, one line."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        rows = table(name, (name,), left=(name,), no_wrap=True)
        rows.add_row(name)
        show(rows, f"written: {name}")
        warn([name])
        warn([name], json=True)
        checked(name)
    plain = printable(name)
    assert out.getvalue().endswith(f"written: {plain}\nwarning: {plain}\n")
    assert err.getvalue() == f"mitt: warning: {plain}\nmitt: the input is good: {plain}\n"
    assert all(x.isprintable() or x == "\n" for x in out.getvalue() + err.getvalue())
    assert out.getvalue().count(plain.strip()) >= 4


def test_progress_names_are_no_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bar on a terminal shows what is done, whatever it is called."""
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", stream)
    with progress() as report:
        report("[/red]$[x]", 1, 2)
    assert "[/red]$[x]" in stream.getvalue()


@pytest.mark.parametrize("name", ["a[/red]b.csv", "m[a].csv", "[bold].csv", "$x$.csv", "a\nb.csv"])
def test_a_command_bears_any_name_of_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """The file is written, its name is told as it is, and the status is 0."""
    points = tmp_path / f"in-{name}"
    points.parent.mkdir(exist_ok=True)
    rows = [f"{0.01 * k},{3.0 - 0.05 * k},0,{0.5 + 0.03 * k - 0.000491 * k * k}" for k in range(20)]
    points.write_text("\n".join(["t_s,x_m,y_m,z_m", *rows]))
    assert main(["track", str(points), "--out", str(tmp_path / name)]) == 0
    assert f"written: {printable(str(tmp_path / name))}" in capsys.readouterr().out
    assert (tmp_path / name).is_file()


def test_a_name_that_utf_8_has_not_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before anything is done that would have to tell of it."""
    assert main(["track", "in.csv", "--out", str(tmp_path / "out\udcff.csv")]) == 2
    err = capsys.readouterr().err
    assert "UTF-8" in err
    assert err.count("\n") == 1


@given(name=st.sampled_from(HOSTILE))
def test_a_name_in_a_figure_is_no_formula(name: str) -> None:
    """Title, labels, ticks and legend show it as a text."""
    text = "".join(x for x in name if x.isprintable())

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        axes.plot([0.0, 1.0], label=text)
        axes.set(title=text, xlabel=text, ylabel=text)
        axes.set_xticks([0.0], [text])
        legend_above(figure, axes)

    svg = plot("x", (3.0, 3.0), draw).svg
    assert html.unescape(svg).count(text.strip()) >= 4


def test_what_is_written_beside_an_input_never_replaces_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An output that is an input, by any path, is refused before anything is read or written."""
    points = tmp_path / "points.csv"
    points.write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path)
    for out in (points, tmp_path / "link" / "points.csv"):
        assert main(["track", str(points), "--out", str(out), "--overwrite"]) == 2
        assert "read or written too" in capsys.readouterr().err
    assert points.read_text() == "mine"


def test_a_study_of_many_generators_shows_each_rate_and_force(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Where cells are wider than there is room they go on in a second line; nothing is cut."""
    names = tuple(GENERATORS)
    row = {"condition": "clean", "throws": 8, "catch_rate": 1.0, "over_force": 0, "complete": True}
    rows = [{**row, "generator": x, "force_n": {"median": 30.0 + k}} for k, x in enumerate(names)]
    clean = SimpleNamespace(name="clean")
    study: Any = SimpleNamespace(kind=CATCH, name="s", generators=names, conditions=(clean,))
    folder: Any = Folder(Path("s"))
    finished: Any = SimpleNamespace(rows=rows)
    show_study(study, folder, finished)
    out = capsys.readouterr().out
    assert out.count("100.0,") == len(names)
    assert all(f" {30 + k} " in out for k in range(len(names)))
