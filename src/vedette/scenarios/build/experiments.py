"""Builders of runs: an experiment to be simulated, or a recording to be tracked."""

from dataclasses import replace

import numpy as np

from vedette.errors import InputError
from vedette.models.correlation import independent_share
from vedette.models.scan_rows import with_scaled_noise
from vedette.recorded import RecordedScans, Tracking
from vedette.scenarios.build.sensors import (
    build_poses,
    build_scan_times,
    build_sensors,
    build_true_sensors,
    first_actions,
    scan_loss_probabilities,
)
from vedette.scenarios.build.trackers import build_tracker
from vedette.scenarios.loading import Scenario
from vedette.scenarios.recorded_data import recorded_scans, recorded_targets
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.targets import RecordedTargets
from vedette.scenarios.sections.world import grouped_order
from vedette.simulation.experiment import Experiment
from vedette.simulation.truth import TargetSource


def build_experiment(scenario: Scenario) -> Experiment:
    """Return the experiment: everything that a run needs except a planner and a seed.

    Raises:
        InputError: a custom model or a recorded file that cannot be loaded, parts that do not fit together, or a
            scenario of recorded scans.
    """
    model = scenario.model
    if model.recording is not None:
        expected = "simulated scans (`vedette.evaluation.track_recording` takes recorded ones)"
        raise InputError(f"{model.name}: expected {expected}; got those of {model.recording.path}")
    sensors = build_sensors(scenario)
    tracker, times = build_tracker(scenario, tuple(sensor.filter for sensor in sensors)), build_scan_times(scenario)
    return Experiment(
        name=model.name,
        times=model.time.build(),
        targets=build_targets(scenario),
        tracker=tracker,
        platforms=tuple(sensor.platform for sensor in sensors),
        poses=build_poses(scenario),
        first_actions=tuple(
            actions.values[0] if not section.stationary_until_first_decision else None
            for actions, section in zip(first_actions(scenario, sensors), model.sensors, strict=True)
        ),
        estimate=model.estimates_by.build(scenario.folder),
        decision_steps=model.decision_steps,
        explain=model.control.explain,
        # Empty if all match the tracker's models, so that a tracker of other sensors may replace this one.
        true_sensors=build_true_sensors(scenario) if any(sensor.is_not_as_assumed for sensor in model.sensors) else (),
        scans_at=None if times.all() else times,
        scan_loss_probability=scan_loss_probabilities(scenario),
    )


def build_tracking(scenario: Scenario, recording: RecordedScans | None = None) -> Tracking:
    """Return the recording of a scenario with its tracker; recording: None to read it from the file.

    Raises `InputError` like `build_experiment`, or for a scenario with simulated scans.
    """
    model, folder = scenario.model, scenario.folder
    if model.recording is None:
        raise InputError(f"{model.name}: expected a section `recording`; got a scenario whose scans are simulated")
    recording = _discounted(recording or recorded_scans(model, folder), model)
    tracker = build_tracker(scenario, tuple(sensor.filter for sensor in build_sensors(scenario)))
    truth = build_targets(scenario).truth(recording.times, rng=np.random.default_rng(0))  # draws nothing
    return Tracking(model.name, recording, tracker, model.estimates_by.build(folder), truth)


def _discounted(recording: RecordedScans, model: ScenarioModel) -> RecordedScans:
    """Return the recording with the noise of its rows counted for less where errors of a sensor last."""
    lasting = {s: x for s, each in enumerate(model.sensors) if (x := each.correlation.noise_s) > 0.0}
    if not lasting:
        return recording
    given = {s: (model.sensors[s].correlation.interval(model.sensors[s].scans, None), x) for s, x in lasting.items()}
    scales = {s: 1.0 / independent_share(*each) for s, each in given.items()}
    scans = tuple(
        tuple(None if scan is None else with_scaled_noise(scan, scales.get(s, 1.0)) for s, scan in enumerate(instant))
        for instant in recording.scans
    )
    return replace(recording, scans=scans)


def build_targets(scenario: Scenario) -> TargetSource:
    """Return the true targets.

    Raises `InputError` for a custom motion or a recorded file that cannot be loaded.
    """
    model, folder = scenario.model, scenario.folder
    if isinstance(model.targets, RecordedTargets):
        return recorded_targets(model, folder)
    motion = model.motion.build(folder)
    return model.targets.build(motion, grouped_order(model.motion), model.time.build(), model.region.build())
