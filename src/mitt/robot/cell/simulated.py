"""A simulated cell: what throws balls or brings parts, a robot with its own controller, what sees.

It goes on by a millisecond a tick, whether commands come or not. The next ball or part comes when
the arm has been at rest in its ready pose for a while and is under command; it is taken away once
it is clear what became of it.
"""

import json
from collections import deque
from collections.abc import Callable, Sequence
from math import log, pi
from typing import Protocol, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.control.setpoints import ROWS
from mitt.core.control.stop import plan_brake
from mitt.core.eyes.lens import bender
from mitt.core.signals import TICK, Array, Command, Image
from mitt.io.cell import Cell, RobotPart
from mitt.lab.trials.runner import cameras_of
from mitt.lab.trials.score import continuous_shares, drive_loads, overheated, ticks_beyond
from mitt.lab.world.drives import JointControl
from mitt.lab.world.flights import BallPath
from mitt.lab.world.scene import Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.targets import Ride
from mitt.lab.world.throws import Throw
from mitt.lab.world.truth import Truth
from mitt.robot.cell.feeds import Feed
from mitt.robot.cell.prepare import PreparedCell
from mitt.robot.cell.robot import ReceivedCommand

#: Bandwidth with which the controller holds and brakes by itself [rad/s]: that of the catcher.
_BANDWIDTH = 80.0
#: Speed at which a joint counts as at rest [rad/s].
_REST = 0.02
#: Youngest age that is told apart [s], and ratio from one class to the next.
_LEAST = 1e-6
_RATIO = 1.01
#: Number of classes: up to 12 s.
_CLASSES = 1640
#: Relative error of a rate by stamps that are times of the day: they are rounded to 2.4e-7 s.
_STAMPS = 1e-3
#: Age from which a command's stamp is none of this robot's: it acts as if it answered now [s].
_FOREIGN = 1.0
#: Readings whose times are kept to tell the age of the command that answers them.
_KEPT = 256


