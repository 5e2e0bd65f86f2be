"""Targets that appear anywhere in a region, on cells: prediction, scans, and the posterior of their birth rate."""

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
from vedette.densities.containers import for_kernel
from vedette.densities.label_sets import are_in_table
from vedette.kernels.base.types import Floats, Ints, Mixture
from vedette.kernels.steps.undetected import Arrivals, Cells, Left
from vedette.models import BirthModel, SurvivalModel, TargetModel, UndetectedModel
from vedette.models.arguments import reject

# Shape of the gamma prior of a learnt birth rate: equivalent to half an observed birth.
_SHAPE = 0.5
# Nodes along each side of a cell for the average of P_D: for 16 x 16 cells, and for cells that a user has chosen.
_NODES, _NODES_OF_CHOSEN = 2, 3
_STAY, _NO_BIRTHS = np.ones(1), np.zeros(2)


class RegionBirths(NamedTuple):
    """Model and cells of targets that appear anywhere in a region."""

    model: UndetectedModel
    cells: Cells


@lru_cache(maxsize=100)
def region_births(birth: BirthModel) -> RegionBirths | None:
    """Return the cells of targets that appear anywhere, or None if the births have no region."""
    measured, model, nodes = birth.from_measurements, birth.anywhere, _NODES_OF_CHOSEN
    if model is None:
        model, nodes = None if measured is None else measured.uniform(), _NODES
    if model is None:
        return None
    grid, dim = model.grid, birth.state_dim
    corner, size = np.array([grid.region.x_min, grid.region.y_min]), np.array(grid.cell_size)
    middles, states = grid.states(dim, 1)[:, 0].copy(), grid.states(dim, nodes)
    return RegionBirths(
        model, Cells(grid.columns, corner, size, middles, states, grid.node_weights(nodes), model.entering)
    )


@lru_cache(maxsize=100)
def no_cells(state_dim: int) -> Cells:
    """Return an empty grid of cells, for births without a region."""
    none = np.empty((0, state_dim))
    return Cells(1, np.zeros(2), np.ones(2), none, none[:, np.newaxis], np.empty(0), np.empty(0))


def tables_of(undetected: UndetectedTargets) -> Floats:
    """Expected numbers in the cells, shape (num_tables, num_cells). A learnt birth rate adds a table per unit rate."""
    if undetected.cells is None:
        return np.empty((0, 0))
    expected, learnt = for_kernel(undetected.cells.expected), undetected.birth_rate
    return expected[np.newaxis] if learnt is None else np.stack([expected, learnt.unit])


def with_cells(before: UndetectedTargets, birth: BirthModel, dt: float, *, appear: bool) -> UndetectedTargets:
    """Return the undetected targets with cells, which the first prediction adds: initial numbers, or births since.

    appear: whether the region has births in this period. Raises `InputError` for a belief with other cells.
    """
    places, cells = region_births(birth), before.cells
    if cells is not None:
        return _on_grid(before, cells, places)
    if places is None or not appear:
        return before
    model, learnt, rate = places.model, before.birth_rate, _rate_of(before, birth, places, dt)
    if model.is_learnt and learnt is None:
        no_labels = np.empty((0, 2), np.int64), np.empty(0)
        learnt = LearntRate(rate, 0.0, np.zeros(model.grid.num_cells), 0.0, *no_labels)
    first = model.initial() + (model.births(dt, rate) if _in_scans(birth) else 0.0)
    return replace(before, cells=UndetectedIntensity(model.grid, first), birth_rate=learnt)


def _on_grid(before: UndetectedTargets, cells: UndetectedIntensity, places: RegionBirths | None) -> UndetectedTargets:
    """Return the same targets on the grid object of the model."""
    if places is not None and cells.grid is places.model.grid:
        return before
    if places is None or cells.grid != places.model.grid:
        expected = "none" if places is None else f"those of the filter's births, {places.model.grid}"
        raise reject("belief.undetected.cells", expected, cells.grid)
    return replace(before, cells=UndetectedIntensity(places.model.grid, cells.expected))


def _in_scans(birth: BirthModel) -> bool:
    """Return True if the number of births is given per scan interval, or per period of the births."""
    measured = birth.from_measurements
    return birth.anywhere is None and measured is not None and not measured.is_learnt


