"""Recordings and lines with reported classes and sizes: read, tracked, written, joined."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from live.examples import small
from models.same_rows import assert_same_rows
from vedette.densities import Estimate
from vedette.errors import InputError, ScenarioError
from vedette.evaluation import track_recording
from vedette.evaluation.gaps import GapRatios, _likely_pairs
from vedette.evaluation.joining import joins_of_run, with_joined_tracks
from vedette.evaluation.scans import scan_table
from vedette.evaluation.track_table import table_of_run, write_tracks
from vedette.live.messages import read_message
from vedette.models import BirthModel, ClassFeatures, ScanRows
from vedette.recorded import Conventions, RecordedSensor, parse_scans
from vedette.recorded.merging import merged
from vedette.recorded.returns import Extent
from vedette.recorded.tables import as_table
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.simulation import load_run, save_run

PROBS, CONFUSION = (0.7, 0.3), ((0.9, 0.1), (0.15, 0.85))
SIZES = ((12.0, 5.0), (110.0, 40.0))
CAMERA = ClassFeatures(PROBS, ("small", "large"), CONFUSION, (0.5, 0.5), SIZES, (30.0, 30.0))
PLACE = RecordedSensor("R", "position", (0.0, 0.0, 0.0), features=CAMERA)
ROWS = {
    "time": [0.0, 0.0, 0.0, 1.0],
    "x": [1.0, 200.0, 300.0, None],
    "y": [5.0, 6.0, 7.0, None],
    "class": ["small", " large ", "", None],
    "size_km": [0.02, "", 0.1, None],
}
SENSORS = """
classes: {fishing: 0.7, cargo: 0.3}
sensor_defaults:
  measurement: {kind: position}
  noise: {kind: constant, std: [20.0, 20.0]}
  detection: {kind: constant, probability: 0.9}
  clutter: {kind: region, rate: 1.0}
sensors:
  - name: R
    position: [0.0, 0.0]
    classification:
      confusion: {fishing: {small: 0.9, large: 0.1}, cargo: {small: 0.15, large: 0.85}}
      size: {fishing: {mean: 12.0, std: 5.0}, cargo: {mean: 110.0, std: 40.0}, clutter: {mean: 30.0, std: 30.0}}
  - {name: P, position: [10.0, 0.0]}
