"""Qualisys by QTM's real-time protocol and its maker's client ``qtm_rt``. No real one was used yet.

Options of ``[source.options]``:

| option  | what                                                                               |
|---------|------------------------------------------------------------------------------------|
| address | of the computer with QTM; "127.0.0.1" if left out                                  |
| port    | of its little-endian protocol; 22223 if left out                                   |
| label   | of the ball's trajectory in QTM; "", if left out, for a loose marker               |

QTM sends millimetres, and as stamp the time of exposure since its measurement began. How long a
frame takes from there is not in it: ``source.latency`` takes it away.
"""

import asyncio
from collections.abc import Sequence
from typing import Any, Final, final

import numpy as np
from defusedxml import ElementTree

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, MittError, check_package
from mitt.core.signals import Array
from mitt.io.cell import Cell
from mitt.robot.cell.capture_frames import CaptureFrames
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.loose_markers import LooseMarkers
from mitt.robot.cell.plugins import given_options
from mitt.robot.cell.trackers import TrackedPlace

_OPTIONS: Final = {"address": "127.0.0.1", "port": 22223.0, "label": ""}


def check_qtm(cell: Cell, arm: Arm) -> list[str]:  # noqa: ARG001 (the arm is not asked for)
    """Refuse options that cannot be; connects to nothing: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    if of["port"] != int(of["port"]) or not 0 < of["port"] < 65536:
        raise InputError("source.options.port", "a port", of["port"])
    check_package("tracker 'qtm'", "qtm_rt", "qtm-rt", "qtm")
    what = f"the trajectory {of['label']}" if of["label"] else "a loose marker"
    return [f"QTM at {of['address']} has to measure {what}"]


def qtm_tracker(cell: Cell) -> "QtmTracker":
    """Return the tracker of a cell: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    return QtmTracker(of["address"], int(of["port"]), of["label"])


@final
class QtmTracker:
    """What QTM sees; see :class:`mitt.robot.cell.trackers.Tracker`."""

    def __init__(
        self, address: str, port: int, label: str = "", *, clock: DeviceClock | None = None
    ) -> None:
        """Connect and let QTM stream.

        Args:
            address: Of the computer with QTM.
            port: Of its protocol.
            label: Of the ball's trajectory; empty for a loose marker.
            clock: Turns QTM's stamps into times of day.

        Raises:
            MittError: QTM does not answer, or has no such trajectory.
        """
        self._frames, self._markers = CaptureFrames(clock), LooseMarkers()
        self._lost, self._index = "", -1
        self._loop = asyncio.new_event_loop()
        self._came = asyncio.Event()
        self._loop.run_until_complete(self._connect(address, port, label))

    async def _connect(self, address: str, port: int, label: str) -> None:
        """Connect, find the label, and begin the stream."""
        import qtm_rt  # noqa: PLC0415 (the extra qtm)

        made = await qtm_rt.connect(address, port=port, on_disconnect=self._lose, loop=self._loop)
        if made is None:
            do = "start it, with its real-time server on"
            raise MittError(f"tracker 'qtm': QTM does not answer at {address}, port {port}: {do}")
        if label:
            self._index = _index_of(label, await made.get_parameters(parameters=["3d"]))
        kind = "3d" if label else "3dnolabels"
        await made.stream_frames(components=[kind], on_packet=self._take)
        self._connection = made

    def _lose(self, reason: object) -> None:
        """Note that QTM has closed the link."""
        self._lost = f"QTM has closed its link: {reason}".removesuffix(": None")

    def _take(self, packet: Any) -> None:  # noqa: ANN401 (qtm_rt.QRTPacket)
        """Take a frame; the client calls it."""
        t = self._frames.come(1e-6 * packet.timestamp)
        self._frames.put(t, self._place(t, packet))
        self._came.set()

    def _place(self, t: float, packet: Any) -> Array:  # noqa: ANN401
        """Return where the ball is in a frame [m]."""
        read = packet.get_3d_markers() if self._index >= 0 else packet.get_3d_markers_no_label()
        markers = [] if read is None else read[1]
        places = 1e-3 * np.array([(m.x, m.y, m.z) for m in markers]).reshape(-1, 3)
        if self._index < 0:
            return self._markers.ball(t, places)
        found: Array = places[self._index] if self._index < len(places) else np.full(3, np.nan)
        return found

    def places(self, timeout: float) -> Sequence[TrackedPlace]:
        """Return what was seen since the last call."""
        self._loop.run_until_complete(self._wait(timeout))
        return self._frames.take()

    async def _wait(self, timeout: float) -> None:
        """Wait for a frame, for a time [s]."""
        try:
            await asyncio.wait_for(self._came.wait(), timeout)
        except TimeoutError:
            return
        self._came.clear()

    def trouble(self) -> str:
        """Return why it sees nothing."""
        return self._lost or self._frames.silence("QTM", "does it measure?")

    def close(self) -> None:
        """Give the link up."""
        self._connection.disconnect()
        self._loop.run_until_complete(asyncio.sleep(0))
        self._loop.close()


def _index_of(label: str, said: bytes) -> int:
    """Return the place of a label among the trajectories that QTM says it has."""
    names = [x.text or "" for x in ElementTree.fromstring(said).iter("Name")]
    if label not in names:
        shown = ", ".join(names)[:200] or "none"
        raise MittError(f"tracker 'qtm': QTM has no trajectory {label!r}, but {shown}")
    return names.index(label)
