"""Warnings of valid settings in a scenario that cost accuracy or are probably mistakes."""

import math
from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np

from vedette.internal.cut_births import MAX_CUT_SHARE, cut_share
from vedette.kernels.base.types import LONGEST_MODE_STEP, Bools, Floats
from vedette.scenarios.coastline import coastline_warnings
from vedette.scenarios.diagnostics import Diagnostic, Path
from vedette.scenarios.loading import Scenario, locate_fault, read_document
from vedette.scenarios.new_targets import new_target_warnings
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.birth_labels import (
    birth_probabilities,
    has_one_belief,
    labels_until_detection,
    max_label_sets,
)
from vedette.scenarios.sections.field_of_view import field_of_view
from vedette.scenarios.sections.fusion import LABEL_FUSIONS, Fusion
from vedette.scenarios.sections.sensing import Detection
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.sections.targets import RecordedTargets
from vedette.scenarios.sections.tracking import LABEL_LIMITED, Filter
from vedette.scenarios.sections.world import grouped_order
from vedette.scenarios.start_warnings import coverage_warnings, start_warnings
from vedette.scenarios.suggestions import is_valid_with, suggest_fusions, suggest_label_settings
from vedette.scenarios.unit_checks import implausible_settings

# Sensors have different views if their probabilities of detection of one place differ by more than this.
MAX_DIFFERENCE = 0.5
# With more sensors than this, rules that send densities lose much information (docs/networks.md).
MAX_GCI_SENSORS = 4
# Birth sites that are nearer to each other than this number of standard deviations of their difference may be confused.
# Of 40 random layouts, GCI lost 5 m and more to cardinality in 7 of the 17 below this distance and in one of the 23
# above.
MIN_SITE_DISTANCE = 4.0
_POINTS_PER_SIDE = 21
# Expected number of targets at a site that earlier scans have not detected, relative to one. Above it, Poisson
# births had 2 to 36 % less OSPA in an LMB filter at 14 settings of one site (P_D .4 and .7), below it 0 to 9 % at 8.
MAX_MISSED = 0.02
_MAX_MODE_STEPS = 10  # between two scans, above which a stay is far shorter than the time between them
_MAX_WORTH = 20.0  # largest plausible worth of an undetected target, in costs of a missed one


def scenario_warnings(scenario: Scenario, more: Iterable[tuple[Path, str]] = ()) -> tuple[str, ...]:
    """Return warnings of a valid scenario, one line each, with file, line and column if it was read from a file.

    more: places and texts of other warnings, which come last.
    """
    warnings = [
        *_recording_warnings(scenario),
        *_different_views(scenario),
        *_birth_warnings(scenario),
        *_delayed_beliefs(scenario),
    ]
    warnings += [
        *_many_sensors(scenario),
        *_large_cells(scenario.model),
        *_label_limit(scenario.model),
        *_undetected_value(scenario.model),
    ]
    warnings += coverage_warnings(scenario.model)
    warnings += [*_undetected_births(scenario.model), *_missed_targets(scenario)]
    warnings += [*start_warnings(scenario), *new_target_warnings(scenario), *_many_mode_steps(scenario)]
    warnings += [*implausible_settings(scenario.model), *coastline_warnings(scenario.model, scenario.folder), *more]
    if not warnings:
        return ()
    document = read_document(scenario)
    lines = []
    for path, text in warnings:
        place = None if document is None else locate_fault(document, Diagnostic(path, "", "")).place
        where = scenario.name if place is None else f"{scenario.path}:{place[0]}:{place[1]}"
        lines.append(f"{where}: warning: {text}")
    return tuple(lines)


