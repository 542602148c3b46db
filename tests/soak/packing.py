"""A recording with its chunks and its text unpacked, and packed again with checksums that fit."""

import contextlib
import json
import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO

import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk

from mitt.io.writing import json_digest

MAGIC = b"\x89MCAP0\r\n"


def unpacked(content: bytes) -> bytes:
    """Return a file in which chunks and attachments are as they are once they are unpacked."""
    return MAGIC + b"".join(_changed(content, _opened))


def packed(content: bytes) -> bytes:
    """Return what :func:`unpacked` opened, altered or not, packed and signed where it can be."""
    return content[: len(MAGIC)] + b"".join(_changed(content, _closed))


def chunk_of(data: bytes) -> bytes:
    """Return a chunk record that packs some records, with its checksum."""
    z = zstandard.ZstdCompressor(level=3).compress(data)
    record = RecordBuilder()
    Chunk(
        data=z,
        compression="zstd",
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=zlib.crc32(data),
        uncompressed_size=len(data),
    ).write(record)
    return bytes(record.end())


def records_of(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of each record; what is cut counts as one of kind -1."""
    at = len(MAGIC)
    while at + 9 <= len(content):
        opcode, length = struct.unpack_from("<BQ", content, at)
        if at + 9 + length > len(content):
            break
        yield opcode, content[at + 9 : at + 9 + length]
        at += 9 + length
    if content[at:]:
        yield -1, content[at:]


def _changed(content: bytes, change: Callable[[int, bytes], bytes]) -> Iterator[bytes]:
    """Yield each record, some of them changed; one that cannot be stays."""
    for opcode, data in records_of(content):
        whole = data if opcode == -1 else struct.pack("<BQ", opcode, len(data)) + data
        with contextlib.suppress(Exception):  # a mutant may be anything
            whole = change(opcode, data) or whole
        yield whole


def _opened(opcode: int, data: bytes) -> bytes:
    """Return a chunk or an attachment unpacked, nothing for other records."""
    stream, record = ReadDataStream(BytesIO(data)), RecordBuilder()
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(stream)
        chunk.data = zstandard.ZstdDecompressor().decompress(chunk.data)
        chunk.write(record)
    elif opcode == Opcode.ATTACHMENT:
        attachment = Attachment.read(stream)
        attachment.data = zstandard.ZstdDecompressor().decompress(attachment.data)
        attachment.write(record)
    return bytes(record.end())


def _closed(opcode: int, data: bytes) -> bytes:
    """Return a chunk or an attachment packed and signed, nothing for other records."""
    stream, record = ReadDataStream(BytesIO(data)), RecordBuilder()
    if opcode == Opcode.CHUNK:
        return chunk_of(Chunk.read(stream).data)
    if opcode == Opcode.ATTACHMENT:
        attachment = Attachment.read(stream)
        attachment.data = zstandard.ZstdCompressor(level=3).compress(_signed(attachment.data))
        attachment.write(record)
    return bytes(record.end())


def _signed(text: bytes) -> bytes:
    """Return what a recording is about with the digest that it has, where it is JSON at all."""
    try:
        content = json.loads(text)
        stated = {key: value for key, value in content.items() if key != "digest"}
    except (ValueError, AttributeError, RecursionError):
        return text
    return json.dumps(stated | {"digest": json_digest(stated)}).encode()
