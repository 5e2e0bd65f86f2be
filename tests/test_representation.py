"""What is printed of the containers of a run, at default settings: a line or two, whatever they hold."""

import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import vedette
from vedette.campaigns import open_results, parse_spec, resolve, run_campaign
from vedette.densities import LMB, MultiTargetSamples, UndetectedIntensity, sample_lmb
from vedette.densities.inspection import Targets
from vedette.errors import InputError
from vedette.evaluation import compare, measure_run, run_scenario
from vedette.internal.representation import SummaryRepr
from vedette.models import CellGrid, Region
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation import RunRecord, Scan
from vedette.tracking import OutOfSequenceTracker, SensorScan, State, Timeline

SCENARIO = load_scenario("paper-e")
WIDEST = 160


@pytest.fixture(scope="module")
def record() -> RunRecord:
    return run_scenario(SCENARIO, "idm", seed=1)


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    experiment = build_experiment(SCENARIO)
    late = OutOfSequenceTracker(experiment.tracker, experiment.poses)
    scans = [SensorScan(s, float(t), np.array([[0.1 * t, 300.0]]), [0.0, 0.0, 0.0]) for t in (1, 3, 2) for s in (0, 1)]
    came = late.initial()
    for scan in scans:
        came, _ = late.process(came, [scan])
    return came


def test_a_run_and_its_parts(record: RunRecord, timeline: Timeline) -> None:
    decision, instant = record.decisions[0], timeline.entries[0]
    joint = run_scenario(SCENARIO, "jdm", seed=1).decisions[0].plan
    parts: list[Any] = [record, decision, decision.plan, *decision.plan.actions, record.truth, record.health]
    parts += [joint, *joint.tables, *decision.plan.tables, *record.estimates]
    parts += [timeline, instant, instant.state, instant.info, *instant.scans.values()]
    parts += [build_experiment(SCENARIO), measure_run(record, SCENARIO), compare({"idm": [record]})]
    parts += [Scan(np.zeros((900, 2)), np.zeros(900, np.int64))]
    for part in parts:
        assert isinstance(part, SummaryRepr)
        lines = repr(part).splitlines()
        assert len(lines) <= 2
        assert max(map(len, lines)) <= WIDEST
        assert lines[0].startswith(f"{type(part).__name__} ")
        assert "array(" not in repr(part)
        assert "<b>" in part._repr_html_()


def test_what_a_run_says(record: RunRecord) -> None:
    mean = record.ospa[:, 0].mean()
    sizes = "40 scans, 2 sensors, 3 decisions"
    assert repr(record) == f"RunRecord of paper-e by idm, seed 1, run 0: {sizes}, mean OSPA {mean:.4g}"
    stopped = replace(record, ospa=np.full((40, 3), np.nan), stopped="scan 7, the filter: <no> memory")
    assert repr(stopped).splitlines()[1:] == ["  stopped: scan 7, the filter: <no> memory"]
    assert "OSPA" not in repr(stopped)
    table = record.to_table()
    assert table["ospa_m"] == record.ospa[:, 0].tolist()
    assert table["num_estimates"] == [estimate.num_targets for estimate in record.estimates]
    assert set(map(len, table.values())) == {40}


def test_what_a_plan_says(record: RunRecord) -> None:
    plan = record.decisions[0].plan
    headings = [float(action[0]) for action in plan.chosen_actions]
    assert plan.to_table() == {
        "sensor": [0, 1],
        "action": list(plan.chosen),
        "num_actions": [len(actions) for actions in plan.actions],
        "heading_deg": headings,
    }
    told = [f"sensor {s}: heading_deg {heading:g}" for s, heading in enumerate(headings, start=1)]
    assert repr(plan) == "Plan of idm for 2 sensors\n  " + "; ".join(told)
    many = replace(plan, actions=plan.actions * 50, chosen=plan.chosen * 50, tables=())
    assert repr(many).endswith("; 96 more")
    why = plan.explain()
    assert repr(why) == str(why)
    assert max(map(len, repr(why).splitlines())) <= 80


def test_what_a_timeline_and_its_states_say(timeline: Timeline) -> None:
    first, second = repr(timeline).splitlines()
    assert first == "Timeline of 3 instants, 6 scans taken, 2 late, 0 dropped, 0 repeated"
    assert second == "  State after scan 3, at 3 s, of 2 sensors"
    assert timeline.to_table() == {"time_s": [1.0, 2.0, 3.0], "num_scans": [2] * 3, "num_measurements": [2] * 3}
    assert re.fullmatch(r"State after .*\n  fused: \w+ of \d+ labels, .* targets expected", repr(timeline.state))
    assert timeline.state.fused._repr_html_() in timeline.state._repr_html_()
    assert repr(State((), "my own")) == "State before the first scan, of 0 sensors\n  fused: str"
    scan = timeline.entries[0].scans[1]
    assert repr(scan) == "SensorScan of sensor 1, time 1, measurements [[0.1, 300.0]], pose [0.0, 0.0, 0.0]"


