"""From a command to the torques of the joints: joint control, delay, drives, fingers, brakes.

A robot that takes positions or velocities has a joint control of its own. Its law is that of
:mod:`mitt.core.control.setpoints`, as computed torque on the arm's nominal model, with the torques
within the arm's limits; in the place of the encoders' readings it uses its joints' true positions,
as a robot's own control reads better encoders than it publishes. Where one torque would be beyond
its limit, all accelerations are asked for in part, by one share: were that torque alone cut, the
inertia that joints share would throw another joint beyond its speed.

A drive's torque follows its command like a filter of first order. Within a step the mean of that
torque acts, so that what it brings about does not depend on the length of the steps.

A brake, which holds the arm once its drives are off, is dry friction that sticks: a stiff spring
holds the joint at the place where it came to rest, and slips where its torque is not enough (the
bristle of Dahl's friction model). So a joint that is held does not creep: it gives way by the load
over the spring's stiffness, once. Shorted windings damp the motion besides; both together are
bounded by the brake's torque, as the current through the windings is bounded.
"""

from collections import deque
from math import pi
from typing import NamedTuple, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.catch import FingerDrive
from mitt.core.arm.description import ArmModel
from mitt.core.arm.limits import Limits, joint_level
from mitt.core.control.setpoints import Setpoints
from mitt.core.errors import InputError
from mitt.core.kernels import Record, kernel
from mitt.core.signals import TICK, Array, Command
from mitt.lab.world.scene import Actuation, Scene

#: Length of the longest simulation step [s], and the parts of its limit of stability that springs
#: and dampers of all brakes together may take.
_STEP = 0.001
_SPRING = 0.3
_DAMPER = 0.6
#: Poses over which the smallest inertia of a joint is looked for, and their seed.
_POSES = 64
_SEED = 1
#: Torque of a brake where neither the arm's description nor a limit set states one [N m].
_STRONG = 100.0


class Drives(NamedTuple):
    """The drives of an arm of n joints, and commands on their way to them and to the fingers.

    Attributes:
        rate: Bandwidth of the torque [1/s]; 0 follows at once.
        now: Torques at the end of the last step [N m], shape (n,).
        mean: Mean torques over the last step [N m], shape (n,).
        torques: Torques that were commanded [N m], at the tick modulo k, shape (k, n).
        angles: Closing angles that were commanded [rad], the same, shape (k,).
    """

    rate: float
    now: Array
    mean: Array
    torques: Array
    angles: Array


class FingerServo(NamedTuple):
    """The servo of a finger: the numbers of :class:`mitt.core.arm.catch.FingerDrive`."""

    tau_max: float
    braking: float
    settling: float
    gain: float


def fresh_drives(actuation: Actuation, holding: Array) -> Drives:
    """Return drives that hold the arm still, and a hand that is open.

    Args:
        actuation: Settings.
        holding: Torques that hold the arm [N m], shape (n,).
    """
    ticks, rate = actuation.delay + 1, 2.0 * np.pi * actuation.bandwidth
    torques = np.tile(holding, (ticks, 1))
    return Drives(rate, np.array(holding), np.array(holding), torques, np.zeros(ticks))


@kernel
def command(drives: Drives, tick: int, tau: Array, hand: float) -> None:
    """Send torques [N m], shape (n,), and a closing angle [rad] on their way in a tick."""
    row = tick % len(drives.angles)
    for i in range(len(tau)):
        drives.torques[row, i] = tau[i]
    drives.angles[row] = hand


@kernel
def follow(drives: Drives, tick: int, h: float) -> float:
    """Let the drives follow what has arrived for a step, and return the closing angle [rad].

    Args:
        drives: The drives.
        tick: Number of the tick.
        h: Length of the step [s].
    """
    rate, row = drives.rate, (tick + 1) % len(drives.angles)
    keep = np.exp(-rate * h)
    for i in range(len(drives.now)):
        target = drives.torques[row, i]
        if rate == 0.0:
            drives.now[i] = drives.mean[i] = target
        else:
            gap = drives.now[i] - target
            drives.mean[i] = target + gap * (1.0 - keep) / (rate * h)
            drives.now[i] = target + gap * keep
    return float(drives.angles[row])


