"""Faults between the sensors and the catcher: exposure, delivery, encoders, cameras.

Each is a stage that passes on what its fault does not change. Every stage draws in every tick,
whether its fault is active or not, so that no draw depends on those before it.
"""

import heapq
from dataclasses import replace
from math import floor

import numpy as np

from mitt.robot.description import rotation
from mitt.signals import TICK, Array, Frame, Senses, Sighting
from mitt.world.faults.draw import direction, drawn
from mitt.world.faults.plan import (
    Calibration,
    Clock,
    Dropout,
    Duplicate,
    Encoder,
    Fault,
    FrameRate,
    Frozen,
    Late,
    Latency,
    Noise,
    NotNumber,
    Outlier,
)
from mitt.world.faults.sensor_fault import SensorFault

Batch = tuple[tuple[Frame, ...], tuple[Sighting, ...]]

#: A delay is over when less than this is left of it [s].
_SLACK = 1e-9


def sensor_faults(plan: tuple[Fault, ...], seed: int, *, pixels: bool) -> tuple[SensorFault, ...]:
    """Return the faults between sensors and catcher, in the order of the plan.

    Args:
        plan: All entries.
        seed: Seed of the trial.
        pixels: Whether there are images; they carry an error of calibration themselves.
    """
    out = (_sensor_fault(fault, rng, pixels=pixels) for fault, rng in drawn(plan, seed))
    return tuple(stage for stage in out if stage is not None)


def _sensor_fault(fault: Fault, rng: np.random.Generator, *, pixels: bool) -> SensorFault | None:
    """Return the stage of an entry; None where it has none."""
    match fault:
        case Noise() | Outlier():
            return _Displaced(fault, rng)
        case FrameRate():
            return _FrameRate(fault, rng)
        case Calibration():
            return None if pixels else _Turned(fault, rng)
        case Dropout():
            return _Dropout(fault, rng)
        case Frozen():
            return _FrozenFrame(fault, rng)
        case Latency() | Late():
            return _Delayed(fault, rng)
        case Duplicate():
            return _DuplicateFrame(fault, rng)
        case NotNumber():
            return _NotNumber(fault, rng)
        case Clock():
            return _ClockJump(fault)
        case Encoder():
            return _EncoderFault(fault)
        case _:
            return None


class _Displaced(SensorFault):
    """Shows the ball displaced, by noise at every exposure or by an outlier at some."""

    def __init__(self, fault: Noise | Outlier, rng: np.random.Generator) -> None:
        self._fault, self._rng = fault, rng

    def shown(self, t: float, r_o: Array) -> Array:
        fault, size = self._fault, self._fault.magnitude
        if isinstance(fault, Noise):
            off, hit = size * self._rng.standard_normal(3), True
        else:
            hit = bool(self._rng.random() < fault.chance)
            off = size * direction(self._rng)
        return np.asarray(r_o + off) if hit and fault.is_active(t) else r_o


class _FrameRate(SensorFault):
    """Exposes so many times a second, from a random phase."""

    def __init__(self, fault: FrameRate, rng: np.random.Generator) -> None:
        self._fault, self._phase = fault, rng.random()

    def exposes(self, t: float) -> bool:
        if not self._fault.is_active(t):
            return True
        rate = min(self._fault.magnitude, 1.0 / TICK)
        now = floor(t * rate + self._phase + 1e-9)
        return now != floor((t - TICK) * rate + self._phase + 1e-9)


class _Turned(SensorFault):
    """Moves points as wrongly calibrated cameras would, for worlds without cameras."""

    def __init__(self, fault: Calibration, rng: np.random.Generator) -> None:
        size = fault.magnitude * rng.standard_normal()
        axis = direction(rng)
        self._A = rotation(axis, size) if fault.part == "angles" else (1.0 + size) * np.eye(3)

    def shown(self, t: float, r_o: Array) -> Array:  # noqa: ARG002
        return np.asarray(self._A @ r_o)


class _Dropout(SensorFault):
    """Loses frames and points."""

    def __init__(self, fault: Dropout, rng: np.random.Generator) -> None:
        self._fault, self._rng = fault, rng

    def delivered(self, senses: Senses) -> Senses:
        lost = self._rng.random() < self._fault.magnitude
        if not lost or not self._fault.is_active(senses.t, slack=_SLACK):
            return senses
        camera = self._fault.camera
        kept = () if camera is None else tuple(f for f in senses.frames if f.camera != camera)
        return replace(senses, frames=kept, points=())


