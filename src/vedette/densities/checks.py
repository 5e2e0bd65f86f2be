"""Checks that the containers share. Each error names the field, the expected value and the actual one.

A container checks itself when it is created, see `vedette.densities.containers`.

Faults of form (type, shape, order) raise `InputError`. Faults of value (not finite, not normalised, not positive
definite) raise the `error` given: `NumericalError` for the result of a computation, `InputError` for a user's data.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vedette.errors import InputError, NumericalError, VedetteError
from vedette.kernels.base.types import CLASSES, MODE, Bools, Floats, Ints
from vedette.kernels.gaussian.marks import NOT_DRAWN
from vedette.models.arguments import as_array

NORMALISATION_TOLERANCE = 1e-9
SYMMETRY_TOLERANCE = 1e-9  # of the largest variance


def check_array(field: str, array: Any, dtype: type, shape: Sequence[int | None]) -> None:
    """Raise `InputError` unless `array` is an array of this type and shape (None: any length)."""
    if type(array) is not np.ndarray:
        raise InputError(f"{field}: expected an array of {np.dtype(dtype)}; got {type(array).__name__}")
    if array.dtype != np.dtype(dtype):
        raise InputError(f"{field}: expected an array of {np.dtype(dtype)}; got one of {array.dtype}")
    if array.shape != shape:
        check_shape(field, array, shape)


def check_shape(field: str, array: NDArray[Any], shape: Sequence[int | None]) -> None:
    """Raise `InputError` unless `array` has this shape (None: any length)."""
    fits = array.ndim == len(shape)
    for want, have in zip(shape, array.shape, strict=False):
        fits = fits and want in (None, have)
    if not fits:
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        raise InputError(f"{field}: expected shape ({wanted}); got {array.shape}")


def _first(faulty: Bools) -> int:
    return int(np.flatnonzero(faulty)[0])


def check_finite(field: str, array: Floats, error: type[VedetteError] = NumericalError) -> None:
    """Raise `error` unless every entry is finite."""
    faulty = ~np.isfinite(array)
    if faulty.any():
        place = tuple(int(i) for i in np.argwhere(faulty)[0])
        raise error(f"{field}{list(place)}: expected a finite number; got {array[place]}")


def check_log_weights(field: str, log_weights: Floats, error: type[VedetteError] = NumericalError) -> None:
    """Raise `error` unless every entry is a log weight: a number or -inf."""
    faulty = np.isnan(log_weights) | (log_weights == np.inf)
    if faulty.any():
        place = _first(faulty)
        raise error(f"{field}[{place}]: expected a log weight (a number or -inf); got {log_weights[place]}")


def check_logits(field: str, logits: Floats, error: type[VedetteError] = NumericalError) -> None:
    """Raise `error` unless every entry is the log-odds of a probability: a number or an infinity."""
    faulty = np.isnan(logits)
    if faulty.any():
        raise error(f"{field}[{_first(faulty)}]: expected a number; got nan")


def check_offsets(field: str, offsets: Any, count: int, total: int, *, empty_allowed: bool) -> None:
    """Raise `InputError` unless `offsets` divides `total` entries into `count` runs."""
    check_array(field, offsets, np.int64, (count + 1,))
    if offsets[0] != 0 or offsets[-1] != total:
        raise InputError(f"{field}: expected to go from 0 to {total}; got {offsets[0]} to {offsets[-1]}")
    faulty = np.diff(offsets) < (0 if empty_allowed else 1)
    if faulty.any():
        place = _first(faulty)
        expected = "no decrease" if empty_allowed else "an increase"
        raise InputError(f"{field}[{place + 1}]: expected {expected}; got {offsets[place + 1]} after {offsets[place]}")


def offsets_of(sizes: Sequence[int] | Ints) -> Ints:
    """Return the offsets of runs of these sizes, shape (len(sizes) + 1,)."""
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes, dtype=np.int64)])


def check_sources(field: str, sources: Any, count: int) -> None:
    """Raise `InputError` unless `sources` has a track or -1 and a measurement, -1 or -2, for each of `count` tracks."""
    check_array(field, sources, np.int64, (count, 2))
    faulty = (sources < [-1, -2]).any(axis=1)
    if faulty.any():
        place = _first(faulty)
        raise InputError(f"{field}[{place}]: expected at least [-1, -2]; got {sources[place].tolist()}")


def take_runs(offsets: Ints, places: Ints) -> tuple[Ints, Ints]:
    """Return the offsets of the runs at `places` after concatenation, and the indices of their entries."""
    taken = offsets_of(np.diff(offsets)[places])
    return taken, np.repeat(offsets[places] - taken[:-1], np.diff(taken)) + np.arange(taken[-1])


def distinct_labels(labels: Ints) -> tuple[Ints, Ints]:
    """Return the distinct labels (num_distinct, 2) in increasing order, and the place of each label among them, (num,).

    labels: (num, 2).
    """
    order = np.lexsort(labels.T[::-1])
    ordered, place = labels[order], np.empty(len(labels), np.int64)
    new = np.ones(len(labels), np.bool_)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    place[order] = np.cumsum(new) - 1
    return ordered[new], place


def run_log_sums(log_weights: Floats, offsets: Ints) -> Floats:
    """Return the log-sum-exp of each run of `log_weights`. Runs must not be empty."""
    if len(offsets) == 1:
        return np.empty(0)
    peaks = np.maximum.reduceat(log_weights, offsets[:-1])
    safe = np.where(np.isfinite(peaks), peaks, 0.0)
    sums = np.add.reduceat(np.exp(log_weights - np.repeat(safe, np.diff(offsets))), offsets[:-1])
    with np.errstate(divide="ignore"):
        return np.asarray(safe + np.log(sums))


def check_normalised(
    field: str, log_weights: Floats, offsets: Ints, error: type[VedetteError] = NumericalError
) -> None:
    """Raise `error` unless the weights of each run sum to one, to 1e-9."""
    log_sums = run_log_sums(log_weights, offsets)
    faulty = ~(np.abs(log_sums) <= NORMALISATION_TOLERANCE)
    if faulty.any():
        place = _first(faulty)
        run = f"{field}[{offsets[place]}:{offsets[place + 1]}]"
        with np.errstate(over="ignore"):
            total = float(np.exp(log_sums[place]))
        raise error(f"{run}: expected weights that sum to 1; got {total!r}")


def check_covariances(field: str, covs: Floats, error: type[VedetteError] = NumericalError) -> None:
    """Raise `error` unless every matrix is finite, symmetric and positive definite."""
    if covs.size == 0:
        return
    check_finite(field, covs, error)
    scale = np.abs(np.diagonal(covs, axis1=1, axis2=2)).max(axis=1)
    asymmetry = np.abs(covs - covs.transpose(0, 2, 1)).max(axis=(1, 2))
    faulty = asymmetry > SYMMETRY_TOLERANCE * scale
    if faulty.any():
        place = _first(faulty)
        raise error(f"{field}[{place}]: expected a symmetric matrix; got an asymmetry of {asymmetry[place]:.3g}")
    try:
        np.linalg.cholesky(covs)
    except np.linalg.LinAlgError:
        least = np.linalg.eigvalsh(covs)[:, 0]
        place = int(np.argmin(least / np.maximum(scale, np.finfo(float).tiny)))
        message = f"{field}[{place}]: expected a positive definite matrix; got a least eigenvalue of {least[place]:.3g}"
        raise error(message) from None


def no_classes() -> Floats:
    """Return the class probabilities of components without classes. A container gives them their length."""
    return np.empty((0, 0))


def check_components(field: str, density: Any, error: type[VedetteError] = NumericalError) -> None:
    """Raise unless a density's arrays are weights, moments and marks of components.

    Arguments as in `check_mixtures`.
    """
    log_weights, means, covs, marks = density.log_weights, density.means, density.covs, density.marks
    check_array(f"{field}means", means, np.float64, (None, None))
    num_components, dim = means.shape
    if dim == 0:
        raise InputError(f"{field}means: expected a state of at least 1 dimension; got 0")
    check_array(f"{field}log_weights", log_weights, np.float64, (num_components,))
    check_array(f"{field}covs", covs, np.float64, (num_components, dim, dim))
    check_log_weights(f"{field}log_weights", log_weights, error)
    check_finite(f"{field}means", means, error)
    check_covariances(f"{field}covs", covs, error)
    check_array(f"{field}marks", marks, np.float64, (num_components, None))
    if marks.shape[1] < CLASSES:
        raise InputError(f"{field}marks: expected at least {CLASSES} column; got {marks.shape[1]}")
    modes, classes = marks[:, MODE], marks[:, CLASSES:]
    if not ((modes >= NOT_DRAWN) & (modes == np.floor(modes))).all():
        wrong = modes[~((modes >= NOT_DRAWN) & (modes == np.floor(modes)))][0]
        raise error(f"{field}modes: expected whole numbers of at least {NOT_DRAWN}; got {wrong:g}")
    if classes.size:
        name, flat = f"{field}log_class_probs", classes.reshape(-1)
        check_log_weights(name, flat, error)
        check_normalised(name, flat, np.arange(num_components + 1) * classes.shape[1], error)


def check_mixtures(
    field: str, density: Any, offsets: Any, count: int, error: type[VedetteError] = NumericalError
) -> None:
    """Raise unless a density's components are `count` mixtures, flat with offsets, each a probability density.

    field: prefix of the names of the arrays. `InputError` for faults of form, `error` for faults of value.
    """
    check_components(field, density, error)
    check_offsets(f"{field}offsets", offsets, count, len(density.log_weights), empty_allowed=False)
    check_normalised(f"{field}log_weights", density.log_weights, offsets, error)


def label_step_up(labels: Ints) -> Bools:
    """Mask (len(labels) - 1,), True if a label is followed by a greater one."""
    before, after = labels[:-1], labels[1:]
    return np.asarray((before[:, 0] < after[:, 0]) | ((before[:, 0] == after[:, 0]) & (before[:, 1] < after[:, 1])))


def labels_increase(labels: Ints, offsets: Ints) -> Bools:
    """Mask (len(labels) - 1,), True if a label is followed by a greater one, or is the last of its run."""
    in_order = label_step_up(labels)
    starts = offsets[(offsets > 0) & (offsets < len(labels))]
    in_order[starts - 1] = True
    return in_order


def as_floats(field: str, values: Any, shape: Sequence[int | None]) -> Floats:
    """Return a new float64 array of a user's numbers. Raises `InputError` for another shape or non-numeric values."""
    return np.array(_given(field, values, "fiu", "numbers", shape), dtype=np.float64, order="C")


