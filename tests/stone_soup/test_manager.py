"""The sensor manager beside Stone Soup's own, and what it hands to the planner."""

from __future__ import annotations

import copy
import datetime
import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stonesoup")

from stonesoup.movable.grid import NStepDirectionalGridMovable
from stonesoup.movable.max_speed import MaxSpeedActionableMovable
from stonesoup.platform.base import FixedPlatform, MovingPlatform
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.sensor.action.dwell_action import DwellActionsGenerator
from stonesoup.sensor.radar.radar import RadarBearingRange, RadarRotatingBearingRange
from stonesoup.sensormanager.action import ActionableProperty
from stonesoup.sensormanager.base import BruteForceSensorManager
from stonesoup.sensormanager.reward import UncertaintyRewardFunction
from stonesoup.types.angle import Angle
from stonesoup.types.groundtruth import GroundTruthState
from stonesoup.types.state import GaussianState, State, StateVector
from stonesoup.types.track import Track
from stonesoup.updater.kalman import ExtendedKalmanUpdater

from stone_soup_scene import MOTION, PRIOR, SECOND, START
from vedette.control import CauchySchwarzReward, JointPlanner, MobileSensor, PlanningSettings
from vedette.densities import LMB, TrackTable
from vedette.errors import InputError
from vedette.filters import LmbFilter
from vedette.fusion import ParallelUpdate
from vedette.models import Region, region_clutter
from vedette.stonesoup import PlanningSensorManager, convert, convert_pose
from vedette.stonesoup.manager import StoneSoupActions
from vedette.tracking import State as Believed

CLUTTER = region_clutter(1.0, Region(-1e3, 1e3, -1e3, 1e3), "bearing_range")
UNTIL = START + SECOND


def rotating(x: float, y: float, dwell: float, kind: Any = RadarRotatingBearingRange) -> Any:
    radar = kind(
        position_mapping=(0, 2),
        noise_covar=np.diag([0.01**2, 5.0**2]),
        ndim_state=4,
        position=StateVector([[x], [y]]),
        orientation=StateVector([[0.0], [0.0], [0.3]]),
        rpm=10,
        fov_angle=math.radians(30.0),
        dwell_centre=StateVector([[dwell - 0.3]]),
        max_range=1000.0,
        resolution=Angle(math.radians(15.0)),
    )
    radar.timestamp = START
    return radar


def of(sensors: Any) -> Any:
    return convert(MOTION, list(sensors), births=PRIOR, clutter=CLUTTER, prob_detection=0.95)


def track(x: float, y: float, variance: float, **metadata: Any) -> Track:
    state = GaussianState([x, 0.0, y, 0.0], np.diag([variance, 4.0, variance, 4.0]), timestamp=START)
    return Track([state], init_metadata=metadata, id=f"{x} {y}")


TRACKS = [track(250.0, 160.0, 400.0), track(200.0, 10.0, 2500.0)]


@pytest.mark.parametrize("reward", [None, CauchySchwarzReward()])
def test_radars_look_where_brute_force_has_them_look(reward: Any) -> None:
    radars = [rotating(0.0, 0.0, 0.0), rotating(500.0, 0.0, math.pi / 2.0)]
    ours = PlanningSensorManager(of(radars), sensors=set(radars), reward=reward)
    (config,), rewards = ours.choose_actions(set(TRACKS), UNTIL, return_reward=True)
    uncertainty = UncertaintyRewardFunction(KalmanPredictor(MOTION), ExtendedKalmanUpdater(None))
    theirs = BruteForceSensorManager(set(radars), reward_function=uncertainty)
    _, best = theirs.choose_actions(set(TRACKS), UNTIL, return_reward=True)
    assert uncertainty(config, set(TRACKS), UNTIL) == pytest.approx(best[0])  # several look at both targets
    assert rewards.shape == (1,)
    assert ours.plan is not None
    assert ours.plan.expected_rewards[0][0] == rewards[0]

    # The actions are theirs: the radars carry them out, and then see both targets.
    for radar, actions in config.items():
        radar.add_actions(actions)
        radar.act(UNTIL)
    truths = {GroundTruthState(one.state_vector, timestamp=UNTIL) for one in TRACKS}
    assert {found.groundtruth_path for radar in radars for found in radar.measure(truths)} == truths


