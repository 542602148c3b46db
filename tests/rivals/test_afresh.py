"""A generator begins each throw as new: the same throw is the same trial, whatever came before."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Any, final

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import (
    Direct,
    Generator,
    Remembering,
    fresh_for_throw,
    refining,
)
from mitt.core.catcher.given import added
from mitt.core.catcher.meeting import Meeting, MeetingSettings
from mitt.core.map.demand import Tolerance
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.map.meeting import unlearned_meeting
from mitt.core.signals import GRAVITY, TICK, Array, BallState, JointReference
from mitt.core.verdict.feasibility import Verdict
from mitt.io.arm_file import load_arm
from mitt.lab.rivals.batting import BATTERS, make_batter
from mitt.lab.rivals.meeting import MEETERS, encoder_of, make_meeter
from mitt.lab.trials.bat_station import bat_station
from mitt.lab.trials.registry import BUILT_IN, make_generator
from mitt.lab.world.scene import named_scene

#: Ticks for which a ball is watched, and followed.
WATCHED = 3
FOLLOWED = 5
Flight = Callable[[float], BallState]


@final
@dataclass(frozen=True)
class Grudge(Generator):
    """Another package's generator, which refuses the more the more it was asked."""

    inner: Direct
    asked: list[float] = field(default_factory=list)

    def sharpness(self, ball: BallState) -> float:
        """Return what the map says."""
        return self.inner.sharpness(ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Add what was asked before to the share of the limit."""
        self.asked.append(ball.t)
        said = self.inner.verdict(ball, q)
        return replace(said, share=said.share + len(self.asked))

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Grudge":
        """Adapt the map."""
        return replace(self, inner=self.inner.adapt(ball, q, dq))

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map."""
        return self.inner.reference(ball)

    def as_map(self) -> DirectMap:
        """Hand the map over."""
        return self.inner.as_map()

    def afresh(self) -> "Grudge":
        """Return the one that was asked nothing."""
        return Grudge(self.inner)


def trial(given: Generator, flight: Flight, arm: Arm) -> list[Any]:
    """Return all that a generator says in a throw: verdicts, then references of what follows."""
    g, q, still, said = fresh_for_throw(given), arm.q_ready, np.zeros(arm.n), list[Any]()
    encoder = encoder_of(g)
    for k in range(WATCHED + FOLLOWED):
        ball = flight(k * TICK)
        if encoder is not None:
            encoder.read(ball.t, 0.15 * ball.t)
        if k < WATCHED:
            verdict = g.verdict(ball, q)
            said += [verdict, g.sharpness(ball), g.unsettled(ball, q), g.returns(ball)]
        else:
            g = g.adapt(ball, q, still) if k == WATCHED else g
            answer = g.reference(ball)
            said += [x.tobytes() for x in (answer.q_d, answer.dq_d, answer.ddq_d)]
    return said


def holds(given: Generator, one: Flight, other: Flight, arm: Arm) -> None:
    """Check that a throw is the same before and after another throw, and its own repetition."""
    first = trial(deepcopy(given), one, arm)
    assert trial(given, one, arm) == first
    trial(given, other, arm)
    assert trial(given, one, arm) == first


def flying(r: Array, dr: Array) -> Flight:
    """Return estimates of a ball that flies, known exactly."""
    g = np.array([0.0, 0.0, -GRAVITY])
    return lambda t: BallState(
        t=t,
        r_o=r + t * dr + 0.5 * t * t * g,
        dr_o=dr + t * g,
        ddr_o=g,
        covariance=1e-8 * np.eye(6),
        t_seen=t,
        t_first=0.0,
    )


GOOD = flying(np.array([2.6, 0.05, 0.5]), np.array([-5.2, -0.05, 1.3]))
WIDE = flying(np.array([2.4, 0.4, 0.6]), np.array([-5.0, 0.3, 1.2]))


@pytest.mark.parametrize("name", [x for x in BUILT_IN if x not in ("mpc", "clairvoyant")])
def test_what_catches(name: str, arm: Arm, learned: Learned) -> None:
    """Every generator by name, but for those that only a solver's package makes."""
    holds(make_generator(name, learned.map), GOOD, WIDE, arm)


@pytest.mark.parametrize("name", ["mpc", "clairvoyant"])
def test_what_catches_by_a_solver(name: str, arm: Arm, learned: Learned) -> None:
    """The same; the oracle knows the flight that it is asked about."""
    pytest.importorskip("casadi")
    generator: Any = make_generator(name, learned.map)
    if name == "clairvoyant":
        generator = generator.with_flight(lambda t: (GOOD(t).r_o, GOOD(t).dr_o))
        assert isinstance(generator, Remembering)
    holds(generator, GOOD, WIDE, arm)


def test_what_is_refined(arm: Arm, learned: Learned) -> None:
    """One map, refined for each ball."""
    holds(refining(learned.map), GOOD, WIDE, arm)


def test_what_another_package_adds(arm: Arm, learned: Learned) -> None:
    """Held to its answers, it is asked to begin anew as ours are; a catcher does so each time."""
    inner = Grudge(Direct(learned.map))
    assert trial(inner, GOOD, arm)[0].share != inner.verdict(GOOD(0.0), arm.q_ready).share + 1.0
    holds(added("generator", inner, arm.n), GOOD, WIDE, arm)
    catcher, asked = Catcher(arm, inner), inner.asked.copy()
    again = catcher.again(inner)
    for one in (catcher, again):
        used = one._planner.generator
        assert used.verdict(GOOD(0.0), arm.q_ready) == trial(inner, GOOD, arm)[0]
    assert inner.asked == asked


@pytest.mark.parametrize("name", BATTERS)
def test_what_bats(name: str) -> None:
    """The batting map and its rivals, wrappers of it; it refuses nothing that it can strike."""
    if name in ("mpc", "clairvoyant"):
        pytest.importorskip("casadi")
    target = np.array([3.0, 0.0, 0.3])
    station = bat_station("wam", scene=named_scene("ideal"), target=target, learns=False)
    batting = replace(station.batting, tolerance=Tolerance(torque=1e3, speed=1e3))
    place = station.arm.position(np.array([0.0, 0.2, 0.0, 0.9]))

    def before(speed: float) -> Flight:
        """Return estimates of a ball that is there 0.45 s after the first of them."""
        dr = np.array([-speed, 0.1, -2.5])
        down = np.array([0.0, 0.0, 0.5 * GRAVITY * 0.45**2])
        return flying(place - 0.45 * dr - down, dr + down / 0.225)

    ball = before(5.0)
    generator = make_batter(name, batting, flight=lambda t: (ball(t).r_o, ball(t).dr_o))
    holds(generator, ball, before(4.8), station.arm)


@pytest.mark.parametrize("name", MEETERS)
def test_what_meets(name: str) -> None:
    """The meeting map and its rivals, wrappers of it."""
    if name == "mpc":
        pytest.importorskip("casadi")
    arm = load_arm("wam")
    arm = Arm(replace(arm.model, q_ready=np.array([0.2, 0.5, 1.5])), arm.limits)
    f = unlearned_meeting(arm, (0, 1, 2))
    meeting = Meeting(f, MeetingSettings(shortest=0.6, closing=0.3, along=(0.0, 1.0, 0.0)))
    start = arm.position(arm.q_ready) + np.array([0.05, -0.1, 0.0])

    def part(speed: float) -> Flight:
        dr = np.array([0.0, speed, 0.0])
        return lambda t: BallState(
            t=t,
            r_o=start + t * dr,
            dr_o=dr,
            ddr_o=np.zeros(3),
            led=True,
            covariance=1e-8 * np.eye(6),
            t_seen=t,
        )

    holds(make_meeter(name, meeting, rate=50.0), part(0.15), part(0.1), arm)
