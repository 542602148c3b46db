"""The simulated world: one plant, thrown at again and again, a tick at a time."""

from typing import final

import mujoco
import numpy as np

from mitt.robot.description import ArmModel
from mitt.robot.hands import HandModel
from mitt.signals import Array, Command, Senses
from mitt.world.build import STEP, build_plant
from mitt.world.contacts import ARM_FLOOR, BALL_FLOOR, BALL_HAND, SELF, is_sane, survey
from mitt.world.flights import BallPath
from mitt.world.hand import HAND
from mitt.world.scene import Scene
from mitt.world.sensors import CameraMaker, Sensors
from mitt.world.servo import actuate, servo_numbers
from mitt.world.throws import Throw
from mitt.world.truth import FirstContact, Tape, Trace, Truth, write_row

#: Control tick [s] and simulation steps in it.
TICK = 0.001
_SUBSTEPS = round(TICK / STEP)

#: No throw and no grip makes a ball this fast [m/s]; a contact that breaks down does.
TOP_SPEED = 30.0


@final
class World:
    """Arm, hand and ball as MuJoCo moves them.

    The model is compiled once; ``reset`` starts a trial with its own plant mismatch and noise,
    drawn from its seed alone. Then each tick: ``sense``, decide, ``apply``.

    Attributes:
        model: The compiled MuJoCo model, with the masses of the present trial.
        data: Its state.
        first_contact: State at the first touch of ball and hand; None until then.
        peak_force: Largest single contact force on the ball so far [N].
    """

    def __init__(self, scene: Scene, arm: ArmModel, *, cameras: CameraMaker | None = None) -> None:
        """Compile the scene.

        Args:
            scene: Settings.
            arm: Arm with its hand.
            cameras: Sets up the cameras of a trial; the ball is seen as points if None.

        Raises:
            ModelError: The arm carries no hand.
        """
        self._scene, self._arm, self._cameras = scene, arm, cameras
        self._plant = build_plant(scene, arm)
        self.model = self._plant.model
        self.data = mujoco.MjData(self.model)
        self._masses = self.model.body_mass.copy(), self.model.body_inertia.copy()
        self._n, self._f = self._plant.joints, self._plant.fingers
        drive = (arm.hand or HandModel()).drive
        self._servo = np.array(servo_numbers(drive))
        self._kinds = self.model.geom_contype.copy()
        self._touching = np.zeros(self.model.ngeom, dtype=np.bool_)
        self._largest, self._tip = np.zeros(1), np.zeros(6)
        d = self.data
        self._views = d.qpos, d.qvel, d.ctrl, d.qfrc_applied
        self._site = d.site_xpos[self._plant.site]
        self._tape = Tape((1, self.model.nq, self.model.nv, self._n, 3, 3, 1, 1))
        self._broken, self.peak_force = False, 0.0
        self.first_contact: FirstContact | None = None
        self._start(None, np.zeros((2, self._n)), 0.0)

    @property
    def t(self) -> float:
        """Time since release [s]."""
        return self._ticks * TICK

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
        plant, sensors = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
        friction, drag = self._draw_mismatch(plant)
        self._sensors = Sensors(
            self._scene.sensing, self._scene.ball.radius, self._cameras, sensors
        )
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[: self._n] = self._arm.q_ready
        if isinstance(ball, Throw):
            self._set_ball(ball.r, ball.dr)
            self._start(None, friction, drag)
        else:
            self._set_ball(*ball.at(0.0))
            self._start(ball, friction, drag)

    def sense(self) -> Senses:
        """Return what reaches the catcher in this tick; once a tick."""
        qpos, qvel = self._views[:2]
        n, ball = self._n, self._n + self._f
        return self._sensors.read(self.t, qpos[:n], qvel[:n], qpos[ball : ball + 3])

    def apply(self, command: Command) -> None:
        """Let the motors follow a command for one tick; nothing here clips it."""
        qpos, qvel, ctrl, passive = self._views
        model, data = self.model, self.data
        self._tau, hand = np.asarray(command.tau, float), command.hand
        self._largest[0], self._seen = 0.0, 0
        for sub in range(1, _SUBSTEPS + 1):
            self._broken |= not actuate(
                qpos, qvel, ctrl, passive, self._tau, hand, self._servo, self._friction, self._drag
            )
            mujoco.mj_step2(model, data)
            if data.ncon:
                self._survey()
            if self._path is not None:
                self._set_ball(*self._path.at(self.t + sub * STEP))
            mujoco.mj_step1(model, data)
            if self.first_contact is None and data.ncon:
                self._watch_for_contact(self.t + sub * STEP)
        self._ticks += 1
        self.peak_force = max(self.peak_force, float(self._largest[0]))
        self._broken |= not is_sane(qpos, qvel, data.qacc, self._n + self._f, TOP_SPEED)
        self._record()

    def truth(self) -> Truth:
        """Return the true state at the end of the last tick."""
        qpos, qvel = (x.copy() for x in self._views[:2])
        n, ball = self._n, self._n + self._f
        touching = (self.model.geom(int(g)).name for g in self._hand_geoms_touched())
        return Truth(
            t=self.t,
            r_o=qpos[ball : ball + 3],
            dr_o=qvel[ball : ball + 3],
            position=self._site.copy(),
            velocity=self._tip[3:].copy(),
            q=qpos[:n],
            dq=qvel[:n],
            tau=self._tau.copy(),
            fingers=qpos[n:ball],
            touching=frozenset(touching),
            contact_force=float(self._largest[0]),
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

    def _start(self, path: BallPath | None, friction: Array, drag: float) -> None:
        """Forget the trial before and bring all derived quantities up to date."""
        self._path, self._friction, self._drag = path, friction, drag
        self._ticks, self._seen = 0, 0
        self._tau = np.zeros(self._n)
        self._broken = False
        self.peak_force = 0.0
        self.first_contact = None
        self._touching[:] = False
        self._largest[0] = 0.0
        mujoco.mj_step1(self.model, self.data)
        self._tape.clear()
        self._record()

    def _draw_mismatch(self, rng: np.random.Generator) -> tuple[Array, float]:
        """Draw this trial's plant; return friction, shape (2, n), and drag force per speed^2."""
        mismatch, ball = self._scene.mismatch, self._scene.ball
        factor = 1.0 + mismatch.mass * rng.uniform(-1.0, 1.0, self.model.nbody)
        factor[self.model.geom_bodyid[self._plant.ball]] = 1.0
        self.model.body_mass[:] = self._masses[0] * factor
        self.model.body_inertia[:] = self._masses[1] * factor[:, None]
        mujoco.mj_setConst(self.model, self.data)
        most = np.array([[mismatch.viscous], [mismatch.coulomb]])
        friction = most * rng.uniform(0.0, 1.0, (2, self._n))
        drag = ball.mass * ball.drag * (1.0 + mismatch.drag * rng.uniform(-1.0, 1.0))
        return friction, drag

    def _set_ball(self, r: Array, dr: Array) -> None:
        """Put the ball somewhere with some velocity."""
        qpos, qvel = self._views[:2]
        ball = self._n + self._f
        qpos[ball : ball + 3], qvel[ball : ball + 3] = r, dr

    def _survey(self) -> None:
        """Read the contacts of the step just made."""
        contact = self.data.contact
        self._seen |= survey(
            contact.geom,
            contact.efc_address,
            self.data.efc_force,
            self._kinds,
            self._touching,
            self._largest,
        )

    def _watch_for_contact(self, t: float) -> None:
        """Note the first touch; a ball that was led flies freely from its first touch on."""
        contact = self.data.contact
        nothing = np.zeros(1)
        touched = survey(
            contact.geom, contact.efc_address, nothing, self._kinds, self._touching, nothing
        )
        if touched & ~(SELF | ARM_FLOOR):
            self._path = None
        if touched & BALL_HAND:
            qpos, qvel = (x.copy() for x in self._views[:2])
            ball = self._n + self._f
            self._read_tip()
            self.first_contact = FirstContact(
                t=t,
                r_o=qpos[ball : ball + 3],
                dr_o=qvel[ball : ball + 3],
                position=self._site.copy(),
                velocity=self._tip[3:].copy(),
            )

    def _read_tip(self) -> None:
        """Read the catch point's angular and linear velocity, world axes."""
        kind = mujoco.mjtObj.mjOBJ_SITE
        mujoco.mj_objectVelocity(self.model, self.data, kind, self._plant.site, self._tip, 0)

    def _hand_geoms_touched(self) -> np.typing.NDArray[np.intp]:
        """Return the geoms of the hand that touch the ball at this instant."""
        contact = self.data.contact
        nothing = np.zeros(1)
        survey(contact.geom, contact.efc_address, nothing, self._kinds, self._touching, nothing)
        return np.flatnonzero(self._touching & (self._kinds == HAND))

    def _record(self) -> None:
        """Append the present state to the trace."""
        self._read_tip()
        qpos, qvel = self._views[:2]
        row, force = self._tape.next_row(), float(self._largest[0])
        write_row(row, self.t, qpos, qvel, self._tau, self._site, self._tip[3:], force)
        row[-1] = self._seen
