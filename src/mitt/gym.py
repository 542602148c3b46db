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
from mitt.lab.trials.batting import batted, hit_of
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
#: Miss at which the reward of a hit is half of its largest [m]; for how long the path of a ball is
#: known, and the time between two of its places [s].
_HALF = 0.25
_FLIES = 2.0
_STRIDE = 0.01


class Driven(gymnasium.Env[Observation, Numbers]):
    """What all environments share: an arm that an agent drives, a tick or some at a time.

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
    _touched: bool

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

    def fresh_catcher(self) -> Catcher:
        """Return a catcher that has seen nothing yet."""
        raise NotImplementedError

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

    def _seeded(self, seed: int | None, options: dict[str, Any] | None) -> None:
        """Take the seed of an episode."""
        seed = None if seed is None else checks.whole("seed", seed, least=0)
        if options is not None:
            checks.instance("options", options, dict)
        super().reset(seed=seed, options=options)
        self._begun = True

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

    def _acted(self, action: Numbers, over: Callable[[], bool]) -> tuple[Array, float, bool]:
        """Act for some milliseconds; return the last torque, how long it took, whether it is over.

        What is seen are points.
        """
        given, world, ended = self._given(action), self.world, False
        self.senses, begun = [], world.t
        for _ in range(self.ticks):
            senses = None
            if self.residual or self.watched:
                senses = world.sense(look=not self.residual or self._catcher.looking)
                self.senses.append(senses)
            command = self._command(senses, given)
            world.apply(command)
            ended = over()
            if ended:
                break
        return command.tau, world.t - begun, ended

    def _cost(self, away: float, tau: Array) -> float:
        """Return what a second costs at a distance [m] and a torque [N m]."""
        effort = tau / self.arm.tau_max
        return _DISTANCE * min(away, 2.0) + _EFFORT * float(effort @ effort) / len(effort)

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

    def _contact(self) -> dict[str, float]:
        """Return the largest force on ball or part, and its errors at the first contact, if any."""
        contact, said = self.world.first_contact, {}
        if contact is not None:
            said = {
                "position_error_m": contact.position_error,
                "velocity_error_m_s": contact.velocity_error,
            }
        return {"peak_contact_force_n": float(self.world.peak_force), **said}


class Environment(Driven):
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
        source = source_of(self.arm, seed=0, count=1, drag=self.scene.ball.drag)
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

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Throw another ball; the same seed throws the same one."""
        self._seeded(seed, options)
        ball = self._source.drawn(self.np_random)
        self._catcher = self._runner.release(ball, seed=int(self.np_random.integers(2**62)))
        self._touched, self.senses = False, []
        self._told, self._driven = list[Array](), list[bool]()
        self.images = np.zeros((2, *self.shape()), np.uint8)
        for frame in self._runner.views[-1] if self._runner.views else ():
            self.images[frame.camera] = frame.pixels
        return self._observed(), {}

    def step(self, action: Numbers) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for some milliseconds."""
        given = self._given(action)
        world, rules = self.world, {"longest": LONGEST, "held": HELD_AFTER}
        self.senses, nothing = [], np.full((3, self.arm.n), np.nan)
        for k in range(self.ticks):
            command = self._command(self._sensed(k), given)
            world.apply(command)
            told = command.joints.copy() if self.residual else np.array([*nothing, command.tau])
            self._told.append(told)
            self._driven.append(not command.brakes)
            if world.over(**rules):
                break
        reward = self._reward(command.tau, TICK * (k + 1))
        over = world.over(**rules)
        late = over and world.first_contact is None and world.t >= LONGEST
        info = self._ended() if over else {}
        reward += _HELD if info.get("status") == "caught" else 0.0
        return self._observed(), reward, over and not late, late, info

    def fresh_catcher(self) -> Catcher:
        """Return a catcher of the map that has seen nothing yet."""
        runner = TrialRunner(self.arm, Direct(self.map), self.scene, pixels=self.pixels)
        return runner.catcher()

    @property
    def views(self) -> list[tuple[Frame, ...]]:
        """Looks at the scene before the throw; none without images."""
        return self._runner.views

    def _sensed(self, k: int) -> Senses | None:
        """Return what is sensed in tick ``k`` of an action; None where nobody asks."""
        if not (self.residual or self.watched or self.pixels):
            return None
        senses = self.world.sense(look=self._looks(k))
        self.senses.append(senses)
        for frame in senses.frames:
            self.images[frame.camera] = frame.pixels
        return senses

    def _reward(self, tau: Array, dt: float) -> float:
        """Return the reward of an action that took ``dt`` [s] and ended with a torque [N m]."""
        gap = self.thing()[0] - self.world.catch_point
        cost = self._cost(float(np.sqrt(gap @ gap)), tau)
        return self._touch_gain() - dt * cost

    def _ended(self) -> dict[str, Any]:
        """Return what became of the throw."""
        world, trace, arm, catcher = self.world, self.world.trace(), self.arm, self._catcher
        phase = catcher.phase if self.residual else Phase.WATCH
        refused, held = self.residual and catcher.refused, was_held(arm, world)
        drives = drive_loads(arm, trace.q[:-1], trace.dq[:-1], trace.tau[1:])
        commanded, driven = np.array(self._told), np.array(self._driven)
        beyond = ticks_beyond(arm, trace, drives, commanded, driven=driven)
        shares = continuous_shares(arm, np.sum(drives.torque**2, axis=0), len(drives.torque))
        return {
            "status": trial_status(world, phase, refused=refused, was_held=held),
            "limit_violations": int(np.sum(beyond)) + overheated(shares),
            **self._contact(),
        }

    def _looks(self, k: int) -> bool:
        """Say whether the cameras expose in a tick of an action."""
        if self.residual:
            return self._catcher.looking
        sensing = self.scene.sensing
        first = self.ticks - 1 - sensing.latency if sensing.frame_rate >= 1.0 / TICK else 0
        return self.watched or (self.pixels and k >= first)

    def shape(self) -> tuple[int, int]:
        """Return the size of the images; none where there are none."""
        camera = self._runner.rig.cameras[0]
        return (camera.height, camera.width) if self.pixels else (0, 0)


@final
class CatchEnv(Environment):
    """``mitt/Catch-v0``: joints, and the true position and velocity of the ball."""


@final
class CatchPixelsEnv(Environment):
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
class MeetEnv(Driven):
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

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Bring another part; the same seed brings the same one."""
        self._seeded(seed, options)
        self._parts = self._drawn_parts(int(self.np_random.integers(2**31)))
        self.world.reset(self._parts.bring(0), self._parts.seed(0))
        self._catcher, self._touched, self.senses = self.fresh_catcher(), False, []
        return self.whole(), {}

    def step(self, action: Numbers) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for some milliseconds."""
        world, parts = self.world, self._parts
        tau, lasts, over = self._acted(
            action, lambda: parts.over(world, world.truth(), ready=True) or parts.held
        )
        reward = self._reward(tau, lasts)
        late = not over and world.t >= _LATE
        info = self._ended() if over or late else {}
        reward += _HELD if info.get("status") == "met" else 0.0
        return self.whole(), reward, over, late, info

    def _reward(self, tau: Array, dt: float) -> float:
        """Return the reward of an action that took ``dt`` [s] and ended with a torque [N m]."""
        world, (r, dr) = self.world, self.thing()
        q, dq = world.data.qpos[: self.arm.n], world.data.qvel[: self.arm.n]
        slip = min(float(np.linalg.norm(dr - self.arm.jacobian(q) @ dq)), 2.0)
        cost = self._cost(float(np.linalg.norm(r - world.catch_point)), tau) + _SLIP * slip
        return self._touch_gain() - dt * cost

    def _ended(self) -> dict[str, Any]:
        """Return what became of the part."""
        status = "stopped" if self._catcher.phase is Phase.STOPPED else None
        return {
            "status": status or self._parts.ended(self.world)["status"],
            **self._contact(),
        }


@final
class BatEnv(Driven):
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
        self._source = source_of(at.arm, seed=0, count=1, drag=self.scene.ball.drag)
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

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Throw another ball; the same seed throws the same one."""
        self._seeded(seed, options)
        ball = self._source.drawn(self.np_random)
        self.world.reset(ball, int(self.np_random.integers(2**31)))
        flight = self.world.flight
        self._path = np.array([flight(t)[0] for t in self._times.tolist()])
        self._touched, self.senses = False, []
        if self.residual:
            self._catcher = self.fresh_catcher()
        return self.whole(), {}

    def step(self, action: Numbers) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for some milliseconds."""
        world, target = self.world, self._at.target
        tau, lasts, over = self._acted(action, lambda: batted(world, target))
        reward = -lasts * self._cost(self._away(), tau)
        happened = world.first_contact is not None or world.truth().ball_on_floor
        late = over and not (happened or world.diverged)
        reward += 0.0 if self._first_touch() is None else _TOUCH
        info = self._ended() if over else {}
        reward += _HELD / (1.0 + info["miss_m"] / _HALF) if "miss_m" in info else 0.0
        return self.whole(), reward, over and not late, late, info

    def _away(self) -> float:
        """Return how far the paddle is from where the ball will pass [m]; 0 after the contact."""
        ahead = self._path[self._times >= self.world.t]
        if self.world.first_contact is not None or not len(ahead):
            return 0.0
        return float(np.linalg.norm(ahead - self.world.catch_point, axis=1).min())

    def _ended(self) -> dict[str, Any]:
        """Return what became of the ball."""
        hit = hit_of(self.arm, self.world, self._at.target)
        stopped = self.residual and self._catcher.phase is Phase.STOPPED
        out = {"status": "missed", "peak_contact_force_n": float(self.world.peak_force)}
        if self.world.diverged:
            out["status"] = "aborted"
        elif stopped:
            out["status"] = "stopped"
        elif hit is not None and hit.returned:
            out |= {"status": "hit", "miss_m": hit.miss, "return_speed_m_s": hit.speed}
        return out


def map_policy(env: gymnasium.Env[Any, Any]) -> Callable[[Observation], Numbers]:
    """Return the map as a policy of an environment, as a baseline.

    For actions ``residual`` it adds nothing. For ``torque`` a catcher of its own goes along with
    the same senses, images or points, and its last torque is the action; with ``ticks=1`` that is
    the catcher itself, with more its torque is held too long.

    Args:
        env: One of this module, wrapped or not.
    """
    raw = checks.instance("env", env, gymnasium.Env).unwrapped
    if not isinstance(raw, Driven):
        raise InputError("env", "an environment of mitt.gym", checks.shown(env))
    if raw.residual:
        return lambda _: np.zeros(raw.action_space.shape or (), np.float32)
    raw.watched = True
    return _MapPolicy(raw).act


@final
class _MapPolicy:
    """A catcher that goes along with an environment; see :func:`map_policy`."""

    def __init__(self, env: Driven) -> None:
        self._env, self._catcher = env, env.fresh_catcher()
        self._last = Command(0.0, np.zeros((4, 0)), 0.0)

    def act(self, _: Observation) -> Numbers:
        """Return torque and closing of the last of the ticks since the last action."""
        env = self._env
        if not env.senses:
            self._catcher = env.fresh_catcher()
            if isinstance(env, Environment) and env.views:
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
