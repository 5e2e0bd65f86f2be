"""Results of earlier formats can be read after an upgrade, whenever it was killed before; nothing of them is lost."""

from __future__ import annotations

import json
import math
import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from vedette.campaigns import open_results
from vedette.campaigns.database import DATABASE
from vedette.campaigns.journal import Writer
from vedette.campaigns.upgrading import upgrade_results
from vedette.cli import app
from vedette.errors import InputError
from vedette.evaluation.diagnostics import diagnostics_line, run_diagnostics
from vedette.scenarios import load_scenario
from vedette.simulation.arrow import Layout, read_table
from vedette.simulation.serialization import FORMER_COLUMNS
from vedette.simulation.storage import load_run
from vedette.simulation.tables import LAYOUTS

FORMATS = (5, 6)
COLUMN = "independence_error_bound"
TABLE = "sensors.arrow"


def fixture(number: int, kind: str, folder: Path) -> Path:
    """A copy of a folder that was written in that format."""
    target = folder / kind
    shutil.copytree(Path(__file__).with_name(f"format-{number}") / kind, target)
    return target


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return fixture(5, "campaign", tmp_path)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return fixture(5, "run", tmp_path)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def dumped(folder: Path) -> list[Any]:
    with sqlite3.connect(folder / DATABASE) as database:
        return database.execute("SELECT * FROM runs ORDER BY cell, run").fetchall()


def sensors_before(folder: Path) -> dict[str, Any]:
    """The sensors' table of a saved run of format 5."""
    layout, former = LAYOUTS["sensors"], FORMER_COLUMNS["sensors"]
    had = Layout({former.get(name, name): kind for name, kind in layout.fixed.items() if name != COLUMN}, layout.more)
    return dict(read_table((folder / TABLE).read_bytes(), had, TABLE))


@pytest.mark.parametrize("number", FORMATS)
def test_every_format_is_read_after_an_upgrade(number: int, tmp_path: Path) -> None:
    folder = fixture(number, "campaign", tmp_path)
    with pytest.raises(InputError, match=rf"expected format 7; got {number}, .*`vedette upgrade \S+campaign` brings"):
        open_results(folder)
    assert upgrade_results(folder) == number
    results = open_results(folder)
    assert [results.finished(cell.name) for cell in results.campaign.cells] == [(0,), (0,)]
    for finished in results.runs():
        assert finished.record.num_scans == finished.metrics.num_scans == 5
        assert set(finished.record.timings) >= {"filter", "planning"}
    saved = fixture(number, "run", tmp_path)
    with pytest.raises(InputError, match="vedette upgrade"):
        load_run(saved)
    assert upgrade_results(saved) == number
    assert load_run(saved).planner == {5: "random", 6: "jdm"}[number]


def test_nothing_is_lost_and_what_was_not_known_is_not(campaign: Path, run: Path) -> None:
    before, others = sensors_before(run), contents(run)
    (run / "figures").mkdir()
    (run / "figures" / "mine.txt").write_text("kept")
    upgrade_results(run)
    record = load_run(run)
    assert np.isnan(record.health.independence_error_bound).all()
    assert "independence error: not known" in diagnostics_line(run_diagnostics(record.health))
    for name, former in (("truncation_error_bound", "discarded_weight_bound"), ("num_tracks", "num_tracks")):
        np.testing.assert_array_equal(getattr(record.health, name).ravel(), before[former])
    after = contents(run)
    assert after.pop("figures/mine.txt") == b"kept"
    assert {name for name, content in after.items() if others[name] != content} == {
        TABLE,
        "scenario.yaml",
        "manifest.json",
    }
    # The campaign's run of the same seed and strategy is the same, but for the clock.
    upgrade_results(campaign)
    twin = open_results(campaign).record("random", 0)
    np.testing.assert_array_equal(twin.ospa, record.ospa)
    np.testing.assert_array_equal(twin.health.num_hypotheses, record.health.num_hypotheses)


def test_former_names_are_replaced_everywhere(tmp_path: Path) -> None:
    """In the specification, the scenarios, the settings, the tables and the names of strategies."""
    folder, saved = fixture(6, "campaign", tmp_path), fixture(6, "run", tmp_path)
    before = json.loads((folder / "manifest.json").read_text())
    for each in (folder, saved):
        upgrade_results(each)
    results, record = open_results(folder), load_run(saved)
    fixed = results.campaign.cell("fixed")
    assert (fixed.planner, results.record("fixed", 0).planner) == ("constant", "constant")
    assert results.campaign.axes["sensors.*.stationary_until_first_decision"] == (True,)
    assert results.campaign.spec["set"]["ospa.last_scan"] == 5
    assert fixed.scenario.model.sensors[0].platform.kind == "heading"
    assert load_scenario(saved / "scenario.yaml").model == results.campaign.cells[0].scenario.model
    texts = [cell["scenario"] for cell in results.manifest["cells"]]
    assert results.manifest["digest"] == results.campaign.digest(texts) != before["digest"]
    why, twin = (each.decisions[0].plan.explanation for each in (record, results.record("jdm", 0)))
    assert why is not None
    assert twin is not None
    np.testing.assert_array_equal(why.reward_without_sensor, twin.reward_without_sensor)
    assert not np.isnan(record.health.independence_error_bound).any()