"""


def test_log_ratios_are_those_of_the_densities() -> None:
    false = norm.pdf(40.0, 30.0, 30.0)
    expected = [
        np.log(row[1] / 0.5) + np.log(norm.pdf(40.0, mean, std) / false)
        for row, (mean, std) in zip(CONFUSION, SIZES, strict=True)
    ]
    np.testing.assert_allclose(CAMERA.log_ratios(1, 40.0), expected, rtol=1e-12)
    assert CAMERA.log_ratios().tolist() == [0.0, 0.0]


def test_false_measurements_are_as_targets_where_nothing_else_is_given() -> None:
    plain = ClassFeatures(PROBS, ("small", "large"), CONFUSION, (), SIZES)
    for ratios in (plain.log_ratios(report=0), plain.log_ratios(size=33.0)):
        assert np.exp(ratios) @ PROBS == pytest.approx(1.0, rel=1e-12)


def test_an_impossible_report_is_a_finite_number() -> None:
    sure = ClassFeatures(PROBS, ("a", "b", "c"), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    assert sure.log_ratios(0).tolist() == [pytest.approx(np.log(1.0 / 0.7)), -700.0]
    assert sure.log_ratios(2).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((PROBS, ("a", "b"), ((0.5, 0.6), (0.5, 0.5))), r"confusion\[0\]: expected probabilities that sum to 1"),
        ((PROBS, ("a", "b"), ((0.5, 0.5),)), "confusion: expected one row for each of 2 classes"),
        ((PROBS, ("a",), ((0.5, 0.5), (0.5, 0.5))), r"confusion\[0\]: expected an array of shape"),
        ((PROBS, (), (), (), ((1.0, 0.0), (1.0, 1.0))), r"sizes\[0\]: expected a standard deviation above 0"),
        (((0.5, 0.6),), "class_probs: expected probabilities that sum to 1"),
    ],
)
def test_bad_features_are_named(given: Any, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        ClassFeatures(*given)


def test_classes_and_sizes_of_rows_are_read() -> None:
    recording = parse_scans(as_table(ROWS), [PLACE], Conventions({}, {}))
    assert recording.unused == ()
    ratios = [CAMERA.log_ratios(0, 20.0), CAMERA.log_ratios(1), CAMERA.log_ratios(size=100.0)]
    measured = [[1.0, 5.0], [200.0, 6.0], [300.0, 7.0]]
    scan: Any = recording.scans[0][0]
    assert_same_rows(scan, ScanRows(measured, class_ratios=ratios))
    plain = parse_scans(as_table(ROWS), [replace(PLACE, features=None)], Conventions({}, {}))
    assert plain.unused == ("class", "size_km")
    with pytest.raises(InputError, match=r"row 1, column 'class': expected one of 'small', 'large', or an empty cell"):
        parse_scans(as_table(ROWS | {"class": ["huge", "", "", None]}), [PLACE], Conventions({}, {}))


def test_merged_rows_have_the_mean_ratio_and_a_class_only_if_they_agree() -> None:
    columns = ROWS | {"x": [1.0, 2.0, 2.5, None], "y": [5.0, 6.0, 6.5, None]}
    for reports, expected in ((["large"] * 3, 1.0), (["small", "large", "large"], np.nan)):
        recording = parse_scans(as_table(columns | {"class": [*reports, None]}), [PLACE], Conventions({}, {}))
        before: Any = recording.scans[0][0]
        found = merged(recording, [PLACE], [Extent(10.0, "as given")])
        scan, accuracy = (each[0][0] for each in (found.scans, found.accuracy))
        assert isinstance(scan, ScanRows)
        assert isinstance(accuracy, np.ndarray)
        for name in ("values", "class_ratios"):
            np.testing.assert_allclose(getattr(scan, name), getattr(before, name).mean(axis=0, keepdims=True))
        np.testing.assert_array_equal(accuracy[:, 0], [expected])


def recording_of(folder: Path, sensors: str = SENSORS) -> Any:
    """Two targets of one class each, one a fishing boat, the other a cargo ship, seen by R; P sees no classes."""
    rng, rows = np.random.default_rng(2), list[list[Any]]()
    for k in range(20):
        for y, report, size in ((-500.0, "small", 14.0), (500.0, "large", 120.0)):
            for name, more in (("R", [report, size if k % 3 else ""]), ("P", ["", ""])):
                rows.append([2.0 * k + (name == "P"), name, *rng.normal([10.0 * k, y], 20.0), *more])
    with (folder / "scans.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["time", "sensor", "x_m", "y_m", "class", "size_m"], *rows])
    (folder / "sensors.yaml").write_text(sensors, "utf-8")
    return scenario_from_recording(folder / "sensors.yaml", folder / "scans.csv")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Any:
    found = recording_of(tmp_path_factory.mktemp("classes"))
    return found, track_recording(found.scenario, found.recording)


def test_tracks_have_their_classes(run: Any, tmp_path: Path) -> None:
    found, record = run
    last = record.estimates[-1]
    assert last.num_targets == 2
    for mean, probs in zip(last.means, last.class_probs, strict=True):
        assert probs[0 if mean[1] < 0.0 else 1] > 0.999
        assert probs.sum() == pytest.approx(1.0)
    table = table_of_run(record, found.scenario)
    assert [table["class"][-2:], table["y_m"][-2] < 0.0] in (
        [["fishing", "cargo"], True],
        [["cargo", "fishing"], False],
    )
    probs = np.column_stack([table["prob_fishing"], table["prob_cargo"]])
    np.testing.assert_allclose(probs.sum(axis=1), 1.0)
    for ending in ("csv", "parquet"):
        write_tracks(tmp_path / f"tracks.{ending}", table)


def test_a_saved_run_keeps_classes(run: Any, tmp_path: Path) -> None:
    _, record = run
    save_run(record, tmp_path / "run")
    for mine, theirs in zip(load_run(tmp_path / "run").estimates, record.estimates, strict=True):
        np.testing.assert_array_equal(mine.class_probs, theirs.class_probs)


def test_scans_that_are_written_again_have_classes(run: Any, tmp_path: Path) -> None:
    found, record = run
    table = scan_table(record, found.scenario)
    with (tmp_path / "scans.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([list(table), *zip(*table.values(), strict=True)])
    (tmp_path / "sensors.yaml").write_text("recording: {bearings: east}" + SENSORS, "utf-8")
    again = scenario_from_recording(tmp_path / "sensors.yaml", tmp_path / "scans.csv").recording
    for mine, theirs in zip(again.scans, found.recording.scans, strict=True):
        for one, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kind", ["lmb", "delta_glmb", "m_delta_glmb"])
def test_other_filters_track_classes(kind: str, tmp_path: Path) -> None:
    found = recording_of(tmp_path, SENSORS + f"filter: {{kind: {kind}}}\n")
    last = track_recording(found.scenario, found.recording).estimates[-1]
    near = last.class_probs[np.argmin(np.abs(last.means[:, 1] + 500.0))]
    assert near[0] > 0.95


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("cargo: 0.3}", "cargo: 0.4}", "classes: expected at least 2 probabilities that sum to 1, got 2 of sum 1.1"),
        ("cargo: 0.3}", "clutter: 0.3}", "classes.clutter: expected another name than clutter"),
        ("large: 0.1}", "large: 0.3}", r"confusion.fishing: expected probabilities that sum to 1, got 1.2"),
        ("large: 0.1}", "huge: 0.1}", "confusion.fishing: expected the same reports for each class: also large"),
        ("cargo: {small", "tanker: {small", "confusion: expected the classes fishing, cargo, and optionally clutter"),
        (
            "classes: {fishing: 0.7, cargo: 0.3}",
            "",
            "expected `classes` of targets in the file, and optionally clutter",
        ),
        ("std: 40.0}", "std: 0.0}", "size.cargo.std: expected"),
    ],
)
def test_faults_of_the_sensors_file_are_named(old: str, new: str, expected: str, tmp_path: Path) -> None:
    assert old in SENSORS
    with pytest.raises(ScenarioError, match=expected):
        recording_of(tmp_path, SENSORS.replace(old, new))


def line(**more: Any) -> bytes:
    return json.dumps({"sensor": "R", "time": 5.0, "measurements": [[1.0, 5.0], [200.0, 6.0]], **more}).encode()


def test_lines_have_classes_and_sizes() -> None:
    given = line(**{"class": ["small", None], "size_m": [None, 40.0]})
    scan = read_message(given, "line 1", [PLACE], Conventions({}, {})).scan.measurements
    ratios = [CAMERA.log_ratios(0), CAMERA.log_ratios(size=40.0)]
    expected = ScanRows([[1.0, 5.0], [200.0, 6.0]], class_ratios=ratios)
    assert_same_rows(scan, expected)


@pytest.mark.parametrize(
    ("more", "site", "expected"),
    [
        ({"class": ["small"]}, PLACE, "class: expected 2 texts or null, one for each measurement"),
        ({"class": ["small", 3]}, PLACE, "class: expected 2 texts or null, one for each measurement"),
        ({"class": ["small", "huge"]}, PLACE, "column 'class': expected one of 'small', 'large'"),
        ({"size_m": ["x", 3]}, PLACE, "size_m: expected 2 numbers or null, one for each measurement"),
        (
            {"size_m": [1, 3]},
            replace(PLACE, features=None),
            "size_m: expected none, as the sensors file gives no `class",
        ),
    ],
)
def test_bad_classes_in_lines_are_named(more: dict[str, Any], site: RecordedSensor, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        read_message(line(**more), "line 1", [site], Conventions({}, {}))


def test_answers_have_the_classes_of_tracks(tmp_path: Path) -> None:
    region = "region: {x_min: -1000.0, x_max: 1000.0, y_min: -1000.0, y_max: 1000.0}\n"
    loop = small(tmp_path, SENSORS + region)
    state, answers = loop.initial(), tuple[Any, ...]()
    for k in range(6):
        more = {"class": ["large"], "size_m": [120.0]}
        state, answers = loop.process(state, line(time=2.0 * k, measurements=[[10.0 * k, 50.0]], **more))
    (track,) = answers[0]["tracks"]
    assert list(track["classes"]) == ["fishing", "cargo"]
    assert track["classes"]["cargo"] > 0.99


@pytest.mark.parametrize("more", [{}, {"stds": [[15.0, 15.0]]}, {"class": [None]}])
def test_a_line_with_more_columns_has_no_more_measurements(more: dict[str, Any], tmp_path: Path) -> None:
    region = "region: {x_min: -1000.0, x_max: 1000.0, y_min: -1000.0, y_max: 1000.0}\n"
    loop = small(tmp_path, SENSORS + region)
    state, answers = loop.initial(), tuple[Any, ...]()
    for k in range(4):
        state, answers = loop.process(state, line(time=2.0 * k, measurements=[[10.0 * k, 50.0]], **more))
    assert len(answers[0]["tracks"]) == 1


def test_labels_of_other_classes_are_not_joined(run: Any) -> None:
    """The factor of a pair against Bayes' rule, summed over the classes."""
    found, record = run
    probs = np.array([[0.9, 0.1], [0.2, 0.8]])
    birth = BirthModel(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)), class_probs=np.array(PROBS))

    class History:
        def __init__(self, own: Any) -> None:
            self.class_probs = own[np.newaxis]

    ended, began = (index.ravel() for index in np.indices((2, 2)))
    histories: Any = [History(own) for own in probs]
    logs = _likely_pairs([GapRatios(ended, began, np.zeros(4))], histories, birth).log_ratios.reshape(2, 2)
    for i, first in enumerate(probs):
        for j, second in enumerate(probs):
            likelihood = second / PROBS  # of the features of the second, up to a factor
            expected = (first @ likelihood) / (np.array(PROBS) @ likelihood)
            assert np.exp(logs[i, j]) == pytest.approx(expected)
    joined = with_joined_tracks(record, joins_of_run(record, found.scenario))
    assert isinstance(joined.estimates[-1], Estimate)
    assert joined.estimates[-1].class_probs.shape == (2, 2)
