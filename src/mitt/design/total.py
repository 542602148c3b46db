"""How much of a whole search is done, by what each of its stages takes."""

from collections.abc import Callable
from typing import final

from mitt.design.effort import Effort

Progress = Callable[[str, int, int], None]

#: What things take, about, in the time of one throw: a round by geometry and one of small changes,
#: a candidate on paper, a map by how it is learned, a step of the region.
_DRAWN, _CHANGED, _ON_PAPER, _STEP = 36.0, 6.0, 1.0, 4.0
_LEARNED = {"glance": 5.0, "quick": 8.0, "many": 20.0, "full": 30.0}
#: Match weights with which each of the last is tried, how many times as many throws decide, and
#: speeds that are tried between those of the page.
_WEIGHTS, _MORE, _BETWEEN = 3, 4, 3
#: Parts that a whole search is told in.
_PARTS = 1000


def stages(effort: Effort) -> dict[str, float]:
    """Return what each stage of a search takes, by its name, in the time of one throw."""
    of = {
        "geometry": _DRAWN * effort.rounds,
        "geometry, changed": _CHANGED * effort.changes,
        "on paper": _ON_PAPER * 6 * effort.judged,
        "learning": _LEARNED["glance"] * 2 * effort.judged,
    }
    for k in range(effort.generations):
        each = _LEARNED["glance"] * effort.offspring
        of[f"changing {k + 1} of {effort.generations}"] = each
    of["throwing"] = effort.thrown * (_LEARNED["quick"] + effort.throws[0])
    for k, throws in enumerate(effort.throws[1:]):
        how = "quick" if throws == effort.throws[0] else "many"
        again = effort.parents if throws > effort.throws[k] else 0
        each = (effort.children + again) * (_LEARNED[how] + throws)
        of[f"improving {k + 1} of {len(effort.throws) - 1}"] = each
    full = _LEARNED["full"]
    of["confirming"] = _WEIGHTS * effort.last * (full + effort.confirm)
    of["confirming again"] = effort.again * (full + _MORE * effort.confirm)
    return of | {"reporting": full + effort.report}


def last_stages(effort: Effort) -> dict[str, float]:
    """Return what is done with a design once it is found."""
    return {
        "region": _LEARNED["full"] + _STEP * (2 * effort.grid + 1),
        "speeds": (len(effort.speeds) + _BETWEEN) * (_LEARNED["quick"] + effort.each_speed),
        "fastest": _LEARNED["quick"] + effort.sure,
    }


@final
class Total:
    """Tells the progress of a whole search whenever it is told that of a stage."""

    def __init__(self, effort: Effort, progress: Progress) -> None:
        """Expect one search, and what follows it."""
        self._takes, self._last = stages(effort), last_stages(effort)
        self._progress, self._before, self._further, self._at = progress, 0.0, 0, 0

    def again(self, effort: Effort) -> None:
        """Expect searches for slower throws besides, since one has found nothing."""
        self._before += sum(self._takes.values())
        self._takes, self._further, self._at = stages(effort), effort.slower - 1, 0

    def __call__(self, name: str, done: int, of: int) -> None:
        """Take in how much of a stage is done; the stages before it count as done."""
        takes = self._takes | self._last
        if name not in takes:
            return
        order = list(takes)
        if order.index(name) < self._at and name in self._takes:  # the next search begins
            self._before += sum(self._takes.values())
            self._further = max(self._further - 1, 0)
        self._at = order.index(name)
        if name in self._last:
            self._further = 0
        past = self._before + sum(takes[x] for x in order[: self._at]) + takes[name] * done / of
        whole = self._before + self._further * sum(self._takes.values()) + sum(takes.values())
        self._progress(f"designing: {name}", int(_PARTS * past / whole), _PARTS)
