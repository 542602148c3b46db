"""The evaluation of a policy: episodes of fixed seeds, their returns, and how many succeed."""

from dataclasses import dataclass
from typing import Any, final

import gymnasium
import numpy as np

from mitt.clock import Progress
from mitt.core import checks
from mitt.core.errors import InputError, answered_by
from mitt.gym.policies import Policy
from mitt.lab.trials.statistics import wilson

#: Episodes of an evaluation, and the seed of the first: of no episode that anything here has been
#: chosen on.
EPISODES = 100
FIRST_SEED = 80_000


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PolicyReturns:
    """What became of episodes, one after the other.

    Attributes:
        seeds: Seed of each.
        returns: Its sum of rewards.
        steps: How many actions it had.
        statuses: How it ended.
        successes: Whether it was a success.
    """

    seeds: tuple[int, ...]
    returns: tuple[float, ...]
    steps: tuple[int, ...]
    statuses: tuple[str, ...]
    successes: tuple[bool, ...]

    @property
    def mean(self) -> float:
        """Mean return."""
        return float(np.mean(self.returns))

    @property
    def deviation(self) -> float:
        """Standard deviation of the returns."""
        return float(np.std(self.returns))

    @property
    def rate(self) -> float:
        """Share of successes."""
        return sum(self.successes) / len(self.successes)

    @property
    def ci95(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the rate."""
        return wilson(sum(self.successes), len(self.successes))


def evaluate(
    env: gymnasium.Env[Any, Any],
    policy: Policy,
    *,
    episodes: int = EPISODES,
    seed: int = FIRST_SEED,
    progress: Progress = lambda *_: None,
) -> PolicyReturns:
    """Let a policy play episodes of the seeds ``seed``, ``seed + 1``, and so on.

    Args:
        env: An environment whose episodes end with ``is_success`` in ``info``, wrapped or not.
        policy: Gives an action for what is observed.
        episodes: How many.
        seed: Of the first.
        progress: Is told how many are done.

    Raises:
        InputError: An argument cannot be, or an episode ends without ``is_success``.
    """
    env = checks.instance("env", env, gymnasium.Env)
    episodes = checks.whole("episodes", episodes, least=1)
    seed = checks.whole("seed", seed, least=0)
    for name, function in (("policy", policy), ("progress", progress)):
        if not callable(function):
            raise InputError(name, "a function", checks.shown(function))
    seeds = tuple(range(seed, seed + episodes))
    rows = list[tuple[float, int, str, bool]]()
    for k, of in enumerate(seeds):
        with answered_by("progress"):
            progress("episode", k, episodes)
        rows.append(_played(env, policy, of))
    returns, steps, statuses, successes = zip(*rows, strict=True)
    return PolicyReturns(
        seeds=seeds, returns=returns, steps=steps, statuses=statuses, successes=successes
    )


def _played(
    env: gymnasium.Env[Any, Any], policy: Policy, seed: int
) -> tuple[float, int, str, bool]:
    """Play one episode; return its return, its steps, how it ended, and whether well."""
    seen, _ = env.reset(seed=seed)
    total, steps, over = 0.0, 0, False
    while not over:
        with answered_by("policy"):
            action = policy(seen)
        seen, reward, ended, late, info = env.step(action)
        total, steps, over = total + float(reward), steps + 1, ended or late
    if "is_success" not in info:
        raise InputError("env", "episodes that end with is_success in info", sorted(info))
    return total, steps, str(info.get("status", "")), bool(info["is_success"])
