"""Kernels that a wheel brought: found after the user's own, compiled anew where they do not fit or are not safe."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest
from numba.core.codegen import get_host_cpu_features

import vedette
from vedette.kernels.base.cache_paths import LEVELS, supports_level
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


def compiling_for(level: str) -> dict[str, str]:
    """What has Numba compile for a level, whatever this processor can do."""
    return {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": ""}


def features(names: Iterable[str]) -> dict[str, str]:
    """What has Numba take this processor for one with these features alone."""
    return {"NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in sorted(names))}


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="levels of x86-64")
def test_a_processor_is_given_the_best_level_that_it_has_all_features_of(tmp_path: Path) -> None:
    site, installed, own = tmp_path / "site", tmp_path / "site/vedette/compiled-kernels", tmp_path / "own"
    shutil.copytree(Path(vedette.__file__).parent, site / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    level = LEVELS["x86-64-v3"]
    if not supports_level("x86-64-v3", get_host_cpu_features()):
        pytest.skip("this processor has no AVX2")
    assert counts(site, installed, **compiling_for("x86-64-v3")) == "0 1"
    assert counts(site, own, **features(level)) == "1 0"
    assert counts(site, own) == "1 0"
    for missing in level:  # each alone: none of such processors may ever run this code
        assert not supports_level("x86-64-v3", features(level - {missing})["NUMBA_CPU_FEATURES"])
    assert counts(site, tmp_path / "older", **features(level - {"avx2"})) == "0 1"
    assert counts(site, installed, **compiling_for("generic")) == "0 1"
    assert len(list(installed.rglob("*.nbc"))) == 2  # both levels side by side
    assert counts(site, tmp_path / "oldest", **features(level - {"avx2"})) == "1 0"


def test_kernels_beside_the_package_are_used_where_nobody_else_can_have_written_them(tmp_path: Path) -> None:
    site, installed = tmp_path / "site", tmp_path / "site/vedette/compiled-kernels"
    shutil.copytree(Path(vedette.__file__).parent, site / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    assert counts(site, installed, **compiling_for("generic")) == "0 1"
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
