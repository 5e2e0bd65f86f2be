"""Compiled kernels on disk: found again, compiled anew when damaged, safe for several processes at once."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vedette.kernels.base import sources
from vedette.kernels.base.compile import JIT_ENABLED
from waiting import PATIENCE

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")

# Calls one kernel with arrays of the types named, in that order, once a file `go` is there; prints what was read from
# disk and what was compiled.
PROGRAM = """
import sys, time
from pathlib import Path
import numpy as np
from vedette.kernels.gaussian.linalg import log_sum

print("ready", flush=True)
while not Path(sys.argv[1], "go").exists():
    time.sleep(0.001)
for name in sys.argv[2:]:
    if not abs(log_sum(np.array([1, 2, 3]).astype(name)) - 3.4076059644443806) < 1e-6:
        raise SystemExit(name)
stats = log_sum.whole.stats  # as it was called from here
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""
KERNELS = Path(sources.__file__).resolve().parents[1]
TYPES = ["float64", "float32", "int64", "int32", "uint8", "int8"]


def start(cache: Path, types: list[str], *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *options, "-c", PROGRAM, str(cache), *types],
        env={**os.environ, "VEDETTE_CACHE_DIR": str(cache)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def counts(process: subprocess.Popen[str]) -> tuple[int, int]:
    """Entries read from disk, and compiled, by a process that must have ended well."""
    out, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, error
    hits, misses = out.split()[-2:]
    return int(hits), int(misses)


def test_processes_that_compile_at_once_keep_every_entry_under_its_own_key(tmp_path: Path) -> None:
    processes = [start(tmp_path, TYPES[turn:] + TYPES[:turn]) for turn in (0, 3)]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    (tmp_path / "go").touch()
    for process in processes:
        hits, misses = counts(process)
        assert hits + misses == len(TYPES)
    assert counts(start(tmp_path, TYPES)) == (len(TYPES), 0)


def test_a_damaged_entry_is_compiled_again(tmp_path: Path) -> None:
    (tmp_path / "go").touch()
    assert counts(start(tmp_path, ["float64", "int64"])) == (0, 2)
    first, second = sorted(tmp_path.rglob("*log_sum*.nbc"))
    first.write_bytes(first.read_bytes()[:-20])
    content = bytearray(second.read_bytes())
    content[len(content) // 2] ^= 0x20
    second.write_bytes(content)
    assert counts(start(tmp_path, ["float64", "int64"])) == (0, 2)
    assert counts(start(tmp_path, ["float64", "int64"])) == (2, 0)
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.suffix not in (".nbc", "")]


def test_python_without_docstrings_reads_what_python_with_them_has_compiled(tmp_path: Path) -> None:
    (tmp_path / "go").touch()
    assert counts(start(tmp_path, ["float64", "int64"])) == (0, 2)
    assert counts(start(tmp_path, ["float64", "int64"], "-OO")) == (2, 0)


def test_a_folder_that_cannot_be_written_leaves_the_kernel_compiled_in_memory(tmp_path: Path) -> None:
    (tmp_path / "go").touch()
    (tmp_path / "file").touch()
    environment = {**os.environ, "VEDETTE_CACHE_DIR": str(tmp_path / "file" / "below")}
    result = subprocess.run([sys.executable, "-c", PROGRAM, str(tmp_path), "float64"], env=environment, check=False)
    assert result.returncode == 0


def test_a_file_may_be_a_script_and_a_module(tmp_path: Path) -> None:
    """What was compiled under the one name is of no use under the other, and does no harm."""
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "own.py").write_text(
        "from vedette.models import model_function\n\n\n"
        "@model_function('prob_survival')\ndef own(state, dt, params):\n    return params[0]\n"
    )
    for arguments, folder in ((["-m", "package.own"], tmp_path), (["-c", "import own"], tmp_path / "package")) * 2:
        command = [sys.executable, "-W", "error", *arguments]
        result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)
        assert result.returncode == 0, result.stderr


def test_a_stamp_covers_every_kernel_file_that_is_reached() -> None:
    reached = {path.relative_to(KERNELS).as_posix() for path in sources.source_closure(KERNELS / "steps/lmb.py")}
    assert {"steps/lmb.py", "association/search.py", "gaussian/linalg.py", "base/types.py"} <= reached
    assert not any(name.startswith("planning/") for name in reached)
    assert "base/compile.py" in reached
    assert "base/disk_cache.py" not in reached


