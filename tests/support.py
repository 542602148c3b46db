"""Balls, flights, and packages of tutorials that several tests use."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import write_metadata

from mitt.core.arm.arm import Arm
from mitt.core.map.learn import Flight
from mitt.core.signals import Array, BallState


def thorough(cases: Iterable[object], further: Iterable[object]) -> list[object]:
    """Return cases of a test, and further ones that ``make thorough`` runs.

    A case of several parameters is a tuple.
    """
    marked = (x if isinstance(x, tuple) else (x,) for x in further)
    return [*cases, *(pytest.param(*x, marks=pytest.mark.thorough) for x in marked)]


def arrays_in(x: Any) -> Iterator[Any]:  # noqa: ANN401
    """Yield all arrays in a tuple of arrays and of such tuples."""
    for part in x:
        if isinstance(part, tuple):
            yield from arrays_in(part)
        else:
            yield part


def ball_state(
    r_o: Array, dr_o: Array, ddr_o: Array, *, t: float = 0.0, sigma: float = 1e-6
) -> BallState:
    """Return a ball that is known to ``sigma`` [m, m/s], by default exactly."""
    return BallState(
        t=t,
        tracked=True,
        r_o=r_o,
        dr_o=dr_o,
        ddr_o=ddr_o,
        drag=0.0,
        covariance=sigma**2 * np.eye(6),
        t_seen=t,
        t_first=0.0,
    )


def parabola(arm: Arm, rng: np.random.Generator, *, instants: int = 25) -> Flight:
    """Return a drag-free flight from 0.4 s before to 0.01 s after a random point of the catch."""
    q = np.array([rng.uniform(-0.3, 0.3), np.pi / 4 + rng.uniform(-0.2, 0.2), np.pi / 2])
    g = np.array([0.0, 0.0, -9.81])
    dr_c = np.array([-rng.uniform(4.5, 6.0), rng.uniform(-0.5, 0.5), -rng.uniform(1.5, 3.0)])
    r_c, t = arm.position(q), np.linspace(-0.4, 0.01, instants)
    ball = np.array([[r_c + dr_c * s + 0.5 * g * s * s, dr_c + g * s, g] for s in t])
    return Flight(t=t + 0.45, ball=ball, seen=ball[0].copy())


def install(package: Path, into: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a package be found with its entry points as if it were installed, for one test.

    Args:
        package: Its folder, with pyproject.toml and modules.
        into: An empty folder.
        monkeypatch: Takes it away after the test.
    """
    write_metadata(package, into)
    for path in (into, package):
        monkeypatch.syspath_prepend(path)


#: An arm file: the WAM with 80 V and a basket.
BASKET_ARM = """schema = "mitt.arm/1"
[arm]
name = "wam"
limits = "wam-80v"
[hand]
name = "basket"
tilt = -1.065
[map]
q_catch = 1.25
kappa = 1.777
inward = 0.97
"""
