# ruff: noqa: E501
"""The words and places of the faults of time, region, motion, survival, births and targets."""

from __future__ import annotations

import pytest

from scenarios.minimal import changed
from vedette.errors import ScenarioError
from vedette.scenarios import parse_scenario

CASES = [
    (
        "name: small",
        "nane: small",
        [
            "f.yaml:1:1: name: expected a value, as it is required, got nothing",
            "f.yaml:1:1: nane: expected one of birth, control, description, estimator, filter, format, fusion, metrics, motion, name, network, ospa, planners, region, sensor_defaults, sensors, survival, targets, time, undetected, got an unknown key (did you mean name?)",
        ],
    ),
    ("name: small", "name: ''", ['f.yaml:1:7: name: expected a name of one or more printable characters, got ""']),
    ("name: small", "name: small\nformat: 2", ["f.yaml:2:9: format: expected 1, got 2"]),
    (
        "name: small",
        "name: small\ndescription: 3",
        ["f.yaml:2:14: description: expected a word or text in quotes, got 3"],
    ),
    ("num_steps: 20", "num_steps: 20.5", ["f.yaml:2:19: time.num_steps: expected a whole number, got 20.5"]),
    ("num_steps: 20", "num_steps: 0", ["f.yaml:2:19: time.num_steps: expected a number of at least 1, got 0"]),
    ("step_period: 0.5", "step_period: fast", ['f.yaml:2:36: time.step_period: expected a number, got "fast"']),
    ("num_steps: 20, ", "", ["f.yaml:2:1: time.num_steps: expected a value, as it is required, got nothing"]),
    ("x_max: 100.0", "x_max: -200.0", ["f.yaml:3:32: region.x_max: expected a number above x_min, -100, got -200.0"]),
    ("y_max: 50.0", "y_max: .nan", ["f.yaml:3:60: region.y_max: expected a finite number, got nan"]),
    (
        "region: {x_min: -100.0, x_max: 100.0, y_min: -50.0, y_max: 50.0}",
        "region: [1, 2]",
        ["f.yaml:3:9: region: expected a mapping, got a list of 2"],
    ),
    (
        "kind: constant_velocity",
        "kind: constant_speed",
        ['f.yaml:4:16: motion.kind: expected one of constant_velocity, coordinated_turn, custom, got "constant_speed"'],
    ),
    (
        "kind: constant_velocity, ",
        "",
        [
            "f.yaml:4:9: motion: expected a mapping with kind: one of constant_velocity, coordinated_turn, custom, got no kind"
        ],
    ),
    ("sigma_v: 1.0", "sigma_v: -1.0", ["f.yaml:4:44: motion.sigma_v: expected a number of at least 0, got -1.0"]),
    (
        "{kind: constant_velocity, sigma_v: 1.0}",
        "{kind: coordinated_turn}",
        [
            "f.yaml:9:30: birth.sites[0].mean: expected 5 numbers, as a state under motion has, got a list of 4",
            "f.yaml:9:57: birth.sites[0].std: expected 5 numbers, as a state under motion has, got a list of 4",
            "f.yaml:13:15: targets.tracks[0].state: expected 5 numbers, as a state under motion has, got a list of 4",
        ],
    ),
    (
        "{kind: constant_velocity, sigma_v: 1.0}",
        "{kind: custom, function: nowhere, state_dim: 4}",
        ['f.yaml:4:34: motion.function: expected "package.module:attribute" or "file.py:attribute", got "nowhere"'],
    ),
    (
        "{kind: constant_velocity, sigma_v: 1.0}",
        "{kind: custom, function: 'absent.py:motion', state_dim: 4}",
        ['f.yaml:4:34: motion.function: expected a file, relative to the scenario file, got "absent.py": no such file'],
    ),
    (
        "{kind: constant_velocity, sigma_v: 1.0}",
        "{kind: custom, function: 'no_such_module_here:motion', state_dim: 4}",
        ['f.yaml:4:34: motion.function: expected a module that Python finds, got "no_such_module_here"'],
    ),
    (
        "probability: 0.95",
        "probability: 95",
        ["f.yaml:5:41: survival.probability: expected a number of at most 1, got 95"],
    ),
    (
        "steps: [1, 5]",
        "steps: [1, 1, 21]",
        [
            "f.yaml:7:14: birth.steps[1]: expected each step once, got 1 again",
            "f.yaml:7:17: birth.steps[2]: expected a step up to the last, 20, got 21",
        ],
    ),
    ("steps: [1, 5]", "steps: always", ['f.yaml:7:10: birth.steps: expected every or a list, got "always"']),
    ("existence: 0.1", "existence: 1.0", ["f.yaml:9:19: birth.sites[0].existence: expected a number below 1, got 1.0"]),
    (
        "std: [5.0, 5.0, 2.0, 2.0]",
        "std: [5.0, 5.0, 0.0, 2.0]",
        ["f.yaml:9:68: birth.sites[0].std[2]: expected a number above 0, got 0.0"],
    ),
    (
        "mean: [0.0, 0.0, 0.0, 0.0]",
        "mean: [0.0, 0.0]",
        ["f.yaml:9:30: birth.sites[0].mean: expected 4 numbers, as a state under motion has, got a list of 2"],
    ),
    (", std: [5.0, 5.0, 2.0, 2.0]", "", ["f.yaml:9:7: birth.sites[0]: expected either std or cov, got neither"]),
    (
        "std: [5.0, 5.0, 2.0, 2.0]",
        "cov: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 2, 1]]",
        [
            "f.yaml:9:57: birth.sites[0].cov: expected a positive definite matrix, got correlations with a least eigenvalue of -1"
        ],
    ),
    (
        "std: [5.0, 5.0, 2.0, 2.0]",
        "cov: [[1, 0], [0, 1]]",
        ["f.yaml:9:57: birth.sites[0].cov: expected 4 rows of 4 numbers, got a list of 2"],
    ),
    (
        "    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}\n",
        "    []\n",
        ["f.yaml:9:5: birth.sites: expected at least one site, or from_measurements, got neither"],
    ),
    (
        "end_step: 18",
        "end_step: 18, std: [1.0, -1.0, 0.0, 0.0]",
        ["f.yaml:13:78: targets.tracks[0].std[1]: expected a number of at least 0, got -1.0"],
    ),
    (
        "end_step: 18",
        "end_step: 18, std: [1.0]",
        ["f.yaml:13:72: targets.tracks[0].std: expected 4 numbers, as a state under motion has, got a list of 1"],
    ),
    (
        "end_step: 18",
        "end_step: 1",
        ["f.yaml:13:63: targets.tracks[0].end_step: expected a step from start_step, 2, on, got 1"],
    ),
    (
        "end_step: 18",
        "end_step: 21",
        ["f.yaml:13:63: targets.tracks[0].end_step: expected a step up to the last, 20, got 21"],
    ),
    (
        "state: [1.0, 2.0, 0.5, -0.5]",
        "state: [1.0, 2.0, 0.5]",
        ["f.yaml:13:15: targets.tracks[0].state: expected 4 numbers, as a state under motion has, got a list of 3"],
    ),
    (
        "state: [1.0, 2.0, 0.5, -0.5]",
        "state: 1.0, 2.0",
        [
            "f.yaml:13:15: targets.tracks[0].state: expected a list, got 1.0",
            "f.yaml:13:20: targets.tracks[0]: expected a word as key, got 2.0",
        ],
    ),
    (
        "  kind: scripted\n  tracks:\n    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}",
        "  kind: recorded\n  path: nowhere.csv",
        ['f.yaml:12:9: targets.path: expected a file, relative to the scenario file, got "nowhere.csv": no such file'],
    ),
]


@pytest.mark.parametrize(("old", "new", "faults"), CASES, ids=[f"{old[:20]} -> {new[:40]}" for old, new, _ in CASES])
def test_faults_are_named_with_their_places(old: str, new: str, faults: list[str]) -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(changed((old, new)), "f.yaml")
    assert error.value.faults == faults


def test_recorded_targets_have_no_states_of_another_motion_to_score() -> None:
    text = changed(
        ("kind: constant_velocity, sigma_v: 1.0", "kind: coordinated_turn"),
        ("mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]", "mean: [0.0, 0, 0, 0, 0], std: [5.0, 5, 2, 2, 1]"),
        (
            "  kind: scripted\n  tracks:\n    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}",
            "  kind: recorded\n  path: nowhere.csv",
        ),
        ("cutoff: 50.0", "cutoff: 50.0, components: state"),
    )
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text, "f.yaml")
    wanted = "position, as states have 5 components and recorded targets 4"
    assert f'f.yaml:22:34: ospa.components: expected {wanted}, got "state"' in error.value.faults
