"""The simulated world: one plant, thrown at again and again, a tick at a time."""

from collections.abc import Callable
from functools import partial
from typing import final

import mujoco
import numpy as np

from mitt.robot.description import ArmModel
from mitt.robot.hands import HandModel
from mitt.robot.limits import Limits
from mitt.signals import Array, Command, Senses
from mitt.world.ballistics import fly
from mitt.world.build import STEP, build_plant
from mitt.world.contacts import ARM_FLOOR, BALL_ANY, BALL_FLOOR, BALL_HAND, SELF, Contacts
from mitt.world.faults.flight import Undisturbed
from mitt.world.faults.trial import Sensor, Troubles
from mitt.world.flights import BallPath
from mitt.world.mismatch import PlantDraw
from mitt.world.scene import Scene
from mitt.world.sensors import CameraMaker, Sensors
from mitt.world.servo import servo_numbers
from mitt.world.silhouettes import Silhouettes
from mitt.world.stepping import BROKEN, FINE, finish, pack_plant, prepare, tip_velocity
from mitt.world.throws import Throw
from mitt.world.truth import FirstContact, Tape, Trace, Truth

#: Control tick [s].
TICK = 0.001

#: Simulation steps in a tick where a contact may begin; else one will do.
_FINE_STEPS = round(TICK / STEP)


