"""The tasks whose trials are run: what each counts and measures, by name."""

from typing import Final

from mitt.trials.batting import BAT
from mitt.trials.meeting import MEET
from mitt.trials.score import CATCH

TASKS: Final = {task.name: task for task in (CATCH, MEET, BAT)}
"""The tasks."""
