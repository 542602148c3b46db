"""The tasks whose trials are run: what each counts and measures, by name."""

from typing import Final

from mitt.lab.trials.batting import BAT
from mitt.lab.trials.meeting import MEET
from mitt.lab.trials.score import CATCH

TASKS: Final = {task.name: task for task in (CATCH, MEET, BAT)}
"""The tasks."""
