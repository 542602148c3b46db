"""What the environments share: an arm that an agent drives, a tick or some at a time."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.limits import saturate
from mitt.core.catcher.catcher import Catcher
from mitt.core.errors import InputError
from mitt.core.signals import TICK, Array, Command, Frame, Senses
from mitt.lab.report.painter import Faces, View, framed, painted
from mitt.lab.report.pictures import body_faces, placed_faces
from mitt.lab.trials.runner import LONGEST
from mitt.lab.trials.score import (
    HELD_AFTER,
    continuous_shares,
    drive_loads,
    overheated,
    ticks_beyond,
)
from mitt.lab.world.scene import Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.truth import Instant

Observation: TypeAlias = Any
Numbers: TypeAlias = NDArray[np.float32]

#: Bounds of what is observed: positions [m], speeds [m/s], joint speeds in shares of their limits,
#: joint angles in halves of their ranges.
FAR = 10.0
FAST = 20.0
_SPIN = 4.0
_BENT = 2.0
#: Residual torque of a full action, as a share of the joint's largest; ours.
_RESIDUAL = 0.2
#: Rewards: for a success, for the first touch, per second and metre of distance, per second of
#: full torque; choices of this project.
_SUCCESS = 10.0
TOUCH = 1.0
_DISTANCE = 1.0
_EFFORT = 0.05
#: Width and height of a picture where nothing is said, and how large it may be [px].
_SIZE = (480, 360)
_LARGEST = 4096
#: What the last number of an action ``torque`` does.
_CLOSES = "closing of the hand: -1 open, 1 closed"
#: Elevation and azimuth from which a picture is taken [deg].
_FROM = (14.0, -66.0)


@final
@dataclass(frozen=True, slots=True)
class Component:
    """A number of what is observed, or of an action.

    Attributes:
        means: What it is.
        of: Of which joint or finger, or along which axis; empty where there is one alone.
        unit: Its unit; 1 for a share.
        low: Least value.
        high: Largest value.
    """

    means: str
    of: str
    unit: str
    low: float
    high: float


#: Bodies that a picture need not show all of; the faces of such.
_BESIDE = ("world", "ball", "belt")
_NO_FACES = np.zeros((0, 3, 3)), np.zeros((0, 3))


class Environment(gymnasium.Env[Observation, Numbers], ABC):
    """An arm that an agent drives, a tick or some at a time: what the environments share.

    A task says what comes (``_come``), when an episode is over and when it is late, how far the
    hand is from what it is to reach, what an end and its success are called, and what that is
    worth.

    Attributes:
        arm: The arm.
        world: Its world.
        scene: Settings of the world.
        ticks: Milliseconds that an action lasts.
        senses: What was sensed in the last action, where somebody asked.
        watched: Whether somebody asks.
        pixels: Whether images are observed.
        thing_is: What comes, in a word.
        good: The status of a success.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012
    pixels = False
    thing_is = "ball"
    good = ""
    _begun = False
    _hand_acts = True
    _judged_by_world = False
    _catcher: Catcher

    def _set_up(
        self,
        render_mode: str | None,
        scene: Scene,
        action: str,
        ticks: int,
        size: tuple[int, int],
    ) -> None:
        """Take what every environment is told."""
        names = ("width", "height")
        width, height = (
            checks.whole(name, x, least=1, most=_LARGEST)
            for name, x in zip(names, size, strict=True)
        )
        self._size = width, height
        checks.one_of("action", action, ("torque", "residual"))
        if render_mode is not None:
            checks.one_of("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode, self._action, self.scene = render_mode, action, scene
        if scene.actuation.takes != "torque":
            raise InputError("scene", "a robot that takes torques", scene.actuation.takes)
        self.ticks = checks.whole("ticks", ticks, least=1)
        self.metadata = {**self.metadata, "render_fps": max(round(1.0 / (TICK * ticks)), 1)}

    def _take(self, arm: Arm, world: World, closed: float) -> None:
        """Take the arm, its world, and the closing of the hand that closes it."""
        self.arm, self.world, self._closed = arm, world, closed
        ball = world.model.joint("ball")
        self._free, self._fast = int(ball.qposadr[0]), int(ball.dofadr[0])
        self._drawn: tuple[mujoco.MjModel, list[Faces], View] | None = None
        self._middle = 0.5 * (arm.q_max + arm.q_min)
        self._half = 0.5 * (arm.q_max - arm.q_min)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.acted()),), np.float32)
        self._high = np.array([x.high for x in self.observed()])
        self.observation_space = self._space()
        self.senses: list[Senses] = []
        self.watched = False
        self._links, self._active = np.zeros((3, len(arm.model.links))), [*arm.model.active]

    @abstractmethod
    def fresh_catcher(self) -> Catcher:
        """Return a catcher that has seen nothing yet."""

    @abstractmethod
    def _come(self) -> None:
        """Let something come, and take a fresh catcher where one is needed."""

    @abstractmethod
    def _over(self) -> bool:
        """Say whether nothing more can happen."""

    @abstractmethod
    def _late(self, *, over: bool) -> bool:
        """Say whether an episode ends for its time alone."""

    @abstractmethod
    def _away(self) -> float:
        """Return how far the hand is from what it is to reach [m]."""

    @abstractmethod
    def _in_view(self) -> Array:
        """Return points that a picture is to show beside the arm [m], shape (k, 3)."""

    @abstractmethod
    def _outcome(self) -> dict[str, Any]:
        """Return the ``status`` of an episode that has ended, and what else is said of it."""

    @abstractmethod
    def _success(self, info: dict[str, Any]) -> float:
        """Return which share of the largest reward an episode that ended so has earned."""

    @property
    def views(self) -> list[tuple[Frame, ...]]:
        """Looks at the scene before the throw; none without images."""
        return []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Let something else come; the same seed brings the same."""
        seed = None if seed is None else checks.whole("seed", seed, least=0)
        if options is not None:
            checks.instance("options", options, dict)
        super().reset(seed=seed, options=options)
        self._begun, self._touched, self.senses = True, False, []
        self._told, self._driven = list[Array](), list[NDArray[np.bool_]]()
        self._come()
        self._compiled = self._plays_compiled()
        r, dr = self.thing()
        about = {"is_success": False, "object_m": r.copy(), "object_m_s": dr.copy()}
        return self._observed(), about

    def step(self, action: Numbers) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for some milliseconds."""
        given = self._given(action)
        self.senses = []
        told, driven, over = self._held(given) if self._compiled else self._ticked(given)
        self._told.append(told)
        self._driven.append(driven)
        reward = self._touch_gain() - TICK * len(told) * self._cost(told[-1, 3])
        late = self._late(over=over)
        info = self._ended() if over or late else {}
        reward += _SUCCESS * self._success(info) if info else 0.0
        return self._observed(), reward, over and not late, late, info

    def _plays_compiled(self) -> bool:
        """Say whether an action is played in compiled code: where the world judges."""
        asked = self.residual or self.watched or self.pixels
        return self._judged_by_world and not asked and self.world.moves_plainly

    def _held(self, given: Array) -> tuple[Array, NDArray[np.bool_], bool]:
        """Act, in compiled code; return as :meth:`_ticked` does."""
        n, told = self.arm.n, np.full((self.ticks, 4, self.arm.n), np.nan)
        wanted, hand = given[:n] * self.arm.tau_max, self._closing(given[n])
        ticks = self.world.hold_torques(
            wanted, hand, self.arm.limits, told, longest=LONGEST, held=HELD_AFTER
        )
        return told[:ticks], np.ones(ticks, bool), self._over()

    def _ticked(self, given: Array) -> tuple[Array, NDArray[np.bool_], bool]:
        """Act, tick by tick.

        Returns:
            What the joints were told in each tick, shape (ticks, 4, n), whether it was by the
            drives, shape (ticks,), and whether nothing more can happen.
        """
        told, driven, over = np.full((self.ticks, 4, self.arm.n), np.nan), list[bool](), False
        for k in range(self.ticks):
            command = self._command(self._sensed(k), given)
            self.world.apply(command)
            if self.residual:
                told[k] = command.joints
            told[k, 3] = command.tau
            driven.append(not command.brakes)
            over = self._over()
            if over:
                break
        return told[: len(driven)], np.array(driven), over

    def _sensed(self, k: int) -> Senses | None:
        """Return what is sensed in tick ``k`` of an action; None where nobody asks."""
        if not (self.residual or self.watched or self.pixels):
            return None
        senses = self.world.sense(look=self._looks(k))
        self.senses.append(senses)
        return senses

    def _looks(self, k: int) -> bool:
        """Say whether the cameras expose in a tick of an action."""
        if self.residual:
            return self._catcher.looking
        sensing = self.scene.sensing
        first = self.ticks - 1 - sensing.image_latency if sensing.frame_rate >= 1.0 / TICK else 0
        return self.watched or (self.pixels and k >= first)

    def _command(self, senses: Senses | None, given: Array) -> Command:
        """Return what arm and hand are told in a tick."""
        n, tau = self.arm.n, np.zeros((4, self.arm.n))
        if senses is None or not self.residual:
            tau[3] = self._within(given[:n] * self.arm.tau_max)
            hand = self._closing(given[n]) if self._hand_acts else 0.0
            return Command(self.world.t, tau, hand)
        command = self._catcher.step(senses)
        if self._catcher.stopped_by is not None:
            self.world.watch_on()
        self._catcher.think()
        if not np.any(given) or command.brakes:
            return command
        joints = command.joints.copy()
        joints[3] = self._within(joints[3] + _RESIDUAL * given * self.arm.tau_max)
        return command._replace(joints=joints)

    def _given(self, action: Numbers) -> Array:
        """Return an action within its bounds; refuse another shape, or one before an episode."""
        if not self._begun:
            raise InputError(
                "step",
                "an environment that was reset",
                "one that was not yet",
                do="call reset first",
            )
        given = checks.array("action", action, self.action_space.shape or (), finite=True)
        return np.clip(given, -1.0, 1.0)

    def _cost(self, tau: Array) -> float:
        """Return what a second costs now, with a torque [N m]."""
        effort = tau / self.arm.tau_max
        work = float(effort @ effort) / len(effort)
        return _DISTANCE * min(self._away(), 2.0) + _EFFORT * work

    def _closing(self, given: float) -> float:
        """Return how far the hand is told to close."""
        return float(0.5 * (1.0 + given) * self._closed)

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of arm and ball or part, drawn in software, shape (height, width, 3)."""
        if self.render_mode is None:
            return None
        if self._drawn is None:
            self._drawn = self._prepared()
        model, faces, view = self._drawn
        placed = placed_faces(model, faces, self.world.data.qpos, np.zeros((0, 3)))
        return np.array(painted(*placed, self.scene.floor, view=view), np.uint8)

    def _prepared(self) -> tuple[mujoco.MjModel, list[Faces], View]:
        """Return what is drawn, and a view in which the arm and what comes to it are seen."""
        model = self.world.model
        faces = [body_faces(model, b, self.arm, self.scene) for b in range(model.nbody)]
        beside = [model.body(b).name in _BESIDE for b in range(model.nbody)]
        arm = [_NO_FACES if x else own for x, own in zip(beside, faces, strict=True)]
        ready = mujoco.MjData(model).qpos
        ready[: self.arm.n] = self.arm.model.q_ready
        corners = placed_faces(model, arm, ready, np.zeros((0, 3)))[0].reshape(-1, 3)
        points = np.concatenate([corners, self._in_view()])
        return model, faces, framed(points, *_FROM, size=self._size)

    @property
    def residual(self) -> bool:
        """Whether actions are added to what the catcher commands."""
        return self._action == "residual"

    def as_action(self, tau: Array, hand: float) -> Numbers:
        """Return a torque [N m], shape (n,), and a closing angle [rad] as an action ``torque``."""
        tau = checks.vector("tau", tau, self.arm.n, finite=True)
        hand = checks.number("hand", hand, finite=True)
        shares = [*(tau / self.arm.tau_max), 2.0 * hand / self._closed - 1.0]
        out: Numbers = np.clip(shares, -1.0, 1.0).astype(np.float32)
        return out[: spaces.flatdim(self.action_space)]

    def _within(self, tau: Array) -> Array:
        """Return torques as the drives can give them at the joints' speeds."""
        links, active = self._links, self._active
        links[0, active], links[1, active] = tau, self.world.data.qvel[: self.arm.n]
        saturate(self.arm.limits.packed, links[0], links[1], links[2])
        return links[2, active]

    def observed(self) -> tuple[Component, ...]:
        """Return what each number of :meth:`whole` is: joints, hand, ball or part."""
        joints, fingers = self.arm.names, map(str, range(1, self._free - self.arm.n + 1))
        what, axes = self.thing_is, ("x", "y", "z")
        kinds = (
            ("joint angle, in its range", joints, "1", _BENT),
            ("joint speed, of its limit", joints, "1", _SPIN),
            ("finger angle", fingers, "rad", _SPIN),
            ("catch point", axes, "m", FAR),
            (what, axes, "m", FAR),
            (f"velocity of the {what}", axes, "m/s", FAST),
        )
        return tuple(
            Component(means, of, unit, -high, high)
            for means, names, unit, high in kinds
            for of in names
        )

    def acted(self) -> tuple[Component, ...]:
        """Return what each number of an action is."""
        means = "torque, of its largest"
        if self.residual:
            means = f"torque added, of {_RESIDUAL:g} of its largest"
        torques = tuple(Component(means, x, "1", -1.0, 1.0) for x in self.arm.names)
        closes = self._hand_acts and not self.residual
        return (*torques, Component(_CLOSES, "", "1", -1.0, 1.0)) if closes else torques

    def thing(self) -> tuple[Array, Array]:
        """Return the true position [m] and velocity [m/s] of ball or part, shape (3,) each."""
        r, dr = self._free, self._fast
        return self.world.data.qpos[r : r + 3], self.world.data.qvel[dr : dr + 3]

    def whole(self) -> Numbers:
        """Return joints, hand, and ball or part, as :meth:`observed` says."""
        arm, n, qpos = self.arm, self.arm.n, self.world.data.qpos
        out = np.empty(len(self._high))
        out[:n] = (qpos[:n] - self._middle) / self._half
        out[n : 2 * n] = self.world.data.qvel[:n] / arm.dq_max
        out[2 * n : -9] = qpos[n : self._free]
        out[-9:-6] = self.world.catch_point
        out[-6:-3], out[-3:] = self.thing()
        np.minimum(np.maximum(out, -self._high, out=out), self._high, out=out)
        return out.astype(np.float32)

    def joints(self) -> Numbers:
        """Return what :meth:`whole` does but for the ball or part."""
        return self.whole()[:-6]

    def whole_space(self) -> spaces.Box:
        """Return the space of :meth:`whole`."""
        high = self._high.astype(np.float32)
        return spaces.Box(-high, high, dtype=np.float32)

    def _space(self) -> spaces.Space[Any]:
        """Return the space of what is observed: joints, and ball or part."""
        return self.whole_space()

    def _observed(self) -> Observation:
        """Return what is observed now."""
        return self.whole()

    def _touch_gain(self) -> float:
        """Return the reward of the first touch, in the action that brings it."""
        touch = self._first_touch()
        return 0.0 if touch is None else TOUCH / (1.0 + touch.velocity_error)

    def _first_touch(self) -> Instant | None:
        """Return the first touch, in the action that brings it; None before and after."""
        touch = None if self._touched else self.world.first_contact
        self._touched = self._touched or touch is not None
        return touch

    def _ended(self) -> dict[str, Any]:
        """Return what became of an episode: its outcome, ticks beyond a limit, the contact.

        Where the physics diverged, the numbers of its ticks mean nothing, and are not counted.
        """
        outcome = self._outcome()
        outcome["is_success"] = outcome["status"] == self.good
        if self.world.diverged:
            return {**outcome, **self._contact()}
        commanded, driven = np.concatenate(self._told), np.concatenate(self._driven)
        trace, arm, k = self.world.trace(), self.arm, len(driven)
        rows = slice(-k - 1, -1)
        drives = drive_loads(arm, trace.q[rows], trace.dq[rows], trace.tau[-k:])
        beyond = ticks_beyond(arm, trace, drives, commanded, driven=driven)
        shares = continuous_shares(arm, np.sum(drives.torque**2, axis=0), len(drives.torque))
        violations = int(np.sum(beyond)) + overheated(shares)
        return {**outcome, "limit_violations": violations, **self._contact()}

    def _contact(self) -> dict[str, float]:
        """Return the largest force on ball or part, and its errors at the first contact, if any."""
        contact, said = self.world.first_contact, {}
        if contact is not None:
            said = {
                "position_error_m": contact.position_error,
                "velocity_error_m_s": contact.velocity_error,
            }
        return {"peak_contact_force_n": float(self.world.peak_force), **said}
