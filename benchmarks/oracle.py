"""The map held against the clairvoyant, throw by throw: what could have been caught, and was not.

A throw is catchable where the clairvoyant's plan, run in the same plant with the same hand and
noise, catches it within all limits. Every throw that the map does not catch is run by the
clairvoyant too, as long as it may be asked, and a random sample of those that it catches, which
says how often the clairvoyant fails there. A verdict is *false feasible* where the map promised and
then did not catch, or went beyond a limit; *false unreachable* where it refused what can be
caught. A ball that the hand met where it tolerates it, within all limits, and that sprang back or
slipped out all the same, is *let go*: the verdict on the way was right, and it is counted apart.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from mitt.lab.trials.score import STATUSES, Trial, reason_of
from mitt.lab.trials.statistics import wilson

#: The stream that a sample is drawn from.
_STREAM = 7
#: Distance of ball and catch point at first contact within which a contact is fair [mm].
FAIR = 30.0


class Estimate(NamedTuple):
    """A rate and the ends of its 95 % interval."""

    rate: float
    low: float
    high: float


def share(successes: int, trials: int) -> Estimate:
    """Return a success rate with its Wilson interval; 0 in (0, 1) without trials."""
    return Estimate(successes / trials if trials else 0.0, *wilson(successes, trials))


def combined(f: Callable[..., float], parts: Sequence[Estimate]) -> Estimate:
    """Return a rate that follows from others, each from trials of its own.

    The distances to the ends are those that each part alone would give, added as squares: G. Y.
    Zou, A. Donner, Construction of confidence limits about effect measures, Stat. Med. 27 (2008)
    1693-1702. Of one part alone that is its own interval.

    Args:
        f: The rate, as it follows from those of the parts; in each it only rises, or only falls.
        parts: The others.
    """
    rates = [part.rate for part in parts]
    rate = f(*rates)
    away = [
        f(*rates[:k], end, *rates[k + 1 :]) - rate
        for k, part in enumerate(parts)
        for end in (part.low, part.high)
    ]
    low = rate - sqrt(sum(d * d for d in away if d < 0.0))
    high = rate + sqrt(sum(d * d for d in away if d > 0.0))
    return Estimate(rate, max(low, 0.0), min(high, 1.0))


Row = dict[str, Any]
#: Throws one ball, by its index.
Run = Callable[[int], Trial]


def judged(
    by_map: Run,
    by_optimum: Run,
    index: int,
    *,
    sampled: bool,
    oracle: bool = True,
    thrifty: bool = False,
) -> Row:
    """Run a throw by the map and, where it fails or is sampled, by the clairvoyant if wished.

    One that is thrifty is not asked about balls that were let go: the verdict was right.
    """
    trial = by_map(index)
    caught, told = trial.status == "caught", trial.certificate or {}
    row: Row = {
        "index": index,
        "status": trial.status,
        "verdict": told.get("outcome"),
        "binding_limit": trial.binding_limit,
        "margin": told.get("margin"),
        "violations": trial.limit_violations,
        "position_error_mm": trial.position_error_mm,
        "velocity_error_m_s": trial.velocity_error_m_s,
        "stopped_by": reason_of(trial.stopped_by),
        "clairvoyant": None,
    }
    if oracle and (sampled or not (caught or (thrifty and _let_go(row)))):
        best = by_optimum(index)
        row |= {"clairvoyant": best.status, "clairvoyant_violations": best.limit_violations}
    return row


def counted(rows: Sequence[Row]) -> Row:
    """Return what a table of throws comes to.

    Where the clairvoyant was asked about some throws of a kind only, these stand for all of them,
    and the intervals say how few they are.
    """
    n, failed = len(rows), [row for row in rows if row["status"] != "caught"]
    met = [row for row in rows if row["status"] == "caught"]
    both = [row for row in met if row["clairvoyant"] is not None]
    broken, let_go = sum(_broken(row) for row in rows), [row for row in rows if _let_go(row)]
    refused = [row for row in failed if row["status"] == "unreachable"]
    unasked = [row for row in failed if not (_let_go(row) and row["clairvoyant"] is None)]
    asked = [row for row in refused if row["clairvoyant"] is not None]
    # Without a sample the clairvoyant is believed to catch what the map catches.
    common, caught = (_Part.of([met]) if both else _Part(len(met))), _Part(len(met))
    timid, lost = _Part.of(_kinds(refused)), _Part.of(_kinds(unasked))
    speeds = [row["velocity_error_m_s"] for row in let_go]
    return {
        "throws": n,
        "caught": len(met),
        **{status: sum(row["status"] == status for row in rows) for status in STATUSES[1:]},
        "sampled": {"throws": len(both), "caught_by_clairvoyant": _caught_by_optimum(both)},
        "catchable": round(common.count + lost.count),
        "caught_of_catchable": _ratio(common, lost),
        "caught_of_what_either_catches": _ratio(caught, lost),
        "false_feasible": _rate(broken, sum(row["verdict"] == "feasible" for row in rows)),
        "false_unreachable": timid.rate(n),
        "false": replace(timid, known=timid.known + broken).rate(n),
        "let_go": len(let_go),
        "let_go_at_m_s": float(np.median(speeds)) if speeds else None,
        "refused": len(refused),
        "refused_and_asked": len(asked),
        "refused_and_caught_by_clairvoyant": _caught_by_optimum(asked),
        "refused_by": dict(Counter(row["binding_limit"] for row in refused)),
        "violations": sum(row["violations"] for row in rows),
        "violations_of_clairvoyant": sum(row.get("clairvoyant_violations", 0) for row in rows),
        "failures": failed,
    }


def _kinds(rows: Sequence[Row]) -> list[list[Row]]:
    """Return throws by what one may stand for another in: condition, and refused or not."""
    kinds: dict[tuple[object, bool], list[Row]] = {}
    for row in rows:
        kind = row.get("condition"), row["status"] == "unreachable"
        kinds.setdefault(kind, []).append(row)
    return list(kinds.values())


#: Share of the throws of a kind that are all known.
_SURE = Estimate(1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class _Part:
    """A part of all throws, of which the clairvoyant knows some.

    Attributes:
        known: Throws of it that are counted.
        drawn: How many throws there are of each further kind, how many of them were asked about,
            and how many of these the clairvoyant caught.
    """

    known: int
    drawn: tuple[tuple[int, int, int], ...] = ()

    @classmethod
    def of(cls, kinds: Sequence[Sequence[Row]]) -> "_Part":
        """Return the throws of some kinds that the clairvoyant catches."""
        known, drawn = 0, []
        for rows in kinds:
            asked = [row for row in rows if row["clairvoyant"] is not None]
            found = _caught_by_optimum(asked)
            if len(asked) == len(rows):
                known += found
            else:
                drawn.append((len(rows), len(asked), found))
        return cls(known, tuple(drawn))

    @property
    def count(self) -> float:
        """How many throws that is, by the rates of those that were asked about."""
        return self.known + sum(m * found / asked for m, asked, found in self.drawn if asked)

    @property
    def kinds(self) -> list[tuple[int, Estimate]]:
        """Throws of each kind, and the share of them that counts."""
        return [(self.known, _SURE), *((m, share(found, asked)) for m, asked, found in self.drawn)]

    def rate(self, n: int) -> Row:
        """Return it as a share of n throws, with its interval."""
        pairs = [(share(size, n), of_kind) for size, of_kind in self.kinds]

        def f(*rates: float) -> float:
            return sum(a * b for a, b in zip(rates[::2], rates[1::2], strict=True))

        return _row(combined(f, [x for pair in pairs for x in pair]), self.count, n)


def _ratio(part: _Part, rest: _Part) -> Row:
    """Return the share of a part in it and the rest, with its interval.

    The throws that either may hold are split into kinds, one after the other: each split is a rate
    of its own.
    """
    kinds = [*part.kinds, *rest.kinds]
    left = [sum(size for size, _ in kinds[k:]) for k in range(len(kinds))]
    splits = [share(size, of) for (size, _), of in zip(kinds, left, strict=True)][:-1]

    def f(*given: float) -> float:
        left, shares = 1.0, []
        for split, rate in zip((*given[: len(splits)], 1.0), given[len(splits) :], strict=True):
            shares.append(left * split * rate)
            left *= 1.0 - split
        whole = sum(shares)
        return sum(shares[: len(part.kinds)]) / whole if whole > 0.0 else 0.0

    rate = combined(f, [*splits, *(of_kind for _, of_kind in kinds)])
    return _row(rate, part.count, round(part.count + rest.count))


def _caught_by_optimum(rows: Sequence[Row]) -> int:
    """Return how many of some throws the clairvoyant caught within all limits."""
    return sum(row["clairvoyant"] == "caught" and not row["clairvoyant_violations"] for row in rows)


def _let_go(row: Row) -> bool:
    """Say whether a ball that was met as promised, within all limits, left the hand again."""
    gap = row["position_error_mm"]
    fair = gap is not None and gap <= FAIR and not row["violations"]
    return bool(row["status"] == "dropped" and row["verdict"] == "feasible" and fair)


def _broken(row: Row) -> bool:
    """Say whether a throw was promised and then not caught, or taken beyond a limit."""
    kept = (row["status"] == "caught" and not row["violations"]) or _let_go(row)
    return bool(row["verdict"] == "feasible" and not kept)


def _rate(k: int, n: int) -> Row:
    """Return a rate with its 95 % Wilson interval."""
    return _row(share(k, n), k, n)


def _row(rate: Estimate, count: float, n: int) -> Row:
    """Return a rate with its interval, and the counts behind it."""
    return {
        "of": n,
        "count": round(count),
        "rate": rate.rate if n else None,
        "low": rate.low,
        "high": rate.high,
    }


def is_sampled(seed: int, index: int, share: float) -> bool:
    """Say whether a throw is in the sample; a function of seed and index alone."""
    return bool(np.random.default_rng([seed, index, _STREAM]).random() < share)


def parallel(work: Callable[[int], list[Row]], workers: int) -> list[Row]:
    """Run all shares, each in its own process where there are several; rows by index."""
    if workers == 1:
        return work(0)
    with ProcessPoolExecutor(workers) as pool:
        parts = list(pool.map(work, range(workers)))
    return sorted((row for rows in parts for row in rows), key=lambda row: int(row["index"]))
