"""Data association as an argument: belief propagation, a function of the user's own, and what is refused."""

from __future__ import annotations

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.examples import crowded, evaluator_of
from filters.examples import SCENES, assert_same_mixtures, linear_scene, plain_lmb
from filters.tables import make_options, marginals_of
from reference import iterated_corrector as plain
from reference.test_iterated_corrector import SENSORS, world
from scenarios.minimal import changed
from scenarios.own_association import exact
from vedette.campaigns import parse_spec, resolve, run_campaign
from vedette.control.search.problem import all_joint_actions
from vedette.errors import InputError, ModelError, VedetteError
from vedette.evaluation import run_scenario
from vedette.filters import (
    BeliefPropagation,
    CustomMarginals,
    FilterInfo,
    Gibbs,
    Limits,
    LmbFilter,
    RankedAssignment,
    SequentialLmbFilter,
)
from vedette.kernels.association.assignment import ABSENT, MISSED
from vedette.kernels.association.propagation import propagate_beliefs
from vedette.kernels.base.types import Floats, Ints
from vedette.models import model_function
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation.loop import SCANS, TRUTH, run_stream, sensor_streams
from vedette.simulation.scans import simulate_scans

OWN = Path(__file__).parents[1] / "scenarios" / "own_association.py"


def propagated(options: Any, tolerance: float = 0.0) -> tuple[float, Floats]:
    out = np.empty(len(options.columns))
    log_total = propagate_beliefs(options.offsets, options.columns, options.log_weights, 1000, tolerance, out)
    return log_total, np.exp(out)


def summed(options: Any) -> tuple[float, Floats]:
    log_total, log_chances = marginals_of(options)
    return log_total, np.exp(log_chances)


def rows_of(claims: list[Any], draw: Any) -> list[list[tuple[int, float]]]:
    return [[(column, draw()) for column in (*own, MISSED, ABSENT)] for own in claims]


@pytest.mark.lanes
@given(st.integers(1, 5), st.booleans(), st.lists(st.floats(-30.0, 30.0), min_size=20, max_size=20))
def test_it_is_exact_where_no_claims_make_a_loop(num: int, is_chain: bool, weights: list[float]) -> None:
    claims: list[Any] = [(i, i + 1) if is_chain else (0, i + 1) for i in range(num)]
    options = make_options(rows_of(claims, iter(weights).__next__), num + 1)
    got, wanted = propagated(options), summed(options)
    assert got[0] == pytest.approx(wanted[0], abs=1e-9)
    np.testing.assert_allclose(got[1], wanted[1], rtol=1e-9, atol=1e-13)


@pytest.mark.lanes
def test_in_loops_it_is_that_of_the_plain_messages() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        num, meas = rng.integers(2, 6), rng.integers(1, 5)
        options = make_options(rows_of([range(meas)] * num, lambda: rng.normal(0.0, 2.0)), int(meas))
        odds, got = np.zeros((num, meas)), np.zeros((num, meas + 1))
        _, chances = propagated(options, 1e-12)
        for i in range(num):
            own = slice(options.offsets[i], options.offsets[i + 1])
            columns, weights = options.columns[own], np.exp(options.log_weights[own])
            odds[i, columns[columns >= 0]] = weights[columns >= 0] / weights[columns < 0].sum()
            np.add.at(got[i], np.maximum(columns, -1) + 1, chances[own])
        np.testing.assert_allclose(got, plain.marginals(odds), atol=1e-11)


@pytest.mark.lanes
def test_rows_that_must_be_detected() -> None:
    """No option but a measurement: messages are infinite, probabilities are not."""
    certain = make_options([[(0, 1.0)], [(0, 5.0), (1, -2.0), (MISSED, -4.0)]], 2)
    got, wanted = propagated(certain), summed(certain)
    assert got[0] == pytest.approx(wanted[0], abs=1e-12)
    np.testing.assert_allclose(got[1], wanted[1], atol=1e-13)
    assert propagated(make_options([[(0, 1.0)], [(0, 2.0)]], 1))[0] == -math.inf
    assert propagated(make_options([[(0, 1.0)], []], 1))[0] == -math.inf


def two_steps(tracker: LmbFilter, scene: Any) -> list[tuple[Any, FilterInfo]]:
    """The first scan with its prediction, the second without."""
    rng = np.random.default_rng(0)
    belief, info = tracker.step(tracker.initial(), scene.scans[0], scene.pose, 1.0, 1, rng=rng)
    return [(belief, info), tracker.update(belief, scene.scans[1], scene.pose, rng=rng)]


