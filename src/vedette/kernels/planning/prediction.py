"""Prediction of a decision's tracks to the horizon."""

from __future__ import annotations

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Motion
from vedette.kernels.gaussian.mixtures import copy_component
from vedette.kernels.gaussian.prediction import predict
from vedette.kernels.gaussian.scratch import make_scratch


@kernel
def predict_tracks(motion: Motion, dt: float, num_steps: int, means: Floats, covs: Floats) -> tuple[Floats, Floats]:
    """Each Gaussian after `num_steps` predictions, without birth or death."""
    new_means, new_covs = np.empty_like(means), np.empty_like(covs)
    dim = means.shape[1]
    scratch = make_scratch(dim, dim)
    old_means, old_covs = np.empty((1, dim)), np.empty((1, dim, dim))
    for c in range(len(means)):
        copy_component(means, covs, c, new_means, new_covs, c)
        for _ in range(num_steps):
            copy_component(new_means, new_covs, c, old_means, old_covs, 0)
            predict(motion, dt, old_means[0], old_covs[0], new_means[c], new_covs[c], scratch)
    return new_means, new_covs
