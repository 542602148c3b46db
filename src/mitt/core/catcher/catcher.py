"""The catcher: from images and encoders to torques and fingers, once a millisecond.

    Frame x2 -> Moments x2 -> Sighting -> BallState -> JointReference -> Command

``step`` makes a tick, one compiled call that knows the order of the stages
(:mod:`mitt.core.catcher.tick`).
``think`` comes after the command has left and does what is slow or rare: the verdict, adapting the
map, planning the brake; it takes effect at the next tick.
The catcher takes senses and gives commands, so it does not know whether a simulated world or a real
arm is at the other end.
"""

from collections.abc import Sequence
from copy import copy, deepcopy
from dataclasses import replace
from typing import final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.ball.belt import SILENT, BeltTravel
from mitt.core.ball.counts import FilterCounts, counts_of
from mitt.core.catcher.catch_notes import CatchNotes
from mitt.core.catcher.generators import Direct, Generator, Unoptimised
from mitt.core.catcher.given import GeneratorLike, answering, for_arm
from mitt.core.catcher.planner import Planner
from mitt.core.catcher.settings import (
    BRAKE,
    PHASES,
    REFUSED,
    STOPPED,
    STOPS,
    WATCH,
    CatcherSettings,
    Phase,
)
from mitt.core.catcher.sightings import Sightings
from mitt.core.catcher.state import (
    CatcherMemory,
    CatcherState,
    Result,
    ResultHandle,
    StateHandle,
    Tick,
    fresh_state,
    prepare_holding,
    stopped_by,
    tick_of,
)
from mitt.core.catcher.tick import act, looks, perceive, take, tick
from mitt.core.control.encoders import check_recovered
from mitt.core.control.envelope import check_motion
from mitt.core.control.health import Reason, StoppedBy
from mitt.core.errors import InputError
from mitt.core.eyes.clock_offset import ClockOffset, LearnedClock, load_fit
from mitt.core.eyes.eyes import Eyes, closed_eyes
from mitt.core.signals import TICK, Array, Command, Frame, Image, Senses, Sighting
from mitt.core.verdict.feasibility import Verdict

__all__ = ["Catcher", "CatcherSettings", "Phase", "Tick"]


