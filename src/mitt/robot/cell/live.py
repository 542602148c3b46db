"""The live loop: a robot, a catcher, and a person who says when the arm may move.

Readings pace the loop: those that come together make one tick of the catcher, whose command answers
the newest of them. Where no reading comes at all nothing is written, so that the robot's own
watchdog brakes, and the brakes are engaged. Whatever a driver raises or gives that cannot be used
stops the arm: within its limits as long as it can be read, by its brakes where it cannot.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import final

import numpy as np

from mitt.clock import monotonic
from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.control.health import Reason
from mitt.core.eyes.clock_offset import LearnedClock
from mitt.core.eyes.lens import Lens
from mitt.core.signals import TICK, ArmState, Array, Command
from mitt.lab.trials.slow_motion import slow_motion
from mitt.robot.cell.frames import FrameSet, FrameSource, Sight
from mitt.robot.cell.placing import Leg, PutDown
from mitt.robot.cell.readings import Counts, Lag, Positions, Watch, check_reading
from mitt.robot.cell.recorder import Recorder
from mitt.robot.cell.robot import RobotLink
from mitt.robot.cell.ticks import Ticks

#: Time without a position after which a ball or part is gone [s].
_GONE = 0.4
#: How far from the ready pose the arm may rest [rad].
_NEAR = 0.03
#: Speed of a joint that no slow motion has [rad/s]: it is told 1 rad/s at most; fastest setpoint
#: then, which corrects gaps too.
_TOO_FAST = 2.5
_TO_READY = 1.5
_SLOW = "joint states repeat: the robot is slower than its publisher"
_FROZEN = "joint states repeat while the arm moves: the robot is not read any more"
#: Time within which a stop has to end [s].
_STOPS = 2.0


#: Parts in a row that the tool did not take, after which the loop stops.
_EMPTY = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """When a throw, or a part that comes by, is one, and when it is over.

    Attributes:
        slowest: Slowest ball that is a throw, at its fastest, or part that is one, when it is seen
            last [m/s].
        longest: Longest time for which one is seen [s].
        held: How long what was caught is held before the arm moves on [s].
    """

    slowest: float = 1.0
    longest: float = 3.0
    held: float = 0.6


#: Share of a ball's sightings from which it is said that they were not used.
_UNUSED = 0.1
_PARTS = Rules(slowest=0.05, longest=60.0, held=0.05)


class Mode(Enum):
    """What the loop is about: a value says it in words."""

    WAITING = "waiting for the robot"
    """No healthy robot yet, or nobody has said that the arm may move."""
    MOVING = "to the ready pose"
    """Slowly."""
    CATCHING = "catching"
    """A fresh catcher watches, follows, brakes and holds."""
    PLACING = "putting down"
    """A part that was met."""
    MEASURING = "measuring"
    """How the robot follows: the arm swings about its ready pose."""
    STOPPING = "stopping"
    """A controlled stop within all limits."""
    STOPPED = "stopped"
    """At rest, brakes engaged, latched until a person says so."""


@final
class LiveLoop:
    """Catches with a robot, throw after throw.

    Attributes:
        mode: What it is about.
        why: Why it stops or has stopped.
        counts: What happened so far.
        notes: What is odd now in what the robot and the ball's source send, in words, by its kind;
            of what is looked at now and then, what the last look found.
        brakes: What the brakes were told last, as far as nothing went wrong with that.
        age: Time from the newest reading to its command here [s].
        measured: Stamps between which the arm was measured [s]; None before.
    """

    def __init__(
        self,
        link: RobotLink,
        arm: Arm,
        first: Catcher,
        again: Callable[[Catcher], Catcher],
        *,
        ready_speed: float,
        silence: float,
        frames: FrameSource | None = None,
        lenses: Sequence[Lens] = (),
        recorder: Recorder | None = None,
        clock: Callable[[], float] = monotonic,
        period: float = TICK,
        placing: PutDown | None = None,
        measures: Callable[[Arm, Array], Array] | None = None,
    ) -> None:
        """Take the robot, the arm as it is driven, and a first catcher.

        ``again`` returns a fresh one for another throw. ``ready_speed`` is the share of the speeds
        in motions to the ready pose, ``silence`` the time without a reading after which the robot
        is lost [s], ``clock`` the steady clock by which readings arrive, ``period`` apart [s].
        Without ``frames`` the ball is seen as points; ``lenses`` bend them. ``recorder`` keeps each
        tick of a catch. ``placing`` puts down the parts that are met, where no balls are caught.
        ``measures`` returns a motion about a pose, from rest to rest, that is made once the arm is
        in its ready pose for the first time.
        """
        self._link, self._robot, self._arm = link, link.robot, arm
        self._share, self._silence, self._sight = ready_speed, silence, Sight(frames, lenses)
        self._clock, self._lag = clock, Lag()
        self.mode, self.why = Mode.WAITING, ""
        self.counts, self.notes, self.brakes = Counts(), dict[str, str](), ""
        self._positions = Positions(self.counts)
        self._watch = Watch(
            arm, link.robot, self._lag, self._positions, clock=clock, silence=silence
        )
        self._ticks = Ticks(
            first, again, self._sight, self._positions, self.counts, recorder, arm, period=period
        )
        self.age, self._until, self._fastest, self._missed = 0.0, np.inf, 0.0, False
        self._unread, self._placing, self._leg, self._empty = 0, placing, Leg.BACK, 0
        self._rules = Rules() if placing is None else _PARTS
        self._measures, self._from = measures, 0.0
        self.measured: tuple[float, float] | None = None

    @property
    def idle(self) -> bool:
        """Whether the arm waits in its ready pose for a ball that it has not decided on."""
        catcher = self._ticks.catcher
        watches = self.mode is Mode.CATCHING and catcher.phase is Phase.WATCH
        return watches and catcher.begun

    @property
    def disturbed(self) -> bool:
        """Whether the last look found an arm that a person has to see to before it may move."""
        return self._watch.disturbed

    @property
    def meets(self) -> bool:
        """Whether parts are met, and no balls caught."""
        return self._placing is not None

    @property
    def clock(self) -> LearnedClock:
        """The eyes' clock as the catches so far say it."""
        return self._ticks.clock

    def healthy(self) -> str:
        """Read without moving, at first for 50 ms; return what is wrong, nothing if all is well."""
        blind, wrong = self._sight.open(), self._watch.look()
        now = self._clock()
        self._sight.newest(now)
        return "; ".join(x for x in (wrong, blind or self._sight.silent(now)) if x)

    def begin(self) -> None:
        """Move to the ready pose from here: a person has said that the arm may move."""
        self.mode, self.why, self._until = Mode.MOVING, "", np.inf
        self._unread = self._empty = 0
        try:
            self._robot.read(0.0)
            self._ticks.restart()
            self._link.release()
        except Exception as error:  # a driver's own
            self._cut(f"the robot cannot be released: {error}")

    def acknowledge(self) -> str:
        """Release the brakes of a robot in protective stop: a person has said so.

        What is returned says why that failed; nothing where it did not.
        """
        try:
            self._link.release()
        except Exception as error:  # a driver's own
            return f"the robot cannot be released: {error}{self._engaged()}"
        return ""

    def leave(self, why: str) -> None:
        """Leave the arm safe, whatever happened: at rest if it can be, its brakes engaged."""
        end = monotonic() + _STOPS + 1.0
        try:
            self.stop(why)
            while self.mode is Mode.STOPPING and monotonic() < end:
                try:
                    self.cycle()
                except BaseException as error:  # it ends anyway: first the arm comes to rest
                    self._failed(f"interrupted: {error}")
        finally:
            if self._link.released:
                self.finish()

    def stop(self, why: str) -> None:
        """Stop within all limits, for a reason; it stays so until :meth:`begin`."""
        if self.mode in (Mode.MOVING, Mode.CATCHING, Mode.PLACING, Mode.MEASURING):
            self.why = why
            self._ticks.stop()
            self.mode, self._until = Mode.STOPPING, self._ticks.stamps.t + _STOPS

    def finish(self) -> None:
        """Engage the brakes of the arm at rest: all is done."""
        was, self.mode = self.mode, Mode.STOPPED
        self.why += self._engaged()
        if was is Mode.CATCHING:
            self._stay()

    def _engaged(self) -> str:
        """Tell the brakes to engage, more than once where they do not answer; say what failed.

        Whether they have engaged is known to nobody here.
        """
        said, self.brakes = "", ""
        for _ in range(3):
            try:
                unheard = self._link.brake()
            except BaseException as error:  # a driver's own: its watchdog is left
                said = f"; the brakes do not answer: {error}"
            else:
                if unheard:
                    return f"; the brakes were told to engage, and {unheard}"
                self.brakes = "the brakes were told to engage"
                return ""
        return said

    def _stay(self) -> None:
        """Leave a robot that rests with a setpoint that moves nothing: it may be its last."""
        catcher = self._ticks.catcher
        if catcher.begun and self._ticks.rests:
            hand, stamp = catcher.result.scalars[0]["hand"], self._ticks.stamps.stamp
            self._link.stay(catcher.estimated[0], float(hand), stamp)

    def cycle(self) -> None:
        """Wait for readings and answer them; what goes wrong stops the arm and is not raised."""
        try:
            # The second look is for a stall of ours, after which nothing had time to come in.
            readings = self._robot.read(self._silence) or self._robot.read(0.003)
            for reading in readings or ():
                check_reading(reading, self._arm.n)
        except Exception as error:  # a driver's own
            self._failed(f"the robot cannot be read: {error}")
            return
        self._unread = 0
        try:
            self._take(readings)
        except Exception as error:  # ours, or what a driver gave
            self._cut(str(error))

    def _failed(self, why: str) -> None:
        """Stop where readings fail; give the robot up once they have for as long as silence may be.

        What fails at once, without waiting, counts as a tick.
        """
        self._unread += 1
        self.stop(why)
        if self._unread * TICK >= self._silence:
            self._cut(why)

    def _take(self, readings: Sequence[ArmState]) -> None:
        """Answer the readings of a cycle."""
        now, begun = self._clock(), monotonic()
        if not readings:
            self._cut(f"no joint states for {1e3 * self._silence:.0f} ms")
            return
        late = self._lag.fault(readings[-1].t, now)
        self._look_at_ball(readings[-1].t + self._lag.later)
        seen = self._images(now)
        answer = self._ticks.answer(readings, now, seen if self.mode is Mode.CATCHING else None)
        self.counts.late += len(readings) - 1
        if late and not self._ticks.stamps.fault:
            self.stop(f"the robot's {late}")
        if blind := self._sight.silent(now):
            self.stop(blind)
        if self._ticks.frozen:
            self.stop(_FROZEN)
        if answer is not None and self.mode is not Mode.STOPPED:
            self._answer(*answer)
            self.age = monotonic() - begun
            self._ticks.catcher.think()
        self._ask()  # after the command: what others say may take its time
        if answer is not None and self.mode is not Mode.STOPPED:
            self._advance()

    def _answer(self, command: Command, stamp: float) -> None:
        """Pass a command on; give up a robot that takes none."""
        try:
            slow = self.mode in (Mode.MOVING, Mode.PLACING, Mode.MEASURING)
            fastest = _TO_READY if slow else np.inf
            q = self._ticks.catcher.estimated[0]
            self._link.write(command, stamp, q, fastest=fastest)
        except Exception as error:  # a driver's own
            self._cut(f"the robot takes no command: {error}")

    def _ask(self) -> None:
        """Stop where the robot says so, but for 50 ms after a release: of why it stopped before."""
        try:
            robot = self._robot
            trouble = robot.conflict() or robot.waits() or robot.trouble()
        except Exception as error:  # a driver's own
            trouble = str(error)
        if trouble and self._ticks.stamps.t > 0.05:
            self.stop(f"the robot says: {trouble}")

    def _look_at_ball(self, due: float) -> None:
        """Take in new positions of the ball; stop where none of them can be used."""
        try:
            self._positions.take(self._robot.points(), due)
        except Exception as error:  # a driver's own
            self.stop(str(error))
        if self._positions.fault:
            self.stop(self._positions.fault)
        slow = self._ticks.repeating > 3.5  # of the last hundred, about
        self.note("ball", self._positions.note)
        self.note("absent", self._positions.absent)
        self.note("readings", _SLOW if slow else "")

    def note(self, kind: str, said: str) -> None:
        """Say of a kind of oddity what is so now: nothing where it is over."""
        if said:
            self.notes[kind] = said
        else:
            self.notes.pop(kind, None)

    def _images(self, now: float) -> FrameSet | None:
        """Return the newest images since the last tick; stop where their source fails."""
        try:
            return self._sight.newest(now)
        except Exception as error:  # a source's own
            self.stop(f"the cameras cannot be read: {error}")
            return None

    def _advance(self) -> None:
        """Go on to what comes next."""
        catcher, stamps, now = self._ticks.catcher, self._ticks.stamps, self._ticks.t
        if self.mode is Mode.STOPPED:  # latched: only a person goes on
            return
        if stamps.fault and self.mode is not Mode.STOPPING:
            self.stop(f"the robot's stamps jumped: {stamps.fault}")
        if self.mode is Mode.STOPPING:
            rests = catcher.phase is Phase.STOPPED and self._ticks.rests
            if rests or stamps.t > self._until:
                self._halt()
        elif catcher.phase is Phase.STOPPED:
            self._stopped(catcher)
        elif self._link.braked:
            self._cut("the brakes were engaged: a joint was not read")
        elif self.mode is Mode.MOVING:
            self._moving(now)
        elif self.mode is Mode.MEASURING:
            self._measuring(now)
        elif self.mode is Mode.CATCHING:
            self._catching(now)
        elif self._placing is not None:
            self._put_down(self._placing, now)

    def _moving(self, now: float) -> None:
        """Plan the way once the arm's place is known; watch once it is at its end."""
        catcher, ready = self._ticks.catcher, self._arm.q_ready
        if self._races("to the ready pose"):
            return
        if self._until == np.inf and self._ticks.told_to_rest:  # with jerk limits after some ticks
            way = slow_motion(self._arm, catcher.result.command[0].copy(), ready, self._share)
            catcher.move(way)
            self._ticks.recorded = False
            self._until = now + len(way) * TICK
        elif now > self._until:
            near = (gap := np.max(np.abs(catcher.estimated[0] - ready))) < _NEAR
            if near and self._ticks.rests and self._measures is not None:
                way = self._measures(self._arm, catcher.result.command[0].copy())
                catcher.move(way)
                self._until, self._from = now + len(way) * TICK, self._ticks.stamps.stamp
                self.mode, self._measures = Mode.MEASURING, None
            elif near and self._ticks.rests:
                self._ticks.fresh()
                self._ticks.record()
                self.mode = Mode.CATCHING
            elif now > self._until + 1.0:
                self.stop(f"the ready pose was not reached: {gap:.2f} rad are left")

    def _measuring(self, now: float) -> None:
        """Let the arm swing to the end of the motion, then go to the ready pose."""
        if self._races("while it was measured"):
            return
        if now > self._until and self._ticks.rests:
            self.measured = (self._from, self._ticks.stamps.stamp)
            self.mode, self._until = Mode.MOVING, np.inf
        elif now > self._until + 1.0:
            self.stop("the arm does not come to rest after it was measured")

    def _races(self, where: str) -> bool:
        """Stop an arm that is faster than it was told to be on its way; say whether it is."""
        races = bool(np.max(np.abs(self._ticks.catcher.estimated[1])) > _TOO_FAST)
        if races:
            self.stop(f"the arm is faster than it was told to be on its way {where}")
        return races

    def _put_down(self, placing: PutDown, now: float) -> None:
        """Put a part down, a motion after the other; then go to the ready pose."""
        ticks, catcher = self._ticks, self._ticks.catcher
        if self._races("to where parts are put down"):
            return
        if self._until == np.inf:
            if ticks.told_to_rest:
                self._until = now + placing.go(catcher, self._leg, self._share)
                ticks.recorded = False
        elif now > self._until and ticks.rests and ticks.gap < _NEAR:
            self._next_leg(now)
        elif now > self._until + 1.0:
            self.stop("the arm does not come to where parts are put down, and to rest")

    def _next_leg(self, now: float) -> None:
        """Go on to the next motion; what was not taken is not put down."""
        leg, self._until = self._leg, np.inf
        if leg is Leg.BACK and not self._ticks.holds(now):
            self.counts.empty += 1
            self._empty += 1
            if self._empty >= _EMPTY:
                self.stop(f"{_EMPTY} parts in a row were not taken: does the tool answer?")
                return
            self._leg = Leg.LET_GO
        elif leg is Leg.UP or (leg is Leg.LET_GO and self._empty):
            self.mode = Mode.MOVING
        else:
            self._empty = 0 if leg is Leg.BACK else self._empty
            self._leg = Leg(leg.value + 1)
        if self._leg is Leg.LET_GO and leg is not Leg.LET_GO:
            self._ticks.catcher.let_go()

    def _catching(self, now: float) -> None:
        """See whether a throw is over."""
        catcher = self._ticks.catcher
        result, phase = catcher.result.scalars[0], catcher.phase
        if phase is Phase.BRAKE:
            t_end = catcher.state.scalars[0]["t_brake"] + catcher.braking
            if now > t_end + self._rules.held:
                self._over()
            return
        if not result["tracked"]:
            return
        before = self._fastest if self._placing is None else 0.0
        self._fastest = max(before, float(np.linalg.norm(catcher.result.ball[1])))
        # What is carried or lies about is no throw yet, however long it is seen.
        lasts = now - catcher.flight_begun > self._rules.longest
        lasts = lasts and (self._placing is not None or not result["led"])
        refused = phase is Phase.REFUSED and catcher.done
        gone = refused or lasts or now - result["t_seen"] > _GONE
        if gone and phase is Phase.FOLLOW:
            self._missed = True
            self._ticks.stop()
        elif gone:
            waited = phase is Phase.WATCH and self._placing is not None
            self._over(refused=waited or catcher.refused)

    def _stopped(self, catcher: Catcher) -> None:
        """Go back after a stop for the ball's sake; else stay, once at rest."""
        found = catcher.stopped_by
        for_the_ball = found is not None and (self._missed or found.reason is Reason.LOST)
        if found is not None and for_the_ball and not self._link.braked:
            rests = self._ticks.rests  # never where something keeps it from where it was to stop
            if not rests and self._ticks.stamps.t < found.t + _STOPS:
                return
            if (gap := self._ticks.gap) < 0.1 and rests:  # [rad]
                self.counts.stopped += not self._missed
                self._over()
                return
            self.why = f"the arm was pushed {gap:.2f} rad away from where it was to stop"
        elif found is None:
            self.why = "unknown"
        elif found.reason is Reason.SILENT and self._ticks.repeats:
            self.why = _FROZEN  # so they were taken for none
        elif found.reason is Reason.OVERRUN and self._ticks.waited > 0.0:
            self.why = f"this loop was late: readings of {1e3 * self._ticks.waited:.0f} ms waited"
        else:
            joint = "" if found.joint is None else f" {found.joint}"
            hint = f"; {found.hint}" if found.hint else ""
            self.why = f"{found.reason.value}{joint}{hint}"
        self.mode, self._until = Mode.STOPPING, self._ticks.stamps.t + _STOPS

    def _over(self, *, refused: bool = False) -> None:
        """Count a throw, or a part, and put a part down, then go to the ready pose."""
        self._note_unused()
        took = self._placing is not None and self._ticks.closed
        if took or self._fastest > self._rules.slowest:
            self.counts.throws += 1
            self.counts.refused += refused
        took = took and self._ticks.catcher.phase is Phase.BRAKE
        if self._ticks.catcher.phase is Phase.BRAKE:  # a braked one still holds the ball
            self._ticks.learn()
            self.note("clock", self.clock.warning)
        else:
            self._ticks.fresh()
        self._fastest, self._missed = 0.0, False
        self.mode = Mode.PLACING if took else Mode.MOVING
        self._leg, self._until = Leg.BACK, np.inf

    def _note_unused(self) -> None:
        """Note why many sightings of this ball were not used; those of a good one all are."""
        counts = self._ticks.catcher.counts
        unused = sum(counts.unused.values())
        self.notes.pop("unused", None)
        if unused > max(_UNUSED * (counts.used + unused), 5.0):
            self.notes["unused"] = (
                f"of the last ball's {counts.used + unused} sightings"
                f" {unused} were not used: {counts.words}"
            )

    def _halt(self) -> None:
        """Engage the brakes and stay; a ball in flight then is one that was not caught."""
        self.mode = Mode.STOPPED
        self.why += self._engaged()
        self._stay()
        self.counts.stops.append(self.why)
        if self._fastest > self._rules.slowest:
            self.counts.throws += 1
            self.counts.stopped += 1
        self._fastest, self._missed = 0.0, False

    def _cut(self, why: str) -> None:
        """Give up a robot that cannot be read: brakes, and its own watchdog, stop it."""
        if self.mode not in (Mode.STOPPED, Mode.WAITING):
            self.why = self.why if self.mode is Mode.STOPPING else why
            self._halt()
