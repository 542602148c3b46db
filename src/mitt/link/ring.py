"""A ring of bytes in memory that two processes share: one puts, one takes, neither waits.

The memory has a file descriptor and no name, so nothing is left behind however they end. Each side
writes one counter that the other reads: bytes put and bytes taken since the start. An entry is
``size, kind`` (two uint32), then its bytes, then padding to 8; kind 0 fills the end of the ring.
"""

import mmap
import os
import struct
import tempfile
from typing import final

import numpy as np

#: Counters before the ring: bytes put, bytes taken, entries refused, largest fill [bytes].
_PUT, _TAKEN, _REFUSED, _FULLEST = range(4)
_COUNTERS, _ALIGN = 64, 8
_HEAD = struct.Struct("<II")


@final
class Ring:
    """One end of the ring.

    Attributes:
        fd: File descriptor of the memory.
        size: Bytes for entries.
    """

    def __init__(self, fd: int, size: int) -> None:
        """Map the memory behind a descriptor."""
        self.fd, self.size = fd, size
        self._memory = mmap.mmap(fd, _COUNTERS + size)
        self._counters = np.frombuffer(self._memory, np.int64, _COUNTERS // 8)

    @classmethod
    def new(cls, size: int) -> "Ring":
        """Return the first end of a new ring with room for ``size`` bytes."""
        size += -size % _ALIGN
        try:
            fd = os.memfd_create("mitt")
        except AttributeError:  # not Linux
            fd, name = tempfile.mkstemp()
            os.unlink(name)
        os.truncate(fd, _COUNTERS + size)
        return cls(fd, size)

    @property
    def refused(self) -> int:
        """Entries for which there was no room."""
        return int(self._counters[_REFUSED])

    @property
    def ever(self) -> int:
        """Bytes put so far."""
        return int(self._counters[_PUT])

    @property
    def left(self) -> int:
        """Bytes put and not taken yet."""
        return int(self._counters[_PUT]) - int(self._counters[_TAKEN])

    @property
    def fullest(self) -> float:
        """Largest share of the ring that was ever full."""
        return float(self._counters[_FULLEST]) / self.size

    def put(self, kind: int, data: bytes) -> bool:
        """Put an entry of a kind from 1 on; False, and it is counted, where there is no room."""
        counters = self._counters
        put, room = int(counters[_PUT]), self.size
        whole = _HEAD.size + len(data)
        whole += -whole % _ALIGN
        at = put % room
        gap = room - at if room - at < whole else 0
        used = put - int(counters[_TAKEN]) + gap + whole
        if used > room:
            counters[_REFUSED] += 1
            return False
        if gap:
            _HEAD.pack_into(self._memory, _COUNTERS + at, gap, 0)
            at = 0
        start = _COUNTERS + at
        _HEAD.pack_into(self._memory, start, len(data), kind)
        self._memory[start + _HEAD.size : start + _HEAD.size + len(data)] = data
        if used > counters[_FULLEST]:
            counters[_FULLEST] = used
        counters[_PUT] = put + gap + whole  # last: the other end sees whole entries only
        return True

    def take(self) -> tuple[int, bytes] | None:
        """Return kind and bytes of the oldest entry; None where there is none."""
        counters = self._counters
        taken = int(counters[_TAKEN])
        while taken < int(counters[_PUT]):
            start = _COUNTERS + taken % self.size
            size, kind = _HEAD.unpack_from(self._memory, start)
            if kind == 0:
                taken += size
                continue
            data = self._memory[start + _HEAD.size : start + _HEAD.size + size]
            whole = _HEAD.size + size
            counters[_TAKEN] = taken + whole + -whole % _ALIGN
            return kind, data
        return None

    def close(self) -> None:
        """Let go of the memory; what was counted stays."""
        self._counters = self._counters.copy()
        self._memory.close()
        os.close(self.fd)
