"""Trials of ``mitt meet``: a part comes by on a belt or in a hand, the arm meets and takes it.

After the tool has closed the arm brakes, goes back along the tool's axis with the part, and holds
it. All that is scored is taken from the true states of the world.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from mitt.catcher.catcher import Catcher
from mitt.catcher.generators import Generator
from mitt.catcher.meeting import Meeting
from mitt.catcher.settings import Phase
from mitt.catcher.state import copied, gathered
from mitt.clock import Stopwatch
from mitt.errors import InputError
from mitt.rivals.meeting import encoder_of
from mitt.signals import TICK, Array
from mitt.trials.score import measure, reason_of, stop_as_json
from mitt.trials.station import Station
from mitt.trials.statistics import wilson
from mitt.world.simulation import World
from mitt.world.targets import HandReach, Ride, drawn_reach, drawn_ride

SCHEMA = "mitt.meet/1"
STATUSES = ("met", "slipped", "missed", "unreachable", "stopped", "aborted")

#: Longest time from the start of a trial to the meeting, and how long a part is held [s].
_LONGEST, _HELD = 7.0, 0.5
#: Way back with the part [m] and its time [s].
_BACK, _TIME_BACK = 0.1, 0.8
#: In step with the target: position and velocity of tool and part so near [m, m/s].
NEAR, SLOW = 0.005, 0.05
#: How far a part that is held may be from where the tool holds it [m].
_KEPT = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetTrial:
    """One trial, field by field as in the result.

    Attributes:
        index: Its number.
        status: ``met``: the tool holds the part by contact 0.5 s after it has closed, moved away;
            ``slipped``: touched, not held; ``missed``: never touched; ``unreachable``: the arm did
            not start; ``stopped``, ``aborted``.
        t_met_s: When the tool had closed [s].
        in_sync_s: Longest time before that in which tool and part were within 5 mm and 0.05 m/s.
        position_error_mm: Distance of tool and part when it had closed.
        velocity_error_m_s: Difference of their velocities then.
        touch_m_s: The same when they first touched.
        peak_contact_force_n: Largest single contact force on the part.
        peak_acceleration: Largest commanded acceleration of each joint until then [rad/s^2].
        limit_violations: As of :class:`mitt.trials.score.Trial`.
        binding_limit: The limit that the verdict found most used, or what ended the trial.
        stopped_by: Why the catcher stopped; None where it did not.
    """

    index: int
    status: str
    t_met_s: float | None
    in_sync_s: float
    position_error_mm: float | None
    velocity_error_m_s: float | None
    touch_m_s: float | None
    peak_contact_force_n: float | None
    peak_acceleration: list[float]
    limit_violations: int
    binding_limit: str | None
    stopped_by: dict[str, Any] | None = None


@final
class MeetRunner:
    """A station and its world, built once and used for many trials."""

    def __init__(
        self, station: Station, *, seed: int, speed: float, generator: Generator | None = None
    ) -> None:
        """Build the world.

        Args:
            station: The arm where it meets things.
            seed: Of all trials.
            speed: Of the belt, or the largest of the hand [m/s].
            generator: What moves the arm; the meeting map if left out.
        """
        self._station, self._seed, self._speed = station, seed, speed
        self._generator = generator or Meeting(station.map, station.settings)
        self._encoder = encoder_of(self._generator)
        self._target: Ride | HandReach | None = None
        self.world = World(station.scene, station.arm.model, limits=station.arm.limits)
        self.stopwatch = Stopwatch()

    @property
    def _presented(self) -> Array:
        """How a person presents a thing: its upper side towards the tool, (3, 3)."""
        return self._station.map.frame * [1.0, -1.0, -1.0]

    def target(self, index: int) -> Ride | HandReach:
        """Return what comes by in a trial."""
        rng, s = np.random.default_rng([self._seed, index, 1]), self._station
        if s.scene.belt is not None and s.target == "belt":
            return drawn_ride(rng, s.place, s.scene.belt.direction, speed=self._speed)
        reach = drawn_reach(rng, to=s.place + 0.03 * rng.standard_normal(3), speed=self._speed)
        return replace(reach, orientation=self._presented)

    def trial(self, index: int) -> MeetTrial:
        """Run one trial; run again, it gives the same."""
        world, s = self.world, self._station
        self._target = self.target(index)
        world.reset(self._target, int(np.random.default_rng([self._seed, index]).integers(2**31)))
        catcher = Catcher(s.arm, self._generator, settings=s.catcher)
        results, closed = [], None
        for _ in self._ticks(catcher, _LONGEST):
            results.append(copied(catcher.result))
            if catcher.done:
                break
        began = catcher.state.fingers[0]["t_begun"].item()
        if np.isfinite(began):
            closed = began + catcher.state.fingers[0]["duration"].item()
        if catcher.phase is Phase.BRAKE and closed is not None:
            self._go_back(catcher, results)
        return self._scored(index, catcher, results, closed)

    def _ticks(self, catcher: Catcher, longest: float) -> Iterator[None]:
        """Make ticks for so long [s]."""
        for _ in range(round(longest / TICK)):
            senses = self.world.sense(look=catcher.looking)
            self._read_belt(senses.t)
            with self.stopwatch:
                command = catcher.step(senses)
            self.world.apply(command)
            catcher.think()
            yield
            if self.world.diverged:
                return

    def _read_belt(self, t: float) -> None:
        """Let a generator that follows the belt's encoder have its reading of this tick."""
        if self._encoder is not None and isinstance(self._target, Ride):
            way = self._target.at(t)[0] - self._target.start
            self._encoder.read(t, float(way @ self._target.along))

    def _go_back(self, catcher: Catcher, results: list[Any]) -> None:
        """Go back along the tool's axis with the part, as far as limits let it, and hold it."""
        f, last = self._station.map, catcher.result.command[0].copy()
        count = round(_TIME_BACK / TICK)
        x = np.arange(1, count + 1) / count
        way = np.stack([
            x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * (x * (1.0 - x)) ** 2 / _TIME_BACK,
            60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / _TIME_BACK**2,
        ], axis=1)  # fmt: skip
        start, rows = self._station.arm.position(last), [np.array([last, 0.0 * last, 0.0 * last])]
        for step in way:
            target = np.outer(step, -_BACK * f.frame[:, 2])
            target[0] += start
            inside, virtual = f.virtual(target, rows[-1][0])
            if not inside:
                break
            rows.append(virtual)
        if len(rows) == count + 1:
            rows[-1][1:] = 0.0
            with suppress(InputError):  # a limit forbids it: the part is held where it is
                catcher.move(np.array(rows))
        ticks = self._ticks(catcher, _TIME_BACK + _HELD)
        results.extend(copied(catcher.result) for _ in ticks)

    def _scored(
        self, index: int, catcher: Catcher, results: list[Any], closed: float | None
    ) -> MeetTrial:
        """Score a finished trial."""
        world, ticks, truth = self.world, gathered(results), self.world.trace()
        gap = np.linalg.norm(truth.r_o - truth.position, axis=1)
        slip = np.linalg.norm(truth.dr_o - truth.velocity, axis=1)
        contact, verdict = world.first_contact, catcher.verdict
        k = None if closed is None else min(round(closed / TICK), len(gap) - 1)
        until = len(gap) if k is None else k
        found = measure(self._station.arm, ticks, truth)
        stopped = stop_as_json(catcher.stopped_by)
        why = reason_of(stopped) or (None if verdict is None else verdict.binding_limit)
        most = np.abs(ticks.command[:until, 2]).max(axis=0, initial=0.0)
        return MeetTrial(
            index=index,
            status=self._status(catcher, gap[-1], k),
            t_met_s=closed,
            in_sync_s=_longest((gap[:until] <= NEAR) & (slip[:until] <= SLOW)) * TICK,
            position_error_mm=None if k is None else 1e3 * float(gap[k]),
            velocity_error_m_s=None if k is None else float(slip[k]),
            touch_m_s=None if contact is None else contact.velocity_error,
            peak_contact_force_n=None if contact is None else world.peak_force,
            peak_acceleration=most.tolist(),
            limit_violations=found.limit_violations,
            binding_limit=why,
            stopped_by=stopped,
        )

    def _status(self, catcher: Catcher, gap: float, closed: int | None) -> str:
        """Return how a trial has ended."""
        world = self.world
        if world.diverged:
            return "aborted"
        if catcher.phase is Phase.STOPPED:
            return "stopped"
        if not np.isfinite(catcher.t_0):
            return "unreachable"
        if world.first_contact is None:
            return "missed"
        held = closed is not None and gap <= _KEPT and len(world.truth().touching) > 0
        return "met" if held else "slipped"


def _longest(inside: Array) -> int:
    """Return the length of the longest run of true values."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int64), [0]])))
    return int(np.max(ends[1::2] - ends[::2], initial=0))


def summary(trials: list[MeetTrial], stopwatch: Stopwatch) -> dict[str, Any]:
    """Return counts, the rate with its 95 % Wilson interval, and times of ticks."""
    counts = {status: sum(t.status == status for t in trials) for status in STATUSES}
    low, high = wilson(counts["met"], len(trials))
    sync = [t.in_sync_s for t in trials]
    return {
        "trials": len(trials),
        **counts,
        "meet_rate": counts["met"] / len(trials) if trials else 0.0,
        "ci95": [low, high],
        "in_sync_s_p50": float(np.median(sync)) if sync else None,
        "tick_us": stopwatch.percentiles_us(),
    }
