"""Targets that appear anywhere in a region, on cells: prediction, scans, and the posterior of their birth rate."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vedette.densities import (
    FactoredGLMB,
    LearntRate,
    UndetectedIntensity,
    UndetectedTargets,
    existence_probabilities,
    track_moments,
)
from vedette.densities.checks import distinct_labels
from vedette.densities.label_sets import are_among
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.steps.lmb import Reduction
from vedette.kernels.steps.undetected import survival_probabilities, take_out_detected
from vedette.models import BirthModel, SensorModel, SurvivalModel, TargetModel, UndetectedModel, kernel_motion
from vedette.models.arguments import reject

# Shape of the gamma prior of a learnt birth rate: half a target has been seen.
_SHAPE = 0.5
# Nodes along each side of a cell by which P_D is averaged: of 16 x 16 cells, and of cells that a user has chosen.
_NODES, _NODES_OF_CHOSEN = 2, 3


class Appearing(NamedTuple):
    """Targets that appear anywhere in a region, by cells."""

    model: UndetectedModel
    states: Floats  # (num_cells, num_nodes, state_dim) nodes of the cells
    node_weights: Floats  # (num_nodes,)


@lru_cache(maxsize=100)
def appearing(birth: BirthModel) -> Appearing | None:
    """The cells of targets that appear anywhere; None where the births have no region."""
    measured, model, nodes = birth.from_measurements, birth.anywhere, _NODES_OF_CHOSEN
    if model is None:
        model, nodes = None if measured is None else measured.uniform(), _NODES
    if model is None:
        return None
    return Appearing(model, model.grid.states(birth.state_dim, nodes), model.grid.node_weights(nodes))


def predicted_cells(
    before: UndetectedTargets, targets: TargetModel, dt: float, *, appear: bool
) -> tuple[UndetectedIntensity | None, LearntRate | None]:
    """The targets that appeared anywhere, and what is known of a learnt birth rate, `dt` seconds later.

    The first prediction makes the cells: with the targets that are there at first, or those born since the start.
    appear: whether targets have been born since then; else nobody has.
    Raises `InputError` for a belief of other cells.
    """
    birth, places = targets.birth, appearing(targets.birth)
    if places is None or not (appear or before.cells is not None):
        return before.cells, before.birth_rate
    model, learnt, measured = places.model, before.birth_rate, birth.from_measurements
    rate = model.first_rate if learnt is None else learnt.rate
    in_scans = birth.anywhere is None and measured is not None and not isinstance(measured.expected, str)
    if in_scans:
        rate = measured.expected / (dt if birth.period is None else birth.period)  # type: ignore[union-attr, operator]
    if model.is_learnt and learnt is None:
        no_labels = np.empty((0, 2), np.int64), np.empty(0)
        learnt = LearntRate(rate, 0.0, np.zeros(model.grid.num_cells), 0.0, *no_labels)
    if before.cells is None:
        first = model.initial() + (model.births(dt, rate) if in_scans else 0.0)
        return UndetectedIntensity(model.grid, first), learnt
    if before.cells.grid != model.grid:
        raise reject("belief.undetected.cells", f"those of the filter's births, {model.grid}", before.cells.grid)
    survival = survival_in_cells(model, targets, dt)
    cells = UndetectedIntensity(model.grid, model.predict(before.cells.expected, dt, survival, rate * appear))
    if learnt is not None:
        learnt = replace(learnt, unit=model.predict(learnt.unit, dt, survival, float(appear)))
    return cells, learnt


def survival_in_cells(model: UndetectedModel, targets: TargetModel, dt: float) -> Floats | float:
    """Probability of living through `dt` seconds, in each cell (num_cells,) or everywhere."""
    if model.survival is not None:
        return float(model.survival**dt)
    motion = kernel_motion(targets.motion, targets.survival)
    return survival_probabilities(motion, dt, model.grid.states(targets.state_dim, 1)[:, 0].copy())


def cells_after(
    before: UndetectedTargets, birth: BirthModel, sensor: SensorModel, scan: Floats, pose: Floats
) -> tuple[UndetectedIntensity | None, LearntRate | None]:
    """The targets that appeared anywhere and that a scan did not detect, and what is then known of the birth rate."""
    cells, learnt, places = before.cells, before.birth_rate, appearing(birth)
    if cells is None or places is None:
        return cells, learnt
    look = sensor.to_kernel(), pose, places.states, places.node_weights
    left = UndetectedIntensity(cells.grid, take_out_detected(*look, cells.expected))
    if learnt is None:
        return left, None
    unit = take_out_detected(*look, learnt.unit)
    exposure = learnt.exposure + float(learnt.unit.sum() - unit.sum())
    step, index = before.next_label
    labels = np.column_stack([np.full(len(scan), step), index + np.arange(len(scan))])
    return left, replace(
        learnt,
        unit=unit,
        exposure=exposure,
        labels=np.concatenate([learnt.labels, labels]),
        shares=np.concatenate([learnt.shares, _shares(before, learnt, birth, sensor, scan, pose)]),
    )


def _shares(
    before: UndetectedTargets, learnt: LearntRate, birth: BirthModel, sensor: SensorModel, scan: Floats, pose: Floats
) -> Floats:
    """(num_measurements,) of the intensity at each measurement, the share of targets born after the first scan.

    Others were there at first, come from birth sites, or had a label before. Noise is taken as half of the standard
    deviation of a birth.
    """
    measured, cells = birth.from_measurements, before.cells
    if measured is None or cells is None or not len(scan):
        return np.zeros(len(scan))
    positions = sensor.measurement.positions(scan, pose)
    spread = before.intensity.covs[:, :2, :2] + np.diag((0.5 * measured.std[:2]) ** 2)
    apart = positions[:, np.newaxis] - before.intensity.means[:, :2]
    squares = np.einsum("mci,cij,mcj->mc", apart, np.linalg.inv(spread), apart)
    peaks = np.exp(before.intensity.log_weights) / (2.0 * np.pi * np.sqrt(np.linalg.det(spread)))
    elsewhere = np.exp(-0.5 * squares) @ peaks
    born = learnt.rate * density_at(cells.grid.cells_at(positions), learnt.unit, cells)
    total = density_at(cells.grid.cells_at(positions), cells.expected, cells) + elsewhere
    return np.asarray(np.divide(born, total, out=np.zeros(len(scan)), where=born > 0.0))


def density_at(at: Ints, expected: Floats, cells: UndetectedIntensity) -> Floats:
    """(num,) targets per square metre in the cells `at`; 0 outside of the region (-1)."""
    width, height = cells.grid.cell_size
    return np.where(at >= 0, expected[at], 0.0) / (width * height)


def with_deaths(
    before: UndetectedTargets, belief: FactoredGLMB, survival: SurvivalModel, dt: float
) -> UndetectedTargets:
    """The same, where targets of a learnt birth rate that died within `dt` seconds are still counted as detected."""
    learnt = before.birth_rate
    if learnt is None or not len(learnt.labels):
        return before
    labels, existence = existence_probabilities(belief)
    of_track = distinct_labels(belief.tracks.labels)[1]
    dying = 1.0 - survival.prob(track_moments(belief.tracks)[0], dt)
    mean = np.bincount(of_track, dying, len(labels)) / np.bincount(of_track, minlength=len(labels))
    died = float((_shares_of(learnt, labels) * existence * mean).sum())
    return replace(before, birth_rate=replace(learnt, past=learnt.past + died))


def with_learnt_rate(
    undetected: UndetectedTargets, before: FactoredGLMB, kept: FactoredGLMB, birth: BirthModel
) -> UndetectedTargets:
    """The undetected targets with the posterior birth rate, and as many of them as it says.

    Of a prior gamma density of shape a and mean 1/T, n expected first detections and an exposure E, the posterior mean
    is (a + n) / (a T + E). A measurement counts with the probability that it was one. Labels that are not yet decided
    then change nothing: they are as many as the rate has it.

    before, kept: the belief with the labels that were dropped and without them.
    """
    learnt, cells, places = undetected.birth_rate, undetected.cells, appearing(birth)
    if learnt is None or cells is None or places is None:
        return undetected
    labels, existence = existence_probabilities(before)
    is_held = are_among(labels, kept.tracks.labels)
    shares = _shares_of(learnt, labels)
    past = learnt.past + float((shares * existence)[~is_held].sum())
    number = past + float((shares * existence)[is_held].sum())
    rate = (_SHAPE + number) / (_SHAPE / places.model.prior_rate + learnt.exposure)
    expected = np.maximum(cells.expected + (rate - learnt.rate) * learnt.unit, 0.0)
    counted = is_held & (shares > 0.0)
    learnt = replace(learnt, rate=rate, past=past, labels=labels[counted], shares=shares[counted])
    return replace(undetected, cells=UndetectedIntensity(cells.grid, expected), birth_rate=learnt)


def with_faint_candidates(reduction: Reduction, undetected: UndetectedTargets, birth: BirthModel) -> Reduction:
    """The same, with a least existence of labels that falls with a learnt birth rate.

    Otherwise no measurement could start a label, and none be counted, once the rate is low.
    """
    learnt, places = undetected.birth_rate, appearing(birth)
    if learnt is None or places is None:
        return reduction
    log_share = min(0.0, math.log(learnt.rate / places.model.first_rate))
    return reduction._replace(min_existence_logit=reduction.min_existence_logit + log_share)


def _shares_of(learnt: LearntRate, labels: Ints) -> Floats:
    """(num_labels,) probability that each label, if its target exists, is of one born after the first scan."""
    known = dict(zip(map(tuple, learnt.labels.tolist()), learnt.shares.tolist(), strict=True))
    return np.array([known.get(tuple(label), 0.0) for label in labels.tolist()])
