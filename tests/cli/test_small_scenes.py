"""Scenes with one or none of everything, through every command that draws them."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from vedette.cli import app
from vedette.simulation.storage import load_run

SCENE = """\
name: small
time: {num_steps: 6}
region: {x_min: -100.0, x_max: 100.0, y_min: -50.0, y_max: 50.0}
birth:
  steps: [1]
  sites:
    - {existence: 0.9, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}
    - {existence: 0.9, mean: [30.0, 20.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}
targets:
  kind: scripted
  tracks:
    - {state: [1.0, 2.0, 0.5, -0.5]}
    - {state: [31.0, 21.0, 0.5, -0.5]}
sensor_defaults: {noise: {kind: constant, std: [0.02, 3.0]}, clutter: {kind: region, rate: 2.0}}
sensors:
  - {position: [0.0, 40.0], platform: {kind: heading, speed: 4.0}}
  - {position: [0.0, -40.0], platform: {kind: heading, speed: 4.0}}
control: {decision_steps: [4], num_samples: 2}
"""
TARGETS = SCENE[SCENE.index("targets:") : SCENE.index("sensor_defaults:")]
ONE_SENSOR = ("  - {position: [0.0, -40.0], platform: {kind: heading, speed: 4.0}}\n", "")
NO_TARGET = (TARGETS, "targets: {kind: scripted, tracks: []}\n")
ONE_SCAN = ("time: {num_steps: 6}", "time: {num_steps: 1}")
NO_DECISION = ("decision_steps: [4]", "decision_steps: []")
NO_ESTIMATE = ("control:", "estimator: {kind: marginal, threshold: 0.9999999}\ncontrol:")
CHANGES = {
    "as it is": (),
    "one target": (("    - {state: [31.0, 21.0, 0.5, -0.5]}\n", ""),),
    "a target at one scan": (("[31.0, 21.0, 0.5, -0.5]", "[31.0, 21.0, 0.5, -0.5], start_step: 3, end_step: 3"),),
    "no target": (NO_TARGET,),
    "no estimate": (NO_ESTIMATE,),
    "no target and no estimate": (NO_TARGET, NO_ESTIMATE),
    "one sensor": (ONE_SENSOR,),
    "no decision": (NO_DECISION,),
    "one scan": (ONE_SCAN, NO_DECISION),
    "a decision after the only scan": (ONE_SCAN, ("decision_steps: [4]", "decision_steps: [1]")),
    "one component": (
        ("control:", "filter: {kind: m_delta_glmb, limits: {max_components: 1, max_hypotheses: 1}}\ncontrol:"),
    ),
    "one sample": (("num_samples: 2", "num_samples: 1"),),
    "one of everything": (
        *(ONE_SENSOR, ONE_SCAN, NO_DECISION),
        ("    - {state: [31.0, 21.0, 0.5, -0.5]}\n", ""),
        ("control:", "filter: {kind: phd, limits: {max_intensity_components: 1}}\nfusion: {kind: none}\ncontrol:"),
    ),
}


def called(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(params=CHANGES)
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    text = SCENE
    for old, new in CHANGES[request.param]:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return path


def test_a_run_is_saved_drawn_and_shown(scene: Path, tmp_path: Path) -> None:
    planner = "jdm" if "phd" not in scene.read_text() else "random"
    out = tmp_path / "run"
    assert "mean OSPA" in called("run", scene, "--planner", planner, "--out", out)
    assert load_run(out).scenario == "small"
    assert (out / "figures" / "tracks.pdf").stat().st_size > 100
    called("show", scene, "--out", tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 100


# The scenes that draw a page of another kind; the others take as long, and are left to the slow tests.
TELLING = (
    "one target",
    "no target and no estimate",
    "one sensor",
    "a decision after the only scan",
    "one of everything",
)


@pytest.mark.parametrize(
    "scene",
    [name if name in TELLING else pytest.param(name, marks=pytest.mark.slow) for name in CHANGES],
    indirect=True,
)
@pytest.mark.usefixtures("svg_figures")
def test_a_campaign_of_one_run_is_reported_and_exported(scene: Path, tmp_path: Path) -> None:
    spec, folder = tmp_path / "spec.toml", tmp_path / "results"
    planners = '["idm", "stationary"]' if "phd" not in scene.read_text() else '["random", "stationary"]'
    spec.write_text(f'name = "small"\nscenarios = ["{scene.name}"]\nplanners = {planners}\nruns = 1\n')
    called("campaign", spec, "--out", folder, "--workers", 1)
    called("results", folder, "--export", tmp_path / "csv", "--format", "csv")
    called("report", folder, "--figures", tmp_path / "figures")
    assert "small" in (folder / "report.html").read_text("utf-8")
    assert (tmp_path / "csv" / "scans.csv").stat().st_size > 100
