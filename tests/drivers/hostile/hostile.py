"""A driver whose client does its worst in a call of a name, once the arm moves.

Its arm is where it was commanded to be. It notes in a file what it was told, and when.
"""

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.signals import ArmState, Command, Sighting
from mitt.io.cell import Cell

#: Speed of a joint from which the arm moves [rad/s].
MOVES = 0.2


def blocks() -> None:
    """Wait for ever."""
    while True:
        time.sleep(1000.0)


def holds() -> None:
    """Wait for ever and keep Python's lock."""
    ctypes.PyDLL(None).pause()


def spins() -> None:
    """Compute for ever."""
    while True:
        pass


def crashes() -> None:
    """Read where nothing is."""
    ctypes.string_at(0)


def closes() -> None:
    """Close whatever is open, then wait for ever."""
    os.closerange(3, 100)
    blocks()


def fails() -> None:
    """Raise what Python raises."""
    raise RuntimeError("reflex! [joint_velocity_violation]")


FAULTS: dict[str, Callable[[], None]] = {
    "blocks": blocks,
    "holds": holds,
    "spins": spins,
    "crashes": crashes,
    "closes": closes,
    "fails": fails,
    "exits": lambda: sys.exit("the vendor's licence has expired"),
    "ends": lambda: os._exit(3),
    "stops": lambda: os.kill(os.getpid(), signal.SIGSTOP),
    "dies": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "nothing": lambda: None,
}


def hostile(cell: Cell, arm: Arm) -> "Hostile":
    """Return the robot of a cell: the entry point."""
    return Hostile(cell, arm)


class Hostile:
    """An arm that follows exactly, and a client that fails."""

    brakes = True

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Take the call that fails and how, and the file for notes."""
        of = cell.robot.options
        self._call, self._fault = str(of["call"]), FAULTS[str(of["fault"])]
        self._notes = Path(str(of["notes"]))
        self._q, self._dq, self._n = arm.q_ready + 0.3, np.zeros(arm.n), arm.n
        self._due, self._released, self._failed = time.monotonic(), False, False
        self._note("made", "make")

    def _note(self, what: str, call: str) -> None:
        """Note what is done; fail where it is time to."""
        if what:
            with self._notes.open("a") as notes:
                notes.write(f"{time.monotonic()} {what} {os.getpid()}\n")
        now = call in ("make", "release", "close") or bool(np.max(np.abs(self._dq)) > MOVES)
        if call == self._call and now:
            if not self._failed:
                self._failed = True
                with self._notes.open("a") as notes:
                    notes.write(f"{time.monotonic()} failed {os.getpid()}\n")
            self._fault()

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return a reading a millisecond."""
        self._note("", "read")
        left = self._due - time.monotonic()
        if left > timeout:
            time.sleep(timeout)
            return ()
        time.sleep(max(left, 0.0))
        self._due = max(self._due + 1e-3, time.monotonic() - 5e-3)
        return [ArmState(t=time.time(), q=self._q, dq=self._dq)]

    def points(self) -> Sequence[Sighting]:
        """Return none."""
        self._note("", "points")
        return ()

    def write(self, command: Command, answers: float) -> None:  # noqa: ARG002
        """Be where the command says."""
        self._note("", "write")
        if self._released:
            self._q, self._dq = command.q, command.dq

    def engage_brakes(self) -> None:
        """Stop at once."""
        self._released, self._dq = False, np.zeros(self._n)
        self._note("braked", "engage_brakes")

    def release(self) -> None:
        """Follow from now on."""
        self._note("released", "release")
        self._released = True

    def waits(self) -> str:
        """Return nothing."""
        self._note("", "waits")
        return ""

    def conflict(self) -> str:
        """Return nothing."""
        return ""

    def trouble(self) -> str:
        """Return nothing."""
        self._note("", "trouble")
        return ""

    def news(self) -> Sequence[str]:
        """Return nothing."""
        return ()

    def close(self) -> None:
        """Note it."""
        self._note("closed", "close")