@final
class Catcher:
    """Lets an arm catch; one object a throw.

    Attributes:
        stopped_by: Why the catcher has stopped, and what it knew then; None where it has not.
        t_0: Time at which the arm began to move [s]; infinite before.
    """

    def __init__(
        self,
        arm: Arm,
        generator: GeneratorLike,
        eyes: Eyes | None = None,
        *,
        settings: CatcherSettings | None = None,
    ) -> None:
        """Take the arm, what moves it, and the eyes, which are copied.

        Args:
            arm: The arm.
            generator: A map, what :func:`mitt.learn` returned, or another generator.
            eyes: Find the ball in images; if left out, the catcher is given points alone.
            settings: What it knows of ball, arm and surroundings.
        """
        self._arm = checks.instance("arm", arm, Arm)
        arm.model.check_ranges()
        generator, self._map = for_arm(arm, generator)
        generator = answering(generator, arm.n)
        eyes = closed_eyes() if eyes is None else checks.instance("eyes", eyes, Eyes)
        settings = CatcherSettings() if settings is None else settings
        self._settings = checks.instance("settings", settings, CatcherSettings)
        self._turns = eyes.heads > 0
        prepare_holding(arm, settings)
        # Other generators predict sigma at another catch than the map's: evaluated at each tick.
        plain = isinstance(generator, Direct | Unoptimised)
        self._blank = fresh_state(
            arm,
            eyes,
            settings,
            self._map,
            sigma_ready=settings.sigma_ready if plain else np.inf,
        )
        self._begin(generator, copy(eyes))
        looks(*self._memory.handles)  # loaded now, not in the middle of a throw
        load_fit(arm)
        self._clock = LearnedClock()  # of all throws

    def __copy__(self) -> "Catcher":
        """Return a catcher that goes on from here on its own; the arm is shared."""
        return deepcopy(self, {id(self._arm): self._arm})

    def again(self, generator: GeneratorLike) -> "Catcher":
        """Return a catcher for another throw, as this one was when it was made.

        Args:
            generator: Of the same kind and with the same map, if any; another is refused.
        """
        (generator, f), mine = for_arm(self._arm, generator), self._map
        same = f is mine or (f is not None and mine is not None and f.equals(mine))
        if not same:
            raise InputError("generator", "one with the map of this catcher", "another")
        generator = answering(generator, self._arm.n)
        other, eyes = object.__new__(Catcher), copy(self._eyes)
        other.__dict__.update(self.__dict__)
        other._begin(generator, eyes)
        eyes.reset()
        return other

    def take_over(self, torques: Array, t: float | None = None) -> None:
        """Let torques go on from those of another catcher, no faster than they may change.

        Args:
            torques: Commanded in the tick before the first one here [N m], shape (n,).
            t: Time of that tick, by the clock of those to come [s]; if left out, a millisecond
                before the first of them.

        Raises:
            InputError: It has made a tick.
        """
        torques = checks.vector("torques", torques, self._arm.n, finite=True)
        if self._ticked:
            raise InputError("take_over", "a catcher before its first tick", "one after it")
        self.state.tracking.before[:] = torques
        if t is not None:
            self.state.health["t"] = checks.number("t", t, finite=True)

    def _begin(self, generator: Generator, eyes: Eyes) -> None:
        """Begin a throw with a state of its own."""
        self._eyes = eyes
        self._memory = CatcherMemory(self._blank, eyes)
        self._planner = Planner(self._arm, generator, self._settings, self.state, self.result)
        self._todo, self._ticked, self._sightings = 0, False, Sightings()
        self._notes, self._hint = CatchNotes(self._arm), False
        self._said: str | None = None
        along = self._settings.belt
        self._belt = None if along is None else BeltTravel(np.array(along))
        self.stopped_by: StoppedBy | None = None
        self.t_0 = np.inf

    @property
    def state(self) -> CatcherState:
        """What the catcher knows and remembers, overwritten by the next tick."""
        return self._memory.state

    @property
    def result(self) -> Result:
        """What the last tick brought about, overwritten by the next."""
        return self._memory.result

    @property
    def estimated(self) -> Array:
        """Joint angles and speeds as they are estimated [rad, rad/s], (2, n); overwritten."""
        return self.state.estimated

    @property
    def phase(self) -> Phase:
        """What the catcher is about in the next tick, as far as that is known by now."""
        return PHASES[self._planner.phase]

    @property
    def braking(self) -> float:
        """Time that braking, or a motion of :meth:`move`, takes from its start to rest [s]."""
        return float(len(self._planner.brake) * TICK)

    @property
    def done(self) -> bool:
        """Whether the throw is over: braked, stopped or refused, and the arm rests.

        No motion is left, and command and arm have been at rest for 50 ms. Its torques hold it, or
        its brakes once they act. They go on to hold it only as long as ticks are made and their
        commands are sent.
        """
        return self._memory.held

    @property
    def refused(self) -> bool:
        """Whether a flight is refused, or was, and no other ball has been followed since."""
        phase, s = self._planner.phase, self.state.scalars[0]
        return phase == REFUSED or (phase == WATCH and bool(s["t_refused"] < np.inf))

    @property
    def flight_begun(self) -> float:
        """When the flight began that the estimate is of [s]: seen first, let go or kicked."""
        return self._planner.flight_begun

    @property
    def halted(self) -> bool:
        """Whether the last command leaves the arm at rest, and no motion is under way.

        The arm itself may still be on its way there.
        """
        return self._memory.halted

    @property
    def rests(self) -> bool:
        """Whether command and arm have been at rest for 50 ms, whatever the catcher is about."""
        return self._memory.rests

    @property
    def looking(self) -> bool:
        """Whether the catcher wants to see; not once it has stopped, or its braked arm rests."""
        return bool(looks(*self._memory.handles))

    @property
    def flying(self) -> bool:
        """Whether what is seen tells of the ball's flight; in the braking hand it has ended."""
        return self._planner.phase not in (BRAKE, STOPPED)

    @property
    def hint(self) -> str | None:
        """Why it stopped, may never see its ball or not catch it, where a likely cause is known.

        One line: sightings in other units, of another clock, too uncertain, always the same, none
        for some seconds, or noisier than they say; and once a throw is over, sightings whose stamps
        are some milliseconds off. None while there is nothing to say.
        """
        if self.stopped_by is not None and self.stopped_by.hint:
            return self.stopped_by.hint
        watched = self._hint_of_watch() if self._planner.phase == WATCH else None
        return watched or self._sightings.scatter or self._hint_of_catch()

    def _hint_of_watch(self) -> str | None:
        """Return why no ball may ever be seen; None where nothing is known to be wrong."""
        said, more = self._sightings.hint, self._eyes.left_out
        if said is None or more == 0:
            return said
        return (
            f"{said} Its images show {more} bright things beyond those that are followed: let"
            " learn_background see them before the throw, or cover them"
        )

    def _hint_of_catch(self) -> str | None:
        """Return what the catch says of a mistake, once the arm rests."""
        if self._planner.phase != BRAKE or not self.done:
            return None
        if not self._hint:
            self._hint, self._said = True, self._notes.hint(self.state, self._clock)
        return self._said

    @property
    def clock_offset(self) -> ClockOffset:
        """What the catch says of the clocks of eyes and arm, once the arm rests."""
        return self._notes.offset(self.state)

    @property
    def counts(self) -> FilterCounts:
        """What became of the sightings of this throw, each counted by its reason."""
        return counts_of(self.state.ball_filter)

    @property
    def certificate(self) -> Verdict | None:
        """What the map as refined last says of the catch; None where none was refined."""
        return self._planner.certificate

    @property
    def verdict(self) -> Verdict | None:
        """Verdict on the throw, the newest; None before the first."""
        return self._planner.verdict

    @property
    def begun(self) -> bool:
        """Whether it has made a tick."""
        return self._ticked

    @property
    def tick(self) -> Tick | None:
        """What the last tick brought about; None before the first."""
        return tick_of(self.result) if self._ticked else None

    def step(self, senses: Senses) -> Command:
        """See, estimate, generate, close, track: one tick.

        Its command has to be sent before another tick is made: until then the arm is taken to obey
        it. Of readings that wait make a tick of the newest alone; the time since is bridged.

        Raises:
            ShapeError: The encoders, or an image, have not the size of this arm or camera.
            InputError: Something else in ``senses`` is not what it should be. The tick is not
                made then, and the catcher is as it was before.
        """
        if senses.__class__ is not Senses:
            checks.instance("senses", senses, Senses)
        memory = self._memory
        memory.read(self._arm, senses.arm)
        images, apart, t_exposed = self._eyes.arrange(senses.frames)
        if self._todo:
            self.think()
        t, flying = senses.t, self.flying
        if self._belt is not None:
            for reading in senses.belt:
                self._belt.read(reading.t, reading.travel)
        if senses.points and flying:
            take(self._on_belt(senses.points), t, self.state)
        seen, read = (
            (images, self.backgrounds, apart, t_exposed),
            (t, senses.arm.t, memory.q, memory.dq),
        )
        brake, (state, out) = self._planner.brake, memory.handles
        if self._map is None:
            perceive(seen, read, state, out)
            self._ride()
            self._planner.refer()
            self._todo = act(brake, state, out)
        else:
            self._todo = tick(seen, read, brake, state, out)
        self._ticked = True
        self._notes.note(senses, self.state, self.result)
        if flying:
            self._sightings.note(senses.points, bool(memory.out["sighted"]), memory.t)
        if self._todo & STOPS:
            self._note_stop()
        if memory.out["following"]:
            self.t_0 = min(self.t_0, memory.t)
        return memory.command(memory.result.gaze.copy() if self._turns else None)

    def _on_belt(self, points: tuple[Sighting, ...]) -> tuple[Sighting, ...]:
        """Return sightings as the filter takes them: in the frame of the belt, if it is read."""
        belt = self._belt
        if belt is None:
            return points
        known = points if belt.known else ()
        return tuple(replace(x, r_o=belt.into(x.t, x.r_o)) if x.found else x for x in known)

    def _ride(self) -> None:
        """Bring the estimate of what rides on a belt to where the belt has carried it."""
        belt, result = self._belt, self.result
        out = result.scalars[0]
        if belt is None or not out["tracked"] or not self.flying:
            return
        t = float(out["t"])
        belt.carry(t, result.ball, result.covariance)
        if t - belt.newest > SILENT:  # from then on it is known as little as what is hidden
            out["t_seen"] = min(float(out["t_seen"]), belt.newest)

    def learn_background(self, views: Sequence[tuple[Frame, ...]]) -> None:
        """Learn what the cameras see before the throw, as :meth:`Eyes.learn_background`."""
        self._eyes.learn_background(views)

    @property
    def backgrounds(self) -> tuple[Image, ...]:
        """What :func:`mitt.core.catcher.tick.tick` takes as backgrounds."""
        return self._eyes.backgrounds

    @property
    def parts(self) -> tuple[Array, StateHandle, ResultHandle] | None:
        """What :func:`mitt.core.catcher.tick.tick` takes after the senses, for a loop over ticks.

        Such a loop goes on without :meth:`think` where
        :func:`mitt.core.catcher.planner.undecided` says so.

        None for a generator that is no map: it asks for :meth:`step`.
        """
        return None if self._map is None else self.kernel_arguments

    @property
    def kernel_arguments(self) -> tuple[Array, StateHandle, ResultHandle]:
        """What the kernels of a tick take after the senses: the brake, the state, the result."""
        return self._planner.brake, *self._memory.handles

    def ticked(self, todo: int, since: float) -> None:
        """Take over after a loop over ticks of one phase.

        Args:
            todo: What the last tick left to be thought about.
            since: Time of the first tick [s].
        """
        todo = checks.whole("todo", todo, least=0)
        since = checks.number("since", since, finite=True)
        self._todo, self._ticked = todo, True
        if todo & STOPS:
            self._note_stop()
        if self._memory.out["following"]:
            self.t_0 = min(self.t_0, since)

    def think(self) -> None:
        """Do what is slow or rare, to be used by the next tick; best after the command has left.

        Does nothing if there is nothing to think about or it has been done.
        """
        todo, self._todo = self._todo, 0
        self._planner.think(todo)

    def _note_stop(self) -> None:
        """Note why the tick just made has stopped the arm."""
        s = self.state.scalars[0]
        age = s["age_told"].item() if s["stale"] else None
        found = stopped_by(self._arm, self.state.monitor.joints, self.estimated, self.result, age)
        failed = found.reason is Reason.FAILED
        self.stopped_by = replace(found, hint=self._planner.failure) if failed else found

    def stop(self) -> None:
        """Stop with the next tick, within all limits, and stay until :meth:`recover`."""
        self._memory.scalars["stop_requested"] = True

    def move(self, motion: Array) -> None:
        """Move the waiting or braked arm along a motion instead of catching, within all limits.

        The hand stays as it is. The way is over for good: a throw takes a fresh catcher.

        Args:
            motion: q, dq, ddq each tick from the last command on, the last row at rest, shape
                (k, 3, n) [rad ...].

        Raises:
            InputError: The arm was not commanded to rest by now, or the catcher has stopped or was
                told to; the motion does not begin at the last command, does not end at rest, has
                rows that are not those of one motion, or is beyond a limit.
        """
        motion = checks.array("motion", motion, (None, 3, self._arm.n), finite=True)
        if (why := self._unfit_to_move()) is not None:
            raise InputError("move", "a catcher that waits, its arm at rest", why)
        last = self._memory.state.last
        check_motion(self._arm.names, self._memory.state.safety.bounds, last, motion)
        self._planner.move(motion, self._memory.t)

    def let_go(self) -> None:
        """Open the hand of an arm that has braked and rests; its torques go on to hold it.

        Raises:
            InputError: It has not braked, or does not rest yet.
        """
        braked = self._planner.phase == BRAKE
        if not (braked and self._memory.rests):
            given = "one that moves" if braked else self.phase.value
            raise InputError("let_go", "a catcher that has braked, its arm at rest", given)
        self._memory.let_go(self._blank, self._arm)

    def _unfit_to_move(self) -> str | None:
        """Return in words why no motion can begin now; None where one can."""
        if not self._memory.scalars["begun"]:
            return "one whose joints were not all read yet: make a tick first"
        if self._planner.phase not in (WATCH, REFUSED, BRAKE):
            return self.phase.value
        if self._memory.scalars["stop_requested"]:
            return "one that was told to stop"
        return None if self._memory.halted else "one whose arm is commanded to move"

    def recover(self, *, checked: bool = False) -> None:
        """Release the brakes and watch for a ball again, from where the encoders say the arm is.

        Args:
            checked: Whether a person has checked the encoders that had a fault. If not, each has
                to have read well for 50 ms, near to where its joint was predicted to be, and one
                that was stuck has to have moved.

        Raises:
            InputError: The catcher has not stopped, the arm is not at rest and held yet, or the
                encoder of a joint still has a fault.
        """
        stopped = self._planner.phase == STOPPED
        if not (stopped and self._memory.held):
            given = "one whose arm is not at rest and held yet" if stopped else self.phase.value
            raise InputError("recover", "a catcher that has stopped, its arm at rest", given)
        if not checks.flag("checked", checked):
            check_recovered(self._arm.names, self.state.monitor.joints)
        self._eyes.reset()
        self._memory.restart(self._blank, self._eyes)
        self._planner.begin()
        self._todo, self.t_0, self.stopped_by = 0, np.inf, None
        self._sightings, self._notes, self._hint = Sightings(), CatchNotes(self._arm), False
