"""What every command shares: --json, --quiet, completion, whole names, and words for what is missing or in the way."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner, Result

from recordings import write_recording
from vedette.campaigns.published import published_comparisons
from vedette.cli import app, completing
from vedette.scenarios import list_builtin, load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.overrides import replace_fields

COMMANDS: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
SPEC = 'name = "trial"\nscenarios = ["short.yaml"]\nplanners = ["stationary", "own"]\nruns = 2\n'
WAIT = 600.0  # s


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a scenario of few scans and a strategy of its own, one with a fault, and a campaign."""
    fields: dict[str, Any] = {"time.num_steps": 3, "ospa.first_scan": None, "ospa.last_scan": None}
    fields |= {"birth.steps": [1], "targets.tracks": [{"state": [x, 0.0, 1.0, 1.0]} for x in (0.0, 40.0)]}
    fields |= {"planners": {"own": {"kind": "independent"}}}
    text = dump_scenario(replace_fields(load_scenario("linear-10"), fields).model)
    (tmp_path / "short.yaml").write_text(text, "utf-8")
    (tmp_path / "faulty.yaml").write_text(text.replace("num_steps: 3", "num_steps: few"), "utf-8")
    (tmp_path / "spec.toml").write_text(SPEC, "utf-8")
    write_recording(tmp_path, seconds=40.0)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*words: str, columns: int = 80) -> Result:
    return CliRunner().invoke(app, list(words), env={"COLUMNS": str(columns)})


# Each as it may be given after those before it, with keys of its document.
CALLS: list[tuple[tuple[str, ...], set[str]]] = [
    (("init", "bay.yaml"), {"written"}),
    (("generate", "made.yaml"), {"written"}),
    (("crowd", "crowd.yaml"), {"written"}),
    (("check", "short.yaml"), {"files"}),
    (("show", "short.yaml", "--out", "picture.png"), {"file", "scenario", "picture"}),
    (("schema", "--out", "schema.json"), {"written"}),
    (
        ("run", "short.yaml", "--planner", "stationary", "--out", "run"),
        {"decisions", "ospa", "seconds", "diagnostics", "folder"},
    ),
    (("results", "run"), {"decisions", "ospa", "written"}),
    (
        ("track", "scans.csv", "--sensors", "radars.yaml", "--out", "tracked"),
        {"ospa", "assumptions", "skipped", "folder"},
    ),
    (("live", "--sensors", "short.yaml"), {"lines", "errors", "scans", "dropped"}),
    (
        ("calibrate", "scans.csv", "--sensors", "radars.yaml", "--out", "found.yaml"),
        {"parameters", "assumptions", "log_likelihood", "written"},
    ),
    (("report", "tracked"), {"page", "figures"}),
    (("video", "run", "--out", "run.gif", "--fps", "2", "--size", "200"), {"video", "frames", "seconds"}),
    (("campaign", "spec.toml", "--dry-run"), {"cells", "compared", "warnings"}),
    (("campaign", "spec.toml", "--workers", "1"), {"folder", "finished", "failed"}),
    (("campaign", "spec.toml", "--slurm", "1000", "--time", "4h"), {"script"}),
    (("campaign", "spec.toml", "--workers", "1", "--shard", "1/2"), {"folder", "finished", "failed"}),
    (("campaign", "spec.toml", "--workers", "1", "--shard", "2/2"), {"folder", "finished", "failed"}),
    (("merge", "trial-shards", "--out", "merged"), {"folder", "runs", "finished", "missing_shards", "commands"}),
    (("results", "trial-results", "--export", "tables", "--tex", "table.tex"), {"comparisons", "missing", "written"}),
    (("report", "trial-results"), {"page", "figures"}),
    (("demo", "short.yaml", "--planners", "stationary,own", "--workers", "1"), {"comparisons", "page"}),
    (
        ("reproduce", "short.yaml", "--runs", "1", "--planners", "stationary", "--workers", "1"),
        {"comparisons", "report"},
    ),
    (("benchmark", "--scenes", "polar-10", "--runs", "1", "--workers", "1"), {"folder", "report", "scenes"}),
]
LISTS = [("list",), ("reproduce", "--list"), ("benchmark", "--list"), ("schema",)]


def test_every_command_has_both_options() -> None:
    assert {words[0] for words, _ in CALLS} | {"list"} == set(COMMANDS)
    for command in COMMANDS.values():
        assert {"--json", "--quiet", "-q"} <= {option for each in command.params for option in each.opts}


