"""Options of the commands as plain data; light to import, so that ``--help`` is quick."""

from mitt.options.catching import ArmOptions, CatchOptions, LearnOptions, LimitName
from mitt.options.seeing import CalibrateOptions, SeeOptions, TrackOptions
from mitt.options.studying import BenchOptions, ReportOptions, StudyOptions

__all__ = [
    "ArmOptions",
    "BenchOptions",
    "CalibrateOptions",
    "CatchOptions",
    "LearnOptions",
    "LimitName",
    "ReportOptions",
    "SeeOptions",
    "StudyOptions",
    "TrackOptions",
]
