"""A finished run as a row of the store: packed where it was done, verified whenever it is read.

Every row carries checksums, over its cell and run number too, of what was packed.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any, NamedTuple

import pyarrow as pa

from vedette.internal.reading import MOST_BYTES, error_summary, inflate

_ZSTD = pa.Codec("zstd", compression_level=-1)  # to a third of the size; 4 % less takes a third longer
# Bytes of a row are packed to a third; those that unpack to more than this are no row.
_MOST_TIMES, _SMALL = 1000, 2**20
_MAGIC = b"\x28\xb5\x2f\xfd"  # that its frames begin with


class Packed(NamedTuple):
    """Some bytes of a run as they are kept: compressed, with the checksum of what they were before."""

    content: bytes
    checksum: str


def pack(cell: str, run: int, content: bytes) -> Packed:
    """What is kept of some bytes of a run."""
    return Packed(_ZSTD.compress(content, asbytes=True), _checksum(cell, run, content))


def unpack(packed: bytes, most: int = MOST_BYTES) -> bytes:
    """What was packed into these bytes, by zstd or, before that, by zlib. Raises `ValueError` for others.

    A frame of zstd says what it unpacks to (RFC 8878, 3.1.1.1); it is that, or refused before it takes the memory.
    """
    most = min(most, _SMALL + _MOST_TIMES * len(packed))
    if packed[: len(_MAGIC)] != _MAGIC:
        return inflate(packed, most)
    descriptor = int.from_bytes(packed[4:5], "little")
    flag, single = descriptor >> 6, descriptor >> 5 & 1
    field = packed[6 - single :][: (single, 2, 4, 8)[flag]]
    size = int.from_bytes(field, "little") + 256 * (flag == 1)
    if size > most:
        raise ValueError(f"it unpacks to more than {most} bytes")
    try:
        content: bytes = _ZSTD.decompress(packed, decompressed_size=size, asbytes=True)
    except OSError as error:
        raise ValueError(error_summary(error)) from None
    return content


@dataclass(frozen=True, slots=True)
class Row:
    """One finished run, to be kept.

    Attributes:
        cell, run: which.
        payload, timings: the run, and what the clock said of it.
        metrics: what was measured of it; packed of no bytes where nothing was, as it can be measured again.
    """

    cell: str
    run: int
    payload: Packed
    metrics: Packed
    timings: Packed

    def values(self, session: int) -> tuple[Any, ...]:
        """Of the columns of the store."""
        return (self.cell, self.run, session, *self.payload, *self.metrics, *self.timings)


def row_of(cell: str, run: int, payload: bytes, timings: bytes, metrics: bytes = b"") -> Row:
    """A finished run, packed."""
    return Row(cell, run, *(pack(cell, run, part) for part in (payload, metrics, timings)))


@dataclass(frozen=True, slots=True)
class Entry:
    """One finished run as it was kept.

    Attributes:
        cell, run: which.
        session: that it was handed in by, counted from 1.
        payload, metrics, timings: as of `Row`, unpacked.
    """

    cell: str
    run: int
    session: int
    payload: bytes
    metrics: bytes
    timings: bytes

    @property
    def checksum(self) -> str:
        """SHA-256 of the run's cell, number and payload: equal for equal results, whenever they were computed."""
        return _checksum(self.cell, self.run, self.payload)


def verified(values: tuple[Any, ...]) -> Entry | None:
    """The run in the columns of the store; None where it is not as it was written."""
    cell, run, session, *packed = values
    if not isinstance(cell, str) or not isinstance(run, int) or not isinstance(session, int):
        return None
    try:
        parts = [unpack(part) for part in packed[::2]]
    except (ValueError, TypeError):
        return None
    intact = [_checksum(cell, run, part) for part in parts] == packed[1::2]
    return Entry(cell, run, session, *parts) if intact else None


def _checksum(cell: str, run: int, content: bytes) -> str:
    digest = hashlib.sha256(f"{cell}\n{run}\n".encode())
    digest.update(content)
    return digest.hexdigest()
