"""Batting as a generator: the ball is sent to a target, or a paddle at rest is put in its way.

The verdict chooses the instant of the contact, and so its place, along the predicted flight: of
those at which the paddle can be brought to the ball as the target asks, the one whose motion takes
the least share of the arm's limits. The map is moved to it by one projection
(:mod:`mitt.core.map.batting`), and moved again while the ball gets to be known better, until
shortly before the contact; in between it answers to the ball alone, as in catching, in the compiled
tick.
"""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Annotated, NamedTuple, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import acceleration, advance_spinning
from mitt.core.ball.spin import spin_shown, steady_lift
from mitt.core.catcher.generators import Generator, Memory
from mitt.core.errors import InputError
from mitt.core.fields import Range, Settings, brief
from mitt.core.map.batting import BattingMap, easiest
from mitt.core.map.demand import Tolerance, shares_of
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap
from mitt.core.map.polynomial import CatchBasis
from mitt.core.map.prediction import HORIZON, STRIDE, flown, spread
from mitt.core.map.striking import Impact, PaddleStrike
from mitt.core.signals import Array, BallState, JointReference
from mitt.core.verdict.feasibility import Outcome, Verdict
from mitt.core.verdict.pieces import Pieces

#: Time after which a ball that could not be struck is judged anew [s].
_ANEW = 0.02
#: Instants at which a motion is held against its limits.
_INSTANTS = 12


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BattingSettings(Settings):
    """Where a ball is sent, and when it is met.

    Attributes:
        target: Where the ball is to go [m]; None for a shield: the paddle is in its way, at rest.
        impact: How ball and paddle part; its drag and its spin are those of the estimate.
        gain: Spin of a ball over the one that its flight shows.
        spin: Spin of the ball that is told, in place of the one that its flight shows [rad/s].
        earlier: How long before the ball is where the map strikes usually it may be met [s], and
            how long after.
        instants: How many contacts, evenly spaced, are looked at within that time at first.
        tried: Of how many of these, the easiest, the whole motion is looked at.
        shortest: Shortest time from start to contact [s].
        again: Time between two adaptations to the ball's estimate [s].
        until: Time to the contact below which the map is left as it is [s].
    """

    target: tuple[float, float, float] | None = None
    impact: Impact
    gain: Annotated[float, Range(0.0, 10.0)] = 1.0
    spin: tuple[float, float, float] | None = None
    earlier: Annotated[float, Range(0.0, 1.0)] = 0.05
    instants: Annotated[int, Range(1, 100)] = 7
    tried: Annotated[int, Range(1, 100)] = 3
    shortest: Annotated[float, Range(0.01, 10.0)] = 0.15
    again: Annotated[float, Range(0.001, 10.0)] = 0.04
    until: Annotated[float, Range(0.0, 1.0)] = 0.08

    @property
    def aim(self) -> Array | None:
        """The target as an array, shape (3,)."""
        return None if self.target is None else np.array(self.target)

    def window(self, usual: float) -> Array:
        """Return the instants that are looked at about the usual one [s]."""
        return usual + np.linspace(-self.earlier, self.earlier, self.instants)


def _flown(ball: BallState, after: Array) -> Array:
    """Fly an estimate on as :func:`flown` does, with the lift of its spin."""
    r, v, path = ball.r_o.copy(), ball.dr_o.copy(), np.empty((len(after), 3, 3))
    lift, last = steady_lift(ball.lift), 0.0
    for k, t in enumerate(after.tolist()):
        advance_spinning(r, v, ball.drag, lift, t - last)
        last = t
        path[k, 0], path[k, 1] = r, v
        acceleration(v, ball.drag, path[k, 2])
        path[k, 2] += np.cross(ball.lift, v)
    return path


def foreseen(ball: BallState, after: float) -> Array:
    """Return where a ball will be so much later [s] and how fast [m, m/s], shape (2, 3)."""
    return _flown(ball, np.array([after]))[0, :2]


class _Plan(NamedTuple):
    """A verdict, and the strike and the map that it rests on, if any."""

    verdict: Verdict
    found: tuple[PaddleStrike, DirectMap] | None


@final
class _Memory(Memory[_Plan]):
    """What was found out last, and is asked for again.

    Besides the plan the verdict that came nearest to a strike, if any; when the ball is where the
    map strikes usually, ``usual``, and when that was looked at [s].
    """

    def __init__(self) -> None:
        """Begin without one."""
        super().__init__()
        self.nearest: Verdict | None = None
        self.looked, self.usual = -inf, inf

    def keep(self, ball: BallState, plan: _Plan) -> _Plan:
        """Keep a plan and return it; one without a strike says what was lacking when it had one."""
        if plan.found is None and self.nearest is not None:
            plan = plan._replace(verdict=replace(self.nearest, outcome=Outcome.UNSETTLED))
        elif self.nearest is None or plan.verdict.share < self.nearest.share:
            self.nearest = plan.verdict
        return super().keep(ball, plan)


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrikeParts:
    """What makes a way of batting again; as of :class:`BattingMap` and :class:`Batting`."""

    design: MapDesign
    basis: CatchBasis
    alpha: Array
    H: Array
    region: Array
    q_rest: Array
    held: tuple[int, ...]
    settings: BattingSettings
    tolerance: Tolerance

    def made(self, arm: Arm) -> "Batting":
        """Return the generator of an arm."""
        f = DirectMap(
            arm=arm,
            design=self.design,
            basis=self.basis,
            alpha=self.alpha,
            H=self.H,
            region=self.region,
            q_rest=self.q_rest,
        )
        return Batting(BattingMap(map=f, held=self.held), self.settings, self.tolerance)


