"""A finished run as a row of the store: packed where it was done, verified whenever it is read.

Every row carries checksums, over its cell and run number too, of what was packed.
"""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass
from typing import Any, NamedTuple

from vedette.reading import inflate

_LEVEL = 1  # of zlib: half the size in under a millisecond, and higher levels gain little


class Packed(NamedTuple):
    """Some bytes of a run as they are kept: compressed, with the checksum of what they were before."""

    content: bytes
    checksum: str


def pack(cell: str, run: int, content: bytes) -> Packed:
    """What is kept of some bytes of a run."""
    return Packed(zlib.compress(content, _LEVEL), _checksum(cell, run, content))


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
        parts = [inflate(part) for part in packed[::2]]
    except (ValueError, TypeError):
        return None
    intact = [_checksum(cell, run, part) for part in parts] == packed[1::2]
    return Entry(cell, run, session, *parts) if intact else None


def _checksum(cell: str, run: int, content: bytes) -> str:
    return hashlib.sha256(f"{cell}\n{run}\n".encode() + content).hexdigest()
