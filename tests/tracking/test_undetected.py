"""The intensity of targets not yet found, carried beside any tracker."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from tracking.scenes import SURVIVAL, filters, rngs, scans_of, sensor, targets
from vedette import models
from vedette.densities import LMB, UndetectedIntensity
from vedette.errors import InputError, ModelError
from vedette.filters import Limits, SequentialLmbFilter
from vedette.fusion import Clmb, LabelMatchedFusion
from vedette.models.functions import model_function
from vedette.tracking import (
    BeliefNetwork,
    Central,
    Distributed,
    Network,
    ScanNetwork,
    State,
    Tracker,
    UndetectedTargetTracker,
    failed_stage,
)

REGION = models.Region(-200.0, 200.0, -100.0, 100.0)
GRID = models.CellGrid(REGION, 8, 5)
WORLD, SENSORS = targets(), (sensor(max_range=120.0), sensor(prob=0.6))
POSES = np.array([[-60.0, 20.0, 0.0], [150.0, -80.0, 1.0]])
CLMB = Clmb((0.5, 0.5))
TRACKERS: dict[str, Tracker] = {
    "distributed": Distributed(filters(WORLD, SENSORS), CLMB, feedback=True),
    "central": Central(SequentialLmbFilter(WORLD, SENSORS)),
    "scans": ScanNetwork(SequentialLmbFilter(WORLD, SENSORS), Network(delay=1), LabelMatchedFusion(CLMB)),
    "beliefs": BeliefNetwork(filters(WORLD, SENSORS), CLMB, Network(), LabelMatchedFusion(CLMB)),
}


def undetected(**changes: Any) -> models.UndetectedModel:
    own: dict[str, Any] = {"birth_rate": 0.05, "birth_density": "boundary", "speed": 6.0, **changes}
    return models.UndetectedModel(GRID, own.pop("expected", 3.0), **own)


def follow(tracker: Any, times: Any = (1.0, 2.0, 4.5, 5.0)) -> list[Any]:
    """States and reports of some steps; the first sensor does not scan at the second."""
    truth, draws, noise = np.zeros((1, 4)), rngs(2, 3), np.random.default_rng(5)
    state, found = tracker.initial(), []
    for step, time in enumerate(times, start=1):
        scans = scans_of(truth, SENSORS, POSES, noise)
        if step == 2:
            scans[0] = None
        found.append(tracker.step(state, scans, POSES, time, rngs=draws))
        state = found[-1][0]
    return found


def assert_same_bits(one: Any, other: Any) -> None:
    for name in ("labels", "offsets", "log_weights", "means", "covs"):
        assert getattr(one.tracks, name).tobytes() == getattr(other.tracks, name).tobytes()
    assert one.existence_logit.tobytes() == other.existence_logit.tobytes()


@pytest.mark.parametrize("name", TRACKERS)
def test_beliefs_are_the_same_to_the_last_bit(name: str) -> None:
    tracker = TRACKERS[name]
    searching = UndetectedTargetTracker(tracker, undetected())
    assert isinstance(searching, Tracker)
    assert searching.targets is tracker.targets
    assert searching.sensors == tracker.sensors
    for (mine, told), (other, before) in zip(follow(searching), follow(tracker), strict=True):
        assert_same_bits(mine.fused, other.fused)
        for belief, another in zip(mine.local, other.local, strict=True):
            assert_same_bits(belief, another)
        assert (mine.step, mine.time) == (other.step, other.time)
        assert mine.undetected is not None
        assert other.undetected is None
        assert told.bytes_sent == before.bytes_sent
        assert told.seconds.keys() == {*before.seconds, "targets not yet found"}


@pytest.mark.parametrize("survival", [None, 0.9])
def test_the_intensity_is_that_of_plain_numpy(survival: float | None) -> None:
    model = undetected(survival=survival)
    nodes, weights = GRID.states(4), GRID.node_weights()
    expected, last = np.full(40, 3.0 / 40), None
    times = (1.0, 2.0, 4.5, 5.0)
    for step, (time, (state, _)) in enumerate(
        zip(times, follow(UndetectedTargetTracker(TRACKERS["central"], model), times), strict=True)
    ):
        if last is not None:
            lives = SURVIVAL if survival is None else survival ** (time - last)
            expected = model.predict(expected, time - last, lives)
        for s, one in enumerate(SENSORS):
            if (step, s) != (1, 0):
                expected = expected * [1.0 - weights @ one.detection.prob(own, POSES[s]) for own in nodes]
        np.testing.assert_allclose(state.undetected.expected, expected, rtol=1e-12)
        assert state.undetected.grid == GRID
        last = time


@model_function("prob_survival")
def _by_place(state, dt, params):
    return 0.5 if state[0] < 0.0 else 0.9 + state[2]


def test_survival_is_evaluated_at_rest_at_cell_centres() -> None:
    world = replace(WORLD, survival=models.SurvivalModel(_by_place))
    model = models.UndetectedModel(GRID, 3.0)
    searching = UndetectedTargetTracker(Central(SequentialLmbFilter(world, SENSORS)), model)
    state = replace(searching.initial(), time=1.0, step=1)
    after, _ = searching.step(state, [None, None], POSES, 2.0, rngs=rngs(2))
    assert after.undetected is not None
    np.testing.assert_allclose(after.undetected.table[:, :4], 0.5 * 3.0 / 40, rtol=1e-15)
    np.testing.assert_allclose(after.undetected.table[:, 4:], 0.9 * 3.0 / 40, rtol=1e-15)


def test_before_the_first_scan_no_time_passes() -> None:
    expected = np.arange(40.0)
    searching = UndetectedTargetTracker(TRACKERS["central"], undetected(expected=expected))
    state = searching.initial()
    assert state.undetected is not None
    np.testing.assert_array_equal(state.undetected.expected, expected)
    after, _ = searching.step(state, [None, None], POSES, 7.0, rngs=rngs(2))
    assert after.undetected is not None
    np.testing.assert_array_equal(after.undetected.expected, expected)


def test_a_view_smaller_than_a_cell_still_counts() -> None:
    tiny = sensor(max_range=12.0)
    searching = UndetectedTargetTracker(Central(SequentialLmbFilter(WORLD, (tiny,))), undetected())
    poses = np.array([[-175.0 + 14.0, 0.0, 0.0]])  # away from the middle of its cell
    after, _ = searching.step(searching.initial(), [np.empty((0, 2))], poses, 1.0, rngs=rngs(1))
    assert after.undetected is not None
    share = after.undetected.expected / (3.0 / 40)
    assert 0.0 < 1.0 - share[16] < 0.6
    assert (np.delete(share, 16) == 1.0).all()


def test_states_of_another_making_are_refused() -> None:
    searching = UndetectedTargetTracker(TRACKERS["central"], undetected())
    state, scans = searching.initial(), [None, None]
    with pytest.raises(InputError, match=r"state\.undetected: expected an UndetectedIntensity, as of initial\(\)"):
        searching.step(replace(state, undetected=None), scans, POSES, 1.0, rngs=rngs(2))
    other = UndetectedIntensity.uniform(models.CellGrid(REGION, 2, 2), 1.0)
    with pytest.raises(InputError, match=r"state\.undetected: expected one of the model's grid") as raised:
        searching.step(replace(state, undetected=other), scans, POSES, 1.0, rngs=rngs(2))
    assert failed_stage(raised.value) == "the targets not yet found"
    with pytest.raises(InputError, match="scans: expected 2, one a sensor; got 1"):
        searching.step(state, [None], POSES, 1.0, rngs=rngs(2))


def test_it_needs_a_tracker_and_a_model() -> None:
    wrong: Any = "tracker"
    with pytest.raises(InputError, match="tracker: expected a Tracker, with targets"):
        UndetectedTargetTracker(wrong, undetected())
    with pytest.raises(InputError, match=r"UndetectedModel\.birth_rate: expected a number, as it is the beliefs of"):
        UndetectedTargetTracker(TRACKERS["central"], undetected(birth_rate="learnt"))
    with pytest.raises(InputError, match="model: expected an UndetectedModel; got tracker"):
        UndetectedTargetTracker(TRACKERS["central"], wrong)


@model_function("prob_detection")
def _no_probability(state, pose, params):
    return 1.2


def test_an_invalid_detection_probability_is_reported() -> None:
    bad = replace(SENSORS[0], detection=models.DetectionModel(_no_probability))
    searching = UndetectedTargetTracker(Central(SequentialLmbFilter(targets(()), (bad,))), undetected())
    with pytest.raises(ModelError, match=r"probability is not in \[0, 1\]"):
        searching.step(searching.initial(), [np.empty((0, 2))], POSES[:1], 1.0, rngs=rngs(1))


@dataclass
class _Own:
    """A tracker of one's own, of anything."""

    targets: Any = WORLD
    sensors: Any = SENSORS

    def initial(self) -> State:
        return State(("nothing", "nothing"), "nothing")

    def step(self, state: State, scans: Any, poses: Any, time: float, *, rngs: Any) -> Any:
        return replace(state, step=state.step + 1, time=time), TRACKERS["central"].step(
            TRACKERS["central"].initial(), scans, poses, time, rngs=rngs
        )[1]


