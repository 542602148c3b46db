"""What is to be caught, and where: how balls arrive, and where throws come from.

A task has default throws, a user's throws, or recorded flights. How they arrive is measured on
throws that are flown to where they are to be caught.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError
from mitt.core.map.learn import Flight
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import Neighbourhood, neighbourhood
from mitt.core.signals import Array
from mitt.io.arm_file import ARRIVALS
from mitt.lab.trials.source import Source, ranges_of, source_of
from mitt.lab.world.flights import CATCH_FRACTION, JITTER_POSITION, RecordedFlight, place_flight
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Aim, Throw, ThrowRanges, default_throw, fly

#: Half-widths of the box of throws for a catch point 1 m from the second joint [m]: across the
#: ball's way and upwards as the default throws of the WAM (docs/throws.md).
BOX = (0.05, 0.3, 0.22)
#: Farthest from that joint for which the box grows [m]: 0.77 is the WAM's.
FAR = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Balls:
    """The balls that are to be caught, where they arrive; measured on throws.

    What is left out is that of 400 default throws (:func:`mitt.lab.design.task.of_default_throws`).

    Attributes:
        speed: Middle of their speeds at the arrival [m/s].
        descent: Middle of the angles by which they come down there [rad].
        speeds: Speeds that 5 and 95 % of them stay below [m/s].
        descents: The same of the angles [rad].
        azimuth: Middle of where they come from, off +x [rad].
        aim: Centre and half-widths of the box that they pass [m], shape (2, 3); None where the
            design may choose it.
        around: Half-widths of the box where the design chooses its centre [m], shape (3,); as of
            default throws where None.
    """

    speed: float = 5.86
    descent: float = 0.51
    speeds: tuple[float, float] = (5.19, 6.70)
    descents: tuple[float, float] = (0.35, 0.67)
    azimuth: float = 0.0
    aim: Array | None = None
    around: Array | None = None

    def velocity(self, faster: float = 0.0, azimuth: float = 0.0, steeper: float = 0.0) -> Array:
        """Return a velocity at the arrival [m/s], shape (3,); they come from +x.

        Args:
            faster: From the least speed (-1) by the middle (0) to the most (1).
            azimuth: Where it comes from, off the middle [rad].
            steeper: From the least descent (-1) by the middle (0) to the most (1).
        """
        speed = _between(self.speed, self.speeds, faster)
        down = _between(self.descent, self.descents, steeper)
        flat, side = np.cos(down), self.azimuth + azimuth
        v: Array = -speed * np.array([flat * np.cos(side), flat * np.sin(side), np.sin(down)])
        return v


def _between(middle: float, ends: tuple[float, float], place: float) -> float:
    """Return a number from the lower end (-1) by the middle (0) to the upper end (1)."""
    return middle + abs(place) * (ends[int(place > 0.0)] - middle)


#: Centre of the box that they pass [m]: the catch point of the WAM's default throws
#: (docs/throws.md), for which the heights of all throws are stated.
_PLACE = np.array([0.77, 0.0, 0.057])
#: Shares of the throws that arrive slower, or less steeply, than the least, middle and most.
_QUANTILES = (0.05, 0.5, 0.95)
#: Steps in which a throw is followed [s], and for how long.
_STEP = 0.005
_LONGEST = 1.5
#: Farthest that a user's aim may be off the middle of the throws [m].
_MISSED = 0.5
#: By which share the speeds of ranges are wider than those of the throws that they hold.
_SPEEDS = 0.08


class Arrivals(NamedTuple):
    """Where balls are as they pass a place, how fast, and since when they fly."""

    r: Array  # (B, 3)
    v: Array  # (B, 3)
    t: Array  # (B,)

    def balls(self, *, aim: Array | None = None, around: Array | None = None) -> Balls:
        """Return what a search needs to know of them; see :class:`Balls` for the arguments."""
        slow, middle, quick = np.quantile(self.speed, _QUANTILES).tolist()
        flat, down, steep = np.quantile(self.descent, _QUANTILES).tolist()
        return Balls(
            speed=middle,
            descent=down,
            speeds=(slow, quick),
            descents=(flat, steep),
            azimuth=float(np.median(self.side)),
            aim=aim,
            around=around,
        )

    @property
    def speed(self) -> Array:
        """Their speeds [m/s], shape (B,)."""
        return np.asarray(np.linalg.norm(self.v, axis=1))

    @property
    def descent(self) -> Array:
        """By which angles they come down [rad], shape (B,)."""
        return np.asarray(np.arcsin(-self.v[:, 2] / self.speed))

    @property
    def side(self) -> Array:
        """Where they come from, off +x [rad], shape (B,)."""
        return np.asarray(np.arctan2(-self.v[:, 1], -self.v[:, 0]))

    def ranges(self) -> Array:
        """Return what maps are to be learned on: ``ArmModel.arrivals``, shape (4, 2).

        Flights to learn from differ more: by a share of the speed, in descent and azimuth [rad],
        and in time [s].
        """
        values = (self.speed, self.descent, self.side, self.t)
        ends = [np.quantile(x, _QUANTILES[::2]) for x in values]
        share, angle, aside, time = 0.12, 0.11, 0.03, 0.03
        ends[0] *= (1.0 - share, 1.0 + share)
        ends[1] += (-angle, angle)
        ends[2] += (-aside, aside)
        ends[3] = np.maximum(ends[3] + (-time, time), 0.2)
        bounds = np.array(list(ARRIVALS.values()))
        out: Array = np.clip(np.array(ends), bounds[:, :1], bounds[:, 1:])
        return out


@lru_cache(maxsize=32)
def of_default_throws(ranges: ThrowRanges) -> Arrivals:
    """Return how 400 default throws of some ranges arrive; heights are as for the WAM's aim.

    Raises:
        InputError: There are no such throws.
    """
    rng, half = np.random.default_rng(33), FAR * np.array(BOX)
    place = Aim(position=np.copy, q_low=_PLACE - half, q_high=_PLACE + half)
    throws = [default_throw(rng, place, ranges) for _ in range(400)]
    return of_throws(throws, _PLACE[0], ranges.drag)


def of_throws(throws: Sequence[Throw], x: float, drag: float) -> Arrivals:
    """Return how throws pass the plane at x [m] with a drag coefficient [1/m].

    Raises:
        InputError: One does not within 1.5 s, or not towards the arm.
    """
    rows = list[tuple[Array, Array, float]]()
    for number, throw in enumerate(throws):
        r, v, t = throw.r.copy(), throw.dr.copy(), 0.0
        while r[0] > x and t < _LONGEST:
            r, v = fly(r, v, drag=drag, duration=_STEP)
            t += _STEP
        if r[0] > x or t == 0.0 or v[0] >= 0.0:
            raise InputError(
                f"throw {number}",
                f"one from +x that passes x = {x:.2f} m",
                f"released at x = {throw.r[0]:.2f} m",
                do="aim it there, or say --aim",
            )
        rows.append((r, v, t))
    return Arrivals(*(np.array(column) for column in zip(*rows, strict=True)))


def of_flights(recordings: Sequence[RecordedFlight]) -> Arrivals:
    """Return how recorded flights arrive where they are led past the catch point."""
    placed = [place_flight(x, np.zeros(3), rng=None) for x in recordings]
    t = np.array([x.after(CATCH_FRACTION) for x in placed])
    states = np.array([x.at(float(at)) for x, at in zip(placed, t, strict=True)])
    return Arrivals(states[:, 0], states[:, 1], t - [x.release for x in placed])


#: Half-widths of the box where recorded flights are led [m], shape (3,).
AROUND_FLIGHTS = np.full(3, JITTER_POSITION)


def box_of(throws: Sequence[Throw], drag: float, aim: Array | None, far: float) -> Array:
    """Return the box that a user's throws pass, centre and half-widths [m], shape (2, 3).

    Twice their standard deviation wide either way, 30 mm at least; 50 mm along their way.

    Args:
        throws: The throws.
        drag: Drag coefficient [1/m].
        aim: A point where they are to be caught [m], shape (3,); where they come near enough to
            the base if left out.
        far: How near that is, seen from the base [m].

    Raises:
        InputError: They do not come from +x, or do not pass there.
    """
    middle = Throw(
        r=np.median([x.r for x in throws], axis=0), dr=np.median([x.dr for x in throws], axis=0)
    )
    off = float(np.arctan2(-middle.dr[1], -middle.dr[0]))
    if abs(off) > 0.6:
        raise InputError(
            "the throws",
            "throws from +x, the side of the thrower",
            f"{np.degrees(off):.0f} degrees off it in the middle",
            do="turn the frame of the throws",
        )
    x = _near(middle, drag, far) if aim is None else float(aim[0])
    r = of_throws(throws, x, drag).r
    if aim is not None and np.linalg.norm(np.median(r, axis=0) - aim) > _MISSED:
        raise InputError(
            "--aim",
            f"a point at most {_MISSED:g} m off the throws in the middle",
            f"{np.linalg.norm(np.median(r, axis=0) - aim):.2f} m off",
            do="leave --aim out",
        )
    centre = np.array([x, *np.median(r[:, 1:], axis=0)]) if aim is None else aim
    half = np.maximum(2.0 * r.std(axis=0), 0.03)
    half[0] = 0.05
    return np.array([centre, half])


def _near(throw: Throw, drag: float, far: float) -> float:
    """Return x where a throw first comes so near to the base, or nearest [m]."""
    r, v = throw.r.copy(), throw.dr.copy()
    nearest, x = np.inf, float(r[0])
    for _ in range(round(_LONGEST / _STEP)):
        distance = float(np.linalg.norm(r))
        if distance < nearest:
            nearest, x = distance, float(r[0])
        if distance < far:
            break
        r, v = fly(r, v, drag=drag, duration=_STEP)
    return x


def ranges_of_throws(throws: Sequence[Throw], box: Array, drag: float) -> ThrowRanges:
    """Return ranges of default throws that hold a user's throws, for the arm file.

    Args:
        throws: The throws.
        box: As of :func:`box_of`.
        drag: Drag coefficient [1/m].
    """
    from_aim = np.array([x.r for x in throws]) - box[0]
    speed = np.array([np.linalg.norm(x.dr) for x in throws])
    t = of_throws(throws, float(box[0, 0]), drag).t
    wide = _ends(speed * [[1.0 - _SPEEDS], [1.0 + _SPEEDS]])  # they are drawn one by one
    return ThrowRanges(
        duration=_ends(t),
        speed=wide,
        distance=_ends(np.hypot(*from_aim[:, :2].T)),
        azimuth=_ends(np.arctan2(from_aim[:, 1], from_aim[:, 0])),
        height=_ends(np.array([x.r[2] for x in throws])),
        drag=drag,
    )


def _ends(x: Array) -> tuple[float, float]:
    """Return the least and the largest number."""
    return float(x.min()), float(x.max())


def shifted(ranges: ThrowRanges, arm: Arm) -> ThrowRanges:
    """Return ranges of throws with their own heights, raised as an arm's aim is above the WAM's."""
    by = ranges_of(arm).height[0] - ThrowRanges().height[0]
    return replace(ranges, height=(ranges.height[0] + by, ranges.height[1] + by))


#: Least seed of throws that are reported: no search uses one of these.
REPORTED = 80_000
#: Balls of a user's of which a search sees only half.
_HALVED_FROM = 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignTask:
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
    recordings: tuple[RecordedFlight, ...] = ()

    @property
    def own(self) -> bool:
        """Whether the throws are a user's, not drawn from ranges."""
        return bool(self.throws or self.recordings)

    @property
    def unseen(self) -> int | None:
        """How many of a user's throws no search sees; None where throws are drawn."""
        count = len(self.throws or self.recordings)
        return None if not self.own else count // 2 if count >= _HALVED_FROM else 0

    @property
    def reported(self) -> str:
        """What throws are reported, in words."""
        match self.unseen:
            case None:
                return "throws that the search had not used"
            case 0:
                return "the throws of the search, with other noise"
            case count:
                return f"{count} throws that the search had not used"

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
            f.arm,
            seed=seed,
            count=throws,
            drag=self.scene.ball.drag,
            spinning=self.scene.ball.spinning,
            ranges=None if self.ranges is None else shifted(self.ranges, f.arm),
        )
        part = unseen if seed >= REPORTED else seen
        return replace(drawn, throws=part(self.throws), recordings=part(self.recordings))


_Balls = TypeVar("_Balls", Throw, RecordedFlight)


def seen(balls: tuple[_Balls, ...]) -> tuple[_Balls, ...]:
    """Return the half, mixed, of many balls that a search may see and measure; all of a few."""
    return _half(balls, 0)


def unseen(balls: tuple[_Balls, ...]) -> tuple[_Balls, ...]:
    """Return the other half, which is thrown for the report alone; all of a few."""
    return _half(balls, 1)


def _half(balls: tuple[_Balls, ...], first: int) -> tuple[_Balls, ...]:
    """Return the first or second half, mixed, of many balls; all of a few."""
    if len(balls) < _HALVED_FROM:
        return balls
    order = np.random.default_rng(35).permutation(len(balls))
    return tuple(balls[k] for k in sorted(order[first::2]))
