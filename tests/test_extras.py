"""What the light installation can do, and what it says where a package is missing that an extra brings.

Each in a process of its own, in which nothing that an extra brings can be imported.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer

from recordings import write_recording
from vedette.cli import app
from vedette.internal.extras import EXTRA_OF

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
WAIT = 600.0  # s; kernels may have to be compiled

REFUSING = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in REFUSED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Refuse())
"""
COMMANDS = """
import json
from typer.testing import CliRunner
from vedette.cli import app

def outcome(arguments):
    result = CliRunner().invoke(app, arguments)
    return [result.exit_code, result.stdout, result.stderr, repr(result.exception)]

print(json.dumps([outcome(arguments) for arguments in json.loads(sys.argv[1])]))
"""

LIGHT = [
    ["--help"],
    ["list"],
    ["init", "bay.yaml"],
    ["generate", "made.yaml"],
    ["crowd", "crowd.yaml"],
    ["check", "bay.yaml", "made.yaml", "crowd.yaml"],
    ["show", "bay.yaml"],
    ["schema"],
    ["run", "linear-10", "--planner", "stationary"],
    ["live", "--sensors", "bay.yaml"],
    ["track", "scans.csv", "--sensors", "radars.yaml", "--out", "tracked"],
    ["calibrate", "scans.csv", "--sensors", "radars.yaml"],
]
HEAVY = {
    ("show", "linear-10", "--out", "picture.png"): ("matplotlib", "report"),
    ("run", "linear-10", "--planner", "stationary", "--out", "run"): ("matplotlib and pyarrow", "report"),
    ("video", "there", "--out", "run.gif"): ("matplotlib and pyarrow", "report"),
    ("live", "--sensors", "bay.yaml", "--listen", "ws://127.0.0.1:0"): (
        "websockets and jinja2 and matplotlib and pyarrow",
        "live,report",
    ),
    ("campaign", "spec.toml"): ("pyarrow", "campaigns"),
    ("merge", "there"): ("pyarrow", "campaigns"),
    ("results", "there"): ("pyarrow", "campaigns"),
    ("report", "there"): ("jinja2 and matplotlib and pyarrow", "report"),
    ("demo",): ("jinja2 and matplotlib and pyarrow", "report"),
    ("reproduce",): ("jinja2 and matplotlib and pyarrow", "report"),
    ("benchmark",): ("jinja2 and matplotlib and pyarrow", "report"),
}


