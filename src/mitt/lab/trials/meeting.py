"""Trials of ``mitt meet``: a part comes by on a belt or in a hand, the arm meets and takes it.

After the tool has closed the arm brakes, goes back along the tool's axis with the part, carries it
to a tray, puts it down, opens, and goes back to where it waits, ready for the next. All that is
scored is taken from the true states of the world.

Each trial begins anew, the arm where it waits: so each gives the same alone and among others, and
may be run again to be looked at. What a next part on the same belt needs, the arm back at its place
and the tool open, is part of what is scored as ``placed``.
"""

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, NamedTuple, final

import numpy as np

from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.meeting import Meeting
from mitt.core.catcher.settings import Phase
from mitt.core.catcher.state import gathered
from mitt.core.control.health import Reason
from mitt.core.errors import InputError
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import EyesConfig
from mitt.core.signals import TICK, Array, Senses
from mitt.core.verdict.feasibility import Outcome
from mitt.io.about import About
from mitt.io.messages import CATCH_POINT, TRUTH, tick_rows
from mitt.io.recordings import Recording as Written
from mitt.io.recordings import Track, heading_of
from mitt.lab.rivals.meeting import encoder_of
from mitt.lab.trials.placing import Placing, backed, carried, placing_of
from mitt.lab.trials.result import finite
from mitt.lab.trials.score import measure, reason_of, stop_as_json
from mitt.lab.trials.scored_task import Measure, ScoredTask
from mitt.lab.trials.station import Station
from mitt.lab.trials.task_runner import TaskRunner
from mitt.lab.world.engine import BALL_HAND
from mitt.lab.world.flights import RecordedFlight
from mitt.lab.world.simulation import World
from mitt.lab.world.targets import InHand, RecordedMotion, Ride, recorded
from mitt.lab.world.truth import Trace

STATUSES = ("met", "slipped", "missed", "unreachable", "stopped", "aborted")

