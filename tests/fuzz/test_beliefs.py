"""Beliefs made by hand, with any mistake: refused by name, or a density like any other; the process never ends.

The cases run in a process of their own, so that a crash of the machine code is a failure and not the end of pytest.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError, VedetteError

SHORT = 60


def crooked_integers(array: Any, rng: np.random.Generator) -> Any:
    """Indices, offsets or labels with one entry out of place, or of another shape or type."""
    spoilt = array.copy()
    if spoilt.size:
        place = rng.integers(spoilt.size)
        spoilt.flat[place] = rng.choice([-1, -(10**9), 10**9, 2**62, 0, 1, int(spoilt.flat[place]) + 1])
    return any_form(spoilt, rng)


def crooked_floats(array: Any, rng: np.random.Generator) -> Any:
    spoilt = array.copy()
    if spoilt.size:
        values = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, 1e-300, rng.normal()]
        spoilt.flat[rng.integers(spoilt.size)] = rng.choice(values)
    return any_form(spoilt, rng)


def any_form(array: Any, rng: np.random.Generator) -> Any:
    """Mostly as it is; else shorter, longer, of another type, order or kind."""
    forms = [
        lambda: array[:-1].copy(), lambda: np.concatenate([array, array]), lambda: array.astype(np.float32),
        lambda: array.astype(np.int32, casting="unsafe"), lambda: array.tolist(), lambda: np.asfortranarray(array),
        lambda: np.repeat(array, 2)[::2], lambda: array[..., None], lambda: np.ma.masked_array(array),
        lambda: np.broadcast_to(array, array.shape), lambda: array.astype(">f8"), lambda: None,
    ]  # fmt: skip
    with np.errstate(all="ignore"):
        return forms[rng.integers(len(forms))]() if rng.random() < 0.3 else array


def spoil(fields: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """One or two of the arrays with a mistake."""
    spoilt = dict(fields)
    for name in rng.choice(list(fields), size=rng.integers(1, 3), replace=False):
        if isinstance(spoilt[name], np.ndarray):
            crook = crooked_integers if spoilt[name].dtype.kind == "i" else crooked_floats
            spoilt[name] = crook(spoilt[name], rng)
    return spoilt


def fields_of(container: Any) -> dict[str, Any]:
    return {name: getattr(container, name) for name in type(container).__match_args__}


def one_case(rng: np.random.Generator) -> None:
    """A belief with a mistake through everything that takes beliefs; what comes out is valid."""
    from filters.members import POSE, make
    from vedette import densities as d
    from vedette.divergence import cauchy_schwarz
    from vedette.filters import CbMemberFilter, CphdFilter, DeltaGlmbFilter, LmbFilter, PhdFilter
    from vedette.fusion import Clmb, CmDeltaGlmb

    dim, covs = 4, np.tile(100.0 * np.eye(4), (4, 1, 1))
    means = rng.normal(0.0, 50.0, (4, dim))
    mixtures = [
        ([1.0], means[:1], covs[:1]), ([0.5, 0.5], means[1:3], covs[1:3]), ([1.0], means[3:], covs[3:])
    ]  # fmt: skip
    tracks = d.TrackTable.from_mixtures([(1, 0), (1, 1), (2, 0)], mixtures)
    good = [
        d.GLMB.from_hypotheses(tracks, [[0, 1], [1, 2], []], [0.5, 0.3, 0.2]),
        d.LMB(tracks, rng.normal(size=3)),
        d.Poisson.from_gaussians([0.5, 0.3], means[:2], covs[:2]),
        d.IidCluster.from_gaussians([0.2, 0.5, 0.3], [0.5, 0.5], means[:2], covs[:2]),
        d.MultiBernoulli.from_gaussians([0.5, 0.3], means[:2], covs[:2]),
    ]
    kind = rng.integers(len(good))
    belief: Any = good[kind]
    try:
        if kind < 2 and rng.random() < 0.5:
            made = d.TrackTable(**spoil(fields_of(tracks), rng))
            spoilt = type(belief)(**{**fields_of(belief), "tracks": made})
        else:
            spoilt = type(belief)(**spoil(fields_of(belief), rng))
    except InputError:
        return
    tracker = make([DeltaGlmbFilter, LmbFilter, PhdFilter, CphdFilter, CbMemberFilter][kind])
    samplers: list[Any] = [
        d.sample_glmb,
        d.sample_lmb,
        d.sample_poisson,
        d.sample_iid_cluster,
        d.sample_multi_bernoulli,
    ]
    uses: list[Any] = [
        lambda: tracker.step(spoilt, [[10.0, 10.0], [50.0, 50.0]], POSE, 1.0, 3, rng=rng)[0],
        lambda: samplers[kind](spoilt, 10, rng=rng),
    ]
    if kind < 2:
        uses += [lambda: d.map_estimate(spoilt), lambda: d.marginal_estimate(spoilt)]
        uses.append(lambda: d.least_gospa_estimate(spoilt))
        uses.append(lambda: (CmDeltaGlmb if kind == 0 else Clmb)((0.5, 0.5)).fuse([spoilt, belief])[0])
        uses.append(lambda: d.as_lmb(spoilt) if kind == 0 else d.as_glmb(spoilt, max_hypotheses=5)[0])
    if kind < 3:
        with contextlib.suppress(VedetteError):
            assert cauchy_schwarz(spoilt, spoilt) >= 0.0
    for use in uses:
        try:
            made = use()
        except VedetteError:
            continue
        made.validate()


def one_product(rng: np.random.Generator) -> None:
    """The same of a product of GLMBs."""
    from vedette import densities as d
    from vedette.densities.label_sets import without_labels
    from vedette.divergence import cauchy_schwarz
    from vedette.fusion import CmDeltaGlmb

    covs, means = np.tile(100.0 * np.eye(4), (6, 1, 1)), rng.normal(0.0, 50.0, (6, 4))
    tracks = d.TrackTable.from_gaussians([(1, 0), (1, 1), (1, 1), (2, 0)], means[:4], covs[:4])
    several = d.GLMB.from_hypotheses(tracks, [[0, 1], [2, 3], [0], []], [0.4, 0.3, 0.2, 0.1])
    alone = d.LMB.from_bernoullis([(1, 5), (3, 0)], [0.9, 0.2], means[4:], covs[4:])
    belief = d.FactoredGLMB.product([d.FactoredGLMB.of(alone), d.FactoredGLMB.of(several)], 4)
    try:
        if rng.random() < 0.3:
            made = d.TrackTable(**spoil(fields_of(belief.tracks), rng))
            spoilt = d.FactoredGLMB(**{**fields_of(belief), "tracks": made})
        else:
            spoilt = d.FactoredGLMB(**spoil(fields_of(belief), rng))
    except InputError:
        return
    with contextlib.suppress(VedetteError):
        assert cauchy_schwarz(spoilt, belief) >= 0.0
    uses: list[Any] = [
        lambda: d.map_estimate(spoilt),
        lambda: d.marginal_estimate(spoilt),
        lambda: d.least_gospa_estimate(spoilt),
        lambda: d.as_lmb(spoilt),
        lambda: d.as_glmb(spoilt, max_hypotheses=5)[0],
        lambda: d.marginalise(spoilt),
        lambda: without_labels(spoilt, np.array([[1, 1], [3, 0]]))[0],
        lambda: CmDeltaGlmb((0.5, 0.5)).fuse([spoilt, belief])[0],
    ]
    for use in uses:
        try:
            made = use()
        except VedetteError:
            continue
        made.validate()


PROGRAM = """
import sys
import numpy as np
import pytest
sys.path.insert(0, sys.argv[1])
from fuzz.test_beliefs import one_case, one_product

seed, first, last = (int(value) for value in sys.argv[2:])
for number in range(first, last):
    print(number, flush=True)
    one_case(np.random.default_rng([seed, number]))
    one_product(np.random.default_rng([seed, number, 1]))
"""


@pytest.mark.fuzz
def test_no_belief_ends_the_process(request: pytest.FixtureRequest, try_cases: Any) -> None:
    """A case of the fixture is fifty in one process; the last number printed is the one that ended it."""

    def check(rng: np.random.Generator) -> None:
        seed = str(rng.integers(2**31))
        tests = str(Path(__file__).resolve().parents[1])
        command = [sys.executable, "-X", "faulthandler", "-c", PROGRAM, tests, seed, "0", str(SHORT)]
        result = subprocess.run(command, capture_output=True, text=True, timeout=1800, check=False)
        assert result.returncode == 0, f"seed {seed}, case {result.stdout.split()[-1:]}: {result.stderr}"

    try_cases(check, 1)