def without(refused: list[str], program: str, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A program run where some packages cannot be imported, warnings as errors."""
    code = f"REFUSED = {refused}\n{REFUSING}\n{program}"
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=WAIT,
        check=False,
    )


REFUSED = [*EXTRA_OF, "dask"]
HEAVY_ROOMS = {"campaigns", "gym", "reports", "figures", "stonesoup"}


def outcomes(commands: list[list[str]], folder: Path, refused: list[str] = REFUSED) -> list[tuple[int, str, str, str]]:
    """Exit status, output, error output and exception of each command."""
    ran = without(refused, COMMANDS, folder, json.dumps(commands))
    assert ran.returncode == 0, ran.stderr
    return [tuple(each) for each in json.loads(ran.stdout.splitlines()[-1])]


def brought(extra: str) -> set[str]:
    """Names of the packages that an extra brings, with those of the extras that it names."""
    found: set[str] = set()
    for entry in PROJECT["optional-dependencies"][extra]:
        if inner := re.fullmatch(r"vedette\[(.*)\]", entry):
            found.update(*(brought(name) for name in inner[1].split(",")))
        else:
            found.add(re.split(r"[<>=]", entry)[0])
    return found


def test_extras_bring_what_they_are_named_for() -> None:
    named = {"asterix": "libasterix"}  # by another name than it is imported by
    assert brought("all") == {named.get(package, package) for package in EXTRA_OF}
    for package, extra in EXTRA_OF.items():
        assert named.get(package, package) in brought(extra)
        assert brought("campaigns") <= brought(extra)
    plain = {re.split(r"[<>=]", entry)[0] for entry in PROJECT["dependencies"]}
    assert plain == {"numba", "numpy", "pydantic", "pymap3d", "rich", "ruamel.yaml", "scipy", "typer"}


def test_filters_fusion_control_and_scenarios_need_no_extra(tmp_path: Path) -> None:
    rooms = [
        f"vedette.{path.relative_to(ROOT / 'src/vedette').with_suffix('').as_posix().replace('/', '.')}"
        for path in sorted((ROOT / "src/vedette").rglob("*.py"))
        if path.name != "__init__.py"
        and not HEAVY_ROOMS & set(path.relative_to(ROOT / "src/vedette").parts)
        and path.name not in ("picture.py", "web.py")
    ]
    assert len(rooms) > 200
    ran = without(REFUSED, "\n".join(f"import {room}" for room in rooms), tmp_path)
    assert ran.returncode == 0, ran.stderr


def test_a_tracking_loop_with_a_plan_needs_no_extra(tmp_path: Path) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/loop.md").read_text("utf-8"), re.DOTALL)
    ran = without(REFUSED, block, tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "go to" in ran.stdout


def test_light_commands_need_no_extra(tmp_path: Path) -> None:
    write_recording(tmp_path, seconds=40.0)
    for command, (status, _, error, exception) in zip(LIGHT, outcomes(LIGHT, tmp_path), strict=True):
        assert (status, exception) == (0, "None"), f"{command}: {error}"


def test_commands_that_need_an_extra_name_it_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "spec.toml").write_text(
        'name = "trial"\nscenarios = ["linear-10"]\nplanners = ["stationary"]\nruns = 1\n'
    )
    (tmp_path / "there").mkdir()
    found = outcomes([list(command) for command in HEAVY], tmp_path)
    for (command, (names, extra)), (status, output, error, _) in zip(HEAVY.items(), found, strict=True):
        assert status == 1, command
        (line,) = error.splitlines()
        assert line.startswith(f"vedette {command[0]}")
        assert f" needs {names}, which" in line
        assert line.endswith(f"not installed: pip install 'vedette[{extra}]'")
        assert output == ""  # said before anything is done
    assert {path.name for path in tmp_path.iterdir()} == {"spec.toml", "there"}


def test_what_a_format_needs_is_asked_for_before_anything_is_done(tmp_path: Path) -> None:
    """Files that do not exist are not even looked for."""
    track = ["track", "scans.csv", "--sensors", "radars.yaml", "--out", "run", "--format", "csv", "--format"]
    commands = [[*track, "parquet"], [*track, "mcap"], ["results", "there", "--export", "files", "--format", "netcdf"]]
    found = outcomes(commands[:2], tmp_path) + outcomes(commands[2:], tmp_path, ["xarray"])
    assert [(status, output, error) for status, output, error, _ in found] == [
        (1, "", "writing .parquet files needs pyarrow, which is not installed: pip install 'vedette[campaigns]'\n"),
        (1, "", "writing .mcap files needs mcap, which is not installed: pip install 'vedette[formats]'\n"),
        (
            1,
            "",
            "vedette results --format netcdf needs xarray, which is not installed: pip install 'vedette[xarray]'\n",
        ),
    ]
    assert list(tmp_path.iterdir()) == []


def test_an_environment_asks_for_what_draws_it_when_it_is_made(tmp_path: Path) -> None:
    pytest.importorskip("gymnasium")
    pytest.importorskip("pettingzoo")
    program = "import vedette.gym; vedette.gym.ScenarioEnv('no-such-scenario', render_mode='rgb_array')"
    ran = without(["matplotlib"], program, tmp_path)
    assert "MissingPackageError: a picture of an environment needs matplotlib" in ran.stderr.splitlines()[-1]


def test_every_command_is_among_these() -> None:
    assert set(typer.main.get_command(app).commands) == {command[0] for command in (*LIGHT[1:], *HEAVY)}  # type: ignore[attr-defined]


def test_only_a_scheduler_needs_the_extra_of_clusters(tmp_path: Path) -> None:
    (tmp_path / "spec.toml").write_text(
        'name = "trial"\nscenarios = ["linear-10"]\nplanners = ["stationary"]\nruns = 2\n'
    )
    command = ["campaign", "spec.toml"]
    found = outcomes(
        [[*command, "--scheduler", "tcp://127.0.0.1:1"], [*command, "--workers", "2"]],
        tmp_path,
        ["cryptography", "distributed", "dask"],
    )
    (cluster, two) = found
    assert cluster[0] == 1
    assert "a campaign on a cluster needs distributed, which is not installed" in cluster[2]
    assert "pip install 'vedette[cluster]'" in cluster[2]
    assert two[0] == 0, two[2]
    assert (tmp_path / "trial-results" / "tables").is_dir()


@pytest.mark.parametrize(
    ("program", "names", "extra"),
    [
        ("import vedette.evaluation.figures", "matplotlib", "report"),
        ("import vedette.reports", "jinja2 and matplotlib and pyarrow", "report"),
        ("import vedette.campaigns", "pyarrow", "campaigns"),
        ("import vedette.gym", "gymnasium and pettingzoo", "gym"),
        ("from vedette.stonesoup import convert", "stonesoup", "stonesoup"),
        ("from vedette.simulation.arrow import write_table; write_table({}, None)", "pyarrow", "campaigns"),
        ("from vedette.recorded.files import read_table; read_table('a.parquet')", "pyarrow", "campaigns"),
    ],
)
def test_the_library_names_the_extra_too(program: str, names: str, extra: str, tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    ran = without(REFUSED, program, tmp_path)
    last = ran.stderr.splitlines()[-1]
    assert last.startswith("vedette.errors.MissingPackageError: ")
    assert f"needs {names}, which" in last
    assert last.endswith(f"pip install 'vedette[{extra}]'")


def test_tracks_are_written_without_any_extra(tmp_path: Path) -> None:
    write_recording(tmp_path, seconds=30.0)
    command = ["track", "scans.csv", "--sensors", "radars.yaml", "--out", "run"]
    ((status, printed, told, _),) = outcomes([command], tmp_path)
    assert status == 0, told
    assert "Wrote run: tracks/tracks.csv" in printed
    assert "needs pyarrow, which is not installed: pip install 'vedette[campaigns]'" in told
    assert "needs matplotlib, which is not installed: pip install 'vedette[report]'" in told
    found = sorted(path.relative_to(tmp_path).as_posix() for path in (tmp_path / "run").rglob("*.*"))
    assert found == ["run/tracks/tracks.csv", "run/tracks/tracks.geojson"]
