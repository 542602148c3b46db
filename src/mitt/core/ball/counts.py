"""What became of the sightings that a filter was given: each is counted once, by its reason.

A rule that drops a sighting can be wrong, so none drops one in silence: where a ball is not
followed, the counts say which rule it was.
"""

from dataclasses import asdict, dataclass

from mitt.core.kernels import Record

_UNUSED = ("rejected", "unusable", "untimely", "duplicate", "repeated", "isolated", "late")
"""Reasons for which a sighting is not used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterCounts:
    """What became of the sightings.

    Each sighting is in one of the first eight; ``kicks`` and ``restarts`` count what they led to.

    Attributes:
        used: Taken in.
        rejected: Beyond the gate, and not explained by a kick or another ball since.
        unusable: Not found, not finite, absurd, or the first of a track and without a position.
        untimely: Stamped ahead of their tick, or behind it by more than ``max_gap``; in a catcher.
        duplicate: Of a stamp that was there before.
        repeated: Of a place that was there before to the last digit, while the ball is elsewhere.
        isolated: Of another time than the track, too few in a row.
        late: Too old to be put in their place.
        kicks: Times that the velocity was forgotten.
        restarts: Times that a new track replaced an old one: sightings in a row, elsewhere or of
            another time, agreed with one another.
    """

    used: int = 0
    rejected: int = 0
    unusable: int = 0
    untimely: int = 0
    duplicate: int = 0
    repeated: int = 0
    isolated: int = 0
    late: int = 0
    kicks: int = 0
    restarts: int = 0

    @property
    def unused(self) -> dict[str, int]:
        """Sightings that were not used, by why; reasons that did not occur are left out."""
        counts = asdict(self)
        return {name: counts[name] for name in _UNUSED if counts[name] > 0}

    @property
    def words(self) -> str:
        """The same for a person; nothing where all were used."""
        return ", ".join(f"{count} {name}" for name, count in self.unused.items())


def counts_of(ball: Record) -> FilterCounts:
    """Return what became of the sightings that a filter was given so far."""
    b = ball[0]
    now, dropped = b["now"], b["dropped"]
    return FilterCounts(
        used=int(now["all_used"]),
        rejected=int(now["all_rejected"]),
        unusable=int(dropped["unusable"] + now["all_vague"]),
        untimely=int(dropped["untimely"]),
        duplicate=int(dropped["duplicate"]),
        repeated=int(dropped["repeated"]),
        isolated=int(dropped["isolated"] + b["waits"]),
        late=int(dropped["late"]),
        kicks=int(now["all_kicks"]),
        restarts=int(now["all_restarts"]),
    )
