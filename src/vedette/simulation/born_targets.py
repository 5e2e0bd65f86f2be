"""Targets drawn anew in every run: Poisson births, or a steady crowd that is uniform over the region."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models import Modes, MotionModel, Region
from vedette.models.arguments import float_array, generator, reject
from vedette.models.fields import Count, NonNegative, Probability, check_fields
from vedette.simulation.true_motion import (
    check_moved,
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


@dataclass(frozen=True, slots=True, eq=False)
class UniformTargets:
    """A steady crowd: `number` targets at the first scan, and on average afterwards, uniform over the region.

    From scan to scan a target dies or moves with the motion's process noise. The number of births is Poisson with the
    mean number of deaths. A target that leaves the region is replaced by one that enters at the opposite edge with the
    same velocity. Otherwise the density would decrease towards the edges, the more the smaller the region.

    Attributes:
        motion: motion model.
        number: number of targets at the first scan.
        region: region of the targets.
        std: (state_dim - 2,) standard deviations of the components of an initial state after the position, with mean 0.
        death_probability: probability that a target dies between two scans.
    """

    motion: MotionModel
    number: Count
    region: Region
    std: Floats
    death_probability: Probability = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "UniformTargets.")
        std = float_array("UniformTargets.std", self.std, (self.motion.state_dim - 2,))
        if (std < 0.0).any():
            raise reject("UniformTargets.std", "numbers of at least 0", std.tolist())
        object.__setattr__(self, "std", std)

    def truth(self, times: ArrayLike, *, rng: np.random.Generator) -> Truth:
        """Draw deaths, motion and births, scan by scan.

        Raises:
            InputError: the scan times do not increase.
            ModelError: a motion function raised, or returned a state that is not finite.
        """
        scans = scan_times(times)
        generator(rng)
        states = self._born(self.number, rng)
        ids, num_ids = np.arange(self.number), self.number
        all_ids, all_states = [ids], [states]
        for dt in np.diff(scans).tolist():
            alive = rng.random(len(ids)) >= self.death_probability
            moved, stays = self._moved(states[alive], dt, rng)
            born = self._born(int(rng.poisson(self.number * self.death_probability)), rng)
            # Targets that stay keep their ids; those that enter follow with new ones, so that ids increase.
            states = np.concatenate([moved[stays], moved[~stays], born])
            num_new = len(states) - int(stays.sum())
            ids = np.concatenate([ids[alive][stays], num_ids + np.arange(num_new)])
            num_ids += num_new
            all_ids.append(ids)
            all_states.append(states)
        offsets: Ints = np.concatenate([[0], np.cumsum([len(ids) for ids in all_ids])]).astype(np.int64)
        rows, dim = np.concatenate(all_states), self.motion.state_dim
        factors = detection_factors_of(self.motion, rows[:, -1])
        return Truth(scans, offsets, np.concatenate(all_ids), rows[:, :dim], factors)

    def _born(self, num: int, rng: np.random.Generator) -> Floats:
        """(num, state_dim) initial states, behind them the mode of a motion with modes."""
        states = np.hstack([self.region.sample(num, rng=rng), self.std * rng.standard_normal((num, len(self.std)))])
        if not isinstance(self.motion, Modes):
            return states
        return np.column_stack([states, [first_mode(self.motion, rng) for _ in range(num)]])

    def _moved(self, states: Floats, dt: float, rng: np.random.Generator) -> tuple[Floats, Bools]:
        """States (and modes) `dt` seconds later, wrapped at edges, and (num,) whether a target crossed none."""
        if isinstance(self.motion, Modes):
            each = [moved_target(self.motion, own[:-1], int(own[-1]), dt, rng) for own in states]
            moved = np.array([[*state, mode] for state, mode in each]).reshape(states.shape)
        else:
            moved = self.motion.propagate(states, dt) + self._noise(states, dt, rng)
        check_moved(states, moved, dt)
        stays = self.region.contains(moved[:, :2])
        low, high = self.region.bounds[::2], self.region.bounds[1::2]
        moved[~stays, :2] = low + (moved[~stays, :2] - low) % (high - low)
        return moved, stays

    def _noise(self, states: Floats, dt: float, rng: np.random.Generator) -> Floats:
        """(num, state_dim) process noise."""
        normals = rng.standard_normal(states.shape)
        covs = self.motion.noise_covs(states, dt)
        if (covs == covs[:1]).all():  # most motion models: equal for all states
            return normals @ semidefinite_factor(covs[0]).T if len(covs) else normals
        factors = np.array([semidefinite_factor(cov) for cov in covs])
        return np.asarray((factors @ normals[:, :, np.newaxis])[:, :, 0])