def test_a_stamp_of_a_model_covers_the_models_whose_kernels_it_calls() -> None:
    """Clutter around a sensor calls the density of range rates, which is in another file of models."""
    models = KERNELS.parent / "models"
    assert models / "clutter.py" in sources.source_closure(models / "sensor_clutter.py")


IMPORTS = """
from vedette.kernels.gaussian.linalg import cholesky
from vedette.kernels.planning.known_changes import (  # a comment
    Entries,
    fill_changes,
)
from vedette.kernels.labelled import gci

def late():
    from vedette.kernels.steps.lmb import step_lmb
"""


def test_every_way_to_import_a_kernel_is_found(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(IMPORTS, encoding="utf-8")
    found = {path.relative_to(KERNELS).as_posix() for path in sources._kernel_imports(tmp_path / "own.py")}
    assert found == {"gaussian/linalg.py", "planning/known_changes.py", "labelled/gci.py", "steps/lmb.py"}


def test_imports_are_found_as_a_parser_finds_them() -> None:
    for path in sorted(KERNELS.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        named = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
        names = {f"{node.module}.{alias.name}" for node in named for alias in node.names}
        names |= {node.module for node in named if node.module}
        modules = {KERNELS.parent.joinpath(*name.split(".")[1:]).with_suffix(".py") for name in names}
        expected = {module for module in modules if module.is_relative_to(KERNELS) and module.is_file()}
        assert sources._kernel_imports(path) >= expected, path


EDITED = """
import shutil, sys
from pathlib import Path

copy = Path(sys.argv[1], "vedette")
sys.path.insert(0, sys.argv[1])
import numpy as np
from vedette.kernels.gaussian import linalg
from vedette.kernels.base import sources

assert Path(linalg.__file__).is_relative_to(copy)
file = Path(linalg.__file__).resolve()
file.write_text(file.read_text(encoding="utf-8") + "# edited", encoding="utf-8")
print(sources.source_stamp(file))
"""


def test_a_stamp_is_that_of_the_file_that_was_imported(tmp_path: Path) -> None:
    """Edited before its first call, a kernel must not be kept as what was compiled of the edited file."""
    shutil.copytree(KERNELS.parent, tmp_path / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    stamps = []
    for _ in range(3):
        command = [sys.executable, "-c", EDITED, str(tmp_path)]
        result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)
        stamps += result.stdout.split()
    assert stamps[0] == sources.source_stamp(KERNELS / "gaussian/linalg.py")
    assert len(set(stamps)) == 3


def test_every_function_has_the_stamp_of_what_compiles_it() -> None:
    for file in (KERNELS / "gaussian/linalg.py", KERNELS.parent / "models/kinematics.py"):
        reached = {path.name for path in sources.source_closure(file)}
        assert {"compile.py", "dispatchers.py", "libraries.py"} <= reached


def test_where_the_sources_lie_does_not_tell(tmp_path: Path) -> None:
    """All environments of a user share what is compiled of the same sources."""
    shutil.copytree(KERNELS.parent, tmp_path / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "go").touch()
    cache = tmp_path / "cache"
    for folder, expected in ((KERNELS.parents[1], "0 1"), (tmp_path, "1 0")):
        result = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(tmp_path), "float64"],
            env={**os.environ, "VEDETTE_CACHE_DIR": str(cache), "PYTHONPATH": str(folder)},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=True,
        )
        assert result.stdout.splitlines()[-1] == expected


OWN = """
import numpy as np
from vedette.kernels.base.compile import kernel

@kernel
def at(values, place):
    return values[place]

at.whole.compile("(float64[::1], int64)")
print(sum(at.whole.stats.cache_misses.values()))
try:
    at(np.zeros(1), 1)
except IndexError:
    print("checked")
"""


def test_a_function_of_ones_own_is_not_taken_for_one_that_checks_bounds(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    for checks, expected in (("1", ["1", "checked"]), ("0", ["1"]), ("0", ["0"]), ("1", ["1", "checked"])):
        result = subprocess.run(
            [sys.executable, "own.py"],
            cwd=tmp_path,
            env={**os.environ, "NUMBA_BOUNDSCHECK": checks},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=True,
        )
        assert result.stdout.split() == expected
