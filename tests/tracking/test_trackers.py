"""Trackers: what they do with the scans of a time, by hand and in a run; filters and trackers of one's own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from vedette.control import IndependentPlanner, JointPlanner, MobileSensor, PlanningSettings
from vedette.errors import InputError, NumericalError
from vedette.filters import DeltaGlmbFilter, Filter, Limits, LmbFilter, MultiSensorGlmbFilter, MultiSensorLmbFilter
from vedette.fusion import Clmb
from vedette.models import TargetModel
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_planner, build_sensors
from vedette.simulation import RunRecord, simulate, simulate_scan
from vedette.simulation.experiment import Experiment
from vedette.simulation.journal import STAGES, RunStopped
from vedette.simulation.loop import FILTER, PLANNER, SCANS, TRUTH, run_stream
from vedette.simulation.replay import scans_of
from vedette.tracking import Central, CentralFilter, Distributed, State, Tracker, failed_stage

QUICK = PlanningSettings(num_samples=4, horizon_steps=2, num_threads=1)


def no_score(truth: Any, estimates: Any) -> Any:
    return np.zeros((truth.num_scans, 3))


def run(experiment: Experiment, planner: Any = None) -> RunRecord:
    return simulate(experiment, planner, seed=5, run=2, score=no_score)


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    """paper-e, eight scans, a decision after the fifth."""
    whole = build_experiment(load_scenario("paper-e"))
    return replace(whole, times=whole.times[:8], decision_steps=(5,))


def assert_same(first: RunRecord, second: RunRecord) -> None:
    """To the last bit."""
    assert first.poses.tobytes() == second.poses.tobytes()
    assert len(first.estimates) == len(second.estimates)
    for mine, other in zip(first.estimates, second.estimates, strict=True):
        for name in ("labels", "means", "covs", "existence"):
            assert getattr(mine, name).tobytes() == getattr(other, name).tobytes()
    for decision, again in zip(first.decisions, second.decisions, strict=True):
        assert decision.plan.chosen == again.plan.chosen
        for table, another in zip(decision.plan.tables, again.plan.tables, strict=True):
            assert table.mean.tobytes() == another.mean.tobytes()


def test_the_tracker_equals_a_plain_loop(experiment: Experiment) -> None:
    planner: Any = replace(build_planner(load_scenario("paper-e"), "jdm"), settings=QUICK)  # type: ignore[type-var]
    record = run(experiment, planner)
    tracker: Any = experiment.tracker
    truth = experiment.targets.truth(experiment.times, rng=run_stream(5, 2, TRUTH))
    scan_rngs, filter_rngs = ([run_stream(5, 2, stream, s) for s in range(2)] for stream in (SCANS, FILTER))
    planner_rng = run_stream(5, 2, PLANNER)
    poses, beliefs = experiment.poses, [local.initial() for local in tracker.filters]
    for step in range(1, 9):
        for s, local in enumerate(tracker.filters):
            scan = simulate_scan(truth.at(step - 1)[1], poses[s], local.sensor, rng=scan_rngs[s]).measurements
            beliefs[s], info = local.step(beliefs[s], scan, poses[s], 1.0, step, rng=filter_rngs[s])
            assert record.health.log_likelihood[step - 1, s] == info.log_likelihood
        fused, report = tracker.fusion.fuse(beliefs)
        assert record.health.fusion_log_normaliser[step - 1] == report.log_normaliser
        assert record.poses[step - 1].tobytes() == poses.tobytes()
        assert record.estimates[step - 1].means.tobytes() == experiment.estimate(fused, step).means.tobytes()
        if step == 5:
            plan = planner.plan(State(tuple(beliefs), fused), poses, rng=planner_rng)
            assert record.decisions[0].plan.chosen == plan.chosen
            assert record.decisions[0].plan.tables[0].mean.tobytes() == plan.tables[0].mean.tobytes()
            started, actions = poses, plan.chosen_actions
        if step >= 5:
            poses = started.copy()
            for s, platform in enumerate(experiment.platforms):
                poses[s] = platform.course(started[s], actions[s], np.array([step - 4.0]))[0]


class Own:
    """A filter that is known by its protocol alone; it works with a built-in one, and says what it was told."""

    def __init__(self, inner: Filter) -> None:
        self.inner, self.told = inner, []  # type: ignore[var-annotated]

    @property
    def targets(self) -> TargetModel:
        return self.inner.targets

    @property
    def sensor(self) -> Any:
        return self.inner.sensor

    def initial(self) -> Any:
        return self.inner.initial()

    def step(self, belief: Any, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator) -> Any:
        self.told.append((dt, step))
        return self.inner.step(belief, scan, pose, dt, step, rng=rng)


@pytest.mark.parametrize("kind", ["m_delta_glmb", "lmb"])
@pytest.mark.parametrize("planner", [JointPlanner, IndependentPlanner])
def test_a_custom_filter_tracks_and_decides(experiment: Experiment, kind: str, planner: Any) -> None:
    tracker: Any = experiment.tracker
    if kind == "lmb":
        local = tuple(LmbFilter(one.targets, one.sensor) for one in tracker.filters)
        tracker = Distributed(local, Clmb((0.5, 0.5)))
    own = tuple(Own(local) for local in tracker.filters)
    records = []
    for filters in (tracker.filters, own):
        sensors = tuple(map(MobileSensor, filters, experiment.platforms))
        made = replace(experiment, tracker=replace(tracker, filters=filters))
        records.append(run(made, planner(sensors, tracker.fusion, QUICK)))
    assert_same(*records)
    assert len(records[0].decisions) == 1
    assert [step for _, step in own[0].told] == list(range(1, 9))


@dataclass(frozen=True)
class OfFirst:
    """A central filter that heeds the first sensor alone."""

    local: Any
    sensors: tuple[Any, ...]

    @property
    def targets(self) -> TargetModel:
        return self.local.targets

    def initial(self) -> Any:
        return self.local.initial()

    def step(self, belief: Any, scans: Any, poses: Any, dt: float, step: int, *, rng: np.random.Generator) -> Any:
        assert len(scans) == len(poses) == len(self.sensors)
        return self.local.step(belief, scans[0], poses[0], dt, step, rng=rng)


def test_a_central_filter_is_every_sensors_belief(experiment: Experiment) -> None:
    tracker: Any = experiment.tracker
    local = tracker.filters[0]
    central = Central(OfFirst(local, tracker.sensors))
    assert isinstance(central, Tracker)
    assert isinstance(central.filter, CentralFilter)
    record = run(replace(experiment, tracker=central))
    only: Any = {"platforms": experiment.platforms[:1], "poses": experiment.poses[:1], "first_actions": (None,)}
    only |= {"true_sensors": experiment.true_sensors[:1], "scans_at": None}
    alone = run(replace(experiment, tracker=Distributed((local,)), **only))
    assert_same(replace(record, poses=alone.poses), alone)
    both = record.health.num_hypotheses
    np.testing.assert_array_equal(both, np.repeat(alone.health.num_hypotheses, 2, axis=1))
    assert (record.health.fusion_num_sets == 0).all()
    assert tuple(record.timings) == STAGES
    assert (record.timings["filter"] > 0.0).all()
    assert (record.timings["fusion"] == 0.0).all()


@pytest.mark.parametrize("kind", [MultiSensorGlmbFilter, MultiSensorLmbFilter])
def test_a_central_run_is_the_filter_on_the_scans_of_the_run(experiment: Experiment, kind: Any) -> None:
    tracker = Central(kind(experiment.tracker.targets, experiment.tracker.sensors, Limits(max_hypotheses=50)))
    shorter = replace(experiment, tracker=tracker, times=experiment.times[:4], decision_steps=())
    record = run(shorter)
    belief, rng = tracker.filter.initial(), np.random.default_rng(0)
    drawn: Any = scans_of(record, shorter)
    for step, scans in enumerate(drawn, start=1):
        measurements = [scan.measurements for scan in scans]
        belief, info = tracker.filter.step(belief, measurements, experiment.poses, 1.0, step, rng=rng)
        assert (record.health.log_likelihood[step - 1] == info.log_likelihood).all()
        assert record.estimates[step - 1].means.tobytes() == experiment.estimate(belief, step).means.tobytes()


def test_measurements_that_one_filter_of_all_left_out_are_counted_once(experiment: Experiment) -> None:
    @dataclass(frozen=True)
    class Leaving(OfFirst):
        def step(self, *args: Any, **kwargs: Any) -> Any:
            belief, info = OfFirst.step(self, *args, **kwargs)
            return belief, replace(info, num_duplicates=3, limit_reached=True)

    tracker: Any = experiment.tracker
    health = run(replace(experiment, tracker=Central(Leaving(tracker.filters[0], tracker.sensors)))).health
    assert health.num_duplicates.tolist() == [[3, 0]] * 8
    assert health.limit_reached.all()


def test_a_decision_from_a_central_belief(experiment: Experiment) -> None:
    """Every sensor starts from the one belief: the same decision as of sensors that all believe it."""
    tracker: Any = experiment.tracker
    central = Central(OfFirst(tracker.filters[0], tracker.sensors))
    planner = JointPlanner(build_sensors(load_scenario("paper-e")), tracker.fusion, QUICK)
    record = run(replace(experiment, tracker=central), planner)
    assert len(record.decisions) == 1
    assert record.decisions[0].plan.tables[0].mean.shape == (13, 13)


def test_filters_receive_the_time_between_scans(experiment: Experiment) -> None:
    tracker: Any = experiment.tracker
    own = Own(tracker.filters[0])
    alone, rng = Distributed((own,)), np.random.default_rng(0)
    state = alone.initial()
    assert (state.step, state.time) == (0, None)
    for time in (3.0, 3.5, 7.0):
        state, info = alone.step(state, [np.empty((0, 2))], np.zeros((1, 3)), time, rngs=[rng])
        assert state.time == time
        assert info.fusion is None
        assert list(info.seconds) == ["filter"]
    assert own.told == [(1.0, 1), (0.5, 2), (3.5, 3)]
    assert (state.step, state.local, len(info.filters)) == (3, (state.fused,), 1)


def test_only_what_is_fused_is_sent(experiment: Experiment) -> None:
    tracker: Any = experiment.tracker
    alone, sent = Distributed(tracker.filters[:1]), []
    for each in (tracker, alone):
        num = len(each.sensors)
        rngs = [np.random.default_rng(s) for s in range(num)]
        _, info = each.step(each.initial(), [[]] * num, experiment.poses[:num], 1.0, rngs=rngs)
        sent.append(info.bytes_sent)
    assert len(sent[0]) == 2
    assert min(sent[0]) > 0
    assert sent[1] == ()


def test_feedback_gives_every_sensor_the_fused_belief(experiment: Experiment) -> None:
    tracker: Any = replace(experiment.tracker, feedback=True)  # type: ignore[type-var]
    scans, rngs = [np.array([[0.1, 500.0]])] * 2, [np.random.default_rng(0)] * 2
    state, info = tracker.step(tracker.initial(), scans, experiment.poses, 1.0, rngs=rngs)
    assert all(belief is state.fused for belief in state.local)
    assert list(info.seconds) == ["filter", "fusion"]


@pytest.mark.parametrize("which", ["distributed", "central"])
def test_steps_that_cannot_be_made(experiment: Experiment, which: str) -> None:
    tracker: Any = experiment.tracker
    if which == "central":
        tracker = Central(OfFirst(tracker.filters[0], tracker.sensors))
    rng, empty = np.random.default_rng(0), np.empty((0, 2))
    given = {"scans": [empty, empty], "poses": experiment.poses, "time": 1.0, "rngs": [rng, rng]}
    state, _ = tracker.step(tracker.initial(), *(given[name] for name in ("scans", "poses", "time")), rngs=[rng, rng])
    for change, message in (
        ({"scans": [empty]}, "scans: expected 2, one a sensor; got 1"),
        ({"scans": None}, "scans: expected 2, one a sensor; got None"),
        ({"poses": experiment.poses[:1]}, "poses: expected 2, one a sensor; got 1"),
        ({"rngs": [rng]}, "rngs: expected 2, one a sensor; got 1"),
        ({"time": 0.5}, "time: expected one from that of the last scan on, 1 s; got 0.5"),
        ({"time": np.nan}, "time: expected a finite number"),
    ):
        bad: Any = given | {"time": 2.0} | change
        with pytest.raises(InputError, match=message):
            tracker.step(state, bad["scans"], bad["poses"], bad["time"], rngs=bad["rngs"])
    with pytest.raises(InputError, match="state: expected a State; got GLMB"):
        tracker.step(state.fused, given["scans"], given["poses"], 2.0, rngs=given["rngs"])


def test_trackers_that_cannot_be_made(experiment: Experiment) -> None:
    tracker: Any = experiment.tracker
    first, second = tracker.filters
    with pytest.raises(InputError, match="filters: expected at least one; got none"):
        Distributed(())
    with pytest.raises(InputError, match=r"filters\[1\]: expected a Filter, with targets, sensor"):
        Distributed((first, "filter"), tracker.fusion)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="fusion: expected one for 2 sensors; got none"):
        Distributed((first, second))
    others = replace(second.targets, survival=replace(second.targets.survival))
    with pytest.raises(InputError, match=r"filters\[1\]\.targets: expected the target model of filters\[0\]"):
        Distributed((first, DeltaGlmbFilter(others, second.sensor)), tracker.fusion)
    same = DeltaGlmbFilter(replace(second.targets), second.sensor)  # another object of the same parts
    assert Distributed((first, same), tracker.fusion).targets == first.targets
    with pytest.raises(InputError, match="filter: expected one of several sensors"):
        Central(first)


def test_an_exception_names_its_stage(experiment: Experiment) -> None:
    class Failing(Own):
        def step(self, *_: Any, **__: Any) -> Any:
            raise NumericalError("no hypothesis")

    tracker: Any = experiment.tracker
    broken = replace(tracker, filters=(tracker.filters[0], Failing(tracker.filters[1])))
    scans, rngs = [np.empty((0, 2))] * 2, [np.random.default_rng(0)] * 2
    with pytest.raises(NumericalError) as caught:
        broken.step(broken.initial(), scans, experiment.poses, 1.0, rngs=rngs)
    assert failed_stage(caught.value) == "the filter of sensor 2"
    assert failed_stage(ValueError("elsewhere")) is None


def test_a_filter_without_a_report_is_named(experiment: Experiment) -> None:
    class Silent(Own):
        def step(self, *args: Any, **kwargs: Any) -> Any:
            return super().step(*args, **kwargs)[0], None

    tracker: Any = experiment.tracker
    silent = replace(tracker, filters=(tracker.filters[0], Silent(tracker.filters[1])))
    message = r"in the report of the tracker: TrackerInfo.filters: expected .*; got \['FilterInfo', 'NoneType'\]"
    with pytest.raises(RunStopped, match=message):
        run(replace(experiment, tracker=silent))


def test_a_custom_tracker_needs_no_stages(experiment: Experiment) -> None:
    class OwnTracker:
        """Only the protocol; it gives up after three scans."""

        targets, sensors = experiment.tracker.targets, experiment.tracker.sensors

        def initial(self) -> State:
            return experiment.tracker.initial()

        def step(self, state: State, scans: Any, poses: Any, time: float, *, rngs: Any) -> Any:
            if state.step == 3:
                raise KeyError("lost")
            state, info = experiment.tracker.step(state, scans, poses, time, rngs=rngs)
            return state, replace(info, seconds={})

    with pytest.raises(RunStopped, match=r"stopped at step 4 of 8 .* in the filter: KeyError: 'lost'") as caught:
        run(replace(experiment, tracker=OwnTracker()))
    record = caught.value.record
    assert record is not None
    assert record.num_scans == 3
    assert (record.timings["filter"] > 0.0).all()
