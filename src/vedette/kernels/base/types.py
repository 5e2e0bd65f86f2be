"""Inputs and outputs of kernels: bundles of arrays and model functions, without behaviour or checks.

Ragged data is flat with offsets (CSR): the entries of item `i` are `offsets[i]:offsets[i + 1]`.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Marks of Gaussian components, (num, 1 + num_classes). All functions that depend on the columns are in
# `vedette.kernels.gaussian.marks`, so that a new column is added only here and there.
Marks = Floats
MODE = 0  # mode of motion, or -1: not drawn yet, as at birth
CLASSES = 1  # first of the log probabilities of the classes of a target

# States begin with the position, those of four components or more also with the velocity. Others are found by name.
VX, VY = 2, 3
VELOCITY = slice(VX, VY + 1)  # m/s
# Longest step of a chain of modes, in mean stays in the mode that is left fastest. A longer time is divided.
LONGEST_MODE_STEP = 0.25
HEIGHT, CLIMB = "pz", "vz"  # names of the height, m, and the vertical velocity, m/s
PLANE = ("px", "py", "vx", "vy")
STATE_COMPONENTS = {
    "constant_velocity": PLANE,
    "coordinated_turn": (*PLANE, "turn_rate"),
    "constant_velocity_height": (*PLANE, HEIGHT, CLIMB),
    "constant_turn": PLANE,
    "constant_acceleration": (*PLANE, "ax", "ay"),
    "ornstein_uhlenbeck": PLANE,
    "random_walk": PLANE[:2],
}

# Components of a pose have fixed places. A shorter pose lacks the last ones.
HEADING = 2  # rad
POINTING, HALF_WIDTH = 3, 4  # middle and half width of a camera's field of view, rad
BUDGET = 5  # remaining seconds of scanning
OWN_VELOCITY = 6  # velocity of the sensor, two components, m/s
BEAM, TURN_RATE = 8, 9  # bearing of the beam in the middle of a turn, rad, and turn rate of the beam, rad/s
OWN_HEIGHT = 10  # height of the sensor, m
VISITS = 11  # seconds since the last visit of the first place; those of the other places follow


def place_of(name: str, components: Sequence[str]) -> int:
    """Return the place of a component in states, or -1 if they do not have it."""
    return components.index(name) if name in components else -1


def common_components(states: Iterable[Sequence[str]]) -> tuple[str, ...]:
    """Return the components that at least one kind of state has: position and velocity first, then others in order."""
    found = dict.fromkeys(name for components in states for name in components)
    return (*(name for name in PLANE if name in found), *(name for name in found if name not in PLANE))


class Mixture(NamedTuple):
    """Gaussian components: one mixture of any total weight, or several that offsets separate."""

    log_weights: Floats  # (num,)
    means: Floats  # (num, state_dim)
    covs: Floats  # (num, state_dim, state_dim)
    marks: Marks


class Tracks(NamedTuple):
    """Labelled Gaussian-mixture track densities."""

    labels: Ints  # (num_tracks, 2) birth step, birth index
    offsets: Ints  # (num_tracks + 1,) into the components
    components: Mixture  # weights are normalised within each track


class Glmb(NamedTuple):
    """GLMB density: hypotheses over one shared track table (Vo, Vo, Hoang 2017, eq. 12, paper eq. 4)."""

    tracks: Tracks
    hyp_offsets: Ints  # (num_hyps + 1,) into hyp_tracks
    hyp_tracks: Ints  # indices into `tracks`; those of one hypothesis in label order
    hyp_log_weights: Floats  # (num_hyps,)


class Lmb(NamedTuple):
    """LMB density: one track per label, in label order."""

    tracks: Tracks
    existence_logit: Floats  # (num_tracks,) log r - log (1 - r)


class FactoredGlmb(NamedTuple):
    """Product of independent GLMBs over disjoint labels (factors), one after the other in shared arrays."""

    tracks: Tracks  # tracks of a factor are adjacent
    track_offsets: Ints  # (num_factors + 1,) into `tracks`
    hyp_offsets: Ints  # (num_hyps + 1,) into hyp_tracks; hypotheses of a factor together
    hyp_tracks: Ints  # indices into `tracks`; those of one hypothesis in label order
    hyp_log_weights: Floats  # (num_hyps,) normalised within each factor
    factor_offsets: Ints  # (num_factors + 1,) into the hypotheses


class Switching(NamedTuple):
    """Changes of the mode of motion of a target: a Markov chain in continuous time."""

    rates: Floats  # (num_modes, num_modes) of the changes from row to column, 1/s; rows sum to 0
    at_birth: Floats  # (num_modes,) probabilities of the mode of a target that was born
    merge_distance: float  # within which predicted components of one mode merge; inf: all of them


class Motion(NamedTuple):
    """Motion and survival functions with their parameters, the first two with a row for each mode of motion."""

    transition: Any
    transition_jacobian: Any
    process_noise_cov: Any
    prob_survival: Any
    transition_params: Floats  # (num_modes, k)
    noise_params: Floats  # (num_modes, l)
    survival_params: Floats
    switching: Switching
    method: int  # LINEARISED, UNSCENTED or CUBATURE of `vedette.kernels.gaussian.sigma_points`


class Sensor(NamedTuple):
    """Measurement, noise, detection and clutter functions with their parameter vectors."""

    measurement: Any
    measurement_jacobian: Any
    measurement_noise_cov: Any
    prob_detection: Any
    mean_prob_detection: Any  # mean over a Gaussian; used depending on `detection_rule`
    log_clutter_intensity: Any
    measurement_params: Floats
    noise_params: Floats
    detection_params: Floats
    clutter_params: Floats
    periods: Floats  # (meas_dim,) interval after which a component repeats, such as 2 pi for an angle; inf: it does not
    method: int  # as in `Motion`, or SWITCHED
    height: int  # place in states of the height that the measurement depends on, or -1
    detection_rule: int  # AT_CENTRE, CLOSED_FORM, BY_NODES or AT_EDGES of `vedette.kernels.gaussian.detection`
    detection_nodes: Floats  # (num, 3) weight and two standard deviates per node; empty for AT_CENTRE
    mode_factors: Floats  # (num_modes,) on the probability of detection; empty: none


class Measurements(NamedTuple):
    """The rows of a scan and what they bring with them. Fields that no row brings are empty."""

    values: Floats  # (num, meas_dim), finite
    noise: Floats  # (num, meas_dim, meas_dim) covariance; variance 0: that of the noise model, inf: not measured
    added_noise: Floats  # (num, meas_dim, meas_dim) covariance in addition to it, or to that of the noise model
    log_ratios: Floats  # (num,) log likelihood ratio of a row's features, target over clutter
    class_ratios: Floats  # (num, num_classes) the same of further features, log, for targets of each class


class RowNoise(NamedTuple):
    """The noise that one row brings. Fields are empty as in `Measurements`."""

    own: Floats  # (1, meas_dim, meas_dim)
    added: Floats  # (1, meas_dim, meas_dim)


class ScanInput(NamedTuple):
    """One scan of a sensor, and the births since the previous scan."""

    birth: Lmb  # births since the previous scan
    measurements: Measurements
    pose: Floats  # (pose_dim,) of the sensor
    dt: float  # seconds since the previous scan