def test_undetected_targets_with_a_custom_tracker() -> None:
    state, _ = follow(UndetectedTargetTracker(_Own(), undetected()))[-1]
    (other, _) = follow(UndetectedTargetTracker(TRACKERS["central"], undetected()))[-1]
    assert state.fused == "nothing"
    assert state.undetected.expected.tobytes() == other.undetected.expected.tobytes()


def _without_limits(**limits: Any) -> UndetectedTargetTracker:
    own = SequentialLmbFilter(WORLD, SENSORS, Limits(**limits))
    return UndetectedTargetTracker(Central(own), models.UndetectedModel(GRID, 0.0))


def _state(searching: UndetectedTargetTracker, mean: Any, std: float, existence: float = 0.7) -> State:
    belief = LMB.from_bernoullis([[1, 0]], [existence], [[*mean, 0.0, 0.0]], [np.diag([std, std, 1.0, 1.0]) ** 2])
    return replace(searching.initial(), local=(belief,) * 2, fused=belief, step=1, time=1.0)


@pytest.mark.parametrize("scanned", [False, True])
def test_dropped_labels_become_undetected_targets(scanned: bool) -> None:
    dropping, keeping = _without_limits(max_position_std=1.0), _without_limits()
    state, scans = _state(dropping, (170.0, -80.0), 3.0), [np.empty((0, 2)) if scanned else None] * 2
    after, _ = dropping.step(state, scans, POSES, 2.0, rngs=rngs(2))
    kept, _ = keeping.step(state, scans, POSES, 2.0, rngs=rngs(2))
    assert after.undetected is not None
    assert kept.undetected is not None
    assert after.fused.tracks.num_tracks == 0
    # The expected number of the filter that keeps it, and in the cell where that has it.
    np.testing.assert_allclose(after.undetected.total, kept.fused.existence.sum(), rtol=1e-9)
    assert after.undetected.expected.argmax() == GRID.cells_at(kept.fused.tracks.means)[0]
    assert kept.undetected.total == 0.0


