"""Code that scenarios name: a report of somebody else's results runs none of it, and a run says what it runs."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evaluation.synthetic import make_record
from fuzz.store_edits import sign_manifest
from vedette.campaigns.cells import Campaign, resolve
from vedette.campaigns.codec import encode
from vedette.campaigns.rows import row_of
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.cli import app
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.trust import custom_code, foreign_code_reason
from vedette.simulation.serialization import encode_timings

MODELS = """
from pathlib import Path
from vedette.models import constant_detection

def sees():
    (Path(__file__).parent / "mark").touch()
    return constant_detection(0.9)
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A scenario whose sensors see by code beside it, which leaves a file `mark` when it is called."""
    place = tmp_path / "own"
    place.mkdir()
    (place / "models.py").write_text(MODELS)
    path = place / "own.yaml"
    own = {"sensors.*.detection": {"kind": "custom", "function": "models.py:sees"}}
    path.write_text("")
    built_in = Scenario(load_scenario("paper-a").model, path)  # its paths are relative to the new file
    path.write_text(dump_scenario(replace_fields(built_in, own).model))
    return path


@pytest.fixture
def results(scenario: Path, tmp_path: Path) -> Path:
    campaign: Campaign = resolve(
        spec_from_data({"name": "own", "scenarios": [str(scenario)], "planners": ["jdm"], "runs": 1, "seed": 7})
    )
    with Store.open(tmp_path / "results", campaign) as store:
        record = replace(make_record("jdm"), scenario="paper-a")
        store.add(row_of("jdm", 0, encode(record), encode_timings(record)))
    scenario.with_name("mark").unlink()
    return tmp_path / "results"


def call(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def test_reading_results_runs_no_code_that_they_name(results: Path, scenario: Path, tmp_path: Path) -> None:
    mark = scenario.with_name("mark")
    call("results", results, "--export", tmp_path / "export", "--format", "csv", "--format", "parquet")
    said = call("report", results, "--figures", tmp_path / "figures")
    assert not mark.exists()
    assert "without measurements, as drawing them runs" in said
    assert "models.py:sees: --allow-code allows it" in said
    page = (results / "report.html").read_text()
    assert "measurements are left out" in page
    assert _scans(page) == []
    assert "without measurements" not in call("report", results, "--allow-code")
    assert mark.exists()
    assert len(_scans((results / "report.html").read_text())) == 40


def _scans(page: str) -> list[object]:
    start = page.index('id="runs">') + len('id="runs">')
    (run,) = json.loads(page[start : page.index("</script>", start)])
    scans: list[object] = run["scans"]
    return scans


def test_a_module_that_a_manifest_names_is_not_run(results: Path, scenario: Path, tmp_path: Path) -> None:
    manifest = json.loads((results / "manifest.json").read_text())
    (cell,) = manifest["cells"]
    mark = tmp_path / "made by the shell"
    text = cell["scenario"].replace(f'"{scenario.with_name("models.py")}:sees"', '"os:system"')
    cell["scenario"] = text.replace("arguments: {}", f"arguments: {{command: \"touch '{mark}'\"}}")
    assert "touch" in cell["scenario"]
    assert "os:system" in cell["scenario"]
    (results / "manifest.json").write_text(json.dumps(manifest))
    sign_manifest(results)
    assert "os:system: --allow-code allows it" in call("report", results)
    assert not mark.exists()


def test_a_run_lists_the_custom_code_it_runs(scenario: Path) -> None:
    assert custom_code(load_scenario(scenario).model) == ("models.py:sees",)
    assert "runs code of yours: models.py:sees" in call("show", scenario)
    assert "code of" not in call("show", "paper-a")


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owners there")
@pytest.mark.parametrize("what", ["own.yaml", "models.py", "."])
def test_code_that_others_may_have_written_needs_a_word(scenario: Path, what: str, tmp_path: Path) -> None:
    place = scenario.parent / what
    place.chmod(place.stat().st_mode | 0o002)
    spec = tmp_path / "spec.toml"
    spec.write_text(f'name = "own"\nscenarios = ["{scenario}"]\nruns = 1\n')
    for command in (("run", scenario), ("show", scenario), ("campaign", spec, "--dry-run"), ("reproduce", scenario)):
        result = CliRunner().invoke(app, [str(each) for each in command])
        assert result.exit_code == 1, result.output
        assert f"every user may write to {place.resolve()}: read it, and have it run by --allow-code" in result.output
    assert not scenario.with_name("mark").exists()
    assert "runs code of theirs, as trusted: models.py:sees" in call("campaign", spec, "--dry-run", "--allow-code")
    assert scenario.with_name("mark").exists()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owners there")
def test_code_of_another_user_is_not_ones_own(scenario: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = load_scenario(scenario)
    assert foreign_code_reason(loaded) == ""
    if os.getuid() == 0:  # what the system's administrator owns is trusted
        os.chown(scenario.with_name("models.py"), 12345, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: scenario.stat().st_uid + 1)
    assert "belongs to another user" in foreign_code_reason(loaded)