@final
class Controller:
    """What stands between commands and drives.

    It holds the arm on its brakes until it is released. From then on it expects commands; where
    none has come for the watchdog's time it brakes as a catcher does, engages the brakes and
    stays so: a protective stop. A command acts once a reading of the time that it answers is as old
    as the link and the drives of the cell make it.

    Attributes:
        trouble: Why it takes no commands; nothing where it does.
        released: Whether it expects commands.
        stop_time: Time from the last protective stop to rest [s], and what its brake was planned
            to take; None until there was one.
    """

    def __init__(self, arm: Arm, robot: RobotPart, *, late: float = 0.0) -> None:
        """Take the arm, and what the cell's file says of the robot.

        A command begins to act no sooner than ``late`` after the reading that it answers [s].
        """
        self._arm, self._watchdog, self._row = arm, robot.watchdog, ROWS[robot.takes]
        self._late, self._coming = late, deque[tuple[float, ReceivedCommand]]()
        w = 2.0 * pi * robot.servo
        self._control = (
            None if robot.takes == "torque" else JointControl(arm, robot.takes, bandwidth=w)
        )
        self.trouble, self.released = "", False
        self.stop_time: tuple[float, float] | None = None
        self._take_over(0.0, arm.q_ready, np.zeros(arm.n))
        self._told: ReceivedCommand | None = None
        self._heard, self._acted, self._since, self._hand = 0.0, 0.0, np.inf, 0.0

    @property
    def commanded(self) -> bool:
        """Whether a command acts."""
        return self._told is not None

    @property
    def told(self) -> Array:
        """Rows q, dq, ddq, tau of the command that acts, shape (4, n); NaN where it says none."""
        rows = np.full((4, self._arm.n), np.nan)
        if self._told is not None and self._control is None:
            rows[:] = self._told.joints
        elif self._told is not None:
            rows[self._row] = self._told.joints[self._row]
        return rows

    def release(self, t: float, q: Array, dq: Array) -> None:
        """Release the brakes and forget a stop: hold the arm until a command comes."""
        self.trouble, self.released, self._told = "", True, None
        self._heard = self._acted = t
        self._take_over(t, q, dq)

    def engage(self, t: float, q: Array, dq: Array) -> None:
        """Engage the brakes as a command says."""
        if self.released:
            self.released, self._told = False, None
            self._take_over(t, q, dq)

    def command(self, t: float, q: Array, dq: Array, new: ReceivedCommand | None) -> Command:
        """Return what acts in the tick from ``t`` [s] on; ``new`` is a command that has come."""
        if new is not None and self.released:
            answered = new.answers if abs(t - new.answers) < _FOREIGN else t
            self._coming.append((answered + self._late, new))
            self._heard = t
        elif self.released and t - self._heard > self._watchdog:
            self.trouble = f"protective stop: no command for {1e3 * self._watchdog:.0f} ms"
            self.released, self._told, self._since = False, None, t
            self._take_over(t, q, dq)
        while self._coming and self._coming[0][0] < t + 0.1 * TICK:
            self._obey(t, self._coming.popleft()[1])
        if np.isfinite(self._since) and np.all(np.abs(dq) < _REST):
            self.stop_time = (t - self._since, self._way.duration)
            self._since = np.inf
        told = self._own(t, q, dq) if self._told is None else self._followed(q, dq)
        still = not self.released and self._held is not None
        return Command(t=t, joints=told, hand=self._hand, brakes=still)

    def _obey(self, t: float, new: ReceivedCommand) -> None:
        """Let a command act from now on."""
        if self._control is not None:
            self._control.take(new.joints[self._row], passed=max(t - self._acted, TICK))
        self._told, self._acted, self._hand = self._cut(new), t, new.hand

    def _cut(self, new: ReceivedCommand) -> ReceivedCommand:
        """Return a command without what torques may not change in a tick, as drivers cut it off."""
        rate, last = self._arm.limits.torque_rate, self._told
        if rate is None or last is None or self._control is not None:
            return new
        joints, step = new.joints.copy(), TICK * self._arm.active(rate)
        joints[3] = np.clip(joints[3], last.joints[3] - step, last.joints[3] + step)
        return new._replace(joints=joints)

    def _take_over(self, t: float, q: Array, dq: Array) -> None:
        """Plan the stop from here, to hold wherever it ends."""
        self._held: Array | None = None
        self._coming.clear()
        if self._control is not None:
            self._control.restart()
        self._way = plan_brake(self._arm, t, np.array([q, dq, np.zeros(self._arm.n)]))

    def _own(self, t: float, q: Array, dq: Array) -> Array:
        """Return the controller's own command within the limits: the stop's speeds, then to hold.

        Where the drives lag behind the stop the arm ends elsewhere; it does not move on to there.
        """
        arm, w = self._arm, _BANDWIDTH
        if self._held is None and np.all(np.abs(dq) < _REST):
            self._held = q.copy()
        wanted = self._way.at(t)
        wanted[0] = q if self._held is None else self._held
        ddq = wanted[2] + 2.0 * w * (wanted[1] - dq) + w**2 * (wanted[0] - q)
        tau = arm.limits.saturate(arm.torque(q, dq, ddq), arm.all_joints(dq))
        return np.array([*wanted, arm.active(tau)])

    def _followed(self, q: Array, dq: Array) -> Array:
        """Return the command that came: its torque, or that of the robot's own control."""
        assert self._told is not None
        told, arm, still = self._told.joints, self._arm, np.zeros(self._arm.n)
        if self._control is not None:
            within = [np.clip(q, arm.q_min, arm.q_max), np.clip(dq, -arm.dq_max, arm.dq_max)]
            within[self._row] = told[self._row]
            return np.array([*within, still, self._control.torque(q, dq)])
        return np.where(np.isnan(told), np.array([q, dq, still, still]), told)


@final
class Ages:
    """Counts ages in classes 1 % wide, in memory that does not grow."""

    def __init__(self) -> None:
        """Start without any."""
        self._counts = np.zeros(_CLASSES, dtype=np.int64)
        self._oldest = 0.0

    def add(self, age: float) -> None:
        """Count an age [s]."""
        place = int(log(max(age, _LEAST) / _LEAST) / log(_RATIO))
        self._counts[min(place, _CLASSES - 1)] += 1
        self._oldest = max(self._oldest, age)

    def percentiles_us(self) -> dict[str, float] | None:
        """Return median, p99 and p99.9, each within 1 %, and the largest [us]; None without any.

        A percentile is told as the upper end of its class, at most the largest.
        """
        names, total = ("p50", "p99", "p99_9"), int(self._counts.sum())
        if total == 0:
            return None
        most, below = 1e6 * self._oldest, np.cumsum(self._counts)
        places = np.searchsorted(below, np.array([0.5, 0.99, 0.999]) * total)
        ends = 1e6 * _LEAST * _RATIO ** (places + 1.0)
        return {**dict(zip(names, np.minimum(ends, most).tolist(), strict=True)), "max": most}


