"""Undetected targets between scans: births as a Poisson intensity, survival and motion."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB, FactoredGLMB, Poisson, UndetectedTargets, as_lmb
from vedette.densities.label_sets import without_labels
from vedette.filters.appearing import cells_after, density_at, predicted_cells
from vedette.filters.inputs import births_of, births_within
from vedette.filters.limits import Limits
from vedette.kernels.association.first_detections import Undetected
from vedette.kernels.base.types import Floats, Lmb, Mixture
from vedette.kernels.gaussian.intensities import predicted_intensity, stacked_mixtures
from vedette.models import BirthModel, SensorModel, TargetModel, kernel_motion
from vedette.models.arguments import reject, step_number
from vedette.probabilities import expit

# Existence of a birth from which on it is a label from the start: as Poisson, its number would be wrong by 2 r^2.
FROM_THE_START = 0.15
# Components of the intensity that a birth site may have, where these are more than `Limits.max_intensity_components`.
_COMPONENTS_A_SITE = 3
# Standard deviations of a birth's position that stand for "anywhere" about a measurement: wide beside the noise.
_WIDE = 3.0


@cache
def no_undetected(state_dim: int) -> Undetected:
    """No undetected targets, as kernels take them."""
    none = no_births(state_dim).undetected
    return Undetected(none, none, 0, 0, 0.0)


class SplitBirths(NamedTuple):
    """Births at sites, as the default filter takes them."""

    labels: LMB  # that are there from the start, of step 0
    undetected: Mixture  # intensity of the others
    error: float  # L1, of taking these as Poisson


@lru_cache(maxsize=100)
def split_births(birth: BirthModel, dt: float) -> SplitBirths:
    """The births at all sites within `dt` seconds."""
    born = births_within(births_of(birth), birth.period, dt)
    existence = expit(born.existence_logit)
    strong, weak = (np.flatnonzero(chosen) for chosen in (existence >= FROM_THE_START, existence < FROM_THE_START))
    undetected = _intensity_of(born.take(weak).to_kernel())
    return SplitBirths(born.take(strong), undetected, float((2.0 * existence * -np.expm1(-existence))[weak].sum()))


@cache
def no_births(state_dim: int) -> SplitBirths:
    """Return no births, of either kind."""
    return SplitBirths(LMB.empty(state_dim), Poisson.empty(state_dim).to_kernel(), 0.0)


def predicted_undetected(
    before: UndetectedTargets, targets: TargetModel, born: Mixture, dt: float, limits: Limits, *, appear: bool
) -> UndetectedTargets:
    """The undetected targets `dt` seconds later.

    Args:
        before: at the time of the last scan.
        targets: how they move, live on, and appear anywhere.
        born: intensity of those that have appeared at sites since.
        dt: s, above 0.
        limits: of which `max_intensity_components` counts.
        appear: whether targets have appeared anywhere since.
    """
    motion = kernel_motion(targets.motion, targets.survival)
    most = max(limits.max_intensity_components, _COMPONENTS_A_SITE * targets.birth.num_sites)
    intensity = predicted_intensity(before.intensity.to_kernel(), motion, dt, born, most)
    cells = predicted_cells(before, targets, dt, appear=appear)
    return UndetectedTargets(Poisson.from_kernel(intensity), before.next_label, *cells)


def with_dropped(undetected: UndetectedTargets, before: FactoredGLMB, kept: FactoredGLMB) -> UndetectedTargets:
    """The undetected targets, and those whose labels a belief no longer holds, each as the Gaussians of its label.

    before, kept: the belief with these labels and without them.
    """
    if kept.tracks.num_tracks == before.tracks.num_tracks:
        return undetected
    lost = as_lmb(without_labels(before, kept.tracks.labels)[0])
    intensity = stacked_mixtures(undetected.intensity.to_kernel(), _intensity_of(lost.to_kernel()))
    return replace(undetected, intensity=Poisson.from_kernel(intensity))


def _intensity_of(labels: Lmb) -> Mixture:
    """The tracks of labels, weighed by their existence."""
    existence, tracks = expit(labels.existence_logit), labels.tracks
    return Mixture(
        tracks.log_weights + np.repeat(np.log(existence), np.diff(tracks.offsets)), tracks.means, tracks.covs
    )


def named_at(undetected: UndetectedTargets, step: Any, num_sites: int) -> UndetectedTargets:
    """The same with the labels of a scan of this step. Raises `InputError` for a step before the last one."""
    number, last = step_number(step), undetected.next_label[0]
    if number < last:
        raise reject("step", f"at least {last}, the step of the belief", step)
    return undetected if number == last else replace(undetected, next_label=(number, num_sites))


def seen_by(
    undetected: UndetectedTargets, error: float, birth: BirthModel, sensor: SensorModel, scan: Floats, pose: Floats
) -> Undetected:
    """Return the undetected targets in the form that `step_factored` needs. error: see `SplitBirths`."""
    intensity = undetected.intensity.to_kernel()
    local, measured = no_births(birth.state_dim).undetected, birth.from_measurements
    if undetected.cells is not None and measured is not None and len(scan):
        places, std = sensor.measurement.positions(scan, pose), measured.std.copy()
        std[:2] *= _WIDE
        means = np.zeros((len(scan), len(std)))
        means[:, :2] = places
        cells = undetected.cells
        with np.errstate(divide="ignore"):
            density = density_at(cells.grid.cells_at(places), cells.expected, cells)
            log_weights = np.log(density) + np.log(2.0 * np.pi * std[0] * std[1])
        local = Mixture(log_weights, means, np.tile(np.diag(std**2), (len(scan), 1, 1)))
    return Undetected(intensity, local, *undetected.next_label, error)


def undetected_after(
    before: UndetectedTargets, missed: Mixture, birth: BirthModel, sensor: SensorModel, scan: Floats, pose: Floats
) -> tuple[UndetectedTargets, float]:
    """The undetected targets after a scan, and the log probability that it detected none of those anywhere.

    missed: the intensity that the scan's kernel has left.
    """
    step, index = before.next_label
    cells, learnt = cells_after(before, birth, sensor, scan, pose)
    log_missed = 0.0 if cells is None or before.cells is None else cells.total - before.cells.total
    return UndetectedTargets(Poisson.from_kernel(missed), (step, index + len(scan)), cells, learnt), log_missed
