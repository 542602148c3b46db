"""Write the table of a finished study into a document: ``evidence_tables.py DIR docs/evidence.md``.

Between the marks ``<!-- tables -->`` and ``<!-- end of tables -->`` everything is replaced by what
``DIR/summary.json`` and ``DIR/trials.parquet`` say: catch rates, and each generator against
``direct`` on the same throws (McNemar, Holm over the conditions).
"""

import json
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from mitt.lab.trials.study_results import against

BEGIN = "<!-- tables -->"
END = "<!-- end of tables -->"
#: Corrected p from which two generators count as different.
LEVEL = 0.05
REFERENCE = "direct"
#: The generators whose intervals stand in the table; the page of the study has all.
WITH_INTERVAL = (REFERENCE, "single")

Row = dict[str, Any]


def main() -> None:
    """Replace the table of the document."""
    folder, document = Path(sys.argv[1]), Path(sys.argv[2])
    rows = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["rows"]
    rows = [row for row in rows if row["throws"]]
    text = table(rows, pairs(folder / "trials.parquet"))
    before, rest = document.read_text(encoding="utf-8").split(BEGIN)
    after = rest.split(END)[1]
    document.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")


def pairs(trials: Path) -> dict[tuple[str, str], Row]:
    """Return how each generator stands against the reference in each condition."""
    caught: dict[tuple[str, str], dict[int, bool]] = {}
    names = ["generator", "condition", "index", "status"]
    for row in pq.read_table(trials, columns=names).to_pylist():
        cell = caught.setdefault((row["generator"], row["condition"]), {})
        cell[row["index"]] = row["status"] == "caught"
    return against(caught, REFERENCE)


def table(rows: list[Row], paired: dict[tuple[str, str], Row]) -> str:
    """Return the table, as Markdown: a line a condition, a column a generator."""
    generators = list(dict.fromkeys(row["generator"] for row in rows))
    lines = [["condition", "throws", *generators], ["---"] + ["---:"] * (len(generators) + 1)]
    for condition in dict.fromkeys(row["condition"] for row in rows):
        cells = {row["generator"]: row for row in rows if row["condition"] == condition}
        throws = sorted({row["throws"] for row in cells.values()})
        count = " to ".join(str(n) for n in dict.fromkeys((throws[0], throws[-1])))
        said = [_cell(cells.get(name), paired) for name in generators]
        lines.append([condition, count, *said])
    return "\n".join("|" + "|".join(line) + "|" for line in lines)


def _cell(row: Row | None, paired: dict[tuple[str, str], Row]) -> str:
    """Return a catch rate [%], marked where it differs from that of the reference."""
    if row is None:
        return ""
    text = f"{100 * row['catch_rate']:.0f}"
    if row["generator"] in WITH_INTERVAL:
        low, high = row["ci95"]
        text += f" ({100 * low:.0f}-{100 * high:.0f})"
    pair = paired.get((row["generator"], row["condition"]))
    if pair is None or pair["p_holm"] >= LEVEL:
        return text
    return f"{text} {'-' if pair['only_direct'] > pair['only_this'] else '+'}"


if __name__ == "__main__":
    main()