@pytest.mark.parametrize("name", SCENES)
def test_a_function_that_is_exact_gives_the_exact_filter(name: str) -> None:
    scene = SCENES[name]()
    own = replace(scene.lmb_filter(), assignment=exact)
    for (belief, info), (wanted, told) in zip(two_steps(own, scene), two_steps(scene.lmb_filter(), scene), strict=True):
        for label, (existence, mixture) in plain_lmb(wanted).items():
            got = plain_lmb(belief)[label]
            assert got[0] == pytest.approx(existence, rel=1e-10)
            assert_same_mixtures(got[1], mixture)
        assert info.log_likelihood == pytest.approx(told.log_likelihood, abs=1e-10)
        assert math.isnan(info.truncation_error_bound)
        assert told.truncation_error_bound == pytest.approx(0.0, abs=1e-12)


def test_several_sensors_in_turn_are_the_plain_corrector() -> None:
    """The published scene's filter, message for message: belief propagation, nothing merged, nothing gated."""
    experiment = build_experiment(load_scenario("three-positions"))
    central = SequentialLmbFilter(
        experiment.tracker.targets,
        experiment.tracker.sensors,
        Limits(
            min_existence=0.01,
            max_components=20,
            min_component_weight=1e-6,
            merge_distance=0.0,
            gate_probability=1.0,
            min_log_clutter=-1e3,
        ),
        BeliefPropagation(tolerance=1e-13),
    )
    truth = experiment.targets.truth(experiment.times, rng=run_stream(0, 0, TRUTH))
    rngs = sensor_streams(0, 0, SCANS, 3)
    tracks: list[plain.Track] = []
    belief = central.initial()
    for k in range(30):
        scans = [
            each.measurements for each in simulate_scans(truth.at(k)[1], experiment.poses, central.sensors, rngs=rngs)
        ]
        tracks = plain.step(tracks, world(), SENSORS, scans, plain.Caps())
        belief, info = central.step(belief, scans, np.zeros((3, 3)), 1.0, k + 1, rng=np.random.default_rng(0))
        assert len(belief.existence) == len(tracks)
        for ours, wanted in zip(np.sort(belief.existence), sorted(track.existence for track in tracks), strict=True):
            assert ours == pytest.approx(wanted, rel=1e-6)
        means = np.array([track.means[0] for track in tracks]).reshape(-1, 4)
        heaviest = np.array([belief.tracks.means[i] for i in belief.tracks.offsets[:-1]]).reshape(-1, 4)
        order, other = np.lexsort(means.T), np.lexsort(heaviest.T)
        np.testing.assert_allclose(heaviest[other], means[order], rtol=1e-6, atol=1e-6)
    assert len(tracks) > 1
    assert math.isnan(info.truncation_error_bound)


def rewards_of(assignment: Any) -> Floats:
    """Of all joint actions, in a crowd where every target may have given any of the measurements."""
    example = crowded(4)
    sensors = tuple(
        replace(sensor, filter=LmbFilter(sensor.filter.targets, sensor.filter.sensor, assignment=assignment))
        for sensor in example.sensors
    )
    evaluator = evaluator_of(replace(example, sensors=sensors))
    return evaluator.joint()(all_joint_actions(evaluator.joint_shape()))


def test_pseudo_updates_associate_as_the_filter_does() -> None:
    ranked, propagated = rewards_of(RankedAssignment()), rewards_of(BeliefPropagation())
    np.testing.assert_allclose(rewards_of(exact), ranked, rtol=1e-9, atol=1e-12)
    assert np.isfinite(propagated).all()
    assert not np.allclose(propagated, ranked, rtol=0.01)


def scene_of(folder: Path, filter: Any, fusion: Any = None) -> Scenario:
    """LMB filters of two sensors, whose decisions ask what their filters would."""
    shutil.copy(OWN, folder)
    own = {"kind": "lmb", "limits": {"min_existence": 0.01}} | filter
    control = {"decision_steps": [4, 8], "horizon_steps": 1, "num_samples": 3, "association": "full"}
    text = changed(
        ("{kind: m_delta_glmb}", json.dumps(own)),
        ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", json.dumps(fusion or {"kind": "clmb"})),
        ("{decision_steps: [4, 8]}", json.dumps(control)),
    )
    (folder / "scene.yaml").write_text(text)
    return load_scenario(folder / "scene.yaml")


CUSTOM = {"kind": "custom", "function": "own_association.py:exact"}


def test_a_scenario_takes_a_function_of_the_users_own(tmp_path: Path) -> None:
    own = run_scenario(scene_of(tmp_path, {"assignment": CUSTOM}), "jdm", seed=1)
    ranked = run_scenario(scene_of(tmp_path, {}), "jdm", seed=1)
    assert [decision.plan.chosen for decision in own.decisions] == [d.plan.chosen for d in ranked.decisions]
    np.testing.assert_allclose(own.ospa, ranked.ospa, rtol=1e-8)
    for fusion in ({"kind": "sequential"}, {"kind": "parallel"}):
        for assignment in (CUSTOM, {"kind": "belief_propagation", "tolerance": 1e-9}):
            record = run_scenario(scene_of(tmp_path, {"assignment": assignment}, fusion), "jdm", seed=1)
            assert np.isfinite(record.ospa).all()


