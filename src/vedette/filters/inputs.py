"""Checks of the input of a filter step, and translation of kernel errors."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from numbers import Real
from pathlib import Path
from traceback import walk_tb
from typing import Any, TypeVar

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB, IidCluster, LabelledDensity, MultiBernoulli, Poisson, TrackTable
from vedette.densities.containers import unchecked
from vedette.densities.tracks import gaussian_tracks, relabelled_tracks
from vedette.errors import InputError, ModelError, VedetteError
from vedette.internal.unit_warnings import warn_implausible
from vedette.kernels.base.types import Floats, Ints, Lmb, Measurements
from vedette.kernels.gaussian.scans import examined_scan
from vedette.kernels.labelled import births as kernels
from vedette.models import BirthModel, SensorModel, TargetModel
from vedette.models.arguments import as_array, reject, step_number
from vedette.models.measurement import MeasurementModel, wrap_periodic
from vedette.models.scan_rows import ScanRows, table_of, to_measurements, with_values

_WITHIN = 0.9995  # half periods; components beyond may need to be wrapped
_MOST_STDS = 10.0  # standard deviations of noise below the least noise-free measurement
_NO_ROWS = np.empty(0, np.int64)
_PACKAGE = Path(__file__).parents[1]
_Density = TypeVar("_Density", GLMB, LMB, FactoredGLMB, Poisson, IidCluster, MultiBernoulli)


def check_scan(scan: Any, sensor: SensorModel, num_classes: int) -> tuple[Measurements, Ints]:
    """Return the scan in kernel form without repeated rows, and the rows that were repeats.

    scan: (num, meas_dim) array, or `vedette.models.ScanRows`. Angles are returned in (-pi, pi], and other components
    with a period within half of it. num_classes: number of classes of the targets. Warns of values too far below the
    least possible value for noise, such as a negative range.

    Raises:
        InputError: not an array of that shape, a value that is not finite, or an angle beyond a full turn either way,
            which has other units. A scan without measurements is an empty array. None is refused, since a sensor
            that did not scan must not be updated at all.
    """
    measurement, meas_dim = sensor.measurement, sensor.meas_dim
    expected = f"an array of shape (num_measurements, {meas_dim}), empty for a scan without measurements"
    if scan is None:
        raise InputError(f"scan: expected {expected}; got None")
    is_bundle = isinstance(scan, ScanRows)
    given = scan.values if is_bundle else scan
    if type(given) is not np.ndarray or given.dtype != np.float64:
        given = as_array("scan", given, "fiu", f"numbers in {expected}")
    if given.size == 0 and given.ndim <= 2:
        return to_measurements(np.empty((0, meas_dim))), _NO_ROWS
    if given.ndim != 2 or given.shape[1] != meas_dim:
        raise InputError(f"scan: expected {expected}; got shape {given.shape}")
    if is_bundle and scan.class_ratios.shape[1] not in (0, num_classes):
        ratios = f"class ratios of {num_classes} classes, as the targets have"
        raise InputError(f"scan: expected {ratios}; got those of {scan.class_ratios.shape[1]}")
    array = np.array(given, dtype=np.float64, order="C")
    bad, is_below, largest, may_repeat = examined_scan(array, measurement.least, measurement.periods)
    if bad >= 0:
        raise InputError(f"scan: expected finite numbers; got {array[bad].tolist()} in row {bad}")
    if is_below:
        _warn_negative(array, measurement, sensor.noise.least_stds)
    if largest > _WITHIN:  # rare
        array, may_repeat = _wrapped(array, measurement), True
    rows = with_values(scan, array) if is_bundle else array
    if not may_repeat:  # most scans
        return to_measurements(rows), _NO_ROWS
    first = np.sort(np.unique(table_of(rows), axis=0, return_index=True)[1])
    return to_measurements(rows[first]), np.setdiff1d(np.arange(len(rows)), first)


def _warn_negative(scan: Floats, measurement: MeasurementModel, stds: Floats | None) -> None:
    below = measurement.least - scan > _MOST_STDS * (np.inf if stds is None else stds)
    for row, component in np.argwhere(below)[:1].tolist():
        got = f"{scan[row, component]:g} in row {row}, component {component}"
        least = f"at least {measurement.least[component]:g}, but for noise"
        warn_implausible("scan", least, got, "a sign, or components exchanged")


def _wrapped(scan: Floats, measurement: MeasurementModel) -> Floats:
    angular = measurement.angular
    sizes = np.abs(scan[:, angular])
    if sizes.max(initial=0.0) > 2.0 * math.pi:
        row = int(np.argmax(sizes.max(axis=1)))
        raise InputError(
            f"scan: expected angles in radians, in (-pi, pi]; got {scan[row].tolist()} in row {row}, whose component "
            f"{int(np.flatnonzero(angular)[np.argmax(sizes[row])])} is an angle (is it in degrees?)"
        )
    return wrap_periodic(scan, measurement.periods)


def check_belief(
    belief: object, kind: type[_Density], model: TargetModel | BirthModel, name: str = "belief"
) -> _Density:
    """Return the belief. Raises `InputError` unless it is of the filter's kind, with the model's states and classes."""
    if not isinstance(belief, kind):
        raise InputError(f"{name}: expected a {kind.__name__}; got {type(belief).__name__}")
    if belief.state_dim != model.state_dim:
        raise InputError(f"{name}: expected states of dimension {model.state_dim}; got {belief.state_dim}")
    if belief.num_classes != model.num_classes:
        expected = f"{model.num_classes} classes of targets, as in the birth model"
        raise InputError(f"{name}: expected {expected}; got {belief.num_classes}")
    return belief


def births_for(
    birth: BirthModel, dt: float, step: Any, belief: LabelledDensity | None = None, births: LMB | None = None
) -> Lmb:
    """Return the birth density for a step of `dt` seconds in kernel form: `births`, or the model's birth sites if None.

    Raises:
        InputError: a step below 1, births of another kind or dimension, or a belief with labels of that step or later
            ones, which the labels of the births could repeat.
    """
    number = step_number(step)
    if births is not None:
        born = check_belief(births, LMB, birth, "births")
    elif birth.is_active(number):
        born = births_within(births_at(birth, number), birth.period, dt)
    else:
        return no_births_for_kernel(birth.state_dim)
    if belief is not None and len(born.tracks.labels):
        check_new(belief, int(born.tracks.labels[0, 0]), step)  # labels of an LMB increase
    return born.to_kernel()


def check_new(belief: LabelledDensity, first: int, step: Any) -> None:
    """Raise `InputError` if labels born at steps from `first` on could repeat those of a belief. step: as given."""
    steps = belief.tracks.labels[:, 0]
    newest = steps.max() if len(steps) else first - 1
    if newest >= first:
        raise reject("step", f"a step after those of the labels in the belief, of which the last is {newest}", step)


def is_zero_duration(dt: Any) -> bool:
    """Return True if `dt` is the number 0. Other types are rejected where they are used."""
    return not isinstance(dt, bool) and isinstance(dt, Real) and dt == 0.0


@lru_cache(maxsize=100)
def no_births(like: int | BirthModel) -> LMB:
    """Return an LMB without targets, cached for each state dimension or birth model."""
    return LMB.empty(like)


@cache
def no_births_for_kernel(state_dim: int) -> Lmb:
    """Return an empty birth density in kernel form, cached for each dimension."""
    return no_births(state_dim).to_kernel()


def births_at(birth: BirthModel, step: int) -> LMB:
    """Return the LMB of the births at `step`, or within the model's period, labelled (step, site)."""
    return born_at(births_of(birth), step) if birth.is_active(step) else no_births(birth)


