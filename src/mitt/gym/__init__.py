"""Catching as a Gymnasium environment: ``mitt/Catch-v0`` and ``mitt/CatchPixels-v0``.

    import gymnasium, mitt.gym
    env = gymnasium.make("mitt/Catch-v0", scene="lab", action="residual", map="MAP.json")

| keyword  | what                                                                                |
|----------|-------------------------------------------------------------------------------------|
| `arm`    | an arm as of ``mitt.load_arm``, its name or file; it needs a hand                   |
| `limits` | its limit set                                                                       |
| `scene`  | the world: a ``Scene``, the name or the file of one                                 |
| `action` | `torque`: of each joint as a share of its largest, and the closing of the hand;     |
|          | `residual`: torque on top of what the catcher with the map commands                 |
| `map`    | for `residual` and :func:`map_policy`: a learned map or its file; learned if needed |
| `ticks`  | milliseconds that an action lasts                                                   |

docs/gym.md says what is observed and rewarded.
"""

from collections.abc import Callable
from typing import Any, final

import numpy as np

from mitt import checks
from mitt.errors import InputError, MissingPackageError

try:
    import gymnasium
    from gymnasium import spaces
except ImportError:
    raise MissingPackageError("mitt.gym", "gymnasium", "gym") from None

from mitt.generator.generators import Direct
from mitt.gym.environment import FAR, FAST, Environment, Numbers, Observation
from mitt.signals import Command
from mitt.trials.runner import TrialRunner

__all__ = ["Catch", "CatchPixels", "Environment", "map_policy"]


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
