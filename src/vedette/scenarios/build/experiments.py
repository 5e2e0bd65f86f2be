"""The experiment of a scenario: all that a run needs but a planner and a seed."""

from __future__ import annotations

from vedette.scenarios.build.sensors import (
    build_poses,
    build_scan_times,
    build_sensors,
    build_true_sensors,
    drop_outs,
    first_actions,
)
from vedette.scenarios.build.trackers import build_tracker
from vedette.scenarios.loading import Scenario
from vedette.simulation.experiment import Experiment
from vedette.simulation.truth import TargetSource


def build_experiment(scenario: Scenario) -> Experiment:
    """Everything a run needs but a planner and a seed.

    Raises:
        InputError: a custom model or a recorded file that cannot be had, or parts that do not fit together.
    """
    model = scenario.model
    sensors = build_sensors(scenario)
    tracker, times = build_tracker(scenario, tuple(sensor.filter for sensor in sensors)), build_scan_times(scenario)
    known = tuple(sensor.filter.sensor for sensor in sensors)
    recording = None if model.recording is None else model.recording.build(model, scenario.folder)
    return Experiment(
        name=model.name,
        times=model.time.build() if recording is None else recording.times,
        targets=model.targets.build(model, tracker.targets.motion, scenario.folder),
        tracker=tracker,
        platforms=tuple(sensor.platform for sensor in sensors),
        poses=build_poses(scenario),
        first_actions=tuple(
            own.values[0] if section.moves_from == "start" else None
            for own, section in zip(first_actions(scenario, sensors), model.sensors, strict=True)
        ),
        estimate=model.estimates_by.build(scenario.folder),
        decision_steps=model.decision_steps,
        explain=model.control.explain,
        # Where they are what the tracker takes them for, a tracker of other sensors may stand in for this one.
        true_sensors=build_true_sensors(scenario, known) if any(sensor.truth for sensor in model.sensors) else (),
        scans_at=None if times.all() or recording is not None else times,
        recording=recording,
        drop_out=drop_outs(scenario),
    )


def build_targets(scenario: Scenario) -> TargetSource:
    """The true targets. Raises `InputError` for a custom motion or a recorded file that cannot be had."""
    model, folder = scenario.model, scenario.folder
    return model.targets.build(model, model.motion.build(folder), folder)
