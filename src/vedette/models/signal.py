"""Evidence of signal-to-noise ratios that a measurement is of a target."""

import math
from dataclasses import dataclass

import numpy as np

from vedette.models.fields import Real, check_fields

_STRONG_CLUTTER = 1e-3  # share of false measurements with the signal of a target


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
