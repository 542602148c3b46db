"""What is to be caught: default throws, a user's throws, or recorded flights, in a world."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from mitt.design.arrivals import shifted
from mitt.design.balls import Balls
from mitt.generator.learn import Flight
from mitt.generator.mapping import DirectMap
from mitt.signals import Array
from mitt.trials.learning import Neighbourhood, neighbourhood
from mitt.trials.source import Source, source_of
from mitt.world.flights import Recording
from mitt.world.scene import Scene
from mitt.world.throws import Throw, ThrowRanges

#: Least seed of throws that are reported: no search uses one of these.
REPORTED = 80_000
#: Balls of a user's of which a search sees only half.
_MANY = 20
#: Seed by which these are chosen.
_MIXED = 35


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Task:
    """What is to be caught, and where it is tried.

    Attributes:
        balls: What arrives.
        scene: The world.
        seed: Seed of the search.
        ranges: Of the throws, heights as for the WAM's aim; None for the default ones.
        arrivals: On what maps are learned, as ``ArmModel.arrivals``; None for default throws.
        throws: A user's throws in the place of default ones.
        recordings: Recorded flights in the place of throws.
    """

    balls: Balls
    scene: Scene
    seed: int = 0
    ranges: ThrowRanges | None = None
    arrivals: Array | None = None
    throws: tuple[Throw, ...] = ()
    recordings: tuple[Recording, ...] = ()

    @property
    def own(self) -> bool:
        """Whether the throws are a user's, not drawn from ranges."""
        return bool(self.throws or self.recordings)

    @property
    def kept(self) -> int | None:
        """How many of a user's throws no search sees; None where throws are drawn."""
        count = len(self.throws or self.recordings)
        return None if not self.own else count // 2 if count >= _MANY else 0

    @property
    def reported(self) -> str:
        """What throws are reported, in words."""
        match self.kept:
            case None:
                return "throws that the search had not used"
            case 0:
                return "the throws of the search, with other noise"
            case kept:
                return f"{kept} throws that the search had not used"

    def around(self, usual: Neighbourhood) -> Neighbourhood:
        """Return flights of this ball, to learn from or to try a candidate on paper with."""
        drag = self.scene.ball.drag
        return replace(usual, drag=(0.75 * drag, 1.25 * drag))

    def flights(
        self, f: DirectMap, rng: np.random.Generator, settings: Neighbourhood
    ) -> list[Flight]:
        """Draw flights of these balls, as ``mitt catch`` learns from."""
        return neighbourhood(f, rng, self.around(settings))

    def source(self, f: DirectMap, *, throws: int, seed: int) -> Source:
        """Return balls for a map's arm.

        Of 20 throws or flights of a user's on, half, by chance, is kept for the throws that are
        reported; a search sees the others.
        """
        drawn = source_of(
            f.arm, seed=seed, count=throws, drag=self.scene.ball.drag,
            ranges=None if self.ranges is None else shifted(self.ranges, f.arm),
        )  # fmt: skip
        part = kept if seed >= REPORTED else seen
        return replace(drawn, throws=part(self.throws), recordings=part(self.recordings))


_Balls = TypeVar("_Balls", Throw, Recording)


def seen(balls: tuple[_Balls, ...]) -> tuple[_Balls, ...]:
    """Return the half, mixed, of many balls that a search may see and measure; all of a few."""
    return _half(balls, 0)


def kept(balls: tuple[_Balls, ...]) -> tuple[_Balls, ...]:
    """Return the other half, which is thrown for the report alone; all of a few."""
    return _half(balls, 1)


def _half(balls: tuple[_Balls, ...], first: int) -> tuple[_Balls, ...]:
    """Return the first or second half, mixed, of many balls; all of a few."""
    if len(balls) < _MANY:
        return balls
    order = np.random.default_rng(_MIXED).permutation(len(balls))
    return tuple(balls[k] for k in sorted(order[first::2]))
