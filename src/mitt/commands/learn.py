"""``mitt learn``: learn a map, show the cost at each step, write the map."""

from pathlib import Path

import mitt
from mitt.commands.options import LearnOptions
from mitt.commands.screen import check_new_files, checked, print_json, progress, show, table, warn
from mitt.errors import InputError
from mitt.files.maps import save_map
from mitt.generator.advice import warnings_of
from mitt.generator.learn import Learned
from mitt.trials.learning import LEARNING_SEED, Neighbourhood
from mitt.trials.learning import learn as learn_map
from mitt.trials.runs import arm_of, design_of

#: Most flights to learn from; more only takes longer.
_MOST_FLIGHTS = 10_000


def run(options: LearnOptions) -> int:
    """Run ``mitt learn``; return its exit status."""
    arm = arm_of(options)
    design = design_of(options, arm)
    if not 1 <= options.flights_count <= _MOST_FLIGHTS:
        raise InputError("--flights", f"a number in 1..{_MOST_FLIGHTS}", options.flights_count)
    if options.seed is not None and not 0 <= options.seed < 2**63:
        raise InputError("--seed", "a number from 0 to 2^63 - 1", options.seed)
    check_new_files(options, {"--out": options.out})
    warn(warnings_of(arm, design), json=options.json)
    if options.check:
        return checked(f"{options.flights_count} flights, output to {options.out}")
    with progress() as report:
        report("learning", 0, 1)
        learned = learn_map(
            arm,
            design=design,
            seed=LEARNING_SEED if options.seed is None else options.seed,
            around=Neighbourhood(flights=options.flights_count),
        )
        report("learning", 1, 1)
    save_map(options.out, learned)
    if options.json:
        print_json({
            "schema": "mitt.learn/1",
            "version": mitt.__version__,
            "map": str(options.out),
            "status": learned.status,
            "flights": learned.flights,
            "left_out": learned.left_out,
            "cost_torque": [step.cost_torque for step in learned.steps],
            "cost_speed": [step.cost_speed for step in learned.steps],
        })  # fmt: skip
    else:
        _show(learned, options.out)
    return 0


def _show(learned: Learned, out: Path) -> None:
    """Print the cost at each step, the numbers behind fig. 7."""
    costs = table("cost over the optimisation (fig. 7)",
                  ("step", "torque", "speed", "sum", "largest share of a limit"))  # fmt: skip
    for k, step in enumerate(learned.steps):
        numbers = step.cost_torque, step.cost_speed, step.cost_torque + step.cost_speed
        costs.add_row("alpha = 0" if k == 0 else str(k - 1), *(f"{x:.4f}" for x in numbers),
                      f"{step.worst:.2f}")  # fmt: skip
    show(costs, f"{learned.status}: {learned.flights} flights, {learned.left_out} left out; "
                f"written: {out}")  # fmt: skip
