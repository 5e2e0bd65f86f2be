"""Kernels that a wheel brought: found after the user's own, compiled anew where they do not fit or are not safe."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import vedette
from vedette.kernels.base.compile import JIT_ENABLED
from waiting import PATIENCE

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")

PROGRAM = """
import numpy as np
from vedette.kernels.gaussian.linalg import log_sum
assert log_sum(np.zeros(1)) == 0.0
print(sum(log_sum.whole.stats.cache_hits.values()), sum(log_sum.whole.stats.cache_misses.values()))
"""


def counts(site: Path, cache: Path, **more: str) -> str:
    """Hits and misses of a process that uses the package in `site`."""
    environment = {**os.environ, "PYTHONPATH": str(site), "VEDETTE_CACHE_DIR": str(cache), **more}
    command = [sys.executable, "-c", PROGRAM]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE, check=True)
    return result.stdout.strip()


def test_kernels_beside_the_package_are_used_where_nobody_else_can_have_written_them(tmp_path: Path) -> None:
    site, installed = tmp_path / "site", tmp_path / "site/vedette/compiled-kernels"
    shutil.copytree(Path(vedette.__file__).parent, site / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    assert counts(site, installed, NUMBA_CPU_NAME="generic") == "0 1"
    assert counts(site, tmp_path / "empty") == "1 0"
    assert not (tmp_path / "empty").exists()
    if os.name == "posix":
        installed.chmod(0o777)
        assert counts(site, tmp_path / "own") == "0 1"
        assert counts(site, tmp_path / "own") == "1 0"  # the user's own come first
        installed.chmod(0o700)
    source = site / "vedette/kernels/gaussian/linalg.py"
    source.write_text(source.read_text(encoding="utf-8") + "\n# another version\n", encoding="utf-8")
    assert counts(site, tmp_path / "other") == "0 1"
