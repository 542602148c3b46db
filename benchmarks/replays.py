"""Recorded trials of every kind, replayed: are all commands the same to the bit?

python benchmarks/replays.py                    26 kinds, 8 throws each
python benchmarks/replays.py --throws 2 --only images
"""

import argparse
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from recorded_trials import CASES, recorded, replayed

SEED = 80_000


def main() -> None:
    """Throw, record, replay, and print a row for each kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=8)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    total, same = 0, 0
    statuses = Counter[str]()
    print(f"{'kind':28} identical  begins   MB/throw  replay s  statuses")
    for case in CASES:
        if options.only not in case.name:
            continue
        found, size, seconds, good, begins = Counter[str](), 0, 0.0, 0, set[str]()
        with TemporaryDirectory() as folder:
            where = Path(folder)
            for status, path in recorded(case, where, throws=options.throws, seed=options.seed):
                found[status] += 1
                size += path.stat().st_size
                start = perf_counter()
                one = replayed(path)
                seconds += perf_counter() - start
                good += one.identical
                begins.add(one.begins)
                path.unlink()
        n = options.throws
        total, same, statuses = total + n, same + good, statuses + found
        print(
            f"{case.name:28} {good:4} of {n:2}  {'/'.join(sorted(begins)):8} "
            f"{1e-6 * size / n:8.2f} {seconds / n:9.2f}  "
            + ", ".join(f"{count} {status}" for status, count in found.items()),
            flush=True,
        )
    print(f"{same} of {total} identical; {dict(statuses)}")


if __name__ == "__main__":
    main()
