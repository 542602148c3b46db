"""What the rows of the fault table share: a map, and trials with a plan of faults."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Phase
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.state import REASONS, STATES, Result, copied, gathered
from mitt.core.map.learn import Learned
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import Senses
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import held, measure, trial_status
from mitt.lab.trials.source import aim_of
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw, default_throw

#: Seed of the throws; evaluations have others.
SEED = 61
TICKS = 1100
Change = Callable[[Senses], Senses]


@dataclass(frozen=True, slots=True)
class Thrown:
    """What became of one throw.

    Attributes:
        status: As in the contract.
        ticks: Results of all ticks.
        violations: Ticks that broke a limit.
        finite: Whether all numbers of all commands were finite.
        phase: Phase at the end.
    """

    status: str
    ticks: Result
    violations: int
    finite: bool
    phase: Phase

    @property
    def states(self) -> set[str]:
        """Names of the states that occurred."""
        return {STATES[k].value for k in np.unique(self.ticks.scalars["health"])}

    @property
    def reasons(self) -> set[str]:
        """Reasons that occurred."""
        return {REASONS[k].value for k in np.unique(self.ticks.scalars["reason"])}

    def first(self, state: str) -> float:
        """Return the time of the first tick in a state [s]; infinite if there is none."""
        at = np.flatnonzero([STATES[k].value == state for k in self.ticks.scalars["health"]])
        return float(self.ticks.scalars["t"][at[0]]) if len(at) else np.inf


@dataclass(frozen=True, slots=True)
class Range:
    """Where throws with faults are made."""

    taught: Learned
    throws: list[Throw]

    def throw(
        self,
        *faults: dict[str, Any],
        number: int = 0,
        pixels: bool = False,
        change: Change | None = None,
        ball: Throw | None = None,
        late: tuple[int, int] | None = None,
    ) -> Thrown:
        """Throw once with a plan of faults and a change of the senses.

        ``late`` is the number of a tick that does not come, and how many do not; the world goes on
        with the command before.
        """
        arm = self.taught.map.arm
        scene = Scene.model_validate({"faults": list(faults)})
        runner = TrialRunner(arm, Direct(self.taught.map), scene, pixels=pixels)
        world, catcher, rows, finite = runner.world, runner.catcher(), [], True
        world.reset(ball or self.throws[number], SEED + number)
        for k in range(TICKS):
            senses = world.sense(look=catcher.looking)
            if late is None or not late[0] <= k < sum(late):
                command = catcher.step(senses if change is None else change(senses))
            everything = (
                command.q,
                command.dq,
                command.ddq,
                command.tau,
                [command.hand, command.t],
            )
            finite &= all(bool(np.all(np.isfinite(row))) for row in everything)
            world.apply(command)
            catcher.think()
            rows.append(copied(catcher.result))
        ticks = gathered(rows)
        was_held = held(world.truth(), scene.ball.radius)
        return Thrown(
            trial_status(world, catcher.phase, refused=catcher.refused, was_held=was_held),
            ticks,
            measure(arm, ticks, world.trace()).limit_violations,
            finite,
            catcher.phase,
        )


@pytest.fixture(scope="session")
def place(arm: Arm) -> Range:
    """The map that ``mitt catch`` learns, and some default throws."""
    rng, aim = np.random.default_rng(SEED), aim_of(arm)
    return Range(learn(arm), [default_throw(rng, aim) for _ in range(6)])