class Port(Protocol):
    """Where a simulated cell publishes and hears."""

    def state(self, t: float, q: Array, dq: Array) -> None:
        """Publish a reading of the encoders."""

    def ball(self, t: float, r_o: Array) -> None:
        """Publish a position of the ball."""

    def frames(self, t: float, images: Sequence[Image]) -> None:
        """Publish images that were exposed together."""

    def status(self, t: float, trouble: str) -> None:
        """Publish how the robot is."""

    def result(self, said: str) -> None:
        """Publish how a throw ended, as JSON."""

    def command(self) -> ReceivedCommand | None:
        """Return the newest command since the last call."""

    def brake(self) -> bool | None:
        """Return whether brakes are to be engaged or released; None where nothing was said."""

    def close(self) -> None:
        """Take away what others should not find any more."""


def _link_of(cell: Cell, scene: Scene) -> float:
    """Return how late a command begins to act at the robot of a cell, whole ticks [s].

    The time for which it acts is of the cell's delay; so is what the drives of the scene take, but
    within a joint control, where it makes no command later.
    """
    of, robot = scene.actuation, cell.robot
    drives = of.delay * TICK + (0.0 if of.bandwidth == 0.0 else 0.5 / (pi * of.bandwidth))
    link = robot.delay - robot.ticks * TICK - (drives if robot.takes == "torque" else 0.0)
    return max(round(link / TICK), 0) * TICK


