"""Catching as a Gymnasium environment: ``mitt/Catch-v0`` and ``mitt/CatchPixels-v0``.

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

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt import checks
from mitt.errors import InputError, MissingPackageError

try:
    import gymnasium
    from gymnasium import spaces
except ImportError:
    raise MissingPackageError("mitt.gym", "gymnasium", "gym") from None

from mitt.arm.arm import Arm
from mitt.arm.hands import HandModel
from mitt.arm.limits import saturate
from mitt.catcher.generators import Direct, check_arm
from mitt.catcher.settings import Phase
from mitt.files.arm_file import arm_with_hand
from mitt.files.maps import read_map
from mitt.map.learn import Learned
from mitt.map.map_design import default_design
from mitt.map.mapping import DirectMap, unlearned
from mitt.report.painter import Faces, painted
from mitt.report.pictures import body_faces, placed
from mitt.signals import TICK, Array, Command, Frame, Senses
from mitt.trials.learning import learn
from mitt.trials.runner import LONGEST, TrialRunner
from mitt.trials.score import (
    HELD_AFTER,
    continuous_shares,
    drive_loads,
    overheated,
    status_of,
    ticks_beyond,
    was_held,
)
from mitt.trials.source import source_of, widened
from mitt.world.scene import Scene, scene_from
from mitt.world.throws import ThrowRanges, default_throw

__all__ = ["Catch", "CatchPixels", "Environment", "map_policy"]

Observation: TypeAlias = Any
Numbers: TypeAlias = NDArray[np.float32]

#: Bounds of what is observed: positions [m], speeds [m/s], joint speeds in shares of their limits.
FAR, FAST, _SPIN = 10.0, 20.0, 4.0
#: Residual torque of a full action, as a share of the joint's largest; ours.
_RESIDUAL = 0.2
#: Rewards: for a ball that is held, for the first touch, per second and metre of distance, per
#: second of full torque; choices of this project.
_HELD, _TOUCH, _DISTANCE, _EFFORT = 10.0, 1.0, 1.0, 0.05


class Environment(gymnasium.Env[Observation, Numbers]):
    """What both environments share."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012
    pixels = False

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
        checks.one_of("action", action, ("torque", "residual"))
        if render_mode is not None:
            checks.one_of("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode, self._action, self.scene = render_mode, action, scene_from(scene)
        if self.scene.actuation.takes != "torque":
            raise InputError("scene", "a robot that takes torques", self.scene.actuation.takes)
        self.ticks = checks.whole("ticks", ticks, least=1)
        self.metadata = {**self.metadata, "render_fps": max(round(1.0 / (TICK * ticks)), 1)}
        limits = None if limits is None else checks.text("limits", limits)
        self.arm, said = (arm, None) if isinstance(arm, Arm) else arm_with_hand(arm, limits=limits)
        self._design = default_design(self.arm, base=None if said is None else said.map)
        source = source_of(self.arm, seed=0, count=1, drag=self.scene.ball.drag)
        if said is not None and said.throws is not None:
            source = widened(source, said.throws)
        self._aim = source.aim
        self._ranges = replace(source.ranges or ThrowRanges(), drag=source.drag)
        self._map = self._checked(map)
        n, f = self.arm.n, None if action == "torque" else self.map
        base = f or unlearned(self.arm, self._design)
        self._runner = TrialRunner(self.arm, Direct(base), self.scene, pixels=self.pixels)
        self.world, self._catcher = self._runner.world, self._runner.catcher()
        self._drawn: tuple[mujoco.MjModel, list[Faces]] | None = None
        hand = self.arm.model.hand
        self._hand = 1.2 * (hand.drive.closed if isinstance(hand, HandModel) else 1.0)
        sides = n + 1 if action == "torque" else n
        self.action_space = spaces.Box(-1.0, 1.0, (sides,), np.float32)
        self.observation_space = self._space()
        self.senses: list[Senses] = []
        self.watched = False
        self._links, self._active = (
            np.zeros((3, len(self.arm.model.links))),
            [*self.arm.model.active],
        )

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
        seed = None if seed is None else checks.whole("seed", seed, least=0)
        if options is not None:
            checks.instance("options", options, dict)
        super().reset(seed=seed, options=options)
        ball = default_throw(self.np_random, self._aim, self._ranges)
        self._catcher = self._runner.release(ball, seed=int(self.np_random.integers(2**62)))
        self._touched, self.senses = False, []
        self._told, self._driven = list[Array](), list[bool]()
        self.images = np.zeros((2, *self.shape()), np.uint8)
        for frame in self._runner.views[-1] if self._runner.views else ():
            self.images[frame.camera] = frame.pixels
        return self._observed(), {}

    def step(self, action: Numbers) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for some milliseconds."""
        given = checks.array("action", action, self.action_space.shape or (), finite=True)
        given = np.clip(given, -1.0, 1.0)
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

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture, drawn in software, shape (262, 340, 3)."""
        if self.render_mode is None:
            return None
        if self._drawn is None:
            model = self.world.model
            faces = [body_faces(model, b, self.arm, self.scene) for b in range(model.nbody)]
            self._drawn = model, faces
        qpos = self.world.data.qpos.copy()
        picture = painted(*placed(*self._drawn, qpos, np.zeros((0, 3))), self.scene.floor)
        return np.array(picture, np.uint8)

    @property
    def residual(self) -> bool:
        """Whether actions are added to what the catcher commands."""
        return self._action == "residual"

    @property
    def views(self) -> list[tuple[Frame, ...]]:
        """Looks at the scene before the throw; none without images."""
        return self._runner.views

    def as_action(self, tau: Array, hand: float) -> Numbers:
        """Return a torque [N m], shape (n,), and a closing angle [rad] as an action ``torque``."""
        tau = checks.vector("tau", tau, self.arm.n, finite=True)
        hand = checks.number("hand", hand, finite=True)
        shares = [*(tau / self.arm.tau_max), 2.0 * hand / self._hand - 1.0]
        out: Numbers = np.clip(shares, -1.0, 1.0).astype(np.float32)
        return out

    def _sensed(self, k: int) -> Senses | None:
        """Return what is sensed in tick ``k`` of an action; None where nobody asks."""
        if not (self.residual or self.watched or self.pixels):
            return None
        senses = self.world.sense(look=self._looks(k))
        self.senses.append(senses)
        for frame in senses.frames:
            self.images[frame.camera] = frame.pixels
        return senses

    def _command(self, senses: Senses | None, given: Array) -> Command:
        """Return what arm and hand are told in a tick."""
        n, tau = self.arm.n, np.zeros((4, self.arm.n))
        if senses is None or not self.residual:
            tau[3] = self._within(given[:n] * self.arm.tau_max)
            return Command(self.world.t, tau, 0.5 * (1.0 + given[n]) * self._hand)
        command = self._catcher.step(senses)
        if self._catcher.stopped_by is not None:
            self.world.watch_on()
        self._catcher.think()
        if not np.any(given) or command.brakes:
            return command
        joints = command.joints.copy()
        joints[3] = self._within(joints[3] + _RESIDUAL * given * self.arm.tau_max)
        return command._replace(joints=joints)

    def _within(self, tau: Array) -> Array:
        """Return torques as the drives can give them at the joints' speeds."""
        links, active = self._links, self._active
        links[0, active], links[1, active] = tau, self.world.data.qvel[: self.arm.n]
        saturate(self.arm.limits.packed, links[0], links[1], links[2])
        return links[2, active]

    def _reward(self, tau: Array, dt: float) -> float:
        """Return the reward of an action that took ``dt`` [s] and ended with a torque [N m]."""
        gap, effort = self.world.data.qpos[-7:-4] - self.world.catch_point, tau / self.arm.tau_max
        cost = _DISTANCE * min(float(np.sqrt(gap @ gap)), 2.0)
        cost += _EFFORT * float(effort @ effort) / len(effort)
        touch = None if self._touched else self.world.first_contact
        self._touched = self._touched or touch is not None
        gain = 0.0 if touch is None else _TOUCH / (1.0 + touch.velocity_error)
        return gain - dt * cost

    def _ended(self) -> dict[str, Any]:
        """Return what became of the throw."""
        world, trace, arm = self.world, self.world.trace(), self.arm
        phase = self._catcher.phase if self.residual else Phase.WATCH
        drives = drive_loads(arm, trace.q[:-1], trace.dq[:-1], trace.tau[1:])
        commanded, driven = np.array(self._told), np.array(self._driven)
        beyond = ticks_beyond(arm, trace, drives, commanded, driven=driven)
        shares = continuous_shares(arm, np.sum(drives.torque**2, axis=0), len(drives.torque))
        contact = world.first_contact
        errors = {} if contact is None else {
            "position_error_m": contact.position_error,
            "velocity_error_m_s": contact.velocity_error,
        }  # fmt: skip
        return {
            "status": status_of(world, phase, was_held=was_held(arm, world)),
            "limit_violations": int(np.sum(beyond)) + overheated(shares),
            "peak_contact_force_n": float(world.peak_force),
            **errors,
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

    def joints(self) -> Numbers:
        """Return joint angles in their ranges, speeds in shares of their limits, catch point."""
        arm, n, data = self.arm, self.arm.n, self.world.data
        middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
        q = np.clip((data.qpos[:n] - middle) / half, -2.0, 2.0)
        dq = np.clip(data.qvel[:n] / arm.dq_max, -_SPIN, _SPIN)
        fingers = np.clip(data.qpos[n:-7], -_SPIN, _SPIN)
        place = np.clip(self.world.catch_point, -FAR, FAR)
        return np.concatenate([q, dq, fingers, place]).astype(np.float32)

    def bounds(self) -> Numbers:
        """Return the upper bounds of :meth:`joints`; the lower ones are their negatives."""
        n, fingers = self.arm.n, len(self.world.data.qpos) - 7 - self.arm.n
        sides = [np.full(n, 2.0), np.full(n + fingers, _SPIN), np.full(3, FAR)]
        return np.concatenate(sides).astype(np.float32)

    def _space(self) -> spaces.Space[Any]:
        """Return the space of what is observed."""
        raise NotImplementedError

    def _observed(self) -> Observation:
        """Return what is observed now."""
        raise NotImplementedError


@final
class Catch(Environment):
    """``mitt/Catch-v0``: joints, and the true position and velocity of the ball."""

    def _space(self) -> spaces.Space[Any]:
        """Return a box: joints, then the ball."""
        ball = np.array([FAR] * 3 + [FAST] * 3, np.float32)
        high = np.concatenate([self.bounds(), ball])
        return spaces.Box(-high, high, dtype=np.float32)

    def _observed(self) -> Numbers:
        """Return joints and ball."""
        data = self.world.data
        ball = np.clip(data.qpos[-7:-4], -FAR, FAR), np.clip(data.qvel[-6:-3], -FAST, FAST)
        return np.concatenate([self.joints(), *ball]).astype(np.float32)


@final
class CatchPixels(Environment):
    """``mitt/CatchPixels-v0``: joints, and the newest image of each of two cameras."""

    pixels = True

    def _space(self) -> spaces.Space[Any]:
        """Return boxes: ``joints`` and ``images``."""
        high, shape = self.bounds(), (2, *self.shape())
        return spaces.Dict({
            "joints": spaces.Box(-high, high, dtype=np.float32),
            "images": spaces.Box(0, 255, shape, np.uint8),
        })  # fmt: skip

    def _observed(self) -> dict[str, Any]:
        """Return joints and images."""
        return {"joints": self.joints(), "images": self.images.copy()}


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
        self._env = env
        self._runner = TrialRunner(env.arm, Direct(env.map), env.scene, pixels=env.pixels)
        self._catcher, self._last = self._runner.catcher(), Command(0.0, np.zeros((4, 0)), 0.0)

    def act(self, _: Observation) -> Numbers:
        """Return torque and closing of the last of the ticks since the last action."""
        env = self._env
        if not env.senses:
            self._catcher = self._runner.catcher()
            if env.views:
                self._catcher.learn_background(env.views)
            return env.as_action(np.zeros(env.arm.n), 0.0)
        for senses in env.senses:
            self._last = self._catcher.step(senses)
            self._catcher.think()
        return env.as_action(self._last.tau, self._last.hand)


gymnasium.register(id="mitt/Catch-v0", entry_point="mitt.gym:Catch")
gymnasium.register(id="mitt/CatchPixels-v0", entry_point="mitt.gym:CatchPixels")
