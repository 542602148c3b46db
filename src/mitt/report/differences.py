"""How generators of a study differ: on the same throws, and over a swept disturbance."""

from collections.abc import Mapping, Sequence
from typing import Any

from mitt.sweep.study import Study
from mitt.sweep.summary import REFERENCE

Row = Mapping[str, Any]

#: Below this, after Holm's correction, a difference is called one.
_LEVEL = 0.05
_HALF = 0.5


def sweeps_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each swept disturbance."""
    out: dict[str, list[Row]] = {}
    for row in rows:
        if row["value"] is not None:
            out.setdefault(str(row["disturbance"]), []).append(row)
    return {name: found for name, found in out.items() if len({r["value"] for r in found}) > 1}


def decided(pairs: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """Return the rows against which the direct map is ahead, and behind."""
    sure = [row for row in pairs if row["against_direct"]["p_holm"] < _LEVEL]
    more = [row["against_direct"]["only_direct"] > row["against_direct"]["only_this"]
            for row in sure]  # fmt: skip
    ahead = [row for row, won in zip(sure, more, strict=True) if won]
    return ahead, [row for row, won in zip(sure, more, strict=True) if not won]


def paired_tests(study: Study, rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of paired differences, a row a condition, a column a rival."""
    rivals = [name for name in study.generators if name != REFERENCE]
    if not rivals or REFERENCE not in study.generators:
        return []
    found = {(row["condition"], row["generator"]): row["against_direct"] for row in rows}
    return [
        [c.name, *(_difference(found.get((c.name, rival))) for rival in rivals)]
        for c in study.conditions
    ]


def _difference(pair: Row | None) -> str:
    """Return one paired difference."""
    if pair is None or not pair["pairs"]:
        return ""
    points = 100.0 * (pair["only_direct"] - pair["only_this"]) / pair["pairs"]
    sure = pair["p_holm"] < _LEVEL
    return f"{points:+.1f}" + (f" ({max(pair['p_holm'], 1e-4):.2g})" if sure else "")


def break_even(rows: Sequence[Row]) -> list[list[str]]:
    """Return where half of the balls are lost, and where a rival draws level with the map."""
    out = []
    for name, points in sweeps_of(rows).items():
        unit = str(points[0]["unit"])
        curves = {g: _curve(points, g) for g in dict.fromkeys(str(r["generator"]) for r in points)}
        mine = curves.get(REFERENCE)
        for generator, curve in curves.items():
            half = _crossing(curve, [_HALF] * len(curve))
            level = "" if mine is None or generator == REFERENCE else _level(mine, curve, unit)
            out.append([name, generator, _value(half, unit) or "not in this range", level])
    return out


def _curve(points: Sequence[Row], generator: str) -> list[tuple[float, float]]:
    """Return value and rate of a generator, in the order of the values."""
    return sorted(
        (float(row["value"]), float(row["catch_rate"]))
        for row in points
        if row["generator"] == generator
    )


def _level(mine: list[tuple[float, float]], other: list[tuple[float, float]], unit: str) -> str:
    """Return where two curves cross; who is ahead everywhere where they do not."""
    if [x for x, _ in mine] != [x for x, _ in other]:
        return ""
    crossing = _crossing(other, [rate for _, rate in mine])
    if crossing is not None:
        return _value(crossing, unit)
    gaps = [b - a for (_, a), (_, b) in zip(mine, other, strict=True)]
    if all(gap == 0.0 for gap in gaps):
        return "level everywhere"
    return "never: direct ahead" if min(gaps) < 0.0 else "never: direct behind"


def _crossing(curve: Sequence[tuple[float, float]], bar: Sequence[float]) -> float | None:
    """Return where a curve first passes from one side of a bar to the other."""
    gaps = [rate - height for (_, rate), height in zip(curve, bar, strict=True)]
    for k in range(len(gaps) - 1):
        if gaps[k] * gaps[k + 1] < 0.0:
            share = gaps[k] / (gaps[k] - gaps[k + 1])
            return curve[k][0] + share * (curve[k + 1][0] - curve[k][0])
    return None


def _value(value: float | None, unit: str) -> str:
    """Return a value with its unit."""
    return "" if value is None else f"{value:.3g} {unit}".strip()
