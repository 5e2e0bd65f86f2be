"""Where a decision by sums over labels starts: beliefs without scans, samples, sensors that can be worked on as one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vedette.control.priors import decision_of, draw_paths, targets_of
from vedette.control.settings import IDEAL_MODES, MobileSensor, PlanningSettings, scans_within
from vedette.densities import LMB
from vedette.densities.checks import offsets_of
from vedette.densities.containers import unchecked
from vedette.densities.tracks import places_of, single_gaussians, take_tracks
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.planning.ideal import EXPECTED, IDEAL, Decision, Futures
from vedette.kernels.planning.known import rows_without_scans
from vedette.kernels.planning.reach import Belief, label_radii, predict_paths
from vedette.platforms import Options
from vedette.probabilities import logit
from vedette.tracking import State


class Samples(NamedTuple):
    """Samples of the fused density over the horizon, and which target is of which label."""

    states: Floats  # (horizon_steps, num_targets, state_dim)
    offsets: Ints  # (num_samples + 1,) into the targets
    targets: Ints  # (num_labels, num_samples) place of each label's target, -1 where it is not there

    @classmethod
    def draw(
        cls, fused: Any, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
    ) -> Samples:
        """`num_samples` of them, carried over the horizon without noise."""
        drawn, states = draw_paths(fused, sensors, settings, rng=rng)
        return cls(states, drawn.offsets, targets_of(fused.tracks.labels, drawn.labels, drawn.offsets))

    @classmethod
    def none(cls, fused: Any, settings: PlanningSettings) -> Samples:
        """One sample in which nobody is there, for what needs no samples."""
        states = np.empty((settings.horizon_steps, 0, fused.state_dim))
        return cls(states, np.zeros(2, np.int64), np.full((fused.tracks.num_tracks, 1), -1))

    def futures(self, meas_dim: int, settings: PlanningSettings, *, rng: np.random.Generator) -> Futures:
        """As one sensor meets them; random numbers of detections and noise are drawn where they are wanted."""
        mode = IDEAL_MODES[settings.ideal_measurements]
        shape = self.states.shape[:2]
        uniforms = rng.random(shape) if mode != IDEAL else np.empty((0, 0))
        noisy = mode not in (IDEAL, EXPECTED)
        normals = rng.standard_normal((*shape, meas_dim)) if noisy else np.empty((0, 0, meas_dim))
        return Futures(self.offsets, self.states, uniforms, normals)


class SensorGroup(NamedTuple):
    """Sensors of one model that start from one belief: their courses are those of one sensor."""

    members: tuple[int, ...]
    belief: Belief  # of labels that the fused density has
    labels: Ints  # (num_own,) place of the sensor's labels among those of the fused density
    decision: Decision
    rows: Floats  # (num_own, bernoulli_size) without scans
    course_offsets: Ints  # (num_members + 1,)
    reach: float  # m, beyond which these sensors detect nothing


class Start(NamedTuple):
    """All groups, and the prediction's rows."""

    groups: tuple[SensorGroup, ...]
    references: Floats  # (num_labels, state_dim) means of the prediction, about which all rows are taken
    prior: Floats  # (num_labels, bernoulli_size)
    bases: tuple[Floats, ...]  # for each sensor (num_labels, bernoulli_size) of its own belief without scans
    num_samples: int


def starts_of(
    prediction: LMB,
    state: State,
    sensors: Sequence[MobileSensor],
    options: Sequence[Options],
    settings: PlanningSettings,
    *,
    missing_existence: float,
    sampled: bool,
    rng: np.random.Generator,
) -> Start:
    """What the changes of the sensors' scans are added to.

    prediction: the fused density at the end of the horizon, of one Gaussian a label. options: of each sensor, with
    courses over the horizon. missing_existence: of a label that a sensor lacks. sampled: false for what needs no
    samples, and takes the mean P_D over the predicted Gaussian.
    """
    samples = Samples.draw(state.fused, sensors, settings, rng=rng) if sampled else Samples.none(state.fused, settings)
    given = prediction.to_kernel()
    references, covs = given.tracks.components.means, given.tracks.components.covs
    prior = rows_without_scans(references, covs, given.existence_logit, references)
    courses, scans = [own.courses for own in options], scans_within(sensors, options, state.time, settings)
    shared, groups = IDEAL_MODES[settings.ideal_measurements] == IDEAL or not sampled, []
    for members in _alike(sensors, state.local, shared=shared):
        group = _group(members, prediction, state.local, sensors, courses, scans, samples, settings, sampled, rng)
        groups.append(group)
    bases: list[Floats] = [prior] * len(sensors)
    for group in groups:
        row = _spread(group, prior, missing_existence)
        for s in group.members:
            bases[s] = row
    return Start(tuple(groups), references, prior, tuple(bases), samples.targets.shape[1])


def _alike(sensors: Sequence[MobileSensor], beliefs: Sequence[Any], *, shared: bool) -> list[tuple[int, ...]]:
    """Sensors with the same belief and equal models together; each by itself unless `shared`."""
    found: dict[object, list[int]] = {}
    for s, (sensor, belief) in enumerate(zip(sensors, beliefs, strict=True)):
        key: list[object] = [id(belief)]
        for part in sensor.filter.sensor.to_kernel():
            key.append(part.tobytes() if isinstance(part, np.ndarray) else part)
        found.setdefault(tuple(key) if shared else s, []).append(s)
    return list(map(tuple, found.values()))


def _group(
    members: tuple[int, ...],
    prediction: LMB,
    beliefs: Sequence[Any],
    sensors: Sequence[MobileSensor],
    courses: Sequence[Floats],
    scans: Sequence[Bools],
    samples: Samples,
    settings: PlanningSettings,
    sampled: bool,
    rng: np.random.Generator,
) -> SensorGroup:
    sensor, belief = sensors[members[0]], beliefs[members[0]]
    places = places_of(belief.tracks.labels, prediction.tracks.labels)
    own = np.flatnonzero((places >= 0) & (belief.existence_logit > -np.inf))
    prior = unchecked(LMB, single_gaussians(take_tracks(belief.tracks, own)), belief.existence_logit[own]).to_kernel()
    futures = samples.futures(sensor.filter.sensor.meas_dim, settings, rng=rng)
    together, when = (np.concatenate([own[s] for s in members]) for own in (courses, scans))
    decision = decision_of(sensor, together, futures, settings, when, None if sampled else "mean")
    labels, gaussians, horizon = places[own], prior.tracks.components, decision.horizon
    paths = predict_paths(decision.motion, horizon.dt, horizon.poses.shape[1], gaussians.means, gaussians.covs)
    ends = np.ascontiguousarray(paths.means[:, -1]), np.ascontiguousarray(paths.covs[:, -1])
    rows = rows_without_scans(*ends, prior.existence_logit, prediction.tracks.means[labels])
    targets = np.ascontiguousarray(samples.targets[labels])
    offsets = offsets_of([len(courses[s]) for s in members])
    known = Belief(prior, paths, targets, label_radii(paths, targets, samples.states))
    return SensorGroup(members, known, labels, decision, rows, offsets, sensor.filter.sensor.detection.reach)


def _spread(group: SensorGroup, prior: Floats, missing_existence: float) -> Floats:
    """The rows on all labels; of one that the sensor lacks, an existence that it would hardly have missed."""
    rows = np.zeros_like(prior)
    rows[:, -2] = min(logit(missing_existence), float(group.rows[:, -2].min(initial=np.inf)))
    rows[group.labels] = group.rows
    return rows
