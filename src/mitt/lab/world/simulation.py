"""The simulated world: one plant, thrown at again and again, a tick at a time."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NoReturn, final

import mujoco
import numpy as np

from mitt.core import checks
from mitt.core.arm.description import ArmModel
from mitt.core.arm.limits import Limits
from mitt.core.arm.tools import Paddle
from mitt.core.ball.spin import lift_constant, lift_of
from mitt.core.errors import InputError
from mitt.core.signals import GRAVITY, TICK, Array, Command, Frame, Senses
from mitt.lab.world.build import Drawn, PlantDraw, build_scene, rubber_of
from mitt.lab.world.capsules import Body, body_of, lay_capsules
from mitt.lab.world.disturbances import DisturbedTrial, Undisturbed
from mitt.lab.world.drives import brakes_of, finger_servo, fresh_drives, servo_of
from mitt.lab.world.driving import hold_torques
from mitt.lab.world.engine import Plant, hand_names, plant_of, released
from mitt.lab.world.faults import ActiveFaults, Sensor
from mitt.lab.world.flights import BallPath, PlacedFlight
from mitt.lab.world.giver import Giver
from mitt.lab.world.imaging import Imager
from mitt.lab.world.motion import move_motors, note_state, note_stop, over
from mitt.lab.world.prescribed import FREE, Prescribed, states_of
from mitt.lab.world.scene import Scene
from mitt.lab.world.sensors import CameraMaker, Odometer, Sensors, encoder_steps
from mitt.lab.world.sight import viewpoint_of
from mitt.lab.world.targets import InHand, Ride
from mitt.lab.world.throws import Throw, fly
from mitt.lab.world.truth import Instant, Trace, TraceBuffer, Truth, truth_of


@dataclass(frozen=True, slots=True)
class Stage:
    """A world as compiled code plays on it: see :mod:`mitt.lab.trials.play`.

    Attributes:
        plant: The plant.
        trace_buffer: The trace, whose row of a tick has its number.
        body: Arm and hand.
        sensors: What reaches the catcher.
        imager: The cameras, two that see images of one size and do not turn; None where the ball
            is seen as points.
        scene: Settings.
        radius: Radius of the ball [m].
        rows: Prescribed motion of the ball for a number of ticks, shape (k, 2, 3).
    """

    plant: Plant
    trace_buffer: TraceBuffer
    body: Body
    sensors: Sensors
    imager: Imager | None
    scene: Scene
    radius: float
    rows: Callable[[int], Array]


@final
class World:
    """Arm, hand and ball as MuJoCo moves them.

    The model is compiled once; ``reset`` starts a trial with its own plant mismatch and noise,
    drawn from its seed alone. Then each tick: ``sense``, decide, ``apply``.

    Attributes:
        model: The compiled MuJoCo model, with the masses of the present trial.
        data: Its state.
        radius: Radius of the present trial's ball [m].
    """

    def __init__(
        self,
        scene: Scene,
        arm: ArmModel,
        *,
        cameras: CameraMaker | None = None,
        limits: Limits | None = None,
    ) -> None:
        """Compile the scene.

        Args:
            scene: Settings.
            arm: Arm with its hand.
            cameras: Sets up the cameras of a trial; the ball is seen as points if None.
            limits: Limit set of the arm; only motors that are weaker than it ask for it.

        Raises:
            ModelError: The arm carries no hand.
        """
        checks.instance("scene", scene, Scene)
        checks.instance("arm", arm, ArmModel)
        self._scene, self._arm, self._cameras, self._limits = scene, arm, cameras, limits
        self._built = build_scene(scene, arm)
        self.model = self._built.model
        self.data = mujoco.MjData(self.model)
        self._brakes = brakes_of(arm.complete(), limits)
        self._joint_servo = servo_of(scene, arm, limits)
        self._draw = PlantDraw(scene, self._built)
        self._n, self._f = self._built.joints, self._built.fingers
        hand = arm.hand
        assert hand is not None  # no scene is built without one
        self._fingers = finger_servo(hand.drive)
        self._delay, self._pulls = round(hand.delay / TICK), hand.pulls
        self._waiting: deque[float] = deque()
        self._ride: Ride | None = None
        self._odometer: Odometer | None = None
        self._giver: Giver | None = None
        self._part = int(self.model.geom_bodyid[self._built.ball])
        self._belt = None if scene.belt is None else self.model.joint("belt").id
        d, n, ball = self.data, self._n, self._n + self._f
        self._plant = plant_of(self.model, d, self._built.site, n, fine=self._built.fine)
        if isinstance(hand, Paddle):
            rubber = rubber_of(scene, hand, self.model, self._plant.rubber.facing)
            self._plant = self._plant._replace(rubber=rubber)
        self._names = hand_names(self.model)
        qpos, qvel, self._site = self._plant.qpos, self._plant.qvel, self._plant.place
        self._links, self._active = np.zeros((3, len(arm.links))), np.array(arm.active, np.int64)
        self._senses = qpos[:n], qvel[:n], qpos[ball : ball + 3], qvel[ball : ball + 3]
        self._body, self._steps = body_of(self.model, d), encoder_steps(scene, arm)
        self._ball = self._senses[2:]
        self._pose, self._spin = qpos[ball : ball + 7], qvel[ball + 3 : ball + 6]
        self._trace = TraceBuffer(ball + 7, ball + 6, n)
        self._path: BallPath | None = None
        self._faults: ActiveFaults | None = None
        self._prescribed: Prescribed | None = None
        self._start(self._draw.nominal)

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied: what compiled code works on lies in MuJoCo's memory."""
        raise InputError(
            "world",
            "a world that is not copied or sent elsewhere",
            "a copy",
            do="make another from the same scene and arm, and reset it",
        )

    @property
    def t(self) -> float:
        """Time since release [s]."""
        return self._ticks * TICK

    @property
    def flight(self) -> Callable[[float], tuple[Array, Array]]:
        """The ball's true flight, untouched: time since release [s] to position and velocity.

        For oracles and rewards alone; read right after ``reset``.
        """
        if self._faults is not None:
            return self._faults.untouched_flight(self._drag).at
        if self._path is not None:
            return self._path.at
        r, dr, drag = *(x.copy() for x in self._ball), self._drag
        lift = lift_of(self._spin.copy(), self._plant.ball_lift, self.radius)
        return lambda t: fly(r, dr, drag=drag, duration=t, lift=lift)

    @property
    def spin(self) -> Array:
        """Angular velocity of the ball [rad/s], (3,): in the world until it has touched anything.

        For oracles alone.
        """
        return self._spin.copy()

    @property
    def first_contact(self) -> Instant | None:
        """True state at the first touch of ball and hand; None until then."""
        t = float(self._plant.state["touched"][0])
        return None if t < 0.0 else Instant(t, *self._plant.first.copy())

    @property
    def catch_point(self) -> Array:
        """Where the catch point is now [m], shape (3,)."""
        return self._site.copy()

    @property
    def peak_force(self) -> float:
        """Largest single contact force on the ball so far [N]."""
        return float(self._plant.state["peak"][0])

    @property
    def peak_load(self) -> float:
        """Largest load on the hand so far [N]: of all contacts together, or of one if larger."""
        return float(self._plant.state["load"][0])

    @property
    def ride(self) -> Ride | None:
        """How the part rides on the belt in this trial; None without one."""
        return self._ride

    @property
    def hand_force(self) -> float | None:
        """Largest force on the hand that hands something over [N]; None where there is none."""
        return None if self._giver is None else self._giver.force

    def watch_on(self) -> None:
        """Go on for :data:`mitt.lab.world.motion.WATCHED` from now on: the catcher has stopped."""
        note_stop(self._plant.state, bool(self._plant.state["braked"][0] >= 0.0), True)

    def over(self, *, longest: float, held: float) -> bool:
        """Tell whether the trial is at its end, by :func:`mitt.lab.world.motion.over`."""
        return bool(over(self._plant.state, longest, held))

    @property
    def diverged(self) -> bool:
        """Whether the physics broke down in this trial, or a command was not finite."""
        return bool(self._plant.state["broken"][0])

    def reset(self, ball: Throw | BallPath | Ride, seed: int, *, stay: bool = False) -> None:
        """Start a trial.

        Args:
            ball: A throw, which flies freely, a path, which leads the ball until it is touched, a
                ride on the scene's belt, or a thing in a hand that holds it until the tool does.
            seed: Seed of the plant mismatch and of all noise in this trial.
            stay: Whether arm and fingers go on from where they are, not from the ready pose.
        """
        seed = checks.whole("seed", seed, least=0)
        if isinstance(ball, Ride) and self._belt is None:
            raise InputError("ball", "a scene with a belt, for a ride on it", "one without")
        if not isinstance(ball, Throw | BallPath | Ride):
            raise InputError("ball", "a Throw, a BallPath or a Ride", checks.shown(ball))
        self._waiting.clear()
        size = self._n + self._f
        kept = self.data.qpos[:size].copy(), self.data.qvel[:size].copy()
        plant, noise, own = (
            np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)
        )
        self._faults = faults = self._drawn_faults(ball, seed)
        payload = 0.0 if faults is None else faults.payload
        drawn = self._draw.draw(self.data, plant, ball=own, payload=payload)
        behind = -ball.orientation[:, 2] if isinstance(ball, InHand) else None
        sensors = Sensors(
            self._scene.sensing,
            drawn.radius,
            self._cameras,
            noise,
            self._body,
            self._steps,
            viewpoint_of(self._scene, drawn.radius, behind),
        )
        self._sensors: Sensor = sensors
        self._imager = sensors.imager
        if faults is not None:
            self._sensors = faults.sensors(sensors, pixels=self._cameras is not None)
            ball = faults.ball
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[: self._n] = self._arm.q_ready
        if stay:
            self.data.qpos[:size], self.data.qvel[:size] = kept
        self._ride, encoder = ball if isinstance(ball, Ride) else None, self._scene.sensing.belt
        own = np.random.default_rng([seed, 1])
        self._odometer = None if encoder is None else Odometer(encoder, own)
        self._giver = self._person(ball, drawn) if isinstance(ball, InHand) else None
        r, dr = (ball.r, ball.dr) if isinstance(ball, Throw) else ball.at(0.0)
        self._ball[0][:], self._ball[1][:] = r, dr
        if isinstance(ball, Throw | PlacedFlight):
            self._spin[:] = ball.spin
        if self._ride is not None:
            turned = 0.5 * self._ride.yaw
            self._pose[3:] = np.cos(turned), 0.0, 0.0, np.sin(turned)
        elif self._giver is not None:
            self._pose[3:] = self._giver.quaternion
        self._path = None if isinstance(ball, Throw | Ride) else ball
        self._start(drawn)

    def sense(self, *, look: bool = True) -> Senses:
        """Return what reaches the catcher in this tick; once a tick.

        Args:
            look: Whether ball and images are exposed in this tick; encoders always are.
        """
        senses, ride = self._sensors.read(self.t, *self._senses, look=look), self._ride
        if self._odometer is None or ride is None:
            return senses
        return replace(senses, belt=self._odometer.read(self.t, ride.travel(self.t)))

    def views_before(self, count: int) -> list[tuple[Frame, ...]]:
        """Return looks at the scene before the release, without the thrown ball.

        None where the ball is seen as points. No noise of the trial is used up.

        Args:
            count: Number of looks.
        """
        if self._imager is None:
            return []
        lay_capsules(self._body, self._body.capsules)
        return self._imager.before(count, self._body.capsules)

    @property
    def stage(self) -> Stage | None:
        """The world as compiled code plays on it; None where only :meth:`sense` will do.

        That is where sensors or commands are at fault, a person holds what is met, cameras turn or
        are not a pair, points can be hidden, and where not every tick has its frame.
        """
        sensors = self._sensors
        hidden = self._imager is None and self._scene.sensing.viewpoint != "around"
        if hidden or not self.moves_plainly:
            return None
        if not isinstance(sensors, Sensors) or self._scene.sensing.frame_rate < 1.0 / TICK:
            return None
        imager = sensors.imager
        if imager is not None and not imager.a_pair:
            return None
        return Stage(
            self._plant,
            self._trace,
            self._body,
            sensors,
            imager,
            self._scene,
            self.radius,
            self._rows,
        )

    @property
    def moves_plainly(self) -> bool:
        """Whether motors follow commands as they are, and nothing else moves in a tick.

        That is not so with faults of sensors and commands, belts and persons, tools that act late,
        arms that follow setpoints, and cameras that turn.
        """
        disturbed = self._faults is not None and not self._faults.on_ball_alone
        moved = self._ride is not None or self._giver is not None
        late = self._delay > 0 or self._pulls or self._joint_servo is not None
        return not (disturbed or moved or late or self._scene.sensing.cameras == "active")

    def hold_torques(
        self,
        wanted: Array,
        hand: float,
        limits: Limits,
        given: Array,
        *,
        longest: float,
        held: float,
    ) -> int:
        """Let the motors give torques for some ticks, or until the trial is over, compiled.

        It is as :meth:`apply` in each tick, and :meth:`over` after it; for a world that
        :attr:`moves_plainly`.

        Args:
            wanted: Torques of the joints [N m], shape (n,), cut to what the drives can give.
            hand: Closing angle commanded [rad].
            limits: What the drives can give.
            given: Torques that were given [N m]: the last of four rows of each tick is written,
                shape (ticks, 4, n).
            longest: As of :meth:`over`.
            held: As of :meth:`over`.

        Returns:
            How many ticks there were.
        """
        until = self._ticks + len(given) + 1
        trace, path = self._trace.reserve(until), self._rows(until)
        packed, active, links = limits.packed, self._active, self._links
        plant = self._plant
        return int(
            hold_torques(
                plant, wanted, hand, packed, active, links, trace, path, given, longest, held
            )
        )

    def apply(self, command: Command) -> None:
        """Let the motors follow a command for one tick; nothing here clips it."""
        command = self._checked(command)
        if self._faults is not None:
            command = self._faults.command(self.t, command)
        if self._joint_servo is not None:
            command = self._joint_servo.torques(command, *self._senses[:2])
        command = command._replace(hand=self._worked(command.hand))
        if self._ride is not None and self._belt is not None:
            joint = self.model.jnt_qposadr[self._belt], self.model.jnt_dofadr[self._belt]
            self.data.qpos[joint[0]], self.data.qvel[joint[1]] = 0.0, self._ride.speed(self.t)
        if self._giver is not None:
            self._hand_over(self._giver, command.hand)
        if self._faults is not None and (rate := self._faults.turn(self.t)) is not None:
            self._spin[2] = rate
        note_stop(self._plant.state, command.brakes, False)
        self._disturb()
        until = self._ticks + 2
        trace = self._trace.reserve(until)
        move_motors(self._plant, command.tau, command.hand, trace, self._rows(until))
        self._sensors.turn(command.gaze, TICK)

    def _disturb(self) -> None:
        """Disturb what rides, or is held, until the tool has touched it; it is free then."""
        met = self._ride is not None or self._giver is not None
        if self._faults is None or not met or self._plant.state["touched"][0] >= 0.0:
            return
        if self._faults.push(self.t, *self._ball):
            self._plant.state["prescribed"] = False

    def _rows(self, count: int) -> Array:
        """Return the prescribed motion of the ball for so many ticks; none where it is free."""
        known = self._prescribed is not None and self._plant.state["prescribed"][0]
        return self._prescribed.rows(count) if self._prescribed and known else FREE

    def _person(self, path: InHand, drawn: Drawn) -> Giver:
        """Return the person who holds what is drawn for a trial."""
        return Giver(path, drawn.mass, float(self.model.body_inertia[self._part].min()))

    def _hand_over(self, giver: Giver, hand: float) -> None:
        """Let the person pull at what the tool has touched, and let go of what it holds.

        It holds what all its fingers touch once they close, or the cup once it pulls.
        """
        if self._plant.state["prescribed"][0]:
            return
        if self._plant.state["touched"][0] < 0.0:  # somebody has taken it away
            self.data.xfrc_applied[self._part], self._giver = 0.0, None
            return
        acts = bool(self.data.ctrl[-1] > 0.0) if self._pulls else hand > 0.0
        held = acts and int(np.sum(self._plant.touching)) >= self._f
        weight = GRAVITY * float(self._plant.ball_mass)
        motion = self._pose, np.concatenate([self._ball[1], self._spin])
        self.data.xfrc_applied[self._part] = giver.pull(self.t, *motion, weight, held=held)

    def _worked(self, hand: float) -> float:
        """Return what reaches the fingers now of what was commanded a delay ago; a cup pulls."""
        if self._delay:
            self._waiting.append(hand)
            hand = self._waiting.popleft() if len(self._waiting) > self._delay else 0.0
        if self._pulls:
            self.data.ctrl[-1] = float(hand > 0.0)
            return 0.0
        return hand

    def _checked(self, command: Command) -> Command:
        """Return a command as compiled code takes it; refuse another shape."""
        given = checks.instance("command", command, Command)
        joints = checks.array("command.joints", given.joints, (4, self._n))
        hand = checks.number("command.hand", given.hand)
        return given._replace(joints=joints, hand=hand)

    def truth(self) -> Truth:
        """Return the true state at the end of the last tick."""
        tau = self._trace.rows.tau[self._ticks].copy()
        return truth_of(self._plant, names=self._names, tau=tau)

    def trace(self) -> Trace:
        """Return all true states since release."""
        return self._trace.trace(self._ticks + 1)

    def _drawn_faults(self, ball: Throw | BallPath | Ride, seed: int) -> ActiveFaults | None:
        """Return what goes wrong in a trial; None where the plan is empty."""
        plan = self._scene.faults
        if not plan:
            return None
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[: self._n] = self._arm.q_ready
        mujoco.mj_kinematics(self.model, self.data)
        flight = Undisturbed(ball=ball, drag=self._scene.ball.drag, hand=self._site.copy())
        return ActiveFaults(plan, seed, DisturbedTrial(flight, self._limits, self._arm.active))

    def _start(self, drawn: Drawn) -> None:
        """Forget the trial before and bring all derived quantities up to date."""
        self.radius = drawn.radius
        self._drag = float(drawn.drag_force / drawn.mass)
        self.model.opt.timestep = TICK
        mujoco.mj_step1(self.model, self.data)
        actuation = self._scene.actuation
        if self._joint_servo is not None:
            self._joint_servo.start()
            actuation = actuation.model_copy(update={"delay": 0})  # its setpoints wait instead
        self._plant = released(
            self._plant,
            ball=(
                drawn.mass,
                self._drag,
                self._scene.ball.lift * lift_constant(drawn.radius, drawn.mass),
                drawn.radius,
            ),
            rubber=self._plant.rubber,
            friction=drawn.friction,
            fingers=self._fingers,
            drives=fresh_drives(actuation, self.data.qfrc_bias[: self._n]),
            brakes=self._brakes,
        )
        self._prescribed = self._prescription()
        self._plant.state["prescribed"] = self._prescribed is not None
        note_state(self._plant, self._trace.rows)

    def _prescription(self) -> Prescribed | None:
        """Return the motion that the ball follows until it is touched; None where it is free.

        What rides on a belt, or is held by somebody, is disturbed as it goes on: :meth:`apply`.
        """
        if self._ride is not None:
            return None
        if self._faults is not None and self._giver is None:
            return self._faults.prescribed(self._drag)
        return None if self._path is None else Prescribed(states_of(self._path))

    @property
    def _ticks(self) -> int:
        """Ticks since release."""
        return int(self._plant.state["ticks"][0])
