"""Parameters of the sensors in a sensors file that `calibrate` estimates, and the file with the estimates."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from vedette.calibration import Calibration, Parameter, Problem
from vedette.calibration.parameters import with_biases
from vedette.filters import Limits, SequentialLmbFilter, common_target_model
from vedette.internal.quantities import (
    COMPONENTS,
    HEIGHT_DEPENDENT,
    PLACED,
    QUANTITIES,
    USUAL_SHARE,
    in_file,
    is_position,
)
from vedette.internal.reading import read_text
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.kernels.base.types import Floats
from vedette.models import Bias, Region, SensorModel, TargetModel
from vedette.models.clutter import at_raw_measurements
from vedette.recorded import RecordedScans
from vedette.recorded.extents import places_of
from vedette.recorded.scan_times import Bearings, sensor_bias
from vedette.scenarios.build import build_sensors
from vedette.scenarios.dumping import dump_data
from vedette.scenarios.loading import Scenario
from vedette.scenarios.motion_parameters import motion_parameters, with_motion_values
from vedette.scenarios.recorded_data import recorded_scans, recorded_sensors
from vedette.scenarios.sections.base import GaussianMethod
from vedette.scenarios.sections.sensing import Clutter
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sensors_file import EXPECTED_BIRTHS
from vedette.scenarios.yaml_reader import MAX_BYTES, read_yaml
from vedette.tracking import Central, Tracker

# With wide gates, and components merged only if they are alike: where either changes, the likelihood jumps.
_LIMITS = Limits(min_existence=1e-3, gate_probability=1.0 - 1e-12, merge_distance=0.5, max_components=20)
# Standard deviations at and above which a parameter counts as unknown: of clocks, s; of logarithms, of log-odds.
_UNKNOWN_CLOCK, _UNKNOWN_LOG, _UNKNOWN_ODDS = 5.0, 1.0, 4.0
_USUAL_CLOCK, _USUAL_NOISE = 1.0, 0.5  # standard deviations before any recording: of clocks, s; of logarithms of noise
_FAR = 0.9  # quantile of the ranges that a share of is usual as a bias
_WIDENING = 3.0  # times the region, along each axis: noise at its edge stays in it
_SUPPORTED_CLUTTER = (
    "region",
    "around_sensor",
    "measurement_space",
)  # clutter that can be evaluated at the raw measurement
_NOT_CONVERGED = "# The optimiser stopped before it converged: all values are as before."
_MIN_RATE, _MAX_PROBABILITY = 0.01, 0.98  # to start from


def build_problem(
    scenario: Scenario,
    *,
    position: bool = False,
    biases: bool = True,
    bearings: Bearings | None = None,
    prior_scale: float = 1.0,
) -> Problem:
    """Return the calibration problem of a recording: its sensors' parameters, to be estimated.

    The parameters are biases of the measured quantities and of the clock, noise, probability of detection and clutter
    rate, as far as each sensor has them, and of modes of motion the stays and noises. Clocks are relative to that of
    the first sensor. The measurement of the first sensor is the reference if all sensors measure positions; with
    `position`, so are its place and bearing. The likelihood is that of an LMB filter with sequential updates, with the
    motion, survival and births of the scenario.

    Args:
        scenario: from `vedette.scenarios.from_recording`; one of sensors alone, for future scans, has no recording.
        position: True to estimate biases of the other sensors' own places, too.
        biases: False to leave out all biases.
        bearings: in which direction the biases of bearings count if there is no recording.
        prior_scale: factor on the prior standard deviations: 1 degree, 1 s, 1 m/s, and 5 m or 1 % of the range,
            whichever is wider, for biases; half a unit of the logarithm for noise, and one for the motion.
    """
    model, folder = scenario.model, scenario.folder
    sites = tuple(recorded_sensors(model))
    recording = RecordedScans(np.empty(0), 0.0, False, (), np.empty((0, len(sites), 3)), (), (bearings,) * len(sites))
    if model.recording is not None:
        recording = recorded_scans(model, folder, as_told=True)
    parameters, only_positions = list[Parameter](), all(is_position(site.kind) for site in sites)
    for s, sensor in enumerate(model.sensors):
        if not recording.scans or any(scans[s] is not None for scans in recording.scans):
            clockwise = recording.bearings[s] == "north"
            if biases:
                usual = _usual_biases(recording, s, sites[s].kind, model.region.build(), prior_scale)
                parameters += _bias_parameters(s, sensor, sites[s].bias, clockwise, position, only_positions, usual)
            parameters += _model_parameters(s, sensor, prior_scale)
    parameters += motion_parameters(model.motion, prior_scale)
    filters = [sensor.filter for sensor in build_sensors(scenario)]
    region, method = model.region.build(), model.filter.gaussian_method

    wide_region = _widen_region(region)

    def tracker(values: Floats, births: float) -> tuple[Tracker, Floats]:
        targets = _births_per_scan(common_target_model(filters), recording.times, births)
        if parameters and parameters[-1].kind == "motion":
            motion = with_motion_values(model.motion, parameters, values.tolist())
            targets = replace(targets, motion=motion.build(folder, method=method))
        models, added_rates = list[SensorModel](), np.zeros(len(model.sensors))
        biased = with_biases(sites, parameters, values)
        with suppress_unit_warnings():
            for s, sensor in enumerate(_with_values(model.sensors, parameters, values.tolist())):
                changes = _widen_clutter(sensor)
                area = wide_region if sensor.clutter.kind == "region" else region
                added_rates[s] = changes.get("rate", 0.0) - sensor.clutter.rate if changes else 0.0
                sensor = sensor.model_copy(update={"clutter": sensor.clutter.model_copy(update=changes)})
                given = area, _smooth(method, sensor.measurement.kind), folder, targets.motion.components
                built = sensor.build(*given, filters[s].sensor.detection_at)
                if sensor.clutter.kind in _SUPPORTED_CLUTTER:
                    raw = at_raw_measurements(built.clutter, *sensor_bias(biased[s], recording.bearings[s]))
                    built = replace(built, clutter=raw)
                models.append(built)
        return Central(SequentialLmbFilter(targets, tuple(models), _LIMITS)), added_rates

    return Problem(recording, sites, tuple(parameters), tracker, EXPECTED_BIRTHS)


def _smooth(method: GaussianMethod, kind: str) -> GaussianMethod:
    """Return a method without the switch of `auto`, for a kind of measurement that determines a place in the plane.

    A switch makes the likelihood jump, and second differences take a jump for information. Other kinds need it: along
    a direction that they leave open, or above a radar, they bend too much for sigma points.
    """
    return "ukf" if method == "auto" and kind in PLACED and kind not in HEIGHT_DEPENDENT else method


def _births_per_scan(targets: TargetModel, times: Floats, learnt: float) -> TargetModel:
    """Return the targets with the expected births of an average scan interval at every scan, whenever it comes.

    learnt: replaces a number that is to be learnt, and would change with the parameters. Births that count per period
    become more the later a scan comes, which would make later clocks more likely.
    """
    birth = targets.birth
    measured = birth.from_measurements
    if measured is None:
        return targets
    if isinstance(measured.expected, str):
        measured = replace(measured, expected=learnt)
    elif birth.period is None or len(times) < 2:
        return targets
    else:
        share = float(times[-1] - times[0]) / (len(times) - 1) / birth.period
        measured = replace(measured, expected=share * measured.expected)
    return replace(targets, birth=replace(birth, period=None, from_measurements=measured))


def _widen_clutter(sensor: Sensor) -> dict[str, float]:
    """Return fields that make the clutter of a sensor reach farther, at the same density.

    Clutter must not end where noise at the edge of the view may take a measurement: no clutter would be possible there,
    and the likelihood would jump.
    """
    clutter, folded = sensor.clutter, getattr(sensor.measurement, "max_unambiguous_range_rate", None)
    if clutter.kind not in ("region", "around_sensor"):
        return {}
    if folded is not None:  # a bias may take a range rate out of the interval in which it is measured
        most = clutter.max_range_rate or folded
        wider = _wider_figure(clutter)
        return wider | {"rate": _WIDENING * wider["rate"], "max_range_rate": _WIDENING * most}
    return _wider_figure(clutter)


def _wider_figure(clutter: Clutter) -> dict[str, float]:
    """Return fields of clutter in a larger part of the plane, at the same density."""
    if clutter.kind == "region":
        return {"rate": _WIDENING**2 * clutter.rate}
    size = "radius" if clutter.radius is not None else "half_side"
    wider = {"rate": _WIDENING**2 * clutter.rate, size: _WIDENING * getattr(clutter, size)}
    if size == "radius":  # the area of a sector of a square depends on the heading
        wider |= {"rate": wider["rate"] * 180.0 / clutter.half_width_deg, "half_width_deg": 180.0}
    return wider


def _widen_region(region: Region) -> Region:
    """Return the region widened about its middle."""
    sides = []
    for low, high in ((region.x_min, region.x_max), (region.y_min, region.y_max)):
        middle, half_side = 0.5 * (low + high), 0.5 * _WIDENING * (high - low)
        sides += [middle - half_side, middle + half_side]
    return Region(*sides)


def _bias_parameters(
    s: int,
    sensor: Sensor,
    given: Bias,
    clockwise: bool,
    position: bool,
    only_positions: bool,
    usual: Mapping[str, float],
) -> Iterator[Parameter]:
    """Return the biases of a sensor: of its measurement, its clock and, with `position`, its place.

    usual: prior standard deviations.
    """
    components = COMPONENTS[sensor.measurement.kind]
    names = [*components]
    if s > 0:  # a common shift in time, shift in space or turn of all sensors changes nothing
        names += ["clock", *(("x", "y") if position and "x" not in components else ())]
    elif only_positions:
        names = []
    elif position and "bearing" in components:
        names.remove("bearing")
    for name in names:
        if name == "clock":
            yield Parameter(s, "bias", name, name, "s", given.clock, 1.0, "plain", _UNKNOWN_CLOCK, usual[name])
            continue
        quantity = QUANTITIES[name]
        start, per_si = getattr(given, name) * quantity.per_si, quantity.per_si
        per_si = -per_si if clockwise and quantity.is_angle else per_si
        yield Parameter(
            s, "bias", name, in_file(name), quantity.unit, start, per_si, "plain", quantity.unknown, usual[name]
        )


def _usual_biases(recording: RecordedScans, s: int, kind: str, region: Region, scale: float) -> dict[str, float]:
    """Return the prior standard deviation of each bias of a sensor, in its unit; wider for lengths if it sees far."""
    rows = [
        np.hypot(*(places_of(scan, poses[s], kind) - poses[s, :2]).T)
        for scans, poses in zip(recording.scans, recording.poses, strict=True)
        if (scan := scans[s]) is not None
    ]
    sides = region.x_max - region.x_min, region.y_max - region.y_min  # without measurements, they count
    ranges = np.concatenate(rows) if sum(map(len, rows)) else np.array([max(sides)])
    far = USUAL_SHARE * float(np.quantile(ranges, _FAR))
    usual = {name: max(each.usual_bias, far if each.unit == "m" else 0.0) for name, each in QUANTITIES.items()}
    return {name: scale * std for name, std in {**usual, "clock": _USUAL_CLOCK}.items()}


def _model_parameters(s: int, sensor: Sensor, scale: float) -> Iterator[Parameter]:
    """Return the parameters of noise, detection and clutter that the sections give as numbers.

    scale: factor on the prior standard deviation of noise.
    """
    noise, components = sensor.noise, COMPONENTS[sensor.measurement.kind]
    for i, component in enumerate(components):
        quantity = QUANTITIES[component]
        unit, per_si, name = quantity.si, 1.0, ""
        if noise.kind == "range_dependent":
            name, unit, per_si = f"sigma_{in_file(component)}", quantity.unit, quantity.per_si
            start = getattr(noise, name)
        elif noise.kind in ("constant", "by_axis"):
            name, start = f"std.{i}", noise.std[i]
        if name:
            yield Parameter(
                s, "noise", component, f"noise.{name}", unit, start, per_si, "log", _UNKNOWN_LOG, scale * _USUAL_NOISE
            )
    if (extent := getattr(noise, "extent", 0.0)) > 0.0:
        yield Parameter(
            s, "noise", "extent", "noise.extent", "m", extent, 1.0, "log", _UNKNOWN_LOG, scale * _USUAL_NOISE
        )
    if (probability := getattr(sensor.detection, "probability", None)) is not None:
        start = min(max(probability, 1.0 - _MAX_PROBABILITY), _MAX_PROBABILITY)
        yield Parameter(s, "detection", "", "detection.probability", "", start, 1.0, "logit", _UNKNOWN_ODDS)
    if (rate := getattr(sensor.clutter, "rate", None)) is not None:
        start = max(rate, _MIN_RATE)
        yield Parameter(s, "clutter", "", "clutter.rate", "per scan", start, 1.0, "log", _UNKNOWN_LOG)


def _with_values(
    sensors: Sequence[Sensor], parameters: Sequence[Parameter], values: Sequence[float]
) -> tuple[Sensor, ...]:
    """Return the sections of the sensors with these values of their noise, detection and clutter."""
    updated = list(sensors)
    for parameter, value in zip(parameters, values, strict=True):
        if parameter.kind not in ("bias", "motion"):
            section = getattr(updated[parameter.sensor], parameter.kind)
            _, name, *indices = parameter.name.split(".")
            current = getattr(section, name)
            items = tuple(value if str(i) in indices else item for i, item in enumerate(current)) if indices else value
            section = section.model_copy(update={name: items})
            updated[parameter.sensor] = updated[parameter.sensor].model_copy(update={parameter.kind: section})
    return tuple(updated)


def calibrated_text(scenario: Scenario, sensors: FilePath, calibration: Calibration, folder: FilePath | None) -> str:
    """Return the sensors file with the estimates.

    Parameters without a better estimate keep their values; comments are lost. If the optimiser did not converge, so do
    all parameters, and the first line is a comment.

    Args:
        scenario: of the recording.
        sensors: the sensors file that the scenario was made with.
        calibration: the estimates.
        folder: of the new file; if it is not that of the old one, files that it names get absolute paths. None: any.
    """
    data = dict(read_yaml(read_text(sensors, "sensors file", MAX_BYTES), str(sensors)).data)
    biases = [sensor.bias.model_dump(exclude_defaults=True) for sensor in scenario.model.sensors]
    found = [each for each in calibration.estimates if calibration.converged and each.is_better]
    parameters = [each.parameter for each in found]
    values = [float(f"{each.value:.7g}") for each in found]  # far more digits than are accurate
    for each, value in zip(parameters, values, strict=True):
        if each.kind == "bias":
            biases[each.sensor][each.name] = value
    sections = _with_values(scenario.model.sensors, parameters, values)
    data["sensors"] = [
        {
            **{**given, "bias": bias},
            **{kind: getattr(section, kind).model_dump(mode="json") for kind in ("noise", "detection", "clutter")},
        }
        for given, section, bias in zip(data["sensors"], sections, biases, strict=True)
    ]
    if any(each.kind == "motion" for each in parameters):
        motion = with_motion_values(scenario.model.motion, parameters, values)
        data["motion"] = motion.model_dump(mode="json", exclude_unset=True)
    is_same = folder is not None and folder.resolve() == sensors.parent.resolve()
    text = dump_data(data, None if is_same else sensors.parent)
    return text if calibration.converged else f"{_NOT_CONVERGED}\n{text}"
