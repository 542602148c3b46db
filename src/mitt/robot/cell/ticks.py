"""A catcher's ticks from a robot's readings: their time, what was seen beside them, the record.

Readings that come together make one tick, that of the newest: **a tick is made only where its
command is sent**. So what a catcher commanded is what the arm was told, until the next tick, and
whatever compares readings with commands may rest on it. Where this loop was late the arm obeyed the
last command all the while, and the catcher goes on by the time that has passed, as the stamps say.
Readings that never came are counted. What arm and eyes say of a catch is kept as it comes, for the
offset of the eyes' clock.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher
from mitt.core.control.encoders import SIGMAS
from mitt.core.errors import InputError
from mitt.core.eyes.clock_offset import ClockOffset, LearnedClock
from mitt.core.signals import TICK, ArmState, Array, Command, Frame, Senses, Sighting
from mitt.robot.cell.frames import FrameSet, Sight
from mitt.robot.cell.readings import STRAY, Counts, Positions, Stamps
from mitt.robot.cell.recorder import Recorder

#: How far a joint has to have moved before a row of angles that repeats is no reading [rad], beside
#: a step of its encoder.
_MOVED = 5e-5
#: Time after which the speeds that a fresh catcher estimates do not rest on its first reading [s]:
#: one in which an encoder has just counted on says that the arm moves.
_SETTLES = 0.03
#: Age to which a sighting says where a part is [s], and how far from the tool one that it holds may
#: be seen [m].
_RECENT = 0.3
_AT_TOOL = 0.06


@final
class Ticks:
    """Lets catchers make ticks, one catcher a throw; their time begins with each.

    Attributes:
        catcher: The one of this throw.
        stamps: The robot's stamps as a time that only goes on.
        recorded: Whether the ticks are recorded: those of a catch are.
        repeating: How many of the last hundred readings, about, repeat the one before, of those
            that can tell: of an arm that moves.
        repeats: Whether all of those do that came together at last.
        waited: How much older than it the oldest was that came with it [s].
        frozen: Whether they have for so long that no reading comes any more.
        clock: The eyes' clock as the catches so far say it; it corrects their stamps.
    """

    def __init__(
        self,
        first: Catcher,
        again: Callable[[Catcher], Catcher],
        sight: Sight,
        positions: Positions,
        counts: Counts,
        recorder: Recorder | None,
        arm: Arm,
        *,
        period: float = TICK,
    ) -> None:
        """Take a first catcher, what returns a fresh one for another throw, and what they need.

        Its readings come a ``period`` apart [s].
        """
        self._period, self._arm = period, arm
        self._seen: Sighting | None = None
        self._taken: Array | None = None
        self.catcher, self.stamps, self.recorded = first, Stamps(), False
        self._again, self._sight, self._counts, self._recorder = again, sight, counts, recorder
        self._positions, self._begun, self._last = positions, 0.0, 0.0
        self.clock, self._offset = LearnedClock(), 0.0
        self.repeating, self.frozen = 0.0, False
        self._run, self._travel, self.repeats, self.waited = 0, 0.0, False, 0.0
        self._read, self._moved, self._least = np.zeros(0), np.zeros(0), _MOVED + arm.encoder_step

    @property
    def t(self) -> float:
        """Time of this catcher [s]."""
        return self.stamps.t - self._begun

    @property
    def gap(self) -> float:
        """How far the arm is from where it is commanded to be, at the worst joint [rad]."""
        return float(np.max(np.abs(self.catcher.result.command[0] - self.catcher.estimated[0])))

    @property
    def told_to_rest(self) -> bool:
        """Whether the last command leaves every joint at rest, and no motion is left."""
        return self.catcher.halted

    @property
    def rests(self) -> bool:
        """Whether the arm is commanded to rest, and does: for a while, where the command is."""
        return self.catcher.rests

    @property
    def closed(self) -> bool:
        """Whether the hand was told to close."""
        return bool(self.catcher.state.fingers[0]["t_begun"] < np.inf)

    def holds(self, now: float) -> bool:
        """Say whether the tool holds what it closed on: it is not seen elsewhere at ``now`` [s]."""
        seen = self._seen
        if seen is None or seen.t < now - _RECENT:
            return True
        tool = self._arm.position(self.catcher.estimated[0])
        return bool(np.linalg.norm(seen.r_o - tool) < _AT_TOOL)

    def restart(self) -> None:
        """Forget the stamps so far, as after a stop, and take a fresh catcher."""
        self.stamps, self._last, self._read, self.frozen = Stamps(), 0.0, np.zeros(0), False
        self._positions.restart()
        self.fresh(goes_on=False)

    def fresh(self, *, goes_on: bool = True) -> None:
        """Take a fresh catcher, whose time begins now.

        Where it ``goes_on`` under command, torques that have rates keep them from tick to tick.
        """
        before, self._taken = self.catcher.result.command[3], None
        self.catcher, self.recorded = self._again(self.catcher), False
        if goes_on and self._arm.limits.torque_rate is not None:
            self._taken = before.copy()
            self.catcher.take_over(self._taken)
        self._begun, self._seen = self.stamps.t, None
        self._sight.fresh()

    def answer(
        self, readings: Sequence[ArmState], arrived: float, shown: FrameSet | None
    ) -> tuple[Command, float] | None:
        """Make a tick from the newest of readings that came together; its command is to be sent.

        What is returned is that command and the stamp of the reading that it answers [s]; None
        where no reading was newer than those before.

        Raises:
            InputError: A stamp is no number, or a first reading has joints without a number.
        """
        newest, tells, self.waited = None, None, readings[-1].t - readings[0].t
        for reading in readings:
            if self._follows(reading, arrived):
                newest, tells = reading, tells if self._repeats(reading) else reading
        if newest is None:
            return None
        self.repeats = tells is None
        return self._answered(newest, tells, shown), newest.t

    def _follows(self, reading: ArmState, arrived: float) -> bool:
        """Let time go on to a reading and count those before it that are lost; say if it is new."""
        t = self.stamps.take(reading.t, arrived)
        if t is None:
            return False
        if self.catcher.begun:  # a fresh one begins with this reading
            self._counts.lost += max(round((t - self._last) / self._period) - 1, 0)
        self._last = t
        return True

    def _answered(
        self, reading: ArmState, tells: ArmState | None, shown: FrameSet | None
    ) -> Command:
        """Return the command that answers a reading.

        One that repeats says nothing; of readings that came together one before it may.

        Args:
            reading: The newest.
            tells: The newest that does not repeat; None where all do.
            shown: Images, if there are new ones.
        """
        t, shift = self.t, self.stamps.at(0.0) - self._begun
        seen = tuple(
            replace(p, t=p.t + shift + self._offset) for p in self._positions.upto(reading.t)
        )
        self._seen = seen[-1] if seen else self._seen
        frames: tuple[Frame, ...] = ()
        if shown is not None and -STRAY < shown.t + shift - t < STRAY:
            frames = self._sight.show(self.catcher, shown, shown.t + shift + self._offset)
        elif shown is not None:
            self._counts.stray += 1
        if not self.catcher.begun and not np.all(np.isfinite(reading.q)):
            raise InputError("the first reading", "the angle of each joint", "NaN")
        self._counts.ticks += 1
        if tells is None:
            nothing = np.full(len(reading.q), np.nan)
            arm = ArmState(t=t, q=nothing, dq=nothing)
        else:
            read = t if tells is reading else tells.t + shift
            arm = ArmState(t=read, q=tells.q, dq=tells.dq)
        watched = seen if self.recorded else ()  # on its way to the ready pose it follows nothing
        return self._step(Senses(t=t, arm=arm, frames=frames, points=watched))

    def _repeats(self, reading: ArmState) -> bool:
        """Say whether a reading is the one before under a new stamp: all joints, to the last digit.

        An arm at rest repeats itself. One that moves does not, once a joint has moved by more than
        its encoder tells apart; it moves as it is surely estimated to, by the commands that were
        sent: where this loop was late that is an estimate of before.
        """
        new = not self.catcher.begun or self.t < _SETTLES
        sigma = np.sqrt(self.catcher.state.monitor.joints["variance_dq"])
        speed = np.maximum(np.abs(self.catcher.estimated[1]) - SIGMAS * sigma, 0.0)
        if new or not np.array_equal(reading.q, self._read):
            if bool(
                np.any(self._period * speed > self._least)
            ):  # it would have been seen to repeat
                self.repeating *= 0.99
            self._read, self._moved = np.array(reading.q), np.zeros(len(reading.q))
            self._run, self._travel, self.frozen = 0, 0.0, False
            return False
        self._moved = 0.9 * self._moved + self._period * speed  # at rest estimates are not zero
        repeats = bool(np.any(self._moved > self._least))
        if repeats:
            self._counts.repeated += 1
            self.repeating = 0.99 * self.repeating + 1.0
        self._run += repeats
        self._travel += self._period * float(np.max(speed))
        # Hardware of 125 Hz repeats 7, an encoder of 1 degree more on a slow way.
        self.frozen = self._run >= 9 and self._travel > 0.005
        return repeats

    def _step(self, senses: Senses) -> Command:
        """Let the catcher make a tick; recorded unless it is on its way to the ready pose."""
        command = self.catcher.step(senses)
        if self._recorder is not None and self.recorded:
            self._recorder.tick(senses, command, self.catcher.result)
        return command

    def stop(self) -> None:
        """Stop with the next tick."""
        self.catcher.stop()
        self._note("stop")

    def record(self) -> None:
        """Record from now on: a catch begins, with the clock as it is known."""
        self.recorded, self._offset = True, self.clock.offset
        self._note("again")
        if self._recorder is not None and self._taken is not None:
            self._recorder.torques(self._taken)
        if self._recorder is not None and self._offset != 0.0:
            self._recorder.clock(self._offset)

    def learn(self) -> ClockOffset:
        """Learn from the catch that is over what it says of the clocks, and return that."""
        found = self.catcher.clock_offset
        self.clock.take(found, self._offset)
        return found

    def _note(self, call: str) -> None:
        """Record what the catcher is told besides its senses."""
        if self._recorder is not None and self.recorded:
            self._recorder.call(call)