#: Longest time from the start of a trial to the meeting [s], and from the end of a recording.
_LONGEST = 7.0
_BEYOND = 3.0
#: How long after it has closed the tool has to hold the part [s]; last ticks of that time in one of
#: which it touches it.
_HELD = 0.5
_LAST = 20
#: Time that the arm is given to come to rest at the end of a trial, and that a tool is given to
#: open, beyond its delay [s].
_SETTLES = 0.5
_OPENS = 0.7
#: In step with the target: position and velocity of tool and part so near [m, m/s].
NEAR = 0.005
SLOW = 0.05
#: How far a part that is held may be from where the tool holds it, how near to its place a part is
#: put, seen from above [m], how slow it is there [m/s], and how near to its place a tool that
#: waits again is [m].
_KEPT = 0.03
_PUT = 0.05
_LIES = 0.02
_WAITS = 0.02
#: Last ticks of a trial in which a joint that rests turns by no more than this [rad].
_STILL = 100
_RESTS = 0.01
#: Longest time that the arm takes to come to rest where it is told to put a part down [s].
_COMES_TO_REST = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetTrial:
    """One trial, field by field as in the result.

    Attributes:
        index: Its number.
        status: ``met``: the tool holds the part by contact 0.5 s after it has closed; ``slipped``:
            touched, not held; ``missed``: never touched; ``unreachable``: the arm did not start;
            ``stopped``: a controlled stop; ``aborted``: the physics diverged.
        t_met_s: When the tool had closed [s].
        in_sync_s: Longest time before that in which tool and part were within 5 mm and 0.05 m/s.
        position_error_mm: Distance of tool and part when it had closed.
        velocity_error_m_s: Difference of their velocities then.
        touch_m_s: The same when they first touched.
        peak_contact_force_n: Largest single contact force on the part.
        peak_acceleration: Largest commanded acceleration of each joint until then [rad/s^2].
        limit_violations: As of :class:`mitt.lab.trials.score.Trial`.
        binding_limit: The limit that the verdict found most used, or what ended the trial;
            ``area``: the part left the work area, or does not come into it; ``window``: it leaves
            it before the tool would have closed; ``taken``: it was taken away or fell; ``hidden``:
            it was hidden for too long; ``tool``: it runs faster than the tool may follow;
            ``blocked``: the arm's limits, the arm itself or the floor kept it from following.
        placed: Whether the part lies on its tray, the tool open and the arm back where it waits;
            None where nothing was met, or there is no tray.
        cycle_s: From when the arm set out until it waited again, the part on its tray; None where
            it was not placed.
        tool_speed_m_s: Largest speed of the tool.
        over_force: Whether the contacts together, or one of them, pressed harder than the tool
            takes; None without a contact.
        hand_force_n: Largest force on the hand that handed the part over; None without one.
        at_rest: Whether the arm rests at the end.
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
    placed: bool | None = None
    cycle_s: float | None = None
    tool_speed_m_s: float = 0.0
    over_force: bool | None = None
    hand_force_n: float | None = None
    at_rest: bool = True
    stopped_by: dict[str, Any] | None = None


class Course(NamedTuple):
    """How a trial went, k instants.

    Attributes:
        t: Time [s], shape (k,).
        gap: Distance of tool and part [m], shape (k,).
        slip: Difference of their velocities [m/s], shape (k,).
        force: Largest contact force on the part [N], shape (k,).
        t_touched: When they first touched [s]; None where they did not.
        t_met: When the tool had closed [s]; None where it did not.
    """

    t: Array
    gap: Array
    slip: Array
    force: Array
    t_touched: float | None
    t_met: float | None


class _Ending(NamedTuple):
    """How the meeting of a trial went, before the arm was put away.

    Attributes:
        closed: When the tool had closed [s]; None where it did not.
        left: ``area`` where the part left the work area while it was followed.
        put: Where the part was put; None where it was not.
        ended: When the arm had nothing more to do [s].
    """

    closed: float | None
    left: str | None
    put: Placing | None
    ended: float


@final
class MeetRunner(TaskRunner[MeetTrial]):
    """A station and its world, built once and used for many trials.

    Attributes:
        placing: Where parts are put; None where there is no place.
        course: How the last trial went.
    """

    def __init__(
        self,
        station: Station,
        *,
        seed: int,
        speed: float,
        generator: Generator | None = None,
        recordings: tuple[RecordedFlight, ...] = (),
    ) -> None:
        """Build the world.

        Args:
            station: The arm where it meets things.
            seed: Of all trials.
            speed: Of the belt, or the largest of the hand [m/s].
            generator: What moves the arm; the meeting map if left out.
            recordings: Recorded motions, one after the other, instead of belt or hand.
        """
        self._station, self._seed, self._speed = station, seed, speed
        self._recordings = recordings
        self._generator = generator or Meeting(station.map, station.settings)
        self._encoder = encoder_of(self._generator)
        self.placing, scene = placing_of(station), station.scene
        if self.placing is not None:
            scene = scene.model_copy(update={"tray": self.placing.tray})
        world = World(scene, station.arm.model, limits=station.arm.limits)
        super().__init__(station.arm, world)
        self.course: Course | None = None
        self._first_course: Course | None = None
        self._longest, self._ending = _LONGEST, _Ending(None, None, None, 0.0)

    @property
    def first_course(self) -> Course:
        """How the first trial went, which is run now where it was not."""
        if self._first_course is None:
            self.trial(0)
        if self._first_course is None:
            raise RuntimeError("a trial has a course")
        return self._first_course

    def target(self, index: int) -> Ride | InHand:
        """Return what comes by in a trial."""
        rng, s = np.random.default_rng([self._seed, index, 1]), self._station
        if self._recordings:
            recording = self._recordings[index % len(self._recordings)]
            return replace(recorded(recording, s.place, rng), orientation=s.presented)
        return s.coming(rng, self._speed)

    def draw(self, index: int) -> tuple[Ride | InHand, int]:
        """Return what comes by, and the seed of its trial; what is longer is followed longer."""
        target = self.target(index)
        self._longest = _LONGEST
        if isinstance(target, RecordedMotion):
            self._longest = max(_LONGEST, target.duration + _BEYOND)
        return target, int(np.random.default_rng([self._seed, index]).integers(2**31))

    def generator(self) -> Generator:
        """Return what moves the arm."""
        return self._generator

    def made(self, generator: Generator) -> Catcher:
        """Return the catcher that those of all trials begin as."""
        return Catcher(self.arm, generator, settings=self._station.catcher)

    def sensed(self, senses: Senses) -> None:
        """Let a generator that follows the belt's encoder have its reading of this tick."""
        ride = self.world.ride
        if self._encoder is None or ride is None:
            return
        for reading in senses.belt:
            self._encoder.read(reading.t, reading.travel)
        if self._station.scene.sensing.belt is None:  # an exact one
            self._encoder.read(senses.t, ride.travel(senses.t))

    def over(self, catcher: Catcher) -> bool:
        """Say whether the tool has closed, the part was given up, or too much time has passed."""
        ended = catcher.done or _has_braked(catcher, self.world.t)
        return self.world.diverged or ended or len(self._rows) >= round(self._longest / TICK)

    def play(self, catcher: Catcher) -> None:
        """Meet the part, put it away, and come to rest."""
        self.keeps = True
        while not self.over(catcher):
            self.tick(catcher)
        self.keeps = False
        fingers, closed = catcher.state.fingers[0], None
        if np.isfinite(fingers["t_begun"]):
            closed = float(fingers["t_begun"] + fingers["duration"])
        braked = catcher.phase is Phase.BRAKE and closed is None
        left = self._left_area() if braked and not _given_up(catcher) else None
        put = None
        if catcher.phase is Phase.BRAKE and closed is not None:
            put = self._put_away(catcher, closed)
        elif catcher.phase is Phase.FOLLOW:
            catcher.stop()
        self._ending = _Ending(closed, left, put, self.world.t)
        self._wait(catcher, _SETTLES)
        self.gather(catcher)

    def _wait(self, catcher: Catcher, lasts: float, *, look: bool | None = False) -> None:
        """Make ticks for so long [s], unless the physics diverges."""
        for _ in range(round(lasts / TICK)):
            if self.world.diverged:
                return
            self.tick(catcher, look=look)

    def recording(self, trial: MeetTrial) -> Written:
        """Return the recording of the last trial, up to when the tool had closed.

        Raises:
            InputError: What moved the arm is not the map: only that is made again by a replay.
        """
        s, ticks = self._station, self._rows[: len(self.senses)]
        if not isinstance(self._generator, Meeting):
            raise InputError("a recording of a meeting", "the generator direct", "another")
        about = About(
            arm=s.arm,
            generator="meeting",
            maps=(),
            made_of=Meeting(s.map, s.settings),
            settings=s.catcher,
            rig=fixed_rig(),
            eyes=EyesConfig(),
            notes=s.notes,
        )
        truth = self.world.trace()
        said = {
            "trial": json.dumps(finite(asdict(trial)), allow_nan=False),
            "seed": str(self._seed),
        }
        return Written(
            heading=heading_of(about, said),
            ticks=tick_rows(gathered(ticks), self.senses, 0),
            points={k: x.points for k, x in enumerate(self.senses) if x.points},
            belt={k: x.belt for k, x in enumerate(self.senses) if x.belt},
            tracks=(
                Track(topic=TRUTH, t=truth.t, r=truth.r_o),
                Track(topic=CATCH_POINT, t=truth.t, r=truth.position),
            ),
        )

    def _left_area(self) -> str | None:
        """Return ``area`` where the part is outside the work area now."""
        r_o, s = self.world.truth().r_o, self._station.settings
        return None if np.all((r_o >= s.low) & (r_o <= s.high)) else "area"

    def _put_away(self, catcher: Catcher, closed: float) -> Placing | None:
        """Carry the part to the tray and put it down; go back to where the arm waits.

        What is not held is not carried. Returns where the part was put, if it was.
        """
        s = self._station
        self._move(catcher, backed(s.map, catcher.result.command[0].copy()))
        self._wait(catcher, closed + _HELD - self.world.t, look=None)
        put = self.placing if self._holds(self.world.trace(), closed) else None
        for pose in () if put is None else (put.over, put.down):
            if not self._move(catcher, pose):
                return put  # it is not let go elsewhere
        for _ in range(round(_COMES_TO_REST / TICK)):
            if self.world.diverged:
                break
            self.tick(catcher, look=False)
            if catcher.rests:
                break
        with suppress(InputError):  # it has stopped
            catcher.let_go()
        delay = s.arm.model.hand.delay if s.arm.model.hand is not None else 0.0
        self._wait(catcher, _OPENS + delay)
        if put is not None:
            self._move(catcher, put.over)
        self._move(catcher, s.arm.q_ready)
        return put

    def _move(self, catcher: Catcher, to: Array) -> bool:
        """Move to a pose as slowly as the station says; where a limit forbids it, stay.

        Returns whether it has moved there.
        """
        start = catcher.result.command[0].copy()
        with suppress(InputError):
            way = carried(self._station.arm, start, to, self._station.settings.speed)
            catcher.move(way)
            self._wait(catcher, len(way) * TICK)
            return True
        return False

    def _holds(self, truth: Trace, closed: float) -> bool:
        """Say whether the tool held the part for so long after it had closed."""
        k = min(round((closed + _HELD) / TICK), len(truth.t) - 1)
        gap = float(np.linalg.norm(truth.r_o[k] - truth.position[k]))
        return gap <= _KEPT and bool(np.any(truth.seen[max(k - _LAST, 0) : k + 1] & BALL_HAND))

    def _lies(self, put: Placing) -> bool:
        """Say whether the part lies on its place, left alone by an arm that waits again."""
        truth, arm = self.world.truth(), self._station.arm
        waits = float(np.linalg.norm(truth.position - arm.position(arm.q_ready))) < _WAITS
        away = truth.r_o - put.place
        near = float(np.hypot(away[0], away[1])) < _PUT and abs(float(away[2])) < 0.5 * _PUT
        slow = float(np.linalg.norm(truth.dr_o)) < _LIES
        return near and slow and waits and not truth.touching

    def score(self, index: int, catcher: Catcher) -> MeetTrial:
        """Score a finished trial."""
        world, ticks, truth = self.world, self.ticks, self.world.trace()
        closed, left, put, ended = self._ending
        gap = np.linalg.norm(truth.r_o - truth.position, axis=1)
        slip = np.linalg.norm(truth.dr_o - truth.velocity, axis=1)
        contact, verdict, hand = world.first_contact, catcher.verdict, self._station.arm.model.hand
        k = None if closed is None else min(round(closed / TICK), len(gap) - 1)
        until = len(gap) if k is None else k
        stopped = stop_as_json(catcher.stopped_by)
        why = reason_of(stopped) or (None if verdict is None else verdict.binding_limit)
        touched = None if contact is None else contact.t
        self.course = Course(truth.t, gap, slip, truth.force, touched, closed)
        if index == 0:
            self._first_course = self.course
        status = self._status(catcher, truth, closed)
        placed = None if status != "met" or put is None else self._lies(put)
        return MeetTrial(
            index=index,
            status=status,
            t_met_s=closed,
            in_sync_s=_longest((gap[:until] <= NEAR) & (slip[:until] <= SLOW)) * TICK,
            position_error_mm=None if k is None else 1e3 * float(gap[k]),
            velocity_error_m_s=None if k is None else float(slip[k]),
            touch_m_s=None if contact is None else contact.velocity_error,
            peak_contact_force_n=None if contact is None else world.peak_force,
            peak_acceleration=np.abs(ticks.command[:until, 2]).max(axis=0, initial=0.0).tolist(),
            limit_violations=measure(self._station.arm, ticks, truth).limit_violations,
            binding_limit=left or why,
            placed=placed,
            cycle_s=ended - catcher.t_0 if placed else None,
            tool_speed_m_s=float(np.linalg.norm(truth.velocity, axis=1).max()),
            over_force=None if contact is None or hand is None else world.peak_load > hand.force,
            hand_force_n=None if contact is None else world.hand_force,
            at_rest=bool(np.ptp(truth.q[-_STILL:], axis=0).max() < _RESTS),
            stopped_by=stopped,
        )

    def _status(self, catcher: Catcher, truth: Trace, closed: float | None) -> str:
        """Return how a trial has ended."""
        world = self.world
        if world.diverged:
            return "aborted"
        if catcher.stopped_by is not None and catcher.stopped_by.reason is not Reason.REQUESTED:
            return "stopped"
        if not np.isfinite(catcher.t_0):
            return "unreachable"
        if world.first_contact is None:
            return "missed"
        return "met" if closed is not None and self._holds(truth, closed) else "slipped"


