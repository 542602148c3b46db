"""OptiTrack by NatNet: what Motive streams, by the client ``natnet``. No real camera was used yet.

Options of ``[source.options]``:

| option     | what                                                                            |
|------------|---------------------------------------------------------------------------------|
| address    | of the computer with Motive; "127.0.0.1" if left out                            |
| local      | address of this computer in that network; "127.0.0.1" if left out               |
| multicast  | as Motive is set to stream; true if left out                                    |
| rigid_body | streaming ID of the ball's rigid body; 0, if left out, for a loose marker       |
| tick_rate  | of the stamps of exposure: that of Windows' counter, 1e7 Hz, if left out        |

Motive streams metres, y up unless it is set to z up: ``source.rpy`` turns it. The stamp of a frame
is the middle of its exposure: Motive says how long ago that was when it sends the frame, and the
frame that came fastest how far its clock is behind.
"""

import threading
from collections.abc import Sequence
from typing import Any, Final, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, MittError, check_package
from mitt.core.signals import Array
from mitt.io.cell import Cell
from mitt.robot.cell.capture_frames import CaptureFrames
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.loose_markers import LooseMarkers
from mitt.robot.cell.plugins import given_options
from mitt.robot.cell.trackers import TrackedPlace

_OPTIONS: Final = {
    "address": "127.0.0.1",
    "local": "127.0.0.1",
    "multicast": True,
    "rigid_body": 0.0,
    "tick_rate": 1e7,
}
#: Time in which Motive has to answer [s].
_ANSWERS: Final = 5.0
#: Time after which it is looked whether the ticks are as fast as they are said to be [s], and by
#: what share they may be off.
_WATCHED: Final = 1.0
_OFF: Final = 0.02


def check_natnet(cell: Cell, arm: Arm) -> list[str]:  # noqa: ARG001 (the arm is not asked for)
    """Refuse options that cannot be; connects to nothing: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    if of["rigid_body"] != int(of["rigid_body"]) or of["rigid_body"] < 0.0:
        raise InputError("source.options.rigid_body", "a streaming ID", of["rigid_body"])
    if not 1e3 <= of["tick_rate"] <= 1e10:
        raise InputError("source.options.tick_rate", "1e3 to 1e10 Hz", of["tick_rate"])
    check_package("tracker 'natnet'", "natnet", "natnet", "natnet")
    what = f"rigid body {of['rigid_body']:.0f}" if of["rigid_body"] else "a loose marker"
    return [f"Motive at {of['address']} has to stream {what}, in metres"]


def natnet_tracker(cell: Cell) -> "NatNetTracker":
    """Return the tracker of a cell: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    from natnet import NatNetClient  # noqa: PLC0415 (the extra natnet)

    client = NatNetClient(
        server_ip_address=of["address"],
        local_ip_address=of["local"],
        use_multicast=of["multicast"],
    )
    tracker = NatNetTracker(client, rigid_body=int(of["rigid_body"]), tick_rate=of["tick_rate"])
    try:
        client.connect(_ANSWERS)
    except TimeoutError as error:
        raise MittError(
            f"tracker 'natnet': Motive does not answer at {of['address']}: stream there,"
            " multicast or not as source.options.multicast says"
        ) from error
    client.run_async()
    return tracker


@final
class NatNetTracker:
    """What Motive sees; see :class:`mitt.robot.cell.trackers.Tracker`."""

    def __init__(
        self,
        client: Any,  # noqa: ANN401 (natnet.NatNetClient)
        *,
        rigid_body: int = 0,
        tick_rate: float = 1e7,
        clock: DeviceClock | None = None,
    ) -> None:
        """Hear what a client receives.

        Args:
            client: ``natnet.NatNetClient``.
            rigid_body: Streaming ID of the ball; 0 for a loose marker.
            tick_rate: Of the stamps of exposure [Hz].
            clock: Turns Motive's stamps into times of day.
        """
        self._client, self._body, self._rate = client, rigid_body, tick_rate
        self._frames, self._markers = CaptureFrames(clock), LooseMarkers()
        self._came, self._trouble = threading.Event(), ""
        self._first: tuple[float, float] | None = None
        client.on_data_frame_received_event.handlers.append(self._take)

    def _take(self, frame: Any) -> None:  # noqa: ANN401 (natnet.DataFrame)
        """Take a frame; the client calls it."""
        of = frame.suffix
        if not of.stamp_transmit or not of.stamp_camera_mid_exposure:
            self._trouble = "Motive sends no stamps of exposure: NatNet 3.0 or later does"
            return
        sent = of.stamp_transmit / self._rate
        ago = (of.stamp_transmit - of.stamp_camera_mid_exposure) / self._rate
        t = self._frames.come(sent) - ago
        self._watch(sent)
        self._frames.put(t, self._place(t, frame))
        self._came.set()

    def _watch(self, sent: float) -> None:
        """Hold the ticks to what they are said to be."""
        heard = self._frames.heard
        if self._first is None:
            self._first = sent, heard
        passed, ticked = heard - self._first[1], sent - self._first[0]
        if passed > _WATCHED:
            off = abs(ticked / passed - 1.0) > _OFF
            rate = self._rate * ticked / passed
            self._trouble = (
                f"its stamps go on by {rate:.3g} a second: say that in source.options.tick_rate"
                if off
                else ""
            )

    def _place(self, t: float, frame: Any) -> Array:  # noqa: ANN401
        """Return where the ball is in a frame."""
        if not self._body:
            return self._markers.ball(t, np.array(frame.unlabeled_marker_pos).reshape(-1, 3))
        for body in frame.rigid_bodies:
            if body.id_num == self._body and body.tracking_valid is not False:
                return np.array(body.pos, dtype=np.float64)
        return np.full(3, np.nan)

    def places(self, timeout: float) -> Sequence[TrackedPlace]:
        """Return what was seen since the last call."""
        self._came.wait(timeout)
        self._came.clear()
        return self._frames.take()

    def trouble(self) -> str:
        """Return why it sees nothing."""
        return self._trouble or self._frames.silence("Motive", "does it stream?")

    def close(self) -> None:
        """Give the link up."""
        self._client.shutdown()
