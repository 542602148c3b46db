"""Trials of whatever task: what comes, the loop of a world and its catcher, and the score.

A task derives its runner from :class:`TaskRunner` and says what comes (``draw``), when a trial is
over (``over``) and what it is worth (``score``); the loop stands here alone: sense, step, apply,
think. What is scored is taken from the true states of the world.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from pathlib import Path
from typing import Generic, TypeVar

from mitt.clock import Stopwatch
from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.state import Result, copied, gathered, room_for
from mitt.core.errors import InputError
from mitt.core.signals import Frame, Senses
from mitt.lab.trials.log import TrialLog, log_of
from mitt.lab.world.flights import BallPath
from mitt.lab.world.simulation import World
from mitt.lab.world.targets import Ride
from mitt.lab.world.throws import Throw

#: Looks at the scene before a trial from which the catcher learns its background.
LOOKS = 10

AnyTrial = TypeVar("AnyTrial")


class TaskRunner(ABC, Generic[AnyTrial]):
    """An arm, its generator and their world, built once and used for many trials.

    Attributes:
        arm: The arm.
        world: The simulated world.
        stopwatch: Wall-clock time of the catcher's ticks.
        senses: What the catcher took in the last trial, as far as it is kept.
        views: Looks at the scene before the last trial, from which its background was learned.
        keeps: Whether what the catcher takes is kept, for a log or a recording.
        keeps_images: Whether images are kept with it.
        clock_offset: What is added to the stamps of what the eyes see [s].
    """

    def __init__(self, arm: Arm, world: World, *, keeps: bool = False) -> None:
        """Take an arm and its world."""
        self.arm, self.world = arm, world
        self.keeps, self.keeps_images = keeps, True
        self.stopwatch, self.clock_offset = Stopwatch(), 0.0
        self.views, self.senses = list[tuple[Frame, ...]](), list[Senses]()
        self._rows = list[Result]()
        self._t_0 = float("inf")
        self._first: Catcher | None = None
        self._ticks: Result | None = None

    @property
    def ticks(self) -> Result:
        """Results of all ticks of the last trial.

        Raises:
            InputError: There was none.
        """
        if self._ticks is None:
            raise InputError("ticks", "a trial before", "none")
        return self._ticks

    @abstractmethod
    def draw(self, index: int) -> tuple[Throw | BallPath | Ride, int]:
        """Return what comes in a trial, and the seed of its plant and noise."""

    @abstractmethod
    def generator(self) -> Generator:
        """Return what moves the arm in the trial that has just begun."""

    @abstractmethod
    def made(self, generator: Generator) -> Catcher:
        """Return the catcher that those of all trials begin as."""

    @abstractmethod
    def over(self, catcher: Catcher) -> bool:
        """Say whether nothing more can happen to the score of a trial."""

    @abstractmethod
    def score(self, index: int, catcher: Catcher) -> AnyTrial:
        """Return the score of the trial that is over."""

    def looks(self, catcher: Catcher) -> bool:
        """Say whether the eyes look in the next tick."""
        return catcher.looking

    def sensed(self, senses: Senses) -> None:
        """Take notice of what the catcher is about to get."""

    def trial(self, index: int) -> AnyTrial:
        """Run one trial; run again, it gives the same unless its task learns from each."""
        ball, seed = self.draw(index)
        catcher = self.release(ball, seed=seed)
        self.play(catcher)
        return self.score(index, catcher)

    @property
    def said(self) -> dict[str, object]:
        """What the result of a run says of what was learned on the way."""
        return {}

    @property
    def warning(self) -> str | None:
        """What is odd about what was learned on the way; None where nothing is."""
        return None

    def keep(self, folder: Path) -> None:
        """Write what a run keeps beside its trials, before the first."""

    def catcher(self) -> Catcher:
        """Return a fresh catcher."""
        generator = self.generator()
        if self._first is None:
            self._first = self.made(generator)
        return self._first.again(generator)

    def release(self, ball: Throw | BallPath | Ride, *, seed: int) -> Catcher:
        """Begin a trial and return its catcher, which has looked at the scene before."""
        self.world.reset(ball, seed)
        catcher = self.catcher()
        self.views = self.world.views_before(LOOKS)
        if self.views:
            catcher.learn_background(self.views)
        self.senses, self._rows = [], []
        return catcher

    def step(self, catcher: Catcher, *, look: bool | None = None) -> Senses:
        """Make one tick: sense, step, apply, think; return what was sensed.

        Args:
            catcher: The catcher.
            look: Whether the eyes look; as :meth:`looks` says if left out.
        """
        look = self.looks(catcher) if look is None else look
        senses = _shifted(self.world.sense(look=look), self.clock_offset)
        self.sensed(senses)
        with self.stopwatch:
            command = catcher.step(senses)
        if catcher.stopped_by is not None:
            self.world.watch_on()
        self.world.apply(command)
        catcher.think()
        return senses

    def tick(self, catcher: Catcher, *, look: bool | None = None) -> Senses:
        """Make one tick as :meth:`step`, and keep what it brings about."""
        senses = self.step(catcher, look=look)
        if self.keeps:
            self.senses.append(senses if self.keeps_images else replace(senses, frames=()))
        self._rows.append(copied(catcher.result))
        return senses

    def play(self, catcher: Catcher) -> None:
        """Make ticks until the trial is over."""
        while not self.over(catcher):
            self.tick(catcher)
        self.gather(catcher)

    def gather(self, catcher: Catcher) -> Result:
        """Put the results of all ticks of a trial together, as ``ticks``."""
        found = gathered(self._rows) if self._rows else room_for(catcher.result, 0)
        self._ticks, self._t_0 = found, catcher.t_0
        return found

    def log(self) -> TrialLog:
        """Return the log of the last trial.

        Raises:
            InputError: There was none.
        """
        images = any(senses.frames for senses in self.senses)
        return log_of(
            self.arm,
            self.ticks,
            self.world.trace(),
            t_0=self._t_0,
            senses=tuple(self.senses),
            background=tuple(x for view in self.views for x in view) if images else (),
            clock_offset=self.clock_offset,
        )


def _shifted(senses: Senses, by: float) -> Senses:
    """Return senses with other stamps of what is seen, by a time [s]."""
    if by == 0.0:
        return senses
    frames = tuple(replace(x, t=x.t + by) for x in senses.frames)
    points = tuple(replace(x, t=x.t + by) for x in senses.points)
    return replace(senses, frames=frames, points=points)
