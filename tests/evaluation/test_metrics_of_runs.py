from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from evaluation.synthetic import make_record
from vedette.densities.estimates import Estimate
from vedette.errors import InputError, NumericalError
from vedette.evaluation import (
    RunMetrics,
    TimeToTrack,
    continuity_of_run,
    gospa_of_run,
    match_run,
    measure,
    nees,
    ospa2_of_run,
)
from vedette.simulation.records import RunRecord

CUTOFF, ORDER, WINDOW = 30.0, 2.0, 7


def measured(record: RunRecord) -> RunMetrics:
    return measure(record, cutoff=CUTOFF, order=ORDER, window=WINDOW)


def test_each_column_is_its_own_measure() -> None:
    record = make_record("random")
    metrics, truth, estimates = measured(record), record.truth, record.estimates
    gospa = gospa_of_run(truth, estimates, cutoff=CUTOFF, order=ORDER)
    assert metrics.gospa_m.tolist() == gospa.total.tolist()
    assert metrics.gospa_localisation.tolist() == gospa.localisation.tolist()
    assert metrics.gospa_missed.tolist() == gospa.missed.tolist()
    assert metrics.gospa_false.tolist() == gospa.false.tolist()
    assert metrics.num_missed.tolist() == gospa.num_missed.tolist()
    assert metrics.num_false.tolist() == gospa.num_false.tolist()
    ospa2 = ospa2_of_run(truth, estimates, cutoff=CUTOFF, order=ORDER, window=WINDOW)
    assert metrics.ospa2_m.tolist() == ospa2[:, 0].tolist()
    breaks = continuity_of_run(truth, estimates, cutoff=CUTOFF, order=ORDER)
    assert metrics.label_switches.tolist() == breaks.label_switches.tolist()
    assert metrics.fragmentations.tolist() == breaks.fragmentations.tolist()
    assert metrics.fragmentations.any()
    np.testing.assert_array_equal(metrics.seconds_to_track, TimeToTrack(CUTOFF, ORDER)(record))
    assert not np.isnan(metrics.seconds_to_track).all()


def test_numbers_of_targets_and_pairs_agree() -> None:
    record = make_record("random")
    metrics = measured(record)
    for scan, estimate in enumerate(record.estimates):
        ids, _ = record.truth.at(scan)
        assert metrics.cardinality_error[scan] == estimate.num_targets - len(ids)
        assert metrics.nees_count[scan] == len(ids) - metrics.num_missed[scan]
        assert metrics.num_false[scan] - metrics.num_missed[scan] == metrics.cardinality_error[scan]


def test_nees_is_the_mean_over_the_pairs_of_the_scan() -> None:
    record = make_record("jdm")
    metrics = measured(record)
    for scan, estimate in enumerate(record.estimates):
        ids, states = record.truth.at(scan)  # labels of the synthetic estimates are the ids; targets lie far apart
        rows = [ids.tolist().index(index) for index in estimate.labels[:, 1].tolist()]
        errors = estimate.means - states[rows]
        near = np.hypot(*errors[:, :2].T) < CUTOFF
        if not near.any():
            assert math.isnan(metrics.nees_mean[scan])
            assert math.isnan(metrics.position_nees_mean[scan])
            assert math.isnan(metrics.position_nees_max[scan])
            continue
        full, position = nees(errors, estimate.covs)[near], nees(errors[:, :2], estimate.covs[:, :2, :2])[near]
        assert metrics.nees_mean[scan] == pytest.approx(full.mean())
        assert metrics.position_nees_mean[scan] == pytest.approx(position.mean())
        assert metrics.position_nees_max[scan] == pytest.approx(position.max())


def test_states_of_another_dimension_have_a_nees_of_position_alone() -> None:
    record = make_record("jdm")
    known = measured(record)
    flat = replace(record, truth=replace(record.truth, states=np.ascontiguousarray(record.truth.states[:, :2])))
    metrics = measured(flat)
    assert np.isnan(metrics.nees_mean).all()
    assert not metrics.nees_count.any()
    assert metrics.position_nees_mean == pytest.approx(known.position_nees_mean, nan_ok=True)


def test_columns_and_back() -> None:
    metrics = measured(make_record("random"))
    columns = metrics.columns()
    again = RunMetrics.from_columns(dict(reversed(columns.items())))
    assert [*columns, "custom"] == [field.name for field in fields(RunMetrics)]
    for name, values in columns.items():
        assert values.shape == (metrics.num_scans,)
        assert values.dtype == (np.int64 if name in INTEGERS else np.float64)
        assert values.flags.c_contiguous
        assert np.array_equal(values, again.columns()[name], equal_nan=True)


INTEGERS = ("num_missed", "num_false", "cardinality_error", "nees_count", "label_switches", "fragmentations")


def test_a_run_without_any_estimate_keeps_its_types() -> None:
    record = make_record("jdm", num_scans=3)
    metrics = measured(replace(record, estimates=(Estimate.empty(4),) * 3))
    RunMetrics.from_columns(metrics.columns())
    assert metrics.num_missed.tolist() == [3, 3, 3]
    assert metrics.gospa_m == pytest.approx(np.full(3, CUTOFF * math.sqrt(1.5)))
    assert metrics.gospa_localisation.tolist() == [0.0] * 3
    assert metrics.ospa2_m.tolist() == [CUTOFF] * 3
    assert np.isnan(metrics.nees_mean).all()
    assert not metrics.label_switches.any()


def test_other_columns_are_refused() -> None:
    columns = measured(make_record(num_scans=5)).columns()
    missing = {name: values for name, values in columns.items() if name != "ospa2_m"}
    with pytest.raises(InputError, match="columns: expected gospa_m, gospa_localisation"):
        RunMetrics.from_columns(missing)
    with pytest.raises(InputError, match=r"columns\.extra: expected float64"):
        RunMetrics.from_columns({**columns, "extra": columns["num_missed"]})
    with pytest.raises(InputError, match=r"columns.num_missed: expected int64 in shape \(5,\); got float64"):
        RunMetrics.from_columns({**columns, "num_missed": columns["gospa_m"]})
    with pytest.raises(
        InputError, match=r"columns.ospa2_m: expected float64 in shape \(5,\); got float64 in shape \(4,\)"
    ):
        RunMetrics.from_columns({**columns, "ospa2_m": columns["gospa_m"][1:]})


def test_bad_input_is_named() -> None:
    record = make_record(num_scans=12)
    first, *rest = record.estimates[6:]
    cases: list[tuple[Estimate, str]] = [
        (replace(first, means=first.means + math.nan), "estimates: expected finite coordinates"),
        (
            Estimate(first.labels[:1], np.zeros((1, 2)), np.eye(2)[None], np.ones(1)),
            "estimates: expected states of one",
        ),
    ]
    for estimate, message in cases:
        with pytest.raises(InputError, match=message):
            measured(replace(record, estimates=(*record.estimates[:6], estimate, *rest)))
    singular = replace(first, covs=np.zeros_like(first.covs))
    with pytest.raises(NumericalError, match="expected a positive definite matrix"):
        measured(replace(record, estimates=(*record.estimates[:6], singular, *rest)))
    with pytest.raises(InputError, match="one for each of 12 scans; got 11"):
        match_run(record.truth, record.estimates[1:], cutoff=1.0, order=1.0)
    with pytest.raises(InputError, match="order: expected a finite number of at least 1; got inf"):
        match_run(record.truth, record.estimates, cutoff=1.0, order=math.inf)
