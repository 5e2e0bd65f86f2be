"""Files that appear whole or not at all."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from vedette.internal.files import lock_beside, sweep, write_whole


def test_a_file_appears_whole_and_readable_by_others(tmp_path: Path) -> None:
    target = tmp_path / "file"
    write_whole(target, lambda file: file.write(b"first"))
    write_whole(target, lambda file: file.write(b"second"))
    assert target.read_bytes() == b"second"
    (tmp_path / "plain").touch()
    assert stat.S_IMODE(target.stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "plain"]


def test_a_fault_half_way_leaves_what_was_there(tmp_path: Path) -> None:
    target = tmp_path / "file"
    target.write_bytes(b"first")

    def write(file) -> None:
        file.write(b"sec")
        raise OSError("no space")

    with pytest.raises(OSError, match="no space"):
        write_whole(target, write)
    assert target.read_bytes() == b"first"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    with pytest.raises(FileNotFoundError):
        write_whole(tmp_path / "nowhere" / "file", lambda file: file.write(b""))


def test_what_killed_processes_leave_is_deleted_under_the_lock(tmp_path: Path) -> None:
    left = [tmp_path / f".{name}.{'0a1b' * 8}" for name in ("state", "other")]
    kept = [tmp_path / name for name in (".state.yaml", "state", f"state.{'0a1b' * 8}")]
    for path in (*left, *kept):
        path.touch()
    lock_beside(tmp_path / "state").close()
    assert [path.exists() for path in left] == [False, True]
    sweep(tmp_path)
    assert not left[1].exists()
    assert all(path.exists() for path in kept)
