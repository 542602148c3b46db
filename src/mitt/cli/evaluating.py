"""``mitt evaluate``: returns of policies that need no learning, by one protocol."""

from collections.abc import Callable
from typing import Any

from mitt.cli.options import EvaluateOptions
from mitt.cli.screen import checked, print_json, progress, show, table, tell_of_kernels
from mitt.core.errors import check_package
from mitt.lab.world.scene import read_scene
from mitt.version import __version__

_NAMES = {"catch": "mitt/Catch-v0", "meet": "mitt/Meet-v0", "bat": "mitt/Bat-v0"}
_POLICIES = ("zero", "random", "expert")


def evaluate_command(options: EvaluateOptions) -> int:
    """Run ``mitt evaluate``; return its exit status."""
    check_package("mitt evaluate", "gymnasium", "gymnasium", "gym")
    if options.scene is not None:
        read_scene(options.scene)
    name = _NAMES[options.task]
    if options.check:
        return checked(f"{name}, {options.episodes} episodes")
    tell_of_kernels()
    chosen = _POLICIES if options.policy is None else (options.policy,)
    found = {policy: played(name, policy, options) for policy in chosen}
    if options.json:
        said: dict[str, Any] = {"schema": "mitt.evaluation/1", "version": __version__}
        said |= {"environment": name, "episodes": options.episodes, "seed": options.seed}
        print_json({**said, "policies": found})
        return 0
    rows = table(
        f"{name}, seeds {options.seed} to {options.seed + options.episodes - 1}",
        ("policy", "actions", "return", "deviation", "success [%]", "95 % [%]", "steps"),
        left=("policy", "actions"),
    )
    for policy, of in found.items():
        low, high = (100.0 * x for x in of["ci95"])
        rows.add_row(
            policy,
            of["action"],
            f"{of['mean']:.2f}",
            f"{of['deviation']:.2f}",
            f"{100.0 * of['rate']:.0f}",
            f"{low:.1f} to {high:.1f}",
            f"{of['steps']:.0f}",
        )
    show(rows)
    return 0


def played(name: str, policy: str, options: EvaluateOptions) -> dict[str, Any]:
    """Return what a policy comes to."""
    import gymnasium  # noqa: PLC0415 (an extra)

    from mitt.gym import evaluate, map_policy  # noqa: PLC0415 (an extra)
    from mitt.gym.policies import random_policy, zero_policy  # noqa: PLC0415 (an extra)

    action = "residual" if policy == "expert" else "torque"
    more: dict[str, Any] = {} if options.scene is None else {"scene": options.scene}
    env: Any = gymnasium.make(name, action=action, **more)
    makers: dict[str, Callable[[], Any]] = {
        "zero": lambda: zero_policy(env),
        "random": lambda: random_policy(env, seed=options.seed),
        "expert": lambda: map_policy(env),
    }
    with progress() as tell:
        of = evaluate(
            env,
            makers[policy](),
            episodes=options.episodes,
            seed=options.seed,
            progress=lambda _, done, count: tell(policy, done, count),
        )
    env.close()
    return {
        "action": action,
        "mean": of.mean,
        "deviation": of.deviation,
        "rate": of.rate,
        "ci95": list(of.ci95),
        "steps": sum(of.steps) / len(of.steps),
        "returns": list(of.returns),
        "statuses": list(of.statuses),
    }
