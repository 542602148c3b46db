"""Tables in other axes and units are doubted; what flies, spins, rolls or is carried is not."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mitt.core.errors import FileError
from mitt.core.signals import GRAVITY, Array
from mitt.lab.world.fall import doubt_of, doubt_of_throws
from mitt.lab.world.flights import builtin_flights, read_flights

Flights = list[tuple[Array, Array]]


def _thrown(
    count: int = 6, rate: float = 120.0, lift: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Flights:
    """Return throws with drag and an acceleration by spin [m/s^2], 1 mm of noise."""
    rng = np.random.default_rng(5)
    out = []
    for _ in range(count):
        t = np.arange(0.0, rng.uniform(0.45, 0.9), 1.0 / rate)
        r, dr = np.array((3.4, 0.1, 1.0)), np.array((rng.uniform(-7, -5), 0.3, rng.uniform(1, 3)))
        rows = np.empty((len(t), 3))
        for k in range(len(t)):
            rows[k] = r
            ddr = np.array(lift) - (0.0, 0.0, GRAVITY) - 0.1 * np.linalg.norm(dr) * dr
            r, dr = r + dr / rate + 0.5 * ddr / rate**2, dr + ddr / rate
        out.append((t, rows + rng.normal(0.0, 1e-3, rows.shape)))
    return out


#: What a table may be in, and a word of what the doubt says.
_TURNED = {
    "along -y": lambda r: np.stack((r[:, 0], r[:, 2], -r[:, 1]), 1),
    "along +y": lambda r: np.stack((r[:, 0], -r[:, 2], r[:, 1]), 1),
    "along -x": lambda r: np.stack((r[:, 2], r[:, 0], r[:, 1]), 1),
    "along +x": lambda r: np.stack((-r[:, 2], r[:, 1], r[:, 0]), 1),
    "along +z": lambda r: np.stack((r[:, 0], -r[:, 1], -r[:, 2]), 1),
}


def _named(text: str, turn: str) -> bool:
    """Say whether ``x, -z, y`` of a remedy turns rows back."""
    return text.endswith(f"write {turn} for x, y, z")


@pytest.mark.parametrize("axis", _TURNED)
@pytest.mark.parametrize("flights", [_thrown(), [(x.t, x.r) for x in builtin_flights()]])
def test_another_axis_up_is_named_and_its_remedy_turns_it_back(axis: str, flights: Flights) -> None:
    """The remedy makes the recording fall along -z again, right-handed."""
    turned = [(t, _TURNED[axis](r)) for t, r in flights]
    doubt = doubt_of(turned)
    assert doubt is not None
    assert axis in doubt.given
    parts = doubt.do.removeprefix("turn the axes: write ").removesuffix(" for x, y, z").split(", ")
    matrix = np.array(
        [np.eye(3)["xyz".index(p[-1])] * (-1.0 if p[0] == "-" else 1.0) for p in parts]
    )
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    assert doubt_of([(t, r @ matrix.T) for t, r in turned]) is None


@pytest.mark.parametrize(
    ("metre", "second", "said"),
    [
        (1000.0, 1.0, "mm"),
        (100.0, 1.0, "cm"),
        (1.0 / 0.0254, 1.0, "inches"),
        (1.0 / 0.3048, 1.0, "feet"),
        (1.0, 1e3, "ms"),
        (1.0, 1e6, "us"),
        (1.0, 1e9, "ns"),
        (1000.0, 1e3, "mm and ms"),
        (1.0, 120.0, "frames"),
        (1.0, 200.0, "frames"),
        (1.0, 4.0, "slow motion"),
        (1.0, 8.0, "slow motion"),
    ],
)
def test_another_unit_is_named(metre: float, second: float, said: str) -> None:
    """Lengths, times and both."""
    doubt = doubt_of([(t * second, r * metre) for t, r in _thrown()])
    assert doubt is not None
    assert said in doubt.given + doubt.do


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "lift", [(0.0, 0.0, 5.0), (0.0, 0.0, 9.0), (0.0, 0.0, -15.0), (0.0, 12.0, 0.0), (0.0, 8.0, 8.0)]
)
def test_spin_is_no_doubt(seed: int, lift: tuple[float, float, float]) -> None:
    """A ball is lifted, pushed down or aside by up to 15 m/s^2."""
    rng = np.random.default_rng(seed)
    assert doubt_of(_thrown(lift=tuple(np.array(lift) * rng.uniform(0.9, 1.0)))) is None


_T = np.arange(0.0, 3.0, 0.01)
_MOVED: dict[str, Callable[[Array], Array]] = {
    "rolls on a table": lambda t: np.stack((2.0 - 0.5 * t, 0.1 * t, 0 * t), 1),
    "rolls to a stop": lambda t: np.stack((2.0 - t + 0.15 * t**2, 0 * t, 0 * t), 1),
    "rolls down a ramp": lambda t: np.stack((3.0 - 0.6 * t**2, 0 * t, 2.0 - 0.2 * t**2), 1),
    "lies still": lambda t: np.zeros((len(t), 3)),
    "is carried": lambda t: np.stack((np.cos(2 * t), 0.3 * np.sin(3 * t), 0.2 * np.sin(2 * t)), 1),
    "hangs on a string": lambda t: np.stack((np.sin(3 * t), 0 * t, -np.cos(np.sin(3 * t))), 1),
    "circles on a table": lambda t: np.stack((np.cos(3.1 * t), np.sin(3.1 * t), 0 * t), 1),
    "rides on a belt": lambda t: np.stack((0.005 * t, 0 * t, 0 * t), 1),
}


@pytest.mark.parametrize("how", _MOVED)
@pytest.mark.parametrize("noise", [0.0, 1e-3, 5e-3])
def test_what_does_not_fly_is_no_doubt(how: str, noise: float) -> None:
    """Slow and rolling recordings are what they are."""
    rows = _MOVED[how](_T)
    noisy = rows + np.random.default_rng(2).normal(0.0, 1.0, rows.shape) * noise
    assert doubt_of([(_T, noisy)]) is None


def test_bounces_and_one_odd_flight_are_no_doubt() -> None:
    """Most flights have to say the same."""
    flights = _thrown(4)
    bounced = [(t, np.column_stack((r[:, :2], np.abs(r[:, 2] - 0.8)))) for t, r in flights]
    odd = [(flights[0][0] * 1e3, flights[0][1])]
    assert doubt_of(bounced + odd) is None
    assert doubt_of([(x.t, x.r) for x in builtin_flights()]) is None
    assert doubt_of([]) is None


def test_throws_that_miss_only_as_they_are_written_are_doubted() -> None:
    """Another axis up, or another unit; throws that go nowhere near are left alone."""
    rng = np.random.default_rng(3)
    r = np.array((3.0, 0.0, 0.3)) + rng.uniform(-0.2, 0.2, (20, 3))
    target = np.array((0.7, 0.0, 0.2)) + rng.uniform(-0.2, 0.2, (20, 3))
    dr = (target - r) / 0.5 + np.array((0.0, 0.0, 0.25 * GRAVITY))
    assert doubt_of_throws(r, dr) is None
    for metre, said in ((1.0 / 0.3048, "feet"), (100.0, "cm"), (1000.0, "mm")):
        doubt = doubt_of_throws(r * metre, dr * metre)
        assert doubt is not None
        assert said in doubt.given
    away = dr * (-1.0, 1.0, 1.0)
    assert doubt_of_throws(r, away) is None


def test_a_table_with_y_up_is_refused_in_one_line(tmp_path: Path) -> None:
    """It names the file, the axis and what to do; z up is read."""
    for name, up in (("z.csv", 2), ("y.csv", 1)):
        order = (0, 1, 2) if up == 2 else (0, 2, 1)
        rows = [
            f"{n},{t:.6f},{r[order[0]]:.6f},{r[order[1]]:.6f},{r[order[2]]:.6f}"
            for n, (times, points) in enumerate(_thrown(3))
            for t, r in zip(times, points, strict=True)
        ]
        path = tmp_path / name
        path.write_text("flight,t_s,x_m,y_m,z_m\n" + "\n".join(rows) + "\n")
        if up == 2:
            assert len(read_flights(path)) == 3
            continue
        with pytest.raises(FileError, match=r"y\.csv.*along -y; turn the axes") as caught:
            read_flights(path)
        assert "\n" not in str(caught.value)
