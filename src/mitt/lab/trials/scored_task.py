"""What a task is to those who count its trials: how they end, and what is measured in each.

Tables, summaries, pages and the tests between generators of a study follow from this.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, final

from mitt.io.writing import Leaves

NAME = "trials.jsonl"
"""What the list of trials is called in the folder of a run."""
RESULT = "result.json"
"""What the result is called there."""
PAGE = "report.html"
"""What the page is called there."""

Row = Mapping[str, Any]
"""A trial, by the columns of its table."""


class Measure(NamedTuple):
    """What is measured in each trial.

    Attributes:
        words: What it is, with its unit.
        column: Field of the trial; of one with a value for each joint the largest counts.
        digits: Digits in tables; None where no table shows it.
        factor: What the field is multiplied by.
        more: Whether more of it is better.
        percent: Percentile that is told beside the median.
    """

    words: str
    column: str
    digits: int | None
    factor: float = 1.0
    more: bool = False
    percent: int = 90

    def of(self, trial: Row) -> float | None:
        """Return it from a trial; None where the trial has none."""
        value = trial[self.column]
        if isinstance(value, list):
            value = max(value, default=None)
        return None if value is None else self.factor * value

    @property
    def unit(self) -> str:
        """Its unit."""
        return self.words.partition(" [")[2].rstrip("]")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ScoredTask:
    """A task, as its trials are counted and compared.

    Attributes:
        name: What files call it.
        schema: Of the summary of a study.
        trial: Its trials, a dataclass.
        trials: What they are called in a study.
        doing: What is done in one, for the bar: ``throwing``.
        in_result: What the summary of a run calls their number.
        statuses: How they end, the successful one first.
        rate: Name of the share of the successful ones.
        counted: In words, what succeeded.
        measures: What is compared between generators in each trial, by name.
        medians: Of what else a summary gives medians, by name.
        more: Returns what the summary of a run says of its trials beside counts and rate.
        extra: Numbers that a study adds to the fields of each trial.
        keeps: Names of files that a run leaves beside throws, result, page and recordings.
    """

    name: str
    schema: str
    trial: type
    trials: str
    doing: str
    in_result: str
    statuses: tuple[str, ...]
    rate: str
    counted: str
    measures: Mapping[str, Measure]
    medians: Mapping[str, Measure]
    more: Callable[[Sequence[Any]], dict[str, Any]]
    extra: tuple[str, ...] = ()
    keeps: tuple[str, ...] = ()

    @property
    def success(self) -> str:
        """Status of a trial that did what it was to do."""
        return self.statuses[0]

    @property
    def done(self) -> str:
        """What is said of a trial that did what it was to do, as ``The ball was caught.``."""
        return f"The {self.counted.partition(' ')[0].removesuffix('s')} was {self.success}."

    @property
    def result_schema(self) -> str:
        """Schema of the result of a run."""
        return f"mitt.{self.name}/1"

    def recording(self, index: int) -> str:
        """Return where the recording of a trial is in the folder of a run."""
        return f"recordings/{self.trials.removesuffix('s')}-{index:05d}.mcap"

    @property
    def leaves(self) -> Leaves:
        """All that a run leaves in its folder."""
        recordings = rf"recordings/{self.trials.removesuffix('s')}-\d{{5,}}\.mcap"
        return Leaves(
            command=f"mitt {self.name}",
            schema=self.result_schema,
            manifests=(NAME, RESULT),
            names=(*map(re.escape, (NAME, RESULT, PAGE, *self.keeps)), recordings),
        )

    @property
    def figures(self) -> Mapping[str, Measure]:
        """All that is measured, by name."""
        return {**self.measures, **self.medians}

    @property
    def shown(self) -> Sequence[Measure]:
        """What tables show of each trial."""
        known = {x.name for x in fields(self.trial)}
        return [x for x in self.figures.values() if x.digits is not None and x.column in known]