@final
@dataclass(frozen=True, slots=True)
class Batting(Generator):
    """The batting map as a generator.

    Attributes:
        map: The map as learned.
        settings: Where balls are sent.
        tolerance: Share of each limit at which a ball is refused.
        strike: How the ball that is followed will be met; None before.
        posed: The map moved to it.
        t_contact: When [s].
        t_adapted: When the map was moved last [s].
        memory: What was planned last.
    """

    map: BattingMap
    settings: BattingSettings
    tolerance: Tolerance = field(default_factory=Tolerance)
    strike: PaddleStrike | None = None
    posed: DirectMap | None = None
    t_contact: float = inf
    t_adapted: float = -inf
    memory: _Memory = field(default_factory=_Memory, repr=False, compare=False)

    __repr__ = brief

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that the map was made for."""
        return (self.map.arm,)

    @property
    def parts(self) -> StrikeParts:
        """What makes it again, before any ball."""
        f = self.map.map
        return StrikeParts(
            design=f.design,
            basis=f.basis,
            alpha=f.alpha,
            H=f.H,
            region=f.region,
            q_rest=f.tangent.q_rest,
            held=self.map.held,
            settings=self.settings,
            tolerance=self.tolerance,
        )

    @property
    def certificate(self) -> Verdict | None:
        """Nothing is refined."""
        return None

    def sharpness(self, ball: BallState) -> float:
        """Fly the estimate on to the contact."""
        usual = self.t_contact if self.strike else ball.t + self._usual(ball)
        after = usual - ball.t
        return spread(ball, max(after, 0.0)) if after < inf else inf

    def verdict(self, ball: BallState, q: Array, dq: Array | None = None) -> Verdict:
        """Return the verdict: the contact that takes the least share of the limits.

        A ball that cannot be struck as it flies now may bounce, or be known better: it is judged
        anew, and never refused; nor is what is under way: the catcher's commands keep the limits.
        """
        return self.consider(ball, q, dq, Pieces())[0]

    def consider(
        self, ball: BallState, q: Array, dq: Array | None, pieces: Pieces
    ) -> tuple[Verdict, "Batting"]:
        """Return that verdict, worked out in pieces, and the generator with its strike."""
        if self.strike is not None:
            verdict = Verdict(
                outcome=Outcome.FEASIBLE,
                binding_limit="",
                share=0.0,
                t_catch=self.t_contact,
                sigma=self.sharpness(ball),
            )
            return verdict, self
        plan = self._planned(ball, q, np.zeros(len(q)) if dq is None else dq, pieces)
        return plan.verdict, self if plan.found is None else self._begun(plan, ball)

    def _begun(self, plan: _Plan, ball: BallState) -> "Batting":
        """Return the generator that follows a plan with a strike."""
        if plan.found is None:
            raise InputError("ball", "one that the paddle can reach", "another")
        (strike, posed), at = plan.found, plan.verdict.t_catch
        return replace(self, strike=strike, posed=posed, t_contact=at, t_adapted=ball.t)

    def afresh(self) -> "Batting":
        """Return the generator before any ball."""
        return replace(self, memory=_Memory())

    def pause(self) -> float:
        """Return the time after which a ball that could not be struck is judged anew [s]."""
        return _ANEW

    def _planned(self, ball: BallState, q: Array, dq: Array, pieces: Pieces) -> _Plan:
        """Return the verdict for an arm in ``q`` that moves at ``dq``, the strike and its map."""
        best, why, at, found = inf, "domain", inf, None
        for after, strike in self._contacts(ball, q, pieces):
            f = pieces.of(f"map {after!r}", self.map.adapt, ball, q, dq, strike)
            if f is None:
                continue
            shares = pieces.of(f"shares {after!r}", self._shares, f, ball, after)
            binding = max(shares, key=lambda name: shares[name])
            if shares[binding] < best:
                best, why, at, found = shares[binding], binding, after, (strike, f)
        outcome = Outcome.FEASIBLE if best <= 1.0 else Outcome.UNSETTLED
        return self.memory.keep(
            ball,
            _Plan(
                Verdict(
                    outcome=outcome,
                    binding_limit=why,
                    share=best,
                    t_catch=ball.t + at,
                    sigma=spread(ball, at) if found else inf,
                ),
                found,
            ),
        )

    def _shares(self, f: DirectMap, ball: BallState, after: float) -> dict[str, float]:
        """Return the shares of the limits that a map takes up to a contact after a time [s]."""
        motion = f.motions(_flown(ball, np.linspace(0.0, after, _INSTANTS)))
        return shares_of(self.map.arm, motion, self.tolerance)

    def _contacts(
        self, ball: BallState, q: Array, pieces: Pieces
    ) -> list[tuple[float, PaddleStrike]]:
        """Return the easiest contacts: times from now and strikes."""
        s, usual = self.settings, pieces.of("usual", self._passes, ball)
        if usual == inf:
            return []
        near = list[PaddleStrike]()

        def met(after: float) -> tuple[float, PaddleStrike] | None:
            if not s.shortest <= after < inf:
                return None
            found = pieces.of(
                f"contact {after!r}", self._met, ball, q, after, near[-1] if near else None
            )
            near.extend([] if found is None else found[1:])
            return found

        found = easiest(met, s.window(usual))
        return [(after, strike) for after, (_, strike) in found[: s.tried]]

    def _met(
        self, ball: BallState, q: Array, after: float, near: PaddleStrike | None
    ) -> tuple[float, PaddleStrike] | None:
        """Return how easily a ball is met after a time [s], and the strike; None if it is not."""
        strike = self.asked(foreseen(ball, after), ball, near)
        return None if strike is None else (self.map.ease(strike, q, after), strike)

    def _usual(self, ball: BallState) -> float:
        """Return about the time until the ball is where the map strikes usually [s].

        It is looked at now and then, and for :meth:`sharpness` alone: a verdict that somebody reads
        in between is to change nothing.
        """
        memory = self.memory
        if not (0.0 <= ball.t - memory.looked < _ANEW and memory.usual < inf):
            memory.looked, memory.usual = ball.t, ball.t + self._passes(ball)
        return memory.usual - ball.t

    def _passes(self, ball: BallState) -> float:
        """Return the time until the ball is nearest to where the map strikes usually [s]."""
        times = np.arange(0.0, HORIZON, STRIDE)
        place = self.map.arm.position(self.map.map.start)
        away = np.linalg.norm(flown(ball, times)[:, 0] - place, axis=1)
        nearest = int(np.argmin(away))
        return float(times[nearest]) if 0 < nearest < len(times) - 1 else inf

    def asked(self, met: Array, ball: BallState, near: PaddleStrike | None) -> PaddleStrike | None:
        """Return the strike that a ball asks for; None where it cannot be, or points elsewhere.

        Args:
            met: Position and velocity of the ball at the contact [m, m/s], shape (2, 3).
            ball: Its estimate now, whose drag it has.
            near: A strike from which the search starts; None for the usual one.
        """
        strike = self.map.strike(met, self.settings.aim, self._impact(ball), near=near)
        aims = strike is not None and self.map.aims(strike, self.settings.aim)
        return strike if aims else None

    def _impact(self, ball: BallState) -> Impact:
        """Return how ball and paddle part, with the ball's drag and spin as estimated, or told."""
        s, impact = self.settings, self.settings.impact
        if s.spin is not None:
            return replace(impact, drag=ball.drag, spin=s.spin)
        shown = s.gain * spin_shown(ball.lift, ball.dr_o, impact.lift, impact.radius)
        x, y, z = shown.tolist()
        return replace(impact, drag=ball.drag, spin=(x, y, z))

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Batting":
        """Start from where the arm is, eq. (12), and end in the strike that the ball asks for.

        Once under way the ball is met where the map's catch joint meets it now, and not at a given
        time; shortly before that nothing changes any more.
        """
        if self.strike is None:
            return self._begun(self.memory.of(ball) or self._planned(ball, q, dq, Pieces()), ball)
        ball = replace(ball, led=True)
        left = self.as_map().reference(ball).time_to_catch
        if not self.settings.until <= left < inf:
            return replace(self, t_adapted=ball.t)
        end = foreseen(ball, left)
        strike = self.map.strike(end, self.settings.aim, self._impact(ball), near=self.strike)
        f = None if strike is None else self.map.adapt(ball, q, dq, strike)
        if f is None:
            return replace(self, t_adapted=ball.t)
        return replace(self, strike=strike, posed=f, t_contact=ball.t + left, t_adapted=ball.t)

    def astray(self, ball: BallState) -> bool:
        """Say whether it is time to adapt to what is known of the ball by now."""
        s = self.settings
        due = ball.t - self.t_adapted >= s.again
        return self.strike is not None and due and self.t_contact - ball.t >= s.until

    def wait(self, ball: BallState, q: Array, dq: Array) -> "Batting":
        """Adapt: no verdict of this generator is to wait."""
        return self.adapt(ball, q, dq)

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map."""
        return self.as_map().reference(ball)

    def as_map(self) -> DirectMap:
        """Hand the map over, moved to the strike."""
        return self.map.map if self.posed is None else self.posed
