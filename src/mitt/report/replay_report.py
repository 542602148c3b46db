"""One page about a recorded throw: what happened, and why the ball was missed."""

from pathlib import Path

import numpy as np

from mitt.files.messages import PHASE
from mitt.files.writing import write_text
from mitt.report.figures.replay import estimate, hand, limits, states
from mitt.report.page import Section, number, page
from mitt.trials.explain import evidence_of, explain
from mitt.trials.replayed import Replayed

_SECTIONS = (
    Section("summary", "Summary", "What happened"),
    Section("states", "States", "Phases and states"),
    Section("estimate", "Estimate", "What the estimate was worth"),
    Section("hand", "Hand", "Where the hand was"),
    Section("limits", "Limits", "Limits used"),
    Section("verdicts", "Verdicts", "Verdicts on the throw"),
    Section("events", "Events", "What the recording says"),
)
#: Most rows of a table, and fewest ticks that are drawn.
_MOST, _FEWEST = 40, 3
#: Where a replay begins, in words.
_BEGINS = {
    "images": "from the images on",
    "eyes": "behind the eyes: from the positions that they found",
    "points": "from the given points on",
}


def write_replay_page(path: Path, x: Replayed, *, command: str) -> None:
    """Write the page of a replayed recording.

    Args:
        path: The file.
        x: The replay.
        command: The command that made it.
    """
    e = evidence_of(x)
    drawn = len(e.t) >= _FEWEST and bool(np.all(np.isfinite(e.t)))
    plots = {} if not drawn else {
        "states": states(x, e).svg, "estimate": estimate(x, e).svg, "hand": hand(x, e).svg,
        "limits": limits(x, e).svg,
    }  # fmt: skip
    first = x.first_difference
    said = "identical to the bit" if x.identical else (
        "ticks are missing" if first is None else f"differs from tick {first} on"
    )  # fmt: skip
    verdicts = [
        (number(j.t, 3), j.verdict.outcome.value, j.verdict.binding_limit or "",
         number(j.verdict.share if np.isfinite(j.verdict.share) else None, 2))
        for j in x.verdicts[-_MOST:]
    ]  # fmt: skip
    events = [(number(t, 3), topic, text[:200]) for t, topic, text in x.recorded.notices
              if topic != PHASE][:_MOST]  # fmt: skip
    write_text(
        path,
        page(
            "replay", _SECTIONS, title=f"Why: {x.recorded.path.stem}", command=command,
            file=x.recorded.path.name, about=x.about, recorded_by=x.recorded.about.version,
            explanation=explain(x, e), verdict=said, begins=_BEGINS[x.begins], plots=plots,
            changed=bool(np.any(x.differs)), verdicts=verdicts, events=events,
            followed=bool(np.any(np.isfinite(e.behind))),
        ),
    )  # fmt: skip
