"""Tables of users: what was not seen, and tables of other programs."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mitt.core.ball.filter import BallFilter
from mitt.core.errors import FileError
from mitt.core.signals import GRAVITY, Sighting
from mitt.io.csv_table import header_of, read_table
from mitt.lab.world.flights import read_flights
from mitt.lab.world.throws import read_throws
from mitt.robot.cameras.filtering import follow_all, read_positions, write_track

POSITION = ("x_m", "y_m", "z_m")
COLUMNS = ("t_s", *POSITION)
ABSENT = ("", "nan", "NaN", " ", "NA", "null")
COUNT = 60
HIDDEN = range(20, 26)


def fall(cells: str | None, *, flight: str = "", hidden: range = HIDDEN) -> str:
    """Return a fall as a table; hidden rows hold ``cells``, and are left out for None."""
    lines = ["flight," * bool(flight) + ",".join(COLUMNS)]
    for k in range(COUNT):
        t = k / 120.0
        place = (3.0 - 4.0 * t, 0.1 * t, 1.0 + 2.0 * t - 0.5 * GRAVITY * t * t)
        shown = [f"{x:.6f}" for x in place] if k not in hidden else 3 * [cells or ""]
        if k not in hidden or cells is not None:
            lines.append(f"{flight}," * bool(flight) + ",".join((f"{t:.6f}", *shown)))
    return "\n".join(lines) + "\n"


def written(path: Path, text: str) -> Path:
    """Write a table and return its path."""
    path.write_text(text)
    return path


@pytest.mark.parametrize("cells", ABSENT)
def test_what_was_not_seen_is_the_same_at_every_door(tmp_path: Path, cells: str) -> None:
    """Flights, positions, points of a calibration and Python: as if these rows were not there."""
    with_gap = read_flights(written(tmp_path / "a.csv", fall(cells, flight="f")))
    without = read_flights(written(tmp_path / "b.csv", fall(None, flight="f")))
    assert np.array_equal(with_gap[0].t, without[0].t)
    assert np.array_equal(with_gap[0].r, without[0].r)

    gap, none = (
        read_positions(written(tmp_path / f"{name}.csv", fall(x)))
        for name, x in (("c", cells), ("d", None))
    )
    tracks = [follow_all(x.samples, x.rows.values(), sigma=1e-3) for x in (gap, none)]
    seen = [k for k in range(COUNT) if k not in HIDDEN]
    for own, other in zip(*(track[:5] for track in tracks), strict=True):
        assert isinstance(own, np.ndarray)
        assert np.array_equal(own[seen], other)
        assert np.all(np.isfinite(own))
    assert np.array_equal(gap.flight(""), none.flight(""))

    table = read_table(tmp_path / "c.csv", COLUMNS, seen=POSITION)
    assert np.array_equal(np.isnan(table).any(axis=1), np.isin(np.arange(COUNT), HIDDEN))

    balls = BallFilter(), BallFilter()
    for row in table:
        found = bool(np.isfinite(row).all())
        for ball, given in zip(balls, (True, found), strict=True):
            if given:
                R = 1e-6 * np.eye(3)
                ball.update(Sighting(t=row[0], found=True, r_o=row[1:], covariance=R))
    states = [ball.state(0.5) for ball in balls]
    assert np.array_equal(states[0].r_o, states[1].r_o)


@pytest.mark.parametrize("cells", ABSENT[:2])
def test_a_track_is_empty_where_nothing_is_known(tmp_path: Path, cells: str) -> None:
    """A ball that is hidden at first; no cell that was added is NaN."""
    positions = read_positions(written(tmp_path / "a.csv", fall(cells, hidden=range(5))))
    track = follow_all(positions.samples, positions.rows.values())
    write_track(tmp_path / "t.csv", positions, track, ahead=False)
    lines = (tmp_path / "t.csv").read_text().splitlines()[1:]
    assert all(line.endswith(9 * ",") for line in lines[:5])
    added = [line.split(",")[4:] for line in lines[5:]]
    assert np.isfinite(np.array(added, dtype=float)).all()


@pytest.mark.parametrize("read", [read_positions, read_flights])
def test_a_table_without_any_position_is_refused(
    tmp_path: Path, read: Callable[[Path], object]
) -> None:
    """One line, whichever reader."""
    flight = "f" if read is read_flights else ""
    path = written(tmp_path / "a.csv", fall("", flight=flight, hidden=range(COUNT)))
    with pytest.raises(FileError, match="at least"):
        read(path)


def test_what_has_to_be_there_is_refused_with_a_remedy(tmp_path: Path) -> None:
    """A throw without a velocity, a row without a time."""
    throw = written(tmp_path / "a.csv", "x,y,z,vx,vy,vz\n3,0,0,,0,1\n")
    with pytest.raises(FileError, match=r"column vx.*take that row out"):
        read_throws(throw)
    with pytest.raises(FileError, match=r"line 2 column t_s.*take that row out"):
        read_positions(written(tmp_path / "b.csv", ",".join(COLUMNS) + "\n,1,1,1\n"))


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        (fall(None).replace(",", ";").replace(".", ","), "points for decimals"),
        (fall(None).replace(",", "\t"), "points for decimals"),
        (fall(None).replace(".", ","), "points for decimals"),
        ("Format Version,1.23,Take Name,a\n,Type,Marker\n", "name the columns so"),
        ("Frame,Time,X,Y,Z\n0,0.0,1,2,3\n", "name the columns so"),
        ("#\tx\n", "points for decimals"),
    ],
)
@pytest.mark.parametrize(
    "read", [read_positions, read_flights, read_throws, lambda x: read_table(x, COLUMNS)]
)
def test_tables_of_other_programs_are_told_what_to_do(
    tmp_path: Path, text: str, remedy: str, read: Callable[[Path], object]
) -> None:
    """Semicolons, tabs, decimal commas, other headers: one line with a remedy."""
    with pytest.raises(FileError) as caught:
        read(written(tmp_path / "a.csv", text))
    said = str(caught.value)
    assert remedy in said or (
        remedy == "points for decimals"
        and "name the columns so" in said
        and ";" not in text
        and "\t" not in text
    )
    assert "\n" not in said


def test_a_header_of_another_separator_is_told(tmp_path: Path) -> None:
    """Also where only the header is looked at."""
    with pytest.raises(FileError, match="points for decimals"):
        header_of(written(tmp_path / "a.csv", "x_m;y_m;z_m\n1;2;3\n"))
