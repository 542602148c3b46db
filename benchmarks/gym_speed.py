"""Steps a second of processor time, beside those of ``gymnasium[mujoco]``, in one run.

python benchmarks/gym_speed.py                5 s each
python benchmarks/gym_speed.py --seconds 1 --json speed.json
"""

import argparse
import json
from pathlib import Path
from time import process_time
from typing import Any

import gymnasium
import numpy as np

import mitt.gym

#: Environments and their keywords; simulated time of one step [s] is asked of each.
ENVIRONMENTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("Reacher-v5", {}),
    ("Pusher-v5", {}),
    ("mitt/Catch-v0", {}),
    ("mitt/Catch-v0", {"ticks": 1}),
    ("mitt/Catch-v0", {"ticks": 20}),
    ("mitt/Catch-v0", {"action": "residual"}),
    ("mitt/CatchPixels-v0", {}),
    ("mitt/CatchPixels-v0", {"action": "residual"}),
)


def measured(name: str, words: dict[str, Any], seconds: float) -> dict[str, float]:
    """Return steps a second, and how much faster than life that is, with random actions."""
    env = gymnasium.make(name, **words)
    env.action_space.seed(80_000)
    env.reset(seed=80_000)
    actions = [env.action_space.sample() for _ in range(256)]
    for action in actions[:20]:
        env.step(action)
    env.reset()
    steps, start = 0, process_time()
    while (elapsed := process_time() - start) < seconds:
        _, _, terminated, truncated, _ = env.step(actions[steps % 256])
        steps += 1
        if terminated or truncated:
            env.reset()
    raw: Any = env.unwrapped
    dt = 1e-3 * raw.ticks if isinstance(raw, mitt.gym.Environment) else raw.dt
    env.close()
    return {"steps_per_s": steps / elapsed, "real_time": steps * dt / elapsed, "step_s": dt}


def main() -> None:
    """Measure all, three times in turn, and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows: dict[str, dict[str, float]] = {}
    labels = [f"{name} {words or ''}".strip() for name, words in ENVIRONMENTS]
    found: dict[str, list[dict[str, float]]] = {label: [] for label in labels}
    for _ in range(3):
        for label, (name, words) in zip(labels, ENVIRONMENTS, strict=True):
            try:
                found[label].append(measured(name, words, options.seconds / 3.0))
            except Exception as error:  # what another package raises with this MuJoCo
                print(f"{label}: does not run: {type(error).__name__} {error}")
    for label, runs in found.items():
        if runs:
            rows[label] = {key: float(np.median([run[key] for run in runs])) for key in runs[0]}
    base = rows.get("Pusher-v5") or rows.get("Reacher-v5")
    print(f"{'environment':46} steps/s   x real time  of Pusher's steps/s")
    for label, row in rows.items():
        ratio = row["steps_per_s"] / base["steps_per_s"] if base else float("nan")
        print(f"{label:46} {row['steps_per_s']:7.0f}  {row['real_time']:10.1f}  {ratio:10.2f}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
