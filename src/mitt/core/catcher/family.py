"""Maps that catch in different places: the paper's future "modular system", one for each throw.

The default generator: the learned map first, then those of :mod:`mitt.core.map.family`, which catch
farther out. A throw is given to the first one that catches it with margin, and with room for the
brake after the catch, unless one asked before finds it low, or else to the one that asks least of
its tightest limit. The choice is part of the verdict (:meth:`Family.consider`): the arm starts with
the map that the verdict rests on. With each verdict under way, as after a bounce, the choice is
made again, and as soon as the predicted catch leaves the region of the map that is followed, as
where drag or a gust makes the ball fall short. A ball that comes in low from the first is waited
for: it may be meant to bounce into the region of a map. That map waits where it would, and keeps
the ball as long as it can catch or await it: another map that reaches lower would go for the ball
where it falls, and come too late after the bounce. Eq. (12) makes the new map start where the arm
is and as fast as it moves, so that a change of maps is no jump.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.errors import InputError
from mitt.core.fields import brief
from mitt.core.map.demand import uniform
from mitt.core.map.family import family_of
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import nominal_ball
from mitt.core.signals import Array, BallState, JointReference
from mitt.core.verdict.feasibility import Outcome, Verdict, judge
from mitt.core.verdict.pieces import Pieces

#: Share of each limit in units of which maps are compared: one that keeps them is preferred. The
#: arm may be weaker, or carry more, than modelled: a fifth of its torque is no part of the brake.
_CHOICE = replace(uniform(1.0), torque=1.25, strength=0.8)


@final
@dataclass(frozen=True, slots=True)
class Family:
    """A choice among maps; see the module.

    Attributes:
        maps: The maps, the preferred one first.
        margin: Share of its tightest limit up to which a map is taken without asking the others.
        chosen: Index of the map that is followed, or will be; None before the first choice.
        waited: Whether the map that is followed has waited for the ball.
    """

    maps: tuple[Direct, ...]
    margin: float = 0.9
    chosen: int | None = None
    waited: bool = False

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse a choice among nothing."""
        for f in checks.instance("maps", self.maps, tuple):
            checks.instance("maps", f, Direct)
        sizes = {f.map.alpha.shape for f in self.maps}
        if len(sizes) != 1:
            wanted = "maps of one arm and one degree, all with a match_weight or none"
            raise InputError("maps", wanted, f"{len(self.maps)} others")

    @property
    def map(self) -> Direct:
        """The map that is followed; the preferred one before the first choice."""
        return self.maps[self.chosen or 0]

    @property
    def certificate(self) -> Verdict | None:
        """As of the map that is followed."""
        return self.map.certificate

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arms that its maps were made for."""
        return tuple(arm for f in self.maps for arm in f.arms)

    def on(self, arm: Arm) -> "Family":
        """Return the choice for the same arm with other limits."""
        return replace(self, maps=tuple(f.on(arm) for f in self.maps))

    def sharpness(self, ball: BallState) -> float:
        """Return the smallest predicted 1-sigma at any map's catch [m]."""
        return min(f.sharpness(ball) for f in self._candidates())

    def verdict(self, ball: BallState, q: Array, dq: Array | None = None) -> Verdict:
        """Return the verdict of the map that the throw would be given to.

        The arm is at rest in ``q``, or moves at ``dq`` [rad, rad/s], shape (n,) each.
        """
        return self.consider(ball, q, dq, Pieces())[0]

    def consider(
        self, ball: BallState, q: Array, dq: Array | None, pieces: Pieces
    ) -> tuple[Verdict, "Family"]:
        """Return that verdict, and the choice that it rests on, with which :meth:`adapt` starts."""
        best = self._best(ball, q, np.zeros(self.map.map.arm.n) if dq is None else dq, pieces)
        said, _ = self.maps[best].consider(ball, q, dq, pieces, f"map {best} ")
        return said, replace(self, chosen=best)

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Look whether no map's verdict could settle it."""
        return all(f.unsettled(ball, q) for f in self.maps)

    def returns(self, ball: BallState) -> bool:
        """Look whether the predicted catch lies in the region of the map that waits."""
        return self.map.returns(ball)

    def astray(self, ball: BallState) -> bool:
        """Say whether the map that is followed cannot catch any more, and another can.

        A ball that was waited for was never given to a map for where it falls.
        """
        others = (f for f in self.maps if f is not self.map)
        lost = not self.waited and not self.map.returns(ball)
        return lost and any(f.returns(ball) for f in others)

    def waiting(self, ball: BallState) -> BallState:
        """Wait where the map that is followed would."""
        return self.map.waiting(ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Family":
        """Adapt the chosen map to start in ``q``, ``dq``, eq. (12); choose where none was."""
        index = self._index(ball, q, dq)
        return self._follow(index, self.maps[index].adapt(ball, q, dq))

    def wait(self, ball: BallState, q: Array, dq: Array) -> "Family":
        """Let the map whose verdict on a ball is open wait for it, from ``q``, ``dq`` on."""
        index = self._index(ball, q, dq)
        f = self.maps[index]
        return replace(self._follow(index, f.adapt(f.waiting(ball), q, dq)), waited=True)

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the chosen map."""
        return self.map.reference(ball)

    def as_map(self) -> DirectMap:
        """Hand the chosen map over; all have the same number of monomials."""
        return self.map.map

    def _index(self, ball: BallState, q: Array, dq: Array) -> int:
        """Return the map that was chosen, or is for a ball where none was."""
        return self._best(ball, q, dq, Pieces()) if self.chosen is None else self.chosen

    def _follow(self, index: int, adapted: Direct) -> "Family":
        """Return the choice of a map, adapted."""
        maps = (*self.maps[:index], adapted, *self.maps[index + 1 :])
        return replace(self, maps=maps, chosen=index)

    def _candidates(self) -> Sequence[Direct]:
        """Return the maps that are still to be asked: all, or the one that is followed."""
        return self.maps if self.chosen is None else (self.map,)

    def _keeps(self, index: int, outcome: Outcome) -> bool:
        """Say whether a map has waited for the ball, and has a verdict with which it keeps it."""
        return self.waited and index == self.chosen and outcome in _KEPT

    def _best(self, ball: BallState, q: Array, dq: Array, pieces: Pieces) -> int:
        """Return the map for a ball; the one followed is asked first."""
        order = sorted(range(len(self.maps)), key=lambda k: k != self.chosen)
        said: list[tuple[int, Verdict]] = []
        waits = self.chosen is None  # for a bounce, until the ball is in a map's region
        for k in order:
            verdict = pieces.whole(f"map {k}", self._judged, k, ball, q, dq, pieces)
            if verdict.outcome is Outcome.FEASIBLE and verdict.share <= self.margin:
                return k
            if waits and verdict.outcome is Outcome.OPEN:
                return k
            if self._keeps(k, verdict.outcome):
                return k
            waits = waits and not np.isfinite(verdict.share)
            said.append((k, verdict))
        if all(verdict.outcome is Outcome.UNREACHABLE for _, verdict in said):
            own = [self._own(k, ball, q, dq, pieces).outcome for k, _ in said]
            said = [(k, replace(x, outcome=y)) for (k, x), y in zip(said, own, strict=True)]
            if self.chosen is not None and self._keeps(self.chosen, own[0]):
                return self.chosen
        worth = _AT_FIRST if self.chosen is None else _ON_THE_WAY
        return min(said, key=lambda x: (worth.index(x[1].outcome), x[1].share))[0]

    def _judged(self, k: int, ball: BallState, q: Array, dq: Array, pieces: Pieces) -> Verdict:
        """Return the verdict by which a map is compared with others: by the same shares."""
        f, name = self.maps[k].map, f"map {k} "
        return judge(f, ball, q, tolerance=_CHOICE, dq=dq, pieces=pieces, name=name)

    def _own(self, k: int, ball: BallState, q: Array, dq: Array, pieces: Pieces) -> Verdict:
        """Return the verdict of a map for an arm at rest, by its own shares."""
        # A "map" is a way that is known where the arm rests.
        name = f"own {k}" if np.any(dq) else f"map {k}"
        consider = self.maps[k].consider
        return pieces.whole(f"own {k}", consider, ball, q, None, pieces, f"{name} ")[0]


#: Verdicts with which a map that has waited for a ball keeps it.
_KEPT = (Outcome.FEASIBLE, Outcome.OPEN)
#: Verdicts, the one worth most first. Once under way, a catch that costs too much is worth more
#: than to wait with another map for what the map that was followed had waited for.
_AT_FIRST = (Outcome.FEASIBLE, Outcome.OPEN, Outcome.UNSETTLED, Outcome.UNREACHABLE)
_ON_THE_WAY = (Outcome.FEASIBLE, Outcome.UNSETTLED, Outcome.UNREACHABLE, Outcome.OPEN)


def direct(learned: DirectMap) -> Family:
    """Return the default generator: a learned map, and those that catch where it does not."""
    maps = (learned, *family_of(learned, nominal_ball(learned.arm)))
    return Family(tuple(Direct(f) for f in maps))
