"""Ctrl-C while kernels run: a KeyboardInterrupt each time, and never the end of the process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vedette.kernels.base.compile import JIT_ENABLED, kernel
from vedette.kernels.base.types import Mixture
from vedette.kernels.gaussian.marks import no_marks
from waiting import PATIENCE

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")

# The next interrupt is due some CPU time after the one before was caught: each must be, however busy the machine is. A
# filter's step returns bundles within bundles, and a model function of the user's own is called from machine code.
PROGRAM = """
import random, signal, sys
import numpy as np
from vedette import models
from vedette.densities import map_estimate
from vedette.filters import DeltaGlmbFilter
from vedette.fusion import CmDeltaGlmb
from vedette.tracking import Distributed

@models.model_function("prob_detection")
def seldom_beyond(state, pose, params):
    return 0.9 if np.hypot(state[0] - pose[0], state[1] - pose[1]) < params[0] else 0.1

sensor = models.SensorModel(
    models.bearing_range(),
    models.range_dependent_noise(10.0, 5e-5, np.pi / 180, 5e-6),
    models.DetectionModel(seldom_beyond, np.array([1500.0])),
    models.region_clutter(5.0, models.Region(-1000.0, 1000.0, -1000.0, 1000.0), "bearing_range"),
)
birth_cov = np.diag([50.0, 50.0, 25.0, 25.0]) ** 2
birth = models.BirthModel(np.array([0.02]), np.array([[0.0, 400.0, 0.0, 0.0]]), birth_cov[np.newaxis])
targets = models.TargetModel(models.constant_velocity(5.0), models.constant_survival(0.98), birth)
local = DeltaGlmbFilter(targets, sensor)
tracker = Distributed((local, local), CmDeltaGlmb([0.5, 0.5]))
poses = np.array([[-700.0, 800.0, 0.0], [-600.0, 200.0, 0.0]])

def follow():
    rng, state = np.random.default_rng(1), tracker.initial()
    for time in range(1, 11):
        seen = np.array([10.0 * time, 400.0]) - poses[:, :2]
        scans = [np.array([[np.arctan2(dy, dx), np.hypot(dx, dy)]]) for dx, dy in seen]
        state, _ = tracker.step(state, scans, poses, time, rngs=[rng, rng])
        map_estimate(state.fused)

NUM, moment, lost = int(sys.argv[1]), random.Random(1), 0
follow()
signal.signal(signal.SIGPROF, signal.default_int_handler)  # that of SIGINT; the background ignores SIGINT
for _ in range(NUM):
    try:
        signal.setitimer(signal.ITIMER_PROF, 1e-4 + 0.01 * moment.random())
        for _ in range(2000):  # some ten seconds
            follow()
        lost += 1
    except KeyboardInterrupt:
        pass
print(NUM, "interrupts,", lost, "lost")
"""


def interrupted(tmp_path: Path, num: int) -> subprocess.CompletedProcess[str]:
    (tmp_path / "follow.py").write_text(PROGRAM)
    command = [sys.executable, "-X", "faulthandler", str(tmp_path / "follow.py"), str(num)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)


@pytest.mark.skipif(os.name != "posix", reason="sends itself signals")
@pytest.mark.parametrize("num", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_every_interrupt_is_a_keyboard_interrupt(tmp_path: Path, num: int) -> None:
    """Boxed as Numba does it, 6 of 6 such processes died of a segmentation fault after 0 to 3."""
    result = interrupted(tmp_path, num)
    assert result.returncode == 0, result.stderr
    assert result.stdout == f"{num} interrupts, 0 lost\n"


@kernel
def _pair(values: np.ndarray) -> tuple[Mixture, int]:
    return Mixture(values, values.reshape(1, -1).copy(), np.zeros((1, 1, 1)), no_marks(1)), len(values)


def test_what_a_kernel_returns_has_its_names() -> None:
    """And arrays that own what they hold, with the types that they have in the kernel."""
    given = np.arange(3.0)
    mixture, num = _pair(given)
    assert isinstance(mixture, Mixture)
    assert num == 3
    assert mixture.log_weights is given
    assert mixture.means.tolist() == [[0.0, 1.0, 2.0]]
    assert (mixture.covs.shape, str(mixture.covs.dtype)) == ((1, 1, 1), "float64")
    assert mixture.covs.flags.writeable


def test_a_read_only_array_is_refused_rather_than_compiled_for() -> None:
    values = np.zeros(2)
    values.flags.writeable = False
    with pytest.raises(TypeError, match="kernel _pair: expected writeable arrays"):
        _pair(values)


def test_numba_goes_on_as_it_is_for_others() -> None:
    """A user's own compiled function returns what Numba returns."""
    from numba import njit

    @njit
    def own(values: np.ndarray) -> Mixture:
        return Mixture(values, np.zeros((1, 1)), np.zeros((1, 1, 1)), no_marks(1))

    _pair(np.zeros(1))
    assert isinstance(own(np.zeros(1)), Mixture)