def finger_servo(drive: FingerDrive) -> FingerServo:
    """Return the servo of a finger's drive."""
    return FingerServo(drive.tau_max, drive.braking, drive.settling, drive.gain)


@kernel
def finger_torque(angle: float, speed: float, command: float, servo: FingerServo) -> float:
    """Return the torque of one finger's servo [N m] at its angle [rad] and speed [rad/s]."""
    error = command - angle
    wish = min(abs(error) / servo.settling, np.sqrt(2.0 * servo.braking * abs(error)))
    if error < 0.0:
        wish = -wish
    return float(min(max(servo.gain * (wish - speed), -servo.tau_max), servo.tau_max))


def fresh_brakes(n: int) -> Record:
    """Return n brakes without any torque, as of :func:`brakes_of`."""
    names = "torque", "delay", "stiffness", "damping", "given"
    return np.zeros(n, np.dtype([(name, np.float64) for name in names], align=True))


def brakes_of(model: ArmModel, limits: Limits | None) -> Record:
    """Return the brakes of an arm's active joints at rest, shape (n,).

    Their fields are the largest ``torque`` [N m]; the ``delay`` from the command until the brake
    acts [s]; the ``stiffness`` of the spring that holds [N m/rad], as stiff as a step of 1 ms
    carries; the ``damping`` of spring and windings [N m s/rad], no more than such a step carries;
    and how far the spring has ``given`` way [rad].

    Args:
        model: The arm with its hand.
        limits: Its limit set, for the torque of brakes that the description does not state.
    """
    many = np.full(len(model.links), _STRONG)
    arm = Arm(model, limits or joint_level("none", tau=many, speed=many))
    inertia, brakes = _least_inertia(arm), fresh_brakes(arm.n)
    brakes["torque"] = [brake.torque for brake in arm.brakes]
    brakes["delay"] = [brake.delay for brake in arm.brakes]
    brakes["stiffness"] = _SPRING / arm.n * inertia / _STEP**2
    most = _DAMPER / arm.n * inertia / _STEP
    brakes["damping"] = np.minimum(0.5 * most + [brake.damping for brake in arm.brakes], most)
    return brakes


def _least_inertia(arm: Arm) -> Array:
    """Return the smallest inertia of each joint in many poses, the others free, shape (n,)."""
    poses = np.random.default_rng(_SEED).uniform(arm.q_min, arm.q_max, (_POSES, arm.n))
    inverse = [np.diag(np.linalg.inv(arm.mass_matrix(q))) for q in poses]
    out: Array = 1.0 / np.max(inverse, axis=0)
    return out


@kernel
def hold(brakes: Record, since: float, qvel: Array, ctrl: Array, passive: Array, h: float) -> None:
    """Let the brakes that act by now hold their joints for a step; their drives give nothing.

    Args:
        brakes: As of :func:`brakes_of`; springs are overwritten.
        since: Time since they were commanded to engage [s].
        qvel: Velocities of the plant, arm first.
        ctrl: Motor torques, overwritten, arm first.
        passive: Friction, which the brakes' torques are added to, arm first.
        h: Length of the step [s].
    """
    for k in range(len(brakes)):
        brake = brakes[k]
        if since < 0.0 or since < brake.delay - 0.5 * h:
            continue
        most, stiff = brake.torque, brake.stiffness
        given = brake.given + h * qvel[k]
        brake.given = min(max(given, -most / stiff), most / stiff)
        torque = stiff * brake.given + brake.damping * qvel[k]
        ctrl[k] = 0.0
        passive[k] -= min(max(torque, -most), most)


