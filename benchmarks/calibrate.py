"""How near the Cramer-Rao bound is a calibration from 20 views of a board with 0.2 px of noise?

    PYTHONPATH=tests python benchmarks/calibrate.py [CALIBRATIONS] [FIRST_SEED]

Each calibration has views of its own; corners are projections with Gaussian noise, seen by two
cameras 0.6 m apart with distorted lenses. Prints root mean squares of the errors and of the bounds.
"""

import sys

import numpy as np
from cramer_rao import one_calibration


def main() -> None:
    """Calibrate many times and print errors beside bounds."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 8000
    runs = [one_calibration(seed) for seed in range(first, first + count)]
    print(f"{count} calibrations, seeds {first} to {first + count - 1}")
    for name in runs[0]:
        error, bound = np.sqrt(np.mean([np.square(run[name]) for run in runs], axis=0))
        print(
            f"{name}: rms error {1e3 * error:.3f} mm, Cramer-Rao bound {1e3 * bound:.3f} mm, "
            f"ratio {error / bound:.3f}"
        )


if __name__ == "__main__":
    main()
