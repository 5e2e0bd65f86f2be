"""One run of a scenario under a strategy."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from vedette.evaluation.metrics.matching import match_run, near_targets
from vedette.evaluation.metrics.point_ospa import ospa_of_run
from vedette.evaluation.metrics.run import Metric, RunMetrics, measure
from vedette.evaluation.metrics.targets import TargetScore, target_scores
from vedette.evaluation.metrics.track_ospa import ospa2_of_run
from vedette.evaluation.recording_metadata import recording_metadata
from vedette.kernels.base.types import HEIGHT, place_of
from vedette.recorded import RecordedScans
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import (
    build_experiment,
    build_planner,
    build_tracking,
    build_true_sensors,
)
from vedette.scenarios.sections.scoring import AnyMetric
from vedette.simulation.journal import Score
from vedette.simulation.loop import simulate
from vedette.simulation.records import Measure, RunRecord
from vedette.tracking import TraceEntry


def run_scenario(
    scenario: Scenario | str | Path,
    planner: str,
    *,
    seed: int,
    run: int = 0,
    num_threads: int = 0,
    progress: Callable[[int], None] | None = None,
) -> RunRecord:
    """Run a scenario once under a strategy and return the record.

    Args:
        scenario: from `vedette.scenarios.load_scenario`, or the name or file that it reads.
        planner: "jdm" (joint), "idm" (independent), "lookahead" (joint, over several decisions), "nearest",
            "assigned_target" or "centroid" (rules of thumb), "oracle" and "true_targets" (which know the targets),
            "random", "constant", "stationary", or one of the scenario's own planners, not used for recorded scans.
        seed, run: fix every random number. Runs with equal seed and number are paired across strategies.
        num_threads: of a decision (0: one per processor), which changes no result.
        progress: called with the number of every finished scan.

    Raises:
        VedetteError: the scenario's models, filters or planner do not support the request.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if scenario.model.recording is not None:
        return track_recording(scenario, seed=seed, run=run, progress=progress)
    strategy = build_planner(scenario, planner, num_threads)
    return simulate(
        build_experiment(scenario), strategy, seed=seed, run=run, score=build_score(scenario), progress=progress
    )


def track_recording(
    scenario: Scenario,
    recording: RecordedScans | None = None,
    *,
    seed: int = 0,
    run: int = 0,
    progress: Callable[[int], None] | None = None,
    trace: list[TraceEntry] | None = None,
) -> RunRecord:
    """Track the recorded scans of a scenario.

    Args:
        scenario: such as that of `vedette.scenarios.from_recording.scenario_from_recording`.
        recording: its scans. None: read from the file.
        seed, run, progress, trace: see `vedette.recorded.Tracking.run`.

    Raises:
        VedetteError: scans that are not recorded, or models and filters that do not support the request.
    """
    tracking = build_tracking(scenario, recording)
    return tracking.run(build_score(scenario), seed=seed, run=run, progress=progress, trace=trace)


def build_score(scenario: Scenario) -> Score | None:
    """Return the OSPA of estimates at each scan as a function, as the scenario defines it. None: unknown targets."""
    ospa, places = scenario.model.ospa, [0, 1, place_of(HEIGHT, scenario.model.motion.components)]
    if scenario.model.targets.kind == "unknown":
        return None
    components = places if ospa.components == "position_and_height" else ospa.components
    score = partial(ospa_of_run, cutoff=ospa.cutoff, order=ospa.order, components=components)
    if ospa.truth == "complete":
        return score
    return lambda truth, estimates: score(truth, near_targets(truth, estimates, ospa.cutoff))


def custom_metrics(scenario: Scenario) -> tuple[Metric, ...]:
    """Return the metrics that a scenario adds to the built-in ones. Raises `InputError` if one cannot be loaded."""
    return tuple(Metric(name, _build_metric(scenario, section)) for name, section in scenario.model.metrics.items())


def _build_metric(scenario: Scenario, section: AnyMetric) -> Measure:
    ospa, sensors = scenario.model.ospa, tuple(true.model for true in build_true_sensors(scenario))
    metric: Measure = section.build(scenario.folder, sensors=sensors, cutoff=ospa.cutoff, order=ospa.order)
    return metric


def measure_run(record: RunRecord, scenario: Scenario, custom: Sequence[Metric] = ()) -> RunMetrics:
    """Return all measures of a run by its scenario's cutoff, order, window and truth. Raises like `measure`."""
    ospa, record = scenario.model.ospa, _scored(record, scenario)
    return measure(record, cutoff=ospa.cutoff, order=ospa.order, window=ospa.window, custom=custom)


def _scored(record: RunRecord, scenario: Scenario) -> RunRecord:
    """Return the record with only the estimates that count (`ospa.truth`)."""
    ospa = scenario.model.ospa
    if ospa.truth == "complete":
        return record
    return replace(record, estimates=tuple(near_targets(record.truth, record.estimates, ospa.cutoff)))


def named_target_scores(record: RunRecord, scenario: Scenario) -> list[tuple[str, TargetScore]]:
    """Return the name (by default id + 1) and the score of every true target of a run, none if they are unknown."""
    ospa, names = scenario.model.ospa, recording_metadata(record, scenario).names
    scores = target_scores(record, cutoff=ospa.cutoff, order=ospa.order)
    return [(names[own.target] if names else str(own.target + 1), own) for own in scores]


def trajectory_errors(record: RunRecord, scenario: Scenario) -> dict[str, float]:
    """Return the errors of a run's tracks over all scans, by the cutoff, order and window of its scenario.

    `rmse_m` is the root mean square distance of the estimates matched with targets, NaN without any. `ospa2_m` is the
    mean OSPA(2). Raises like `measure`.
    """
    ospa, record = scenario.model.ospa, _scored(record, scenario)
    matching = match_run(record.truth, record.estimates, cutoff=ospa.cutoff, order=ospa.order)
    distances = ospa2_of_run(record.truth, record.estimates, cutoff=ospa.cutoff, order=ospa.order, window=ospa.window)
    squares = matching.distances**2
    return {
        "rmse_m": float(np.sqrt(squares.mean())) if len(squares) else float("nan"),
        "ospa2_m": float(distances[:, 0].mean()),
    }
