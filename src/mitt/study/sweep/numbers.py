"""Tables and words of a study's page."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from mitt.study import page
from mitt.study.result import STATUSES
from mitt.study.sweep.study import Study
from mitt.study.sweep.summary import REFERENCE

Row = Mapping[str, Any]

#: Below this, after Holm's correction, a difference is called one.
_LEVEL = 0.05
_TO = "\u2013"
_HALF = 0.5


def sweeps_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows of each swept disturbance."""
    out: dict[str, list[Row]] = {}
    for row in rows:
        if row["value"] is not None:
            out.setdefault(str(row["disturbance"]), []).append(row)
    return {name: found for name, found in out.items() if len({r["value"] for r in found}) > 1}


def extent(study: Study, throws: int) -> str:
    """Return how large a study is: ``9 generators, 1 condition, 2,700 throws``."""
    counts = {
        "generator": len(study.generators),
        "condition": len(study.conditions),
        "throw": throws,
    }
    return ", ".join(f"{n:,} {what}{'s' * (n != 1)}" for what, n in counts.items())


def headline(study: Study, rows: Sequence[Row]) -> str:
    """Return what the study is, in one line."""
    return f"{study.name}: {extent(study, sum(int(row['throws']) for row in rows))}"


def story(study: Study, rows: Sequence[Row]) -> str:
    """Return what came out, in words."""
    about = f'<p class="lead">{escape(study.about)}</p>' if study.about else ""
    unfinished = sum(not row["complete"] for row in rows)
    left = (
        f"<p><b>{unfinished} of {len(rows)} cells are not complete.</b></p>" if unfinished else ""
    )
    pairs = [row for row in rows if row["against_direct"] is not None]
    if not pairs:
        return about + left
    ahead, behind = _decided(pairs)
    beside = len(pairs) - len(ahead) - len(behind)
    words = (
        f"<p>On the same throws, the direct map is ahead in {len(ahead)} of {len(pairs)} pairs of "
        f"rival and condition, behind in {len(behind)}, and not told apart in {beside} "
        "(McNemar&rsquo;s exact test, p below 0.05 after Holm&rsquo;s correction over the "
        "conditions of a rival).</p>"
    )
    names = ", ".join(f"{escape(r['generator'])} in &ldquo;{escape(r['condition'])}&rdquo;"
                      for r in behind[:12])  # fmt: skip
    return about + left + words + (f"<p>Behind: {names}.</p>" if behind else "")


def _decided(pairs: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """Return the rows against which the direct map is ahead, and behind."""
    sure = [row for row in pairs if row["against_direct"]["p_holm"] < _LEVEL]
    more = [row["against_direct"]["only_direct"] > row["against_direct"]["only_this"]
            for row in sure]  # fmt: skip
    ahead = [row for row, won in zip(sure, more, strict=True) if won]
    return ahead, [row for row, won in zip(sure, more, strict=True) if not won]


def duels(study: Study, rows: Sequence[Row]) -> str:
    """Return the table of paired differences, a row a condition, a column a rival."""
    rivals = [name for name in study.generators if name != REFERENCE]
    found = {(row["condition"], row["generator"]): row["against_direct"] for row in rows}
    if not rivals or REFERENCE not in study.generators:
        return ""
    table = [
        [c.name, *(_duel(found.get((c.name, rival))) for rival in rivals)] for c in study.conditions
    ]
    note = (
        "<p>Throws that only the direct map caught, minus those that only the rival caught, as a "
        "share of the throws that both had [percentage points]; in brackets p after Holm, where "
        "it is below 0.05.</p>"
    )
    return note + page.table(("condition", *rivals), table, numbers=len(rivals))


def _duel(pair: Row | None) -> str:
    """Return one paired difference."""
    if pair is None or not pair["pairs"]:
        return ""
    points = 100.0 * (pair["only_direct"] - pair["only_this"]) / pair["pairs"]
    sure = pair["p_holm"] < _LEVEL
    return f"{points:+.1f}" + (f" ({max(pair['p_holm'], 1e-4):.2g})" if sure else "")


def break_even(rows: Sequence[Row]) -> str:
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
    if not out:
        return ""
    note = (
        "<p>Straight lines between the values that were tried. Level: where the curve of a rival "
        "crosses that of the direct map.</p>"
    )
    head = ("disturbance", "generator", "half of the balls are caught at", "level with direct at")
    return note + page.table(head, out, numbers=2)


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


def every_row(rows: Sequence[Row]) -> str:
    """Return the folded table of the summary."""
    head = ("condition", "generator", "stopped by", "throws", "caught", "rate [%]",
            "95 % interval [%]", *STATUSES[1:], "position [mm]", "velocity [m/s]", "force [N]",
            "work [J]", "beyond a limit")  # fmt: skip
    table = []
    for row in rows:
        low, high = (100.0 * x for x in row["ci95"])
        median = row["median"]
        table.append([
            str(row["condition"]), str(row["generator"]),
            ", ".join(f"{reason} {count}" for reason, count in row["stopped_by"].items()),
            str(row["throws"]), str(row["caught"]),
            f"{100.0 * row['catch_rate']:.1f}", f"{low:.1f}{_TO}{high:.1f}",
            *(str(row[status]) for status in STATUSES[1:]),
            _number(median["position_error_mm"], 1), _number(median["velocity_error_m_s"], 2),
            _number(median["peak_contact_force_n"], 0), _number(median["energy_j"], 0),
            str(row["violating_throws"]),
        ])  # fmt: skip
    whole = page.table(head, table, numbers=len(head) - 3)
    return f"<details><summary>Show all {len(rows)} rows</summary>{whole}</details>"


def _number(value: float | None, digits: int) -> str:
    """Return a number, or a dash where there is none."""
    return "\u2013" if value is None else f"{value:.{digits}f}"