class _Delayed(SensorFault):
    """Delivers late, in each tick all that is due.

    Points come in the order of their exposure; of each camera the newest frame comes, as a driver
    overwrites what nobody has taken.
    """

    def __init__(self, fault: Latency | Late, rng: np.random.Generator) -> None:
        self._fault, self._rng, self._count = fault, rng, 0
        self._waiting: list[tuple[float, int, Batch]] = []

    def delivered(self, senses: Senses) -> Senses:
        fault, t = self._fault, senses.t
        hit = True if isinstance(fault, Latency) else bool(self._rng.random() < fault.chance)
        delay = fault.magnitude if hit and fault.is_active(t, slack=_SLACK) else 0.0
        if senses.frames or senses.points:
            batch = senses.frames, senses.points
            heapq.heappush(self._waiting, (t + delay, self._count, batch))
            self._count += 1
        due: list[tuple[int, Batch]] = []
        while self._waiting and self._waiting[0][0] <= t + _SLACK:
            due.append(heapq.heappop(self._waiting)[1:])
        newest: dict[int, Frame] = {}
        points: list[Sighting] = []
        for _, (frames, seen) in sorted(due, key=lambda one: one[0]):
            newest |= {frame.camera: frame for frame in frames}
            points += seen
        batch = tuple(newest.values()), tuple(points)
        if isinstance(fault, Latency) and not fault.stamped:
            batch = _restamped(batch, t)
        return replace(senses, frames=batch[0], points=batch[1])


def _restamped(batch: Batch, t: float) -> Batch:
    """Return frames and points with another time [s]."""
    frames, points = batch
    return tuple(replace(f, t=t) for f in frames), tuple(replace(p, t=t) for p in points)


class _DuplicateFrame(SensorFault):
    """Delivers some frames and points a second time."""

    def __init__(self, fault: Duplicate, rng: np.random.Generator) -> None:
        self._fault, self._rng = fault, rng
        self._last: Batch = (), ()

    def delivered(self, senses: Senses) -> Senses:
        again = self._rng.random() < self._fault.magnitude
        frames, points = self._last
        again = again and self._fault.is_active(senses.t, slack=_SLACK) and bool(frames or points)
        self._last = (frames if again else senses.frames), senses.points
        if not again:
            return senses
        return replace(senses, frames=frames, points=(*points, *senses.points))


class _FrozenFrame(SensorFault):
    """Shows what was seen last before the fault."""

    def __init__(self, fault: Frozen, rng: np.random.Generator) -> None:
        self._fault, self._hit = fault, bool(rng.random() < fault.magnitude)
        self._frames: dict[int, Frame] = {}
        self._points: tuple[Sighting, ...] = ()

    def delivered(self, senses: Senses) -> Senses:
        if not self._hit or not (senses.frames or senses.points):
            return senses
        if not self._fault.is_active(senses.t, slack=_SLACK):
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


class _NotNumber(SensorFault):
    """Writes NaN into positions, stamps or encoders."""

    def __init__(self, fault: NotNumber, rng: np.random.Generator) -> None:
        self._fault, self._rng = fault, rng

    def delivered(self, senses: Senses) -> Senses:
        hit = self._rng.random() < self._fault.magnitude
        if not hit or not self._fault.is_active(senses.t, slack=_SLACK):
            return senses
        if self._fault.where == "encoders":
            nan = np.full_like(senses.arm.q, np.nan)
            return replace(senses, arm=replace(senses.arm, q=nan, dq=nan.copy()))
        if self._fault.where == "points":
            nan = np.full(3, np.nan)
            return replace(senses, points=tuple(replace(p, r_o=nan) for p in senses.points))
        frames, points = _restamped((senses.frames, senses.points), float("nan"))
        return replace(senses, frames=frames, points=points)


class _ClockJump(SensorFault):
    """Sets a clock forward or back for as long as the fault lasts."""

    def __init__(self, fault: Clock) -> None:
        self._fault = fault

    def delivered(self, senses: Senses) -> Senses:
        if not self._fault.is_active(senses.t, slack=_SLACK):
            return senses
        by = self._fault.magnitude
        frames = tuple(replace(f, t=f.t + by) for f in senses.frames)
        points = tuple(replace(p, t=p.t + by) for p in senses.points)
        if self._fault.clock == "camera":
            return replace(senses, frames=frames, points=points)
        arm = replace(senses.arm, t=senses.arm.t + by)
        return replace(senses, t=senses.t + by, arm=arm, frames=frames, points=points)


class _EncoderFault(SensorFault):
    """Wrong readings of one joint or all; speeds follow from what is read."""

    def __init__(self, fault: Encoder) -> None:
        self._fault = fault
        self._t, self._read, self._stuck = 0.0, np.empty(0), np.empty(0)

    def delivered(self, senses: Senses) -> Senses:
        fault, arm, before = self._fault, senses.arm, self._t
        self._t = senses.t
        if not fault.is_active(senses.t):
            self._read = self._stuck = arm.q
            return senses
        chosen = np.full(len(arm.q), fault.joint is None)
        if fault.joint is not None:
            chosen[fault.joint % len(arm.q)] = True
        q, dq = np.where(chosen, self._reading(arm.q), arm.q), np.zeros_like(arm.q)
        if len(self._read) == len(q) and senses.t > before:
            dq = (q - self._read) / (senses.t - before)
        self._read = q
        return replace(senses, arm=replace(arm, q=q, dq=np.where(chosen, dq, arm.dq)))

    def _reading(self, q: Array) -> Array:
        """Return what the encoders read instead of q [rad]."""
        size = self._fault.magnitude
        match self._fault.fault:
            case "stuck":
                return self._stuck if len(self._stuck) else q
            case "jump":
                return np.asarray(q + size)
            case "dropout":
                return np.full_like(q, np.nan)
            case "sign":
                return -q
            case "step":
                return np.asarray(size * np.rint(q / size))
