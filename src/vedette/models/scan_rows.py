"""Scans whose measurements bring the covariance of their noise and the likelihood ratio of their features."""

from dataclasses import dataclass, fields
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Bools, Floats, Ints, Measurements
from vedette.kernels.gaussian.row_noise import replace_all_noise
from vedette.models.arguments import float_array


@dataclass(frozen=True, eq=False, repr=False, init=False)
class ScanRows(SummaryRepr):
    """Measurements of one scan with what each of them brings, as all filters take them in place of an array.

    A field that is not given, or empty, has length 0. `len` is the number of measurements, and an index, slice or mask
    selects some of them.

    Attributes:
        values: (num, m) measurements. NaN after the second component: it was not measured. That is kept as a value of
            0 with an infinite variance, and such a variance may be given with any value that stands in.
        noise: (num, m, m) covariances of the noise, or (num, m) standard deviations, in SI units. A variance of 0
            leaves a component to the sensor's noise model.
        added_noise: (num, m, m) covariances in addition to those, or to the sensor's noise model where it holds, such
            as those of the sensor's own pose.
        log_ratios: (num,) log ratio of the probability densities of a measurement's features, such as its
            signal-to-noise ratio, if it is of a target and if it is false.
        class_ratios: (num, num_classes) the same log ratio, of further features, for a target of each class of
            `BirthModel.class_probs`.

    Raises:
        InputError: an array of another shape, a number that is not finite, a covariance that is not symmetric and
            positive definite.
    """

    values: Floats
    noise: Floats
    added_noise: Floats
    log_ratios: Floats
    class_ratios: Floats

    def __init__(
        self,
        values: ArrayLike,
        noise: ArrayLike | None = None,
        added_noise: ArrayLike | None = None,
        log_ratios: ArrayLike | None = None,
        class_ratios: ArrayLike | None = None,
    ) -> None:
        table = np.array(values, np.float64)
        if table.ndim != 2:
            raise InputError(f"values: expected shape (num, meas_dim); got {table.shape}")
        num, dim = table.shape
        own, missing = _covariances("noise", noise, num, dim), np.isnan(table) & (np.arange(dim) > 1)
        if missing.any():
            own = own if len(own) else np.zeros((num, dim, dim))
            own[missing[:, :, np.newaxis] | missing[:, np.newaxis]] = 0.0
            own[missing[:, :, np.newaxis] & np.eye(dim, dtype=np.bool_)] = np.inf
            table[missing] = 0.0
        ratios, classes, added = np.empty(0), np.empty((0, 0)), _covariances("added_noise", added_noise, num, dim)
        if not _is_empty(log_ratios):
            ratios = float_array("log_ratios", log_ratios, (num,))
        if not _is_empty(class_ratios):
            classes = float_array("class_ratios", class_ratios, (num, None))
        _put(self, float_array("values", table, (num, dim)), own, added, ratios, classes)
        if len(own) or len(added):
            self._check_definite()

    def _check_definite(self) -> None:
        """Raise `InputError` unless the covariances are positive definite with a noise model of 1."""
        num, dim = self.values.shape
        covs = self.covs(np.tile(np.eye(dim), (num, 1, 1)))
        stds = np.sqrt(np.maximum(np.diagonal(covs, axis1=1, axis2=2), np.finfo(np.float64).tiny))
        wrong = np.linalg.eigvalsh(covs / (stds[:, :, np.newaxis] * stds[:, np.newaxis]))[:, 0] <= 0.0
        if wrong.any():
            row = int(np.argmax(wrong))
            got = (self.noise if len(self.noise) else self.added_noise)[row].tolist()
            raise InputError(f"noise: expected positive definite covariances of rows; got {got} in row {row}")

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, rows: slice | Ints | Bools) -> "ScanRows":
        if not isinstance(rows, slice) and np.ndim(rows) != 1:
            raise IndexError(f"expected a slice, or an array of indices or flags; got {rows!r}")
        return _unchecked(*(each[rows] if len(each) else each for each in self.to_kernel()))

    def _summary(self) -> str:
        brought = [each.name for each in fields(self)[1:] if len(getattr(self, each.name))]
        return f"{self.values.shape} with {', '.join(brought) or 'no noise of their own'}"

    @property
    def missing(self) -> Bools:
        """(num, m) True for components that were not measured."""
        if not len(self.noise):
            return np.zeros(self.values.shape, np.bool_)
        return np.asarray(np.isinf(np.diagonal(self.noise, axis1=1, axis2=2)))

    def covs(self, of_model: Floats) -> Floats:
        """Return the covariances of the rows' noise, (num, m, m). of_model: those of the sensor's noise model."""
        return _replaced(self.to_kernel(), of_model)

    def to_kernel(self) -> Measurements:
        """Return the fields as kernels take them."""
        return Measurements(self.values, self.noise, self.added_noise, self.log_ratios, self.class_ratios)


