"""Any motion capture by ``motioncapture``: Vicon, VRPN, OptiTrack, Qualisys; none real so far.

Options of ``[source.options]``:

| option  | what                                                                               |
|---------|------------------------------------------------------------------------------------|
| kind    | ``vicon``, ``vrpn``, ``optitrack``, ``qualisys``, ``mock``: what the library has    |
| address | of the computer with the tracker's software; "127.0.0.1" if left out               |
| body    | name of the ball's rigid body there; "ball" if left out                            |

It passes on no stamps: a place is stamped as it arrives, and ``source.latency`` says how long it
was on its way. Where the tracker's jitter is more than 3 ms (15 mm of flight), prefer ``natnet`` or
``qtm``, which have stamps.
"""

from collections.abc import Sequence
from typing import Any, Final, final

import numpy as np

from mitt.clock import time_of_day
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, check_package
from mitt.io.cell import Cell
from mitt.robot.cell.plugins import given_options
from mitt.robot.cell.trackers import TrackedPlace

_KINDS: Final = ("vicon", "vrpn", "optitrack", "qualisys", "mock")
_OPTIONS: Final = {"kind": "", "address": "127.0.0.1", "body": "ball"}


def check_motioncapture(cell: Cell, arm: Arm) -> list[str]:  # noqa: ARG001 (the arm is not asked for)
    """Refuse options that cannot be; connects to nothing: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    if of["kind"] not in _KINDS:
        raise InputError("source.options.kind", f"one of {', '.join(_KINDS)}", of["kind"] or "none")
    check_package("tracker 'motioncapture'", "motioncapture", "motioncapture", "motioncapture")
    return [f"{of['kind']} at {of['address']} has to track the rigid body {of['body']}"]


def motioncapture_tracker(cell: Cell) -> "CaptureTracker":
    """Return the tracker of a cell: the entry point."""
    of = given_options("source.options", cell.source.options, _OPTIONS)
    import motioncapture  # noqa: PLC0415 (the extra motioncapture)

    return CaptureTracker(
        motioncapture.connect(of["kind"], {"hostname": of["address"]}), of["body"]
    )


@final
class CaptureTracker:
    """What a motion capture sees; see :class:`mitt.robot.cell.trackers.Tracker`."""

    def __init__(self, connection: Any, body: str) -> None:  # noqa: ANN401
        """Take a connection, ``motioncapture.MotionCapture``, and the name of the ball."""
        self._connection, self._body = connection, body

    def places(self, timeout: float) -> Sequence[TrackedPlace]:  # noqa: ARG002 (it has no time-out)
        """Return what the next frame sees: it waits for that."""
        self._connection.waitForNextFrame()
        t, body = time_of_day(), self._connection.rigidBodies.get(self._body)
        place = np.full(3, np.nan) if body is None else np.array(body.position, dtype=np.float64)
        return (TrackedPlace(t, place),)

    def trouble(self) -> str:
        """Return nothing: while no frame comes it waits, which is seen."""
        return ""

    def close(self) -> None:
        """Nothing can be given up."""
