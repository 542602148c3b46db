"""Sockets that hear one network interface alone, whatever address their library binds them to."""

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from mitt.errors import InputError


def _sockets() -> dict[int, str]:
    """Return the sockets of this process: file descriptor, and what the kernel calls it."""
    found = {}
    for name in os.listdir("/proc/self/fd"):
        with suppress(OSError):
            place = os.readlink(f"/proc/self/fd/{name}")
            if place.startswith("socket:"):
                found[int(name)] = place
    return found


@contextmanager
def kept_to(interface: str) -> Iterator[None]:
    """Bind each UDP socket that is made inside the block to an interface.

    Cyclone DDS 11 binds its receiving sockets to all addresses, whatever interface it is told to
    use. So bound, the kernel drops what comes in by any other interface.

    Raises:
        InputError: The system does not allow it.
    """
    if sys.platform != "linux":
        raise InputError("robot.options.interface", "Linux for the loopback alone", sys.platform,
                         do="name another interface")  # fmt: skip
    before = _sockets()
    yield
    for fd, place in _sockets().items():
        if before.get(fd) == place:
            continue
        with socket.socket(fileno=os.dup(fd)) as one:
            if one.type == socket.SOCK_DGRAM and one.family in (socket.AF_INET, socket.AF_INET6):
                _bind(one, interface)


def _bind(one: socket.socket, interface: str) -> None:
    """Bind a socket to an interface."""
    try:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode() + b"\0")
    except OSError as error:
        do = "needs Linux 5.7 or the capability CAP_NET_RAW; or name another interface"
        raise InputError("robot.options.interface", f"sockets bound to {interface}",
                         error.strerror, do=do) from None  # fmt: skip
