"""What is said while kernels are compiled: on a terminal, in a log, and where nothing is."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from vedette.kernels.base.compile import JIT_ENABLED
from waiting import PATIENCE

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")

PROGRAM = """
import numpy as np
from vedette.cli.compiling import compiling
from vedette.kernels.gaussian.linalg import log_sum
with compiling():
    log_sum(np.zeros(1))
"""


def environment(cache: Path, columns: int = 80) -> dict[str, str]:
    return {**os.environ, "VEDETTE_CACHE_DIR": str(cache), "COLUMNS": str(columns), "TERM": "xterm"}


def test_a_log_has_a_line_at_the_start_and_one_at_the_end(tmp_path: Path) -> None:
    for expected in (2, 0):  # then all is there
        command = [sys.executable, "-c", PROGRAM]
        result = subprocess.run(
            command, env=environment(tmp_path), capture_output=True, text=True, timeout=PATIENCE, check=True
        )
        lines = result.stderr.splitlines()
        assert len(lines) == expected, result.stderr
        assert result.stdout == ""
        if lines:
            assert "once" in lines[0]
            assert str(tmp_path) in lines[0]
            assert lines[1].startswith("compiled 1 kernel in ")


@pytest.mark.parametrize("columns", [30, 120])
def test_a_terminal_shows_the_progress_of_compilation(tmp_path: Path, columns: int) -> None:
    main, side = pty.openpty()
    with subprocess.Popen([sys.executable, "-c", PROGRAM], env=environment(tmp_path, columns), stderr=side) as process:
        os.close(side)
        shown = b""
        try:
            while chunk := os.read(main, 4096):
                shown += chunk
        except OSError:  # closed at the other end
            pass
        assert process.wait(PATIENCE) == 0
    os.close(main)
    text = shown.decode()
    assert "log_sum" in text or columns < 60
    assert "0 kernels done" in text
    assert "compiled 1 kernel in " in text
