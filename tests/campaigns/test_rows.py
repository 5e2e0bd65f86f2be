"""Bytes of a run come back as they were packed, or not at all; a row cannot take more memory than it may."""

from __future__ import annotations

import zlib

import numpy as np
import pyarrow as pa
import pytest

from vedette.campaigns.rows import pack, row_of, unpack, verified


def test_bytes_of_every_length_come_back() -> None:
    rng = np.random.default_rng(0)
    for size in (0, 1, 255, 256, 65_791, 65_792, 600_000, 3_000_000):  # a frame says its size in 1, 2, 4 bytes
        content = rng.bytes(size // 2) + bytes(size - size // 2)
        assert unpack(pack("cell", 1, content).content) == content


def test_rows_that_zlib_packed_are_read() -> None:
    row = row_of("cell", 1, b"run" * 99, b"seconds", b"measures").values(1)
    older = [zlib.compress(unpack(part), 1) if place in (3, 5, 7) else part for place, part in enumerate(row)]
    assert verified(tuple(older)) == verified(row)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda packed: packed[:4],
        lambda packed: packed[:5],
        lambda packed: packed[:-1],
        lambda packed: packed + b"behind it",
        lambda packed: packed[:4] + b"\xff" + packed[5:],  # eight bytes of size, and a dictionary
        lambda packed: packed[:5] + b"\xff" + packed[6:],
        lambda packed: packed.replace(b"\x28\xb5", b"\x28\xb6"),
        lambda packed: b"",
        lambda packed: None,
        lambda packed: "text",
    ],
)
def test_other_bytes_are_no_run(spoil) -> None:
    row = list(row_of("cell", 1, b"run" * 99, b"seconds").values(1))
    row[3] = spoil(row[3])
    assert verified(tuple(row)) is None


def test_a_small_row_does_not_unpack_to_a_large_one() -> None:
    packed = pack("cell", 0, bytes(2**27)).content
    assert len(packed) < 2**14
    with pytest.raises(ValueError, match="it unpacks to more than"):
        unpack(packed)


def test_what_would_unpack_to_too_much_is_refused_before_it_does() -> None:
    before = pa.total_allocated_bytes()
    for packed in (pack("cell", 1, bytes(3_000_000)).content, zlib.compress(bytes(3_000_000))):
        with pytest.raises(ValueError, match="more than 1000000 bytes"):
            unpack(packed, 1_000_000)
    vast = b"\x28\xb5\x2f\xfd\xe0" + (2**62).to_bytes(8, "little") + b"\x01\x00\x00"
    with pytest.raises(ValueError, match="more than"):
        unpack(vast)
    honest = pack("cell", 1, bytes(3_000_000)).content
    size = (3_000_000).to_bytes(4, "little")
    lying = honest.replace(size, (1000).to_bytes(4, "little"))
    assert size in honest
    with pytest.raises(ValueError, match="too small"):
        unpack(lying)
    assert pa.total_allocated_bytes() == before
