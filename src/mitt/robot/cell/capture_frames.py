"""Frames of a motion capture as they come: their stamps as times of day, and whether any comes."""

from collections import deque
from math import inf
from typing import Final, final

from mitt.clock import monotonic
from mitt.core.signals import Array
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.trackers import TrackedPlace

#: Time after which a capture has fallen silent, and after which its clock is followed only as
#: clocks drift [s].
_SILENT: Final = 1.0
_SETTLED: Final = 2.0
#: Frames that are kept until they are asked for.
_KEPT: Final = 1000


@final
class CaptureFrames:
    """Keeps what the frames of a capture show until it is asked for.

    Attributes:
        heard: When the newest frame came, or this was made, by the steady clock [s].
    """

    def __init__(self, clock: DeviceClock | None = None) -> None:
        """Know no frame yet; ``clock`` turns the capture's stamps into times of day."""
        self._clock, self._found = clock or DeviceClock(), deque[TrackedPlace](maxlen=_KEPT)
        self.heard, self._first = monotonic(), inf

    def come(self, stamp: float) -> float:
        """Note that a frame has come; return the time of day of its stamp [s]."""
        self.heard = monotonic()
        self._first = min(self._first, self.heard)
        if self.heard - self._first > _SETTLED:
            self._clock.fix()
        return self._clock.at(stamp)

    def put(self, t: float, r: Array) -> None:
        """Keep where the ball was at a time of day [s, m]; no numbers where it was not seen."""
        self._found.append(TrackedPlace(t, r))

    def take(self) -> list[TrackedPlace]:
        """Return what was kept since the last call."""
        return [self._found.popleft() for _ in range(len(self._found))]

    def silence(self, server: str, asked: str) -> str:
        """Return that no frame of a server comes, and what to ask then; nothing where some do."""
        silent = monotonic() - self.heard
        return f"no frame of {server} for {silent:.0f} s: {asked}" if silent > _SILENT else ""
