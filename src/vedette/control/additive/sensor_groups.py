"""Starting point of a decision by sums over labels: beliefs without scans, samples, and sensors evaluated as one."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from vedette.control.known_models import decision_of
from vedette.control.prediction import Prediction, draw_paths, targets_of
from vedette.control.settings import IDEAL_MODES, MobileSensor, PlanningSettings, scans_within
from vedette.densities import LMB
from vedette.densities.checks import offsets_of
from vedette.densities.containers import unchecked
from vedette.densities.tracks import places_of, single_gaussians, take_tracks
from vedette.internal.probabilities import logit
from vedette.kernels.base.types import Floats, Ints, Lmb
from vedette.kernels.planning.ideal import EXPECTED, IDEAL, Decision, SampledTrajectories
from vedette.kernels.planning.known_changes import rows_without_scans
from vedette.kernels.planning.reach import Belief, Paths, label_radii, predict_paths
from vedette.models import SensorModel
from vedette.platforms import Options
from vedette.tracking import State


class Task(NamedTuple):
    """Inputs from which one horizon is prepared."""

    sensors: Sequence[MobileSensor]
    options: Sequence[Options]  # for each sensor, with courses over the horizon
    settings: PlanningSettings
    state: State
    prediction: Prediction
    sampled: bool  # False: no samples, P_D is the mean over the predicted Gaussian


class Samples(NamedTuple):
    """Samples of the fused density over the horizon, and the target of each label."""

    states: Floats  # (horizon_steps, num_targets, state_dim)
    offsets: Ints  # (num_samples + 1,) first target of each sample
    targets: Ints  # (num_labels, num_samples) index of each label's target, -1 if absent

    @classmethod
    def draw(
        cls, fused: Any, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
    ) -> "Samples":
        """Draw `num_samples` samples and propagate them over the horizon without noise."""
        drawn, states = draw_paths(fused, sensors, settings, rng=rng)
        return cls(states, drawn.offsets, targets_of(fused.tracks.labels, drawn.labels, drawn.offsets))

    @classmethod
    def none(cls, fused: Any, settings: PlanningSettings) -> "Samples":
        """Return one sample without targets, for rewards that need no samples."""
        states = np.empty((settings.horizon_steps, 0, fused.state_dim))
        return cls(states, np.zeros(2, np.int64), np.full((fused.tracks.num_tracks, 1), -1))

    def futures(self, meas_dim: int, settings: PlanningSettings, *, rng: np.random.Generator) -> SampledTrajectories:
        """Return the trajectories for one sensor. Draws random numbers for detections and noise if they are needed."""
        mode = IDEAL_MODES[settings.ideal_measurements]
        shape = self.states.shape[:2]
        uniforms = rng.random(shape) if mode != IDEAL else np.empty((0, 0))
        noisy = mode not in (IDEAL, EXPECTED)
        normals = rng.standard_normal((*shape, meas_dim)) if noisy else np.empty((0, 0, meas_dim))
        return SampledTrajectories(self.offsets, self.states, uniforms, normals)


class SensorGroup(NamedTuple):
    """Sensors with equal models and the same belief, whose courses are evaluated as those of one sensor."""

    members: tuple[int, ...]
    belief: Belief  # restricted to labels of the fused density
    labels: Ints  # (num_own,) indices of the sensor's labels in the fused density
    decision: Decision
    rows: Floats  # (num_own, bernoulli_size) without scans
    course_offsets: Ints  # (num_members + 1,) first course of each member
    reach: float  # m, maximum detection range of these sensors


class SensorGroups(NamedTuple):
    """All sensor groups, and the rows of the prediction."""

    groups: tuple[SensorGroup, ...]
    references: Floats  # (num_labels, state_dim) means of the prediction, reference points of all rows
    prior: Floats  # (num_labels, bernoulli_size)
    bases: tuple[Floats, ...]  # for each sensor (num_labels, bernoulli_size), its own belief without scans
    num_samples: int


def prepare_groups(task: Task, missing_existence: float, *, rng: np.random.Generator) -> SensorGroups:
    """Return the sensor groups with their rows before any scan.

    missing_existence: existence assumed for a label that a sensor lacks.
    """
    settings, given = task.settings, task.prediction.end.to_kernel()
    if task.sampled:
        samples = Samples.draw(task.state.fused, task.sensors, settings, rng=rng)
    else:
        samples = Samples.none(task.state.fused, settings)
    references = given.tracks.components.means
    prior = rows_without_scans(references, given.tracks.components.covs, given.existence_logit, references)
    shared = IDEAL_MODES[settings.ideal_measurements] == IDEAL or not task.sampled
    scans = scans_within(task.sensors, task.options, task.state.time, settings)
    groups, bases = list[SensorGroup](), [prior] * len(task.sensors)
    for members in _alike(task, shared=shared):
        sensor = task.sensors[members[0]]
        futures = samples.futures(sensor.filter.sensor.meas_dim, settings, rng=rng)
        courses = np.concatenate([task.options[s].courses for s in members])
        scans_at = np.concatenate([scans[s] for s in members])
        decision = decision_of(sensor, courses, futures, settings, scans_at, None if task.sampled else "mean")
        labels, now, paths, rows = _without_scans(task.prediction, task.state.local[members[0]], decision, prior)
        targets = np.ascontiguousarray(samples.targets[labels])
        offsets = offsets_of([len(task.options[s].courses) for s in members])
        belief = Belief(now, paths, targets, label_radii(paths, targets, samples.states))
        reach = sensor.filter.sensor.detection.reach
        group = SensorGroup(members, belief, labels, decision, rows, offsets, reach)
        row = _spread(group, prior, missing_existence)
        for s in members:
            bases[s] = row
        groups.append(group)
    return SensorGroups(tuple(groups), references, prior, tuple(bases), samples.targets.shape[1])


def _alike(task: Task, *, shared: bool) -> list[tuple[int, ...]]:
    """Return groups of sensors with the same belief and equal models, or each sensor alone unless `shared`."""
    if not shared:
        return [(s,) for s in range(len(task.sensors))]
    groups: dict[object, list[int]] = {}
    for s, (sensor, belief) in enumerate(zip(task.sensors, task.state.local, strict=True)):
        groups.setdefault((id(belief), _model_key(sensor.filter.sensor)), []).append(s)
    return list(map(tuple, groups.values()))


@lru_cache(maxsize=1000)
def _model_key(model: SensorModel) -> tuple[object, ...]:
    """Return a key that is equal for sensors with equal models (cached)."""
    return tuple(part.tobytes() if isinstance(part, np.ndarray) else part for part in model.to_kernel())


def _without_scans(
    prediction: Prediction, belief: LMB, decision: Decision, prior: Floats
) -> tuple[Ints, Lmb, Paths, Floats]:
    """Return the labels shared with the prediction, their present tracks, their paths, and their rows without scans.

    Labels are indices into the prediction. For the fused belief these are the prediction's own.
    """
    exists = belief.existence_logit > -np.inf
    if belief is prediction.fused and exists.all():
        return np.arange(len(prior)), prediction.now, prediction.paths, prior
    places = places_of(belief.tracks.labels, prediction.end.tracks.labels)
    own, horizon = np.flatnonzero((places >= 0) & exists), decision.horizon
    now = unchecked(LMB, single_gaussians(take_tracks(belief.tracks, own)), belief.existence_logit[own]).to_kernel()
    paths = predict_paths(
        decision.motion, horizon.dt, horizon.poses.shape[1], now.tracks.components.means, now.tracks.components.covs
    )
    ends = np.ascontiguousarray(paths.means[:, -1]), np.ascontiguousarray(paths.covs[:, -1])
    rows = rows_without_scans(*ends, now.existence_logit, prediction.end.tracks.means[places[own]])
    return places[own], now, paths, rows


def _spread(group: SensorGroup, prior: Floats, missing_existence: float) -> Floats:
    """Return rows for all labels. A label that the sensor lacks gets the existence `missing_existence` or less."""
    if group.rows is prior:
        return prior
    rows = np.zeros_like(prior)
    rows[:, -2] = min(logit(missing_existence), float(group.rows[:, -2].min(initial=np.inf)))
    rows[group.labels] = group.rows
    return rows