ScanLike: TypeAlias = Floats | ScanRows  # (num, meas_dim) measurements, which may bring their noise


def _put(rows: ScanRows, *arrays: Floats) -> ScanRows:
    for each, array in zip(fields(ScanRows), arrays, strict=True):
        object.__setattr__(rows, each.name, array)
    return rows


def _unchecked(*arrays: Floats) -> ScanRows:
    return _put(object.__new__(ScanRows), *arrays)


def _is_empty(given: ArrayLike | None) -> bool:
    return given is None or np.size(given) == 0


def _covariances(name: str, given: ArrayLike | None, num: int, dim: int) -> Floats:
    """Return covariances (num, dim, dim) from those or from standard deviations (num, dim), or (0, dim, dim)."""
    if _is_empty(given):
        return np.empty((0, dim, dim))
    covs = np.array(given, np.float64)
    if covs.ndim == 2:
        stds, covs = float_array(name, covs, (num, dim), finite=False), np.zeros((num, dim, dim))
        covs[:, np.arange(dim), np.arange(dim)] = stds**2
    covs = float_array(name, covs, (num, dim, dim), finite=False)
    may_lack = np.diag(np.arange(dim) > 1) if name == "noise" else np.zeros((dim, dim), np.bool_)
    if not (np.isfinite(covs) | may_lack).all():
        expected = "finite numbers, but for the variance of a component not measured"
        raise InputError(f"{name}: expected {expected}; got others")
    if not np.array_equal(covs, covs.swapaxes(1, 2)) or (np.diagonal(covs, axis1=1, axis2=2) < 0.0).any():
        raise InputError(f"{name}: expected symmetric positive definite covariances; got others")
    return covs


@kernel
def _replaced(measurements: Measurements, covs: Floats) -> Floats:
    out = covs.copy()
    replace_all_noise(measurements, out)
    return out


def as_scan(scan: ArrayLike | ScanRows) -> ScanLike:
    """Return a scan, as a contiguous array unless it brings its noise."""
    return scan if isinstance(scan, ScanRows) else np.ascontiguousarray(scan, np.float64)


def values_of(scan: ScanLike) -> Floats:
    """Return the measurements of a scan, (num, meas_dim)."""
    return scan.values if isinstance(scan, ScanRows) else scan


def table_of(scan: ScanLike) -> Floats:
    """Return all that each row of a scan brings, (num, any), the measurement first."""
    if not isinstance(scan, ScanRows) or not len(scan):
        return values_of(scan)
    return np.column_stack([each.reshape(len(scan), -1) for each in scan.to_kernel() if len(each)])


def with_values(scan: ScanLike, values: Floats) -> ScanLike:
    """Return the scan with other measurements, whose noise stays."""
    return _unchecked(values, *scan.to_kernel()[1:]) if isinstance(scan, ScanRows) else values


def noise_of_rows(scan: ScanLike, covs: Floats) -> Floats:
    """Return the covariances of the rows' noise, (num, m, m). covs: those of the sensor's noise model, (num, m, m)."""
    return scan.covs(covs) if isinstance(scan, ScanRows) else covs


def with_added_noise(scan: ScanLike, added: Floats) -> ScanRows:
    """Return a scan whose noise has covariances (num, m, m) in addition."""
    values, noise, before, *ratios = to_measurements(scan)
    return _unchecked(values, noise, added + before if len(before) else added, *ratios)


def with_scaled_noise(scan: ScanLike, factor: float) -> ScanLike:
    """Return a scan with this many times the covariances that its rows bring in place of those of the noise model."""
    if not isinstance(scan, ScanRows):
        return scan
    values, noise, *others = to_measurements(scan)
    return _unchecked(values, factor * noise, *others)


@cache
def _nothing(meas_dim: int) -> tuple[Floats, ...]:
    return ScanRows(np.empty((0, meas_dim))).to_kernel()[1:]


def to_measurements(scan: ScanLike) -> Measurements:
    """Return a scan as kernels take it."""
    return scan.to_kernel() if isinstance(scan, ScanRows) else Measurements(scan, *_nothing(scan.shape[1]))
