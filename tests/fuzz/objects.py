"""Every public object that Python code makes, with arguments that are good, and what is then asked of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from vedette import control, divergence, filters, fusion, models, platforms, simulation, tracking
from vedette.densities import LMB, as_glmb
from vedette.fusion import FieldsOfView, FusionLimits

Data = dict[str, Any]
STATE = np.array([10.0, 20.0, 1.0, -1.0])
POSES = np.array([[0.0, -50.0, 0.0], [50.0, 0.0, 1.0]])


class Made(NamedTuple):
    """How a public object is made, and calls of what was made: of a method, with its arguments."""

    make: Callable[..., Any]
    arguments: Data
    calls: tuple[tuple[str, Data], ...] = ()


def lmb() -> LMB:
    return LMB.from_bernoullis([[1, 0]], [0.7], STATE[np.newaxis], np.eye(4)[np.newaxis])


def sensor() -> models.SensorModel:
    clutter = models.region_clutter(2.0, models.Region(-100.0, 100.0, -100.0, 100.0), "bearing_range")
    noise = models.constant_noise([0.02, 2.0])
    return models.SensorModel(models.bearing_range(), noise, models.constant_detection(0.9), clutter)


def targets() -> models.TargetModel:
    birth = models.BirthModel([0.1], STATE[np.newaxis], np.eye(4)[np.newaxis] * 25.0)  # type: ignore[arg-type]
    return models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.98), birth)


def everything() -> dict[str, Made]:
    """By name."""
    return {**dict(_models()), **dict(_filters()), **dict(_fusions()), **dict(_trackers()), **dict(_control())}


def _models() -> Iterator[tuple[str, Made]]:
    region = models.Region(-100.0, 100.0, -100.0, 100.0)
    box = {"rate": 2.0, "low": [-3.0, 0.0], "high": [3.0, 100.0], "angular": [True, False]}
    given: list[tuple[Callable[..., Any], Data]] = [
        (models.Region, {"x_min": 0.0, "x_max": 1.0, "y_min": 0.0, "y_max": 1.0}),
        (models.constant_velocity, {"sigma_v": 1.0, "noise_model": "discrete_white", "method": "auto"}),
        (models.coordinated_turn, {"sigma_v": 1.0, "sigma_turn_rate": 0.1, "method": "auto"}),
        (models.constant_survival, {"prob_survival": 0.9}),
        (models.constant_detection, {"prob_detection": 0.9}),
        (models.gaussian_detection, {"sigma": 100.0}),
        (models.limited_range, {"prob_detection": 0.9, "max_range": 100.0, "outside": 0.0}),
        (models.limited_sector, {"prob_detection": 0.9, "max_range": 9.0, "half_width_rad": 0.5, "outside": 0.0}),
        (models.soft_sector, {"prob_detection": 0.9, "max_range": 9.0, "half_width_rad": 0.5, "range_slope": 1.0}),
        (models.camera, {"prob_detection": 0.9, "max_range": 100.0, "reference_half_width_rad": 0.5}),
        (models.constant_noise, {"stds": [0.1, 2.0]}),
        (models.axis_noise, {"std": [1.0, 2.0], "quadratic_growth": [0.0, 0.1]}),
        (
            models.range_dependent_noise,
            {"sigma_range": 1.0, "eta_range": 0.0, "sigma_bearing": 0.1, "eta_bearing": 0.0},
        ),
        (models.region_clutter, {"rate": 2.0, "region": region, "kind": "position"}),
        (models.measurement_space_clutter, box),
        (models.around_sensor, {"rate": 2.0, "kind": "position", "radius": 9.0, "half_width_rad": 3.0}),
        (models.MeasurementBirth, {"expected": 0.5, "max_existence": 0.1, "std": [1.0] * 4}),
        (models.BirthModel, {"existence": [0.1], "means": [STATE], "covs": [np.eye(4)], "steps": frozenset([1])}),
        (models.CellGrid.covering, {"region": region, "cell_size": 20.0}),
        (models.CellGrid, {"region": region, "columns": 3, "rows": 3}),
        (platforms.HeadingPlatform, {"speed": 5.0, "headings_deg": [0.0, 90.0], "relative": False}),
        (platforms.GridPlatform, {"length": 5.0, "speed": 5.0, "directions_deg": [0.0, 90.0], "allow_staying": True}),
        (platforms.Waypoints, {"points": [[0.0, 0.0], [1.0, 1.0]], "speed": 5.0, "closed": False}),
        (
            platforms.Pointing,
            {"pointings_deg": [0.0], "relative": False, "half_widths_deg": [9.0], "turn_rate_deg": 3.0},
        ),
        (platforms.MountedPlatform, {"platform": platforms.Stationary(), "pointing": platforms.Pointing([0.0])}),
        (platforms.Sequences, {"platform": platforms.HeadingPlatform(5.0), "depth": 2, "period": 1.0}),
        (platforms.Actions, {"columns": ("heading_deg",), "values": np.zeros((1, 1))}),
        (
            models.SensorModel,
            {name: getattr(sensor(), name) for name in ("measurement", "noise", "detection", "clutter", "method")},
        ),
        (models.TargetModel, {name: getattr(targets(), name) for name in ("motion", "survival", "birth")}),
        (
            models.UndetectedModel,
            {"grid": models.CellGrid.covering(region, 20.0), "expected": 1.0, "birth_rate": 0.1, "speed": 1.0},
        ),
    ]
    for make, arguments in given:
        yield make.__qualname__, Made(make, arguments)


def _filters() -> Iterator[tuple[str, Made]]:
    yield "Limits", Made(filters.Limits, vars_of(filters.Limits()))
    scan = {"scan": [[0.1, 20.0]], "pose": POSES[0], "dt": 1.0, "step": 3, "rng": np.random.default_rng(1)}
    for kind in ("DeltaGlmbFilter", "FactoredGlmbFilter", "LmbFilter", "PhdFilter", "CphdFilter", "CbMemberFilter"):
        make = getattr(filters, kind)
        more: Data = {"assignment": filters.Gibbs(10), "marginalised": True} if kind[0] == "D" else {}
        more |= {"max_split_error": 0.1, "max_factor_labels": 5} if kind[0] == "F" else {}
        arguments = {"targets": targets(), "sensor": sensor(), "limits": filters.Limits(), **more}
        belief = make(**arguments).initial()
        yield kind, Made(make, arguments, (("step", {"belief": belief, **scan}),))
    scans = {"scans": [[[0.1, 20.0]], None], "poses": POSES, "dt": 1.0, "step": 3, "rng": np.random.default_rng(1)}
    for kind in ("MultiSensorGlmbFilter", "MultiSensorLmbFilter", "SequentialFactoredFilter", "SequentialLmbFilter"):
        make = getattr(filters, kind)
        arguments = {"targets": targets(), "sensors": (sensor(), sensor()), "limits": filters.Limits()}
        yield kind, Made(make, arguments, (("step", {"belief": make(**arguments).initial(), **scans}),))


def vars_of(thing: Any) -> Data:
    return {name: getattr(thing, name) for name in type(thing).__dataclass_fields__}


def _views() -> FieldsOfView:
    return FieldsOfView((sensor(), sensor()), POSES, (True, True), lmb())


def _fusions() -> Iterator[tuple[str, Made]]:
    fuse = ("fuse", {"beliefs": [lmb(), lmb()], "views": _views()})
    glmbs = ("fuse", {"beliefs": [as_glmb(lmb(), max_hypotheses=10)[0]] * 2, "views": None})
    weights = (0.5, 0.5)
    yield (
        "Clmb",
        Made(
            fusion.Clmb,
            {
                "weights": weights,
                "mixture_power": "auto",
                "missing_existence": 1e-4,
                "limits": FusionLimits(),
                "field_of_view_weighting": True,
            },
            (fuse,),
        ),
    )
    yield (
        "CmDeltaGlmb",
        Made(
            fusion.CmDeltaGlmb,
            {"weights": weights, "mixture_power": "auto", "missing_log_weight": -9.0, "limits": FusionLimits()},
            (glmbs,),
        ),
    )
    yield (
        "ArithmeticAverage",
        Made(
            fusion.ArithmeticAverage,
            {"weights": weights, "field_of_view_weighting": True, "limits": FusionLimits()},
            (fuse,),
        ),
    )
    yield (
        "ParallelUpdate",
        Made(fusion.ParallelUpdate, {"weights": weights, "missing_existence": 1e-4, "limits": FusionLimits()}, (fuse,)),
    )
    yield (
        "LabelMatchedFusion",
        Made(fusion.LabelMatchedFusion, {"rule": fusion.Clmb(weights), "gate_probability": 0.99}, (fuse,)),
    )
    yield "FusionLimits", Made(limited_fusion, FusionLimits()._asdict(), (fuse,))
    yield (
        "FieldsOfView",
        Made(
            FieldsOfView,
            {"sensors": (sensor(), sensor()), "poses": POSES, "scanned": (True, True), "prediction": lmb()},
        ),
    )
    yield "match_labels", Made(fusion.match_labels, {"beliefs": [lmb(), lmb()], "gate_probability": 0.99})
    for name in ("cauchy_schwarz", "log_inner_product"):
        yield name, Made(getattr(divergence, name), {"a": lmb(), "b": lmb(), "unit_volume": 1.0})
    yield "renyi", Made(divergence.renyi, {"p": lmb(), "q": lmb(), "order": 0.5})
    yield "power_integral", Made(divergence.power_integral, {"p": lmb(), "q": lmb(), "a": 1.0, "b": 1.0})


def limited_fusion(**limits: Any) -> fusion.Clmb:
    return fusion.Clmb((0.5, 0.5), limits=FusionLimits(**limits))


def _trackers() -> Iterator[tuple[str, Made]]:
    local = filters.LmbFilter(targets(), sensor())
    rngs = [np.random.default_rng(1)] * 2
    scans = {"scans": [[[0.1, 20.0]], None], "poses": POSES, "time": 3.0, "rngs": rngs}
    rule, network = fusion.Clmb((0.5, 0.5)), tracking.Network(100.0)
    central = filters.SequentialLmbFilter(targets(), (sensor(), sensor()))
    region = models.Region(-100.0, 100.0, -100.0, 100.0)
    undetected = models.UndetectedModel(models.CellGrid.covering(region, 20.0), 1.0, 0.1, "uniform", 1.0)
    given: list[tuple[Any, Data]] = [
        (tracking.Distributed, {"filters": (local, local), "fusion": rule, "feedback": True, "min_detection": 0.1}),
        (tracking.Central, {"filter": central}),
        (tracking.BeliefNetwork, {"filters": (local, local), "fusion": rule, "network": network, "merging": rule}),
        (tracking.ScanNetwork, {"filter": central, "network": network, "merging": rule}),
        (tracking.UndetectedTargetTracker, {"tracker": tracking.Central(central), "model": undetected}),
    ]
    for make, arguments in given:
        state = make(**arguments).initial()
        yield make.__name__, Made(make, arguments, (("step", {"state": state, **scans}),))
    yield (
        "Network",
        Made(
            tracking.Network,
            {"radio_range": 9.0, "max_hops": None, "link_loss_probability": 0.1, "delay": 0, "consensus_rounds": None},
        ),
    )


def _control() -> Iterator[tuple[str, Made]]:
    mobile = control.MobileSensor(filters.LmbFilter(targets(), sensor()), platforms.HeadingPlatform(5.0, [0.0, 90.0]))
    settings = control.PlanningSettings(horizon_steps=1, num_samples=2, num_threads=1)
    state = tracking.State((lmb(), lmb()), lmb(), 1, 1.0)
    region = models.Region(-100.0, 100.0, -100.0, 100.0)
    plan = ("plan", {"state": state, "poses": POSES, "rng": np.random.default_rng(1)})
    shared: Data = {"sensors": (mobile, mobile), "fusion": fusion.Clmb((0.5, 0.5)), "settings": settings}
    shared |= {"reward": control.CauchySchwarzReward(), "constraints": (control.Separation(5.0),)}
    planners: list[tuple[Any, Data]] = [
        (control.JointPlanner, {**shared, "search": control.AutomaticSearch(), "notes": ()}),
        (control.IndependentPlanner, shared),
        (
            control.HorizonPlanner,
            {**shared, "depth": 2, "period": 2.0, "search": control.BeamSearch(), "budget": 9, "discount": 0.5},
        ),
        (control.RandomPlanner, {name: shared[name] for name in ("sensors", "settings", "constraints")}),
        (control.ConstantPlanner, {"actions": (platforms.Actions.of(heading_deg=30.0),) * 2}),
    ]
    for make, arguments in planners:
        yield make.__name__, Made(make, arguments, (plan,))
    yield "PlanningSettings", Made(control.PlanningSettings, vars_of(settings))
    yield "MobileSensor", Made(control.MobileSensor, {"filter": mobile.filter, "platform": mobile.platform})
    others: list[tuple[Any, Data]] = [
        (control.AutomaticSearch, {"max_joint_actions": 9}),
        (control.ExhaustiveSearch, {"max_joint_actions": 9}),
        (control.CoordinateAscent, {"num_restarts": 1}),
        (control.SequentialGreedy, {"order": "sensor_order"}),
        (control.CrossEntropy, {"num_samples": 9, "elite_fraction": 0.1, "smoothing": 0.5, "max_rounds": 3}),
        (control.BeamSearch, {"beam_width": 3}),
        (control.TreeSearch, {"exploration": 0.3, "rollout": "random"}),
        (control.CauchySchwarzReward, {"unit_volume": 1.0}),
        (control.RenyiReward, {"order": 0.5}),
        (control.ExpectedGospaReward, {"cutoff": 9.0}),
        (control.ExpectedLossReward, {"cutoff": 9.0}),
        (control.PeecsReward, {"share": 0.5, "cutoff": 9.0}),
        (control.StayInside, {"region": region}),
        (control.KeepOut, {"area": np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]])}),
        (control.Separation, {"distance": 5.0}),
        (control.VoidProbability, {"radius": 5.0, "probability": 0.9}),
        (control.void_probability, {"belief": lmb(), "centres": np.zeros((1, 2)), "radius": 5.0}),
        (simulation.TrueSensor, {"model": sensor(), "first_detection": None, "detection_of": "state"}),
    ]
    for make, arguments in others:
        yield make.__name__, Made(make, arguments)
