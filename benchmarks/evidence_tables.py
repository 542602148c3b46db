"""Write tables of a finished study into a document: ``evidence_tables.py DIR docs/evidence.md``.

Between the marks ``<!-- tables -->`` and ``<!-- end of tables -->`` everything is replaced by what
``DIR/summary.json`` and ``DIR/trials.parquet`` say: catch rates with their 95 % intervals, and each
generator against the direct map on the same throws (McNemar, Holm over the conditions).
"""

import json
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from mitt.trials.result import STATUSES
from mitt.trials.study_results import against

BEGIN, END = "<!-- tables -->", "<!-- end of tables -->"
#: Corrected p from which two generators count as different.
LEVEL = 0.05
CEILING = "clairvoyant"
#: What the others are held against, by the name that the tables give it.
REFERENCES = {"direct": "the direct map", "several": "several maps"}

Row = dict[str, Any]
Cells = dict[tuple[str, str], Row]


def main() -> None:
    """Replace the tables of the document."""
    folder, document = Path(sys.argv[1]), Path(sys.argv[2])
    rows = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["rows"]
    rows = [row for row in rows if row["throws"]]
    _add_pairs(rows, folder / "trials.parquet")
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
        *(part for r in REFERENCES if r in generators
          for part in _against(r, cells, conditions, generators)),
        *(part for r, name in REFERENCES.items() if r in generators for part in (
            f"### What became of the throws of {name}",
            _table(["condition", "throws", *STATUSES, "beyond a limit"],
                   [_fate(cells[c, r]) for c in conditions if (c, r) in cells]),
        )),
    ]  # fmt: skip
    return "\n\n".join(parts)


def _against(
    reference: str, cells: Cells, conditions: list[str], generators: list[str]
) -> list[str]:
    """Return the tables that hold all others against one generator."""
    name, others = REFERENCES[reference], [g for g in generators if g != reference]
    return [
        f"### Against {name}, on the same throws",
        f"Caught by {name} alone : by the other alone, and Holm's corrected p where it is below "
        f"{LEVEL}.",
        _table(["condition", *others], [
            [c, *(_duel(cells.get((c, g)), reference) for g in others)] for c in conditions
        ]),
        _differences(list(cells.values()), reference),
    ]  # fmt: skip


def _add_pairs(rows: list[Row], trials: Path) -> None:
    """Add the pairs with each reference to the rows."""
    names = ["generator", "condition", "index", "status"]
    caught: dict[tuple[str, str], dict[int, bool]] = {}
    for row in pq.read_table(trials, columns=names).to_pylist():
        cell = caught.setdefault((row["generator"], row["condition"]), {})
        cell[row["index"]] = row["status"] == "caught"
    pairs = {name: against(caught, name) for name in REFERENCES}
    for row in rows:
        place = row["generator"], row["condition"]
        row["against"] = {name: found[place] for name, found in pairs.items() if place in found}


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


def _duel(row: Row | None, reference: str) -> str:
    """Return the pairs in which one alone caught."""
    pair = None if row is None else row["against"].get(reference)
    if pair is None:
        return ""
    text = f"{pair['only_direct']} : {pair['only_this']}"
    return f"{text}, p = {pair['p_holm']:.2g}" if pair["p_holm"] < LEVEL else text


def _differences(rows: list[Row], reference: str) -> str:
    """List the conditions in which a generator and the reference differ, corrected."""
    ahead: list[str] = []
    behind: list[str] = []
    for row in rows:
        pair = row["against"].get(reference)
        if pair is None or pair["p_holm"] >= LEVEL:
            continue
        line = f"{row['condition']}: {row['generator']} ({_duel(row, reference)})"
        (ahead if pair["only_direct"] > pair["only_this"] else behind).append(line)
    lost = [line for line in behind if f": {CEILING} (" not in line]
    known = [line for line in behind if line not in lost]
    name = REFERENCES[reference]
    parts = [(f"Ahead with {name}", ahead), ("Behind", lost),
             ("Behind the oracle that knows the flight", known)]  # fmt: skip
    return "\n\n".join(_listed(title, lines) for title, lines in parts)


def _listed(name: str, lines: list[str]) -> str:
    """Return a list with its heading and how many there are."""
    if not lines:
        return f"{name}: nowhere."
    return f"{name} ({len(lines)}):\n\n" + "\n".join(f"- {line}" for line in lines)


def _fate(row: Row) -> list[str]:
    """Return what became of the throws of a cell."""
    names = ("throws", *STATUSES, "violating_throws")
    return [row["condition"], *(str(row[name]) for name in names)]


if __name__ == "__main__":
    main()
