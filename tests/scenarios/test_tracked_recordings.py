"""Recordings are tracked by a loop of their own: what it computes, what it reads, and what its record says."""

from __future__ import annotations

import hashlib
import json
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from recordings import write_recording
from vedette.cli import app
from vedette.errors import InputError
from vedette.evaluation import run_scenario, track_recording
from vedette.evaluation.runs import build_score
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_tracking
from vedette.scenarios.code_checks import code_faults
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording
from vedette.simulation import load_run, save_run
from vedette.simulation.journal import RunInterrupted, RunStopped
from vedette.simulation.records import ScansFile

OPENED: list[str] | None = None


def _note_opening(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and OPENED is not None:
        OPENED.append(Path(str(arguments[0])).name)


sys.addaudithook(_note_opening)


@contextmanager
def openings() -> Iterator[Counter[str]]:
    """How often each file is opened meanwhile, by name."""
    global OPENED
    OPENED, found = [], Counter[str]()
    try:
        yield found
    finally:
        found.update(OPENED)
        OPENED = None


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_recording(tmp_path, seconds=60.0)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def made(folder: Path) -> RecordingScenario:
    return scenario_from_recording(folder / "radars.yaml", folder / "scans.csv", folder / "truth.csv")


def call(*words: str) -> Any:
    return CliRunner().invoke(app, words, env={"COLUMNS": "200"})


def test_the_loop_is_steps_of_the_tracker_and_estimates(made: RecordingScenario) -> None:
    parts, tracker = build_tracking(made.scenario), build_tracking(made.scenario).tracker
    record, state = track_recording(made.scenario, made.recording), tracker.initial()
    rngs = [np.random.default_rng(0)] * 2
    for step, time in enumerate(made.recording.times.tolist(), start=1):
        scans, poses = made.recording.scans[step - 1], made.recording.poses[step - 1]
        state, _ = tracker.step(state, scans, poses, time, rngs=rngs)
        expected, found = parts.estimate(state.fused, step), record.estimates[step - 1]
        for name in ("labels", "means", "covs", "existence"):
            assert getattr(found, name).tobytes() == getattr(expected, name).tobytes()
        np.testing.assert_array_equal(record.poses[step - 1], poses)
    assert record.planner == "recorded"
    assert not record.decisions
    assert not record.off.any()
    score = build_score(made.scenario)
    assert score is not None
    np.testing.assert_array_equal(record.ospa, score(parts.truth, record.estimates))


def test_a_scenario_of_a_recording_is_tracked_whatever_the_planner(made: RecordingScenario) -> None:
    one, other = run_scenario(made.scenario, "jdm", seed=0), track_recording(made.scenario)
    assert (one.planner, one.recording) == (other.planner, other.recording)
    assert one.ospa.tobytes() == other.ospa.tobytes()


@pytest.mark.parametrize("truth", [False, True])
def test_every_file_is_opened_once(folder: Path, truth: bool) -> None:
    told = ("--truth", "truth.csv") if truth else ()
    with openings() as found:
        result = call("track", "scans.csv", "--sensors", "radars.yaml", *told, "--out", "out")
    assert result.exit_code == 0, result.output
    assert (found["scans.csv"], found["truth.csv"]) == (1, int(truth))
    with openings() as found:
        assert call("run", "out/scenario.yaml").exit_code == 0
    assert found["scans.csv"] <= 1


def test_a_record_says_where_its_scans_come_from(folder: Path, made: RecordingScenario) -> None:
    record = track_recording(made.scenario, made.recording)
    assert record.recording == ScansFile("scans.csv", hashlib.sha256((folder / "scans.csv").read_bytes()).hexdigest())
    assert repr(record).startswith("RunRecord of scans from scans.csv: ")
    save_run(record, folder / "out")
    assert {path.stem for path in (folder / "out").glob("*.arrow")} == {
        "scans",
        "truth",
        "tracks",
        "sensors",
        "timings",
    }
    again = load_run(folder / "out")
    assert (again.recording, again.decisions, again.source) == (record.recording, (), "scans.csv")
    with pytest.raises(InputError, match=r"record\.decisions: expected none of a recording; got 1"):
        save_run(replace(record, decisions=(object(),)), folder / "other")  # type: ignore[arg-type]


def test_results_of_earlier_versions_are_read(folder: Path) -> None:
    """They name no file of scans, and have empty tables of decisions."""
    assert call("track", "scans.csv", "--sensors", "radars.yaml", "--out", "out").exit_code == 0
    now, record = call("results", "out"), load_run(folder / "out")
    old, text = replace(record, recording=None), Path("out/scenario.yaml").read_text()
    fit = json.loads((folder / "out/manifest.json").read_text())["fit"]
    save_run(old, folder / "out", overwrite=True, scenario_text=text, fit=fit)
    manifest = json.loads((folder / "out/manifest.json").read_text())
    assert "recording" not in manifest["run"]
    assert (folder / "out/decisions.arrow").exists()
    before = call("results", "out")
    assert (before.exit_code, before.stdout) == (0, now.stdout)
    save_run(old, folder / "out", overwrite=True, scenario_text=text)  # from before runs had a fit
    before = call("results", "out")
    assert before.exit_code == 0
    assert now.stdout.startswith(before.stdout)
    assert now.stdout[len(before.stdout) :].startswith("fit  ")
    assert call("report", "out").exit_code == 0


def test_a_simulated_run_without_its_tables_of_decisions_is_refused(folder: Path) -> None:
    save_run(run_scenario(load_scenario("linear-10"), "stationary", seed=0), folder / "run")
    manifest = json.loads((folder / "run/manifest.json").read_text())
    del manifest["files"]["decisions.arrow"]
    (folder / "run/manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"expected a file decisions\.arrow"):
        load_run(folder / "run")


class Stopping:
    """An estimator that stops at a step."""

    def __init__(self, error: BaseException, estimate: Any) -> None:
        self.error, self.estimate = error, estimate

    def __call__(self, density: Any, step: int) -> Any:
        if step == 4:
            raise self.error
        return self.estimate(density, step)


@pytest.mark.parametrize(
    ("error", "stop", "cause"),
    [(KeyError("lost"), RunStopped, "KeyError: 'lost'"), (KeyboardInterrupt(), RunInterrupted, "interrupted")],
)
def test_an_interrupted_run_reports_the_scan_and_keeps_earlier_ones(
    made: RecordingScenario, error: BaseException, stop: type[RunStopped | RunInterrupted], cause: str
) -> None:
    parts = build_tracking(made.scenario, made.recording)
    with pytest.raises(stop) as caught:
        replace(parts, estimate=Stopping(error, parts.estimate)).run(build_score(made.scenario))
    place = f"stopped at step 4 of {len(made.recording.times)} ({made.recording.times[3]:g} s), in the estimate: "
    assert str(caught.value).startswith(f"scans, scans.csv: {place}{cause}")
    record = caught.value.record  # type: ignore[attr-defined]
    assert (record.num_scans, record.stopped) == (3, str(caught.value))
    whole = parts.run(build_score(made.scenario))
    assert record.ospa.tobytes() == whole.ospa[:3].tobytes()


def test_every_scan_is_recorded(made: RecordingScenario) -> None:
    steps = list[int]()
    track_recording(made.scenario, made.recording, progress=steps.append)
    assert steps == [*range(1, len(made.recording.times) + 1)]


class Rows:
    """A scan that is no array, but becomes one."""

    def __init__(self, scan: Any) -> None:
        self.scan = scan

    def __len__(self) -> int:
        return len(self.scan)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.array(self.scan, dtype)


def test_scans_are_what_numpy_takes(made: RecordingScenario) -> None:
    scans: Any = tuple(tuple(None if scan is None else Rows(scan) for scan in own) for own in made.recording.scans)
    one, other = (
        track_recording(made.scenario, each) for each in (made.recording, replace(made.recording, scans=scans))
    )
    assert one.ospa.tobytes() == other.ospa.tobytes()


def test_inconsistent_arguments_are_refused(made: RecordingScenario) -> None:
    parts = build_tracking(made.scenario)
    one_sensor = replace(made.recording, poses=made.recording.poses[:, :1])
    with pytest.raises(InputError, match="tracker: expected the 1 sensors of the recording; got 2"):
        replace(parts, recording=one_sensor)
    with pytest.raises(InputError, match="truth: expected the times of the recording; got others"):
        replace(parts, truth=parts.truth.first(3))
    with pytest.raises(InputError, match=r"scans: expected simulated scans .*; got those of .*scans\.csv"):
        build_experiment(made.scenario)
    with pytest.raises(
        InputError, match="paper-a: expected a section `recording`; got a scenario whose scans are simu"
    ):
        track_recording(load_scenario("paper-a"))


def test_custom_code_is_tried_on_the_first_scans(made: RecordingScenario) -> None:
    assert code_faults(made.scenario) == []
    parts = build_tracking(made.scenario)
    assert [parts.first(num).run(None).num_scans for num in (1, 3)] == [1, 3]
    assert parts.first(len(made.recording.times)).recording.num_measurements == made.recording.num_measurements
