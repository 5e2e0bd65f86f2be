"""Samples of the fused density, and their trajectories over the horizon."""

from collections.abc import Sequence

import numpy as np

from vedette.control.settings import Belief, MobileSensor, PlanningSettings
from vedette.densities import MultiTargetSamples
from vedette.densities.samples import sample_labelled
from vedette.densities.tracks import places_of
from vedette.filters import common_target_model
from vedette.filters.inputs import model_errors
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.ideal import propagate_samples
from vedette.models import kernel_motion


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