def test_the_plan_is_that_of_the_planner_itself() -> None:
    """Given the poses that the radar may have, the belief and the models by hand."""
    radar = rotating(0.0, 0.0, 0.0)
    models, tracks = of([radar]), [track(250.0, 160.0, 400.0, existence=0.7), TRACKS[1]]
    ours = PlanningSensorManager(models, sensors={radar}, settings=PlanningSettings(horizon_steps=2), seed=5)
    ours.choose_actions(set(tracks), UNTIL)

    class Turned:
        columns = ("pointing",)

        def actions(self, pose: Any) -> Any:
            return np.radians(np.arange(-60.0, 61.0, 15.0))[:, None]

        def course(self, pose: Any, action: Any, times: Any) -> Any:
            turned = np.sign(action[0]) * np.minimum(abs(action[0]), 2.0 * math.pi * 10.0 / 60.0 * times)
            return np.column_stack([np.zeros((len(times), 2)), turned])

    ordered = sorted(tracks, key=lambda one: one.id)
    means = models.layout.states([np.ravel(one.mean).astype(float) for one in ordered])
    covs = models.layout.covs([one.covar for one in ordered])
    chances = np.array([one.metadata.get("existence", 0.99) for one in ordered])
    belief = LMB(TrackTable.from_gaussians([[1, 0], [1, 1]], means, covs), np.log(chances / (1.0 - chances)))
    sensor = MobileSensor(LmbFilter(models.targets, models.sensors[0]), Turned())
    planner = JointPlanner((sensor,), ParallelUpdate(), PlanningSettings(horizon_steps=2, horizon_period=0.5))
    state = Believed((belief,), belief, 1, 0.0)
    plan = planner.plan(state, np.zeros((1, 3)), rng=np.random.default_rng(5))
    assert ours.plan is not None
    assert ours.plan.chosen == plan.chosen
    np.testing.assert_allclose(ours.plan.tables[0].mean, plan.tables[0].mean, rtol=1e-9)


def test_poses_are_those_that_actions_lead_to() -> None:
    radar = rotating(30.0, -20.0, 1.0)
    choices = StoneSoupActions(radar, None, START, UNTIL)
    times = np.array([0.3, 0.7, 1.0])
    courses = choices.courses(choices.pose, choices.actions(choices.pose), times)
    np.testing.assert_array_equal(choices.pose, convert_pose(radar.measurement_model))
    for course, chosen in zip(courses, choices.chosen, strict=True):
        for seconds, pose in zip(times.tolist(), course, strict=True):
            twin = copy.deepcopy(radar)
            twin.add_actions(chosen[radar])
            twin.act(START + datetime.timedelta(seconds=seconds))
            np.testing.assert_allclose(
                pose, convert_pose(twin.measurement_model), atol=1e-6
            )  # times are in microseconds
    assert float(radar.dwell_centre[0, 0]) == 0.7  # nothing was done with it


def on_board(movable: Any, **fields: Any) -> Any:
    radar = RadarBearingRange(
        position_mapping=(0, 2), noise_covar=np.diag([0.01**2, 5.0**2]), ndim_state=4, max_range=250.0
    )
    radar.timestamp = START
    platform = movable if movable.__class__.__name__ == "MovingPlatform" else FixedPlatform(movement_controller=movable)
    platform.add_sensor(radar)
    return platform, radar


@pytest.mark.parametrize("kind", ["max speed", "grid"])
def test_a_platform_goes_where_it_sees_a_target(kind: str) -> None:
    place = {"states": [State([[0.0], [0.0]], timestamp=START)], "position_mapping": (0, 1), "action_mapping": (0, 1)}
    movable = (
        MaxSpeedActionableMovable(**place, resolution=50.0, angle_resolution=np.pi / 2, max_speed=100.0)
        if kind == "max speed"
        else NStepDirectionalGridMovable(**place, n_steps=1, step_size=1, resolution=100.0)
    )
    platform, radar = on_board(movable)
    ours = PlanningSensorManager(of([radar]), platforms={platform})
    (config,) = ours.choose_actions({track(0.0, 330.0, 100.0)}, UNTIL)
    assert config[radar] == ()
    np.testing.assert_allclose(np.ravel(config[platform][0].target_value).astype(float), [0.0, 100.0], atol=1e-9)
    assert np.ravel(platform.position).tolist() == [0.0, 0.0]


