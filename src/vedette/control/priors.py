"""Where a decision starts: the fused density predicted ahead, and what the pseudo-updates of a sensor depend on."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TypeVar

import numpy as np

from vedette.control.settings import IDEAL_MODES, Belief, MobileSensor, PlanningSettings
from vedette.densities import Labelled, MultiTargetSamples, track_moments
from vedette.densities.conversions import collapsed
from vedette.densities.label_sets import possible
from vedette.densities.samples import sample_labelled
from vedette.densities.tracks import gaussian_tracks, places_of
from vedette.filters import shared_targets
from vedette.filters.inputs import model_errors, nobody
from vedette.kernels.base.types import Bools, Floats, Ints, Motion, Sensor
from vedette.kernels.gaussian.sigma_points import LINEARISED
from vedette.kernels.planning.forms import ANY, BEARING_RANGE, CONSTANT, GAUSSIAN, GROWING, POSITION, SAME, Forms
from vedette.kernels.planning.ideal import Decision, Futures, Horizon, propagate_samples
from vedette.kernels.planning.reach import predict_paths
from vedette.models import (
    MotionModel,
    bearing_range,
    constant_detection,
    constant_noise,
    constant_survival,
    constant_velocity,
    gaussian_detection,
    kernel_motion,
    position,
    range_dependent_noise,
)
from vedette.models.detection_functions import MAX_PROB_DETECTION
from vedette.models.functions import ModelFunction

# By the functions themselves: a model of a user's own is none of these.
_LINEAR = {
    (own.transition, own.process_noise_cov)
    for own in (constant_velocity(1.0, acceleration=kind) for kind in ("held", "continuous"))
}

_MEASUREMENTS = {bearing_range().function: BEARING_RANGE, position().function: POSITION}

_NOISES = {
    range_dependent_noise(1.0, 0.0, 1.0, 0.0).function: GROWING,
    constant_noise([1.0]).function: CONSTANT,
}

_DETECTIONS = {gaussian_detection(1.0).function: GAUSSIAN, constant_detection(0.5).function: SAME}

_Labelled = TypeVar("_Labelled", bound=Labelled)

# Over the horizon nobody dies. One model for all decisions, by which what kernels take of a motion is found again.
ALWAYS_SURVIVES = constant_survival(1.0)


def predicted(fused: _Labelled, motion: MotionModel, num_steps: int, period: float) -> _Labelled:
    """The fused density at the end of the horizon, without birth or death (paper, "pseudo-prediction").

    Tracks are first collapsed to one Gaussian each (GLMBs are marginalised), as those of the pseudo-updates are. Label
    sets of weight zero are left out of a GLMB.
    """
    single = possible(collapsed(fused))
    means, covs = track_moments(single.tracks)
    with model_errors():
        paths = predict_paths(kernel_motion(motion, ALWAYS_SURVIVES), float(period), int(num_steps), means, covs)
    ends = np.ascontiguousarray(paths.means[:, -1]), np.ascontiguousarray(paths.covs[:, -1])
    return single.with_fields(tracks=gaussian_tracks(single.tracks.labels, *ends))


def draw_paths(
    fused: Belief, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
) -> tuple[MultiTargetSamples, Floats]:
    """Samples of the fused density, and (horizon_steps, num_targets, state_dim) where they go without noise."""
    targets = shared_targets([sensor.filter for sensor in sensors])
    samples = sample_labelled(fused, settings.num_samples, rng=rng)
    with model_errors():
        motion = kernel_motion(targets.motion, targets.survival)
        states = propagate_samples(motion, samples.states, float(settings.horizon_period), int(settings.horizon_steps))
    return samples, states


def decision_of(
    sensor: MobileSensor,
    courses: Floats,
    futures: Futures,
    settings: PlanningSettings,
    scans: Bools,
    detection_at: str | None = None,
) -> Decision:
    """What the pseudo-updates of a sensor depend on besides its prior.

    scans: (num_courses, horizon_steps) at which of them it scans. detection_at: as of `SensorModel.to_kernel`.
    """
    horizon = Horizon(
        np.ascontiguousarray(courses),
        scans,
        float(settings.horizon_period),
        IDEAL_MODES[settings.ideal_measurements],
        float(settings.detection_threshold),
    )
    targets, own = sensor.filter.targets, sensor.filter.sensor
    motion, sees = kernel_motion(targets.motion, ALWAYS_SURVIVES), own.to_kernel(detection_at)
    return Decision(
        nobody(targets.state_dim),
        motion,
        sees,
        forms_of(motion, sees, horizon.dt, targets.state_dim),
        horizon,
        futures,
        settings.limits.truncation(own.meas_dim),
    )


def targets_of(table: Ints, labels: Ints, offsets: Ints) -> Ints:
    """(num_labels, num_samples) place of the target of each label of `table` in each sample, -1 where it is not there.

    labels: of the sampled targets, which are `offsets[i]:offsets[i + 1]` of sample i.
    """
    rows = places_of(labels, table)
    of_sample = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    targets, known = np.full((len(table), len(offsets) - 1), -1), rows >= 0
    targets[rows[known], of_sample[known]] = np.flatnonzero(known)
    return targets


def forms_of(motion: Motion, sensor: Sensor, dt: float, state_dim: int) -> Forms:
    """The forms of models as kernels take them, over steps of `dt` seconds."""
    is_linear = motion.method == LINEARISED and (motion.transition, motion.process_noise_cov) in _LINEAR
    if is_linear:
        functions = motion.transition_jacobian, motion.process_noise_cov
        step = _linear_step(
            *functions, motion.transition_params.tobytes(), motion.noise_params.tobytes(), dt, state_dim
        )
    else:
        step = np.zeros((2, state_dim, state_dim))
    return Forms(
        int(is_linear),
        step[0],
        step[1],
        _MEASUREMENTS.get(sensor.measurement, ANY),
        _NOISES.get(sensor.measurement_noise_cov, ANY),
        _DETECTIONS.get(sensor.prob_detection, ANY),
        MAX_PROB_DETECTION,
    )


@lru_cache(maxsize=100)
def _linear_step(
    jacobian: ModelFunction, noise_cov: ModelFunction, params: bytes, noise_params: bytes, dt: float, state_dim: int
) -> Floats:
    """(2, state_dim, state_dim) transition and noise of a linear motion, the same at every state."""
    anywhere, step = np.zeros(state_dim), np.zeros((2, state_dim, state_dim))
    jacobian(anywhere, dt, np.frombuffer(params).copy(), step[0])
    noise_cov(anywhere, dt, np.frombuffer(noise_params).copy(), step[1])
    return step