@pytest.mark.usefixtures("quick_figures")
def test_json_is_one_document_and_quiet_is_silence(place: Path) -> None:
    for words, keys in CALLS:
        result = call(*words, "--json")
        assert result.exit_code == 0, result.output
        document = json.loads(result.stdout)
        assert keys <= set(document), words
        assert next(iter(document.items())) == ("version", 2)
        for path in (*document.get("written", ()), *filter(None, (document.get("folder"), document.get("page")))):
            assert Path(path).exists()
    for words in LISTS:
        assert json.loads(call(*words, "--json").stdout)
    again = {"init", "generate", "crowd", "run", "track", "calibrate"}
    for words, _ in CALLS:
        replaced = ("--overwrite",) if words[0] in again else ()
        result = call(*words, *replaced, "--quiet")
        assert (result.exit_code, result.output) == (0, ""), words


def test_documents_have_the_numbers_unrounded(place: Path) -> None:
    run = json.loads(call("run", "short.yaml", "--planner", "own", "--json").stdout)
    ospa = run["ospa"]
    assert ospa["total"] == pytest.approx(ospa["localisation"] + ospa["cardinality"], rel=1e-12)
    assert f"mean OSPA   {ospa['total']:.2f} m" in call("run", "short.yaml", "--planner", "own").stdout
    assert call("campaign", "spec.toml", "--workers", "1").exit_code == 0
    (group,) = json.loads(call("results", "trial-results", "--json").stdout)["comparisons"]
    assert [each["strategy"] for each in group["strategies"]] == ["stationary", "own"]
    assert all(f"{each['ospa_mean_m']:.2f}" in call("results", "trial-results").stdout for each in group["strategies"])


def test_errors_are_in_the_json_and_printed_when_quiet(place: Path) -> None:
    result = call("check", "faulty.yaml", "short.yaml", "absent.yaml", "--json")
    faulty, short, absent = json.loads(result.stdout)["files"]
    assert (result.exit_code, result.stderr) == (1, "")
    assert [each["valid"] for each in (faulty, short, absent)] == [False, True, False]
    assert "num_steps: expected a whole number" in faulty["faults"][0]
    assert absent["faults"][0].startswith("absent.yaml: no such file")
    quiet = call("check", "faulty.yaml", "short.yaml", "--quiet")
    assert (quiet.exit_code, quiet.stdout.splitlines(), quiet.stderr) == (1, faulty["faults"], "")
    failed = call("run", "faulty.yaml", "--json")
    assert (failed.exit_code, failed.stdout) == (1, "")
    assert "num_steps" in failed.stderr


MISSING = [
    *(("check", "gone.yaml"), ("show", "gone.yaml"), ("run", "gone.yaml"), ("reproduce", "gone.yaml")),
    *(("run", "gone"), ("campaign", "gone.toml"), ("results", "gone"), ("report", "gone")),
    *(("check", "folder/gone.yaml"), ("results", "."), ("report", ".")),
]


@pytest.mark.parametrize("words", MISSING, ids=" ".join)
def test_a_missing_file_is_reported(place: Path, words: tuple[str, ...]) -> None:
    result = call(*words)
    assert result.exit_code == 1
    (line,) = result.output.splitlines()
    name = "manifest.json" if words[-1] == "." else words[-1]
    assert line.startswith((f"{name}: no such file; expected", f"{name}: no such folder; expected"))


def test_a_folder_is_no_scenario(place: Path) -> None:
    assert call("run", ".").stderr.startswith(".: a folder; expected a YAML file")


@pytest.mark.parametrize("command", ["check", "run", "show", "reproduce"])
def test_a_campaign_file_is_rejected_as_scenario_with_advice(place: Path, command: str) -> None:
    result = call(command, "spec.toml")
    assert result.exit_code == 1
    assert "vedette campaign spec.toml --dry-run" in result.output
    assert call("campaign", "spec.toml", "--dry-run").exit_code == 0


@pytest.mark.parametrize("words", [("init", "a.yaml"), ("generate", "a.yaml"), ("crowd", "a.yaml")], ids=" ".join)
def test_the_overwrite_option_is_suggested_and_works(place: Path, words: tuple[str, ...]) -> None:
    assert call(*words).exit_code == 0
    refused = call(*words)
    assert (refused.exit_code, refused.stderr) == (1, "a.yaml: already there; --overwrite replaces it\n")
    assert call(*words, "--overwrite").exit_code == 0
    assert call(*words, "--force").exit_code == 0  # its name of before


@pytest.mark.usefixtures("quick_figures")
def test_a_run_names_it_too(place: Path) -> None:
    words = ("run", "short.yaml", "--planner", "stationary", "--out", "run")
    assert call(*words).exit_code == 0
    refused = call(*words)
    assert refused.exit_code == 1
    assert refused.stderr.startswith("--out: expected a new folder; run exists (--overwrite ")
    assert call(*words, "--overwrite").exit_code == 0


