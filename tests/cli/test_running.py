"""The commands that simulate."""

from __future__ import annotations

import shutil

import pytest
from typer.testing import CliRunner

from empty_figures import print_nothing
from short_runs import short_paper_e
from vedette.campaigns import open_results
from vedette.cli import app, running
from vedette.errors import NumericalError
from vedette.filters import DeltaGlmbFilter
from vedette.simulation.storage import load_run, read_manifest


@pytest.fixture
def scenario_file(tmp_path):
    path = tmp_path / "short.yaml"
    path.write_text(short_paper_e(), encoding="utf-8")
    return path


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_run_prints_and_saves(scenario_file, tmp_path):
    out = tmp_path / "results"
    result = call("run", scenario_file, "--planner", "jdm", "--seed", 4, "--out", out)
    assert result.exit_code == 0, result.output
    assert "mean OSPA" in result.output
    assert load_run(out).seed == 4
    assert (out / "figures" / "tracks.pdf").exists()
    assert (out / "figures" / "rewards-8s.png").exists()
    again = call("run", scenario_file, "--planner", "idm", "--out", out)
    assert again.exit_code == 1
    assert "exists" in again.output
    assert load_run(out).planner == "jdm"
    replaced = call("run", scenario_file, "--planner", "idm", "--out", out, "--overwrite")
    assert replaced.exit_code == 0, replaced.output
    assert load_run(out).planner == "idm"


def fail_at(monkeypatch, step, error):
    whole = DeltaGlmbFilter.step

    def failing(self, belief, scan, pose, dt, number, *, rng):
        if number == step:
            raise error
        return whole(self, belief, scan, pose, dt, number, rng=rng)

    monkeypatch.setattr(DeltaGlmbFilter, "step", failing)


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [(NumericalError("no weight"), 1, "no weight"), (KeyboardInterrupt(), 130, "interrupted")],
)
@pytest.mark.usefixtures("quick_figures")
def test_an_interrupted_run_keeps_its_scans(scenario_file, tmp_path, monkeypatch, error, status, said):
    out = tmp_path / "results"
    fail_at(monkeypatch, 9, error)
    result = call("run", scenario_file, "--planner", "idm", "--out", out)
    assert result.exit_code == status, result.output
    place = "paper-e, idm, seed 0, run 0: stopped at step 9 of 10 (9 s), in the filter of sensor 1"
    assert result.stderr == f"{place}: {said}\nwrote {out}, with the 8 scans before\n"
    record = load_run(out)
    assert (record.num_scans, len(record.decisions)) == (8, 1)
    assert read_manifest(out)["run"]["stopped"] == record.stopped == f"{place}: {said}"
    assert (out / "figures" / "tracks.pdf").exists()
    assert (out / "figures" / "rewards-8s.pdf").exists()
    again = call("run", scenario_file, "--planner", "idm", "--out", out, "--overwrite")
    assert again.exit_code == status
    monkeypatch.undo()
    assert call("run", scenario_file, "--planner", "idm", "--out", out, "--overwrite").exit_code == 0
    assert load_run(out).stopped is None
    fail_at(monkeypatch, 9, error)
    kept = call("run", scenario_file, "--planner", "idm", "--out", out, "--overwrite")
    assert kept.exit_code == status
    assert "keeps the whole run that was there" in kept.stderr
    assert load_run(out).num_scans == 10


