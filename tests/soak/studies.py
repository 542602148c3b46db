"""A study killed by SIGKILL at random moments and resumed comes to the same as one left alone."""

import json
import random
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq

STUDY = """
name = "killed"
seed = 700
throws = 60
chunk = 10
generators = ["direct", "unoptimised"]
vision = "points"

[[conditions]]
name = "clean"

[[conditions]]
name = "kick"
scene.faults = [{ kind = "kick", magnitude = 1.0 }]
"""


def soak(kills: int, *, seed: int, folder: Path, longest: float = 20.0) -> dict[str, int]:
    """Return what a study comes to that is killed again and again.

    Args:
        kills: How often.
        seed: Seed of the moments.
        folder: An empty folder.
        longest: Longest time to a kill [s].
    """
    rng, place = random.Random(seed), folder  # noqa: S311
    study, peace, killed = place / "study.toml", place / "peace", place / "killed"
    study.write_text(STUDY)
    subprocess.run(words(study, peace), check=True)
    unreadable = rounds = 0
    for _ in range(kills):
        process = subprocess.Popen(words(study, killed))
        time.sleep(rng.uniform(0.5, longest))
        rounds += process.poll() is None
        process.kill()
        process.wait()
        unreadable += sum(not readable(path) for path in killed.rglob("*.parquet"))
        unreadable += sum(not readable(path) for path in killed.rglob("*.json"))
        if all((killed / name).exists() for name in ("summary.json", "trials.parquet")):
            for part in list(killed.glob("parts/*"))[::2]:  # it was done: give it work again
                part.unlink()
    subprocess.run(words(study, killed), check=True)
    rows = [keys(folder / "trials.parquet") for folder in (peace, killed)]
    same = all(
        (peace / n).read_bytes() == (killed / n).read_bytes()
        for n in ("summary.json", "trials.parquet")
    )
    lost, doubled = set(rows[0]) - set(rows[1]), len(rows[1]) - len(set(rows[1]))
    return {
        "kills": kills,
        "hit_while_running": rounds,
        "unreadable": unreadable,
        "lost": len(lost),
        "doubled": doubled,
        "faults": (not same) + unreadable + len(lost) + doubled,
    }


def words(study: Path, out: Path) -> list[str]:
    """Return the command."""
    return [sys.executable, "-m", "mitt", "study", str(study), "--out", str(out), "--resume"]


def readable(path: Path) -> bool:
    """Say whether a file is whole; temporary files, whose names begin with a dot, do not count."""
    if path.name.startswith("."):
        return True
    try:
        if path.suffix == ".json":
            json.loads(path.read_text())
        else:
            pq.read_table(path, page_checksum_verification=True)
    except (OSError, ValueError):
        return False
    return True


def keys(path: Path) -> list[tuple[str, str, int]]:
    """Return which throws a table holds."""
    table = pq.read_table(path, columns=["generator", "condition", "index"])
    return list(zip(*(table[name].to_pylist() for name in table.column_names), strict=True))
