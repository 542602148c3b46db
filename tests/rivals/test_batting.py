"""Rivals that strike a ball: each is at the contact as it asks for it, and hits in the world."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.ball.flight import acceleration, advance
from mitt.core.catcher.batting import Batting
from mitt.core.errors import UnknownNameError
from mitt.core.map.demand import Tolerance
from mitt.core.map.striking import PaddleStrike
from mitt.core.signals import TICK, Array, BallState
from mitt.core.verdict.pieces import Pieces
from mitt.lab.rivals.batting import BATTERS, BatRival, make_batter
from mitt.lab.trials.bat_station import BatStation, bat_station
from mitt.lab.trials.batting import BatRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import named_scene

TARGET = np.array([3.0, 0.0, 0.3])
#: How far joints may be from what the contact asks for [rad, rad/s].
NEAR = 2e-3
SLOW = 0.05
RIVALS = [name for name in BATTERS if name != "direct"]


@pytest.fixture(scope="module")
def station() -> BatStation:
    """The station of the WAM, its map as it begins."""
    return bat_station("wam", scene=named_scene("ideal"), target=TARGET, learns=False)


@pytest.fixture(scope="module")
def batting(station: BatStation) -> Batting:
    """The map, which refuses nothing that it can strike."""
    return replace(station.batting, tolerance=Tolerance(torque=1e3, speed=1e3))


def _ball(t: float, met: np.ndarray, left: float) -> BallState:
    """Return a ball so long before it is somewhere [s]."""
    r, dr = met.copy()
    advance(r, dr, 0.04, -left)
    ddr = np.empty(3)
    acceleration(dr, 0.04, ddr)
    return BallState(
        t=t,
        r_o=r,
        dr_o=dr,
        ddr_o=ddr,
        covariance=1e-9 * np.eye(6),
        drag=0.04,
        t_seen=t,
        t_first=-0.1,
    )


@pytest.mark.parametrize("name", RIVALS)
def test_the_joints_are_at_the_contact_as_it_asks(
    name: str, station: BatStation, batting: Batting, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In angle and speed, for a ball that flies as it was foreseen; its contact is chosen once."""
    chosen, choose = list[float](), Batting._contacts

    def contacts(
        g: Batting, ball: BallState, q: Array, pieces: Pieces
    ) -> list[tuple[float, PaddleStrike]]:
        chosen.append(ball.t)
        return choose(g, ball, q, pieces)

    monkeypatch.setattr(Batting, "_contacts", contacts)
    arm, lasts = station.arm, 0.45
    met = np.array([arm.position(np.array([0.0, 0.2, 0.0, 0.9])), [-5.0, 0.1, -2.5]])

    def flight(t: float) -> tuple[np.ndarray, np.ndarray]:
        ball = _ball(t, met, lasts - t)
        return ball.r_o, ball.dr_o

    rival = make_batter(name, batting, flight=flight)
    assert isinstance(rival, BatRival)
    start = _ball(0.0, met, lasts)
    assert rival.verdict(start, arm.q_ready).share < np.inf
    rival = rival.adapt(start, arm.q_ready, np.zeros(arm.n))
    assert chosen == [0.0]
    strike, t_c = rival.batting.strike, rival.batting.t_contact
    assert strike is not None
    for t in np.arange(0.0, t_c, TICK).tolist():
        answer = rival.reference(_ball(t, met, lasts - t))
    q = answer.q_d + (t_c - t) * answer.dq_d
    assert q == pytest.approx(strike.q, abs=NEAR)
    assert answer.dq_d == pytest.approx(strike.dq, abs=SLOW)


@pytest.mark.parametrize("name", ["ik", "clairvoyant"])
def test_a_rival_hits_balls_in_the_world(name: str, station: BatStation, batting: Batting) -> None:
    """Towards the target, within every limit."""
    source = source_of(station.arm, seed=2, drag=station.scene.ball.drag, count=1)
    s = replace(station, batting=batting)
    trial = BatRunner(s, source, pixels=False, generator=name).trial(0)
    assert trial.status == "returned"
    assert trial.limit_violations == 0


def test_a_rival_needs_a_name_that_is_known(batting: Batting) -> None:
    """The others are named."""
    with pytest.raises(UnknownNameError, match="quintic"):
        make_batter("another", batting)