def test_tracks_of_an_earlier_time_are_moved_on() -> None:
    radar = rotating(0.0, 0.0, 0.0)
    radar.timestamp = START + SECOND
    late = Track([GaussianState([200.0, 40.0, 0.0, 0.0], np.diag([9.0, 1.0, 9.0, 1.0]), timestamp=START)])
    ours = PlanningSensorManager(of([radar]), sensors={radar})
    belief = ours._belief({late}, START + SECOND)
    moved = KalmanPredictor(MOTION).predict(late, timestamp=START + SECOND)
    np.testing.assert_allclose(belief.tracks.means[0], ours.models.layout.states(np.asarray(moved.mean, float).T)[0])
    np.testing.assert_allclose(belief.tracks.covs[0], ours.models.layout.covs([moved.covar])[0])


def test_nobody_is_anywhere() -> None:
    radar = rotating(0.0, 0.0, 0.0)
    ours = PlanningSensorManager(of([radar]), sensors={radar}, decisions="independent")
    (config,) = ours.choose_actions(set(), UNTIL)
    assert set(config) == {radar}


class Loud(RadarRotatingBearingRange):
    power: StateVector = ActionableProperty(
        doc="", generator_cls=DwellActionsGenerator, default=None, generator_kwargs_mapping={}
    )


def test_what_no_planner_here_knows_is_named() -> None:
    radar, other = rotating(0.0, 0.0, 0.0), rotating(9.0, 0.0, 0.0)
    models = of([radar])
    with pytest.raises(InputError, match="sensors: expected the 1 that models were converted of; got RadarRotating"):
        PlanningSensorManager(models, sensors={other})
    with pytest.raises(InputError, match="sensors: expected the 1 that models were converted of; got 0"):
        PlanningSensorManager(models)
    with pytest.raises(InputError, match=r"reward_function: expected none: rewards are of vedette.control"):
        PlanningSensorManager(models, sensors={radar}, reward_function=lambda *_: 0.0)
    with pytest.raises(InputError, match="decisions: expected one of"):
        PlanningSensorManager(models, sensors={radar}, decisions="alone")
    with pytest.raises(InputError, match=r"models: expected what convert\(\) made; got int"):
        PlanningSensorManager(3, sensors={radar})
    ours = PlanningSensorManager(models, sensors={radar})
    with pytest.raises(InputError, match="nchoose: expected 1, the best; got 2"):
        ours.choose_actions(set(TRACKS), UNTIL, nchoose=2)
    with pytest.raises(InputError, match="timestamp: expected a time after the tracks and sensors"):
        ours.choose_actions(set(TRACKS), START)
    loud = rotating(0.0, 0.0, 0.0, Loud)
    with pytest.raises(InputError, match="Loud: actionable property: expected one of dwell_centre, position"):
        StoneSoupActions(loud, None, START, UNTIL)


def test_a_platform_carries_one_sensor_and_may_go_its_own_way() -> None:
    movable = MaxSpeedActionableMovable(states=[State([[0.0], [0.0]], timestamp=START)], position_mapping=(0, 1))
    platform, radar = on_board(movable)
    second = on_board(copy.deepcopy(movable))[1]
    models = of([radar, second])
    platform.add_sensor(second)
    with pytest.raises(InputError, match="platforms: expected one sensor on each; got 2 on one"):
        PlanningSensorManager(models, platforms={platform})

    sailing = MovingPlatform(
        states=[State([[0.0], [10.0], [0.0], [0.0]], timestamp=START)],
        position_mapping=(0, 2),
        transition_model=MOTION,
    )
    platform, radar = on_board(sailing)
    choices = StoneSoupActions(radar, platform, START, UNTIL)
    np.testing.assert_allclose(choices.courses(choices.pose, np.zeros((1, 1)), np.array([1.0]))[0], [[10.0, 0.0, 0.0]])
