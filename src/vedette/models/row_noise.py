"""Measurements that bring the covariance of their noise and the likelihood ratio of their features."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vedette.errors import InputError
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.row_noise import MISSING, replace_noise, row_length
from vedette.models.arguments import float_array
from vedette.models.fields import Real, check_fields

LOG_RATIO_OF_MISSING = 0.5 * math.log(2.0 * math.pi * MISSING)  # makes up for the density of the wide Gaussian
_STRONG_CLUTTER = 1e-3  # share of false measurements with the signal of a target


def with_row_noise(
    measurements: ArrayLike,
    covs: ArrayLike,
    log_likelihood_ratios: ArrayLike | None = None,
    added: ArrayLike | None = None,
    log_class_ratios: ArrayLike | None = None,
) -> Floats:
    """Return a scan whose measurements bring their noise, (num, m + m (m + 1) / 2 + 1), as all filters take it.

    Args:
        measurements: (num, m). A component after the second may be NaN: it was not measured.
        covs: (num, m, m) covariances of the noise, or (num, m) standard deviations, in SI units. A variance of 0
            leaves a component to the sensor's noise model.
        log_likelihood_ratios: (num,) log ratio of the probability densities of a measurement's features, such as its
            signal-to-noise ratio, if it is of a target and if it is false. None: 0.
        added: (num, m, m) covariances in addition to those, or to the sensor's noise model where it holds, such as
            those of the sensor's own pose. None: 0.
        log_class_ratios: (num, num_classes) the same ratio as `log_likelihood_ratios`, of further features, for a
            target of each class of `BirthModel.class_probs`. These are appended to the rows. None: no such features.

    Raises:
        InputError: an array of another shape, a number that is not finite, a covariance that is not symmetric and
            positive definite.
    """
    table = np.array(measurements, np.float64)
    if table.ndim != 2:
        raise InputError(f"measurements: expected shape (num, meas_dim); got {table.shape}")
    num, dim = table.shape
    given = np.asarray(covs, np.float64)
    if given.ndim == 2:
        given = float_array("covs", given, (num, dim))
        given = given[:, :, np.newaxis] ** 2 * np.eye(dim)
    given = float_array("covs", given, (num, dim, dim)).copy()
    more = np.zeros(given.shape) if added is None else float_array("added", added, (num, dim, dim))
    for name, each in (("covs", given), ("added", more)):
        if not np.array_equal(each, each.swapaxes(1, 2)) or (np.diagonal(each, axis1=1, axis2=2) < 0.0).any():
            raise InputError(f"{name}: expected symmetric positive definite covariances; got others")
    given = _sum(given, more)
    ratios = np.zeros(num) if log_likelihood_ratios is None else log_likelihood_ratios
    first, second = np.tril_indices(dim)
    ratios = float_array("log_likelihood_ratios", ratios, (num,)).copy()
    missing = np.isnan(table)
    missing[:, :2] = False
    for row, component in np.argwhere(missing).tolist():
        table[row, component], given[row, component], given[row, :, component] = 0.0, 0.0, 0.0
        given[row, component, component] = MISSING
        ratios[row] += LOG_RATIO_OF_MISSING
    scan = np.column_stack([table, given[:, first, second], ratios])
    if log_class_ratios is not None:
        scan = np.column_stack([scan, float_array("log_class_ratios", log_class_ratios, (num, None))])
    check_row_noise("covs", scan, dim)
    return scan


@dataclass(frozen=True, slots=True)
class SignalModel:
    """Signal-to-noise ratios of measurements: of targets that fluctuate from scan to scan (Swerling I) in noise.

    Above the threshold t, in units of the noise power, the power s has the density exp(-(s - t) / c) / c if the
    measurement is false, with the mean power c of clutter, and exp(-(s - t) / (1 + d)) / (1 + d) if it is of a target
    with the mean ratio d (Lerro and Bar-Shalom 1993, where c is 1). One false measurement in a thousand is taken to be
    as strong as targets are, which bounds the likelihood ratio.

    Attributes:
        mean_db: mean ratio of targets, d [dB].
        threshold_db: threshold above which the sensor reports a measurement, t [dB].
        clutter_db: mean power of clutter over that of the noise, c. 0: false measurements are noise [dB].

    Raises:
        InputError: a number that is not finite.
    """

    mean_db: Real
    threshold_db: Real
    clutter_db: Real = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "SignalModel.")

    def log_likelihood_ratio(self, snr_db: float) -> float:
        """Return the log likelihood ratio, target over false measurement, of a ratio in dB, below t that at t."""
        target, threshold, clutter, power = (
            10.0 ** (each / 10.0) for each in (self.mean_db, self.threshold_db, self.clutter_db, snr_db)
        )
        target += 1.0
        exact = max(power - threshold, 0.0) * (1.0 / clutter - 1.0 / target) - math.log(target / clutter)
        # log of 1 / (share + (1 - share) / ratio)
        return -float(np.logaddexp(math.log(_STRONG_CLUTTER), math.log1p(-_STRONG_CLUTTER) - exact))


def row_noise(
    stds: Sequence[float],
    missing: Sequence[bool],
    *,
    correlation: float = 0.0,
    log_likelihood_ratio: float = 0.0,
    added: Floats | None = None,
    log_class_ratios: Sequence[float] = (),
) -> tuple[float, ...]:
    """Return what follows a measurement in its row, as in `with_row_noise`.

    stds: of each component, 0 for that of the sensor's noise model. missing: of each component, True if it was not
    measured. correlation: of the first two components. added: (m, m) covariance in addition to these, or to that of the
    noise model. log_class_ratios: of each class, or () if the features of classes are not measured.
    """
    own = [math.sqrt(MISSING) if gap else std for std, gap in zip(stds, missing, strict=True)]
    covs = [own[a] * own[b] if a == b else 0.0 for a in range(len(own)) for b in range(a + 1)]
    if correlation:
        covs[1] = correlation * own[0] * own[1]
    if added is not None:
        places, own_covs = np.tril_indices(len(own)), np.zeros((1, len(own), len(own)))
        own_covs[0][places] = covs
        more = np.where(np.logical_or.outer(missing, missing), 0.0, added)
        covs = _sum(own_covs, more[np.newaxis])[0][places].tolist()
    return (*covs, LOG_RATIO_OF_MISSING * sum(missing) + log_likelihood_ratio, *log_class_ratios)


def _sum(covs: Floats, added: Floats) -> Floats:
    """Return covariances (num, m, m) with others added. A variance left to the noise model is minus what is added."""
    total = covs + added
    for a in range(covs.shape[1]):
        total[:, a, a] = np.where(covs[:, a, a] > 0.0, total[:, a, a], covs[:, a, a] - added[:, a, a])
    return total


def with_added_noise(scan: Floats, added: Floats) -> Floats:
    """Return a scan whose noise has covariances (num, m, m) in addition. Its rows may bring their noise."""
    dim = added.shape[1]
    if scan.shape[1] == dim:
        return with_row_noise(scan, np.zeros(added.shape), added=added)
    out, (first, second), covs = scan.copy(), np.tril_indices(dim), np.zeros(added.shape)
    lower = slice(dim, dim + len(first))
    covs[:, first, second] = covs[:, second, first] = scan[:, lower]
    out[:, lower] = _sum(covs, added)[:, first, second]
    return out


def measured_part(scan: Floats, meas_dim: int) -> Floats:
    """Return the measurements of a scan, (num, meas_dim), whose rows may bring their noise."""
    return scan if scan.shape[1] == meas_dim else scan[:, :meas_dim]


def noise_of_rows(scan: Floats, covs: Floats) -> Floats:
    """Return the covariances of the rows' noise, (num, m, m). covs: those of the sensor's noise model, (num, m, m)."""
    return covs if scan.shape[1] == covs.shape[1] else _replaced(scan, covs)


@kernel
def _replaced(scan: Floats, covs: Floats) -> Floats:
    out = covs.copy()
    for i in range(len(scan)):
        replace_noise(scan[i], out[i])
    return out


def check_row_noise(place: str, scan: Floats, meas_dim: int) -> None:
    """Raise `InputError` unless the covariances that rows bring are positive definite with a noise model of 1."""
    if not len(scan):
        return
    covs = noise_of_rows(scan, np.tile(np.eye(meas_dim), (len(scan), 1, 1)))
    stds = np.sqrt(np.maximum(np.diagonal(covs, axis1=1, axis2=2), np.finfo(np.float64).tiny))
    correlations = covs / (stds[:, :, np.newaxis] * stds[:, np.newaxis])
    wrong = np.linalg.eigvalsh(correlations)[:, 0] <= 0.0
    if wrong.any():
        row = int(np.argmax(wrong))
        got = scan[row, meas_dim : row_length(meas_dim) - 1].tolist()
        raise InputError(f"{place}: expected positive definite covariances of rows; got {got} in row {row}")
