"""What filters and fusion report is recorded scan by scan, and a run that stops says where and keeps what it had."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest

from vedette.control import ConstantPlanner
from vedette.errors import NumericalError
from vedette.evaluation.diagnostics import Diagnostic, diagnostics_line, run_diagnostics
from vedette.evaluation.health import health_sums
from vedette.filters import FilterInfo
from vedette.fusion import CmDeltaGlmb
from vedette.fusion.base import FusionInfo
from vedette.models import limited_range
from vedette.platforms import Actions
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation.experiment import Experiment
from vedette.simulation.health import FUSION_COLUMNS, SENSOR_COLUMNS, Health
from vedette.simulation.journal import RunInterrupted, RunStopped
from vedette.simulation.loop import simulate
from vedette.simulation.records import RunRecord
from vedette.simulation.storage import load_run, read_manifest, save_run


def no_score(truth: Any, estimates: Any) -> Any:
    return np.zeros((truth.num_scans, 3))


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    """paper-e, eight scans, a decision after the fifth."""
    whole = build_experiment(load_scenario("paper-e"))
    return replace(whole, times=whole.times[:8], decision_steps=(5,))


def run(experiment: Experiment, planner: Any = None) -> RunRecord:
    return simulate(experiment, planner, seed=3, run=1, score=no_score)


def with_filters(experiment: Experiment, change: Any) -> Experiment:
    tracker: Any = experiment.tracker
    return replace(experiment, tracker=replace(tracker, filters=tuple(change(each) for each in tracker.filters)))


def with_fusion(experiment: Experiment, change: Any) -> Experiment:
    tracker: Any = experiment.tracker
    return replace(experiment, tracker=replace(tracker, fusion=change(tracker.fusion)))


def with_second(experiment: Experiment, change: Any) -> Experiment:
    """Another filter at the second sensor."""
    tracker: Any = experiment.tracker
    return with_filters(experiment, lambda one: one if one is tracker.filters[0] else change(one))


@dataclass(frozen=True)
class _Recording:
    """A filter or fusion that passes on what another does and keeps what it reported."""

    inner: Any
    said: list[Any]

    def fuse(self, beliefs: Any, views: Any = None) -> Any:
        fused, info = self.inner.fuse(beliefs, views)
        self.said.append(info)
        return fused, info


def test_every_field_of_both_reports_is_recorded() -> None:
    # What mixtures lost is told by one filter alone, and not kept with runs.
    assert {field.name for field in fields(FilterInfo)} - set(SENSOR_COLUMNS) == {"reduction_error"}
    of_fusion = {f"fusion_{field.name}" for field in fields(FusionInfo)}
    assert of_fusion - set(FUSION_COLUMNS) == {"fusion_missing_sets", "fusion_missing_labels"}  # these by sensor


def test_the_record_has_reports_of_filters_and_fusion(experiment: Experiment) -> None:
    said: list[Any] = []
    health = run(with_fusion(experiment, lambda inner: _Recording(inner, said))).health
    health.check(8, 2)
    for scan, info in enumerate(said):
        assert health.num_missing_sets[scan].sum() == info.num_missing_sets
        assert health.fusion_num_sets[scan] == info.num_sets
        assert health.fusion_log_normaliser[scan] == info.log_normaliser
    tracker: Any = experiment.tracker
    record = run(experiment)
    assert np.isfinite(record.health.log_likelihood).all()
    assert (record.health.num_hypotheses[1:] > 1).all()
    assert (record.health.num_hypotheses <= tracker.filters[0].limits.max_hypotheses).all()


def test_a_cap_that_is_met_is_recorded(experiment: Experiment) -> None:
    tight = with_filters(experiment, lambda one: replace(one, limits=replace(one.limits, max_hypotheses=2)))
    health = run(tight).health
    assert health.limit_reached[2:].all()
    assert (health.truncation_error_bound[2:] > 0.0).all()
    searched = with_filters(experiment, lambda one: replace(one, limits=replace(one.limits, max_search_nodes=1)))
    assert run(searched).health.search_truncated.any()


def test_labels_that_a_sensor_lacks_are_counted_at_that_sensor(experiment: Experiment) -> None:
    def blind(local: Any) -> Any:
        near = replace(local.sensor, detection=limited_range(0.98, 1.0))
        return replace(local, sensor=near, limits=replace(local.limits, max_hypotheses=1))

    record = run(with_second(experiment, blind))
    assert record.health.num_missing_labels[-1].tolist() == [0, 4]
    sums = health_sums([record.health] * 2)
    assert sums.num_scans == 16
    assert sums.unknown_labels[0] == 0
    assert sums.unknown_labels[1] > 8


def test_a_target_in_view_of_one_sensor_is_reported_as_lost(experiment: Experiment) -> None:
    def near(local: Any) -> Any:
        return replace(local, sensor=replace(local.sensor, detection=limited_range(0.98, 1.0)))

    record = run(with_second(experiment, near))
    assert record.health.fusion_num_lost_labels[-1] >= 1
    lost = diagnostic(record.health, "Targets lost by fusion")
    assert lost.level == "check"
    assert lost.text == "75 % of scans, up to 4 targets"


def test_every_diagnostic_is_ok_only_where_nothing_was_truncated() -> None:
    health = Health.unreported(40, 2)
    assert all(each.level == "ok" for each in run_diagnostics(health))
    assert diagnostics_line(run_diagnostics(health)) == NOTHING
    for name in ("limit_reached", "search_truncated", "num_inexact_clusters", "num_duplicates", "num_clutter_floored"):
        health = Health.unreported(40, 2)
        getattr(health, name)[7, 1] = 1
        assert diagnostics_line(run_diagnostics(health)) != NOTHING, name
    for name in ("fusion_num_lost_labels", "fusion_empty_intersection", "fusion_discarded_weight"):
        health = Health.unreported(40, 2)
        getattr(health, name)[7] = 1
        assert diagnostics_line(run_diagnostics(health)) != NOTHING, name


def test_bounds_are_named_as_bounds() -> None:
    health = _synthetic().health
    health.limit_reached[:] = 0
    health.truncation_error_bound[:] = 0.0004
    health.independence_error_bound[:] = 0.0
    small = diagnostic(health, "Posterior truncated")
    assert (small.text, small.level) == ("weight less than 1 % (mean less than 1 %)", "note")
    health.truncation_error_bound[3, 1] = 0.72
    health.independence_error_bound[2, 0] = 0.5
    large = diagnostic(health, "Posterior truncated")
    assert (large.text, large.level) == ("weight at most 72 % (mean less than 1 %)", "check")
    assert diagnostic(health, "Independence error").text == "at most 25 % (mean less than 1 %)"


def test_an_unknown_weight_is_not_reported_as_zero() -> None:
    health = Health.unreported(40, 2)
    health.truncation_error_bound[:] = math.nan
    assert math.isnan(health_sums([health]).worst_discarded)
    assert diagnostics_line(run_diagnostics(health)) == "posterior truncated: weight not known"


NOTHING = "no limit reached, nothing truncated"


def diagnostic(health: Health, name: str) -> Diagnostic:
    return next(each for each in run_diagnostics(health) if each.name == name)


def _synthetic() -> RunRecord:
    from evaluation.synthetic import make_record

    return make_record()


@dataclass(frozen=True)
class _Failing:
    """Does what another does, until it raises."""

    inner: Any
    error: BaseException
    at: int

    @property
    def targets(self) -> Any:
        return self.inner.targets

    @property
    def sensor(self) -> Any:
        return self.inner.sensor

    def initial(self) -> Any:
        return self.inner.initial()

    def step(self, belief: Any, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator) -> Any:
        if step == self.at:
            raise self.error
        return self.inner.step(belief, scan, pose, dt, step, rng=rng)


class _FailingFusion:
    def __init__(self, inner: CmDeltaGlmb, at: int) -> None:
        self.inner, self.at, self.step = inner, at, 0

    def fuse(self, beliefs: Any, views: Any = None) -> Any:
        self.step += 1
        if self.step == self.at:
            raise NumericalError("fusion of tracks: no density")
        return self.inner.fuse(beliefs, views)


class _FailingPlanner:
    name = "own"

    def plan(self, *_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("by zero")


def failing(experiment: Experiment, error: BaseException, at: int) -> Experiment:
    """The filter of the second sensor raises."""
    return with_second(experiment, lambda local: _Failing(local, error, at))


def assert_first_scans(record: RunRecord, whole: RunRecord, num: int) -> None:
    """A partial record is the beginning of the whole one."""
    assert record.num_scans == num
    np.testing.assert_array_equal(record.poses, whole.poses[:num])
    np.testing.assert_array_equal(record.truth.states, whole.truth.first(num).states)
    for mine, other in zip(record.estimates, whole.estimates[:num], strict=True):
        np.testing.assert_array_equal(mine.means, other.means)
    for field in fields(Health):
        np.testing.assert_array_equal(getattr(record.health, field.name), getattr(whole.health, field.name)[:num])


def test_a_filter_that_raises_is_named_and_what_was_before_is_kept(experiment: Experiment, tmp_path: Any) -> None:
    cause = NumericalError("no hypothesis has positive weight")
    with pytest.raises(RunStopped) as caught:
        run(failing(experiment, cause, 4))
    stop = caught.value
    assert (
        str(stop) == "paper-e, stationary, seed 3, run 1: stopped at step 4 of 8 (4 s), in the filter of sensor 2: no "
        "hypothesis has positive weight"
    )
    assert stop.__cause__ is cause
    assert (stop.step, stop.time, stop.stage) == (4, 4.0, "the filter of sensor 2")
    assert stop.record is not None
    assert_first_scans(stop.record, run(experiment), 3)
    save_run(stop.record, tmp_path / "run")
    assert read_manifest(tmp_path / "run")["run"]["stopped"] == str(stop)
    assert load_run(tmp_path / "run").stopped == str(stop)
    copy = pickle.loads(pickle.dumps(RunStopped(str(stop), 4, 4.0, stop.stage, None)))
    assert (str(copy), copy.step, copy.stage) == (str(stop), 4, stop.stage)


def test_a_fusion_that_raises_is_named(experiment: Experiment) -> None:
    with pytest.raises(RunStopped, match=r"step 6 of 8 \(6 s\), in the fusion: fusion of tracks") as caught:
        run(with_fusion(experiment, lambda inner: _FailingFusion(inner, 6)))
    assert caught.value.record is not None
    assert caught.value.record.num_scans == 5


def test_a_planner_that_raises_leaves_its_own_scan(experiment: Experiment) -> None:
    with pytest.raises(RunStopped, match=r"step 5 of 8 \(5 s\), in the planning: ZeroDivisionError: by zero") as caught:
        run(experiment, _FailingPlanner())
    assert caught.value.record is not None
    assert_first_scans(caught.value.record, run(experiment), 5)


def test_an_error_in_the_first_scan_leaves_no_record(experiment: Experiment) -> None:
    with pytest.raises(RunStopped, match="step 1 of 8") as caught:
        run(failing(experiment, NumericalError("none"), 1))
    assert caught.value.record is None


def test_an_estimate_that_cannot_be_scored_leaves_all_scans(experiment: Experiment) -> None:
    def score(truth: Any, estimates: Any) -> Any:
        raise NumericalError("not finite")

    with pytest.raises(RunStopped, match="in the score: not finite") as caught:
        simulate(experiment, None, seed=3, run=1, score=score)
    assert caught.value.record is not None
    assert caught.value.record.num_scans == 8
    assert np.isnan(caught.value.record.ospa).all()


def test_an_interrupt_keeps_what_was_before(experiment: Experiment) -> None:
    with pytest.raises(RunInterrupted, match=r"step 6 of 8 \(6 s\), in the filter of sensor 2: interrupted") as caught:
        run(failing(experiment, KeyboardInterrupt(), 6), ConstantPlanner((Actions.of(heading_deg=0.0),) * 2))
    assert isinstance(caught.value, KeyboardInterrupt)
    assert caught.value.record is not None
    assert_first_scans(caught.value.record, run(experiment, ConstantPlanner((Actions.of(heading_deg=0.0),) * 2)), 5)
    assert len(caught.value.record.decisions) == 1
