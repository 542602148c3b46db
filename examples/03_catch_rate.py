"""Throw balls at the simulated arm and print the catch rate with its 95 % interval.

The same throws as ``mitt catch --throws 20 --seed 1``: two simulated cameras at 1 kHz, a plant
that differs from its model, fingers that hold by contact alone.
"""

import numpy as np

import mitt
from mitt.lab.trials.statistics import wilson

arm = mitt.load_arm("wam", limits="paper")
trials = mitt.simulate(mitt.learn(arm).map, throws=20, seed=1)

caught = sum(trial.status == "caught" for trial in trials)
low, high = wilson(caught, len(trials))
print(f"caught {caught} of {len(trials)}: 95 % interval {100 * low:.0f} to {100 * high:.0f} %")

errors = [t.position_error_mm for t in trials if t.position_error_mm is not None]
print(f"median error at first contact: {np.median(errors):.1f} mm")
print(f"ticks beyond a limit: {sum(trial.limit_violations for trial in trials)}")
for trial in trials:
    if trial.status != "caught":
        print(f"throw {trial.index}: {trial.status}, asks most of {trial.binding_limit}")
