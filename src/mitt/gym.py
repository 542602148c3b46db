"""Tasks as Gymnasium environments: ``mitt/Catch-v0``, ``mitt/CatchPixels-v0``.

Parts on a belt, or in a hand, are met in ``mitt/Meet-v0``, and balls hit back in ``mitt/Bat-v0``,
with keywords of their own: :class:`MeetEnv`, :class:`BatEnv`.

    import gymnasium, mitt.gym
    env = gymnasium.make("mitt/Catch-v0", scene="lab", action="residual", map="MAP.json")

| keyword  | what                                                                                |
|----------|-------------------------------------------------------------------------------------|
| `arm`    | an arm as of ``mitt.load_arm``, its name or file; it needs a hand                   |
| `limits` | its limit set; its own if left out, ``paper`` for the WAM                           |
| `scene`  | the world: a ``Scene``, the name or the file of one                                 |
| `action` | `torque`: of each joint as a share of its largest, and the closing of the hand;     |
|          | `residual`: torque on top of what the catcher with the map commands                 |
| `map`    | for `residual` and :func:`map_policy`: a learned map or its file; learned if needed |
| `ticks`  | milliseconds that an action lasts                                                   |

docs/gym.md says what is observed and rewarded.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.errors import InputError, MissingPackageError

try:
    import gymnasium
    from gymnasium import spaces
except ImportError:
    raise MissingPackageError("mitt.gym", "gymnasium", "gym") from None

from mitt.core.arm.arm import Arm
from mitt.core.arm.limits import saturate
from mitt.core.arm.tools import TOOLS
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.given import check_arm
from mitt.core.catcher.meeting import Meeting
from mitt.core.catcher.settings import Phase
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import TICK, Array, Command, Frame, Senses
from mitt.io.arm_file import arm_with_hand
from mitt.io.maps import read_map
from mitt.lab.report.painter import Faces, painted
from mitt.lab.report.pictures import body_faces, placed_faces
from mitt.lab.trials.bat_station import TARGET, BatStation, bat_station
from mitt.lab.trials.landing import batted, hit_of
from mitt.lab.trials.runner import LONGEST, TrialRunner
from mitt.lab.trials.score import (
    HELD_AFTER,
    continuous_shares,
    drive_loads,
    overheated,
    ticks_beyond,
    trial_status,
    was_held,
)
from mitt.lab.trials.source import source_of, widened
from mitt.lab.trials.station import PARTS_SCENE, TARGETS, station
from mitt.lab.world.scene import Scene, scene_from
from mitt.lab.world.simulation import World
from mitt.lab.world.truth import Instant
from mitt.robot.cell.feeds import Parts

__all__ = ["BatEnv", "CatchEnv", "CatchPixelsEnv", "Environment", "MeetEnv", "map_policy"]

Observation: TypeAlias = Any
Numbers: TypeAlias = NDArray[np.float32]

#: Bounds of what is observed: positions [m], speeds [m/s], joint speeds in shares of their limits.
FAR = 10.0
FAST = 20.0
_SPIN = 4.0
#: Residual torque of a full action, as a share of the joint's largest; ours.
_RESIDUAL = 0.2
#: Rewards: for a ball that is held, for the first touch, per second and metre of distance, per
#: second of full torque; choices of this project.
_HELD = 10.0
_TOUCH = 1.0
_DISTANCE = 1.0
_EFFORT = 0.05
#: The same per second and m/s of difference in velocity, for a part that is to be met; time after
#: which a part has not been taken [s].
_SLIP = 0.5
_LATE = 10.0
#: Landing error at which the reward is half of its largest [m]; for how long the path of a ball
#: is known, and the time between two of its places [s].
_HALF = 0.25
_FLIES = 2.0
_STRIDE = 0.01


class Environment(gymnasium.Env[Observation, Numbers], ABC):
    """An arm that an agent drives, a tick or some at a time: what the environments share.

    A task says what comes (``_come``), when an episode is over and when it is late, how far the
    hand is from what it is to reach, what an end is called, and what its success is worth.

    Attributes:
        arm: The arm.
        world: Its world.
        scene: Settings of the world.
        ticks: Milliseconds that an action lasts.
        senses: What was sensed in the last action, where somebody asked.
        watched: Whether somebody asks.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012
    pixels = False
    _begun = False
    _catcher: Catcher

    def _set_up(self, render_mode: str | None, scene: Scene, action: str, ticks: int) -> None:
        """Take what every environment is told."""
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
        self._drawn: tuple[mujoco.MjModel, list[Faces]] | None = None
        sides = arm.n + 1 if self._action == "torque" else arm.n
        self.action_space = spaces.Box(-1.0, 1.0, (sides,), np.float32)
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
        self._told, self._driven = list[Array](), list[bool]()
        self._come()
        return self._observed(), {}

    def step(self, action: Numbers) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for some milliseconds."""
        given, world, nothing = self._given(action), self.world, np.full((3, self.arm.n), np.nan)
        self.senses, over = [], False
        for k in range(self.ticks):
            command = self._command(self._sensed(k), given)
            world.apply(command)
            told = command.joints.copy() if self.residual else np.array([*nothing, command.tau])
            self._told.append(told)
            self._driven.append(not command.brakes)
            over = self._over()
            if over:
                break
        reward = self._touch_gain() - TICK * (k + 1) * self._cost(command.tau)
        late = self._late(over=over)
        info = self._ended() if over or late else {}
        reward += _HELD * self._success(info) if info else 0.0
        return self._observed(), reward, over and not late, late, info

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
            hand = self._closing(given[n]) if len(given) > n else 0.0
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
        """Return a picture, drawn in software, shape (262, 340, 3)."""
        if self.render_mode is None:
            return None
        if self._drawn is None:
            model = self.world.model
            faces = [body_faces(model, b, self.arm, self.scene) for b in range(model.nbody)]
            self._drawn = model, faces
        qpos = self.world.data.qpos.copy()
        picture = painted(*placed_faces(*self._drawn, qpos, np.zeros((0, 3))), self.scene.floor)
        return np.array(picture, np.uint8)

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

    def joints(self) -> Numbers:
        """Return joint angles in their ranges, speeds in shares of their limits, catch point."""
        arm, n, data = self.arm, self.arm.n, self.world.data
        middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
        q = np.clip((data.qpos[:n] - middle) / half, -2.0, 2.0)
        dq = np.clip(data.qvel[:n] / arm.dq_max, -_SPIN, _SPIN)
        fingers = np.clip(data.qpos[n : self._free], -_SPIN, _SPIN)
        place = np.clip(self.world.catch_point, -FAR, FAR)
        return np.concatenate([q, dq, fingers, place]).astype(np.float32)

    def bounds(self) -> Numbers:
        """Return the upper bounds of :meth:`joints`; the lower ones are their negatives."""
        n, fingers = self.arm.n, self._free - self.arm.n
        sides = [np.full(n, 2.0), np.full(n + fingers, _SPIN), np.full(3, FAR)]
        return np.concatenate(sides).astype(np.float32)

    def thing(self) -> tuple[Array, Array]:
        """Return the true position [m] and velocity [m/s] of ball or part, shape (3,) each."""
        r, dr = self._free, self._fast
        return self.world.data.qpos[r : r + 3], self.world.data.qvel[dr : dr + 3]

    def whole(self) -> Numbers:
        """Return joints, and ball or part."""
        r, dr = self.thing()
        ball = np.clip(r, -FAR, FAR), np.clip(dr, -FAST, FAST)
        return np.concatenate([self.joints(), *ball]).astype(np.float32)

    def whole_space(self) -> spaces.Box:
        """Return the space of :meth:`whole`."""
        ball = np.array([FAR] * 3 + [FAST] * 3, np.float32)
        high = np.concatenate([self.bounds(), ball])
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
        return 0.0 if touch is None else _TOUCH / (1.0 + touch.velocity_error)

    def _first_touch(self) -> Instant | None:
        """Return the first touch, in the action that brings it; None before and after."""
        touch = None if self._touched else self.world.first_contact
        self._touched = self._touched or touch is not None
        return touch

    def _ended(self) -> dict[str, Any]:
        """Return what became of an episode: its outcome, ticks beyond a limit, the contact.

        Where the physics diverged, the numbers of its ticks mean nothing, and are not counted.
        """
        if self.world.diverged:
            return {**self._outcome(), **self._contact()}
        trace, arm, k = self.world.trace(), self.arm, len(self._told)
        rows = slice(-k - 1, -1)
        drives = drive_loads(arm, trace.q[rows], trace.dq[rows], trace.tau[-k:])
        commanded, driven = np.array(self._told), np.array(self._driven)
        beyond = ticks_beyond(arm, trace, drives, commanded, driven=driven)
        shares = continuous_shares(arm, np.sum(drives.torque**2, axis=0), len(drives.torque))
        violations = int(np.sum(beyond)) + overheated(shares)
        return {**self._outcome(), "limit_violations": violations, **self._contact()}

    def _contact(self) -> dict[str, float]:
        """Return the largest force on ball or part, and its errors at the first contact, if any."""
        contact, said = self.world.first_contact, {}
        if contact is not None:
            said = {
                "position_error_m": contact.position_error,
                "velocity_error_m_s": contact.velocity_error,
            }
        return {"peak_contact_force_n": float(self.world.peak_force), **said}


class _Catching(Environment):
    """What both environments of catching share."""

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        arm: Arm | str | Path = "wam",
        limits: str | None = None,
        scene: Scene | str | Path | None = None,
        action: Literal["torque", "residual"] = "torque",
        map: DirectMap | Learned | str | Path | None = None,  # noqa: A002 (its name outside)
        ticks: int = 5,
    ) -> None:
        """Build the world; arguments as of :mod:`mitt.gym`."""
        self._set_up(render_mode, scene_from(scene), action, ticks)
        limits = None if limits is None else checks.text("limits", limits)
        self.arm, said = (arm, None) if isinstance(arm, Arm) else arm_with_hand(arm, limits=limits)
        self._design = default_design(self.arm)
        source = source_of(
            self.arm, seed=0, count=1, drag=self.scene.ball.drag, spinning=self.scene.ball.spinning
        )
        if said is not None and said.throws is not None:
            source = widened(source, said.throws)
        self._source = source
        self._map = self._checked(map)
        f = None if action == "torque" else self.map
        base = f or unlearned(self.arm, self._design)
        self._runner = TrialRunner(self.arm, Direct(base), self.scene, pixels=self.pixels)
        hand, self._catcher = self.arm.model.hand, self._runner.catcher()
        self._take(self.arm, self._runner.world, 1.2 * (1.0 if hand is None else hand.closed))

    @property
    def map(self) -> DirectMap:
        """The map; learned now if it was not given, which takes some seconds."""
        if self._map is None:
            self._map = learn(self.arm, design=self._design).map
        return self._map

    def _checked(self, given: object) -> DirectMap | None:
        """Return the map that was given, for this arm; None where it is still to be learned."""
        if isinstance(given, str | Path):
            given = read_map(checks.path("map", given), self.arm)
        given = given.map if isinstance(given, Learned) else given
        if given is None:
            return None
        f = checks.instance("map", given, DirectMap)
        check_arm(self.arm, f)
        return f

    def _come(self) -> None:
        """Throw another ball."""
        ball = self._source.drawn(self.np_random)
        self._catcher = self._runner.release(ball, seed=int(self.np_random.integers(2**62)))
        self.images = np.zeros((2, *self.shape()), np.uint8)
        for frame in self._runner.views[-1] if self._runner.views else ():
            self.images[frame.camera] = frame.pixels

    def fresh_catcher(self) -> Catcher:
        """Return a catcher of the map that has seen nothing yet."""
        runner = TrialRunner(self.arm, Direct(self.map), self.scene, pixels=self.pixels)
        return runner.catcher()

    @property
    def views(self) -> list[tuple[Frame, ...]]:
        """Looks at the scene before the throw; none without images."""
        return self._runner.views

    def _sensed(self, k: int) -> Senses | None:
        """Return what is sensed in tick ``k`` of an action, and keep the newest images."""
        senses = super()._sensed(k)
        for frame in () if senses is None else senses.frames:
            self.images[frame.camera] = frame.pixels
        return senses

    def _over(self) -> bool:
        """Say whether the ball is held, or can be touched no more."""
        return self.world.over(longest=LONGEST, held=HELD_AFTER)

    def _late(self, *, over: bool) -> bool:
        """Say whether no ball came to the hand in time."""
        return over and self.world.first_contact is None and self.world.t >= LONGEST

    def _away(self) -> float:
        """Return how far the ball is from the catch point [m]."""
        gap = self.thing()[0] - self.world.catch_point
        return float(np.sqrt(gap @ gap))

    def _outcome(self) -> dict[str, Any]:
        """Return what became of the throw."""
        phase = self._catcher.phase if self.residual else Phase.WATCH
        refused, held = self.residual and self._catcher.refused, was_held(self.arm, self.world)
        return {"status": trial_status(self.world, phase, refused=refused, was_held=held)}

    def _success(self, info: dict[str, Any]) -> float:
        """Return 1 for a ball that is held."""
        return float(info["status"] == "caught")

    def shape(self) -> tuple[int, int]:
        """Return the size of the images; none where there are none."""
        camera = self._runner.rig.cameras[0]
        return (camera.height, camera.width) if self.pixels else (0, 0)


@final
class CatchEnv(_Catching):
    """``mitt/Catch-v0``: joints, and the true position and velocity of the ball."""


@final
class CatchPixelsEnv(_Catching):
    """``mitt/CatchPixels-v0``: joints, and the newest image of each of two cameras."""

    pixels = True

    def _space(self) -> spaces.Space[Any]:
        """Return boxes: ``joints`` and ``images``."""
        high, shape = self.bounds(), (2, *self.shape())
        return spaces.Dict(
            {
                "joints": spaces.Box(-high, high, dtype=np.float32),
                "images": spaces.Box(0, 255, shape, np.uint8),
            }
        )

    def _observed(self) -> dict[str, Any]:
        """Return joints and images."""
        return {"joints": self.joints(), "images": self.images.copy()}


@final
class MeetEnv(Environment):
    """``mitt/Meet-v0``: joints, and the true position and velocity of a part that comes by."""

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        arm: str | Path = "ur5e",
        tip: str | None = None,
        joints: Sequence[str] | None = None,
        limits: str | None = None,
        tool: Literal["suction", "jaw"] = "suction",
        target: Literal["belt", "hand"] = "belt",
        speed: float = 0.3,
        gripper_delay: float = 0.05,
        scene: Scene | str | Path | None = None,
        action: Literal["torque", "residual"] = "torque",
        ticks: int = 5,
    ) -> None:
        """Build the station and its world.

        Args:
            render_mode: As of Gymnasium.
            arm: Name or file of an arm.
            tip: Frame of a description file at which the tool is mounted.
            joints: Joints of the file that move.
            limits: Its limit set; its own if left out.
            tool: What takes the part.
            target: What moves it.
            speed: Mean speed of the belt, or largest of the hand [m/s].
            gripper_delay: From the command until the tool acts [s].
            scene: The world; a camera of 60 Hz, 30 ms late, in ``lab`` if left out.
            action: As of :mod:`mitt.gym`.
            ticks: Milliseconds that an action lasts.
        """
        checks.one_of("tool", tool, tuple(TOOLS))
        checks.one_of("target", target, TARGETS)
        delay = checks.number("gripper_delay", gripper_delay, least=0.0, most=2.0)
        self._speed = checks.number("speed", speed, least=0.01, most=5.0)
        limits = None if limits is None else checks.text("limits", limits)
        scene = PARTS_SCENE if scene is None else scene_from(scene)
        self._set_up(render_mode, scene, action, ticks)
        at = station(
            checks.path("arm", arm),
            replace(TOOLS[tool], delay=delay),
            target,
            scene,
            tip=tip,
            joints=joints,
            limits=limits,
        )
        self._at, self.scene = at, at.scene
        self._take(at.arm, World(at.scene, at.arm.model, limits=at.arm.limits), TOOLS[tool].closed)
        self._catcher, self._parts = self.fresh_catcher(), self._drawn_parts(0)

    def fresh_catcher(self) -> Catcher:
        """Return a catcher that meets parts by the map."""
        return Catcher(
            self.arm, Meeting(self._at.map, self._at.settings), settings=self._at.catcher
        )

    def _drawn_parts(self, seed: int) -> Parts:
        """Return what brings a part."""
        put = tuple(self._at.place.tolist())
        return Parts(self._at, speed=self._speed, seed=seed, count=1, put=put)

    def _closing(self, given: float) -> float:
        """Return how far the tool is told to close: nothing up to the middle of its action."""
        return float(max(given, 0.0) * self._closed)

    def _come(self) -> None:
        """Bring another part."""
        self._parts = self._drawn_parts(int(self.np_random.integers(2**31)))
        self.world.reset(self._parts.bring(0), self._parts.seed(0))
        self._catcher = self.fresh_catcher()

    def _over(self) -> bool:
        """Say whether the part was met, or has gone by."""
        parts, world = self._parts, self.world
        return parts.over(world, world.truth(), ready=True) or parts.held

    def _late(self, *, over: bool) -> bool:
        """Say whether the part was not taken in time."""
        return not over and self.world.t >= _LATE

    def _away(self) -> float:
        """Return how far the part is from the tool [m]."""
        return float(np.linalg.norm(self.thing()[0] - self.world.catch_point))

    def _cost(self, tau: Array) -> float:
        """Return what a second costs now; also for the difference of tool and part in velocity."""
        q, dq = self.world.data.qpos[: self.arm.n], self.world.data.qvel[: self.arm.n]
        slip = float(np.linalg.norm(self.thing()[1] - self.arm.jacobian(q) @ dq))
        return super()._cost(tau) + _SLIP * min(slip, 2.0)

    def _outcome(self) -> dict[str, Any]:
        """Return what became of the part."""
        if self._catcher.phase is Phase.STOPPED:
            return {"status": "stopped"}
        return {"status": self._parts.ended(self.world)["status"]}

    def _success(self, info: dict[str, Any]) -> float:
        """Return 1 for a part that was met."""
        return float(info["status"] == "met")


@final
class BatEnv(Environment):
    """``mitt/Bat-v0``: joints, and the true position and velocity of a ball to be hit back."""

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        arm: str | Path = "wam",
        limits: str | None = None,
        target: tuple[float, float, float] = TARGET,
        action: Literal["torque", "residual"] = "torque",
        ticks: int = 5,
        scene: Scene | str | Path | None = None,
    ) -> None:
        """Build the arm, its paddle and their world.

        Args:
            render_mode: As of Gymnasium.
            arm: Name of an arm that has a stance, or an arm file of one.
            limits: Its limit set; its own if left out.
            target: Where balls are to go [m].
            action: As of :mod:`mitt.gym`.
            ticks: Milliseconds that an action lasts.
            scene: The world; ``lab`` if left out.
        """
        self._set_up(render_mode, scene_from(scene), action, ticks)
        self._name, self._learned = checks.path("arm", arm), action == "residual"
        self._limits = None if limits is None else checks.text("limits", limits)
        self._target = checks.vector("target", target, 3, finite=True)
        self._at = self._station()
        at = self._at
        self._take(at.arm, World(at.scene, at.arm.model, limits=at.arm.limits), 1.0)
        self.action_space = spaces.Box(-1.0, 1.0, (at.arm.n,), np.float32)
        self._source = source_of(
            at.arm, seed=0, count=1, drag=self.scene.ball.drag, spinning=self.scene.ball.spinning
        )
        self._times = np.arange(0.0, _FLIES, _STRIDE)
        self._path = np.zeros((len(self._times), 3))
        self._catcher = Catcher(at.arm, at.batting, settings=at.catcher)

    def _station(self) -> BatStation:
        """Return the arm where it bats."""
        return bat_station(
            self._name,
            scene=self.scene,
            target=self._target,
            limits=self._limits,
            learns=self._learned,
        )

    def fresh_catcher(self) -> Catcher:
        """Return a catcher that strikes by the map, which is learned if it was not yet."""
        if not self._learned:
            self._learned = True
            self._at = self._station()
        return Catcher(self.arm, self._at.batting, settings=self._at.catcher)

    def _come(self) -> None:
        """Throw another ball."""
        ball = self._source.drawn(self.np_random)
        self.world.reset(ball, int(self.np_random.integers(2**31)))
        flight = self.world.flight
        self._path = np.array([flight(t)[0] for t in self._times.tolist()])
        if self.residual:
            self._catcher = self.fresh_catcher()

    def _over(self) -> bool:
        """Say whether nothing more can happen to the ball."""
        return batted(self.world, self._at.target)

    def _late(self, *, over: bool) -> bool:
        """Say whether no ball came to the paddle in time."""
        world = self.world
        happened = world.first_contact is not None or world.truth().ball_on_floor
        return over and not (happened or world.diverged)

    def _touch_gain(self) -> float:
        """Return the reward of the first touch, however fast, in the action that brings it."""
        return 0.0 if self._first_touch() is None else _TOUCH

    def _away(self) -> float:
        """Return how far the paddle is from where the ball will pass [m]; 0 after the contact."""
        ahead = self._path[self._times >= self.world.t]
        if self.world.first_contact is not None or not len(ahead):
            return 0.0
        return float(np.linalg.norm(ahead - self.world.catch_point, axis=1).min())

    def _outcome(self) -> dict[str, Any]:
        """Return what became of the ball."""
        hit = hit_of(self.arm, self.world, self._at.target)
        if self.world.diverged:
            return {"status": "aborted", "is_success": False}
        if self.residual and self._catcher.phase is Phase.STOPPED:
            return {"status": "stopped", "is_success": False}
        if hit is None:
            return {"status": "missed", "is_success": False}
        landing = {} if hit.landing is None else {"landing_m": hit.landing}
        return {
            "status": "returned" if hit.returned else "wide",
            "is_success": hit.returned,
            **landing,
            "return_speed_m_s": hit.speed,
        }

    def _success(self, info: dict[str, Any]) -> float:
        """Return the more the nearer to the target a ball lands, 1 at the target."""
        return 1.0 / (1.0 + info["landing_m"] / _HALF) if "landing_m" in info else 0.0


def map_policy(env: gymnasium.Env[Any, Any]) -> Callable[[Observation], Numbers]:
    """Return the map as a policy of an environment, as a baseline.

    For actions ``residual`` it adds nothing. For ``torque`` a catcher of its own goes along with
    the same senses, images or points, and its last torque is the action; with ``ticks=1`` that is
    the catcher itself, with more its torque is held too long.

    Args:
        env: One of this module, wrapped or not.
    """
    raw = checks.instance("env", env, gymnasium.Env).unwrapped
    if not isinstance(raw, Environment):
        raise InputError("env", "an environment of mitt.gym", checks.shown(env))
    if raw.residual:
        return lambda _: np.zeros(raw.action_space.shape or (), np.float32)
    raw.watched = True
    return _MapPolicy(raw).act


@final
class _MapPolicy:
    """A catcher that goes along with an environment; see :func:`map_policy`."""

    def __init__(self, env: Environment) -> None:
        self._env, self._catcher = env, env.fresh_catcher()
        self._last = Command(0.0, np.zeros((4, 0)), 0.0)

    def act(self, _: Observation) -> Numbers:
        """Return torque and closing of the last of the ticks since the last action."""
        env = self._env
        if not env.senses:
            self._catcher = env.fresh_catcher()
            if env.views:
                self._catcher.learn_background(env.views)
            return env.as_action(np.zeros(env.arm.n), 0.0)
        for senses in env.senses:
            self._last = self._catcher.step(senses)
            self._catcher.think()
        return env.as_action(self._last.tau, self._last.hand)


gymnasium.register(id="mitt/Catch-v0", entry_point="mitt.gym:CatchEnv")
gymnasium.register(id="mitt/CatchPixels-v0", entry_point="mitt.gym:CatchPixelsEnv")
gymnasium.register(id="mitt/Meet-v0", entry_point="mitt.gym:MeetEnv")
gymnasium.register(id="mitt/Bat-v0", entry_point="mitt.gym:BatEnv")
