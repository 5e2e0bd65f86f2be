"""Number of detections that a new target needs until it is reported, by the models of a scenario."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path as FilePath
from types import FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vedette.internal.text import pluralise
from vedette.kernels.base.types import VELOCITY, Floats
from vedette.scenarios.diagnostics import Path
from vedette.scenarios.loading import Scenario
from vedette.scenarios.recorded_data import recorded_scans
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.birth_labels import birth_probabilities
from vedette.scenarios.sections.fusion import FULL_INFORMATION_FUSIONS, SINGLE_BELIEF_FUSIONS
from vedette.scenarios.sections.tracking import UNLABELLED, Filter
from vedette.scenarios.sections.undetected_intensity import has_intensity, undetected_anywhere
from vedette.scenarios.trust import custom_code

if TYPE_CHECKING:  # importing the models is slow
    from vedette.models import MotionModel, SensorModel

MOST_LATE = 0.5  # share of the births
_POINTS_PER_SIDE, _MAX_DETECTIONS = 5, 300
_SETTLED = 30  # detections of each sensor after which the covariance hardly changes
_ERROR = 2.0  # detections; of runs with 1e-6 to 1 births per scan
_MIN_DETECTION = 0.1  # a place is covered if a sensor has this probability of detection there


class NewTargets(NamedTuple):
    """New targets at places that the sensors cover: birth sites and points of the region."""

    needed: Floats  # (num,) number of detections until the existence exceeds one half; inf: never
    given: Floats  # (num,) expected detections of a target in the run, in its life, or in view, whichever is shortest
    seconds: Floats  # (num,) mean time from the birth until the target is reported
    births: Floats  # (num,) expected births in the run
    reported: Floats  # (num,) expected number of these that are reported

    @property
    def late_share(self) -> float:
        """Share of the births that need more detections than they give, beyond the error of these numbers."""
        return float(self.births[self.needed > self.given + _ERROR].sum() / self.births.sum())

    def describe(self) -> str:
        """Return medians over the places in words."""
        needed, given, seconds = np.median(self[:3], axis=1)
        if math.isinf(needed):
            return "no number of detections suffices to report a new target"
        numbers = f"{pluralise(round(needed), 'detection')} ({seconds:.2g} s)"
        given_in = f"about {given:.2g} in the run, its life and the view"
        return f"a new target needs about {numbers} to be reported, and gives {given_in}"


class _Source(NamedTuple):
    """Births at one place, before their first detection."""

    mean: Floats
    cov: Floats
    steps: Floats  # number of births at each scan of the run
    area: float  # of births anywhere, m^2; 0 for a site
    existence: float = 0.0  # of a label that the first measurement starts; 0: by the odds of that measurement


def new_target_warnings(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """Yield a warning if most new targets need more detections than they give."""
    found = new_targets(scenario)
    if found is not None and found.late_share > MOST_LATE:
        text = f"{found.describe()}; births are rare, or measurements imprecise, for this clutter"
        yield ("birth",), f"{text}: check birth, and clutter, noise and detection of the sensors"


def new_targets(scenario: Scenario, num_scans: int | None = None) -> NewTargets | None:
    """Return the detections that new targets need and give.

    The odds of existence start as P_D times the density of undetected targets over that of clutter. Each further
    detection adds its expected log likelihood ratio, from a Kalman recursion of the innovation covariance, and
    1 / P_D - 1 misses subtract theirs. Sensors have their first poses, or those in the middle of a recording.

    num_scans: number of scans of the run; None: that of the scenario. Returns None if the filter has no existence
    probabilities, if no place is covered, and for custom code, which is not run.
    """
    model, folder, scan = scenario.model, scenario.folder, scenario.model.time.step_period
    if not isinstance(model.filter, Filter) or model.filter.kind in UNLABELLED or custom_code(model):
        return None
    from vedette.models import CellGrid

    region, num, placed = model.region.build(), num_scans or model.time.num_steps, _placed(model, folder)
    motion, survival = model.motion.build(folder), model.survival.build(folder)
    nodes = CellGrid(region, _POINTS_PER_SIDE, _POINTS_PER_SIDE).states(motion.state_dim, 1)[:, 0]
    width = math.sqrt(region.area * np.mean([bool(_views(placed, node)) for node in nodes]))
    is_moving = any(sensor.platform.top_speed > 0.0 for sensor in model.sensors)
    has_one_belief = model.fusion.kind in (*SINGLE_BELIEF_FUSIONS, *FULL_INFORMATION_FUSIONS)
    ends, rows = scan * np.arange(num, 0, -1), []
    for source in (each for each in _sources(model, nodes, num) if each.steps.any()):
        views, options = _views(placed, source.mean), []
        death = (1.0 - plain(survival.function)(source.mean, scan, survival.params)) / scan
        speed = 0.0 if is_moving else math.hypot(*source.mean[VELOCITY], *np.sqrt(np.diag(source.cov)[VELOCITY]))
        lasts = min(1.0 / death if death else math.inf, width / speed if speed else math.inf)
        for group in filter(None, [views] if has_one_belief else [[view] for view in views]):
            rate = sum(view.rate for view in group)
            needed = _needed(model, motion, source, group, rate + death)
            options.append((needed / rate, needed, rate))
        if options:
            seconds, needed, rate = min(options)
            reported = (source.steps * (ends >= seconds)).sum() * math.exp(-seconds / lasts)
            rows.append((needed, rate * min(lasts, ends[0]), seconds, source.steps.sum(), reported))
    return NewTargets(*np.array(rows).T) if rows else None


class _View(NamedTuple):
    """A sensor that covers a place."""

    sensor: SensorModel
    pose: Floats
    detection: float  # probability there
    rate: float  # detections per second


_Placed = tuple["SensorModel", Floats, float]  # a sensor, its pose, and seconds from scan to scan


def _placed(model: ScenarioModel, folder: FilePath) -> list[_Placed]:
    """Return the sensors at their first poses, or at those in the middle of a recording."""
    scan, region, method = model.time.step_period, model.region.build(), model.filter.gaussian_method
    poses = [np.array(sensor.turning_pose, np.float64) for sensor in model.sensors]
    periods = [scan * sensor.scans.steps(scan)[0] for sensor in model.sensors]
    if model.recording is not None:
        recording = recorded_scans(model, folder)
        poses = list(recording.poses[len(recording.times) // 2])
        numbers = np.array([[each is not None for each in scans] for scans in recording.scans]).sum(axis=0)
        periods = (len(recording.times) * scan / np.maximum(numbers, 1)).tolist()
    given = region, method, folder, model.motion.components
    return list(zip((each.build(*given) for each in model.sensors), poses, periods, strict=True))


def _views(placed: Sequence[_Placed], state: Floats) -> list[_View]:
    """Return the sensors that cover a place, the most frequent one first."""
    views = [
        _View(sensor, pose, chance, chance / period)
        for sensor, pose, period in placed
        if (chance := plain(sensor.detection.function)(state, pose, sensor.detection.params)) >= _MIN_DETECTION
    ]
    return sorted(views, key=lambda view: -view.rate)


def _sources(model: ScenarioModel, nodes: Floats, num_scans: int) -> Iterator[_Source]:
    """Yield births at the sites, and around the nodes of the region."""
    birth, scan = model.birth.build(model.motion, model.region), model.time.step_period
    active = np.array([birth.is_active(step) for step in range(1, num_scans + 1)], np.float64)
    for number, mean, cov in zip(birth_probabilities(model), birth.means, birth.covs, strict=True):
        yield _Source(mean, cov, number * active, 0.0)
    measured, anywhere = birth.from_measurements, undetected_anywhere(model, birth)
    if measured is None:
        return
    rate = anywhere.first_rate if anywhere is not None else float(measured.expected) / (birth.period or scan)
    if anywhere is not None and anywhere.is_learnt:  # without births it falls to about one in the run
        rate = min(rate, 1.0 / (num_scans * scan))
    steps, area = np.full(num_scans, rate * scan / len(nodes)), model.region.build().area / len(nodes)
    clutter = max(getattr(sensor.clutter, "rate", 0.0) for sensor in model.sensors)
    existence = 0.0 if has_intensity(model) else min(measured.max_existence, rate * scan / (1.0 + clutter))
    yield from (_Source(node, measured.cov, steps, area, existence) for node in nodes)


def _needed(model: ScenarioModel, motion: MotionModel, source: _Source, views: Sequence[_View], rate: float) -> float:
    """Return the number of detections until the log odds of existence exceed 0; rate: 1/s, of them and of death."""
    from vedette.kernels.steps.undetected import WIDE

    state, cov, number = source.mean, source.cov.copy(), float(source.steps.max())
    if source.steps.all():  # those born before and not yet detected
        number /= model.time.step_period * rate
    odds, due, now = math.log(number), np.zeros(len(views)), 0.0
    assert isinstance(model.filter, Filter)  # see `new_targets`
    floor = model.filter.limits.min_log_clutter
    if source.existence:
        odds = math.log(source.existence / (1.0 - source.existence))
    elif source.area:
        cov[:2, :2] *= WIDE**2
        odds += math.log(2.0 * math.pi / source.area) + 0.5 * float(np.linalg.slogdet(cov[:2, :2])[1])
    for detections in range(1, _MAX_DETECTIONS + 1):
        i = int(due.argmin())
        (sensor, pose, chance, detection_rate), dt = views[i], float(due[i] - now)
        due[i] += chance**0.25 / detection_rate  # about the geometric mean of the time between detections
        if detections == 1 and source.existence:
            continue
        if dt > 0.0:
            cov, now = _predicted(motion, state, cov, dt), now + dt
        slope, noise, clutter = _measured(sensor, state, pose)
        dim, innovation = sensor.meas_dim, slope @ cov @ slope.T + noise
        # Log of the number of false measurements in the effective volume of the predicted density.
        log_false = max(clutter, floor) + 0.5 * float(np.linalg.slogdet(2.0 * math.pi * innovation)[1])
        if detections == 1:
            odds += math.log(chance) - log_false - (0.0 if source.area else 0.5 * dim)
        else:  # a false measurement may stand in for a missed one
            missed = max(1.0 - chance / (1.0 + math.exp(log_false)), 1e-300)
            gain = math.log(chance * math.exp(-log_false - 0.5 * dim) + missed)
            gain += (1.0 - chance) / chance * math.log(missed)
            odds += gain
            if gain <= 0.0 and detections > _SETTLED * len(views):
                break
        if odds > 0.0:
            return float(detections)
        cov = cov - cov @ slope.T @ np.linalg.solve(innovation, slope @ cov)
    return math.inf


def _predicted(motion: MotionModel, state: Floats, cov: Floats, dt: float) -> Floats:
    """Return the covariance of a state `dt` seconds later."""
    from vedette.models.probe import central_differences

    slope = central_differences(plain(motion.transition), (state, dt, motion.transition_params), cov.shape, 0)
    noise = np.empty_like(cov)
    plain(motion.process_noise_cov)(state, dt, motion.noise_params, noise)
    return slope @ cov @ slope.T + noise


def _measured(sensor: SensorModel, state: Floats, pose: Floats) -> tuple[Floats, Floats, float]:
    """Return the Jacobian of a measurement, the covariance of its noise, and the log clutter intensity there."""
    from vedette.models.probe import central_differences

    dim, function, angular = sensor.meas_dim, plain(sensor.measurement.function), sensor.measurement.angular
    args, expected, noise = (state, pose, sensor.measurement.params), np.empty(dim), np.empty((dim, dim))
    function(*args, expected)
    plain(sensor.noise.function)(state, pose, sensor.noise.params, noise)
    slope = central_differences(function, args, (dim, len(state)), angular)
    return slope, noise, plain(sensor.clutter.log_intensity)(expected, pose, sensor.clutter.params)


@cache
def plain(function: Any) -> Any:
    """Return a model function as plain Python that calls no compiled function, so that a check compiles nothing."""
    source = getattr(function, "py_func", None)
    if source is None:
        return function
    known = ((name, source.__globals__.get(name)) for name in source.__code__.co_names)
    compiled = {name: plain(value) for name, value in known if hasattr(value, "py_func")}
    return FunctionType(source.__code__, {**source.__globals__, **compiled}, source.__name__)
