"""The fused density over the horizon of a decision: its prediction, and samples with their trajectories."""

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from vedette.control.settings import Belief, MobileSensor, PlanningSettings
from vedette.densities import LMB, LabelledDensity, MultiTargetSamples, track_moments
from vedette.densities.containers import for_kernel, unchecked
from vedette.densities.conversions import with_single_gaussians
from vedette.densities.label_sets import without_zero_weights
from vedette.densities.samples import sample_labelled
from vedette.densities.tracks import gaussian_tracks, places_of, single_gaussians
from vedette.filters import common_target_model
from vedette.filters.inputs import model_errors
from vedette.kernels.base.types import Floats, Ints, Lmb
from vedette.kernels.planning.ideal import propagate_samples
from vedette.kernels.planning.reach import Paths, predict_paths
from vedette.models import MotionModel, constant_survival, kernel_motion

_Labelled = TypeVar("_Labelled", bound=LabelledDensity)

# No deaths over the horizon. All decisions share this model, so that the cached kernel input of a motion is reused.
ALWAYS_SURVIVES = constant_survival(1.0)


class Prediction(NamedTuple):
    """A fused LMB over the horizon, without births or deaths."""

    fused: LMB  # the belief that is predicted
    now: Lmb  # the belief with one Gaussian per label, in kernel form
    paths: Paths  # predicted paths of its labels
    end: LMB  # at the end of the horizon, one Gaussian per label

    @classmethod
    def of(cls, fused: LMB, motion: MotionModel, num_steps: int, period: float) -> "Prediction":
        """Return the prediction over `num_steps` steps of `period` seconds. Call it within `model_errors`."""
        tracks, logits = single_gaussians(fused.tracks).to_kernel(), fused.existence_logit
        own = kernel_motion(motion, ALWAYS_SURVIVES)
        paths = predict_paths(own, float(period), int(num_steps), tracks.components.means, tracks.components.covs)
        end = unchecked(LMB, gaussian_tracks(tracks.labels, paths.means[:, -1], paths.covs[:, -1]), logits)
        return cls(fused, Lmb(tracks, for_kernel(logits)), paths, end)


def predicted(fused: _Labelled, motion: MotionModel, num_steps: int, period: float) -> _Labelled:
    """Return the fused density at the end of the horizon, without births or deaths (paper, "pseudo-prediction").

    Tracks are first collapsed to one Gaussian each (GLMBs are marginalised), as in the pseudo-updates. Label sets of
    weight zero are left out of a GLMB.
    """
    single = without_zero_weights(with_single_gaussians(fused))
    means, covs = track_moments(single.tracks)
    with model_errors():
        paths = predict_paths(kernel_motion(motion, ALWAYS_SURVIVES), float(period), int(num_steps), means, covs)
    tracks = gaussian_tracks(single.tracks.labels, paths.means[:, -1], paths.covs[:, -1])
    return single.with_fields(tracks=tracks)


def draw_paths(
    fused: Belief, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
) -> tuple[MultiTargetSamples, Floats]:
    """Return samples of the fused density, and their noise-free states (horizon_steps, num_targets, state_dim)."""
    targets = common_target_model([sensor.filter for sensor in sensors])
    samples = sample_labelled(fused, settings.num_samples, rng=rng)
    with model_errors():
        motion = kernel_motion(targets.motion, targets.survival)
        states = propagate_samples(motion, samples.states, float(settings.horizon_period), int(settings.horizon_steps))
    return samples, states


def targets_of(table: Ints, labels: Ints, offsets: Ints) -> Ints:
    """Return (num_labels, num_samples) the index of the target of each label of `table` in each sample, -1 if absent.

    labels: of the sampled targets, which are `offsets[i]:offsets[i + 1]` of sample i.
    """
    rows = places_of(labels, table)
    of_sample = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    targets, exists = np.full((len(table), len(offsets) - 1), -1), rows >= 0
    targets[rows[exists], of_sample[exists]] = np.flatnonzero(exists)
    return targets
