"""Undetected targets between scans: births as a Poisson intensity, survival and motion."""

from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB, FactoredGLMB, Poisson, UndetectedIntensity, UndetectedTargets, as_lmb
from vedette.densities.containers import unchecked
from vedette.densities.label_sets import without_labels
from vedette.filters.inputs import births_of, births_within
from vedette.filters.limits import Limits
from vedette.filters.region_births import no_cells, rate_after, region_births, tables_of, without_change
from vedette.internal.probabilities import expit
from vedette.kernels.base.types import VELOCITY, VX, VY, Floats, Lmb, Mixture
from vedette.kernels.gaussian.components import stacked_mixtures
from vedette.kernels.steps.undetected import Arrivals, Left, Undetected
from vedette.models import BirthModel, SensorModel
from vedette.models.arguments import reject, step_number
from vedette.models.turns import is_turn, longest_lag

# Births of at least this existence are labels from the start: the Poisson approximation has an error of 2 r^2.
FROM_THE_START = 0.15
# Intensity components per birth site, if these are more than `Limits.max_intensity_components` in total.
_COMPONENTS_A_SITE = 3


@lru_cache(maxsize=100)
def no_undetected(birth: BirthModel) -> Undetected:
    """Return the kernel input for an empty intensity of undetected targets."""
    dim, none = birth.state_dim, no_births(birth).undetected
    places, std, marks = np.empty((0, dim)), np.zeros(dim), birth.marks
    return Undetected(none, np.empty((0, 0)), no_cells(dim), places, std, marks, 0, 0, 0.0, True)


@lru_cache(maxsize=100)
def no_arrivals(birth: BirthModel) -> Arrivals:
    """Return the kernel input for a period without births."""
    return without_change(no_births(birth).undetected, 1)


def undetected_component_cap(limits: Limits, birth: BirthModel) -> int:
    """Return the largest number of components of the intensity of undetected targets."""
    return max(limits.max_intensity_components, _COMPONENTS_A_SITE * birth.num_sites)


class SplitBirths(NamedTuple):
    """Births at sites, split into labels and Poisson intensity as in the default filter."""

    labels: LMB  # labels from the start, of step 0
    undetected: Mixture  # intensity of the others
    error: float  # L1 error of the Poisson approximation of these


@lru_cache(maxsize=100)
def split_births(birth: BirthModel, dt: float) -> SplitBirths:
    """Return the births at all sites within `dt` seconds."""
    born = births_within(births_of(birth), birth.period, dt)
    existence = expit(born.existence_logit)
    strong, weak = (np.flatnonzero(chosen) for chosen in (existence >= FROM_THE_START, existence < FROM_THE_START))
    undetected = _intensity_of(born.take(weak).to_kernel())
    return SplitBirths(born.take(strong), undetected, float((2.0 * existence * -np.expm1(-existence))[weak].sum()))


@lru_cache(maxsize=100)
def no_births(birth: BirthModel) -> SplitBirths:
    """Return empty births of both kinds."""
    return SplitBirths(LMB.empty(birth), Poisson.empty(birth).to_kernel(), 0.0)


def with_dropped(undetected: UndetectedTargets, before: FactoredGLMB, kept: FactoredGLMB) -> UndetectedTargets:
    """Return the undetected targets with those of dropped labels added, each as the Gaussians of its label.

    before, kept: the belief with these labels and without them.
    """
    if kept.tracks.num_tracks == before.tracks.num_tracks:
        return undetected
    lost = as_lmb(without_labels(before, kept.tracks.labels)[0])
    intensity = stacked_mixtures(undetected.intensity.to_kernel(), _intensity_of(lost.to_kernel()))
    return replace(undetected, intensity=Poisson.from_kernel(intensity))


def _intensity_of(labels: Lmb) -> Mixture:
    """Return the tracks of labels, weighted by their existence."""
    existence, tracks = expit(labels.existence_logit), labels.tracks
    weighed = tracks.components.log_weights + np.repeat(np.log(existence), np.diff(tracks.offsets))
    return tracks.components._replace(log_weights=weighed)


def with_step(undetected: UndetectedTargets, step: Any, num_sites: int) -> UndetectedTargets:
    """Return the undetected targets with new labels at this step. Raises `InputError` for a step before the last."""
    number, last = step_number(step), undetected.next_label[0]
    if number < last:
        raise reject("step", f"at least {last}, the step of the belief", step)
    if number == last:
        return undetected
    parts = undetected.intensity, (number, num_sites), undetected.cells, undetected.birth_rate
    return unchecked(UndetectedTargets, *parts)


def before_scan(
    undetected: UndetectedTargets, birth: BirthModel, sensor: SensorModel, scan: Floats, pose: Floats
) -> Undetected:
    """Return the undetected targets and the places of the measurements in the form that `step_factored` needs."""
    (step, index), found, measured = undetected.next_label, region_births(birth), birth.from_measurements
    intensity, none = undetected.intensity.to_kernel(), no_undetected(birth)
    if found is None or undetected.cells is None:
        return none._replace(intensity=intensity, step=step, first_index=index)
    places, std, learnt = none.places, none.std, undetected.birth_rate
    is_placed = measured is None or sensor.measurement.places is not None
    if measured is not None and is_placed and len(scan):
        std = measured.std
        if is_turn(pose) and len(std) > VY:  # a target moves until the beam passes it
            std = np.concatenate([np.hypot(std[:2], longest_lag(pose) * std[VELOCITY]), std[VX:]])
        places = sensor.measurement.states_at(scan, pose, len(std))
    rate = 0.0 if learnt is None else learnt.rate
    tables, marks = tables_of(undetected), none.marks
    return Undetected(intensity, tables, found.cells, places, std, marks, step, index, rate, is_placed)


def after_scan(before: UndetectedTargets, missed: Mixture, left: Left, num_measurements: int) -> UndetectedTargets:
    """Return the undetected targets after a scan.

    missed, left: intensity of the undetected targets and expected numbers in the cells, from the scan's kernel.
    """
    label, cells, learnt = before.next_label, before.cells, before.birth_rate
    if cells is not None:
        cells = unchecked(UndetectedIntensity, cells.grid, left.tables[0].copy())
    if learnt is not None:
        learnt = rate_after(learnt, left, label)
    intensity, label = Poisson.from_kernel(missed), (label[0], label[1] + num_measurements)
    return unchecked(UndetectedTargets, intensity, label, cells, learnt)
