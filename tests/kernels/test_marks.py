"""Optional columns of components: a new one is added in two files, and goes wherever the components go."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import vedette

SRC = Path(vedette.__file__).parents[1]
KERNELS = Path("vedette", "kernels")
MERGED = "    set_mode(out, target, _common_mode(marks, chosen, count))\n"
POOLED = "    set_mode(out, target, mode)\n"
FIRST = "    out[target, NUMBER] = marks[chosen[0], NUMBER]\n"
COPIED = "    out[target, MODE] = marks[source, MODE]\n"
SAME = "marks[first, MODE] == marks[second, MODE]"

# The column `number`: components of different numbers are of different targets, and do not merge.
EDITS = {
    KERNELS / "base" / "types.py": [("CLASSES = 1  #", "NUMBER = 1\nCLASSES = 2  #")],
    KERNELS / "gaussian" / "marks.py": [
        ("import CLASSES, MODE,", "import CLASSES, MODE, NUMBER,"),
        (COPIED, f"{COPIED}    out[target, NUMBER] = marks[source, NUMBER]\n"),
        (SAME, f"{SAME} and marks[first, NUMBER] == marks[second, NUMBER]"),
        (MERGED, FIRST + MERGED),
        (POOLED, FIRST + POOLED),
    ],
}

AFTER = """
import pickle
from dataclasses import replace
import numpy as np
from vedette import models
from vedette.densities import LMB, FactoredGLMB, Poisson, as_glmb, as_lmb, load_density, save_density
from vedette.densities.tracks import single_gaussians
from vedette.filters import DeltaGlmbFilter, FactoredGlmbFilter, Limits, LmbFilter, PhdFilter
from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb
from vedette.kernels.gaussian.components import components_of
from vedette.kernels.gaussian.reduction import MixtureCaps, reduce_mixture

def marked(numbers, classes):
    return np.hstack([np.full((len(numbers), 1), -1.0), numbers, classes])

region = models.Region(-100.0, 100.0, -100.0, 100.0)
motion, survival = models.constant_velocity(1.0), models.constant_survival(0.99)
targets = models.TargetModel(motion, survival, models.BirthModel.none(4))
parts = models.position(), models.constant_noise([3.0, 3.0]), models.constant_detection(0.8)
sensor = models.SensorModel(*parts, models.region_clutter(2.0, region, "position"))
means = np.array([[-20.0, 0.0, 0.0, 0.0], [-19.0, 0.0, 0.0, 0.0], [20.0, 0.0, 0.0, 0.0], [21.0, 0.0, 0.0, 0.0]])
covs, numbers = np.tile(np.eye(4), (4, 1, 1)), np.array([[1.0], [1.0], [2.0], [2.0]])
marks, logs = marked(numbers, np.empty((4, 0))), np.log(np.full(4, 0.5))
table = replace(LMB.empty(4).tracks, labels=np.array([[0, 1], [0, 2]]), offsets=np.array([0, 2, 4]), log_weights=logs,
                means=means, covs=covs, marks=marks)
lmb = LMB(table, np.array([2.0, 1.0]))
scan, rng = np.array([[-19.0, 1.0], [22.0, 0.0], [0.0, 50.0]]), np.random.default_rng(1)

def check(belief):
    assert belief.tracks.num_tracks >= 2
    labels = np.repeat(belief.tracks.labels, np.diff(belief.tracks.offsets), axis=0)
    np.testing.assert_array_equal(belief.tracks.marks[:, 1], labels[:, 1], type(belief).__name__)

def step(kind, belief, limits=Limits()):
    return kind(targets, sensor, limits).step(belief, scan, np.zeros(3), 1.0, 5, rng=rng)[0]

def as_sets(belief):
    return as_glmb(belief, max_hypotheses=9)[0]

for belief in (lmb, as_sets(lmb), FactoredGLMB.of(lmb)):
    check(belief)
    check(pickle.loads(pickle.dumps(belief)))
    save_density("belief.npz", belief)
    check(load_density("belief.npz"))
    check(as_lmb(belief, max_components=1))
one = Limits(max_components=1)
for kind, belief in ((LmbFilter, lmb), (DeltaGlmbFilter, as_sets(lmb)), (FactoredGlmbFilter, FactoredGLMB.of(lmb))):
    for limits in (Limits(), one):
        check(step(kind, belief, limits))
for classes in (np.empty((4, 0)), np.log(np.full((4, 2), 0.5))):
    own = replace(table, marks=marked(numbers, classes))
    check(LMB(single_gaussians(own), lmb.existence_logit))
intensity = Poisson(logs, means, covs, marks)
found = step(PhdFilter, intensity)
np.testing.assert_array_equal(found.marks[:, 1], np.where(found.means[:, 0] < 0.0, 1.0, 2.0))
for rule in (Clmb([0.4, 0.6]), ArithmeticAverage([0.4, 0.6])):
    check(rule.fuse([lmb, step(LmbFilter, lmb)])[0])
check(CmDeltaGlmb([0.4, 0.6]).fuse([as_sets(lmb), as_sets(step(LmbFilter, lmb))])[0])
near = components_of(logs[:2], means[:2], covs[:2], marked(numbers[1:3], np.empty((2, 0))))
assert len(reduce_mixture(near, MixtureCaps(-9.0, 3.0, 9)).log_weights) == 2
assert len(reduce_mixture(components_of(*near[:3]), MixtureCaps(-9.0, 3.0, 9)).log_weights) == 1
"""


def test_a_column_is_two_files(tmp_path: Path) -> None:
    shutil.copytree(SRC / "vedette", tmp_path / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    for path, edits in EDITS.items():
        text = (tmp_path / path).read_text("utf-8")
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new)
        (tmp_path / path).write_text(text, "utf-8")
    own = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", AFTER]
    ran = subprocess.run(command, env=own, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
