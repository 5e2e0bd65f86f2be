"""A scenario in a few words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from vedette.internal.quantities import COMPONENTS, QUANTITIES
from vedette.internal.text import pluralise
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.birth import Birth
from vedette.scenarios.sections.control import Control
from vedette.scenarios.sections.courses import directions_as_courses
from vedette.scenarios.sections.fusion import AnyFusion, CustomFusion
from vedette.scenarios.sections.platforms import GridMoves
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.tracking import AnyFilter, Filter
from vedette.scenarios.sections.true_sensors import BiasSection
from vedette.scenarios.sections.undetected import UndetectedSection
from vedette.scenarios.sections.undetected_intensity import searches_by_default
from vedette.scenarios.sections.world import RegionSection
from vedette.scenarios.wording import describe_settings, name_in_words, plain_values, scans_in_words, short_value

if TYPE_CHECKING:
    from vedette.platforms import Compass


def summary_line(scenario: Scenario) -> str:
    """Return the scenario on one line: `40 scans, 4 targets, 2 sensors; filter delta_glmb, fusion ...`."""
    model = scenario.model
    targets = model.targets
    what = pluralise(len(targets.tracks), "target") if targets.kind == "scripted" else f"{targets.kind} targets"
    decisions = pluralise(len(model.decision_steps), "decision")
    sizes = f"{pluralise(model.time.num_steps, 'scan')}, {what}, {pluralise(len(model.sensors), 'sensor')}"
    return f"{sizes}; filter {model.filter.kind}, fusion {model.fusion.kind}, {decisions}"


def summary_rows(model: ScenarioModel) -> list[tuple[str, str]]:
    """Return the settings of the whole scenario: name of each section and its settings."""
    region, time, control = model.region, model.time, model.control
    end = time.start + (time.num_steps - 1) * time.step_period
    return [
        ("scans", f"{time.num_steps}, every {time.step_period:g} s from {time.start:g} to {end:g} s"),
        *(() if model.origin is None else (("origin", describe_settings(model.origin)),)),
        ("region", _bounds(region)),
        ("motion", _motion(model.motion)),
        ("survival", describe_settings(model.survival)),
        ("births", _births(model.birth)),
        ("filter", _filter(model.filter)),
        ("fusion", _fusion(model.fusion)),
        *(() if model.network is None else (("network", describe_settings(model.network)),)),
        *(() if model.undetected is None else (("not yet found", _undetected(model.undetected)),)),
        *((("not yet found", _searched(model)),) if searches_by_default(model) else ()),
        ("estimate", describe_settings(model.estimates_by)),
        (
            "decisions",
            f"after {scans_in_words(model.decision_steps, time.num_steps)}" if model.decision_steps else "none",
        ),
        ("horizon", f"{pluralise(model.horizon[0], 'step')} of {model.horizon[1]:g} s"),
        ("objective", _objective(control)),
        ("search", describe_settings(control.search)),
        *(("constraint", _constraint(section)) for section in control.constraints),
        *((("sensors move", start),) if (start := first_motion(model)) else ()),
        ("pseudo-scans", f"{control.ideal_measurements} measurements"),
        ("OSPA", describe_settings(model.ospa)),
        *((f"planner {name}", describe_settings(section)) for name, section in model.planners.items()),
        *((f"metric {name}", describe_settings(section)) for name, section in model.metrics.items()),
    ]


def _motion(section: Section) -> str:
    """Return its settings; the root of a spectral density has another unit than an acceleration."""
    if modes := getattr(section, "modes", None):
        stays = [(name, mode.stay_s) for name, mode in modes.items()]
        return "modes " + ", ".join(
            f"{name} (for ever)" if stay is None else f"{name} ({stay:g} s)" for name, stay in stays
        )
    continuous = getattr(section, "noise_model", "") == "continuous_white"
    return describe_settings(section).replace("m/s^2", "m/s^1.5") if continuous else describe_settings(section)


def first_motion(model: ScenarioModel) -> str | None:
    """Return from when the sensors move; None if none does, or not all from the same time."""
    moving = (sensor for sensor in model.sensors if sensor.platform.kind != "stationary")
    waits = {sensor.stationary_until_first_decision for sensor in moving}
    return f"from the {'first decision' if waits.pop() else 'start'} on" if len(waits) == 1 else None


def _objective(control: Control) -> str:
    """Return the reward as `expected loss (cutoff 100 m, order 1; no sampling)`."""
    values = "; ".join(filter(None, (", ".join(plain_values(control.reward)), _samples(control))))
    return f"{name_in_words(control.reward.kind)} ({values})"


def _samples(control: Control) -> str:
    if control.reward.kind == "expected_loss":
        return "no sampling"
    if control.confidence is None:
        return pluralise(control.num_samples, "sample")
    near = f", to {100.0 * control.indifference:g} %" if control.indifference else ""
    time = "" if control.max_seconds is None else f" or {control.max_seconds:g} s"
    return f"samples until certain at {100.0 * control.confidence:g} %{near}, at most {control.max_samples}{time}"


def _bounds(region: RegionSection) -> str:
    return f"x {region.x_min:g} to {region.x_max:g} m, y {region.y_min:g} to {region.y_max:g} m"


def _constraint(section: Section) -> str:
    """Return its settings; for an area its bounds, or its number of corners."""
    area, polygon = getattr(section, "region", None), getattr(section, "polygon", None)
    words = describe_settings(section if polygon is None else section.model_copy(update={"polygon": (), "holes": ()}))
    if polygon is not None:
        words += f", polygon of {len(polygon)} corners"
        words += f", {pluralise(len(holes), 'hole')}" if (holes := getattr(section, "holes", ())) else ""
    return words if area is None else f"{words}, {_bounds(area)}"


def _searched(model: ScenarioModel) -> str:
    at_rate = "" if model.birth.from_measurements is None else ", at a learnt birth rate"
    return f"searched for where targets may be born{at_rate}"


def _undetected(section: UndetectedSection) -> str:
    return describe_settings(section) + ("" if section.region is None else f", in {_bounds(section.region)}")


def _filter(section: AnyFilter) -> str:
    assignment = f", {section.assignment.kind} assignment" if isinstance(section, Filter) else ""
    return ", ".join([section.kind, *plain_values(section)]) + assignment


def _births(section: Birth) -> str:
    sites = f"{pluralise(len(section.sites), 'site')}, {_steps(section.steps)}" if section.sites else "no site"
    measured = section.from_measurements
    if measured is None:
        return sites
    number = "at a learnt rate" if isinstance(measured.expected, str) else f"{measured.expected:g} per scan"
    return f"{sites}; {number} from measurements"


_DESCRIPTIONS = {
    "none": "none",
    "central": "central: one filter takes the scans of all sensors",
    "sequential": "sequential: one belief takes the sensors' scans in turn",
    "parallel": "parallel: each sensor updates one prediction, by which their posteriors are divided",
}


def _fusion(section: AnyFusion) -> str:
    if isinstance(section, CustomFusion):
        return describe_settings(section)
    if section.kind in _DESCRIPTIONS:
        return _DESCRIPTIONS[section.kind]
    words = [section.kind, "equal weights" if section.weights is None else f"weights {short_value(section.weights)}"]
    if section.field_of_view_weighting:
        words.append("by views")
    if section.kind != "arithmetic_average":
        words.append(f"{section.mixture_power} powers")
    if section.matching == "assignment":
        words.append("labels matched by assignment")
    return ", ".join([*words, "feedback" if section.feedback else "no feedback"])


def _steps(steps: Literal["every"] | Sequence[int]) -> str:
    if steps == "every":
        return "every step"
    return ("step " if len(steps) == 1 else "steps ") + ", ".join(map(str, steps))


def sensing_rows(sensor: Sensor, north: Compass | None = None) -> list[tuple[str, str]]:
    """Return a sensor's platform, measurement and models; directions are compass courses if `north` is given."""
    carriers = [section for section in (sensor.platform, getattr(sensor.platform, "platform", None)) if section]
    words = [
        _platform(one, None if north is None else directions_as_courses(one, north, sensor.position))
        for one in carriers
    ]
    truth = _true_differences(sensor)
    assumed = "assumed: " if any(name.startswith("true ") and name.endswith("detection") for name, _ in truth) else ""
    return [
        ("platform", ", on: ".join(words)),
        ("measures", name_in_words(sensor.measurement.kind)),
        ("noise", _noise(sensor.noise, sensor.measurement.kind)),
        ("detection", assumed + describe_settings(sensor.detection)),
        ("clutter", describe_settings(sensor.clutter)),
        *truth,
    ]


