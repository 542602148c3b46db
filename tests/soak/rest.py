"""An arm of which a catcher says that it rests: it moves no more until it is told to.

Throws on the true plant, in which friction, masses and encoders are not as modelled, and on one
that does exactly what the model says. In the middle of some the catcher is told to stop, or the
ball stays where it is, as where somebody catches it; after some the arm is moved, and its motion
pauses on the way.
"""

from dataclasses import dataclass, field

import numpy as np
from exact_plant import FALL, SIGMA, ExactPlant

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.catcher.generators import Generator
from mitt.core.errors import InputError
from mitt.core.signals import TICK, ArmState, Array, Senses, Sighting
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.slow_motion import slow_motion
from mitt.lab.trials.source import Source
from mitt.lab.world.engine import BALL_ANY
from mitt.lab.world.throws import Throw
from mitt.lab.world.truth import Trace

#: Longest throw, and how long it is gone on with once it is over [s].
LONGEST = 1.8
AFTER = 0.15
#: How far a joint that rests may creep [rad].
CREEPS = 0.005
#: Pause in the middle of a motion [ticks].
PAUSE = 120


@dataclass(slots=True)
class Rested:
    """What was found.

    Attributes:
        throws, over: How many were thrown, and how many of these were over.
        ticks: Ticks in which the arm was said to rest.
        worst: Farthest that a joint moved after such a tick [rad].
        faults: Throws in which it was more than ``CREEPS``, and how much.
    """

    throws: int = 0
    over: int = 0
    ticks: int = 0
    worst: float = 0.0
    faults: list[str] = field(default_factory=list)

    def judge(self, name: str, done: list[bool], q: list[Array]) -> None:
        """Take what was said, tick by tick, and where the arm was, of ticks without an order."""
        said, places = np.flatnonzero(done), np.array(q)
        if len(said) == 0:
            return
        self.ticks += len(said)
        high = np.maximum.accumulate(places[::-1])[::-1]
        low = np.minimum.accumulate(places[::-1])[::-1]
        moved = np.maximum(high - places, places - low)[said].max()
        self.worst = max(self.worst, float(moved))
        if moved > CREEPS:
            self.faults.append(f"{name}: {1e3 * moved:.1f} mrad after tick {said[0]}")


def kind_of(k: int) -> str:
    """Return what happens in a throw."""
    return ("none", "stop", "none", "freezes", "move")[k % 5]


def first_blow(truth: Trace, done: list[bool]) -> int:
    """Return the first tick in which a ball strikes an arm that rests, else how many there are.

    An arm that holds the ball, or was struck before, is struck no more.
    """
    touched = np.flatnonzero(truth.seen[: len(done)] & BALL_ANY)
    if len(touched) and any(done[: touched[0]]):
        return int(touched[0])
    return len(done)


def paused(arm: Arm, start: Array) -> Array:
    """Return a motion that pauses half-way, each part from rest to rest, (k, 3, n)."""
    away = np.where(start < 0.5 * (arm.q_min + arm.q_max), 0.3, -0.3)
    middle, still = start + 0.5 * away, np.zeros(arm.n)
    parts = (
        slow_motion(arm, start, middle, 0.3),
        np.repeat(np.array([[middle, still, still]]), PAUSE, axis=0),
        slow_motion(arm, middle, start + away, 0.3),
    )
    return np.concatenate(parts)


def exact(
    arm: Arm, first: Catcher, generator: Generator, source: Source, count: int, seed: int
) -> Rested:
    """Throw at an arm that does what its model says."""
    found = Rested()
    for k in range(count):
        rng, kind, ball = np.random.default_rng([seed, k]), kind_of(k), source.ball(k)
        assert isinstance(ball, Throw)
        catcher, plant, at = first.again(generator), ExactPlant(arm), rng.uniform(0.05, 0.7)
        done, places, over, since = list[bool](), list[Array](), False, 0.0
        t, until = 0.0, LONGEST
        while t < until:
            seen = min(t, at) if kind == "freezes" else t
            r_o = ball.r + seen * ball.dr + 0.5 * seen * seen * FALL
            point = Sighting(
                t=t,
                found=True,
                r_o=r_o + SIGMA * rng.standard_normal(3),
                covariance=SIGMA**2 * np.eye(3),
            )
            reading = ArmState(t=t, q=plant.state[0].copy(), dq=plant.state[1].copy())
            command = catcher.step(Senses(t=t, arm=reading, points=(point,)))
            done.append(catcher.done)
            places.append(plant.state[0].copy())
            if kind == "stop" and t >= at:
                catcher.stop()
            plant.move(command, TICK)
            catcher.think()
            t += TICK
            if catcher.done and not over:
                over, since = True, t
                found.over += 1
            if over and kind == "move" and t - since > AFTER and catcher.phase is Phase.BRAKE:
                found.judge(f"exact {k} {kind}", done, places)
                done, places, kind = [], [], "moved"
                way = paused(arm, catcher.result.command[0].copy())
                catcher.move(way)
                until = t + len(way) * TICK + 0.3
            elif over and kind != "moved" and t - since > 2.0 * AFTER:
                break
        found.throws += 1
        found.judge(f"exact {k} {kind}", done, places)
    return found


def true(runner: TrialRunner, source: Source, count: int, seed: int) -> Rested:
    """Throw in a world whose arm is not quite as modelled."""
    found = Rested()
    for k in range(count):
        rng, kind = np.random.default_rng([seed, k]), kind_of(k)
        catcher, at = (
            runner.release(source.ball(k), seed=source.trial_seed(k)),
            rng.uniform(0.05, 0.7),
        )
        parts, done, over, since = list[tuple[int, str]](), list[bool](), False, 0.0
        t, until = 0.0, LONGEST
        while t < until:
            if kind == "stop" and t >= at:
                catcher.stop()
            t = runner.step(catcher).t
            done.append(catcher.done)
            if catcher.done and not over:
                over, since = True, t
                found.over += 1
            if over and kind == "move" and t - since > AFTER and catcher.phase is Phase.BRAKE:
                way = paused(runner.arm, catcher.result.command[0].copy())
                try:
                    catcher.move(way)
                except InputError:
                    kind = "none"
                    continue
                parts.append((len(done), kind))
                kind, until = "moved", t + len(way) * TICK + 0.3
            elif over and kind != "moved" and t - since > 2.0 * AFTER:
                break
        found.throws += 1
        q, begin = runner.world.trace().q, 0
        until_struck = first_blow(runner.world.trace(), done)
        for end, name in [*parts, (len(done), kind)]:
            end = min(end, until_struck)
            found.judge(f"true {k} {name}", done[begin:end], list(q[begin:end]))
            begin = end
    return found
