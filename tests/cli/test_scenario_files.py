"""The commands about scenario files, as a person would give them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from recordings import SENSORS
from scenarios.minimal import MINIMAL
from vedette import __version__
from vedette.cli import app
from vedette.scenarios import json_schema, list_builtin, load_scenario
from vedette.scenarios.sections.fusion import Fusion


def vedette(*words: str) -> Result:
    return CliRunner().invoke(app, list(words), env={"COLUMNS": "80"})


def test_version() -> None:
    result = vedette("--version")
    assert (result.exit_code, result.stdout) == (0, f"vedette {__version__}\n")


def test_help_names_every_command() -> None:
    result = vedette("--help")
    assert result.exit_code == 0
    for command in ("list", "init", "generate", "crowd", "check", "show", "schema"):
        assert f"  {command} " in result.stdout
    groups = [line for line in result.stdout.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert groups == ["Options:", "Start here:", "Your data:", "Scenarios:", "Runs and campaigns:"]
    assert "..." not in result.stdout.split("Start here:")[1]


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from vedette.cli import app\n"
        "try: app(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'numba', 'scipy', 'pydantic', 'matplotlib', 'ruamel.yaml'} & set(sys.modules)\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("words", [["check", "paper-a"], ["list"], ["schema"]])
def test_commands_that_read_scenarios_import_no_compiler_and_no_filters(words: list[str]) -> None:
    code = (
        "import sys; from vedette.cli import app\n"
        f"try: app({words})\n"
        "except SystemExit: pass\n"
        "sys.exit(', '.join({'numba', 'matplotlib', 'vedette.filters', 'vedette.recorded'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_list_names_every_scenario() -> None:
    result = vedette("list")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines() if not line.startswith(" ")] == list(list_builtin())


@pytest.mark.parametrize("name", list_builtin())
def test_init_writes_a_commented_file_that_passes_check(name: str, tmp_path: Path) -> None:
    file = tmp_path / "new" / "mine.yaml"
    result = vedette("init", str(file), "--from", name)
    assert (result.exit_code, result.stderr) == (0, "")
    text = file.read_text(encoding="utf-8")
    assert text.startswith("# yaml-language-server: $schema=vedette.schema.json\n")
    assert text.count("#") > 8
    assert json.loads((file.parent / "vedette.schema.json").read_text(encoding="utf-8")) == json_schema()
    checked = vedette("check", str(file))
    assert checked.exit_code == 0
    assert checked.stdout.startswith(f"{file}: valid (")
    assert checked.stdout.count("\n") == 1


def test_generate_writes_a_commented_file_that_passes_check(tmp_path: Path) -> None:
    words = ("generate", str(tmp_path / "scenes"), "--sensors", "3", "--pattern", "crowd", "--seed", "2")
    result = vedette(*words)
    assert (result.exit_code, result.stderr) == (0, "")
    file = tmp_path / "scenes" / "crowd-limited-3-seed-2.yaml"
    assert (file.parent / "vedette.schema.json").exists()
    text = file.read_text(encoding="utf-8")
    assert text.startswith("# yaml-language-server: $schema=vedette.schema.json\n# Targets that start apart and meet")
    checked = vedette("check", str(file))
    assert (checked.exit_code, checked.stderr) == (0, "")
    assert checked.stdout.startswith(f"{file}: valid (")
    again = vedette(*words)
    assert (again.exit_code, again.stderr) == (1, f"{file}: already there; --overwrite replaces it\n")
    assert vedette(*words, "--force").exit_code == 0
    assert file.read_text(encoding="utf-8") == text


def test_generate_names_the_file_after_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert vedette("generate", "--sensors", "2", "--field-of-view", "full").exit_code == 0
    assert vedette("generate", "own.yml", "--targets", "3").exit_code == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["own.yml", "spread-full-2.yaml", "vedette.schema.json"]


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (("--pattern", "swarm"), 2, "expected one of 'spread', 'crowd'; got 'swarm'"),
        (("--field-of-view", "none"), 2, "expected one of 'limited', 'full'; got 'none'"),
        (("--sensors", "0"), 2, "Invalid value for '--sensors'"),
    ],
)
def test_generate_rejects_invalid_options(words: tuple[str, ...], status: int, message: str, tmp_path: Path) -> None:
    result = vedette("generate", str(tmp_path / "new"), *words)
    assert result.exit_code == status
    assert message in " ".join(result.stderr.split())
    assert list(tmp_path.iterdir()) == []


def test_crowd_writes_a_commented_file_that_passes_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = vedette("crowd", "--targets", "10000", "--density", "4")
    assert (result.exit_code, result.stderr) == (0, "")
    assert vedette("crowd", "scenes", "--measurement", "bearing_range", "--clutter", "1", "--steps", "5").exit_code == 0
    files = [Path("crowd-10000-density-4.yaml"), Path("scenes/crowd-100-clutter-1-bearing-range-steps-5.yaml")]
    assert (
        files[0].read_text(encoding="utf-8").startswith("# yaml-language-server: $schema=vedette.schema.json\n# A cro")
    )
    checked = vedette("check", *map(str, files))
    assert (checked.exit_code, checked.stderr) == (0, "")
    assert checked.stdout.startswith(f"{files[0]}: valid (")
    assert vedette("crowd", "--targets", "10000", "--density", "4").exit_code == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--measurement", "range"), "expected one of 'position', 'bearing_range'; got 'range'"),
        (("--targets", "0"), "Invalid value for '--targets'"),
        (("--density", "0"), "Invalid value for '--density'"),
    ],
)
def test_crowd_rejects_invalid_options(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    result = vedette("crowd", str(tmp_path / "new"), *words)
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.split())
    assert list(tmp_path.iterdir()) == []


def test_init_starts_from_a_scene_with_lossless_fusion(tmp_path: Path) -> None:
    assert vedette("init", str(tmp_path)).exit_code == 0
    model = load_scenario(tmp_path / "scenario.yaml").model
    assert model == load_scenario("shore-radar").model
    assert isinstance(model.fusion, Fusion)
    assert (len(model.sensors), model.fusion.kind) == (3, "sequential")


def test_init_refuses_a_file_of_another_kind(tmp_path: Path) -> None:
    result = vedette("init", str(tmp_path / "bay.txt"))
    assert result.exit_code == 2
    assert "expected a file that ends in .yaml or .yml, or a folder" in " ".join(result.output.split())
    assert not list(tmp_path.iterdir())
    (tmp_path / "bay.2026").mkdir()
    assert vedette("init", str(tmp_path / "bay.2026")).exit_code == 0


def test_init_brings_recorded_data_and_its_licence_along(tmp_path: Path) -> None:
    assert vedette("init", str(tmp_path), "--from", "solent").exit_code == 0
    scenario = load_scenario(tmp_path / "scenario.yaml")
    assert scenario.model.targets.model_dump()["path"] == "solent.csv"
    assert "MIT License" in (tmp_path / "solent.csv.README.md").read_text(encoding="utf-8")


def test_init_brings_every_file_along_that_a_scenario_names(tmp_path: Path) -> None:
    assert vedette("init", str(tmp_path), "--from", "solent-patrol").exit_code == 0
    model = load_scenario(tmp_path / "scenario.yaml").model
    assert model.control == load_scenario("solent-patrol").model.control
    names = ["scenario.yaml", "solent-land.geojson", "solent.csv", "solent.csv.README.md", "vedette.schema.json"]
    assert sorted(file.name for file in tmp_path.iterdir()) == names


@pytest.mark.parametrize("taken", ["scenario.yaml", "solent.csv"])
def test_init_never_overwrites_without_force(taken: str, tmp_path: Path) -> None:
    (tmp_path / taken).write_text("mine", encoding="utf-8")
    result = vedette("init", str(tmp_path), "--from", "solent")
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == f"{tmp_path / taken}: already there; --overwrite replaces it\n"
    assert (tmp_path / taken).read_text(encoding="utf-8") == "mine"
    assert [file.name for file in tmp_path.iterdir()] == [taken]
    assert vedette("init", str(tmp_path), "--from", "solent", "--force").exit_code == 0
    assert load_scenario(tmp_path / "scenario.yaml").name == "solent"


def test_init_from_an_unknown_scenario_is_a_usage_error(tmp_path: Path) -> None:
    result = vedette("init", str(tmp_path / "a.yaml"), "--from", "paper-z")
    assert result.exit_code == 2
    assert f"expected one of {', '.join(list_builtin())}; got paper-z" in result.stderr.replace("\n", " ")


def test_check_reports_all_errors_of_all_files(tmp_path: Path) -> None:
    good, bad, absent = (tmp_path / name for name in ("good.yaml", "bad.yaml", "absent.yaml"))
    good.write_text(MINIMAL.replace("steps: [1, 5]", "steps: [1]"), encoding="utf-8")
    broken = MINIMAL.replace("num_steps: 20", "num_steps: x").replace("cutoff: 50.0", "cutof: 50.0")
    bad.write_text(broken, encoding="utf-8")
    result = vedette("check", str(bad), str(good), str(absent))
    assert (result.exit_code, result.stderr) == (1, "")
    first, second, third, fourth = result.stdout.splitlines()
    assert first == f'{bad}:2:19: time.num_steps: expected a whole number, got "x"'
    assert second.startswith(f"{bad}:23:8: ospa.cutof: expected one of")
    assert third == (
        f"{good}: valid (20 scans, 1 target, 2 sensors; filter m_delta_glmb, fusion cm_delta_glmb, 2 decisions)"
    )
    assert fourth.startswith(f"{absent}: no such file; expected a YAML file or one of ")


def test_check_accepts_sensors_files(tmp_path: Path) -> None:
    file = tmp_path / "radars.yaml"
    file.write_text(SENSORS, encoding="utf-8")
    result = vedette("check", str(file))
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [
        f"{file}: valid sensors file: 2 sensors (Calshot, boat), bearing and range",
        "  not given, will be assumed: region, motion, survival, birth, clutter",
        f"  use it with: vedette track SCANS --sensors {file}",
    ]
    checked = json.loads(vedette("check", str(file), "--json").stdout)["files"][0]
    assert (checked["kind"], checked["valid"], checked["not_given"][-1]) == ("sensors", True, "clutter")
    file.write_text(SENSORS.replace("bearings: north", "bearings: up").replace("eta_range: 0.0", "eta_range: x"))
    result = vedette("check", str(file))
    assert result.exit_code == 1
    assert result.stdout.splitlines() == [
        f'{file}:2:67: recording.bearings: expected one of east, north, got "up"',
        f'{file}:5:64: sensor_defaults.noise.eta_range: expected a number, got "x"',
    ]


@pytest.mark.parametrize(
    ("targets", "faults"),
    [
        ("{columns: {time: utc}}", []),
        ("{columns: {tme: utc}}", ["targets.columns.tme: expected one of "]),
        ("3", ["targets: expected a mapping, got 3"]),
    ],
)
def test_check_knows_sensors_files_with_columns_of_targets(tmp_path: Path, targets: str, faults: list[str]) -> None:
    file = tmp_path / "radars.yaml"
    file.write_text(f"{SENSORS}\ntargets: {targets}\n", encoding="utf-8")
    result = vedette("check", str(file))
    assert result.exit_code == (1 if faults else 0)
    lines = result.stdout.splitlines() if faults else []
    assert len(lines) == len(faults)
    assert all(fault in line for fault, line in zip(faults, lines, strict=True))


def test_check_without_files_is_wrong_use() -> None:
    assert vedette("check").exit_code == 2


def test_an_unknown_command_is_wrong_use() -> None:
    assert vedette("chekc").exit_code == 2


def test_schema_goes_to_the_screen_or_to_a_file(tmp_path: Path) -> None:
    shown = vedette("schema")
    assert json.loads(shown.stdout) == json_schema()
    assert vedette("schema", "--out", str(tmp_path / "deep" / "s.json")).exit_code == 0
    assert (tmp_path / "deep" / "s.json").read_text(encoding="utf-8") == shown.stdout


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    result = vedette("schema", "--out", str(tmp_path / "file" / "s.json"))
    assert result.exit_code == 1
    assert result.stderr.startswith(f"{tmp_path / 'file' / 's.json'}: expected a file that can be written; ")