def _platform(section: Section, replaced: Mapping[str, tuple[str, object]] | None) -> str:
    if isinstance(section, GridMoves):
        way = f"steps of {section.length:g} m at {section.speed:g} m/s in {len(section.directions_deg)} directions"
        return f"{way}, or stay" if section.allow_staying else way
    return describe_settings(section, replaced)


def _noise(section: Section, measured: str) -> str:
    """Return its settings; a standard deviation for each component has the component's name and unit."""
    stds, components = getattr(section, "std", ()), COMPONENTS.get(measured, ())
    if not isinstance(stds, tuple) or len(stds) != len(components):
        return describe_settings(section)
    pairs = zip(components, stds, strict=True)
    named = ", ".join(f"{name_in_words(name)} {std:g} {QUANTITIES[name].si}" for name, std in pairs)
    return ", ".join(
        [f"{name_in_words(getattr(section, 'kind', ''))}, std {named}", *plain_values(section, {"std": ("std", None)})]
    )


def _bias(section: BiasSection) -> str:
    """Return its values other than 0."""
    none = [name for name in BiasSection.model_fields if getattr(section, name) == 0.0]
    return describe_settings(section, {name: (name, None) for name in none}) or "none"


def _true_differences(sensor: Sensor) -> list[tuple[str, str]]:
    """Return its bias if not 0, its true models if given, and its scan times if it does not scan at every step."""
    differences, truth = [], sensor.true_parameters
    if sensor.bias != BiasSection():
        differences.append(("bias", _bias(sensor.bias)))
    if truth is not None:
        parts = {name: getattr(truth, name) for name in type(truth).model_fields}
        sections = [(name, value) for name, value in parts.items() if isinstance(value, Section)]
        special: dict[str, Callable[[Any], str]] = {
            "noise": partial(_noise, measured=sensor.measurement.kind),
            "bias": _bias,
        }
        differences += [
            (f"true {name_in_words(name)}", special[name](value) if name in special else describe_settings(value))
            for name, value in sections
        ]
        differences += [("detection of", "the measurement")] if truth.detection_of == "measurement" else []
    scans = sensor.scans
    if scans.period is not None:
        differences.append(("scans", f"every {scans.period:g} s from {scans.offset or 0.0:g} s on"))
    elif scans.every > 1:
        differences.append(("scans", f"every {scans.every} steps from step {scans.first}"))
    if sensor.scans.scan_loss_probability:
        differences.append(("scan loss", f"{sensor.scans.scan_loss_probability:g} of its scans"))
    if sensor.scans.late is not None:
        differences.append(("late", describe_settings(sensor.scans.late)))
    return differences
