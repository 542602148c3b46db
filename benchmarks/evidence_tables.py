"""Write the tables of a finished study into a document: ``evidence_tables.py DIR DOCUMENT.md``.

Between the marks ``<!-- tables -->`` and ``<!-- end of tables -->`` everything is replaced by what
``DIR/summary.json`` and ``DIR/trials.parquet`` say: catch rates with their 95 % intervals, and each
generator against the direct map on the same throws (McNemar, Holm over the conditions). Here an
aborted throw counts as not caught; ``catch_rate`` of the summary leaves it out.
"""

import json
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from mitt.study.stats import holm, mcnemar, wilson

BEGIN, END = "<!-- tables -->", "<!-- end of tables -->"
#: Corrected p from which two generators count as different.
LEVEL = 0.05
REFERENCE, CEILING = "direct", "clairvoyant"

Row = dict[str, Any]
Cells = dict[tuple[str, str], Row]


def main() -> None:
    """Replace the tables of the document."""
    folder, document = Path(sys.argv[1]), Path(sys.argv[2])
    rows = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["rows"]
    rows = [row for row in rows if row["throws"]]
    _count_all(rows, folder / "trials.parquet")
    before, rest = document.read_text(encoding="utf-8").split(BEGIN)
    after = rest.split(END)[1]
    text = f"{BEGIN}\n\n{tables(rows)}\n\n{END}"
    document.write_text(before + text + after, encoding="utf-8")


def tables(rows: list[Row]) -> str:
    """Return all tables, as Markdown."""
    cells = {(row["condition"], row["generator"]): row for row in rows}
    conditions = list(dict.fromkeys(row["condition"] for row in rows))
    generators = list(dict.fromkeys(row["generator"] for row in rows))
    parts = [
        "### Catch rate [%], 95 % interval",
        _table(["condition", *generators], [
            [c, *(_rate(cells.get((c, g))) for g in generators)] for c in conditions
        ]),
        _total(cells, conditions, generators),
        "### Against the direct map, on the same throws",
        "Caught by the direct map alone : by the other alone, and Holm's corrected p where it is "
        f"below {LEVEL}.",
        _table(["condition", *generators[1:]], [
            [c, *(_duel(cells.get((c, g))) for g in generators[1:])] for c in conditions
        ]),
        "### Where they differ",
        _differences(rows),
        "### What became of the throws of the direct map",
        _table(["condition", "throws", "caught", "dropped", "missed", "unreachable", "aborted",
                "beyond a limit"], [_fate(cells[c, REFERENCE]) for c in conditions]),
    ]  # fmt: skip
    return "\n\n".join(parts)


def _count_all(rows: list[Row], trials: Path) -> None:
    """Let rates and pairs of the rows count every throw."""
    names = ["generator", "condition", "index", "status"]
    caught: dict[tuple[str, str], dict[int, bool]] = {}
    for row in pq.read_table(trials, columns=names).to_pylist():
        cell = caught.setdefault((row["condition"], row["generator"]), {})
        cell[row["index"]] = row["status"] == "caught"
    for row in rows:
        mine = caught[row["condition"], row["generator"]]
        row["catch_rate"] = row["caught"] / row["throws"]
        row["ci95"] = wilson(row["caught"], row["throws"])
        reference = caught.get((row["condition"], REFERENCE))
        if row["generator"] == REFERENCE or reference is None:
            row["against_direct"] = None
            continue
        both = mine.keys() & reference.keys()
        alone = sum(reference[k] and not mine[k] for k in both)
        other = sum(mine[k] and not reference[k] for k in both)
        p = mcnemar(alone, other)
        row["against_direct"] = {"only_direct": alone, "only_this": other, "p": p}
    for generator in {row["generator"] for row in rows}:
        pairs = [r["against_direct"] for r in rows if r["generator"] == generator]
        known = [pair for pair in pairs if pair is not None]
        for pair, p in zip(known, holm([pair["p"] for pair in known]), strict=True):
            pair["p_holm"] = p


def _table(head: list[str], body: list[list[str]]) -> str:
    """Return a table of Markdown."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *body]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _rate(row: Row | None) -> str:
    """Return a catch rate with its interval, in percent."""
    if row is None:
        return ""
    low, high = row["ci95"]
    return f"{100 * row['catch_rate']:.0f} ({100 * low:.0f} to {100 * high:.0f})"


def _total(cells: Cells, conditions: list[str], generators: list[str]) -> str:
    """Say how many throws there were of each generator in each condition."""
    said = []
    for g in generators:
        counts = [cells[c, g]["throws"] for c in conditions if (c, g) in cells]
        said.append(f"{g} {min(counts)} to {max(counts)}" if counts else f"{g} none")
    return f"Throws in a condition: {', '.join(said)}."


def _duel(row: Row | None) -> str:
    """Return the pairs in which one alone caught."""
    if row is None or row["against_direct"] is None:
        return ""
    pair = row["against_direct"]
    text = f"{pair['only_direct']} : {pair['only_this']}"
    return f"{text}, p = {pair['p_holm']:.2g}" if pair["p_holm"] < LEVEL else text


def _differences(rows: list[Row]) -> str:
    """List the conditions in which a generator and the direct map differ, corrected."""
    ahead: list[str] = []
    behind: list[str] = []
    for row in rows:
        pair = row["against_direct"]
        if pair is None or pair["p_holm"] >= LEVEL:
            continue
        better = pair["only_direct"] > pair["only_this"]
        line = f"{row['condition']}: {row['generator']} ({_duel(row)})"
        (ahead if better else behind).append(line)
    lost = [line for line in behind if f": {CEILING} (" not in line]
    known = [line for line in behind if line not in lost]
    parts = [("The direct map is ahead", ahead), ("It is behind", lost),
             ("It is behind the yardstick that sees the future", known)]  # fmt: skip
    return "\n\n".join(_listed(name, lines) for name, lines in parts)


def _listed(name: str, lines: list[str]) -> str:
    """Return a list with its heading and how many there are."""
    if not lines:
        return f"{name}: nowhere."
    return f"{name} ({len(lines)}):\n\n" + "\n".join(f"- {line}" for line in lines)


def _fate(row: Row) -> list[str]:
    """Return what became of the throws of a cell."""
    names = ("throws", "caught", "dropped", "missed", "unreachable", "aborted", "violating_throws")
    return [row["condition"], *(str(row[name]) for name in names)]


if __name__ == "__main__":
    main()
