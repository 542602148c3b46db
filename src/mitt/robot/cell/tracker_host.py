"""The process of a tracker: a maker's client, and the frame and stamps that mitt makes of it.

A client may wait for ever, hold Python's lock, or crash; here it can do so to itself alone. It is
asked for places, which go to the loop as sightings, and for its trouble. Once mitt is gone the
process ends.
"""

import os
import sys
import threading
from typing import final

from mitt.clock import monotonic, pause
from mitt.io.cell import Cell
from mitt.robot.cell.driver_host import join_exchange, said_of
from mitt.robot.cell.exchange import Call, Exchange, Mark
from mitt.robot.cell.trackers import TRACKERS, SourceFrame, Tracker

#: Longest for which the tracker is let wait, before orders are looked at [s].
_WAITS = 0.02
#: Time between two looks for the parent [s].
_LOOKS = 0.1


@final
class TrackerHost:
    """Asks a tracker and passes on what it sees."""

    def __init__(self, exchange: Exchange, cell: Cell) -> None:
        """Take the exchange, and the cell that names the tracker."""
        self._exchange, self._cell = exchange, cell
        self._frame, self._said = SourceFrame(cell.source), (False, "")

    def run(self) -> None:
        """Make the tracker and pass on what it sees until told to close."""
        name = f"tracker {self._cell.source.tracker!r}"
        try:
            tracker: Tracker = TRACKERS.made(self._cell.source.tracker or "", Tracker, self._cell)
        except BaseException as error:  # a client's own, SystemExit too
            self._exchange.say(Call.MAKE, said_of(name, error), raised=True)
            self._exchange.ring()
            return
        self._exchange.say(Call.MAKE, "")
        self._exchange.ring()
        while not self._exchange.orders.take():  # there is one only: to close
            self._cycle(name, tracker)
        tracker.close()

    def _cycle(self, name: str, tracker: Tracker) -> None:
        """Pass on what is seen, and what is wrong where that is new."""
        state, begun = self._exchange.state, monotonic()
        state[Mark.CALL], state[Mark.SINCE] = float(Call.POINTS), begun
        try:
            for t, r in tracker.places(_WAITS):
                p = self._frame.sighting(float(t), r)
                self._exchange.points.put(p.t, float(p.found), p.r_o, p.covariance)
            said = False, tracker.trouble()
        except BaseException as error:  # a client's own
            said = True, said_of(name, error)
            pause(_WAITS)
        state[Mark.SINCE] = 0.0
        if said != self._said:
            self._said = said
            self._exchange.say(Call.TROUBLE, said[1], raised=said[0])


def serve_tracker(bell: int, memory: int) -> None:
    """Be the process of a tracker: the loop's is the parent, and sends the cell."""
    exchange, parent, sent = join_exchange(bell, memory)
    host = TrackerHost(exchange, sent[0])

    def watch() -> None:
        """End the process once the loop's is gone."""
        while os.getppid() == parent:
            pause(_LOOKS)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    host.run()
    exchange.ring()
    os._exit(0)


if __name__ == "__main__":
    serve_tracker(*map(int, sys.argv[1:]))
