"""Planners and trackers that are programs: what they are told, what they answer, and every way to answer badly."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from test_processes import is_there
from vedette.campaigns import CampaignSpec, open_results, resolve, run_campaign
from vedette.cli.running import CodeTrust
from vedette.errors import InputError
from vedette.evaluation.runs import run_scenario
from vedette.evaluation.scans import scans_of_record
from vedette.internal.programs import MOST_BYTES, Program
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_sensors
from vedette.scenarios.overrides import replace_fields
from vedette.simulation.journal import RunStopped
from vedette.simulation.records import RunRecord
from vedette.tracking.program import UNKNOWN_VARIANCE
from waiting import PATIENCE, wait_until

PAGE = (Path(__file__).resolve().parents[1] / "docs/benchmark.md").read_text("utf-8")
SHOWN = dict(re.findall(r'^```\w+ title="([^"]+)"\n(.*?)^```$', PAGE, re.DOTALL | re.MULTILINE))
NEAREST = SHOWN["nearest.py"]
# A program of one answer; `told` is what it was asked.
ANSWERS = """
import json, os, sys, time
for line in sys.stdin:
    told = json.loads(line)
    if "role" in told:
        print('{"ready": true}', flush=True)
        continue
    ANSWER
"""
SHORT: dict[str, Any] = {"time.num_steps": 6, "control.decision_steps": [1, 2, 3, 4, 5]}


def section(folder: Path, text: str, **more: Any) -> dict[str, Any]:
    """A program of that text."""
    file = folder / "program.py"
    file.write_text(text)
    return {"kind": "program", "command": [sys.executable, str(file)], "seconds": 20.0, **more}


def planned(name: str, program: dict[str, Any], **fields: Any) -> Scenario:
    return replace_fields(load_scenario(name), {"planners": {"mine": program}, **fields})


def tracked(program: dict[str, Any], **fields: Any) -> Scenario:
    """Two targets that stand still, and a program that is to track them."""
    tracks = [{"state": [0.0, 0.0, 0.0, 0.0]}, {"state": [300.0, 0.0, 0.0, 0.0]}]
    own = {"kind": "central", "filter": program}
    targets = {"kind": "scripted", "tracks": tracks}
    scene = {"fusion": own, "targets": targets, "time.num_steps": 4, "ospa.cutoff": 10.0}
    return replace_fields(load_scenario("two-views-1"), {**scene, **fields})


def same(one: RunRecord, other: RunRecord) -> bool:
    choices = [[decision.plan.chosen for decision in record.decisions] for record in (one, other)]
    return choices[0] == choices[1] and np.array_equal(one.ospa, other.ospa) and np.array_equal(one.poses, other.poses)


@pytest.mark.parametrize("name", ["two-searchers", "eight-mobile"])
def test_a_program_that_does_what_a_rule_of_thumb_does_gives_the_same_runs(name: str, tmp_path: Path) -> None:
    steps = {"time.num_steps": 30, "control.decision_steps": list(range(1, 30))}
    scenario = planned(name, section(tmp_path, NEAREST), **steps)
    for run in range(2):
        assert same(
            run_scenario(scenario, "nearest", seed=3, run=run, num_threads=1),
            run_scenario(scenario, "mine", seed=3, run=run, num_threads=1),
        )


def test_what_a_planner_is_told_holds_no_truth_and_its_seed_is_that_of_the_run(tmp_path: Path) -> None:
    keep = "open(f'told{len(os.listdir())}.json', 'w').write(line)"
    text = ANSWERS.replace('if "role" in told:', f'if "role" in told:\n        {keep}')
    text = text.replace("ANSWER", "print(json.dumps({'actions': [0, 0], 'counts': {'rewards': 7}}), flush=True)")
    (tmp_path / "place").mkdir()
    (tmp_path / "place" / "scene.yaml").write_text(
        Path(load_scenario("two-searchers").path or "").read_text(encoding="utf-8"), encoding="utf-8"
    )
    scenario = replace_fields(
        load_scenario(tmp_path / "place" / "scene.yaml"),
        {"planners": {"mine": section(tmp_path, text)}, **SHORT},
    )
    first = run_scenario(scenario, "mine", seed=0, run=0, num_threads=1)
    assert {decision.plan.counts["rewards"] for decision in first.decisions} == {7}
    for run in (0, 1):
        run_scenario(scenario, "mine", seed=0, run=run, num_threads=1)
    told = [file.read_text() for file in sorted((tmp_path / "place").glob("told*.json"))]
    assert told[0] == told[1] != told[2]  # in the seed
    assert '"targets"' not in told[0]
    assert '"role":"planner"' in told[0]


BAD_PLANS = {
    "print('hello', flush=True)": r"expected a JSON object; got hello",
    "print('[0, 0]', flush=True)": r"expected a JSON object; got \[0, 0\]",
    "print('{\"actions\": NaN}', flush=True)": r"expected a JSON object; got {\"actions\": NaN}",
    "print('{}', flush=True)": r'expected "actions": 2 whole numbers, one a sensor; got only an empty object',
    "print('{\"actions\": [0]}', flush=True)": r'expected "actions": 2 whole numbers, one a sensor; got \[0\]',
    "print('{\"actions\": [0, 1.0]}', flush=True)": r'"actions": 2 whole numbers, one a sensor; got \[0, 1.0\]',
    "print('{\"actions\": [0, true]}', flush=True)": r"2 whole numbers, one a sensor; got \[0, True\]",
    "print('{\"actions\": [0, 99]}', flush=True)": r"expected actions\[1\] from 0 to \d+; got 99",
    "print('{\"actions\": [0, -1]}', flush=True)": r"expected actions\[1\] from 0 to \d+; got -1",
    'print(\'{"actions": [0, 0], "counts": {"rewards": -1}}\', flush=True)': r'expected "counts": whole numbers of',
    "time.sleep(600)": r"expected an answer within 0.5 s; got none \(is what it prints flushed",
    "print('a last word', file=sys.stderr); sys.exit(3)": r"got its end, with status 3; it said last: a last word",
    "raise KeyError('lost')": r"got its end, with status 1; it said last: Traceback.*KeyError: 'lost'",
    "print('{', end='', flush=True); sys.exit()": r"expected a line; got { and its end, with status 0",
    "sys.stdout.write('x' * (2**24 + 9)); sys.stdout.flush()": rf"a line of at most {MOST_BYTES} bytes; got a longer",
    'print(\'{"actions": [0, 0], "actions": [1, 1]}\', flush=True)': r"the key 'actions' stands there twice",
    "print('[' * 100000, flush=True)": r"expected a JSON object; got \[\[\[",
}


@pytest.mark.parametrize("answer", BAD_PLANS)
def test_a_bad_answer_is_named_and_ends_the_program(answer: str, tmp_path: Path) -> None:
    program = section(tmp_path, ANSWERS.replace("ANSWER", answer), seconds=0.5 if "sleep" in answer else 20.0)
    with pytest.raises(RunStopped, match=r"in the planning: program .*program\.py, answer 2: .*" + BAD_PLANS[answer]):
        run_scenario(planned("two-searchers", program, **SHORT), "mine", seed=0, num_threads=1)


def test_a_forbidden_action_is_named(tmp_path: Path) -> None:
    text = ANSWERS.replace("ANSWER", "print(json.dumps({'actions': [told['sensors'][0]['allowed'].index(False), 0]}))")
    stays = [{"kind": "stay_inside", "region": {"x_min": -6.0, "x_max": 6.0, "y_min": 149.0, "y_max": 151.0}}]
    scenario = planned("two-searchers", section(tmp_path, text), **SHORT, **{"control.constraints": stays})
    with pytest.raises(RunStopped, match=r"expected actions\[0\] that is allowed; got \d"):
        run_scenario(scenario, "mine", seed=0, num_threads=1)


def test_actions_that_are_forbidden_together_are_named(tmp_path: Path) -> None:
    text = ANSWERS.replace(
        "ANSWER",
        "table = told['pairs'][0]['allowed']\n"
        "    at = next([i, row.index(False)] for i, row in enumerate(table) if False in row)\n"
        "    print(json.dumps({'actions': at}), flush=True)",
    )
    apart = [{"kind": "separation", "distance": 12.0}]
    scenario = planned("two-searchers", section(tmp_path, text), **SHORT, **{"control.constraints": apart})
    with pytest.raises(RunStopped, match=r"expected actions\[0\] and actions\[1\] that are allowed together; got \d"):
        run_scenario(scenario, "mine", seed=0, num_threads=1)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["no-such-program-here"], "expected a program that can be started; got no-such-program-here: No such file"),
        ([sys.executable, "-c", "print('Welcome', flush=True)"], "expected a JSON object; got Welcome"),
        ([sys.executable, "-c", "print('{}', flush=True)"], 'expected "ready": true, in answer to its first line'),
    ],
)
def test_a_program_that_does_not_start_is_named(command: list[str], words: str) -> None:
    program = {"kind": "program", "command": command}
    with pytest.raises(RunStopped, match=words):
        run_scenario(planned("two-searchers", program, **SHORT), "mine", seed=0, num_threads=1)


def test_a_bad_run_stops_neither_the_others_nor_the_campaign(tmp_path: Path) -> None:
    bad = section(tmp_path, ANSWERS.replace("ANSWER", "print('no')"))
    planners: Any = {"mine": bad}
    spec = CampaignSpec(
        name="trial",
        scenarios=("two-searchers",),
        planners=("nearest", "mine"),
        runs=2,
        set={"planners": planners, **SHORT},
    )
    outcome = run_campaign(resolve(spec), tmp_path / "results")
    assert [(each.cell, each.run) for each in outcome.failed] == [("mine", 0), ("mine", 1)]
    assert all("expected a JSON object; got no" in each.message for each in outcome.failed)
    assert open_results(tmp_path / "results").finished("nearest") == (0, 1)


def test_workers_and_resuming_change_nothing(tmp_path: Path) -> None:
    planners: Any = {"mine": section(tmp_path, NEAREST)}
    spec = CampaignSpec(
        name="trial", scenarios=("two-searchers",), planners=("mine",), runs=3, set={"planners": planners, **SHORT}
    )
    whole = resolve(spec)
    run_campaign(whole, tmp_path / "one")
    run_campaign(whole.with_runs(1), tmp_path / "two")
    run_campaign(whole, tmp_path / "two", num_workers=2)
    found = [[open_results(tmp_path / name).run("mine", run).checksum for run in range(3)] for name in ("one", "two")]
    assert found[0] == found[1]


def test_programs_of_others_run_only_when_trusted(tmp_path: Path) -> None:
    scenario = planned("two-searchers", section(tmp_path, NEAREST))
    (tmp_path / "program.py").chmod(0o666)
    with pytest.raises(InputError, match="every user may write to"):
        CodeTrust(False)(scenario)
    CodeTrust(True)(scenario)


# Trackers

SAYS = "print(json.dumps({'estimates': %s}), flush=True)"


def test_the_error_of_a_tracker_of_constants_is_the_one_by_hand(tmp_path: Path) -> None:
    told = "[{'state': [3.0, 4.0], 'label': 'a'}, {'state': [300.0, 0.0, 0.0, 0.0], 'label': 7, 'existence': 0.9}]"
    record = run_scenario(tracked(section(tmp_path, ANSWERS.replace("ANSWER", SAYS % told))), "stationary", seed=0)
    assert np.allclose(record.ospa[:, 0], (5.0 + 0.0) / 2.0)
    assert [estimate.labels.tolist() for estimate in record.estimates] == [[[1, 0], [1, 1]]] * 4
    alone = ANSWERS.replace("ANSWER", SAYS % "[{'state': [3.0, 4.0], 'cov': [[4.0, 0.0], [0.0, 1.0]]}]")
    record = run_scenario(tracked(section(tmp_path, alone)), "stationary", seed=0)
    assert np.allclose(record.ospa[:, 0], (5.0 + 10.0) / 2.0)
    assert [estimate.labels.tolist() for estimate in record.estimates] == [[[1, 0]]] * 4
    assert np.array_equal(record.estimates[0].covs[0, :2, :2], np.diag([4.0, 1.0]))
    none = ANSWERS.replace("ANSWER", SAYS % "[]")
    assert np.allclose(run_scenario(tracked(section(tmp_path, none)), "stationary", seed=0).ospa[:, 0], 10.0)


def test_a_tracker_is_told_every_scan_with_its_time_and_pose(tmp_path: Path) -> None:
    own = "[{'state': [told['time'], sum(len(scan['measurements']) for scan in told['scans'])]}]"
    silent = {"sensors.*.detection": {"kind": "constant", "probability": 0.0}, "sensors.*.clutter.rate": 0.0}
    scenario = tracked(section(tmp_path, ANSWERS.replace("ANSWER", SAYS % own)), **silent)
    record = run_scenario(scenario, "stationary", seed=0)
    assert [estimate.means[0, :2].tolist() for estimate in record.estimates] == [[t, 0.0] for t in record.times]


def test_a_tracker_need_not_know_turn_rates(tmp_path: Path) -> None:
    told = "[{'state': [1.0, 2.0, 3.0, 4.0], 'cov': [[float(i == j) for i in range(4)] for j in range(4)]}]"
    program = section(tmp_path, ANSWERS.replace("ANSWER", SAYS % told))
    scenario = replace_fields(load_scenario("polar-10"), {"fusion": {"kind": "central", "filter": program}})
    estimate = run_scenario(scenario, "stationary", seed=0).estimates[0]
    assert estimate.means.tolist() == [[1.0, 2.0, 3.0, 4.0, 0.0]]
    assert np.diagonal(estimate.covs[0]).tolist() == [1.0, 1.0, 1.0, 1.0, UNKNOWN_VARIANCE]


@pytest.mark.parametrize("name", ["polar-10", "three-positions"])
def test_the_tracker_of_the_page_reports_what_the_first_sensor_says(name: str, tmp_path: Path) -> None:
    program = section(tmp_path, SHOWN["last.py"])
    scenario = replace_fields(load_scenario(name), {"fusion": {"kind": "central", "filter": program}})
    sensor = build_sensors(scenario)[0].filter.sensor
    record = run_scenario(scenario, "stationary", seed=0)
    scan = scans_of_record(record, scenario)[4][0]
    assert scan is not None
    places = sensor.measurement.positions(scan.measurements, record.poses[4, 0])
    assert np.allclose(np.sort(record.estimates[4].means[:, 0]), np.sort(places[:, 0]))


BAD_ESTIMATES = {
    "{'estimates': 3}": r'expected "estimates": a list; got 3',
    "{'estimates': [3]}": r"expected estimates\[0\] with \"state\" and perhaps",
    "{'estimates': [{'stat': [1.0, 2.0]}]}": r"expected estimates\[0\] with \"state\" and perhaps",
    "{'estimates': [{'state': [1.0]}]}": r"estimates\[0\].state: 4 finite numbers or 2 finite numbers; got \[1.0\]",
    "{'estimates': [{'state': [1.0, 'x']}]}": r"estimates\[0\].state: 4 finite numbers or 2",
    "{'estimates': [{'state': [1.0, 1e999]}]}": r"expected a JSON object; got .*Infinity",
    "{'estimates': [{'state': [1.0, 2.0], 'cov': [1.0]}]}": r"estimates\[0\].cov: 2x2 finite numbers; got \[1.0\]",
    "{'estimates': [{'state': [1.0, 2.0], 'cov': [[1, 0], [0, -1]]}]}": r"expected states, covariances and existences",
    "{'estimates': [{'state': [1.0, 2.0], 'existence': 1.5}]}": r"expected states, covariances and existences",
    "{'estimates': [{'state': [1.0, 2.0], 'label': {}}]}": r"estimates\[0\].label: a number or text; got {}",
    "{'estimates': 2 * [{'state': [1.0, 2.0], 'label': 1}]}": r"expected estimates of different labels; got \[1, 1\]",
}


@pytest.mark.parametrize("answer", BAD_ESTIMATES)
def test_bad_estimates_are_named(answer: str, tmp_path: Path) -> None:
    text = ANSWERS.replace("ANSWER", f"print(json.dumps({answer}), flush=True)")
    with pytest.raises(RunStopped, match=r"in the filter: program .*, answer 2: .*" + BAD_ESTIMATES[answer]):
        run_scenario(tracked(section(tmp_path, text)), "stationary", seed=0)


@pytest.mark.skipif(not hasattr(os, "getpgid"), reason="process groups are POSIX's")
def test_a_program_ends_with_the_process_that_asks_it(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(ANSWERS.replace("ANSWER", "pass"))
    code = (
        "import os, sys; from pathlib import Path; from vedette.internal.programs import Program\n"
        f"program = Program([sys.executable, {str(tmp_path / 'program.py')!r}], Path())\n"
        "program.ask({'role': 'planner'}, 20.0); print(program._child.pid, flush=True); os._exit(1)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    # The pipe of its standard error is held by the program alone: had it not ended, this would wait for ever.
    assert (ended.returncode, ended.stdout.strip().isdigit()) == (1, True)


@pytest.mark.skipif(not hasattr(os, "getpgid"), reason="process groups are POSIX's")
def test_what_a_program_started_ends_with_it_though_it_has_ended(tmp_path: Path) -> None:
    """The child holds the pipe of standard error: had it not ended, this would wait for ever."""
    code = (
        "import subprocess; input(); subprocess.Popen(['sleep', '600'], stdin=-3, stdout=-3); print('{}', flush=True)"
    )
    program = Program([sys.executable, "-c", code], tmp_path)
    program.ask({"role": "planner"}, 20.0)
    program._child.wait(PATIENCE)
    program._end()
    program._listener.join(PATIENCE)
    assert not program._listener.is_alive()


PARENT = """
import sys
from pathlib import Path
from vedette.internal.programs import Program

program = Program([sys.executable, "-c", "import time; time.sleep(3600)"], Path())
print(program._child.pid, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(os.name == "nt", reason="there are no groups of processes")
def test_a_program_that_reads_nothing_ends_with_a_parent_that_is_killed() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        program = int(parent.stdout.readline())
        assert is_there(program)
        parent.kill()
        parent.wait(timeout=PATIENCE)
    wait_until(lambda: not is_there(program), "the end of the program")