@pytest.mark.parametrize("columns", [10, 24, 40, 60, 120])
def test_names_are_whole_at_any_width(columns: int) -> None:
    for words, names in ((("list",), list_builtin()), (("reproduce", "--list"), published_comparisons())):
        lines = call(*words, columns=columns).stdout.splitlines()
        assert [line.split()[0] for line in lines if not line.startswith(" ")] == list(names)


def test_completion_lists_available_names(place: Path) -> None:
    (place / "scenes").mkdir()
    assert completing.built_in_scenarios("") == list(list_builtin())
    assert completing.campaigns("deciding") == [name for name in sorted(published_comparisons()) if name != "paper-a"]
    assert completing.scenarios("s") == [*(n for n in list_builtin() if n[0] == "s"), "scenes/", "short.yaml"]
    (place / "scenes" / "a.yml").touch()
    (place / "scenes" / "a.txt").touch()
    assert completing.scenarios("scenes/") == ["scenes/a.yml"]
    assert completing.scenarios("nowhere/") == []


def completion(*words: str) -> dict[str, str]:
    """Return what a shell sets in the environment to complete the last of `words`."""
    line = " ".join(("vedette", *words))
    return {"_VEDETTE_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words))}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("run", "pap"), ["paper-a", "paper-e"]),
        (("show", "fa"), ["faulty.yaml"]),
        (("check", "pol"), ["polar-10"]),
        (("run", "short.yaml", "--planner", "o"), ["oracle", "own"]),
        (("run", "short.yaml", "--planner", "s"), ["stationary"]),
        (("run", "gone.yaml", "--planner", "i"), ["idm"]),
        (("reproduce", "short.yaml", "--planners", "jdm,o"), ["jdm,oracle", "jdm,own"]),
        (("reproduce", "deciding-six"), ["deciding-six-cameras"]),
        (("campaign", "sp"), ["spec.toml"]),
        (("init", "--from", "sol"), ["solent", "solent-patrol"]),
        (("results", "--format", "n"), ["netcdf"]),
        (("generate", "--pattern", "c"), ["crowd"]),
    ],
    ids=lambda each: " ".join(each),
)
def test_shell_completion_lists_names(place: Path, words: tuple[str, ...], expected: list[str]) -> None:
    result = CliRunner().invoke(app, [], prog_name="vedette", env=completion(*words))
    assert result.stderr == ""
    assert result.stdout.split() == expected


def test_the_program_answers_a_shell(place: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from vedette.cli import app; app(prog_name='vedette')"],
        env={**os.environ, **completion("run", "short.yaml", "--planner", "o")},
        capture_output=True,
        text=True,
        timeout=WAIT,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout.split() == ["oracle", "own"]


def test_a_misspelled_option_suggests_the_right_one() -> None:
    result = call("run", "paper-a", "--plannr", "jdm")
    assert result.exit_code == 2
    assert "--planner" in result.stderr


def test_missing_shards_are_listed_with_the_commands_that_run_them(place: Path) -> None:
    assert call("campaign", "spec.toml", "--workers", "1", "--shard", "2/3").exit_code == 0
    result = call("merge", "trial-shards", "--out", "merged")
    assert result.exit_code == 1
    commands = [line.strip() for line in result.stderr.splitlines() if line.startswith("  vedette campaign SPEC")]
    assert [command.split()[-1] for command in commands] == ["1/3", "3/3"]
    for command in commands:
        words = command.replace("SPEC", "spec.toml").split()[1:]
        assert call(*words, "--workers", "1").exit_code == 0
    result = call("merge", "trial-shards", "--out", "merged")
    assert (result.exit_code, "4 of 4 runs" in result.stdout) == (0, True)
    assert call("results", "merged").exit_code == 0


def test_a_job_array_needs_a_time_and_has_no_shard_of_its_own(place: Path) -> None:
    assert call("campaign", "spec.toml", "--slurm", "3").exit_code == 2
    assert call("campaign", "spec.toml", "--slurm", "3", "--time", "4h", "--shard", "1/3").exit_code == 2
    script = call("campaign", "spec.toml", "--runs", "5", "--slurm", "3", "--time", "4h").stdout
    assert script.startswith("#!/bin/bash\n")
    assert "vedette campaign spec.toml --out trial-shards --runs=5 --workers=1 --shard" in script


def test_an_interruption_while_the_program_is_imported_is_no_traceback() -> None:
    code = (
        "import sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'vedette.cli':\n"
        "            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "from vedette.__main__ import main\n"
        "main()\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "\ninterrupted\n")
