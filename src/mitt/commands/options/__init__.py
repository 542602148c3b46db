"""Options of the commands as plain data; light to import, so that ``--help`` is quick."""

from mitt.commands.options.catching import ArmOptions, CatchOptions, LearnOptions
from mitt.commands.options.seeing import CalibrateOptions, SeeOptions, TrackOptions
from mitt.commands.options.studying import BenchOptions, ReportOptions, StudyOptions

__all__ = [
    "ArmOptions",
    "BenchOptions",
    "CalibrateOptions",
    "CatchOptions",
    "LearnOptions",
    "ReportOptions",
    "SeeOptions",
    "StudyOptions",
    "TrackOptions",
]
