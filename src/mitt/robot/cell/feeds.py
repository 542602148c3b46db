"""What comes to a simulated cell, one after another: balls that are thrown, parts to be met."""

from typing import Any, Protocol, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.catcher.settings import Phase
from mitt.core.signals import TICK, Array
from mitt.lab.trials.runner import LONGEST
from mitt.lab.trials.score import HELD_AFTER, trial_status, was_held
from mitt.lab.trials.source import Source
from mitt.lab.trials.station import Station
from mitt.lab.world.flights import BallPath
from mitt.lab.world.simulation import World
from mitt.lab.world.targets import Ride
from mitt.lab.world.throws import Throw
from mitt.lab.world.truth import Truth

#: How near to the tool a part that it holds is, and how far it has to be moved [m].
_KEPT = 0.03
_MOVED = 0.05
#: How far beyond the work area a part is out of reach, and from its place one that was put down
#: [m].
_BEYOND = 0.15
_OFF = 0.03
#: Time without a touch after which a part counts as let go, and longest time that one is there [s].
_LET_GO = 0.5
_THERE = 60.0


class Feed(Protocol):
    """Brings one thing after another, and says what became of each.

    Attributes:
        count: How many there are.
        ends: How they may end.
    """

    count: int
    ends: tuple[str, ...]

    def seed(self, index: int) -> int:
        """Return the seed of the plant and all noise while a thing is there."""

    def bring(self, index: int) -> Throw | BallPath | Ride:
        """Begin with a thing: how it comes."""

    def over(self, world: World, truth: Truth, *, ready: bool) -> bool:
        """Say, once a tick, whether it is over; ``ready``: the arm waits for the next."""

    def ended(self, world: World) -> dict[str, Any]:
        """Return how it ended: ``status``, and what else is known."""


@final
class Throws:
    """Balls that are thrown."""

    ends: tuple[str, ...] = ("caught", "dropped", "missed", "aborted")

    def __init__(self, source: Source, arm: Arm) -> None:
        """Take the balls, and the arm that they are thrown to."""
        self._source, self._arm, self.count = source, arm, source.count

    def seed(self, index: int) -> int:
        """Return the seed of a throw."""
        return self._source.trial_seed(index)

    def bring(self, index: int) -> Throw | BallPath:
        """Return a ball."""
        return self._source.ball(index)

    def over(self, world: World, truth: Truth, *, ready: bool) -> bool:  # noqa: ARG002
        """Say whether a throw is over, as of a trial."""
        return world.over(longest=LONGEST, held=HELD_AFTER)

    def ended(self, world: World) -> dict[str, Any]:
        """Judge as a trial does."""
        held = was_held(self._arm, world)
        return {"status": trial_status(world, Phase.WATCH, refused=False, was_held=held)}


@final
class Parts:
    """Parts that come by on a belt or in a hand, and are put down elsewhere.

    ``met``: the tool held the part by contact while it was moved by 5 cm; ``slipped``: touched, not
    held; ``missed``: never touched. ``placed``: it was let go, and lies where it was to.

    Attributes:
        held: Whether the present part was met.
    """

    ends: tuple[str, ...] = ("met", "slipped", "missed", "aborted")

    def __init__(
        self, at: Station, *, speed: float, seed: int, count: int, put: tuple[float, float, float]
    ) -> None:
        """Take the station, the mean speed of its belt or the largest of the hand [m/s].

        ``put`` is where the middle of a part is put down [m].
        """
        self._at, self._speed, self._seed, self.count = at, speed, seed, count
        self._put = np.array(put)
        self._begin()

    def _begin(self) -> None:
        """Know nothing of the next part."""
        self._taken: Array | None = None
        self._apart, self.held, self._placed = 0.0, False, False

    def seed(self, index: int) -> int:
        """Return the seed of a part."""
        return int(np.random.default_rng([self._seed, index]).integers(2**31))

    def bring(self, index: int) -> BallPath | Ride:
        """Return how a part comes, as of ``mitt meet``."""
        self._begin()
        return self._at.coming(np.random.default_rng([self._seed, index, 1]), self._speed)

    def over(self, world: World, truth: Truth, *, ready: bool) -> bool:
        """Say whether the arm is done with a part, or it has gone by."""
        touched, r = bool(truth.touching), truth.r_o
        near = float(np.linalg.norm(r - truth.position)) < _KEPT
        if not (touched and near):
            self._taken = None
        elif self._taken is None:
            self._taken = r.copy()
        elif float(np.linalg.norm(r - self._taken)) > _MOVED and self._is_off_belt(r):
            self.held = True
        self._apart = 0.0 if touched else self._apart + TICK
        off = float(np.linalg.norm(r[:2] - self._put[:2]))
        self._placed = self.held and self._apart > _LET_GO and off < _OFF
        if world.diverged or world.t > _THERE:
            return True
        done = world.first_contact is not None and self._apart > _LET_GO
        return (self.held and done) or (ready and (done or self._is_gone(r)))

    def _is_off_belt(self, r: Array) -> bool:
        """Say whether a part is higher than it was on its belt: a belt moves what it carries."""
        return self._at.target == "hand" or bool(r[2] > self._at.place[2] + 0.5 * _MOVED)

    def _is_gone(self, r: Array) -> bool:
        """Say whether a part has gone by, or fell."""
        low, belt = np.array(self._at.settings.low), self._at.scene.belt
        if belt is None or r[2] < low[2] - _BEYOND:
            return bool(r[2] < low[2] - _BEYOND)
        along = belt.along[:2]
        half = 0.5 * float(np.abs(along) @ (np.array(self._at.settings.high) - low)[:2])
        return bool(along @ (r[:2] - self._at.place[:2]) > half + _BEYOND)

    def ended(self, world: World) -> dict[str, Any]:
        """Return what became of a part."""
        if world.diverged:
            return {"status": "aborted", "placed": False}
        touched = "missed" if world.first_contact is None else "slipped"
        return {"status": "met" if self.held else touched, "placed": self._placed}