def test_a_second_time_changes_nothing(campaign: Path, run: Path) -> None:
    for folder in (campaign, run):
        upgrade_results(folder)
        before = contents(folder)
        assert upgrade_results(folder) == 7
        assert contents(folder) == before


def test_a_campaign_that_is_killed_at_any_time_is_ended_by_the_same_command(campaign: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    shutil.copytree(campaign, whole)
    upgrade_results(whole)
    rows = dumped(campaign)
    script = (
        "import os, sys\n"
        "from vedette.campaigns import codec, upgrading\n"
        "calls, encode, write = [], codec.encode, upgrading.write_manifest\n"
        "def killed(run):\n"
        "    calls.append(run)\n"
        "    return os._exit(9) if len(calls) > int(sys.argv[2]) else encode(run)\n"
        "codec.encode, upgrading.write_manifest = killed, lambda *given: os._exit(9)\n"
        "upgrading.upgrade_results(sys.argv[1])\n"
    )
    for survived in (0, 1, 2):
        folder = tmp_path / str(survived)
        shutil.copytree(campaign, folder)
        ended = subprocess.run([sys.executable, "-c", script, str(folder), str(survived)], check=False)
        assert ended.returncode == 9
        if survived < 2:  # half a transaction is none
            assert dumped(folder) == rows
        with pytest.raises(InputError, match="vedette upgrade"):
            open_results(folder)
        assert upgrade_results(folder) == 5
        assert dumped(folder) == dumped(whole)
        assert json.loads((folder / "manifest.json").read_text()) == json.loads((whole / "manifest.json").read_text())


class Killed(BaseException):
    pass


def test_a_run_that_is_killed_at_any_time_is_ended_by_the_same_command(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = tmp_path / "whole"
    shutil.copytree(run, whole)
    upgrade_results(whole)
    replace, num_killed = os.replace, 0
    for survived in range(100):
        folder, calls = tmp_path / str(survived), [0]
        shutil.copytree(run, folder)

        def counted(source: Any, target: Any, calls: list[int] = calls, most: int = survived) -> None:
            if calls[0] == most:
                raise Killed
            calls[0] += 1
            replace(source, target)

        with monkeypatch.context() as patched:
            patched.setattr(os, "replace", counted)
            try:
                upgrade_results(folder)
            except Killed:
                num_killed += 1
            else:
                break
        assert upgrade_results(folder) == 5
        assert contents(folder) == contents(whole)
    assert num_killed >= 4


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (8, "expected format 7; got 8, written by a later version"),
        (4, "expected format 7; got 4, written by an earlier version of this program: run it again, or read it with"),
        (True, "expected format 7; got True, written by another version"),
        ("5", "written by another version"),
        (None, "got None"),
        ([5], "written by another version"),
    ],
)
@pytest.mark.parametrize("kind", ["campaign", "run"])
def test_other_formats_are_refused(kind: str, number: Any, message: str, tmp_path: Path) -> None:
    folder = fixture(5, kind, tmp_path)
    path = folder / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "format_version": number}))
    before = contents(folder)
    with pytest.raises(InputError, match=message):
        upgrade_results(folder)
    assert contents(folder) == before


def test_what_is_no_results_folder_is_named(campaign: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a results folder; got nothing"):
        upgrade_results(tmp_path / "nowhere")
    with pytest.raises(InputError, match="expected a results folder; got a file"):
        upgrade_results(campaign / "manifest.json")
    (tmp_path / "photos").mkdir()
    with pytest.raises(InputError, match=r"manifest\.json: no such file; expected the manifest of a results folder"):
        upgrade_results(tmp_path / "photos")


def test_a_campaign_that_is_worked_on_is_left_alone(campaign: Path) -> None:
    before = dumped(campaign)
    writer = Writer(campaign)
    try:
        with pytest.raises(InputError, match="another process is writing this campaign"):
            upgrade_results(campaign)
    finally:
        writer.close()
    assert dumped(campaign) == before


def test_a_damaged_run_stops_it_before_anything_is_changed(campaign: Path, run: Path) -> None:
    with sqlite3.connect(campaign / DATABASE) as database:
        database.execute("UPDATE runs SET payload = x'00' WHERE cell = 'random'")
    (run / TABLE).write_bytes((run / TABLE).read_bytes()[:-1])
    before = dumped(campaign), contents(run)
    with pytest.raises(InputError, match="cell random, run 0: expected the run as it was written"):
        upgrade_results(campaign)
    with pytest.raises(InputError, match=r"sensors\.arrow: expected the file as it was written"):
        upgrade_results(run)
    assert (dumped(campaign), contents(run)) == before


def test_the_command_says_what_it_did(campaign: Path) -> None:
    runner = CliRunner()
    (campaign / "tables").mkdir()
    done = runner.invoke(app, ["upgrade", str(campaign)])
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0] == f"{campaign}: format 5 is now 7"
    assert f"vedette results {campaign} --export" in done.stdout
    again = runner.invoke(app, ["upgrade", str(campaign)])
    assert again.stdout == f"{campaign}: format 7, which this version reads; nothing was changed\n"
    refused = runner.invoke(app, ["upgrade", str(campaign / "nowhere")])
    assert (refused.exit_code, refused.stdout) == (1, "")
    assert runner.invoke(app, ["results", str(campaign)]).exit_code == 0
    assert math.isnan(open_results(campaign).record("jdm", 0).health.independence_error_bound[0, 0])