def as_gaussians(means: Any, covs: Any, num: int) -> tuple[Floats, Floats]:
    """Return new (num, dim) and (num, dim, dim) arrays of a user's means and covariances, without further checks."""
    checked = as_floats("means", means, (num, None))
    return checked, as_floats("covs", covs, (num, checked.shape[1], checked.shape[1]))


def as_logits(field: str, probabilities: Any, num: int | None) -> Floats:
    """Return the log-odds (num,) of a user's probabilities. Raises `InputError` for values outside [0, 1]."""
    checked = as_floats(field, probabilities, (num,))
    if not np.all((checked >= 0.0) & (checked <= 1.0)):
        raise InputError(f"{field}: expected probabilities; got {checked.tolist()}")
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(checked) - np.log1p(-checked))


def as_ints(field: str, values: Any, shape: Sequence[int | None]) -> Ints:
    """Return a new int64 array of a user's integers. Raises `InputError` for another shape or non-integer values."""
    given = _given(field, values, "iu", "integers", shape)
    if given.dtype.kind == "u" and np.any(given > np.iinfo(np.int64).max):
        raise InputError(f"{field}: expected integers below 2^63; got {given.max()}")
    return np.array(given, dtype=np.int64, order="C")


def _given(field: str, values: Any, kinds: str, expected: str, shape: Sequence[int | None]) -> NDArray[Any]:
    given = as_array(field, values, kinds, f"an array of {expected}")
    if given.size == 0 and given.ndim < len(shape):
        given = given.reshape(0, *(0 if length is None else length for length in shape[1:]))
    check_shape(field, given, shape)
    return given