def born_at(born: LMB, step: int) -> LMB:
    """Return the same targets with the labels of a step."""
    tracks, labels = born.tracks, born.tracks.labels.copy()
    labels[:, 0] = step
    return unchecked(LMB, relabelled_tracks(tracks, labels), born.existence_logit)


def births_within(born: LMB, period: float | None, dt: float, others: LMB | None = None) -> LMB:
    """Return the births within `dt` seconds, of the births within `period` (None: at a step of any length).

    1 - r(dt) = (1 - r)^(dt / period). others: more births, whose labels follow.
    """
    if period is None and others is None:
        return born
    more = no_births_for_kernel(born.state_dim) if others is None else others.to_kernel()
    within = kernels.births_within(born.to_kernel(), more, 1.0 if period is None else dt / period)
    return unchecked(LMB, TrackTable.from_kernel(within.tracks), within.existence_logit)


@lru_cache(maxsize=1000)
def births_of(birth: BirthModel) -> LMB:
    """Return the births at the sites, labelled with step 0, cached for each model."""
    labels = np.column_stack([np.zeros(birth.num_sites, np.int64), np.arange(birth.num_sites)])
    tracks = gaussian_tracks(labels, birth.means, birth.covs, np.tile(birth.marks, (birth.num_sites, 1)))
    return unchecked(LMB, tracks, np.log(birth.existence) - np.log1p(-birth.existence))


@contextmanager
def model_errors() -> Iterator[None]:
    """Context manager that applies `raise_model_error` to errors raised inside."""
    try:
        yield
    except Exception as error:
        raise_model_error(error)
        raise


def raise_model_error(error: Exception) -> None:
    """Raise a `ModelError` for an error that a model function raised inside a kernel.

    Numba keeps the place in the traceback. Errors that a kernel (`MemoryError`) or Numba itself raises are left alone.
    """
    if isinstance(error, VedetteError):
        return
    places = [Path(frame.f_code.co_filename) for frame, _ in walk_tb(error.__traceback__)]
    own = places[-1].is_relative_to(_PACKAGE) and not places[-1].is_relative_to(_PACKAGE / "models")
    if not own and not any("numba" in place.parts for place in places):
        raise ModelError(f"a model function raised {type(error).__name__}: {error}") from error
