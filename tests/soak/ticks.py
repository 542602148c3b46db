"""Whole ticks fed with garbage, in all phases, checked after each by an independent rule.

The arm is one that does what the torques bring by the catcher's own model, in some episodes the
exact one of :mod:`exact_plant`; it moves on while a tick is late. Clock, encoders, points and
images are garbage by turns (:mod:`soak.garbage`). The rule is that of :mod:`soak.judge`.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np
from exact_plant import ExactPlant

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, CatcherSettings, Phase
from mitt.core.catcher.generators import Direct, Generator, Unoptimised
from mitt.core.errors import InputError, ShapeError
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.head import active_rig
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import TICK, ArmState, Array, BallState, JointReference, Senses
from mitt.core.verdict.feasibility import Outcome, Verdict
from mitt.io.load import build_arm
from mitt.lab.trials.source import aim_of
from mitt.lab.world.throws import default_throw, fly
from soak import garbage
from soak.garbage import Cameras, Channel
from soak.judge import Judge

#: Ticks of an episode, and the share of it that is free of faults in a calm one.
_EPISODE = 900
_CALM = 0.4
#: Flights that are flown once, and faults kept for the report.
_FLIGHTS = 24
_KEPT = 20
#: Share of the episodes with the exact plant.
_EXACT = 0.3
#: Rows and columns of an image [px].
_SIDE = 128
#: Rates at which faults strike a channel, a tick.
_RATES = (0.0, 0.001, 0.003, 0.01, 0.3)


@dataclass(slots=True)
class Count:
    """What became of the ticks.

    Attributes:
        ticks: Ticks made.
        non_finite: Those with a number that is not finite in their command.
        faults: What broke a rule first in an episode, with its tick.
        fault_ticks: How many ticks broke a rule or raised.
        phases: Ticks by phase.
        states: Ticks by state.
        recovered: Recoveries from a stop.
    """

    ticks: int = 0
    non_finite: int = 0
    faults: list[str] = field(default_factory=list)
    fault_ticks: int = 0
    phases: Counter[str] = field(default_factory=Counter)
    states: Counter[str] = field(default_factory=Counter)
    recovered: int = 0


@final
class Wild:
    """A generator that is no map, refuses nothing, and asks for garbage now and then."""

    def __init__(self, f: DirectMap, rng: np.random.Generator) -> None:
        """Take the map that it mostly follows."""
        self._map, self._rng = f, rng
        self._channel = Channel(("absurd", "all", "far", "time"), rng, 0.02)

    def sharpness(self, ball: BallState) -> float:  # noqa: ARG002
        """Find any ball sharp."""
        return 0.0

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Refuse nothing."""
        outcome = (Outcome.FEASIBLE, Outcome.OPEN)[self._rng.integers(2)]
        return replace(Unoptimised(self._map).verdict(ball, q), outcome=outcome)

    def unsettled(self, ball: BallState, q: Array) -> bool:  # noqa: ARG002
        """Wait for nothing."""
        return False

    def returns(self, ball: BallState) -> bool:  # noqa: ARG002
        """Make up its mind now and then."""
        return bool(self._rng.random() < 0.02)

    def waiting(self, ball: BallState) -> BallState:
        """Wait for nothing."""
        return ball

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Wild":  # noqa: ARG002
        """Start nowhere in particular."""
        return self

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map, and spoil it."""
        asked, rng, fault = self._map.reference(ball), self._rng, self._channel.next()
        if not fault:
            return asked
        if fault == "time":
            return replace(asked, time_to_catch=garbage.absurd(rng))
        rows = np.array([asked.q_d, asked.dq_d, asked.ddq_d])
        if fault == "absurd":
            rows[rng.integers(3), rng.integers(rows.shape[1])] = garbage.absurd(rng)
        elif fault == "all":
            rows[:] = garbage.absurd(rng)
        else:
            rows += 10.0 ** rng.uniform(-2.0, 6.0) * rng.standard_normal(rows.shape)
        return replace(asked, q_d=rows[0], dq_d=rows[1], ddq_d=rows[2])

    def as_map(self) -> DirectMap | None:
        """Be no map."""
        return None


@dataclass(frozen=True, slots=True)
class Setting:
    """What an episode can be made of: arms, a map, flights by their positions each tick."""

    arms: tuple[Arm, ...]
    map: DirectMap
    flights: Sequence[Array]


def setting(f: DirectMap, seed: int) -> Setting:
    """Return arms and flights for a map of the WAM."""
    arm, rng = f.arm, np.random.default_rng(seed)
    throws = [default_throw(rng, aim_of(arm)) for _ in range(_FLIGHTS)]
    flights = [
        np.array([fly(x.r, x.dr, drag=0.04, duration=k * TICK)[0] for k in range(_EPISODE)])
        for x in throws
    ]
    weaker = build_arm("wam", limits="wam-48v", hand=arm.model.hand)
    return Setting((arm, arm, weaker), f, flights)


def soak(ticks: int, *, seed: int, f: DirectMap) -> Count:
    """Make ``ticks`` ticks on garbage with the WAM and a map of it."""
    count, place, episode = Count(), setting(f, seed), 0
    while count.ticks < ticks:
        _Episode(place, np.random.default_rng((seed, episode)), f"episode {episode}").run(
            count, min(_EPISODE, ticks - count.ticks)
        )
        episode += 1
    return count


@final
class _Episode:
    """One catcher, one ball, one set of faults."""

    def __init__(self, place: Setting, rng: np.random.Generator, name: str) -> None:
        """Draw the episode."""
        self._rng, self._name = rng, name
        self._arm = place.arms[rng.integers(len(place.arms))]
        self._flight = place.flights[int(rng.integers(len(place.flights)))]
        rig = active_rig() if rng.random() < 0.2 else fixed_rig()
        self._cameras = Cameras(rig, rng) if rng.random() < 0.5 else None
        settings = CatcherSettings()
        generators: tuple[Generator, ...] = (
            Direct(place.map),
            Direct(place.map),
            Unoptimised(place.map),
            Wild(place.map, rng),
        )
        generator = generators[rng.integers(len(generators))]
        self._catcher = Catcher(self._arm, generator, Eyes(rig), settings=settings)
        self._judge = Judge(self._arm, settings)
        kinds = garbage.CLOCKS, garbage.ENCODERS, garbage.POINTS, garbage.IMAGES
        rates = _RATES[rng.integers(2) :]
        self._channels = [Channel(kind, rng, float(rng.choice(rates))) for kind in kinds]
        self._calm = int(_CALM * _EPISODE * rng.random()) if rng.random() < 0.5 else 0
        self._joints, self._found, self._now = self._start(), False, 0.0
        self._plant = ExactPlant(self._arm) if rng.random() < _EXACT else None
        if self._plant is not None:
            self._plant.state[:] = self._joints

    def _start(self) -> Array:
        """Return q, dq of the arm at the start: mostly ready, at times anywhere."""
        still, rng = np.array([self._arm.q_ready, np.zeros(self._arm.n)]), self._rng
        if rng.random() < 0.8:
            return still
        anywhere: Array = still + rng.standard_normal(still.shape) * np.array([[1.0], [5.0]])
        return anywhere

    def run(self, count: Count, ticks: int) -> None:
        """Make the ticks."""
        before, told, catcher = self._joints, 0.0, self._catcher
        for k in range(ticks):
            faults = [channel.next() if k >= self._calm else "" for channel in self._channels]
            time = garbage.passed(faults[0], self._rng)
            if k > 0:
                before = self._joints
                self._move(time)
                self._now += time
            told = garbage.clock(faults[0], self._now, told, self._rng)
            fault = self._tick(self._sense(told, faults, before))
            count.ticks += 1
            count.phases[catcher.phase.value] += 1
            if (made := catcher.tick) is not None:
                count.states[made.state.value] += 1
            if fault:
                count.fault_ticks += 1
                count.non_finite += fault.startswith("not finite")
                if len(count.faults) < _KEPT and not self._found:
                    count.faults.append(f"{self._name} tick {k} {faults}: {fault}")
                self._found = True
                if fault.startswith("raised"):
                    return
            if catcher.phase is Phase.STOPPED and self._rng.random() < 0.1:
                count.recovered += self._recovers()

    def _sense(self, t: float, faults: list[str], before: Array) -> Senses:
        """Return what the catcher is told."""
        rng, r_o = self._rng, self._flight[min(round(self._now / TICK), _EPISODE - 1)]
        arm: ArmState = garbage.encoders(faults[1], t, self._joints, before, rng)
        if self._cameras is None:
            return Senses(t=t, arm=arm, points=garbage.points(faults[2], t, r_o, rng))
        seen = self._cameras.frames(faults[3], t, r_o, 0.04) if self._catcher.looking else ()
        return Senses(t=t, arm=arm, frames=seen)

    def _tick(self, senses: Senses) -> str:
        """Make a tick; return what went wrong.

        An image of another size is refused, and the tick is made without it.
        """
        try:
            try:
                command = self._catcher.step(senses)
            except ShapeError:
                fitting = tuple(x for x in senses.frames if x.pixels.shape == (_SIDE, _SIDE))
                if len(fitting) == len(senses.frames):
                    raise
                command = self._catcher.step(replace(senses, frames=fitting))
            slowest = self._catcher.state.safety.bounds["dq_max"].copy()
            self._catcher.think()
        except Exception as error:
            return f"raised {type(error).__name__}: {error}"
        self._told = command
        return self._judge.fault(self._catcher, command, slowest)

    def _move(self, time: float) -> None:
        """Let the arm do for so long what the torques bring, within what joints can do at all."""
        (q, dq), arm = self._joints, self._arm
        if self._plant is not None:
            self._plant.move(self._told, time)
            self._joints = self._plant.state.copy()
            return
        command, brakes = self._catcher.result.command, self._catcher.result.scalars["brakes"]
        push = self._catcher.state.monitor.ddq_by_tau
        if brakes.item() and not command[3].any():
            dq = 0.0 * dq  # the brakes hold
        dq = np.clip(dq + time * np.nan_to_num(push), -arm.dq_max, arm.dq_max)
        self._joints = np.array([np.clip(q + time * dq, arm.q_min, arm.q_max), dq])

    def _recovers(self) -> bool:
        """Ask the catcher to recover; return whether it did."""
        try:
            self._catcher.recover(checked=bool(self._rng.random() < 0.5))
        except InputError:
            return False
        self._judge.reset()
        return True
