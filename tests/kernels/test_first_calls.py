"""Several threads that meet functions which none has compiled yet, as when planning is the first thing of a process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vedette.kernels.base.compile import JIT_ENABLED

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")

PROGRAM = """
import pickle, threading
import numpy as np
from vedette import models
from vedette.kernels.gaussian.linalg import log_sum

NUM_THREADS = 8
motion = models.constant_velocity(5.0)
function, survival = motion.transition, models.constant_survival(0.9).function
pickled = pickle.dumps(survival)
start, faults, types = threading.Barrier(NUM_THREADS), [], []

def first_calls(turn):
    try:
        start.wait()
        types.append(function._numba_type_)  # what a kernel asks for
        assert function.c_address and function.jit_address
        out = np.empty(4)
        function(np.arange(4.0), 1.0, motion.transition_params, out)
        assert out.tolist() == [2.0, 4.0, 2.0, 3.0], out
        assert log_sum(np.zeros(1)) == 0.0
        start.wait()
        copy = pickle.loads(pickled)
        assert copy._numba_type_ is not None and copy(np.zeros(4), 1.0, np.array([0.9])) == 0.9
    except BaseException as fault:
        faults.append(repr(fault))
        start.abort()

threads = [threading.Thread(target=first_calls, args=(turn,)) for turn in range(NUM_THREADS)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert not faults, faults
assert len(set(types)) == 1
assert len(function.dispatcher.overloads) == len(log_sum.whole.overloads) == 1
"""


def test_threads_that_begin_together_find_one_compiled_function(tmp_path: Path) -> None:
    """With nothing on disk, and with everything."""
    for _ in range(2):
        environment = {**os.environ, "VEDETTE_CACHE_DIR": str(tmp_path)}
        command = [sys.executable, "-W", "error", "-c", PROGRAM]
        result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=False)
        assert result.returncode == 0, result.stderr
    assert list(tmp_path.rglob("*.nbc"))
