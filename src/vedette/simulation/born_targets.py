"""Targets drawn anew in every run: random births, motion, deaths and exits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Floats
from vedette.models import Modes, MotionModel, Region
from vedette.models.arguments import float_array, generator
from vedette.models.fields import NonNegative, Probability, check_fields
from vedette.simulation.true_motion import (
    detection_factors_of,
    first_mode,
    moved_states,
    moved_target,
    semidefinite_factor,
)
from vedette.simulation.truth import Truth, scan_times


@dataclass(frozen=True, slots=True, eq=False)
class PoissonTargets:
    """Targets with a Poisson number of births per scan, each at a state drawn from one Gaussian.

    From scan to scan a target dies or moves, with the motion's process noise. A target that leaves the region does not
    return.

    Attributes:
        motion: motion model.
        expected: mean number of births per scan.
        mean: (state_dim,) mean of an initial state.
        cov: (state_dim, state_dim) covariance of an initial state, positive semidefinite.
        death_probability: probability that a target dies between two scans.
        region: region of the targets. None: unbounded.

    Raises:
        InputError: names the field, the expected and the given value.
    """

    motion: MotionModel
    expected: NonNegative
    mean: Floats
    cov: Floats
    death_probability: Probability = 0.0
    region: Region | None = None

    def __post_init__(self) -> None:
        check_fields(self, "PoissonTargets.")
        dim = self.motion.state_dim
        object.__setattr__(self, "mean", float_array("PoissonTargets.mean", self.mean, (dim,)))
        object.__setattr__(self, "cov", float_array("PoissonTargets.cov", self.cov, (dim, dim)))
        semidefinite_factor(self.cov)

    def truth(self, times: ArrayLike, *, rng: np.random.Generator) -> Truth:
        """Draw all births, scan by scan, then the life of each target.

        Raises:
            InputError: the scan times do not increase.
            ModelError: a motion function raised, or returned a state that is not finite.
        """
        scans = scan_times(times)
        generator(rng)
        births = np.repeat(np.arange(len(scans)), rng.poisson(self.expected, len(scans)))
        noise = rng.standard_normal((len(births), len(self.mean)))
        starts = self.mean + noise @ semidefinite_factor(self.cov).T
        alive = np.zeros((len(births), len(scans)), np.bool_)
        states, modes = np.zeros((*alive.shape, len(self.mean))), np.zeros(alive.shape, np.int64)
        for target, (birth, state) in enumerate(zip(births.tolist(), starts, strict=True)):
            trajectory, taken = self._life(state, scans[birth:], rng)
            life = slice(birth, birth + len(trajectory))
            alive[target, life], states[target, life], modes[target, life] = True, trajectory, taken
        return Truth.from_arrays(scans, alive, states, detection_factors_of(self.motion, modes))

    def _life(self, state: Floats, times: Floats, rng: np.random.Generator) -> tuple[Floats, list[int]]:
        """(num_scans of its life, state_dim) states of a target from its first scan, and its modes."""
        states, modes = list[Floats](), list[int]()
        mode = first_mode(self.motion, rng) if isinstance(self.motion, Modes) else 0
        for scan in range(len(times)):
            if scan > 0:
                if rng.random() < self.death_probability:
                    break
                dt = float(times[scan] - times[scan - 1])
                if isinstance(self.motion, Modes):
                    state, mode = moved_target(self.motion, state, mode, dt, rng)
                else:
                    normals = rng.standard_normal((1, len(state)))
                    state = moved_states(self.motion, state[np.newaxis], dt, normals, np.ones(1, np.bool_))[0]
            if self.region is not None and not self.region.contains(state[np.newaxis, :2])[0]:
                break
            states.append(state)
            modes.append(mode)
        return np.array(states).reshape(-1, len(state)), modes
