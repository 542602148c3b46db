"""A tracker of another package whose client does its worst after some places."""

import os
import signal
import sys
import time
from collections.abc import Sequence

import numpy as np

from mitt.io.cell import Cell
from mitt.robot.cell.trackers import TrackedPlace

#: Places that it sends before.
GOOD = 5


def faulty(cell: Cell) -> "Faulty":
    """Return the tracker of a cell: the entry point."""
    if cell.source.options["fault"] == "refuses":
        raise RuntimeError("no licence")
    return Faulty(str(cell.source.options["fault"]))


class Faulty:
    """Sees a ball that stands, then fails."""

    def __init__(self, fault: str) -> None:
        """Take how."""
        self._fault, self._count = fault, 0

    def places(self, timeout: float) -> Sequence[TrackedPlace]:  # noqa: ARG002
        """Return a place, five times."""
        time.sleep(0.001)
        self._count += 1
        if self._count <= GOOD:
            return [TrackedPlace(float(self._count), np.array([1.0, 0.0, 0.0]))]
        if self._fault == "blocks":
            time.sleep(1000.0)
        if self._fault == "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        if self._fault == "exits":
            sys.exit("its server has shut down")
        if self._fault == "fails":
            raise ValueError("packet 17 is cut off")
        return ()

    def trouble(self) -> str:
        """Return nothing."""
        return "its cameras are covered" if self._fault == "says" and self._count > GOOD else ""

    def close(self) -> None:
        """Nothing is to be given up."""
