"""Logistic functions and the quantile of chi-squared, against SciPy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import special

from vedette.internal.probabilities import chi_squared_quantile, expit, log_expit, logit

ODDS = np.concatenate([np.linspace(-745.0, 745.0, 2001), np.linspace(-3.0, 3.0, 1001), [0.0, -np.inf, np.inf]])


def test_logistic_functions() -> None:
    with np.errstate(all="raise", under="ignore"):
        probabilities, logs = expit(ODDS), log_expit(ODDS)
    np.testing.assert_allclose(probabilities, special.expit(ODDS), rtol=1e-15, atol=1e-300)
    np.testing.assert_allclose(logs, special.log_expit(ODDS), rtol=1e-15)


@pytest.mark.parametrize("probability", [0.0, 1e-300, 1e-9, 0.3, 0.5, 0.8, 1.0 - 2.0**-53, 1.0])
def test_log_odds(probability: float) -> None:
    assert logit(probability) == pytest.approx(float(special.logit(probability)), rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("dim", [1, 2, 3, 4, 5, 10, 51, 200])
def test_quantiles_of_chi_squared(dim: int) -> None:
    for probability in (1e-3, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0 - 1e-6, 1.0 - 1e-9, 1.0 - 2.0**-53):
        expected = 2.0 * float(special.gammainccinv(0.5 * dim, 1.0 - probability))
        assert chi_squared_quantile(dim, probability) == pytest.approx(expected, rel=1e-14 / probability)
    assert chi_squared_quantile(dim, 0.0) == 0.0
    assert chi_squared_quantile(dim, 1.0) == math.inf
