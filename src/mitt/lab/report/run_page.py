"""The page that a run leaves behind: one file that opens anywhere and loads nothing.

All tasks have one page. Its title, counts, rate, spreads, failures and table follow from what a
task counts and measures; what a task shows besides stands in its :class:`Blocks`.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, final

import numpy as np

from mitt.lab.report.page import (
    NONE,
    Card,
    OwnPicture,
    Section,
    in_print,
    made_with,
    page,
    shown_number,
)
from mitt.lab.report.style import status_colour
from mitt.lab.trials.explain import words_of_limit
from mitt.lab.trials.score import reason_of
from mitt.lab.trials.scored_task import Measure, Row, ScoredTask

#: Heading of the limit of which most was asked.
_LIMIT: Final = "binding limit"
#: Trials in a table.
_ROWS: Final = 500
#: What is so of every run, whatever its task.
_REAL: Final = (
    "Arm, contacts, cameras and what comes are simulated. What sees, decides and commands the "
    "joints is the code that runs on a robot; it has not moved a real arm yet."
)
#: What is said of a run at the top, in this order, where its result has it.
_SETTINGS: Final = ("arm", "limits", "scene", "tool", "target", "generator", "vision", "seed")


class Column(NamedTuple):
    """A column of the table of trials.

    Attributes:
        words: Its heading.
        of: Returns the cell of a trial.
        number: Whether it is a number, which is set to the right.
    """

    words: str
    of: Callable[[Row], str]
    number: bool = True


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Blocks:
    """What one task alone shows on the page of a run.

    Attributes:
        counted: In words, what succeeded; as of the task where it is left out.
        is_: What this is, a sentence.
        shown: What happened in the trial that is shown, a sentence; empty where none is.
        lead: What is said of the run, a paragraph each.
        cards: Figures that are shown large, after those of every task.
        columns: Columns of the table of trials, after those of every task.
        failures: What is said above the trials that failed.
        pictures: Pictures, in the sections ``replay`` and ``figures``.
        system: The system beside that of the paper, rows of four cells.
    """

    counted: str = ""
    is_: str = ""
    shown: str = ""
    lead: Sequence[str] = ()
    cards: Sequence[Card] = ()
    columns: Sequence[Column] = ()
    failures: str = ""
    pictures: Sequence[OwnPicture] = ()
    system: Sequence[tuple[str, ...]] = ()


def run_page(
    task: ScoredTask, result: dict[str, Any], blocks: Blocks | None = None, *, command: str = ""
) -> str:
    """Return the page of a run.

    Args:
        task: What was run.
        result: Its result.
        blocks: What the task shows besides.
        command: The command that made the run, as one types it; empty where none did.
    """
    own, trials = blocks or Blocks(), result["trials"]
    of, noun = result["summary"], task.in_result
    one = noun.removesuffix("s")
    counts = {status: int(of[status]) for status in task.statuses}
    failed = [t for t in trials if t["status"] != task.success]
    reasons = Counter((t["status"], _limit_of(t)) for t in failed)
    columns = [x for x in (*columns_of_task(task), *own.columns) if _says(x, trials)]
    why = [x._replace(of=_limit_of) if x.words == _LIMIT else x for x in columns]
    opening = {"What it is": own.is_, "What is real": _REAL, f"In this {one}": own.shown}
    counted = own.counted or task.counted
    return page(
        "run",
        (
            Section("opening", "What this is", "What this is"),
            Section("summary", "Numbers", f"All {noun} in numbers"),
            Section("failures", "Failures", "What failed, and why"),
            Section("figures", "Figures", "Figures"),
            Section("table_1", "Table 1", "The system beside the paper\u2019s Table 1"),
            Section("trials", f"All {noun}", f"All {noun}"),
            Section("repeat", "Repeat", "How to repeat it"),
        ),
        title=f"{counts[task.success]} of {len(trials)} {_singular(counted, len(trials))}",
        command=task.name,
        task=task,
        result=result,
        settings=[(x, result[x]) for x in _SETTINGS if isinstance(result.get(x), str | int)],
        of=of,
        own=own,
        noun=noun,
        one=one,
        opening={name: text for name, text in opening.items() if text},
        counts={status: n for status, n in counts.items() if n},
        colour={x: status_colour(x, success=x == task.success) for x in task.statuses},
        beyond=_beyond(trials),
        too_hard=sum(t.get("over_force") is True for t in trials),
        cards=[*cards_of(task, result), *own.cards],
        head=[x.words for x in columns],
        numbers=sum(x.number for x in columns),
        reasons=[(status, x, str(n)) for (status, x), n in reasons.most_common()],
        failed=_table(why, failed),
        failures=len(failed),
        rows=_table(columns, trials),
        typed=command,
        made_with=made_with(),
    )


def _beyond(trials: Sequence[Row]) -> tuple[int, int]:
    """Return in how many trials something was beyond a limit, and in how many ticks of all."""
    ticks = [int(t["limit_violations"]) for t in trials]
    return sum(x > 0 for x in ticks), sum(ticks)


def _limit_of(trial: Row) -> str:
    """Return the limit of which a trial asked most, in words, its name behind."""
    limit = trial["binding_limit"]
    return words_of_limit(str(limit)) if limit else NONE


def _says(column: Column, trials: Sequence[Row]) -> bool:
    """Say whether a column has a value for any of the trials that are shown."""
    return any(column.of(trial) != NONE for trial in trials[:_ROWS])


def _singular(words: str, count: int) -> str:
    """Return what was counted, as it is said of one where there was one: ``ball caught``."""
    what, _, did = words.partition(" ")
    return f"{what.removesuffix('s')} {did}".strip() if count == 1 else words


def columns_of_task(task: ScoredTask) -> list[Column]:
    """Return the columns that follow from what a task measures."""

    def number(x: Measure) -> Column:
        return Column(in_print(x.words), lambda t: shown_number(x.of(t), x.digits or 0))

    return [
        Column(task.in_result.removesuffix("s"), lambda t: str(t["index"]), number=False),
        Column("status", lambda t: str(t["status"]), number=False),
        Column(_LIMIT, lambda t: str(t["binding_limit"] or NONE), number=False),
        Column("stopped by", lambda t: reason_of(t.get("stopped_by")) or NONE, number=False),
        Column("beyond a limit [ms]", lambda t: str(t["limit_violations"])),
        *map(number, task.shown),
    ]


def _table(columns: Sequence[Column], trials: Sequence[Row]) -> list[list[str]]:
    """Return the rows of the first trials, a cell a column."""
    return [[column.of(trial) for column in columns] for trial in trials[:_ROWS]]


def cards_of(task: ScoredTask, result: dict[str, Any]) -> list[Card]:
    """Return what people ask first: the rate, the spread of each measure, limits, computing time.

    A spread is the median of a measure, a high percentile, and the largest, over the trials that
    have it; of what is the better the more there is, a low percentile and the least.
    """
    of, trials = result["summary"], result["trials"]
    low, high = (100.0 * end for end in of["ci95"])
    beyond, ticks = _beyond(trials)
    tick, count = of["tick_us"], f"{len(trials)} {task.in_result}"
    return [
        Card(
            task.rate.replace("_", " ").capitalize(),
            f"{100.0 * of[task.rate]:.1f}",
            "%",
            f"{of[task.success]} of {count}; 95 % interval {low:.1f} to {high:.1f} % (Wilson)",
        ),
        *(spread_card(x, trials) for x in task.shown),
        Card(
            "Beyond a limit",
            str(beyond),
            f"of {count}",
            f"{ticks} ms in all, commanded or of the plant",
        ),
        Card(
            "Catcher\u2019s tick",
            f"{tick['p50']:.0f}",
            "\u00b5s, median",
            f"99 % {tick['p99']:.0f}, 99.9 % {tick['p99_9']:.0f}, max {tick['max']:.0f} \u00b5s; "
            f"{of['deadline_misses']} beyond 1 ms",
        ),
    ]


def spread_card(measure: Measure, trials: Sequence[Row]) -> Card:
    """Return a measure over the trials that have it; a dash where none has."""
    values = [x for t in trials if (x := measure.of(t)) is not None]
    title = measure.words.partition(" [")[0]
    title = title[:1].upper() + title[1:]
    if not values:
        return Card(title, NONE)
    percent = 100 - measure.percent if measure.more else measure.percent
    median, far = np.percentile(values, [50.0, percent])
    side, end = ("above", "least") if measure.more else ("below", "largest")
    last, digits = min(values) if measure.more else max(values), measure.digits or 0
    note = f"median; {measure.percent} % {side} {far:.{digits}f}, {end} {last:.{digits}f}"
    return Card(title, f"{median:.{digits}f}", in_print(measure.unit), note)