def test_a_campaign_with_it_gives_the_same_bytes_whatever_the_workers(tmp_path: Path) -> None:
    scene_of(tmp_path, {"assignment": CUSTOM})
    spec = 'name = "own"\nscenarios = ["scene.yaml"]\nruns = 2\nplanners = ["jdm", "random"]\n'
    campaign, kept = resolve(parse_spec(spec), tmp_path), []
    for workers in (1, 2):
        outcome = run_campaign(campaign, tmp_path / f"out{workers}", num_workers=workers)
        assert (outcome.num_completed, outcome.failed) == (4, ())
        kept.append(sorted(file.read_bytes() for file in (tmp_path / f"out{workers}").rglob("scans.parquet")))
    assert kept[0]
    assert kept[0] == kept[1]


NOT_OURS = CUSTOM | {"function": "own_association.py:no_marginals"}
REFUSED: list[tuple[Any, Any, str]] = [
    (
        {"assignment": {"kind": "gibbs"}},
        None,
        "kind: expected belief_propagation or ranked or custom, as the filter is lmb",
    ),
    (
        {"kind": "m_delta_glmb", "assignment": {"kind": "belief_propagation"}},
        {"kind": "cm_delta_glmb"},
        "kind: expected gibbs or ranked, as the filter is m_delta_glmb",
    ),
    (
        {"kind": "factored_glmb", "assignment": CUSTOM},
        {"kind": "sequential"},
        "kind: expected ranked, as the filter is factored_glmb",
    ),
    (
        {"assignment": {"kind": "belief_propagation"}},
        {"kind": "central"},
        "kind: expected ranked, as one filter takes the scans of all sensors",
    ),
    ({"assignment": NOT_OURS}, None, "function: expected own_association.py:no_marginals to give a CustomMarginals"),
]


@pytest.mark.parametrize(("filter", "fusion", "fault"), REFUSED)
def test_what_a_scenario_cannot_ask_for(tmp_path: Path, filter: Any, fusion: Any, fault: str) -> None:
    with pytest.raises(VedetteError, match=re.escape(fault)):
        build_experiment(scene_of(tmp_path, filter, fusion))


def test_options_that_are_refused() -> None:
    scene = linear_scene()
    wrong: Any
    for wrong, name in ((Gibbs(), "Gibbs"), (None, "NoneType"), ("ranked", "str")):
        kinds = "RankedAssignment, BeliefPropagation, CustomMarginals"
        wanted = rf"assignment: expected {kinds} or another with to_kernel\(\); got {name}"
        with pytest.raises(InputError, match=wanted):
            replace(scene.lmb_filter(), assignment=wrong)
    with pytest.raises(InputError, match="assignment: expected RankedAssignment or Gibbs; got BeliefPropagation"):
        scene.glmb_filter(assignment=BeliefPropagation())
    with pytest.raises(InputError, match=r"max_sweeps: expected .*at least 1"):
        BeliefPropagation(0)
    with pytest.raises(InputError, match="tolerance: expected a number of at least 0"):
        BeliefPropagation(tolerance=-1.0)


@model_function("association_marginals")
def _not_normalised(offsets: Ints, columns: Ints, log_weights: Floats, params: Floats, out: Floats) -> float:
    for option in range(len(out)):
        out[option] = log_weights[option]
    return 0.0


@model_function("association_marginals")
def _too_far(offsets: Ints, columns: Ints, log_weights: Floats, params: Floats, out: Floats) -> float:
    return out[len(out)]


@model_function("association_marginals")
def _first_of_small_scans(offsets: Ints, columns: Ints, log_weights: Floats, params: Floats, out: Floats) -> float:
    """Right for a trial, and wrong where there are more than two rows."""
    for row in range(len(offsets) - 1):
        share = -math.log(float(offsets[row + 1] - offsets[row]))
        for option in range(offsets[row], offsets[row + 1]):
            out[option] = share if row < 2 else share + params[0]
    return 0.0


def test_functions_that_are_refused() -> None:
    with pytest.raises(InputError, match=r"function: expected a function decorated with @model_function"):
        CustomMarginals(lambda: 0.0)
    with pytest.raises(ModelError, match=r"(?s)'_not_normalised' at .*expected log probabilities that sum to 1"):
        CustomMarginals(_not_normalised)
    with pytest.raises(ModelError, match=r"(?s)'_too_far' at .*reads or writes outside an array"):
        CustomMarginals(_too_far)
    scene = linear_scene()
    tracker = replace(scene.lmb_filter(), assignment=CustomMarginals(_first_of_small_scans, np.array([0.1])))
    belief, _ = tracker.step(tracker.initial(), scene.scans[0], scene.pose, 1.0, 1, rng=np.random.default_rng(0))
    with pytest.raises(ModelError, match="the probabilities of a row's options do not sum to 1"):
        tracker.step(belief, scene.scans[1], scene.pose, 1.0, 2, rng=np.random.default_rng(0))