def test_what_is_read_and_resolved_is_told_in_two_lines() -> None:
    first, second = repr(SCENARIO).splitlines()
    assert first == "Scenario paper-e: 40 scans, 2 sensors, filter delta_glmb, fusion cm_delta_glmb"
    assert second.startswith("  Reconstruction of the scenario of the paper")
    assert len(second) <= WIDEST + 2
    axes = 'scenarios = ["paper-e", "linear-10"]\nplanners = ["stationary", "idm"]\nruns = 3\n'
    campaign = resolve(parse_spec(f'name = "trial"\n{axes}'))
    assert (
        repr(campaign) == "Campaign trial: 4 cells, 12 runs\n  scenario: paper-e, linear-10; planner: stationary, idm"
    )
    assert "<br>scenario: paper-e, linear-10" in campaign._repr_html_()


def test_others_that_hold_arrays() -> None:
    lmb = LMB.from_bernoullis([(1, 0)], [0.5], [[0.0] * 4], [np.eye(4)])
    samples = sample_lmb(lmb, 1000, rng=np.random.default_rng(0))
    assert isinstance(samples, MultiTargetSamples)
    assert repr(samples).startswith("MultiTargetSamples of offsets (1001,), labels (")
    unfound = UndetectedIntensity.uniform(CellGrid.covering(Region(0.0, 100.0, 0.0, 200.0), 10.0), 2.0)
    assert repr(unfound) == "UndetectedIntensity of 200 cells, 2 targets expected"
    assert repr(State((lmb,), lmb, 2, 4.0, undetected=unfound)) == (
        "State after scan 2, at 4 s, of 1 sensor, 2 not yet found\n  fused: LMB of 1 label, 0.5 targets expected"
    )


class Cells(HTMLParser):
    """Tags and texts of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.texts: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_html_is_escaped_and_short(record: RunRecord) -> None:
    evil = "<script>alert('&')</script>"
    plan = record.decisions[0].plan
    own = replace(plan.actions[0], columns=(evil,))
    for told in (replace(record, scenario=evil), replace(plan, planner=evil, actions=(own, own))):
        found = Cells(told._repr_html_())
        assert "script" not in found.tags
        assert any("<script>" in text for text in found.texts)
    rows = Cells(record._repr_html_())
    assert rows.tags.count("tr") == 21
    assert "and 20 more" in rows.texts


LAZY = """
import sys
import vedette
before = set(sys.modules)
names = dir(vedette)
assert {name.partition(".")[0] for name in before} & {"numpy", "numba", "scipy", "rich", "pydantic"} == set(), before
assert set(sys.modules) == before
assert not hasattr(vedette, "nothing")
assert not hasattr(vedette, "kernels")
assert vedette.errors.InputError.__name__ == "InputError"
assert "numpy" not in sys.modules
import vedette.densities
assert vedette.densities is sys.modules["vedette.densities"]
assert vedette.tracking.State is sys.modules["vedette.tracking"].State
print(*names)
"""


def test_the_package_offers_its_rooms_and_imports_none_before_it_is_asked_for() -> None:
    ran = subprocess.run([sys.executable, "-W", "error", "-c", LAZY], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    source = Path(vedette.__file__).parent
    rooms = {path.parent.name for path in source.glob("*/__init__.py")} - {"cli", "internal", "kernels"}
    assert ran.stdout.split() == sorted([*rooms, "errors", "__version__"])
    assert all(getattr(vedette, name).__name__ == f"vedette.{name}" for name in rooms)


def test_a_results_folder(tmp_path: Path) -> None:
    spec = parse_spec('name = "trial"\nscenarios = ["linear-10"]\nplanners = ["stationary"]\nruns = 1\n')
    run_campaign(resolve(spec), tmp_path / "out")
    first, second = repr(open_results(tmp_path / "out")).splitlines()
    assert first == "CampaignResults of trial: 1 of 1 run finished, 1 cell"
    assert len(second) <= WIDEST


def test_a_belief_is_drawn_into_axes_with_its_ellipses_and_labels(record: RunRecord) -> None:
    estimate = record.estimates[-1]
    axes = Figure().subplots()
    estimate.plot(axes)
    ellipses = [np.column_stack(line.get_data()) for line in axes.lines if len(np.atleast_1d(line.get_xdata())) > 1]
    assert len(ellipses) == estimate.num_targets > 0
    for edge, mean, cov in zip(ellipses, estimate.means, estimate.covs, strict=True):
        away = edge - mean[:2]
        distance = np.sqrt(np.einsum("ij,ij->i", away, np.linalg.solve(cov[:2, :2], away.T).T))
        np.testing.assert_allclose(distance, 2.0, rtol=1e-9)
    names = [f"{step}.{index}" for step, index in estimate.labels.tolist()]
    assert [text.get_text() for text in axes.texts] == names
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")
    on_a_line = Targets(None, np.ones(1), np.ones((1, 1)), np.ones((1, 1, 1)))
    with pytest.raises(InputError, match="plot: expected states that begin with x and y; got 1 number"):
        on_a_line.draw(axes)
