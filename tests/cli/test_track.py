"""``mitt track``: rows in, rows out, from the past alone; and what it refuses."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from mitt.cli.main import main
from mitt.core.signals import Array
from mitt.lab.world.flights import builtin_flights
from mitt.robot.cameras.filtering import ADDED, AHEAD

HEADER = "t_s,x_m,y_m,z_m\n"


def table(t: Array, r: Array, *, flight: str = "") -> str:
    """Return the lines of a table."""
    name = f"{flight}," if flight else ""
    return "".join(f"{name}{a},{x},{y},{z}\n" for a, (x, y, z) in zip(t, r, strict=True))


def read(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    return list(csv.DictReader(path.read_text("utf-8").splitlines()))


def test_rows_come_back_in_order_with_what_was_known_by_then(tmp_path: Path) -> None:
    """Input cells verbatim, the new columns after them; the first velocity is 0."""
    flight = builtin_flights()[0]
    points, out = tmp_path / "points.csv", tmp_path / "track.csv"
    points.write_text(HEADER + table(flight.t, flight.r))
    assert main(["track", str(points), "--out", str(out), "--ahead", "0.1"]) == 0
    rows = read(out)
    assert tuple(rows[0]) == ("t_s", "x_m", "y_m", "z_m", *ADDED, *AHEAD)
    assert [row["x_m"] for row in rows] == [str(x) for x in flight.r[:, 0]]
    assert all(float(rows[0][c]) == 0.0 for c in ADDED[:3])
    assert np.isfinite([[float(x) for x in row.values()] for row in rows]).all()


def test_a_row_knows_nothing_of_later_rows(tmp_path: Path) -> None:
    """Cut after any row, the rows so far are the same."""
    flight = builtin_flights()[3]
    whole, cut = tmp_path / "whole.csv", tmp_path / "cut.csv"
    for path, n in ((whole, len(flight.t)), (cut, 60)):
        points = path.with_suffix(".points")
        points.write_text(HEADER + table(flight.t[:n], flight.r[:n]))
        assert main(["track", str(points), "--out", str(path), "--ahead", "0.05"]) == 0
    assert read(whole)[:60] == read(cut)


def test_interleaved_flights_do_not_touch(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two flights woven into one file give the rows that each gives alone."""
    a, b = builtin_flights()[:2]
    n = 50
    alone, woven = [], []
    for name, f in (("a", a), ("b", b)):
        points, out = tmp_path / f"{name}.csv", tmp_path / f"{name}.out"
        points.write_text("flight," + HEADER + table(f.t[:n], f.r[:n], flight=name))
        assert main(["track", str(points), "--out", str(out)]) == 0
        alone.append(read(out))
    lines = [table(f.t[:n], f.r[:n], flight=name).splitlines() for name, f in (("a", a), ("b", b))]
    points, out = tmp_path / "woven.csv", tmp_path / "woven.out"
    points.write_text(
        "flight," + HEADER + "\n".join(x for pair in zip(*lines, strict=True) for x in pair)
    )
    capsys.readouterr()
    assert main(["track", str(points), "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["schema"], said["rows"], said["flights"]) == ("mitt.track/1", 2 * n, 2)
    assert said["unused"] == {}
    woven = read(out)
    assert [woven[0::2], woven[1::2]] == alone


def test_positions_that_were_not_used_are_counted_by_their_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Origins of a tracker that lost the ball, one wild place, and one of another time."""
    ball, n = builtin_flights()[3], 60
    t, r = ball.t[:n].copy(), ball.r[:n].copy()
    r[30:40] = 0.0
    r[50] += 0.5
    t = np.append(t, t[-1] + 100.0)
    points, out = tmp_path / "points.csv", tmp_path / "track.csv"
    points.write_text(HEADER + table(t, np.vstack((r, r[-1:]))))
    assert main(["track", str(points), "--out", str(out), "--json"]) == 0
    unused = json.loads(capsys.readouterr().out)["unused"]
    assert unused == {"rejected": 2, "repeated": 9, "isolated": 1}
    assert main(["track", str(points), "--out", str(out), "--overwrite"]) == 0
    assert "not used: 2 rejected, 9 repeated, 1 isolated; written" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("0,1,2,3\n0,1,2,3\n", "line 3 column t_s: wanted a time after 0"),
        ("0,1,2,3\n0.1,one,2,3\n", "line 3 column x_m"),
        ("0,1,2,3\n0.1,1,inf,3\n", "line 3 column y_m"),
        ("0,1,2\n", "line 2: wanted 4 cells"),
        ("", "at least one row"),
    ],
)
def test_bad_input_is_named_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], body: str, words: str
) -> None:
    """One line with file, line, wanted and given; status 2; no output."""
    points, out = tmp_path / "points.csv", tmp_path / "track.csv"
    points.write_text(HEADER + body)
    assert main(["track", str(points), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert str(points) in said
    assert said.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize("option", [["--ahead", "-1"], ["--ahead", "nan"], ["--sigma", "0"]])
def test_numbers_out_of_range_are_refused(tmp_path: Path, option: list[str]) -> None:
    """A negative or undefined time, a vanishing noise: status 2."""
    points = tmp_path / "points.csv"
    points.write_text(HEADER + "0,1,2,3\n")
    assert main(["track", str(points), "--out", str(tmp_path / "t.csv"), *option]) == 2


def test_an_existing_file_needs_overwrite_and_check_writes_nothing(tmp_path: Path) -> None:
    """Refused, then replaced; --check leaves no trace."""
    points, out = tmp_path / "points.csv", tmp_path / "track.csv"
    points.write_text(HEADER + "0,1,2,3\n")
    assert main(["track", str(points), "--out", str(out), "--check"]) == 0
    assert not out.exists()
    out.write_text("mine")
    assert main(["track", str(points), "--out", str(out)]) == 2
    assert out.read_text() == "mine"
    assert main(["track", str(points), "--out", str(out), "--overwrite"]) == 0
    assert len(read(out)) == 1
