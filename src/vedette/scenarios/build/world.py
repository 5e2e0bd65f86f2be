"""The world of a scenario: times, region, motion, survival, births and the true targets."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models import (
    BirthModel,
    MotionModel,
    Region,
    SurvivalModel,
    TargetModel,
    constant_survival,
    constant_velocity,
    coordinated_turn,
)
from vedette.scenarios.build.custom import build_custom
from vedette.scenarios.records import recorded_source
from vedette.scenarios.schema.scenario import ScenarioModel
from vedette.scenarios.schema.tracking import GaussianMethod
from vedette.scenarios.schema.world import (
    Birth,
    BirthSite,
    ConstantVelocity,
    CustomMotion,
    CustomSurvival,
    Motion,
    RecordedTargets,
    RegionSection,
    ScriptedTargets,
    Survival,
    Time,
)
from vedette.simulation import ScriptedTargets as ScriptedSource
from vedette.simulation import TargetSource


def build_times(section: Time) -> Floats:
    """(num_steps,) times of the scans in s; that of step k is entry k - 1."""
    return section.start + section.step_period * np.arange(section.num_steps, dtype=np.float64)


def build_region(section: RegionSection) -> Region:
    """The surveillance region."""
    return Region(section.x_min, section.x_max, section.y_min, section.y_max)


def build_motion(section: Motion, method: GaussianMethod, folder: Path) -> MotionModel:
    """The motion model; `folder` is what a custom model's file is relative to.

    Raises:
        InputError: a custom model that cannot be had, or has another state dimension than it says.
    """
    if isinstance(section, CustomMotion):
        motion = build_custom(section, MotionModel, folder, "motion")
        if motion.state_dim != section.state_dim:
            expected = f"that of {section.python}, {motion.state_dim}"
            raise InputError(f"motion.state_dim: expected {expected}; got {section.state_dim}")
        return motion if method == "auto" else replace(motion, method=method)
    if isinstance(section, ConstantVelocity):
        return constant_velocity(section.sigma_v, method=method)
    return coordinated_turn(section.sigma_v, math.radians(section.sigma_turn_rate_deg), method=method)


def build_survival(section: Survival, folder: Path) -> SurvivalModel:
    """The survival model."""
    if isinstance(section, CustomSurvival):
        return build_custom(section, SurvivalModel, folder, "survival")
    return constant_survival(section.probability)


def grouped_order(section: Motion, state_dim: int) -> list[int]:
    """Place in the file's states of each component of the library's states [px, py, vx, vy, ...]."""
    if isinstance(section, CustomMotion) or section.state_order == "grouped":
        return list(range(state_dim))
    return [0, 2, 1, 3, *range(4, state_dim)]


def build_birth(section: Birth, motion: Motion) -> BirthModel:
    """The birth sites, shared by all sensors."""
    covs = np.array([_covariance(site) for site in section.sites])
    order = grouped_order(motion, covs.shape[1])
    return BirthModel(
        np.array([site.existence for site in section.sites]),
        np.array([site.mean for site in section.sites])[:, order],
        covs[:, order][:, :, order],
        None if section.steps == "every" else frozenset(section.steps),
    )


def _covariance(site: BirthSite) -> Floats:
    return np.array(site.cov) if site.cov is not None else np.diag(np.square(site.std or ()))


def build_targets(model: ScenarioModel, folder: Path) -> TargetModel:
    """The targets as every filter knows them.

    Raises:
        InputError: a custom model that cannot be had, or parts that do not fit together.
    """
    motion = build_motion(model.motion, model.filter.gaussian_method, folder)
    return TargetModel(motion, build_survival(model.survival, folder), build_birth(model.birth, model.motion))


def build_truth_source(model: ScenarioModel, motion: MotionModel, folder: Path) -> TargetSource:
    """The true targets: scripted ones follow `motion`, recorded ones their reports.

    Raises:
        InputError: the recorded file cannot be read, or nothing is left of it.
    """
    if isinstance(model.targets, RecordedTargets):
        return recorded_source(model.targets, model.region, folder)
    return _scripted(model.targets, model, motion)


def _scripted(section: ScriptedTargets, model: ScenarioModel, motion: MotionModel) -> ScriptedSource:
    times, tracks = build_times(model.time), section.tracks
    states = np.array([track.state for track in tracks]).reshape(len(tracks), motion.state_dim)
    return ScriptedSource(
        motion,
        states[:, grouped_order(model.motion, motion.state_dim)],
        np.array([times[track.start_step - 1] for track in tracks]),
        np.array([times[(track.end_step or model.time.num_steps) - 1] for track in tracks]),
        [track.process_noise for track in tracks] or False,
    )
