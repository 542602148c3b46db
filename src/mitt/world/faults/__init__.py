"""What goes wrong in a trial: a plan as data, drawn from the trial's seed, the same each time."""
