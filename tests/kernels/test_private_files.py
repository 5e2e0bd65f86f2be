"""A cache that others can write is not read: what is in it would be run."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from vedette.kernels.base.compile import JIT_ENABLED
from vedette.kernels.base.private_files import folder_fault, make_private_folder, read_private, write_private

pytestmark = pytest.mark.skipif(os.name != "posix", reason="files have no owners and modes")

SOURCE = Path(__file__)
STRANGER = 54321

# Compiles one kernel, and prints what came from disk and what was compiled.
PROGRAM = """
import numpy as np
from vedette.kernels.gaussian.linalg import log_sum
assert log_sum(np.zeros(1)) == 0.0
print(sum(log_sum.whole.stats.cache_hits.values()), sum(log_sum.whole.stats.cache_misses.values()))
"""


def counts(cache: Path, *options: str) -> tuple[str, str]:
    """Hits and misses, and what was said."""
    environment = {**os.environ, "VEDETTE_CACHE_DIR": str(cache)}
    command = [sys.executable, *options, "-c", PROGRAM]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip(), result.stderr


def entry(cache: Path) -> Path:
    (found,) = cache.rglob("*log_sum*.nbc")
    return found


needs_jit = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")


@needs_jit
def test_the_cache_is_made_for_its_user_alone(tmp_path: Path) -> None:
    cache = tmp_path / "of" / "mine"
    assert counts(cache, "-W", "error") == ("0 1", "")
    assert counts(cache, "-W", "error") == ("1 0", "")
    for path in (cache, *cache.rglob("*")):
        assert stat.S_IMODE(path.stat().st_mode) == (0o700 if path.is_dir() else 0o600), path


@needs_jit
def test_a_cache_that_others_can_write_is_not_read_and_says_so_once(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert counts(cache)[0] == "0 1"
    cache.chmod(0o777)
    before = entry(cache).stat().st_mtime_ns
    found, said = counts(cache)
    assert found == "0 1"
    assert said.count("RuntimeWarning") == 1
    assert f"others can write to {cache}" in said
    assert "VEDETTE_CACHE_DIR" in said
    assert entry(cache).stat().st_mtime_ns == before
    cache.chmod(0o700)
    assert counts(cache) == ("1 0", "")


@needs_jit
def test_an_entry_that_others_can_write_is_compiled_anew(tmp_path: Path) -> None:
    assert counts(tmp_path)[0] == "0 1"
    entry(tmp_path).chmod(0o666)
    assert counts(tmp_path) == ("0 1", "")
    assert counts(tmp_path) == ("1 0", "")


@pytest.mark.skipif(os.name == "posix" and os.getuid() != 0, reason="only root can give files away")
def test_what_belongs_to_another_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "entry"
    write_private(file, b"code")
    assert read_private(file, SOURCE) == b"code"
    os.chown(file, STRANGER, STRANGER)
    assert read_private(file, SOURCE) is None
    folder = tmp_path / "theirs" / "below"
    make_private_folder(folder)
    assert folder_fault(folder, SOURCE) is None
    os.chown(folder.parent, STRANGER, STRANGER)
    assert folder_fault(folder, SOURCE) == f"{folder.parent} belongs to another user"


def test_a_folder_is_as_private_as_those_above_it(tmp_path: Path) -> None:
    folder = tmp_path / "shared" / "mine"
    make_private_folder(folder)
    assert folder_fault(folder, SOURCE) is None
    folder.parent.chmod(0o777)
    assert folder_fault(folder, SOURCE) == f"others can write to {folder.parent}"
    folder.parent.chmod(0o1777)  # sticky, like /tmp
    assert folder_fault(folder, SOURCE) is None
    folder.chmod(0o1777)
    assert folder_fault(folder, SOURCE) == f"others can write to {folder}"
    file = folder / "entry"
    write_private(file, b"code")
    with pytest.raises(FileExistsError):
        write_private(file, b"other code")
    file.chmod(0o602)
    assert read_private(file, SOURCE) is None
    assert read_private(folder / "none", SOURCE) is None
