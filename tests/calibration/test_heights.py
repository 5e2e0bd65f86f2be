"""Radars that measure slant ranges, elevations or altitudes: which biases are found, and which cannot be."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from vedette.calibration import Calibration, Parameter, ParameterEstimate, calibrate
from vedette.calibration.registration import match_measurements
from vedette.internal.quantities import COMPONENTS
from vedette.scenarios.calibration import build_problem, calibrated_text
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording

RADARS = {"R": (-10e3, 0.0, 30.0), "S": (10e3, 2e3, 200.0)}
STDS = {"bearing": 0.002, "range": 40.0, "elevation": 0.005, "altitude": 30.0, "x": 30.0, "y": 30.0}
COLUMNS = {"bearing": "bearing_rad", "range": "range_m", "elevation": "elevation_rad", "altitude": "altitude_m"}
BIASES = {
    "R": {"bearing": 0.012, "range": 250.0, "elevation": 0.02, "altitude": 200.0},
    "S": {"bearing": -0.015, "range": -150.0, "elevation": -0.015, "altitude": -150.0},
}
KINDS = ("bearing_slant_range", "bearing_range_elevation", "bearing_range_altitude")


def recorded(folder: Path, kind: str, num_radars: int = 2, no_altitude: float = 0.0) -> RecordingScenario:
    """Of five straight aircraft. no_altitude: share of the rows without the third component."""
    rng, names = np.random.default_rng(4), COMPONENTS[kind]
    starts = np.column_stack([rng.uniform(-15e3, 15e3, (5, 2)), rng.uniform(3e3, 9e3, 5)])
    velocities = np.column_stack([rng.uniform(-150.0, 150.0, (5, 2)), rng.uniform(-8.0, 8.0, 5)])
    lines = [",".join(["time", "sensor", *(COLUMNS[name] for name in names)])]
    for k, (name, radar) in enumerate(list(RADARS.items())[:num_radars]):
        for time in np.arange(0.5 + k, 100.0, 4.0).tolist():
            for x, y, z in (starts + time * velocities - [*radar[:2], 0.0])[rng.random(5) < 0.95].tolist():
                up = z - radar[2]
                true = {"bearing": math.atan2(y, x), "range": math.hypot(x, y, up), "altitude": z}
                true["elevation"] = math.atan2(up, math.hypot(x, y))
                cells = [str(true[one] + BIASES[name][one] + rng.normal(0.0, STDS[one])) for one in names]
                if rng.random() < no_altitude:
                    cells[2] = ""
                lines.append(",".join([str(time), name, *cells]))
    (folder / "scans.csv").write_text("\n".join(lines), "utf-8")
    sensors = "".join(
        f"  - {{name: {name}, position: [{x}, {y}], height: {z}}}\n"
        for name, (x, y, z) in list(RADARS.items())[:num_radars]
    )
    (folder / "radars.yaml").write_text(
        "recording: {bearings: east, turns: none}\nmotion: {kind: constant_velocity_height, sigma_v: 0.5}\n"
        f"sensor_defaults:\n  measurement: {{kind: {kind}}}\n"
        f"  noise: {{kind: constant, std: {[1.2 * STDS[name] for name in names]}}}\n"
        "  detection: {kind: constant, probability: 0.9}\n  clutter: {kind: region, rate: 1.0}\n"
        f"sensors:\n{sensors}",
        "utf-8",
    )
    return scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", speed=250.0)


def by_name(calibration: Calibration) -> dict[tuple[int, str], ParameterEstimate]:
    return {(each.parameter.sensor, each.parameter.component): each for each in calibration.estimates}


def truth(parameter: Parameter) -> float:
    """In the unit of the parameter."""
    value = BIASES[list(RADARS)[parameter.sensor]].get(parameter.component, 0.0)
    return math.degrees(value) if parameter.unit == "deg" else value


@pytest.mark.parametrize("kind", KINDS)
def test_biases_of_two_radars_are_estimated(tmp_path: Path, kind: str) -> None:
    scenario = recorded(tmp_path, kind).scenario
    problem = build_problem(scenario, prior_scale=10.0)
    calibration = calibrate(problem, only=[each for each in problem.parameters if each.kind == "bias"])
    assert calibration.converged
    assert {each.parameter.component for each in calibration.estimates} == {*COMPONENTS[kind], "clock"}
    for each in calibration.estimates:
        assert not each.reason
        assert abs(each.value - truth(each.parameter)) < 3.5 * each.std, each
    found = by_name(calibration)
    assert found[0, "range"].std < 60.0
    for name, largest in (("elevation", 0.2), ("altitude", 60.0)):
        if name in COMPONENTS[kind]:
            assert found[1, name].std < largest
    text = calibrated_text(scenario, tmp_path / "radars.yaml", calibration, tmp_path)
    (tmp_path / "found.yaml").write_text(text, "utf-8")
    again = build_problem(
        scenario_from_recording(tmp_path / "found.yaml", tmp_path / "scans.csv", speed=250.0).scenario
    )
    starts = [each.start for each in again.parameters if each.kind == "bias"]
    better = [each.value if each.is_better else each.parameter.start for each in calibration.estimates]
    assert starts == pytest.approx(better, rel=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_noise_detection_and_clutter_of_one_radar_are_estimated_and_its_biases_are_not(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def counted(*args: object) -> object:
        calls.append(args)
        return match_measurements(*args)  # type: ignore[arg-type]

    monkeypatch.setattr("vedette.calibration.initial_guess.match_measurements", counted)
    problem = build_problem(recorded(tmp_path, kind, 1).scenario, prior_scale=10.0)
    calibration = calibrate(problem)
    assert len(calls) == 3  # though biases are held as not identifiable
    has_heights = kind != "bearing_slant_range"  # one slant range leaves the height open, and the likelihood jumps
    assert calibration.converged or not has_heights
    for each in calibration.estimates:
        if each.parameter.kind == "bias":
            what = "a rotation of all targets" if each.parameter.component == "bearing" else "another motion"
            assert f"not identifiable: there is no other sensor to separate it from {what}" in each.reason
            assert (each.value, math.isnan(each.ci_low)) == (0.0, True)
        elif each.parameter.kind == "noise" and has_heights:
            std = STDS[each.parameter.component]
            assert 0.7 * std < each.value < 1.4 * std, each


def test_rows_without_an_altitude_are_calibrated(tmp_path: Path) -> None:
    problem = build_problem(recorded(tmp_path, "bearing_range_altitude", no_altitude=0.3).scenario, prior_scale=10.0)
    calibration = calibrate(problem, only=[each for each in problem.parameters if each.kind == "bias"])
    assert calibration.converged
    for each in calibration.estimates:
        assert abs(each.value - truth(each.parameter)) < 3.5 * each.std, each