def test_dropped_labels_are_where_scans_missed_them() -> None:
    dropping = _without_limits(max_position_std=20.0)
    state = _state(dropping, (60.0, 20.0), 30.0)  # the first sensor sees to x = 60, and surely
    after, _ = dropping.step(state, [np.empty((0, 2)), None], POSES, 2.0, rngs=rngs(2))
    assert after.undetected is not None
    draws = np.random.default_rng(1).multivariate_normal([60.0, 20.0], np.eye(2) * (30.0**2 + 1.0), 200_000)
    missed = 1.0 - SENSORS[0].detection.prob(np.column_stack([draws, draws * 0.0]), POSES[0])
    alive = 0.7 * SURVIVAL
    expected = alive * missed.mean() / (1.0 - alive + alive * missed.mean())
    inside = GRID.cells_at(draws) >= 0
    share = missed[inside].sum() / missed.sum()
    np.testing.assert_allclose(after.undetected.total, expected * share, rtol=0.03)


def test_an_unexplained_measurement_counts_as_undetected() -> None:
    birth = models.MeasurementBirth(1.0, 0.04, np.full(4, 5.0))
    world = replace(WORLD, birth=replace(WORLD.birth, from_measurements=birth))
    searching = UndetectedTargetTracker(Central(SequentialLmbFilter(world, SENSORS)), models.UndetectedModel(GRID, 0.0))
    at = np.array([[-170.0, 80.0]])
    after, _ = searching.step(searching.initial(), [at, None], POSES, 1.0, rngs=rngs(2))
    assert after.undetected is not None
    np.testing.assert_allclose(after.undetected.expected[GRID.cells_at(at)], 0.04, rtol=1e-6)
    np.testing.assert_allclose(after.undetected.total, 0.04, rtol=1e-6)
