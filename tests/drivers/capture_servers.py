"""The other side of two motion captures: packets as Motive and QTM send them.

What they send is read by the makers' own clients, which are the judge of the bytes; when and what
the real programs send is believed.
"""

import asyncio
import socket
import struct
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mitt.core.signals import Array

#: Ticks of Motive's stamps [Hz].
TICKS = 1e7
_VERSION = (4, 1, 0, 0)


def server_info() -> bytes:
    """Return what Motive answers to a client that connects: NAT_SERVERINFO."""
    body = b"Motive".ljust(256, b"\0") + bytes((3, 1, 0, 0)) + bytes(_VERSION)
    return struct.pack("<HH", 1, len(body)) + body


def motive_frame(
    number: int,
    loose: Sequence[Array],
    *,
    exposed: float,
    sent: float,
    body: Array | None = None,
) -> bytes:
    """Return a frame of NatNet 4.1: NAT_FRAMEOFDATA.

    Args:
        number: Its number.
        loose: Places of markers that belong to no body [m].
        exposed: Middle of the exposure, by Motive's clock [s].
        sent: When it is sent, by that clock [s].
        body: Place of rigid body 7 [m]; none where it is not tracked.
    """

    def part(rows: Sequence[bytes]) -> bytes:
        """Return a list with its count and its size."""
        joined = b"".join(rows)
        return struct.pack("<II", len(rows), len(joined)) + joined

    place = np.zeros(3) if body is None else body
    of_body = struct.pack("<I8fH", 7, *place, 0.0, 0.0, 0.0, 1.0, 0.0, int(body is not None))
    stamps = [round(TICKS * t) for t in (exposed, exposed, sent)]
    data = struct.pack("<i", number)
    data += part([]) + part([struct.pack("<3f", *r) for r in loose]) + part([of_body])
    data += part([]) * 5  # skeletons, assets, labelled markers, force plates, devices
    data += struct.pack("<IId3QH", 0, 0, exposed, *stamps, 0)
    return struct.pack("<HH", 7, len(data)) + data


class Motive(threading.Thread):
    """A server of NatNet that sends frames to one client, in real time.

    Attributes:
        port: Of its commands.
    """

    def __init__(self, frame: Callable[[int], bytes], rate: float) -> None:
        """Take what makes a frame of its number, and how many go out a second."""
        super().__init__(daemon=True)
        self._frame, self._rate, self.over = frame, rate, threading.Event()
        self._commands = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._commands.bind(("127.0.0.1", 0))
        self._commands.settimeout(0.01)
        self.port = self._commands.getsockname()[1]

    def run(self) -> None:
        """Answer, and send."""
        client, number = None, 0
        while not self.over.is_set():
            try:
                said, client = self._commands.recvfrom(1024)
                if said[:2] == b"\0\0":
                    self._commands.sendto(server_info(), client)
            except TimeoutError:
                pass
            if client is not None:
                number += 1
                self._commands.sendto(self._frame(number), client)
                self.over.wait(1.0 / self._rate)


def qtm_packet(stamp: float, markers: Sequence[Array], *, labelled: bool) -> bytes:
    """Return a data packet of QTM's protocol: a time of exposure [s], places [m]."""
    kind, each = (1, "<3f") if labelled else (2, "<3fi")
    rows = b"".join(
        struct.pack(each, *(1e3 * r), *([] if labelled else [k])) for k, r in enumerate(markers)
    )
    component = struct.pack("<IHH", len(markers), 0, 0) + rows
    head = struct.pack("<qII", round(1e6 * stamp), 1, 1)
    data = head + struct.pack("<II", 8 + len(component), kind) + component
    return struct.pack("<II", 8 + len(data), 3) + data


class Qtm(threading.Thread):
    """A server of QTM's protocol that sends packets to one client, in real time.

    Attributes:
        port: Of its protocol.
    """

    def __init__(self, packet: Callable[[int], bytes], rate: float, labels: Sequence[str]) -> None:
        """Take what makes a packet of its number, how many go out a second, and trajectories."""
        super().__init__(daemon=True)
        self._packet, self._rate, self._labels = packet, rate, labels
        self._ready, self.port = threading.Event(), 0

    def begin(self) -> int:
        """Listen; return the port."""
        self.start()
        assert self._ready.wait(10.0)
        return self.port

    def run(self) -> None:
        """Serve."""
        self._loop = asyncio.new_event_loop()
        self._loop.run_until_complete(self._serve())

    async def _serve(self) -> None:
        """Listen until the end."""
        self._over = asyncio.Event()
        server = await asyncio.start_server(self._talk, "127.0.0.1", 0)
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        async with server:
            await self._over.wait()

    async def _talk(self, hears: asyncio.StreamReader, says: asyncio.StreamWriter) -> None:
        """Answer commands, then stream."""

        def say(kind: int, text: str) -> None:
            data = text.encode() + b"\0"
            says.write(struct.pack("<II", 8 + len(data), kind) + data)

        say(1, "QTM RT Interface connected")
        while True:
            size, _ = struct.unpack("<II", await hears.readexactly(8))
            said = (await hears.readexactly(size - 8)).rstrip(b"\0").decode()
            if said.startswith("version"):
                say(1, f"Version set to {said.split()[1]}")
            elif said.startswith("getparameters"):
                names = "".join(f"<Label><Name>{x}</Name></Label>" for x in self._labels)
                say(2, f"<QTM_Parameters><The_3D>{names}</The_3D></QTM_Parameters>")
            elif said.startswith("streamframes"):
                break
        for number in range(10**6):
            says.write(self._packet(number))
            await asyncio.sleep(1.0 / self._rate)

    def end(self) -> None:
        """Close all."""
        self._loop.call_soon_threadsafe(self._over.set)


def parsed_frame(data: bytes) -> Any:  # noqa: ANN401 (natnet.DataFrame)
    """Return a frame as the client ``natnet`` reads it."""
    from natnet.data_frame import DataFrame  # noqa: PLC0415
    from natnet.packet_buffer import PacketBuffer  # noqa: PLC0415
    from natnet.version import Version  # noqa: PLC0415

    return DataFrame.read_from_buffer(PacketBuffer(data[4:]), Version(*_VERSION))
