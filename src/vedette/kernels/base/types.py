"""What kernels take and give: bundles of arrays and model functions. They hold no behaviour and check nothing.

Ragged data is flat with offsets (CSR): the entries of item `i` are `offsets[i]:offsets[i + 1]`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class Tracks(NamedTuple):
    """Labelled Gaussian-mixture track densities.

    labels: (num_tracks, 2) birth step, birth index. offsets: (num_tracks + 1,) into the components.
    log_weights: (num_components,), normalised within each track. means: (num_components, state_dim).
    covs: (num_components, state_dim, state_dim).
    """

    labels: Ints
    offsets: Ints
    log_weights: Floats
    means: Floats
    covs: Floats


class Mixture(NamedTuple):
    """One Gaussian mixture of any total weight: log_weights (num,), means (num, state_dim), covs."""

    log_weights: Floats
    means: Floats
    covs: Floats


class Glmb(NamedTuple):
    """GLMB density: hypotheses over one shared track table. hyp_tracks holds indices into `tracks`, in label order."""

    tracks: Tracks
    hyp_offsets: Ints
    hyp_tracks: Ints
    hyp_log_weights: Floats


class Lmb(NamedTuple):
    """LMB density: one track a label, in label order. existence_logit: (num_tracks,) log r - log (1 - r)."""

    tracks: Tracks
    existence_logit: Floats


class Motion(NamedTuple):
    """Motion and survival functions with their parameter vectors. `method`: see `vedette.kernels.gaussian.kalman`."""

    transition: Any
    transition_jacobian: Any
    process_noise_cov: Any
    prob_survival: Any
    transition_params: Floats
    noise_params: Floats
    survival_params: Floats
    method: int


class Sensor(NamedTuple):
    """Measurement, noise, detection and clutter functions with their parameter vectors.

    angular: (meas_dim,) true where a component is an angle in radians, whose residuals are wrapped to (-pi, pi].
    """

    measurement: Any
    measurement_jacobian: Any
    measurement_noise_cov: Any
    prob_detection: Any
    log_clutter_intensity: Any
    measurement_params: Floats
    noise_params: Floats
    detection_params: Floats
    clutter_params: Floats
    angular: Bools
    method: int
