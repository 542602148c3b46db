"""Throws: where a ball is released and how fast, at random or from a file, and how it flies."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mitt.core import checks
from mitt.core.ball.flight import STILL, Lift, advance_spinning
from mitt.core.ball.spin import lift_of
from mitt.core.errors import FileError, InputError, ShapeError
from mitt.core.kernels import kernel
from mitt.core.signals import GRAVITY, Array
from mitt.io.csv_table import finite_cell, read_rows
from mitt.lab.world.fall import doubt_of_throws

COLUMNS = ("x", "y", "z", "vx", "vy", "vz")
NOMINAL_DRAG = 0.04
"""Drag of the default ball [1/m], for which the speeds of the default throws are stated."""
MAX_DISTANCE = 100.0
MAX_SPEED = 100.0
"""Bounds of a release that can be meant [m], [m/s]; beyond them a unit was confused."""
#: Steps of Newton's method: four reach rounding error on any throw of the default range.
_STEPS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Throw:
    """Release of a ball.

    Attributes:
        r: Ball centre at release, world frame [m], shape (3,).
        dr: Its velocity at release [m/s], shape (3,).
        spin: Its angular velocity [rad/s], shape (3,); none if left out.
    """

    r: Array
    dr: Array
    spin: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Hold each to three finite numbers; ShapeError or InputError where they are not."""
        for name, value in (("r", self.r), ("dr", self.dr), ("spin", self.spin)):
            kept = checks.vector(f"throw.{name}", value, 3, finite=True)
            object.__setattr__(self, name, kept)


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """Where throws are aimed: catch points of a box of joint angles.

    Attributes:
        position: Catch point l(q) [m], shape (3,), of joint angles [rad], shape (n,).
        q_low: Lower corner of the box [rad], shape (n,).
        q_high: Upper corner of the box [rad], shape (n,).
    """

    position: Callable[[Array], Array]
    q_low: Array
    q_high: Array

    def __post_init__(self) -> None:
        """Refuse a box that is none."""
        if self.q_low.shape != self.q_high.shape:
            raise ShapeError("q_high", str(self.q_low.shape), self.q_high.shape)
        if not bool(np.all(self.q_low <= self.q_high)):
            raise InputError("q_low", "at most q_high", f"{self.q_low} and {self.q_high}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Spinning:
    """How thrown balls spin.

    Attributes:
        rate: How fast [rad/s]; the axis is drawn, any direction across the velocity alike: hands
            and rackets give top, back and side spin, and hardly any along the flight (believed).
        K: Lift constant of the balls, with which they are aimed.
        radius: Their radius [m].
    """

    rate: float = 0.0
    K: float = 0.0
    radius: float = 0.04


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrowRanges:
    """Ranges of the default throws, the table of docs/throws.md.

    Attributes:
        duration: Time of flight to the aim point [s].
        speed: Speed at release of a ball with the drag ``NOMINAL_DRAG`` [m/s]. One with another
            drag is thrown so that it passes the same point after the same time.
        distance: Horizontal distance of the release from the aim point [m].
        azimuth: Direction of the release seen from the aim point, from +x [rad].
        height: Height of the release above the shoulder centre [m].
        drag: Quadratic drag coefficient k of the ball that is thrown [1/m].
    """

    duration: tuple[float, float] = (0.45, 0.62)
    speed: tuple[float, float] = (5.0, 7.1)
    distance: tuple[float, float] = (2.5, 4.2)
    azimuth: tuple[float, float] = (-0.12, 0.12)
    height: tuple[float, float] = (-0.2, 0.6)
    drag: float = NOMINAL_DRAG


def fly(
    r: Array, dr: Array, *, drag: float, duration: float, lift: Lift = STILL
) -> tuple[Array, Array]:
    """Fly freely for a while.

    Args:
        r: Position at the start [m], shape (3,).
        dr: Velocity at the start [m/s], shape (3,).
        drag: Quadratic drag coefficient k [1/m].
        duration: Time of flight [s], not negative.
        lift: What a spin does.

    Returns:
        Position [m], shape (3,), and velocity [m/s], shape (3,), at the end.
    """
    r, dr = np.array(r, float), np.array(dr, float)
    advance_spinning(r, dr, drag, lift, duration)
    return r, dr


def release_velocity(
    start: Array, target: Array, *, drag: float, duration: float, lift: Lift = STILL
) -> Array:
    """Find the velocity at ``start`` that carries the ball to ``target`` (shooting, Newton).

    Args:
        start: Point of release [m], shape (3,).
        target: Point to be passed after ``duration`` [m], shape (3,).
        drag: Quadratic drag coefficient k [1/m].
        duration: Time of flight [s], positive.
        lift: What its spin does.

    Returns:
        Velocity at release [m/s], shape (3,).
    """
    dr, ends, nudge = (target - start) / duration, np.empty((7, 3)), 1e-5
    dr[2] += 0.5 * GRAVITY * duration
    for _ in range(_STEPS):
        _ends(start, dr, (drag, duration, nudge), lift, ends)
        slope = (ends[:3] - ends[3:6]).T / (2.0 * nudge)
        dr = dr - np.linalg.solve(slope, ends[6] - target)
    return dr


@kernel
def _ends(start: Array, dr: Array, of: tuple[float, float, float], lift: Lift, ends: Array) -> None:
    """Write where flights end [m], shape (7, 3): each axis of ``dr`` more, less, then as it is.

    ``of`` is drag, duration, and by how much more and less.
    """
    drag, duration, nudge = of
    for i in range(7):
        velocity = dr.copy()
        ends[i] = start
        if i < 6:
            velocity[i % 3] += nudge if i < 3 else -nudge
        advance_spinning(ends[i], velocity, drag, lift, duration)


def default_throw(
    rng: np.random.Generator,
    aim: Aim,
    ranges: ThrowRanges | None = None,
    *,
    tries: int = 1000,
    spinning: Spinning | None = None,
) -> Throw:
    """Draw one throw that passes a random aim point; draws with another speed are rejected.

    Args:
        rng: Source of randomness.
        aim: Where to.
        ranges: From where and how fast; the default throws if left out.
        tries: Draws before giving up; about three in five of the default draws are accepted.
        spinning: How it spins; one that spins is thrown so that it passes the same point after the
            same time.

    Raises:
        InputError: No draw had a release speed in the range.
    """
    ranges = ranges or ThrowRanges()
    box = np.array([ranges.azimuth, ranges.distance, ranges.height, ranges.duration])
    low = np.concatenate((aim.q_low, box[:, 0]))
    span = np.concatenate((aim.q_high, box[:, 1])) - low
    for _ in range(tries):
        drawn = low + span * rng.random(len(low))
        target = aim.position(drawn[:-4])
        azimuth, distance, height, duration = drawn[-4:].tolist()
        x, y = target[0] + distance * np.cos(azimuth), target[1] + distance * np.sin(azimuth)
        start = np.array([x, y, height])
        dr = release_velocity(start, target, drag=NOMINAL_DRAG, duration=duration)
        if not ranges.speed[0] <= np.linalg.norm(dr) <= ranges.speed[1]:
            continue
        if ranges.drag != NOMINAL_DRAG:
            dr = release_velocity(start, target, drag=ranges.drag, duration=duration)
        if spinning is None or spinning.rate == 0.0:
            return Throw(r=start, dr=dr)
        axis = np.cross(dr, rng.standard_normal(3))
        spin = spinning.rate / float(np.linalg.norm(axis)) * axis
        lift = lift_of(spin, spinning.K, spinning.radius)
        dr = release_velocity(start, target, drag=ranges.drag, duration=duration, lift=lift)
        return Throw(r=start, dr=dr, spin=spin)
    wanted = f"a release speed of {ranges.speed[0]:g} to {ranges.speed[1]:g} m/s"
    raise InputError("throw ranges", wanted, f"none in {tries} draws")


def read_throws(path: Path) -> tuple[Throw, ...]:
    """Read throws from a CSV file with the columns x, y, z, vx, vy, vz [m, m/s], one a row.

    Raises:
        FileError: The file does not say that, and names line and column; or its throws are in other
            units or with another axis up.
    """
    limits = dict.fromkeys(COLUMNS[:3], MAX_DISTANCE) | dict.fromkeys(COLUMNS[3:], MAX_SPEED)
    throws = []
    for line, cells in read_rows(path, COLUMNS):
        row = np.array([finite_cell(path, line, c, cells[c], limit=limits[c]) for c in COLUMNS])
        throws.append(Throw(r=row[:3], dr=row[3:]))
    if not throws:
        raise FileError(str(path), "at least one throw", "none")
    doubt = doubt_of_throws(np.array([x.r for x in throws]), np.array([x.dr for x in throws]))
    if doubt is not None:
        raise FileError(
            str(path), "throws towards the arm, z up, in m and m/s", doubt.given, do=doubt.do
        )
    return tuple(throws)