def servo_of(scene: Scene, arm: ArmModel, limits: Limits | None) -> "JointServo | None":
    """Return the joint control of a scene's robot; None where it takes torques.

    Raises:
        InputError: The limits of the arm are not known, or a fault acts on commanded torques.
    """
    if scene.actuation.takes == "torque":
        return None
    unheard = sorted({x.kind for x in scene.faults} & {"torque", "command"})
    if unheard:
        raise InputError(
            "faults",
            "others, for a robot that takes no torques",
            unheard,
            do="take them out, or say actuation.takes = torque",
        )
    if limits is None:
        raise InputError("actuation.takes", "torque, or an arm with limits", scene.actuation.takes)
    return JointServo(Arm(arm, limits), scene.actuation)


@final
class JointControl:
    """Follows positions or velocities with torques."""

    def __init__(self, arm: Arm, takes: str, *, bandwidth: float) -> None:
        """Take the arm as its maker knows it, what it takes, and the bandwidth w [rad/s]."""
        self._arm, self._takes, self._w = arm, takes, bandwidth
        self._last: Array | None = None
        self._rate = np.zeros(arm.n)

    def restart(self) -> None:
        """Forget the setpoints so far."""
        self._last, self._rate = None, np.zeros(self._arm.n)

    def take(self, new: Array, *, passed: float = TICK) -> None:
        """Take a setpoint over.

        Args:
            new: Positions [rad] or velocities [rad/s], shape (n,).
            passed: Time since the setpoint before [s].
        """
        if self._last is not None:
            self._rate = (new - self._last) / passed
        self._last = new

    def torque(self, q: Array, dq: Array) -> Array:
        """Return the torques that follow the last setpoint [N m], shape (n,).

        Args:
            q: Joint positions [rad], shape (n,).
            dq: Joint velocities [rad/s], shape (n,).
        """
        assert self._last is not None, "no setpoint"
        w, arm = self._w, self._arm
        if self._takes == "velocity":
            ddq = 2.0 * w * (self._last - dq)
        else:
            ddq = w**2 * (self._last - q) + 2.0 * w * (self._rate - dq)
        return arm.active(_within(arm, q, dq, ddq))


def _within(arm: Arm, q: Array, dq: Array, ddq: Array) -> Array:
    """Return torques of all joints for accelerations; where one is too much, for a share of all."""
    limits, speeds, asked = arm.limits, arm.all_joints(dq), arm.torque(q, dq, ddq)
    high = limits.drive_torque(asked)
    most = np.copysign(limits.torque_bound(high, limits.drive_speed(speeds)), high)
    over = np.abs(high) > np.abs(most)
    if not np.any(over):
        return asked
    still = arm.torque(q, dq, np.zeros(arm.n))
    low = limits.drive_torque(still)
    share = float(np.min((most - low)[over] / (high - low)[over]))
    return limits.saturate(still + max(share, 0.0) * (asked - still), speeds)


@final
class JointServo:
    """A robot of a scene: its control, and setpoints that act after a delay."""

    def __init__(self, arm: Arm, actuation: Actuation) -> None:
        """Take the arm as its maker knows it, and how its control follows."""
        takes, w, self._delay = actuation.takes, 2.0 * pi * actuation.servo, actuation.delay
        self._control = JointControl(arm, takes, bandwidth=w)
        self._setpoints = Setpoints(arm, takes, bandwidth=w, delay=actuation.delay * TICK)
        self._sent: deque[tuple[Array, float]] = deque()

    def start(self) -> None:
        """Forget the trial before."""
        self._sent.clear()
        self._control.restart()
        self._setpoints.restart()

    def torques(self, command: Command, q: Array, dq: Array) -> Command:
        """Return a command with the torques, and the closing angle, of the setpoint that acts now.

        Args:
            command: The command of this tick.
            q: Joint positions [rad], shape (n,).
            dq: Joint velocities [rad/s], shape (n,).
        """
        self._sent.append((self._setpoints.of(command.joints[:3], q), command.hand))
        new, hand = self._sent[0]
        if len(self._sent) > self._delay:
            self._sent.popleft()
        if command.brakes and not command.tau.any():  # the brakes act, the drives are off
            return command._replace(hand=hand)
        self._control.take(new)
        tau = self._control.torque(q, dq)
        return command._replace(joints=np.array([*command.joints[:3], tau]), hand=hand)
