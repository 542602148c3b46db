"""Faults of delivery: frames and points that are lost, late, twice, frozen, or badly stamped."""

import heapq
from dataclasses import replace
from typing import final

import numpy as np

from mitt.signals import Frame, Senses, Sighting
from mitt.world.faults.plan import (
    Clock,
    Dropout,
    Duplicate,
    Frozen,
    Late,
    Latency,
    NotNumber,
)
from mitt.world.faults.stage import Stage

Batch = tuple[tuple[Frame, ...], tuple[Sighting, ...]]

#: A delay is over when less than this is left of it [s].
_SLACK = 1e-9


def _active(fault: Dropout | Frozen | Latency | Late | Duplicate | Clock | NotNumber,
            t: float) -> bool:  # fmt: skip
    """Say whether a fault acts at a time [s]."""
    return fault.start - _SLACK <= t < fault.end - _SLACK


@final
class Lossy(Stage):
    """Loses frames and points."""

    def __init__(self, fault: Dropout, rng: np.random.Generator) -> None:
        """Take the fault and its source of randomness."""
        self._fault, self._rng = fault, rng

    def told(self, senses: Senses) -> Senses:
        """Return the senses without what is lost."""
        lost = self._rng.random() < self._fault.magnitude
        if not lost or not _active(self._fault, senses.t):
            return senses
        camera = self._fault.camera
        kept = () if camera is None else tuple(f for f in senses.frames if f.camera != camera)
        return replace(senses, frames=kept, points=())


@final
class Delayed(Stage):
    """Delivers late, in each tick all that is due.

    Points come in the order of their exposure; of each camera the newest frame comes, as a driver
    overwrites what nobody has taken.
    """

    def __init__(self, fault: Latency | Late, rng: np.random.Generator) -> None:
        """Start with nothing on the way."""
        self._fault, self._rng, self._count = fault, rng, 0
        self._way: list[tuple[float, int, Batch]] = []

    def told(self, senses: Senses) -> Senses:
        """Return what arrives in this tick."""
        fault, t = self._fault, senses.t
        hit = True if isinstance(fault, Latency) else bool(self._rng.random() < fault.chance)
        delay = fault.magnitude if hit and _active(fault, t) else 0.0
        if senses.frames or senses.points:
            batch = senses.frames, senses.points
            heapq.heappush(self._way, (t + delay, self._count, batch))
            self._count += 1
        due: list[tuple[int, Batch]] = []
        while self._way and self._way[0][0] <= t + _SLACK:
            due.append(heapq.heappop(self._way)[1:])
        frames, points = _together(due)
        if isinstance(fault, Latency) and not fault.stamped:
            frames, points = restamped((frames, points), t)
        return replace(senses, frames=frames, points=points)


def _together(due: list[tuple[int, Batch]]) -> Batch:
    """Return what arrives in a tick as one: the newest frame of each camera, and all points."""
    newest: dict[int, Frame] = {}
    points: list[Sighting] = []
    for _, (frames, seen) in sorted(due, key=lambda one: one[0]):
        newest |= {frame.camera: frame for frame in frames}
        points += seen
    return tuple(newest.values()), tuple(points)


def restamped(batch: Batch, t: float) -> Batch:
    """Return frames and points that claim another time [s]."""
    frames, points = batch
    return tuple(replace(f, t=t) for f in frames), tuple(replace(p, t=t) for p in points)


@final
class Twice(Stage):
    """Delivers some frames and points a second time."""

    def __init__(self, fault: Duplicate, rng: np.random.Generator) -> None:
        """Start with nothing delivered."""
        self._fault, self._rng = fault, rng
        self._last: Batch = (), ()

    def told(self, senses: Senses) -> Senses:
        """Return the senses, or the copies of the last."""
        again = self._rng.random() < self._fault.magnitude and _active(self._fault, senses.t)
        frames, points = self._last
        again = again and bool(frames or points)
        self._last = (frames if again else senses.frames), senses.points
        if not again:
            return senses
        return replace(senses, frames=frames, points=(*points, *senses.points))


@final
class Still(Stage):
    """Shows what was seen last before the fault."""

    def __init__(self, fault: Frozen, rng: np.random.Generator) -> None:
        """Draw whether it happens in this trial."""
        self._fault, self._hit = fault, bool(rng.random() < fault.magnitude)
        self._frames: dict[int, Frame] = {}
        self._points: tuple[Sighting, ...] = ()

    def told(self, senses: Senses) -> Senses:
        """Return the senses with the frozen part in its place."""
        if not self._hit or not (senses.frames or senses.points):
            return senses
        if not _active(self._fault, senses.t):
            self._frames = {frame.camera: frame for frame in senses.frames}
            self._points = senses.points
            return senses
        frames = tuple(self._frozen(frame) for frame in senses.frames)
        points = senses.points
        if self._points and self._fault.camera is None:
            new, old = senses.points[-1], self._points[-1]
            points = (replace(old, t=new.t) if self._fault.numbered else old,)
        return replace(senses, frames=frames, points=points)

    def _frozen(self, frame: Frame) -> Frame:
        """Return the last frame before the fault in place of one, if its camera is the one."""
        old = self._frames.get(frame.camera)
        if old is None or self._fault.camera not in (None, frame.camera):
            return frame
        return replace(frame, pixels=old.pixels) if self._fault.numbered else old


@final
class Misread(Stage):
    """Writes NaN into positions, stamps or encoders."""

    def __init__(self, fault: NotNumber, rng: np.random.Generator) -> None:
        """Take the fault and its source of randomness."""
        self._fault, self._rng = fault, rng

    def told(self, senses: Senses) -> Senses:
        """Return the senses, with NaN in some ticks."""
        hit = self._rng.random() < self._fault.magnitude
        if not hit or not _active(self._fault, senses.t):
            return senses
        if self._fault.where == "encoders":
            nothing = np.full_like(senses.arm.q, np.nan)
            return replace(senses, arm=replace(senses.arm, q=nothing, dq=nothing.copy()))
        if self._fault.where == "points":
            nowhere = np.full(3, np.nan)
            return replace(senses, points=tuple(replace(p, r_o=nowhere) for p in senses.points))
        frames, points = restamped((senses.frames, senses.points), float("nan"))
        return replace(senses, frames=frames, points=points)


@final
class Jumpy(Stage):
    """Sets a clock forward or back for as long as the fault lasts."""

    def __init__(self, fault: Clock, rng: np.random.Generator) -> None:  # noqa: ARG002
        """Take the fault; it draws nothing."""
        self._fault = fault

    def told(self, senses: Senses) -> Senses:
        """Return the senses by the other clock."""
        if not _active(self._fault, senses.t):
            return senses
        by = self._fault.magnitude
        frames = tuple(replace(f, t=f.t + by) for f in senses.frames)
        points = tuple(replace(p, t=p.t + by) for p in senses.points)
        if self._fault.clock == "camera":
            return replace(senses, frames=frames, points=points)
        arm = replace(senses.arm, t=senses.arm.t + by)
        return replace(senses, t=senses.t + by, arm=arm, frames=frames, points=points)
