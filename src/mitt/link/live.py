"""The live loop: a robot, a catcher, and a person who says when the arm may move.

Readings pace the loop: each makes a tick of the catcher, and one command answers the newest. A
reading that never came is a tick without encoders, which the catcher bridges. Where no reading
comes at all nothing is written, so that the robot's own watchdog brakes, and the brakes are
engaged.
"""

from collections.abc import Callable, Sequence
from typing import final

import numpy as np

from mitt.catcher.catcher import Catcher, Phase
from mitt.control.health import Reason
from mitt.errors import InputError
from mitt.link.clock import monotonic
from mitt.link.frames import FrameSet
from mitt.link.modes import Counts, Mode
from mitt.link.moves import slow_motion
from mitt.link.readings import wrong_with
from mitt.link.recorder import Recorder
from mitt.link.robot import RobotLink
from mitt.link.sight import FrameSource, Sight
from mitt.link.stamps import Stamps
from mitt.robot.arm import Arm
from mitt.signals import TICK, ArmState, Command, Frame, Senses, Sighting

#: Readings lost in a row that are bridged; more are an overrun.
_BRIDGED = 18
#: Time without a position after which a ball is gone, longest throw, and how long a caught ball is
#: held before the arm goes back [s].
_GONE, _LONGEST, _HELD = 0.4, 3.0, 0.6
#: Slowest ball that is a throw [m/s].
_THROWN = 1.0
#: How long it is looked once more for readings that did not come in time [s].
_LOOK = 0.003
#: How far from the ready pose the arm may rest [rad], and how long it may take beyond its time [s].
_NEAR, _PATIENCE = 0.03, 1.0
#: Speeds below which an arm rests, commanded and estimated [rad/s].
_REST, _STILL = 1e-3, 0.05
#: Time within which a stop has to end [s], and time after a release in which the robot may still
#: say why it had stopped before [s].
_STOPS, _GRACE = 2.0, 0.05


