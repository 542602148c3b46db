"""Policies that are there without learning: nothing, anything, and the paper's map."""

from collections.abc import Callable
from typing import Any, TypeAlias, final

import gymnasium
import numpy as np

from mitt.core import checks
from mitt.core.errors import InputError
from mitt.core.signals import Command
from mitt.gym.environment import Environment, Numbers, Observation

Policy: TypeAlias = Callable[[Observation], Numbers]
"""Gives an action for what is observed."""


def zero_policy(env: gymnasium.Env[Any, Any]) -> Policy:
    """Return the policy whose actions are zeros."""
    zeros = np.zeros(env.action_space.shape or (), np.float32)
    return lambda _: zeros


def random_policy(env: gymnasium.Env[Any, Any], *, seed: int) -> Policy:
    """Return the policy whose actions are drawn from the space of actions, evenly."""
    env.action_space.seed(seed)
    return lambda _: env.action_space.sample()


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
