"""Entrants beside the library's own: their campaigns, how lost runs count, tables, and the command."""

from __future__ import annotations

import csv
import io
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from vedette.campaigns import benchmark, leaderboard, run_campaign
from vedette.campaigns.benchmark import OWN, Scene, campaign_of, clear_stale_results, entrant, scenes
from vedette.campaigns.leaderboard import (
    benchmark_csv,
    benchmark_markdown,
    benchmark_provenance,
    header,
    row,
    scene_table,
)
from vedette.campaigns.manifest import read_manifest
from vedette.cli import app
from vedette.errors import InputError
from vedette.evaluation import Summary
from vedette.scenarios import load_scenario

FIRST = """
import json, sys
for line in sys.stdin:
    told = json.loads(line)
    answer = {"ready": True} if "role" in told else {"actions": [0] * len(told["sensors"]), "counts": {"rewards": 3}}
    print(json.dumps(answer), flush=True)
"""
STEERED = replace(scenes()["paper-a"], beside=("nearest", "constant"))
TRACKED = scenes()["polar-10"]


def run_all(scene: Scene, out: Path, *entrants: benchmark.Entrant, runs: int = 2) -> None:
    for own in (None, *entrants):
        folder = out / scene.name / (OWN if own is None else own.name)
        campaign = campaign_of(scene, own, runs, 0, out)
        clear_stale_results(campaign, folder)
        run_campaign(campaign, folder)


def planner(folder: Path, text: str, name: str = "mine") -> benchmark.Entrant:
    (folder / "mine.py").write_text(text)
    return entrant("planner", f"{name}={sys.executable} mine.py", seconds=20.0, folder=folder)


def test_every_scene_can_be_had(tmp_path: Path) -> None:
    assert {scene.role for scene in scenes().values() if scene.quick} == {"planner", "tracker"}
    for scene in scenes().values():
        text = scene.scenario(tmp_path)
        loaded = load_scenario(text)
        assert bool(loaded.model.decision_steps) == (scene.role == "planner"), scene.name
        assert scene.beside[-1] == "oracle"
    assert len(load_scenario(scenes()["hundred-sensors"].scenario(tmp_path)).model.sensors) == 100


def test_an_entrant_is_paired_with_the_first_and_its_counts_are_told(tmp_path: Path) -> None:
    own = planner(tmp_path, FIRST)
    run_all(STEERED, tmp_path / "out", own)
    table = scene_table(STEERED, tmp_path / "out")
    assert table is not None
    assert [each.label for each in table.standings] == ["nearest", "constant", "mine"]
    first, fixed, mine = table.standings
    assert (first.difference, first.is_own, mine.is_own, mine.num_runs, mine.num_lost) == (None, True, False, 2, 0)
    assert fixed.difference is not None
    assert float(fixed.difference.mean) == pytest.approx(float(fixed.ospa.mean - first.ospa.mean), abs=1e-12)
    assert mine.counts["rewards"] == 3.0
    assert np.isnan(mine.counts["fusions"])
    assert len(header(table)) == len(row(table, mine))
    facts = benchmark_provenance([table], 0)
    digest = read_manifest(tmp_path / "out" / STEERED.name / "mine")["digest"]
    assert facts["planner mine, paper-a"] == digest
    assert facts["scene paper-a"] == table.digest
    page = benchmark_markdown([table], facts)
    assert f"| mine | {float(mine.ospa.mean):.2f} |" in page
    assert digest in page
    rows = list(csv.DictReader(io.StringIO(benchmark_csv([table]))))
    assert [each["strategy"] for each in rows] == ["nearest", "constant", "mine"]
    assert float(rows[2]["ospa"]) == float(mine.ospa.mean)
    assert float(rows[2]["median"]) == pytest.approx(float(mine.ospa.mean))  # of two runs
    assert float(rows[2]["worst"]) == mine.tail.worst > mine.tail.median
    assert float(rows[2]["share_lost"]) in (0.0, 0.5, 1.0)
    assert "| Median run (m) | Worst run (m) | Runs that end with a lost target |" in page


def test_lost_runs_count_as_the_cutoff_and_say_why(tmp_path: Path) -> None:
    own = planner(tmp_path, FIRST.replace("[0] *", "[99] *"))
    run_all(STEERED, tmp_path / "out", own)
    table = scene_table(STEERED, tmp_path / "out")
    assert table is not None
    first, _, mine = table.standings
    assert (float(mine.ospa.mean), mine.num_lost, mine.num_runs, mine.nees) == (100.0, 2, 2, None)
    assert mine.tail == (100.0, 100.0, 1.0)
    assert mine.difference is not None
    assert float(mine.difference.mean) == pytest.approx(100.0 - float(first.ospa.mean))
    assert "expected actions[0] from 0 to" in mine.reason
    assert "expected actions[0] from 0 to" in benchmark_markdown([table], {})


def test_an_entrant_that_never_finished_a_run_may_change_and_one_that_did_may_not(tmp_path: Path) -> None:
    run_all(STEERED, tmp_path / "out", planner(tmp_path, "print('hello', flush=True)"), runs=1)
    run_all(STEERED, tmp_path / "out", planner(tmp_path, FIRST), runs=1)
    run_all(STEERED, tmp_path / "out", planner(tmp_path, FIRST), runs=2)
    table = scene_table(STEERED, tmp_path / "out")
    assert table is not None
    assert (table.standings[-1].num_runs, table.standings[-1].num_lost) == (2, 0)
    with pytest.raises(InputError, match="expected runs of mine as it is now; got those of another program"):
        run_all(STEERED, tmp_path / "out", planner(tmp_path, FIRST + "# better\n"), runs=2)