def _recording_warnings(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    if isinstance(scenario.model.targets, RecordedTargets) or scenario.model.recording is not None:
        from vedette.scenarios.recording_warnings import recording_warnings  # slow to import

        yield from recording_warnings(scenario)


def _many_mode_steps(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """Yield a warning if the shortest stay in a mode divides the usual time between scans into many steps."""
    model, period = scenario.model, scenario.model.time.step_period
    stays = {name: mode.stay_s or math.inf for name, mode in getattr(model.motion, "modes", {}).items()}
    if stays and model.recording is not None:
        from vedette.scenarios.recorded_data import recorded_scans  # slow to import

        gaps = np.diff(recorded_scans(model, scenario.folder).times)
        period = float(np.median(gaps)) if len(gaps) else 0.0
    name = min(stays, key=stays.__getitem__, default="")
    steps = math.ceil(period / (LONGEST_MODE_STEP * stays.get(name, math.inf)))
    if steps > _MAX_MODE_STEPS:
        yield (
            ("motion", "modes", name, "stay_s"),
            f"motion.modes.{name}.stay_s: {stays[name]:g} s is short for scans {period:.3g} s apart: filters divide "
            f"the time between two scans into {steps} steps, each with a prediction of all modes. "
            f"Above {period / (_MAX_MODE_STEPS * LONGEST_MODE_STEP):.3g} s there are at most {_MAX_MODE_STEPS}",
        )


def _fusion_by_label(model: ScenarioModel) -> Fusion | None:
    """Return the fusion by label of several sensors' local beliefs; None if the scenario has none."""
    fusion = model.fusion
    return fusion if isinstance(fusion, Fusion) and fusion.kind in LABEL_FUSIONS and len(model.sensors) > 1 else None


def _birth_warnings(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    model = scenario.model
    steps, fusion = model.birth.steps, _fusion_by_label(model)
    if fusion is None or fusion.feedback or fusion.matching == "assignment":
        return
    if steps != "every" and max(steps, default=1) <= 1:
        yield from _near_sites(scenario, fusion)
        return
    times = "at every step" if steps == "every" else f"up to step {max(steps)}"
    yield (
        ("birth", "steps"),
        f"births {times} without feedback: sensors may take one target up at different steps, under different labels, "
        f"and {_rule_name(fusion)}, which fuses by label, then loses it{suggest_label_settings(scenario, fusion)} "
        "(births at step 1 alone avoid this too)",
    )


def _near_sites(scenario: Scenario, fusion: Fusion) -> Iterator[tuple[Path, str]]:
    """Yield a warning of the first two sites so close that a sensor may confuse their targets."""
    order = grouped_order(scenario.model.motion)[:2]
    for (i, one), (j, other) in combinations(enumerate(scenario.model.birth.sites), 2):
        difference = (np.array(one.mean) - other.mean)[order]
        covariance = (one.covariance() + other.covariance())[np.ix_(order, order)]
        distance = math.sqrt(difference @ np.linalg.solve(covariance, difference))
        if distance < MIN_SITE_DISTANCE:
            yield (
                ("birth", "sites", j),
                f"sites {i} and {j} are {distance:.1f} standard deviations apart: a sensor that misses a "
                "target at first, or measures clutter near it, may take it up under the label of the other site, and "
                f"{_rule_name(fusion)}, which fuses by label, then loses it{suggest_label_settings(scenario, fusion)}",
            )
            return


def _delayed_beliefs(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    model = scenario.model
    fusion, network = _fusion_by_label(model), model.network
    born_later = model.birth.from_measurements is not None or model.birth.steps == "every"
    if fusion is None or network is None or network.delay == 0 or not born_later:
        return
    yield (
        ("network", "delay"),
        f"beliefs come {network.delay} or more scans late: a target that is new to one sensor is unlikely to those "
        f"whose beliefs are older, and {_rule_name(fusion)} then keeps it down, while late scans can be put in "
        f"their place{suggest_fusions(scenario, fusion, by_views=False)}",
    )


def _many_sensors(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """Yield a warning if densities of more than `MAX_GCI_SENSORS` sensors are fused by a rule that then loses much."""
    model = scenario.model
    fusion, num = model.fusion, len(model.sensors)
    if not isinstance(fusion, Fusion) or num <= MAX_GCI_SENSORS:
        return
    if fusion.kind == "parallel" and model.filter.built_kind == "lmb":
        if model.birth.from_measurements is not None and is_valid_with(scenario, {"filter.kind": "factored_glmb"}):
            yield (
                ("filter", "kind"),
                f"{num} sensors each say of every label by itself what their scans say: of labels that contend for one "
                "target all say that one of them goes, and both may; take filter.kind: factored_glmb, which says "
                "it of both together",
            )
        return
    if fusion.kind not in LABEL_FUSIONS:
        return
    why = (
        "a target that several see becomes no surer than the mean of what each says, and is found later"
        if fusion.feedback
        else "each finds every target by itself, and anew where one comes into its view"
    )
    yield (
        ("fusion", "kind"),
        f"{num} sensors fuse densities by {_rule_name(fusion)}, which makes no use of what they have in common: {why}"
        f"{suggest_fusions(scenario, fusion, by_views=False)}",
    )


def _large_cells(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    if model.undetected is None:
        return
    for name, sensor in zip(model.sensor_names, model.sensors, strict=True):
        field = field_of_view(sensor)
        if field is not None and field.reach < 0.5 * model.undetected.cell_size:
            yield (
                ("undetected", "cell_size"),
                f"cells of {model.undetected.cell_size:g} m, and {name} sees as far as {field.reach:g} m: what it sees "
                "of a cell is taken at nine places in it, and too rough; take cells of at most twice as far as it sees",
            )
            return


def _undetected_value(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield a warning if the worth of undetected targets was probably given in metres."""
    worth = model.control.undetected_target_value
    if worth is not None and worth > _MAX_WORTH and model.control.reward.kind in ("expected_loss", "expected_gospa"):
        yield (
            ("control", "undetected_target_value"),
            f"finding a target is worth {worth:g} times what a missed one costs: sensors do little but search; it is a "
            "factor of that cost, mostly 1",
        )


def _label_limit(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    number = model.targets.expected_number(model.time.num_steps)
    if not isinstance(model.filter, Filter) or model.filter.kind not in LABEL_LIMITED or number is None:
        return
    if number > model.filter.limits.max_labels:
        yield (
            ("filter", "limits", "max_labels"),
            f"at most {model.filter.limits.max_labels} labels are kept, and {number:.0f} targets are there at once: "
            f"the others are never tracked; take filter.limits.max_labels of {number:.0f} and more, as what may become "
            "one takes labels, too",
        )


def _undetected_births(model: ScenarioModel) -> Iterator[tuple[Path, str]]:
    """Yield a warning if a cap on hypotheses cuts births because sensors hardly see the sites."""
    max_hypotheses = max_label_sets(model)
    labels = None if max_hypotheses is None else _unconfirmed_labels(model)
    if max_hypotheses is None or labels is None:
        return
    share = cut_share(labels.sum(), float(birth_probabilities(model).mean()), max_hypotheses)
    if share > MAX_CUT_SHARE:
        yield (
            ("filter", "kind"),
            f"targets born at the sites are detected late from where the sensors start: some {labels.sum():.0f} labels "
            f"are unconfirmed at a time, and {max_hypotheses} hypotheses cut {100.0 * share:.0f} % of the expected "
            "births; take filter.kind: factored_glmb or lmb, or births at fewer birth.steps",
        )


def _unconfirmed_labels(model: ScenarioModel) -> Floats | None:
    """Return the mean number of unconfirmed labels of each site, with sensors at their start; None if not known."""
    if not model.birth.sites:
        return None
    places = np.array([site.mean for site in model.birth.sites])[:, grouped_order(model.motion)[:2]]
    detection = [prob_detection(sensor, places) for sensor in model.sensors]
    known = [probabilities for probabilities in detection if probabilities is not None]
    if len(known) < len(detection):
        return None
    detected = 1.0 - np.prod(1.0 - np.array(known), axis=0) if has_one_belief(model) else np.min(known, axis=0)
    return labels_until_detection(model, detected)


def _missed_targets(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    """Yield a warning if an LMB filter probably has sites with several targets that no scan has detected yet."""
    model = scenario.model
    if not (model.filter.kind == model.filter.built_kind == "lmb" and has_one_belief(model) and model.network is None):
        return
    # A sensor that moves does not see the sites as from its start.
    moves = any(sensor.platform.top_speed > 0.0 and sensor.detection.kind != "constant" for sensor in model.sensors)
    labels = None if moves else _unconfirmed_labels(model)
    if labels is None or not is_valid_with(scenario, {"filter.births": "poisson"}):
        return
    missed = birth_probabilities(model) * (labels - 1.0)
    if missed.max() > MAX_MISSED:
        yield (
            ("filter", "kind"),
            f"{missed.max():.2g} undetected targets are expected at birth.sites[{missed.argmax()}] (births per step "
            f"times steps before the first detection): above {MAX_MISSED:g}, the labels of an lmb contend for them, "
            "and find them late; take filter.births: poisson",
        )


def _different_views(scenario: Scenario) -> Iterator[tuple[Path, str]]:
    model = scenario.model
    fusion = _fusion_by_label(model)
    if fusion is None or fusion.field_of_view_weighting:
        return
    region = model.region
    axes = (
        np.linspace(region.x_min, region.x_max, _POINTS_PER_SIDE),
        np.linspace(region.y_min, region.y_max, _POINTS_PER_SIDE),
    )
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    detection = {
        i: probabilities
        for i, sensor in enumerate(model.sensors)
        if (probabilities := prob_detection(sensor, grid)) is not None
    }
    if len(detection) < 2:
        return
    table, names = np.stack(list(detection.values())), [model.sensor_names[i] for i in detection]
    difference = table.max(axis=0) - table.min(axis=0)
    worst = int(difference.argmax())
    if difference[worst] > MAX_DIFFERENCE:
        yield (
            ("sensors", list(detection)[int(table[:, worst].argmin())], "detection"),
            _describe_difference(names, table, difference, grid, fusion)
            + suggest_fusions(scenario, fusion, by_views=True),
        )
    elif model.decision_steps:
        yield from _limited_and_moving(scenario, fusion)


def _rule_name(fusion: Fusion) -> str:
    return "the arithmetic average" if fusion.kind == "arithmetic_average" else "GCI"


def _describe_difference(names: list[str], table: Floats, difference: Floats, grid: Floats, fusion: Fusion) -> str:
    """Describe how much the probabilities of detection differ, and where most; table: (num_sensors, num_places)."""
    worst = int(difference.argmax())
    probabilities = ", ".join(
        f"{name} {probability:.2g}" for name, probability in zip(names, table[:, worst], strict=True)
    )
    share = f"{(difference > MAX_DIFFERENCE).mean():.0%}".replace("%", " %")
    return (
        f"sensors differ in what they see: in {share} of the region by more than {MAX_DIFFERENCE:g} in probability of "
        f"detection ({probabilities} at x {grid[worst, 0]:g}, y {grid[worst, 1]:g} m); {_rule_name(fusion)} loses what "
        "one sensor sees and another does not"
    )


def _limited_and_moving(scenario: Scenario, fusion: Fusion) -> Iterator[tuple[Path, str]]:
    """Yield a warning of sensors with equal views at the start that may differ once they have moved."""
    model, region = scenario.model, scenario.model.region
    diagonal = math.hypot(region.x_max - region.x_min, region.y_max - region.y_min)
    for i, sensor in enumerate(model.sensors):
        field = field_of_view(sensor)
        limited = field is not None and field.reach < diagonal
        if (limited and sensor.platform.top_speed > 0.0) or sensor.detection.kind == "camera":
            yield (
                ("sensors", i, "detection"),
                f"sensors that move or turn and see only so far will differ in what they see; {_rule_name(fusion)} "
                f"loses what one sensor sees and another does not{suggest_fusions(scenario, fusion, by_views=True)}",
            )
            return


def prob_detection(sensor: Sensor, points: Floats) -> Floats | None:
    """Return the (n,) probabilities of detection at (n, 2) places from a sensor's start; None for a custom model.

    In plain NumPy, so that a check compiles nothing: the models are those of `vedette.models.detection`.
    """
    section = sensor.detection
    offsets = points - np.array(sensor.position)
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    if section.kind == "constant":
        return np.full(len(points), section.probability)
    if section.kind == "gaussian":
        return np.asarray(np.exp(-0.5 * (distances / section.sigma) ** 2))
    field = field_of_view(sensor)
    if field is not None:
        angles = np.arctan2(offsets[:, 1], offsets[:, 0]) - field.middle
        angles = np.where(distances == 0.0, 0.0, np.abs((angles + math.pi) % (2.0 * math.pi) - math.pi))
        in_view = (distances <= field.reach) & (angles <= field.half_width)
        if section.kind == "soft_sector":
            return _prob_soft_sector(section, distances - field.reach, angles - field.half_width, in_view)
        outside = section.outside if section.kind in ("limited_range", "limited_sector") else 0.0
        return np.where(in_view, field.probability, outside)
    return None


def _prob_soft_sector(section: Detection, beyond_range: Floats, beyond_angle: Floats, in_view: Bools) -> Floats:
    """Return the probabilities of detection of a soft sector, shape (n,).

    beyond_range, beyond_angle: how far each place lies beyond its edges, in m and rad.
    """
    prob = section.probability * _logistic(section.range_slope * beyond_range)
    if section.angle_slope is not None:
        prob = prob * _logistic(section.angle_slope * beyond_angle)
    elif not section.hard_limit:
        in_view = beyond_angle <= 0.0
    return prob if section.angle_slope is not None and not section.hard_limit else np.where(in_view, prob, 0.0)


def _logistic(exponent: Floats) -> Floats:
    return np.asarray(1.0 / (1.0 + np.exp(np.minimum(exponent, 700.0))))
