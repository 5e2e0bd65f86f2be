"""What a run would refuse, the check refuses: covariances, numbers beyond sense, files of recorded targets."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.minimal import MINIMAL, changed
from vedette.cli import app
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.models import BirthModel
from vedette.scenarios import Scenario, load_scenario, parse_scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.recording_warnings import recording_warnings
from vedette.scenarios.sections.planners import STRATEGIES

TARGETS = MINIMAL[MINIMAL.index("targets:") : MINIMAL.index("sensor_defaults:")]
SHIPS = "time,id,longitude,latitude\n" + "".join(
    f"{2.0 * k},{ship},{-1.1 + 0.0001 * k:.4f},{50.78 + 0.0001 * ship:.4f}\n" for k in range(12) for ship in (1, 2)
)


def written(folder: Path, ships: str, *changes: tuple[str, str], targets: str = "") -> Path:
    """A scenario file, and the file of recorded targets beside it."""
    (folder / "ships.csv").write_text(ships)
    text = MINIMAL.replace(TARGETS, f"targets: {{kind: recorded, path: ships.csv, crop: false{targets}}}\n")
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    file = folder / "scenario.yaml"
    file.write_text(text)
    return file


def fault(file: Path) -> str:
    with pytest.raises(ScenarioError) as error:
        load_scenario(file)
    (only,) = error.value.faults
    return only


@pytest.mark.parametrize(
    ("rows", "wanted"),
    [
        ("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1e-320]]", "variances from 1e-60"),
        ("[[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]", "a positive definite matrix"),
        ("[[1, 0.5, 0, 0], [0.4, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]", "a symmetric matrix"),
        ("[[1, 2, 0, 0], [2, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]", "least eigenvalue of -1"),
        ("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1e300]]", "a number from -1e+15 to 1e+15"),
    ],
)
def test_a_covariance_that_no_filter_can_use(rows: str, wanted: str) -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(changed(("std: [5.0, 5.0, 2.0, 2.0]", f"cov: {rows}")))
    assert wanted in str(error.value)


def test_check_and_birth_model_refuse_the_same() -> None:
    """A matrix that is definite by rounding alone passed one and not the other."""
    nearly = [[1.0, 1.0 - 1e-15], [1.0 - 1e-15, 1.0]]
    with pytest.raises(InputError, match="positive definite"):
        BirthModel([0.1], [[0.0, 0.0]], [nearly])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ("std: [5.0, 5.0, 2.0, 2.0]", "std: [5.0, 5.0, 2.0, 1e-200]", "a number of at least 1e-30"),
        ("position: [0.0, 40.0]", "position: [0.0, 1e150]", "a number from -1e+15 to 1e+15"),
        ("std: [0.02, 3.0]", "std: [0.02, 1e-200]", "a number of at least 1e-30"),
        ("start: 2.0", "start: 1e15", "a period that can be told apart"),
        ("heading_deg: 4.0", "clutter: {kind: region, rate: 1e9}", "a number of at most 1e"),
        (
            "heading_deg: 4.0",
            "clutter: {kind: measurement_space, low: [0, 0], high: [7, 9]}",
            "an angle of at most 2 pi above low",
        ),
    ],
)
def test_numbers_beyond_sense(old: str, new: str, wanted: str) -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(changed((old, new)))
    assert wanted in str(error.value)


@pytest.mark.parametrize(
    ("ships", "wanted"),
    [
        (SHIPS + "3.0,1,-1.1,north\n", "row 26, column 'latitude': expected a finite number; got 'north'"),
        (SHIPS + "3.0,1,-1.1\n", "row 26: expected 4 cells"),
        (SHIPS + "3.0,,-1.1,50.78\n", "row 26, column 'id': expected a name or number"),
        (SHIPS + "1_0,1,-1.1,50.78\n", "row 26, column 'time': expected a finite number; got '1_0'"),
        ("time,id,longitude,latitude\n", "expected at least one report"),
        ("time,id,longitude,latitude\n1,1,0,0\n", "expected at least one track after cleaning"),
        (SHIPS + "3.0,\xe9,-1.1,50.78\n", "cannot be read as CSV in UTF-8"),
    ],
)
def test_a_file_of_targets_is_read_by_the_check(ships: str, wanted: str, tmp_path: Path) -> None:
    file = written(tmp_path, ships)
    if "\xe9" in ships:
        (tmp_path / "ships.csv").write_bytes(ships.encode("latin-1"))
    text = fault(file)
    assert text.startswith(f"{file}:10:33: targets.path: expected a file of recorded targets that a run can use, got ")
    assert wanted in text


def test_scans_at_which_no_target_is_there_are_refused_by_the_check(tmp_path: Path) -> None:
    assert "expected scans between the first and last report" in fault(
        written(tmp_path, SHIPS, targets=", time_origin: 1000")
    )


def test_a_duplicate_report_is_skipped_and_reported(tmp_path: Path) -> None:
    repeated = SHIPS + SHIPS.split("\n")[1] + "\n4.0,2,-1.0,50.9\n"
    scenario, plain = load_scenario(written(tmp_path, repeated)), load_scenario(written(tmp_path, SHIPS))
    (tmp_path / "ships.csv").write_text(repeated)
    ((path, line),) = recording_warnings(scenario)
    assert path == ("targets", "path")
    assert line == (
        "targets.path: ships.csv, row 26: a second report of one target at the time of row 2; left out, as are 1 more"
    )
    kept = build_experiment(scenario).targets
    (tmp_path / "ships.csv").write_text(SHIPS)
    assert list(recording_warnings(plain)) == []
    for track, other in zip(kept.tracks, build_experiment(plain).targets.tracks, strict=True):  # type: ignore[attr-defined]
        assert (track.times == other.times).all()


def test_positions_in_degrees_or_far_away_are_reported(tmp_path: Path) -> None:
    degrees = written(tmp_path, SHIPS, ("position: [0.0, 40.0]", "position: [-1.1, 50.78]"))
    ((_, line),) = recording_warnings(load_scenario(degrees))
    assert line == (
        "sensors[0].position: expected metres from the origin, got (-1.1, 50.78), which is a longitude and latitude "
        "among those of ships.csv"
    )
    far = written(tmp_path, SHIPS, ("position: [0.0, 40.0]", "position: [0.0, 400000.0]"))
    ((_, line),) = recording_warnings(load_scenario(far))
    assert line.startswith(
        "sensors[0].position: expected metres from the origin, got (0, 400000), 400 km from the nearest"
    )
    result = CliRunner().invoke(app, ["check", str(far)])
    assert result.exit_code == 0
    assert re.search(rf"{re.escape(str(far))}:\d+:\d+: warning: {re.escape(line)}", result.output)


@pytest.mark.parametrize(
    ("code", "wanted"),
    [
        ("def motoin():\n    pass\n", 'expected a name that "own.py" defines, got "motion"'),
        ("def motion(:\n", 'expected a file of Python, got "own.py", line 1, which is none'),
        ("from math import *\n", ""),
        ("motion = print('run')\n", ""),
    ],
)
def test_a_custom_model_is_located_but_not_run(
    code: str, wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text(code)
    file = tmp_path / "scenario.yaml"
    motion = "{kind: custom, function: 'own.py:motion', components: [px, py, vx, vy]}"
    file.write_text(changed(("{kind: constant_velocity, sigma_v: 1.0}", motion)))
    if wanted:
        assert wanted in fault(file)
    else:
        load_scenario(file)
    assert capsys.readouterr().out == ""


ONE_SENSOR = """
name: one
time: {num_steps: 4, step_period: 1.0}
region: {x_min: -500.0, x_max: 500.0, y_min: -500.0, y_max: 500.0}
motion: {kind: constant_velocity, sigma_v: 1.0}
birth: {sites: [{existence: 0.05, mean: [0.0, 0.0, 0.0, 0.0], std: [30.0, 30.0, 5.0, 5.0]}]}
targets: {kind: scripted, tracks: [{state: [10.0, 10.0, 1.0, 0.0]}]}
sensors:
  - position: [0.0, 0.0]
    platform: {kind: heading, speed: 5.0, headings_deg: [0.0, 90.0]}
    measurement: {kind: position}
    noise: {kind: constant, std: [5.0, 5.0]}
    detection: {kind: constant, probability: 0.9}
    clutter: {kind: region, rate: 1.0}
