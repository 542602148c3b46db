"""Throws: drawn within the contract or read from a file checked cell by cell, and their flight."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.errors import FileError, InputError, ShapeError
from mitt.core.signals import GRAVITY
from mitt.io.csv_table import MAX_BYTES
from mitt.lab.world.throws import (
    Aim,
    ThrowRanges,
    default_throw,
    fly,
    read_throws,
    release_velocity,
)

NEAR_M = 1e-6
HEADER = "x,y,z,vx,vy,vz\n"


@pytest.fixture(name="aim")
def _aim(arm: Arm) -> Aim:
    """The catch region of the contract."""
    middle, half = np.array([0.0, np.pi / 4, np.pi / 2]), np.array([0.3, 0.22, 0.0])
    return Aim(position=arm.position, q_low=middle - half, q_high=middle + half)


def test_default_throws_keep_the_contract(aim: Aim) -> None:
    """Speed, height and place of the release, and a catch point that the ball passes in time."""
    rng, ranges = np.random.default_rng(4), ThrowRanges()
    radius = float(np.linalg.norm(aim.position(aim.q_low)))
    for _ in range(60):
        throw = default_throw(rng, aim)
        assert 5.0 <= np.linalg.norm(throw.dr) <= 7.1
        assert -0.2 <= throw.r[2] <= 0.6
        times = np.linspace(*ranges.duration, 400)
        way = np.array([fly(throw.r, throw.dr, drag=0.04, duration=s)[0] for s in times])
        nearest = way[np.abs(np.linalg.norm(way, axis=1) - radius).argmin()]
        distance = np.hypot(*(throw.r - nearest)[:2])
        azimuth = np.arctan2(*(throw.r - nearest)[1::-1])
        assert np.linalg.norm(nearest) == pytest.approx(radius, abs=0.01)
        assert 2.49 < distance < 4.21
        assert abs(azimuth) < 0.125


@pytest.mark.parametrize("drag", [0.0, 0.3, 0.5])
def test_throws_are_aimed_with_the_drag_of_the_ball(aim: Aim, drag: float) -> None:
    """A ball with another drag leaves the same hand and passes the same point at the same time."""
    nominal, other = ThrowRanges(), ThrowRanges(drag=drag)
    for seed in range(20):
        throw, usual = (
            default_throw(np.random.default_rng(seed), aim, ranges) for ranges in (other, nominal)
        )
        assert np.array_equal(throw.r, usual.r)
        t = np.linspace(*nominal.duration, 400)
        ways = [
            np.array([fly(x.r, x.dr, drag=k, duration=s)[0] for s in t])
            for x, k in ((throw, drag), (usual, 0.04))
        ]
        assert np.linalg.norm(ways[0] - ways[1], axis=1).min() < NEAR_M + 2e-2 * abs(drag - 0.04)


def test_a_seed_is_a_throw(aim: Aim) -> None:
    """The same seed draws the same throw, another seed another."""
    first, again, other = (default_throw(np.random.default_rng(s), aim) for s in (1, 1, 2))
    assert np.array_equal(first.r, again.r)
    assert np.array_equal(first.dr, again.dr)
    assert not np.array_equal(first.r, other.r)


def test_ranges_without_a_throw_are_refused(aim: Aim) -> None:
    """Nobody throws 4 m in half a second at 1 m/s: that is said, not tried for ever."""
    with pytest.raises(InputError, match="release speed"):
        default_throw(np.random.default_rng(0), aim, ThrowRanges(speed=(1.0, 1.1)), tries=20)


def test_an_aim_must_be_a_box(aim: Aim) -> None:
    """Corners of different length, or the wrong way round, are refused."""
    with pytest.raises(ShapeError):
        Aim(position=aim.position, q_low=aim.q_low, q_high=np.zeros(2))
    with pytest.raises(InputError):
        Aim(position=aim.position, q_low=aim.q_high, q_high=aim.q_low)


def test_throws_are_read_in_any_order_of_columns(tmp_path: Path) -> None:
    """Columns go by name; a byte order mark, blank lines and spaces do no harm."""
    path = tmp_path / "throws.csv"
    path.write_text("\ufeffvx,vy,vz,x, y,z\n-6,0,1.5,3.5,0.1,0.2\n\n-5,0,2,3,0,0\n")
    first, second = read_throws(path)
    assert first.r.tolist() == [3.5, 0.1, 0.2]
    assert first.dr.tolist() == [-6.0, 0.0, 1.5]
    assert second.dr.tolist() == [-5.0, 0.0, 2.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1"),
        ("x,y,z\n1,2,3\n", "columns x,y,z,vx,vy,vz"),
        (HEADER.replace("\n", ",w\n") + "1,2,3,4,5,6,7\n", "columns"),
        ("x,x,z,vx,vy,vz\n1,2,3,4,5,6\n", "columns"),
        (HEADER, "at least one throw"),
        (HEADER + "1,2,3,4,5,6\n1,2,3,4,5\n", "line 3"),
        (HEADER + "1,2,3,4,five,6\n", "line 2 column vy"),
        (HEADER + "1,2,3,4,nan,6\n", "line 2 column vy"),
        (HEADER + "1,inf,3,4,5,6\n", "line 2 column y"),
        (HEADER + "3500,0,0,-6,0,1\n", "within +-100"),
        (HEADER + '"1,2,3,4,5,6\n', "CSV"),
        (HEADER + "1,2,\0,4,5,6\n", "NUL"),
    ],
)
def test_a_bad_file_is_one_line_that_says_where(tmp_path: Path, text: str, said: str) -> None:
    """Each fault of a table names the file and, where there is one, the line and column."""
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        read_throws(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """Missing, a folder, not text, or too large: an error of ours, not of the machine."""
    binary, large = tmp_path / "binary.csv", tmp_path / "large.csv"
    binary.write_bytes(b"\xff\xfe\x00x")
    large.write_bytes(b"1" * (MAX_BYTES + 1))
    for path in (tmp_path / "missing.csv", tmp_path, binary, large):
        with pytest.raises(FileError):
            read_throws(path)


MISS_M = 1e-9
coordinate = st.floats(-3.0, 3.0)


@given(
    x=st.floats(2.0, 5.0),
    y=coordinate,
    z=coordinate,
    drag=st.floats(0.0, 0.2),
    duration=st.floats(0.3, 0.8),
)
def test_the_shot_hits(x: float, y: float, z: float, drag: float, duration: float) -> None:
    """Flying the released ball for the wanted time ends at the target."""
    start, target = np.array([x, y, z]), np.array([0.5, 0.1, 0.0])
    dr = release_velocity(start, target, drag=drag, duration=duration)
    assert fly(start, dr, drag=drag, duration=duration)[0] == pytest.approx(target, abs=MISS_M)


@given(duration=st.floats(0.05, 1.0))
def test_without_drag_a_flight_is_a_parabola(duration: float) -> None:
    """Position and velocity are those of free fall, and the arguments are left alone."""
    r, dr = np.array([3.0, 0.1, 0.5]), np.array([-6.0, 0.2, 2.0])
    end, speed = fly(r, dr, drag=0.0, duration=duration)
    g = np.array([0.0, 0.0, -GRAVITY])
    assert end == pytest.approx(r + dr * duration + 0.5 * g * duration**2, abs=MISS_M)
    assert speed == pytest.approx(dr + g * duration, abs=MISS_M)
    assert r.tolist() == [3.0, 0.1, 0.5]
