"""Random episodes of every filter: each scan gives a valid density or a named error, and never anything else.

For an hour: `pytest -m fuzz tests/fuzz/test_scans.py --fuzz-seconds 3600 --fuzz-seed 1 -s`; a case is an episode of one
to four scans, with fusion, conversions, estimates and a divergence of what they give.
"""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from fuzz import scenes
from vedette.densities import (
    GLMB,
    LMB,
    IidCluster,
    MultiBernoulli,
    Poisson,
    as_glmb,
    as_lmb,
    least_gospa_estimate,
    map_estimate,
    marginal_estimate,
    marginalise,
    unlabelled_estimate,
)
from vedette.divergence import cauchy_schwarz
from vedette.errors import InputError, VedetteError
from vedette.filters import FilterInfo
from vedette.fusion import Clmb, CmDeltaGlmb

pytestmark = [pytest.mark.fuzz, pytest.mark.filterwarnings("ignore::vedette.errors.ImplausibleWarning")]

TryCases = Callable[[Callable[[np.random.Generator], object], int], None]


def _is_certain(belief: Any) -> bool:
    """Whether the belief holds an infinite log-odds of existence."""
    return isinstance(belief, LMB | MultiBernoulli) and not np.isfinite(belief.existence_logit).all()


def _check_belief(belief: Any, certain_allowed: bool) -> None:
    belief.validate()
    assert certain_allowed or not _is_certain(belief), f"existence log-odds {belief.existence_logit}"
    if isinstance(belief, Poisson | IidCluster):
        assert 0.0 <= belief.expected_number < np.inf
    if isinstance(belief, LMB | MultiBernoulli):
        assert ((belief.existence >= 0.0) & (belief.existence <= 1.0)).all()


def _check_info(info: FilterInfo, belief: Any) -> None:
    assert isinstance(belief, MultiBernoulli) or not np.isnan(info.log_likelihood), info
    assert isinstance(belief, LMB | MultiBernoulli) or 0.0 <= info.truncation_error_bound <= 1.0, info
    counts = (info.num_hypotheses, info.num_tracks, info.num_clutter_floored, info.num_duplicates)
    assert min(*counts, info.num_inexact_clusters, info.dropped_existence) >= 0, info


def _check_readings(rng: np.random.Generator, belief: Any) -> None:
    """Estimates and conversions of a valid belief."""
    if isinstance(belief, GLMB | LMB):
        map_estimate(belief).validate()
        marginal_estimate(belief, scenes.one_of(rng, 0.0, 0.5, 0.999)).validate()
        least_gospa_estimate(
            belief, scenes.one_of(rng, 1e-3, 100.0, 1e9), scenes.one_of(rng, 1.0, 2.0, 400.0)
        ).validate()
    else:
        unlabelled_estimate(belief, 3).validate()
    if isinstance(belief, GLMB):
        most = int(scenes.one_of(rng, 1, 4))
        marginalise(belief, max_components=most).validate()
        as_lmb(belief, max_components=most).validate()
    elif isinstance(belief, LMB):
        listed, left_out = as_glmb(belief, max_hypotheses=int(scenes.one_of(rng, 1, 50)))
        listed.validate()
        assert 0.0 <= left_out <= 1.0


def _check_fusion(rng: np.random.Generator, beliefs: list[Any]) -> None:
    weights = rng.random(len(beliefs)) + 1e-3
    power = scenes.one_of(rng, "moment_matched", "moment_matched", "component_wise", "quadrature")
    fused: GLMB | LMB
    if isinstance(beliefs[0], GLMB) and rng.random() < 0.6:
        fused, info = CmDeltaGlmb(weights / weights.sum(), power).fuse([marginalise(belief) for belief in beliefs])
    else:
        fused, info = Clmb(weights / weights.sum(), power).fuse(beliefs)
    _check_belief(fused, isinstance(beliefs[0], GLMB) or any(map(_is_certain, beliefs)))
    assert not np.isnan(info.log_normaliser), info
    assert 0.0 <= info.discarded_weight <= 1.0, info


def _check_divergences(rng: np.random.Generator, beliefs: list[Any]) -> None:
    volume = scenes.some(rng, 1.0, 1e-9, 1e9)
    for a, b in pairwise(beliefs):
        if not isinstance(a, IidCluster | MultiBernoulli):
            assert cauchy_schwarz(a, b, unit_volume=volume) >= 0.0
            assert cauchy_schwarz(a, a, unit_volume=volume) >= 0.0


def _check_scans(rng: np.random.Generator, kind: str, local: Any, steps: int, counts: Counter[str]) -> list[Any]:
    """Beliefs of one sensor after each scan."""
    belief, beliefs = scenes.first_belief(rng, kind, local), []
    # Who cannot survive is surely gone.
    certain_allowed = _is_certain(belief) or local.targets.survival.params[0] == 0.0
    for step in range(1, steps + 1):
        at, dt = scenes.pose(rng), scenes.time_step(rng)
        if rng.random() < 0.01:
            with pytest.raises(InputError):
                local.step(belief, scenes.wrong_scan(rng, local.sensor.meas_dim), at, dt, step, rng=rng)
        counts["scans"] += 1
        belief, info = local.step(belief, scenes.scan(rng, local, at), at, dt, step, rng=rng)
        _check_belief(belief, certain_allowed)
        _check_info(info, belief)
        counts["densities"] += 1
        beliefs.append(belief)
    return beliefs


def _check_episode(rng: np.random.Generator, counts: Counter[str]) -> None:
    kind = scenes.one_of(rng, *scenes.KINDS)
    parts = scenes.world(rng)
    num_sensors = int(rng.integers(2, 4)) if kind in scenes.LABELLED and rng.random() < 0.3 else 1
    steps = int(rng.integers(1, 5))
    locals_ = [scenes.make_filter(rng, kind, parts) for _ in range(num_sensors)]
    histories = [_check_scans(rng, kind, local, steps, counts) for local in locals_]
    for belief in (history[-1] for history in histories):
        _check_readings(rng, belief)
    if num_sensors > 1:
        counts["fusions"] += 1
        _check_fusion(rng, [history[-1] for history in histories])
        counts["fused"] += 1
    if rng.random() < 0.3:
        _check_divergences(rng, histories[0])


def _was_found_here(error: VedetteError) -> bool:
    """Whether a `validate` called by this file raised it: what it finds in a given density is a fault."""
    calls = [frame.f_code for frame, _ in traceback.walk_tb(error.__traceback__)]
    return any(own.co_filename == __file__ and code.co_name == "validate" for own, code in pairwise(calls))


def test_any_scan_gives_a_valid_density_or_a_named_error(try_cases: TryCases) -> None:
    counts: Counter[str] = Counter()

    def check(rng: np.random.Generator) -> None:
        try:
            _check_episode(rng, counts)
        except VedetteError as error:
            # The built-in models raise nothing: what is said to be theirs is a kernel's.
            if _was_found_here(error) or "a model function raised" in str(error):
                raise
            counts[type(error).__name__] += 1

    try_cases(check, 500)
    print(dict(counts))
    assert counts["scans"] < 500 or counts["densities"] > 0.5 * counts["scans"], counts