filter: {kind: lmb}
fusion: {kind: none}
control: {decision_steps: [2]}
"""


def one_sensor(*changes: tuple[str, str]) -> str:
    text = ONE_SENSOR
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize("kind", ["phd", "cphd", "cb_member"])
def test_late_scans_and_planners_of_labels_do_not_go_with_filters_without(kind: str) -> None:
    late = (
        "clutter: {kind: region, rate: 1.0}",
        "clutter: {kind: region, rate: 1.0}\n    scans: {late: {max_delay: 1.0}}",
    )
    planners = "planners: {a: {kind: joint}, b: {kind: independent}, c: {kind: lookahead}, d: {kind: nearest}}"
    text = one_sensor(("kind: lmb", f"kind: {kind}"), late, ("control:", f"{planners}\ncontrol:"))
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text)
    wanted = f"as {kind} filters have no labels (delta_glmb, m_delta_glmb, lmb and factored_glmb do)"
    assert [fault.split(": ")[1] for fault in error.value.faults] == [
        "sensors[0].scans.late",
        "planners.a.kind",
        "planners.b.kind",
        "planners.c.kind",
    ]
    assert all(wanted in fault for fault in error.value.faults[1:])
    assert f"as {kind} filters cannot predict without a scan" in error.value.faults[0]


UNLABELLED = (
    "jdm, idm, lookahead or true_targets is refused: expected nearest, assigned_target, centroid, oracle or custom, "
    "as {} filters have"
)


@pytest.mark.parametrize(
    ("control", "filters", "warned"),
    [
        ("", "phd", UNLABELLED.format("phd")),
        ("", "cphd", UNLABELLED.format("cphd")),
        ("", "cb_member", UNLABELLED.format("cb_member")),
        ("", "lmb", ""),
        (
            ", association: full, reward: {kind: cauchy_schwarz}",
            "lmb",
            "lookahead is refused: expected joint or another, as with control.association full decisions are no sums",
        ),
        (", association: full", "lmb", ""),
        (
            ", reward: {kind: custom, function: 'own_parts.py:reward'}",
            "lmb",
            "lookahead is refused: expected a reward and a fusion of LMBs that are sums over labels",
        ),
    ],
)
def test_the_check_names_the_strategies_that_a_run_refuses(
    control: str, filters: str, warned: str, tmp_path: Path
) -> None:
    """One says so before the run, with what would do; all others can be had."""
    shutil.copy(Path(__file__).parent / "own_parts.py", tmp_path)
    file = tmp_path / "scenario.yaml"
    file.write_text(
        one_sensor(("kind: lmb", f"kind: {filters}"), ("{decision_steps: [2]", f"{{decision_steps: [2]{control}"))
    )
    result = CliRunner().invoke(app, ["check", str(file)])
    assert result.exit_code == 0
    found = [line for line in result.stderr.splitlines() if "warning: " in line]
    assert [f"{file}:17:10: warning: a run with --planner {warned}" in line for line in found] == [True] * bool(warned)
    scenario = load_scenario(file)
    for name in STRATEGIES:
        if name in warned.partition(" is refused")[0]:
            with pytest.raises(InputError, match=f"planner {name}: "):
                build_planner(scenario, name)
        else:
            build_planner(scenario, name)


@pytest.mark.parametrize("kind", ["clmb", "arithmetic_average", "cm_delta_glmb"])
def test_one_sensor_has_nothing_to_match_its_labels_with(kind: str) -> None:
    births = "{from_measurements: {expected: 0.5, max_existence: 0.03, std: [20.0, 20.0, 5.0, 5.0]}}"
    old = "{sites: [{existence: 0.05, mean: [0.0, 0.0, 0.0, 0.0], std: [30.0, 30.0, 5.0, 5.0]}]}"
    filters = "delta_glmb" if kind == "cm_delta_glmb" else "lmb"
    changes = ((old, births), ("fusion: {kind: none}", f"fusion: {{kind: {kind}}}"), ("kind: lmb", f"kind: {filters}"))
    record = run_scenario(Scenario(parse_scenario(one_sensor(*changes))), "stationary", seed=0)
    assert len(record.estimates) == 4


def turning(folder: Path, motion: str, more: str = "") -> Path:
    """A scenario of ships that were recorded, under a motion with other states than theirs."""
    (folder / "ships.csv").write_text("time,id,x,y\n" + "".join(f"{t},a,{10.0 + t},{20.0 * t}\n" for t in range(5)))
    shutil.copy(Path(__file__).parent / "own_models.py", folder)
    num = 3 if "custom" in motion else 5
    file = folder / "scenario.yaml"
    changes = (
        ("targets: {kind: scripted, tracks: [{state: [10.0, 10.0, 1.0, 0.0]}]}", TURNING_TARGETS),
        ("{kind: constant_velocity, sigma_v: 1.0}", motion),
        ("mean: [0.0, 0.0, 0.0, 0.0]", f"mean: {[0.0] * num}"),
        ("std: [30.0, 30.0, 5.0, 5.0]", f"std: {[30.0, 30.0, 5.0, 5.0, 0.1][:num]}"),
        ("control:", f"{more}\ncontrol:"),
    )
    file.write_text(one_sensor(*changes))
    return file


TURNING_TARGETS = "targets: {kind: recorded, path: ships.csv}"


def test_an_oracle_takes_turn_rates_that_were_not_recorded_as_zero(tmp_path: Path) -> None:
    file = turning(tmp_path, "{kind: coordinated_turn, sigma_v: 1.0}", "planners: {known: {kind: oracle, depth: 2}}")
    scenario = load_scenario(file)
    record = run_scenario(scenario, "known", seed=0)
    assert len(record.decisions) == 1
    told = build_planner(scenario, "oracle").with_truth(record.truth)  # type: ignore[union-attr]
    assert record.truth.states.shape[1] == 4
    np.testing.assert_array_equal(told.truth.states[:, :4], record.truth.states)
    np.testing.assert_array_equal(told.truth.states[:, 4], 0.0)


def test_an_oracle_needs_all_components_of_a_custom_motion(tmp_path: Path) -> None:
    motion = "{kind: custom, function: 'own_models.py:motion', components: [px, py, own_2]}"
    assert "planners.known.kind: expected another kind, as states have 3 components under motion and" in fault(
        turning(tmp_path, motion, "planners: {known: {kind: oracle}}")
    )
    scenario = load_scenario(turning(tmp_path, motion))
    with pytest.raises(InputError, match="planner oracle: expected another kind, as states have 3 components"):
        build_planner(scenario, "oracle")
