"""Calls that a scan, a decision and a command take; `docs/architecture.md` names the files of the first two."""

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import vedette
from vedette.cli import app
from vedette.kernels.base.compile import JIT_ENABLED
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation.loop import sensor_streams
from vedette.simulation.scans import simulate_scans

SOURCE = str(Path(vedette.__file__).parent)
WALKS = (Path(__file__).parents[1] / "docs/architecture.md").read_text().split("## How one decision flows")[1]
ROOMS = ("tracking", "filters", "control")

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="what is compiled is called as Python then")


def calls_of(work: Callable[[], Any]) -> Counter[str]:
    """How many frames of each of the library's files a call takes in this thread.

    Comprehensions do not count: from Python 3.12 on they have no frame.
    """
    found: Counter[str] = Counter()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        name = frame.f_code.co_filename
        if event == "call" and name.startswith(SOURCE) and not frame.f_code.co_name.endswith("comp>"):
            found[Path(name).relative_to(SOURCE).as_posix()] += 1

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return found


@pytest.fixture(scope="module")
def walks() -> dict[str, Counter[str]]:
    """Of the fifth scan of `paper-a` and of a second decision by the expected loss after it, when all is warm."""
    scenario = replace_fields(load_scenario("paper-a"), {"control.reward": {"kind": "expected_loss", "cutoff": 100.0}})
    experiment, planner = build_experiment(scenario), build_planner(scenario, "jdm", num_threads=1)
    assert planner is not None
    tracker, poses, rng = experiment.tracker, experiment.poses, np.random.default_rng(0)
    truth = experiment.targets.truth(experiment.times, rng=rng)
    rngs, found = sensor_streams(1, 0, 0, experiment.num_sensors), Counter[str]()
    state = tracker.initial()
    for step in range(1, 6):
        scans = simulate_scans(truth.at(step - 1)[1], poses, experiment.sensors_at(step), rngs=rngs)
        given = state, [None if scan is None else scan.measurements for scan in scans], poses, float(step)
        found = calls_of(lambda given=given: tracker.step(*given, rngs=rngs))  # type: ignore[misc]
        state, _ = tracker.step(*given, rngs=rngs)
    planner.plan(state, poses, rng=rng)
    return {"scan": found, "decision": calls_of(lambda: planner.plan(state, poses, rng=rng))}


@pytest.mark.parametrize(("walk", "most"), [("scan", 150), ("decision", 250)])
def test_it_takes_few_calls(walks: dict[str, Counter[str]], walk: str, most: int) -> None:
    assert 50 < walks[walk].total() <= most, walks[walk].most_common()


def test_every_file_on_the_way_is_in_the_lists(walks: dict[str, Counter[str]]) -> None:
    named = set(re.findall(r"(\w+)\.py", WALKS))
    on_the_way = {file for walk in walks.values() for file in walk if file.split("/")[0] in ROOMS}
    assert len(on_the_way) > 10
    assert {file for file in on_the_way if Path(file).stem not in named} == {"control/settings.py"}  # data


@pytest.mark.parametrize(
    ("begins", "ends", "most"),
    [
        ("A scan of `paper-a`", "[Steps and workspaces]", 15),
        ("When a decision by the expected loss", "Other decisions", 25),
    ],
)
def test_the_list_is_short(begins: str, ends: str, most: int) -> None:
    steps = WALKS.split(begins)[1].split(ends)[0]
    files = set(re.findall(r"`((?:\w+/)*\w+)(?:\.py)?`", steps)) - {
        "control",
        "kernels",
        "platform",
        "kernels/planning",
    }
    assert most - 10 < len(files) <= most, sorted(files)


def test_a_decision_takes_few_files(walks: dict[str, Counter[str]]) -> None:
    assert sum(file.startswith(("control/", "kernels/planning/")) for file in walks["decision"]) <= 24
    assert len(walks["decision"]) <= 54


@pytest.mark.usefixtures("quick_figures")
def test_a_run_from_the_command_line_takes_few_calls(tmp_path: Path) -> None:
    """The second one in a process, which writes its folder and figures; more than half are of tracking and planning.

    The figures are made but not drawn, as the calls counted are those of the library, and drawing is Matplotlib's.
    """
    words = ["run", "paper-a", "--threads", "1", "--out", str(tmp_path / "run"), "--overwrite"]
    assert CliRunner().invoke(app, words).exit_code == 0
    calls = calls_of(lambda: CliRunner().invoke(app, words))
    assert 10_000 < calls.total() <= 32_500, calls.most_common()


READING = """
import sys
from collections import Counter
from pathlib import Path
import vedette

source, found = str(Path(vedette.__file__).parent), Counter()

def note(frame, event, argument):
    if event == "call" and frame.f_code.co_filename.startswith(source):
        found[frame.f_code.co_filename] += 1

sys.setprofile(note)
from vedette.scenarios import load_scenario
load_scenario("paper-a")
sys.setprofile(None)
print(found.total(), len(found))
"""


def test_reading_a_scenario_takes_few_calls_and_no_filters() -> None:
    """In a process of its own, imports included: what is only read needs nothing of what it describes."""
    done = subprocess.run([sys.executable, "-c", READING], capture_output=True, text=True, check=True)
    calls, files = map(int, done.stdout.split())
    assert calls <= 5_200
    assert files <= 54