@final
class SimulatedCell:
    """A cell in simulation.

    Attributes:
        done: Whether all balls or parts have come and were judged.
        statuses: How each ended.
        placed: How many parts were put down where they were to.
        forces: Largest contact force of each [N]; None where the ball did not touch the hand.
        violations: Ticks beyond a limit so far, true or commanded, and one for each drive beyond
            its continuous torque in a throw, by the rules of a trial.
        ages: Ages of the commands that acted.
    """

    def __init__(
        self,
        prepared: PreparedCell,
        scene: Scene,
        feed: Feed,
        port: Port,
        *,
        clock: Callable[[], float],
        started: float = 0.0,
    ) -> None:
        """Set the cell up: the arm on its brakes in its ready pose.

        Commands age by the steady ``clock`` [s]; ``started`` is the stamp of the first reading [s].
        """
        self._arm = arm = prepared.arm
        self._feed, self._port, self._clock = feed, port, clock
        self._sees = prepared.cell.source.kind == "images"
        self._bend = [bender(lens) for lens in prepared.lenses]
        cameras = cameras_of(prepared.rig, scene) if self._sees else None
        self._world = World(scene, arm.model, cameras=cameras, limits=arm.limits)
        self._controller = Controller(arm, prepared.cell.robot, late=_link_of(prepared.cell, scene))
        self._every = prepared.cell.robot.ticks
        self._base, self._ticks, self._next, self._flying = started, 0, 0, False
        self._settled, self.done = 0, False
        self.statuses, self.violations, self.ages = list[str](), 0, Ages()
        self.placed = 0
        self.forces = list[float | None]()
        self._sent = np.zeros(_KEPT, [("stamp", float), ("clock", float)])
        self._rows, self._driven, self._trouble = list[Array](), list[bool](), ""
        self._before: Array | None = None
        self._squares, self._summed = np.zeros(len(arm.limits.tau_rms)), 0
        # Where a ball lies that nobody has thrown: behind the cameras.
        self._aside = Throw(r=np.array([-30.0, 0.0, scene.floor + 0.1]), dr=np.zeros(3))
        self._world.reset(self._aside, self._seed)

    @property
    def _seed(self) -> int:
        """Seed of the plant in the present throw, or of the next."""
        return self._feed.seed(self._next)

    @property
    def t(self) -> float:
        """Time of the cell [s], as its stamps say it."""
        return self._base + self._world.t

    @property
    def flying(self) -> bool:
        """Whether a ball or a part comes, or has come and was not judged yet."""
        return self._flying

    @property
    def ends(self) -> tuple[str, ...]:
        """How balls or parts may end."""
        return self._feed.ends

    @property
    def released(self) -> bool:
        """Whether the robot expects commands: its brakes are not engaged."""
        return self._controller.released

    @property
    def truth(self) -> Truth:
        """True state now, for tests and benchmarks."""
        return self._world.truth()

    def tick(self) -> None:
        """Go on by a tick: read, publish, and let act what has come by then."""
        world, port, t = self._world, self._port, self.t
        senses = world.sense(look=self._flying or self._sees)
        stamp = float(self._base + senses.t)
        if self._ticks % self._every == 0:
            self._sent[self._ticks // self._every % _KEPT] = stamp, self._clock()
            port.state(stamp, senses.arm.q, senses.arm.dq)
        if senses.frames:
            images = [x.pixels for x in senses.frames]
            if self._bend:
                images = [bend(x) for bend, x in zip(self._bend, images, strict=True)]
            port.frames(self._base + senses.frames[0].t, images)
        for p in senses.points:
            if p.found:
                port.ball(self._base + p.t, p.r_o)
        trouble = self._controller.trouble
        if trouble != self._trouble or self._ticks % 100 == 0:
            self._trouble = trouble
            port.status(t, trouble)
        self._ticks += 1

    def act(self) -> None:
        """Let what was commanded by now act for a tick."""
        truth = self._world.truth()
        q, dq, t, control = truth.q, truth.dq, self.t, self._controller
        said = self._port.brake()
        if said is not None:
            (control.engage if said else control.release)(t, q, dq)
        new = self._port.command()
        if new is not None and control.released:
            found = np.flatnonzero(np.abs(self._sent["stamp"] - new.answers) < 0.1 * TICK)
            if len(found):
                self.ages.add(self._clock() - float(self._sent["clock"][found[0]]))
        command = control.command(t, q, dq, new)
        self._rows.append(control.told)
        self._driven.append(control.commanded)
        self._world.apply(command)
        if len(self._rows) >= 100:
            self._check()
        self._go_on(command, truth)

    def _go_on(self, command: Command, truth: Truth) -> None:
        """Let a ball or a part come, judge what became of it, take it away."""
        world = self._world
        still = bool(np.all(np.abs(truth.dq) < 0.05))  # [rad/s]
        near = bool(np.all(np.abs(truth.q - self._arm.q_ready) < 0.05))  # [rad]
        waits = still and near and self._controller.commanded and not command.brakes
        self._settled = self._settled + 1 if waits else 0
        ready = self._settled * TICK >= 0.8
        if self._flying:
            if self._feed.over(world, truth, ready=ready):
                self._judge()
        elif ready and self._next < self._feed.count:
            self._settled, self._flying = 0, True
            self._put(self._feed.bring(self._next))
        elif world.t >= 10.0:  # put there anew [s]
            self._put(self._aside)

    def _judge(self) -> None:
        """Say what became of a ball or a part, and take it away."""
        world = self._world
        ended = self._feed.ended(world)
        self._check()
        self.violations += overheated(continuous_shares(self._arm, self._squares, self._summed))
        self._flying = False
        self.statuses.append(ended["status"])
        self.placed += ended.get("placed", False)
        self.forces.append(None if world.first_contact is None else world.peak_force)
        self._next += 1
        self._put(self._aside)
        self._settled, self.done = 0, self._next >= self._feed.count
        self._port.result(
            json.dumps(
                {
                    "throw": self._next - 1,
                    **ended,
                    "limit_violations": self.violations,
                    "peak_contact_force_n": self.forces[-1],
                    "command_age_us": self.ages.percentiles_us(),
                    "done": self.done,
                }
            )
        )

    def _put(self, ball: Throw | BallPath | Ride) -> None:
        """Put a ball or a part somewhere; arm and hand stay as they are."""
        self._check()
        self._squares[:], self._summed = 0.0, 0
        self._base = self.t
        self._world.reset(ball, self._seed, stay=True)

    def _check(self) -> None:
        """Count the ticks beyond a limit since the last time, a few at once: it takes time."""
        k, arm, truth = len(self._rows), self._arm, self._world.trace()
        if k == 0:
            return
        rows, driven = np.array(self._rows), np.array(self._driven)
        q, dq, given = truth.q[-k - 1 : -1], truth.dq[-k - 1 : -1], truth.tau[-k:]
        drives = drive_loads(arm, q, dq, given)
        beyond = ticks_beyond(
            arm, truth, drives, rows, driven=driven, before=self._before, rounded=_STAMPS
        )
        self.violations += int(np.sum(beyond))
        self._squares += np.sum(drives.torque**2, axis=0)
        self._summed += k
        self._before = rows[-1] if driven[-1] else None
        self._rows, self._driven = [], []
