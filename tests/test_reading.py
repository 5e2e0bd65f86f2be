"""Content of unknown origin takes no more time and memory than there is of it."""

from __future__ import annotations

import json
import os
import tracemalloc
from pathlib import Path

import pytest

from vedette.internal.reading import parse_json, read_file


def test_a_file_takes_the_memory_of_what_is_in_it(tmp_path: Path) -> None:
    """Not that of the largest which would be read: a gigabyte, which there need not be."""
    file = tmp_path / "small"
    file.write_bytes(b"0123456789" * 1000)
    tracemalloc.start()
    try:
        content = read_file(file)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert content == b"0123456789" * 1000
    assert peak < 200_000


@pytest.mark.parametrize("length", [0, 1, 999, 1000])
def test_a_file_is_read_whole_up_to_the_limit(length: int, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"x" * length)
    assert read_file(file, 1000) == b"x" * length


def test_what_is_written_while_a_file_is_read_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"x" * 1000)
    true = os.fstat

    def earlier(number: int) -> os.stat_result:
        return os.stat_result((*true(number)[:6], 100, *true(number)[7:10]))

    monkeypatch.setattr(os, "fstat", earlier)
    assert read_file(file) == b"x" * 1000
    with pytest.raises(ValueError, match="more than 999 bytes"):
        read_file(file, 999)


def test_one_key_twice_among_very_many_is_found_at_once() -> None:
    """Each key was counted among all of them: minutes for a megabyte."""
    text = json.dumps({f"k{number}": 0 for number in range(150_000)})
    assert len(parse_json(text)) == 150_000
    with pytest.raises(ValueError, match="the key 'k149999' stands there twice"):
        parse_json(text[:-1] + ', "k149999": 0}')