@final
class LiveLoop:
    """Catches with a robot, throw after throw.

    Attributes:
        mode: What it is about.
        why: Why it stops or has stopped.
        counts: What happened so far.
        age: Time from the newest reading to its command here [s].
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
        recorder: Recorder | None = None,
    ) -> None:
        """Take the robot and the catcher.

        Args:
            link: The robot.
            arm: The arm as it is driven.
            first: A catcher.
            again: Returns a fresh one for another throw.
            ready_speed: Share of the speeds in motions to the ready pose.
            silence: Time without a reading after which the robot is lost [s].
            frames: Where images come from; None where the ball is seen as points.
            recorder: Keeps each tick of a catch.
        """
        self._link, self._robot, self._arm, self._again = link, link.robot, arm, again
        self._share, self._silence, self._recorder = ready_speed, silence, recorder
        self._sight = Sight(frames)
        self._catcher, self._stamps = first, Stamps()
        self._nothing = np.full(arm.n, np.nan)
        self.mode, self.why = Mode.WAITING, ""
        self.counts = Counts(0, 0, 0, 0, 0, 0, 0, [])
        self.age = 0.0
        self._begun, self._last, self._until = 0.0, 0.0, np.inf
        self._fastest, self._missed, self._recorded = 0.0, False, False

    @property
    def idle(self) -> bool:
        """Whether the arm waits in its ready pose for a ball that it has not decided on."""
        return self.mode is Mode.CATCHING and self._catcher.phase is Phase.WATCH

    def healthy(self) -> str:
        """Read without moving; return what is wrong with the robot, nothing if all is well.

        Raises:
            InputError: What it says does not fit the arm: names, units, two publishers.
        """
        readings = self._robot.read(self._silence)
        self._robot.points()
        if not readings:
            return "no joint states"
        wrong = wrong_with(self._arm, readings[-1])
        return wrong or self._robot.trouble() or self._sight.open()

    def begin(self) -> None:
        """Move to the ready pose from here: a person has said that the arm may move."""
        self._robot.read(0.0)
        self._stamps, self.why, self._last = Stamps(), "", 0.0
        self._fresh()
        self.mode, self._until = Mode.MOVING, np.inf
        self._link.release()

    def stop(self, why: str) -> None:
        """Stop within all limits, for a reason; it stays so until :meth:`begin`."""
        if self.mode in (Mode.MOVING, Mode.CATCHING):
            self.why = why
            self._stop_catcher()
            self.mode, self._until = Mode.STOPPING, self._stamps.t + _STOPS

    def finish(self) -> None:
        """Engage the brakes of the arm at rest: all is done."""
        self._link.brake()
        self.mode = Mode.STOPPED

    def cycle(self) -> None:
        """Wait for readings and answer them; what goes wrong stops the arm and is not raised."""
        try:
            # The second look is for a stall of ours, after which nothing had time to come in.
            readings = self._robot.read(self._silence) or self._robot.read(_LOOK)
        except Exception as error:  # a driver's own
            self._cut(f"the robot cannot be read: {error}")
            return
        try:
            self._take(readings)
        except Exception as error:  # ours, or what a driver gave
            self._cut(str(error))

    def _take(self, readings: Sequence[ArmState]) -> None:
        """Answer the readings of a cycle."""
        now = monotonic()
        if not readings:
            self._cut(f"no joint states for {1e3 * self._silence:.0f} ms")
            return
        points = self._others()
        answer = None
        for reading, seen in zip(readings, self._sight.beside(len(readings)), strict=True):
            t = self._stamps.take(reading.t, now)
            if t is not None:
                self._fill(t)
                answer = self._tick(t, reading, points, seen), reading.t
                points = ()
        self.counts.late += len(readings) - 1
        if answer is not None and self.mode is not Mode.STOPPED:
            self._answer(*answer)
            self.age = monotonic() - now
            self._catcher.think()
            self._advance(self._stamps.t)

    def _answer(self, command: Command, stamp: float) -> None:
        """Pass a command on; give up a robot that takes none."""
        try:
            self._link.write(command, stamp)
        except Exception as error:  # a driver's own
            self._cut(f"the robot takes no command: {error}")

    def _others(self) -> Sequence[Sighting]:
        """Return new positions of the ball; stop where the robot or the source says so."""
        try:
            trouble = self._robot.trouble()
            if trouble and self._stamps.t > _GRACE:
                self.stop(f"the robot says: {trouble}")
            return self._robot.points()
        except Exception as error:  # a driver's own
            self.stop(str(error))
            return ()

    def _fill(self, t: float) -> None:
        """Make ticks without encoders for readings that never came."""
        missing = round((t - self._last) / TICK) - 1
        # A fresh catcher has no reading yet from which it could go on.
        if self._catcher.tick is not None and 0 < missing <= _BRIDGED:
            self.counts.lost += missing
            nothing = self._nothing
            for k in range(missing):
                at = self._last + (k + 1) * TICK - self._begun
                self._step(Senses(t=at, arm=ArmState(t=at, q=nothing, dq=nothing)))
        self._last = t

    def _tick(
        self, t: float, reading: ArmState, points: Sequence[Sighting], shown: FrameSet | None
    ) -> Command:
        """Make a tick of the catcher."""
        shift = self._stamps.at(0.0) - self._begun
        seen = tuple(
            Sighting(t=at, found=p.found, r_o=p.r_o, covariance=p.covariance)
            for p in points
            if -_GONE < (at := p.t + shift) - (t - self._begun) < _GONE
        )
        self.counts.stray += len(points) - len(seen)
        frames: tuple[Frame, ...] = ()
        if shown is not None and self.mode is Mode.CATCHING:
            frames = self._sight.show(self._catcher, shown, shown.t + shift)
        if self._catcher.tick is None and not np.all(np.isfinite(reading.q)):
            raise InputError("the first reading", "the angle of each joint", "NaN")
        t -= self._begun
        arm = ArmState(t=t, q=reading.q, dq=reading.dq)
        self.counts.ticks += 1
        return self._step(Senses(t=t, arm=arm, frames=frames, points=seen))

    def _step(self, senses: Senses) -> Command:
        """Let the catcher make a tick; recorded unless it is on its way to the ready pose."""
        command = self._catcher.step(senses)
        if self._recorder is not None and self._recorded:
            self._recorder.tick(senses, command, self._catcher.result)
        return command

    def _stop_catcher(self) -> None:
        """Stop with the next tick."""
        self._catcher.stop()
        self._note("stop")

    def _note(self, call: str) -> None:
        """Record what the catcher is told besides its senses."""
        if self._recorder is not None and self._recorded:
            self._recorder.call(call)

    def _advance(self, t: float) -> None:
        """Go on to what comes next."""
        catcher, now = self._catcher, t - self._begun
        if self.mode is Mode.STOPPED:  # latched: only a person goes on
            return
        if self._stamps.fault and self.mode is not Mode.STOPPING:
            self.stop(f"the robot's stamps jumped: {self._stamps.fault}")
        if self.mode is Mode.STOPPING:
            rests = catcher.phase is Phase.STOPPED and self._rests()
            if rests or t > self._until:
                self._halt()
        elif catcher.phase is Phase.STOPPED:
            self._stopped(catcher)
        elif self.mode is Mode.MOVING:
            self._moving(now)
        elif self.mode is Mode.CATCHING:
            self._catching(now)

    def _moving(self, now: float) -> None:
        """Plan the way once the arm's place is known; watch once it is at its end."""
        catcher, ready = self._catcher, self._arm.q_ready
        if self._until == np.inf:
            way = slow_motion(self._arm, catcher.result.command[0].copy(), ready, self._share)
            catcher.move(way)
            self._recorded = False
            self._until = now + len(way) * TICK
        elif now > self._until:
            gap = float(np.max(np.abs(catcher.estimated[0] - ready)))
            if gap < _NEAR and self._rests():
                self._fresh()
                self.mode, self._recorded = Mode.CATCHING, True
                self._note("again")
            elif now > self._until + _PATIENCE:
                self.stop(f"the ready pose was not reached: {gap:.2f} rad are left")

    def _catching(self, now: float) -> None:
        """See whether a throw is over."""
        result, phase = self._catcher.result.scalars[0], self._catcher.phase
        if phase is Phase.BRAKE:
            t_end = self._catcher.state.scalars[0]["t_brake"] + self._catcher.braking
            if now > t_end + _HELD:
                self._over()
            return
        if not result["tracked"]:
            return
        self._fastest = max(self._fastest, float(np.linalg.norm(self._catcher.result.ball[1])))
        gone = now - result["t_seen"] > _GONE or now - result["t_first"] > _LONGEST
        if gone and phase is Phase.FOLLOW:
            self._missed = True
            self._stop_catcher()
        elif gone:
            self._over(refused=phase is Phase.REFUSED)

    def _stopped(self, catcher: Catcher) -> None:
        """Go back after a stop for the ball's sake; else stay, once at rest."""
        found = catcher.stopped_by
        for_the_ball = found is not None and (self._missed or found.reason is Reason.LOST)
        if for_the_ball and not self._link.braked:
            if self._rests():
                self.counts.stopped += not self._missed
                self._over()
            return
        why = "unknown" if found is None else found.reason.value
        joint = "" if found is None or found.joint is None else f" {found.joint}"
        self.why = f"{why}{joint}"
        self.mode, self._until = Mode.STOPPING, self._stamps.t + _STOPS

    def _over(self, *, refused: bool = False) -> None:
        """Count a throw and go to the ready pose for the next."""
        if self._fastest > _THROWN:
            self.counts.throws += 1
            self.counts.refused += refused
        if self._catcher.phase is not Phase.BRAKE:  # a braked one still holds the ball
            self._fresh()
        self._fastest, self._missed = 0.0, False
        self.mode, self._until = Mode.MOVING, np.inf

    def _fresh(self) -> None:
        """Take a fresh catcher, whose time begins now."""
        self._catcher, self._recorded = self._again(self._catcher), False
        self._begun = self._stamps.t
        self._sight.fresh()

    def _halt(self) -> None:
        """Engage the brakes and stay; a ball in flight then is one that was not caught."""
        self.mode = Mode.STOPPED
        try:
            self._link.brake()
        except Exception as error:  # a driver's own: its watchdog is left
            self.why += f"; the brakes do not answer: {error}"
        self.counts.stops.append(self.why)
        if self._fastest > _THROWN:
            self.counts.throws += 1
            self.counts.stopped += 1
        self._fastest, self._missed = 0.0, False

    def _cut(self, why: str) -> None:
        """Give up a robot that cannot be read: brakes, and its own watchdog, stop it."""
        if self.mode not in (Mode.STOPPED, Mode.WAITING):
            self.why = self.why if self.mode is Mode.STOPPING else why
            self._halt()

    def _rests(self) -> bool:
        """Say whether the arm is commanded to rest, and does."""
        told, estimated = self._catcher.result.command[1], self._catcher.estimated[1]
        return bool(np.all(np.abs(told) < _REST) and np.all(np.abs(estimated) < _STILL))
