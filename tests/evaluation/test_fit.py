"""The assumed model is tested against the scans of a run: innovations by an oracle, findings by injected faults."""

from __future__ import annotations

import csv
import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recordings import write_recording
from vedette.evaluation.fit import Finding, Fit, fit_of_run
from vedette.evaluation.innovations import Assumed, Instant, compared, joined
from vedette.evaluation.runs import run_scenario, track_recording
from vedette.evaluation.scans import rows_of_record
from vedette.scenarios import Scenario, parse_scenario, replace_fields
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.simulation.storage import read_manifest, save_run

TEXT = """
format: 1
name: two radars
time: {num_steps: 80}
region: {x_min: -5000.0, x_max: 5000.0, y_min: -5000.0, y_max: 5000.0}
motion: {kind: constant_velocity, sigma_v: 0.3}
survival: {kind: constant, probability: 0.99}
birth: {sites: [], from_measurements: {expected: 0.05, std: [60.0, 60.0, 15.0, 15.0]}}
targets:
  kind: scripted
  tracks:
    - {state: [-2000.0, 1000.0, 9.0, 3.0]}
    - {state: [1500.0, 2500.0, -8.0, 5.0]}
    - {state: [0.0, -2500.0, 6.0, 7.0]}
sensor_defaults:
  measurement: {kind: bearing_range}
  noise: {kind: range_dependent, sigma_range: 20.0, eta_range: 0.0, sigma_bearing_deg: 0.4, eta_bearing: 0.0}
  detection: {kind: constant, probability: 0.9}
  clutter: {kind: region, rate: 3.0}
sensors: [{name: east, position: [4000.0, 0.0]}, {name: west, position: [-4000.0, 0.0]}]
fusion: {kind: sequential}
"""
NOISE = {"kind": "range_dependent", "eta_range": 0.0, "eta_bearing": 0.0}
FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "bias": ({"bias": {"bearing_deg": 0.8}}, "bearings are 0.\\d+ deg anticlockwise off its tracks"),
    "noise": ({"noise": {**NOISE, "sigma_range": 60.0, "sigma_bearing_deg": 0.4}}, "ranges spread [12].\\d times"),
    "detection": ({"detection": {"kind": "constant", "probability": 0.5}}, "detects its tracks in \\d+% of scans"),
    "clutter": ({"clutter": {"kind": "region", "rate": 12.0}}, "measurements a scan lie beside all tracks"),
}


def scenario_with(fields: dict[str, Any]) -> Scenario:
    return replace_fields(Scenario(parse_scenario(TEXT)), fields)


def fit_with(fields: dict[str, Any]) -> Fit:
    scenario = scenario_with(fields)
    return fit_of_run(run_scenario(scenario, "stationary", seed=1), scenario)


def test_innovations_are_those_of_a_kalman_filter() -> None:
    """Of a target that is seen at each scan, with linear measurements, filtered by hand from the second estimate on."""
    scenario = scenario_with(
        {
            "targets.tracks": [{"state": [0.0, 0.0, 5.0, 0.0]}],
            "sensors": [
                {
                    "name": "one",
                    "position": [0.0, 0.0],
                    "measurement": {"kind": "position"},
                    "noise": {"kind": "constant", "std": [20.0, 20.0]},
                    "detection": {"kind": "constant", "probability": 0.999},
                    "clutter": {"kind": "region", "rate": 1e-6},
                }
            ],
            "fusion": {"kind": "none"},
        }
    )
    record = run_scenario(scenario, "stationary", seed=0)
    scans = rows_of_record(record, scenario)
    instants = map(Instant, record.times.tolist(), record.poses, scans, record.estimates)
    models = Assumed.of(scenario)
    fits = (compared(*pair, models).fits[0] for pair in pairwise(instants))
    fit = joined(each for each in fits if each is not None)
    transition = np.eye(4) + np.diag([1.0, 1.0], 2)
    start = next(k for k, each in enumerate(record.estimates) if len(each.means))
    mean, cov = record.estimates[start].means[0], record.estimates[start].covs[0]
    process = models.motion.noise_cov(mean, 1.0)
    matches = zip(fit.matches.innovations, fit.matches.variances, fit.matches.whitened, strict=True)
    assert len(fit.matches.labels) == record.num_scans - start - 1
    for k, (innovation, variances, whitened) in enumerate(matches, start=start + 1):
        mean, cov = transition @ mean, transition @ cov @ transition.T + process
        scan = scans[k][0]
        assert isinstance(scan, np.ndarray)
        spread = cov[:2, :2] + 400.0 * np.eye(2)
        np.testing.assert_allclose(innovation, scan[0] - mean[:2], atol=1e-4)
        np.testing.assert_allclose(variances, np.diagonal(spread), rtol=1e-5)
        np.testing.assert_allclose(np.linalg.cholesky(spread) @ whitened, innovation, atol=1e-4)
        gain = cov[:, :2] @ np.linalg.inv(spread)
        mean, cov = mean + gain @ innovation, cov - gain @ spread @ gain.T
    np.testing.assert_allclose(fit.noise_stds, 20.0)
    assert fit.counts.sum() == 0


def test_a_right_model_has_no_finding() -> None:
    fit = fit_with({})
    assert fit.findings == ()
    assert fit.lines()[0].startswith("no fault found; searched: bias, noise,")
    assert fit.lines(num_warnings=2)[0].startswith("nothing beside 2 warnings found; searched: bias")


@pytest.mark.parametrize("test", FAULTS)
def test_a_fault_is_named_with_its_sensor_and_size(test: str) -> None:
    true, words = FAULTS[test]
    fit = fit_with({"sensors.0.true_parameters": true})
    [finding, *_] = [each for each in fit.findings if each.test == test and each.sensor == "east"]
    assert finding.text.startswith("east: ")
    assert re.search(words, finding.text), finding.text
    assert "`vedette track --calibrate`" in finding.text


def test_without_tracks_nothing_is_searched() -> None:
    fit = fit_with({"time.num_steps": 1})
    assert fit.searched == "nothing, as no track spans two scans"


def test_row_noise_counts(tmp_path: Path) -> None:
    """Rows with a column of their own noise are not taken for noise that is too small."""
    write_recording(tmp_path)
    with (tmp_path / "scans.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    rng = np.random.default_rng(3)
    for row in rows:
        row["range_std_m"] = ""
        if row["range_nmi"]:
            row["range_nmi"] = f"{float(row['range_nmi']) + rng.normal(0.0, 150.0) / 1852.0:.6f}"
            row["range_std_m"] = "150"
    with (tmp_path / "scans.csv").open("w", newline="") as file:
        out = csv.DictWriter(file, list(rows[0]))
        out.writeheader()
        out.writerows(rows)
    made = scenario_from_recording(tmp_path / "radars.yaml", tmp_path / "scans.csv")
    fit = fit_of_run(track_recording(made.scenario), made.scenario)
    assert not [each for each in fit.findings if each.test in ("noise", "motion")]


def test_the_fit_is_kept_with_the_run(tmp_path: Path) -> None:
    scenario = scenario_with({"time.num_steps": 3})
    fit = Fit((Finding("bias", "east", "east: bearings are off"),), "bias")
    save_run(run_scenario(scenario, "stationary", seed=0), tmp_path / "run", fit=fit.to_dict())
    kept = read_manifest(tmp_path / "run")["fit"]
    assert Fit.from_dict(json.loads(json.dumps(kept))) == fit
    assert Fit.from_dict(None) is None