def _given_up(catcher: Catcher) -> bool:
    """Say whether a target that was followed was given up, with a reason."""
    return catcher.verdict is not None and catcher.verdict.outcome is not Outcome.FEASIBLE


def _has_braked(catcher: Catcher, t: float) -> bool:
    """Say whether an arm has braked at a time, though friction may still turn its joints [s]."""
    return catcher.phase is Phase.BRAKE and t > float(catcher.state.scalars[0]["t_rest"])


def _longest(inside: Array) -> int:
    """Return the length of the longest run of true values."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int64), [0]])))
    return int(np.max(ends[1::2] - ends[::2], initial=0))


def _more(trials: Sequence[MeetTrial]) -> dict[str, Any]:
    """Return what the summary of a run says beside counts and rate."""
    sync = [t.in_sync_s for t in trials]
    force = [t.peak_contact_force_n for t in trials if t.peak_contact_force_n is not None]
    hand = [t.hand_force_n for t in trials if t.hand_force_n is not None]
    cycles = [t.cycle_s for t in trials if t.cycle_s is not None]
    return {
        "parts_a_minute": 60.0 / float(np.mean(cycles)) if cycles else None,
        "placed": sum(t.placed is True for t in trials),
        "in_sync_s_p50": float(np.median(sync)) if sync else None,
        "force_n": max(force, default=None),
        "hand_force_n": max(hand, default=None),
        "over_force": sum(t.over_force is True for t in trials),
        "at_rest": sum(t.at_rest for t in trials),
        "limit_violations": sum(t.limit_violations for t in trials),
    }


MEET: Final = ScoredTask(
    name="meet",
    schema="mitt.meet-study/1",
    trial=MeetTrial,
    trials="trials",
    doing="meeting",
    in_result="trials",
    statuses=STATUSES,
    rate="meet_rate",
    counted="targets met",
    measures={
        "error_mm": Measure("error at the grasp [mm]", "position_error_mm", 1),
        "velocity_m_s": Measure("relative speed [m/s]", "velocity_error_m_s", 3),
        "acceleration": Measure("peak acceleration [rad/s^2]", "peak_acceleration", 0),
        "force_n": Measure("force on the part [N]", "peak_contact_force_n", 0),
        "in_sync_s": Measure("in step [s]", "in_sync_s", 3, more=True),
    },
    medians={},
    more=_more,
)
"""The task."""