def test_trackers_stand_between_the_last_scan_and_the_oracle(tmp_path: Path) -> None:
    nobody = FIRST.replace('{"actions": [0] * len(told["sensors"]), "counts": {"rewards": 3}}', '{"estimates": []}')
    (tmp_path / "none.py").write_text(nobody)
    own = entrant("tracker", f"nobody={sys.executable} none.py", seconds=20.0, folder=tmp_path)
    run_all(TRACKED, tmp_path / "out", own)
    table = scene_table(TRACKED, tmp_path / "out")
    assert table is not None
    ospa = {each.label: float(each.ospa.mean) for each in table.standings}
    assert ospa["oracle"] < ospa["vedette"] < ospa["last scan"]
    nees = {each.label: each.nees for each in table.standings}
    assert nees["last scan"] is None
    assert nees["nobody"] is None
    assert nees["oracle"] is not None
    assert float(nees["oracle"].mean) == pytest.approx(1.0, abs=0.15)  # its errors are drawn from what it says


def test_functions_and_files_of_ones_own_are_entrants(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("class Mine: pass\n")
    found = entrant("tracker", "mine=own.py:Mine", seconds=1.0, folder=tmp_path)
    assert found.section == {"kind": "custom", "function": f"{tmp_path / 'own.py'}:Mine"}
    assert entrant("planner", "mine=a.b:C", seconds=1.0, folder=tmp_path).section["function"] == "a.b:C"
    program = entrant("planner", "mine=julia 'a b.jl' -x", seconds=2.0, folder=tmp_path).section
    assert program["command"] == ["julia", "a b.jl", "-x"]


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("python3 mine.py", "expected NAME=COMMAND or NAME=file.py:attribute; got 'python3 mine.py'"),
        ("=python3 mine.py", "expected NAME=COMMAND"),
        ("mine=", "expected NAME=COMMAND"),
        ("../mine=python3", "expected NAME=COMMAND"),
        ("jdm=python3", "expected another name than .*jdm.*; got 'jdm'"),
        ("vedette=python3", "expected another name than"),
        ("mine=absent.py:Mine", "planner mine: expected a file; got .*absent.py"),
    ],
)
def test_what_is_no_entrant_is_named(said: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        entrant("planner", said, seconds=1.0, folder=tmp_path)


def test_the_command_ends_with_tables_and_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(benchmark, "scenes", lambda: {"paper-a": STEERED, "polar-10": TRACKED})
    (tmp_path / "mine.py").write_text(FIRST)
    (tmp_path / "bad.py").write_text(
        "print(input() and '{\"ready\": true}', flush=True)\nraise SystemExit('not today')"
    )
    words = ["--planner", f"mine={sys.executable} mine.py", "--planner", f"bad={sys.executable} bad.py"]
    asked = ["benchmark", *words, "--runs", "2", "--workers", "1", "--timeout", "20"]
    for _ in range(2):  # again: what is there is not run again, what was lost is tried again
        result = CliRunner().invoke(app, asked, env={"COLUMNS": "160"})
        assert result.exit_code == 0, result.output
        (mine,) = [line.split() for line in result.stdout.splitlines() if line.startswith("mine ")]
        (bad,) = [line.split() for line in result.stdout.splitlines() if line.startswith("bad ")]
        assert (mine[-1], bad[1], bad[-2:]) == ("2", "100.00", ["2", "2"])
        assert "not today" in result.stdout
    page = (tmp_path / "benchmark" / "benchmark.html").read_text(encoding="utf-8")
    assert "Of what" in page
    assert "not today" in page
    assert "polar-10" not in page  # as trackers have not been entered
    assert (tmp_path / "benchmark" / "benchmark.csv").read_text().count("\n") == 1 + 4


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (f"{sys.executable} mime.py", "can't open file"),
        ("no-such-program-here", "planner mine: expected one that can be started"),
        ("mine.py:Plannr", 'expected a name that "mine.py" defines, got "Plannr"'),
    ],
)
def test_a_typo_is_no_lost_run(what: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(benchmark, "scenes", lambda: {"paper-a": STEERED})
    (tmp_path / "mine.py").write_text(FIRST)
    result = CliRunner().invoke(app, ["benchmark", "--planner", f"mine={what}", "--runs", "1", "--workers", "1"])
    assert result.exit_code != 0
    assert words in " ".join(result.output.split())
    assert not (tmp_path / "benchmark" / "paper-a").exists()


def test_of_few_runs_no_interval_is_shown() -> None:
    numbers = (np.array(3.0), np.array(1.0), np.array(2.0), np.array(4.0))
    assert leaderboard._interval(Summary(*numbers, 2), "+.2f") == ""
    assert leaderboard._interval(Summary(*numbers, 5), "+.2f") == "+2.00 to +4.00"


def test_an_entrant_without_a_scene_is_refused(tmp_path: Path) -> None:
    given = ["benchmark", "--planner", "mine=random:choice", "--scenes", "polar-10", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 2
    assert "expected a scene of planners for mine, see --list; got polar-10" in " ".join(result.stderr.split())
    assert not (tmp_path / "out").exists()


def test_a_scene_that_is_none_is_named() -> None:
    result = CliRunner().invoke(app, ["benchmark", "--scenes", "paper-a,bay"])
    assert result.exit_code == 2
    assert "expected some of paper-a" in result.stderr
