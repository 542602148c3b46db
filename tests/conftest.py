"""What tests share: the arm, a few flights, a learned map, and a fixed Hypothesis profile."""

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from mitt.generator.flights import Flight
from mitt.generator.learn import Learned, learn
from mitt.generator.mapping import DirectMap, MapDesign, unlearned
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import Array, BallState

settings.register_profile(
    "mitt", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("mitt")


def ball_state(r_o: Array, dr_o: Array, ddr_o: Array, *, t: float = 0.0) -> BallState:
    """Return a ball that is known exactly."""
    return BallState(
        t=t,
        tracked=True,
        r_o=r_o,
        dr_o=dr_o,
        ddr_o=ddr_o,
        drag=0.0,
        covariance=1e-12 * np.eye(6),
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


@pytest.fixture(scope="session")
def arm() -> Arm:
    """The WAM with the limits that the paper's experiment needs."""
    return load_arm("wam", limits="paper")


@pytest.fixture(scope="session")
def plain(arm: Arm) -> DirectMap:
    """The map with alpha = 0."""
    return unlearned(arm, MapDesign())


@pytest.fixture(scope="session")
def flights(arm: Arm) -> list[Flight]:
    """Forty drag-free flights."""
    rng = np.random.default_rng(11)
    return [parabola(arm, rng) for _ in range(40)]


@pytest.fixture(scope="session")
def learned(arm: Arm, flights: list[Flight]) -> Learned:
    """A map learned from them."""
    return learn(arm, MapDesign(), flights)