@pytest.mark.usefixtures("quick_figures")
def test_ctrl_c_during_figures_reports_that_the_run_is_saved(scenario_file, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("vedette.evaluation.figures.tracks_figure", interrupted)
    result = call("run", scenario_file, "--planner", "stationary", "--out", tmp_path / "results")
    assert result.exit_code == 130
    assert f"interrupted: wrote {tmp_path / 'results'}, but not all of its figures" in result.stderr
    assert load_run(tmp_path / "results").num_scans == 10
    monkeypatch.undo()
    again = call("run", scenario_file, "--planner", "random", "--out", tmp_path / "results")
    assert again.exit_code == 0, again.output  # the folder was unfinished
    assert load_run(tmp_path / "results").planner == "random"
    assert call("run", scenario_file, "--planner", "idm", "--out", tmp_path / "results").exit_code == 1


@pytest.mark.usefixtures("quick_figures")
def test_a_run_that_another_process_wrote_meanwhile_is_kept(scenario_file, tmp_path, monkeypatch):
    out, simulate = tmp_path / "results", running._simulate

    def slow(*arguments):
        monkeypatch.setattr(running, "_simulate", simulate)
        other = call("run", scenario_file, "--planner", "random", "--out", out, "--overwrite")
        assert other.exit_code == 0, other.output
        return simulate(*arguments)

    for words in ([], ["--overwrite"]):
        monkeypatch.setattr(running, "_simulate", slow)
        result = call("run", scenario_file, "--planner", "stationary", "--out", out, *words)
        assert result.exit_code == 0, result.output
        assert f"{out} has changed since this command started; it is kept" in result.stderr
        assert load_run(out).planner == "random"
        number = len(words) + 2
        assert load_run(tmp_path / f"results-{number}").planner == "stationary"
        if not words:
            shutil.rmtree(out)


def test_a_run_that_stops_at_once_writes_nothing(scenario_file, tmp_path, monkeypatch):
    fail_at(monkeypatch, 1, NumericalError("no weight"))
    result = call("run", scenario_file, "--planner", "stationary", "--out", tmp_path / "results")
    assert result.exit_code == 1
    assert result.stderr.endswith("no weight\nnothing was written\n")
    assert not (tmp_path / "results").exists()


def test_a_run_ends_with_its_health(scenario_file):
    result = call("run", scenario_file, "--planner", "stationary")
    assert result.stdout.splitlines()[-1] == "diagnostics no limit reached, nothing truncated"


def test_run_without_a_folder_writes_nothing(scenario_file, tmp_path):
    assert call("run", scenario_file, "--planner", "random").exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["short.yaml"]


def test_reproduce(scenario_file, tmp_path, monkeypatch):
    out = tmp_path / "all"
    result = call("reproduce", scenario_file, "--runs", 2, "--planners", "idm,stationary", "--workers", 1, "--out", out)
    assert result.exit_code == 0, result.output
    assert "idm independent decisions, CS divergence, other sensors absent" in " ".join(result.output.split())
    results = open_results(out)
    assert [results.finished(cell) for cell in ("idm", "stationary")] == [(0, 1), (0, 1)]
    for name in ("report.html", "summary.md", "summary.csv", "figures/ospa.pdf", "tables/scans.parquet"):
        assert (out / name).stat().st_size > 100
    print_nothing(monkeypatch)  # the figures have just been drawn
    again = call("reproduce", scenario_file, "--runs", 2, "--planners", "idm,stationary", "--workers", 1, "--out", out)
    assert again.exit_code == 0, again.output
    other = call("reproduce", scenario_file, "--runs", 2, "--planners", "stationary", "--workers", 1, "--out", out)
    assert other.exit_code == 1
    assert "expected a folder of this campaign" in other.output


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (("run", "paper-z"), 1, "paper-z"),
        (
            ("run", "paper-a", "--planner", "clever"),
            2,
            "jdm, idm, lookahead, nearest, assigned_target, centroid, oracle, true_targets, random, constant, "
            "stationary",
        ),
        (("reproduce", "--planners", "jdm,jdm"), 2, "each strategy once"),
        (("reproduce", "--runs", "0"), 2, "--runs"),
        (("run", "paper-a", "--seed", "-1"), 2, "--seed"),
    ],
)
def test_mistakes(arguments, status, message):
    result = call(*arguments)
    assert result.exit_code == status
    assert message in result.output
    assert "Traceback" not in result.output


def test_a_folder_of_someone_elses_is_kept(scenario_file, tmp_path):
    precious = tmp_path / "thesis"
    precious.mkdir()
    (precious / "a.tex").write_text("x")
    for arguments in (("run", scenario_file), ("reproduce", scenario_file, "--runs", 1)):
        result = call(*arguments, "--out", precious)
        assert result.exit_code == 1
        assert "holds something else" in result.output or "exists" in result.output
    assert [path.name for path in precious.iterdir()] == ["a.tex"]
