"""Births that a cap on hypotheses cuts: the estimate against the filter, and which scenarios are refused."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.minimal import changed
from vedette import models
from vedette.densities import existence_probabilities
from vedette.errors import ImplausibleWarning, ScenarioError
from vedette.filters import DeltaGlmbFilter, MultiSensorGlmbFilter
from vedette.internal.cut_births import MAX_CUT_SHARE, cut_share
from vedette.scenarios import load_scenario, parse_scenario
from vedette.scenarios.warnings import scenario_warnings

REGION = models.Region(-5e3, 5e3, -5e3, 5e3)
FAST = (
    ("num_steps: 20, step_period: 0.5", "num_steps: 240, step_period: 0.05"),
    ("steps: [1, 5]", "period: 1.0"),
    ("decision_steps: [4, 8]", "decision_steps: [60]"),
)
SLOW_SCANS = (
    "noise: {kind: constant, std: [0.02, 3.0]}",
    "noise: {kind: constant, std: [0.02, 3.0]}\n  scans: {every: 60}",
)
FAR = (
    "noise: {kind: constant, std: [0.02, 3.0]}",
    "noise: {kind: constant, std: [0.02, 3.0]}\n  detection: {kind: gaussian, sigma: 12.0}",
)


def models_of(
    existence: float, sites: int, period: float | None = 1.0
) -> tuple[models.TargetModel, models.SensorModel]:
    """Targets born at sites within a period, and a sensor of positions."""
    means = np.array([[100.0 * i, 0.0, 0.0, 0.0] for i in range(sites)])
    covs = np.tile(np.diag([100.0, 100.0, 9.0, 9.0]), (sites, 1, 1))
    birth = models.BirthModel(np.full(sites, existence), means, covs, period=period)
    targets = models.TargetModel(models.constant_velocity(1.0), models.constant_survival(1.0), birth)
    noise, clutter = models.constant_noise([10.0, 10.0]), models.region_clutter(5.0, REGION, "position")
    return targets, models.SensorModel(models.position(), noise, models.constant_detection(0.9), clutter)


def predicted(existence: float, dt: float, steps: int, sites: int, marginalised: bool) -> float:
    """Expected number of targets after as many predictions without a scan, with births of a period of 1 s."""
    local = DeltaGlmbFilter(*models_of(existence, sites), marginalised=marginalised)
    belief: Any = local.initial()
    for step in range(1, steps + 1):
        belief, _ = local.predict(belief, dt, step)
    return float(existence_probabilities(belief)[1].sum())


@pytest.mark.filterwarnings("ignore:max_hypotheses:vedette.errors.ImplausibleWarning")
@pytest.mark.parametrize("marginalised", [False, True])
@pytest.mark.parametrize(
    ("existence", "dt", "steps", "sites"),
    [(0.06, 0.05, 60, 2), (0.05, 0.05, 20, 2), (0.2, 0.05, 60, 1), (0.1, 1.0, 5, 1)],
)
def test_warning_states_the_fraction_of_hypotheses_the_filter_truncates(
    existence: float, dt: float, steps: int, sites: int, marginalised: bool
) -> None:
    each = 1.0 - (1.0 - existence) ** dt
    left = predicted(existence, dt, steps, sites, marginalised) / (steps * sites * each)
    assert cut_share(steps * sites, each, 300) == pytest.approx(1.0 - left, abs=2e-3)


def first_warned(local: Any, dt: float, steps: int, every: int) -> int | None:
    """First step at which a filter warns, if there is a scan of one target at every so many steps."""
    belief, rng, several = local.initial(), np.random.default_rng(0), isinstance(local, MultiSensorGlmbFilter)
    for step in range(1, steps + 1):
        scan = np.zeros((1, 2)) if step % every == 0 else None
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            if several:
                belief, _ = local.step(belief, [scan], np.zeros((1, 3)), dt, step, rng=rng)
            elif scan is None:
                belief, _ = local.predict(belief, dt, step)
            else:
                belief, _ = local.step(belief, scan, np.zeros(3), dt, step, rng=rng)
        if found:
            (warning,) = found
            assert warning.category is ImplausibleWarning
            assert warning.filename == __file__
            assert "300 hypotheses cut more than 5 % of the expected births" in str(warning.message)
            return step
    return None


@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize(
    ("existence", "dt", "steps", "every"), [(0.2, 0.05, 60, 60), (0.2, 0.05, 60, 6), (0.1, 1.0, 5, 6)]
)
def test_a_filter_in_python_warns_where_a_scenario_is_refused(
    several: bool, existence: float, dt: float, steps: int, every: int
) -> None:
    """At the first step at which the unconfirmed labels of one site are as many as the check refuses."""
    targets, sensor = models_of(existence, 1)
    local = MultiSensorGlmbFilter(targets, (sensor,)) if several else DeltaGlmbFilter(targets, sensor)
    each = 1.0 - (1.0 - existence) ** dt
    refused = [n for n in range(1, every + 1) if cut_share(n, each, 300) > MAX_CUT_SHARE]
    expected = refused[0] if refused and refused[0] <= steps else None
    assert first_warned(local, dt, steps, every) == expected
    assert (expected is None) == (every != 60)


def test_labels_that_scans_reject_are_not_unconfirmed() -> None:
    """Four sites before a sensor that sees them all, a scan at each step: a list is full, but no births are cut."""
    targets, _ = models_of(0.06, 4)
    clutter = models.region_clutter(20.0, models.Region(-500.0, 500.0, -500.0, 500.0), "position")
    noise, detection = models.constant_noise([10.0, 10.0]), models.constant_detection(0.9)
    local = DeltaGlmbFilter(targets, models.SensorModel(models.position(), noise, detection, clutter))
    belief, rng = local.initial(), np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for step in range(1, 16):
            true = targets.birth.means[:, :2] + rng.normal(0.0, 10.0, (4, 2))
            scan = np.concatenate([true, rng.uniform(-500.0, 500.0, (20, 2))])
            belief, _ = local.step(belief, scan, np.zeros(3), 1.0, step, rng=rng)
    assert belief.num_hyps == local.limits.max_hypotheses


def test_births_per_step_never_warn() -> None:
    """Without a period births are meant per step, and a scenario is not refused."""
    assert first_warned(DeltaGlmbFilter(*models_of(0.01, 1, period=None)), 0.05, 40, 40) is None


def test_few_labels_or_many_hypotheses_truncate_nothing() -> None:
    assert cut_share(0, 0.1, 300) == 0.0
    assert cut_share(8, 0.1, 300) == pytest.approx(0.0, abs=1e-12)
    assert cut_share(120, 0.003, 10_000) < 0.05 < cut_share(120, 0.003, 300)
    assert cut_share(100_000, 0.01, 300) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("kind", ["delta_glmb", "m_delta_glmb"])
def test_births_at_many_steps_between_scans_are_refused(kind: str) -> None:
    text = changed(*FAST, SLOW_SCANS, ("m_delta_glmb}\nf", f"{kind}}}\nf"), ("existence: 0.1", "existence: 0.2"))
    with pytest.raises(ScenarioError, match=r"filter\.kind: expected factored_glmb or lmb") as caught:
        parse_scenario(text)
    assert "60 steps with births from one scan to the next make 60 labels" in str(caught.value)
    assert "300 hypotheses cut 35 % of the expected births" in str(caught.value)


@pytest.mark.parametrize(
    "cure",
    [
        ("kind: m_delta_glmb}", "kind: m_delta_glmb, limits: {max_hypotheses: 40000}}"),
        ("scans: {every: 60}", "scans: {every: 6}"),
        ("period: 1.0", "period: 1.0\n  steps: [1, 61]"),
        ("period: 1.0", "period: 100.0"),
        ("filter: {kind: m_delta_glmb}\nfusion: {kind: cm_delta_glmb", "filter: {kind: lmb}\nfusion: {kind: clmb"),
    ],
)
def test_few_truncated_births_are_accepted(cure: tuple[str, str]) -> None:
    parse_scenario(changed(*FAST, SLOW_SCANS, ("existence: 0.1", "existence: 0.2"), cure))


def test_birth_sites_with_low_detection_probability_warn(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    for changes, is_warned in ((FAST, False), ((*FAST, FAR), True)):
        file.write_text(changed(*changes))
        found = [line for line in scenario_warnings(load_scenario(file)) if "are detected late" in line]
        assert len(found) == is_warned
        assert all("take filter.kind: factored_glmb or lmb" in line for line in found)
