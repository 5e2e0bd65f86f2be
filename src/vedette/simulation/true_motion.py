"""Motion of true targets: over one step, and through the modes of a motion."""

import math

import numpy as np

from vedette.errors import InputError, ModelError
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models import Modes, MotionModel

# A pivot below this share of its variance is rounding: that direction has no noise of its own.
_PIVOT_TOLERANCE = 1e-12


def first_mode(modes: Modes, rng: np.random.Generator) -> int:
    """Draw the mode of a new target."""
    return int(rng.choice(len(modes.motions), p=modes.at_birth))


def moved_target(modes: Modes, state: Floats, mode: int, dt: float, rng: np.random.Generator) -> tuple[Floats, int]:
    """Return the state and mode of a target `dt` seconds later, with process noise, through all modes in between."""
    left, noisy = dt, np.ones(1, np.bool_)
    while True:
        rate = -float(modes.rates[mode, mode])
        stay = rng.exponential(1.0 / rate) if rate > 0.0 else math.inf
        leg, normals = min(stay, left), rng.standard_normal((1, len(state)))
        state = moved_states(modes.in_common[mode], state[np.newaxis], leg, normals, noisy)[0]
        left -= leg
        if left <= 0.0:
            return state, mode
        following = np.maximum(modes.rates[mode], 0.0) / rate
        mode = int(rng.choice(len(following), p=following))


def detection_factors_of(motion: MotionModel, modes: Ints | Floats) -> Floats | None:
    """Return the factor of each mode on the probability of detection, or None if the motion has none below 1."""
    if not isinstance(motion, Modes) or motion.detection_factors.min() == 1.0:
        return None
    return motion.detection_factors[modes.astype(np.int64)]


def manoeuvring_target(
    modes: Modes, state: Floats, elapsed: Floats, rng: np.random.Generator | None
) -> tuple[Floats, Ints]:
    """Return the states of a target at each scan, (num_scans, state_dim), and its modes then, (num_scans,).

    elapsed: s since the previous scan, or 0. rng: None for the first mode without noise.
    """
    mode, states = 0 if rng is None else first_mode(modes, rng), np.empty((len(elapsed), len(state)))
    taken = np.empty(len(elapsed), np.int64)
    for scan, dt in enumerate(elapsed.tolist()):
        if rng is None:
            state = modes.in_common[0].propagate(state, dt)[0] if dt > 0.0 else state
        elif dt > 0.0:
            state, mode = moved_target(modes, state, mode, dt, rng)
        states[scan], taken[scan] = state, mode
    return states, taken


def moved_states(motion: MotionModel, states: Floats, dt: float, normals: Floats, noisy: Bools) -> Floats:
    """(num, state_dim) states `dt` seconds later, with process noise where `noisy`. Raises `ModelError`.

    normals: (num, state_dim) standard normal deviates, read where `noisy`.
    """
    moved, disturbed = motion.propagate(states, dt), noisy.nonzero()[0]
    if len(disturbed):
        factors: dict[bytes, Floats] = {}
        for i, cov in zip(disturbed.tolist(), motion.noise_covs(states[disturbed], dt), strict=True):
            key = cov.tobytes()  # most motion models: equal for all states
            if key not in factors:
                factors[key] = semidefinite_factor(cov)
            moved[i] += factors[key] @ normals[i]
    check_moved(states, moved, dt)
    return moved


def check_moved(states: Floats, moved: Floats, dt: float) -> None:
    """Raise `ModelError` unless all propagated states (num, state_dim) are finite."""
    if not np.isfinite(moved).all():
        bad = np.isfinite(moved).all(axis=1).argmin()
        state, got = states[bad], moved[bad]
        raise ModelError(f"motion of a target at state {state}, dt {dt}: expected a finite state; got {got}")


def semidefinite_factor(cov: Floats) -> Floats:
    """Return lower L with L L' = cov for a positive semidefinite covariance, which may be singular."""
    factor = np.zeros_like(cov)
    for j in range(len(cov)):
        column = cov[j:, j] - factor[j:, :j] @ factor[j, :j]
        if column[0] < -_PIVOT_TOLERANCE * max(1.0, cov[j, j]) or not np.isfinite(column).all():
            raise InputError(f"covariance: expected positive semidefinite; got {cov.tolist()}")
        if column[0] > _PIVOT_TOLERANCE * cov[j, j]:
            factor[j:, j] = column / np.sqrt(column[0])
    return factor