@final
class World:
    """Arm, hand and ball as MuJoCo moves them.

    The model is compiled once; ``reset`` starts a trial with its own plant mismatch and noise,
    drawn from its seed alone. Then each tick: ``sense``, decide, ``apply``.

    Attributes:
        model: The compiled MuJoCo model, with the masses of the present trial.
        data: Its state.
        first_contact: State at the first touch of ball and hand; None until then.
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
        self._scene, self._arm, self._cameras, self._limits = scene, arm, cameras, limits
        self._plant = build_plant(scene, arm)
        self.model = self._plant.model
        self.data = mujoco.MjData(self.model)
        self._draw = PlantDraw(scene, self._plant)
        self._n, self._f = self._plant.joints, self._plant.fingers
        self._servo = servo_numbers((arm.hand or HandModel()).drive)
        self._contacts, self._peaks = Contacts(self.model, self.data), np.zeros(2)
        d, n, ball = self.data, self._n, self._n + self._f
        self._views = d.qpos, d.qvel, d.ctrl, d.qfrc_applied
        self._senses = d.qpos[:n], d.qvel[:n], d.qpos[ball : ball + 3], d.qvel[ball : ball + 3]
        self._body = Silhouettes(self.model, d)
        self._ball = d.qpos[ball : ball + 3], d.qvel[ball : ball + 3]
        self._flight, self._qacc = np.zeros((2, 3)), d.qacc
        self._site = d.site_xpos[self._plant.site]
        slides = self.model.jnt_type[:n] == mujoco.mjtJoint.mjJNT_SLIDE
        self._axes = d.xanchor, d.xaxis, np.ascontiguousarray(slides)
        self._options, self._steps = self.model.opt, 1
        self._tape = Tape((1, self.model.nq, self.model.nv, n, 3, 3, 1, 1))
        self._start(None, np.zeros((2, n)), 0.0)

    @property
    def t(self) -> float:
        """Time since release [s]."""
        return self._ticks * TICK

    @property
    def flight(self) -> Callable[[float], tuple[Array, Array]]:
        """The ball's true flight, untouched: time since release [s] to position and velocity.

        For the clairvoyant alone; asked right after ``reset``.
        """
        if self._troubles is not None:
            return self._troubles.rehearsed(float(self._numbers[5])).at
        if self._path is not None:
            return self._path.at
        r, dr = (x.copy() for x in self._ball)
        return partial(_flown, r, dr, float(self._numbers[5]))

    @property
    def peak_force(self) -> float:
        """Largest single contact force on the ball so far [N]."""
        return float(self._peaks[1])

    @property
    def ball_on_floor(self) -> bool:
        """Whether the ball touched the floor in the last tick."""
        return bool(self._seen & BALL_FLOOR)

    @property
    def diverged(self) -> bool:
        """Whether the physics broke down in this trial, or a command was not finite."""
        return self._broken

    def reset(self, ball: Throw | BallPath, seed: int) -> None:
        """Start a trial.

        Args:
            ball: A throw, which flies freely, or a path, which leads the ball until it is touched.
            seed: Seed of the plant mismatch and of all noise in this trial.
        """
        plant, noise = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
        self._troubles = troubles = self._drawn_troubles(ball, seed)
        payload = 0.0 if troubles is None else troubles.payload
        friction, drag = self._draw.draw(self.data, plant, payload=payload)
        sensors = Sensors(
            self._scene.sensing, self._scene.ball.radius, self._cameras, noise, self._body
        )
        self._sensors: Sensor = sensors
        if troubles is not None:
            self._sensors = troubles.sensors(sensors, pixels=self._cameras is not None)
            ball = troubles.ball
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[: self._n] = self._arm.q_ready
        if isinstance(ball, Throw):
            self._ball[0][:], self._ball[1][:] = ball.r, ball.dr
            self._start(None, friction, drag)
        else:
            self._ball[0][:], self._ball[1][:] = ball.at(0.0)
            self._start(ball, friction, drag)

    def sense(self, *, look: bool = True) -> Senses:
        """Return what reaches the catcher in this tick; once a tick.

        Args:
            look: Whether ball and images are exposed in this tick; encoders always are.
        """
        return self._sensors.read(self.t, *self._senses, look=look)

    def apply(self, command: Command) -> None:
        """Let the motors follow a command for one tick; nothing here clips it."""
        model, data, steps, troubles = self.model, self.data, self._steps, self._troubles
        if troubles is not None:
            command = troubles.command(self.t, command)
        tau, hand = np.asarray(command.tau, float), command.hand
        start, h = self._ticks * TICK, TICK / steps
        self._tau, self._peaks[0], self._seen = tau, 0.0, 0
        for step in range(1, steps + 1):
            alone = not data.ncon
            if troubles is not None and self.first_contact is None:
                self._push(troubles, start + (step - 1) * h, h)
            if not prepare(*self._views, tau, hand, self._numbers, h, alone, self._flight):
                self._broken = True
            mujoco.mj_step2(model, data)
            if not alone:
                touched = self._contacts.made(self._peaks)
                self._seen |= touched
                if not touched & BALL_ANY:
                    self._ball[0][:], self._ball[1][:] = self._flight
            if self._path is not None:
                self._ball[0][:], self._ball[1][:] = self._path.at(start + step * h)
            mujoco.mj_step1(model, data)
            if data.ncon and self.first_contact is None:
                self._watch_for_contact(start + step * h)
        self._sensors.turn(command.gaze, TICK)
        self._ticks += 1
        self._record()

    def truth(self) -> Truth:
        """Return the true state at the end of the last tick."""
        qpos, qvel = (x.copy() for x in self._views[:2])
        n, ball = self._n, self._n + self._f
        return Truth(
            t=self.t,
            r_o=qpos[ball : ball + 3],
            dr_o=qvel[ball : ball + 3],
            position=self._site.copy(),
            velocity=self._velocity(),
            q=qpos[:n],
            dq=qvel[:n],
            tau=self._tau.copy(),
            fingers=qpos[n:ball],
            touching=self._contacts.hand(),
            contact_force=float(self._peaks[0]),
            self_contact=bool(self._seen & SELF),
            floor_contact=bool(self._seen & ARM_FLOOR),
            ball_on_floor=bool(self._seen & BALL_FLOOR),
        )

    def trace(self) -> Trace:
        """Return all true states since release."""
        t, qpos, qvel, tau, position, velocity, force, seen = self._tape.columns()
        return Trace(
            t=t[:, 0],
            qpos=qpos,
            qvel=qvel,
            tau=tau,
            position=position,
            velocity=velocity,
            force=force[:, 0],
            seen=seen[:, 0].astype(np.int64),
        )

    def _drawn_troubles(self, ball: Throw | BallPath, seed: int) -> Troubles | None:
        """Return what goes wrong in a trial; None where the plan is empty."""
        plan = self._scene.faults
        if not plan:
            return None
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[: self._n] = self._arm.q_ready
        mujoco.mj_kinematics(self.model, self.data)
        flight = Undisturbed(ball=ball, drag=self._scene.ball.drag, hand=self._site.copy())
        active = self._arm.active
        return Troubles(plan, seed, flight, limits=self._limits, active=active, tick=TICK)

    def _start(self, path: BallPath | None, friction: Array, drag: float) -> None:
        """Forget the trial before and bring all derived quantities up to date."""
        self._path = path
        self._numbers = pack_plant(self._servo, friction, drag, self._scene.ball.mass)
        self._ticks, self._seen = 0, 0
        self._tau = np.zeros(self._n)
        self._broken = False
        self.first_contact: FirstContact | None = None
        self._peaks[:] = 0.0
        self._steps, self._options.timestep = 1, TICK
        mujoco.mj_step1(self.model, self.data)
        self._tape.clear()
        self._record()

    def _push(self, troubles: Troubles, t: float, h: float) -> None:
        """Let the flight be disturbed for a step; a ball that was led flies freely from then on."""
        r, dr = (x.copy() for x in self._ball)
        if troubles.push(t, h, r, dr):
            self._ball[0][:], self._ball[1][:] = r, dr
            self._path = None

    def _watch_for_contact(self, t: float) -> None:
        """Note the first touch; a ball that was led flies freely from its first touch on."""
        touched = self._contacts.present()
        self._seen |= touched
        if touched & BALL_ANY:
            self._path = None
        if touched & BALL_HAND:
            self.first_contact = FirstContact(
                t=t,
                r_o=self._ball[0].copy(),
                dr_o=self._ball[1].copy(),
                position=self._site.copy(),
                velocity=self._velocity(),
            )

    def _velocity(self) -> Array:
        """Return the catch point's velocity [m/s], shape (3,)."""
        velocity = np.empty(3)
        tip_velocity(self._site, *self._axes, self._views[1], velocity)
        return velocity

    def _record(self) -> None:
        """Append the present state to the trace, judge it, and set the steps of the next tick."""
        t, first = self._ticks * TICK, self.first_contact
        index = self._tape.extend()
        judged = finish(
            self._tape.rows,
            index,
            self._seen,
            t,
            self._views[0],
            self._views[1],
            self._qacc,
            self._tau,
            self._site,
            *self._axes,
            self._peaks,
            -1.0 if first is None else t - first.t,
        )
        if judged == BROKEN:
            self._broken = True
        steps = _FINE_STEPS if judged == FINE else 1
        if steps != self._steps:
            self._steps, self._options.timestep = steps, TICK / steps


def _flown(r: Array, dr: Array, drag: float, t: float) -> tuple[Array, Array]:
    """Return a free flight from a release."""
    return fly(r, dr, drag=drag, duration=t)