def _rate_of(before: UndetectedTargets, birth: BirthModel, places: RegionBirths, dt: float) -> float:
    """Return the rate of births in the region, 1/s."""
    if _in_scans(birth):
        return birth.from_measurements.expected / (dt if birth.period is None else birth.period)  # type: ignore[union-attr, operator]
    return places.model.first_rate if before.birth_rate is None else before.birth_rate.rate


def arrivals_of(
    before: UndetectedTargets, targets: TargetModel, born: Mixture, dt: float, most: int, *, appear: bool
) -> Arrivals:
    """Return the kernel input for the prediction of undetected targets over `dt` seconds.

    born: intensity of births at sites. most: largest number of components. appear: whether the region has births in
    this period. Cells that the first prediction adds do not change (`with_cells`).
    """
    birth, places = targets.birth, region_births(targets.birth)
    if places is None or before.cells is None:
        return without_change(born, most)
    period = dt if appear else 0.0
    numbers = [_rate_of(before, birth, places, dt) * period] + [period] * (before.birth_rate is not None)
    return Arrivals(born, most, *_changes(places.model, dt), np.array(numbers))


@lru_cache(maxsize=1000)
def _changes(model: UndetectedModel, dt: float) -> tuple[float, Floats, Floats]:
    """Return the survival and the shares of `Arrivals` for `dt` seconds."""
    return -1.0 if model.survival is None else float(model.survival**dt), *model.shares(dt)


def without_change(born: Mixture, most: int) -> Arrivals:
    """Return the kernel input for a period in which the numbers in the cells stay. Arguments: see `arrivals_of`."""
    return Arrivals(born, most, 1.0, _STAY, _STAY, _NO_BIRTHS)


def rate_after(learnt: LearntRate, left: Left, label: tuple[int, int]) -> LearntRate:
    """Return the learnt birth rate after a scan. left: from its kernel. label: of its first measurement."""
    num = len(left.born_shares)
    labels = np.column_stack([np.full(num, label[0]), label[1] + np.arange(num)])
    return replace(
        learnt,
        unit=left.tables[1],
        exposure=learnt.exposure - float(left.changes[1]),
        labels=np.concatenate([learnt.labels, labels]),
        shares=np.concatenate([learnt.shares, left.born_shares]),
    )


def with_deaths(
    before: UndetectedTargets, belief: FactoredGLMB, survival: SurvivalModel, dt: float
) -> UndetectedTargets:
    """Return the undetected targets after `dt` seconds of deaths of detected targets, for a learnt birth rate.

    Targets that were born at this rate and died within `dt` seconds are still counted as detected.
    """
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
    """Return the undetected targets with the posterior birth rate, and their expected number at this rate.

    For a gamma prior of shape a and mean 1/T, n expected first detections and an exposure E, the posterior mean is
    (a + n) / (a T + E). Each measurement counts with the probability that it was a first detection. Labels that are
    still undecided therefore change nothing: their expected number is the one that the rate predicts.

    before, kept: the belief with the labels that were dropped and without them.
    """
    learnt, cells, places = undetected.birth_rate, undetected.cells, region_births(birth)
    if learnt is None or cells is None or places is None:
        return undetected
    labels, existence = existence_probabilities(before)
    is_held = are_in_table(labels, kept.tracks.labels)
    shares = _shares_of(learnt, labels)
    past = learnt.past + float((shares * existence)[~is_held].sum())
    number = past + float((shares * existence)[is_held].sum())
    rate = (_SHAPE + number) / (_SHAPE / places.model.prior_rate + learnt.exposure)
    expected = np.maximum(cells.expected + (rate - learnt.rate) * learnt.unit, 0.0)
    counted = is_held & (shares > 0.0)
    learnt = replace(learnt, rate=rate, past=past, labels=labels[counted], shares=shares[counted])
    return replace(undetected, cells=UndetectedIntensity(cells.grid, expected), birth_rate=learnt)


def _shares_of(learnt: LearntRate, labels: Ints) -> Floats:
    """Probability that a label, if its target exists, is of a target born after the first scan, shape (num_labels,)."""
    known = dict(zip(map(tuple, learnt.labels.tolist()), learnt.shares.tolist(), strict=True))
    return np.array([known.get(tuple(label), 0.0) for label in labels.tolist()])
