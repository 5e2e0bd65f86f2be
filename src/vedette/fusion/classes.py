"""Class probabilities of fused targets, updated by the evidence of each sensor's scan."""

import numpy as np

from vedette.kernels.base.types import Floats


def class_gains(after: Floats, before: Floats) -> Floats:
    """Return the log likelihood of each class that took log probabilities from `before` to `after`.

    0 for a class that was impossible before. Arguments: of any shape (..., num_classes).
    """
    with np.errstate(invalid="ignore"):
        return np.where(before > -np.inf, after - before, 0.0)


def updated_classes(prior: Floats, gains: Floats) -> tuple[Floats, Floats]:
    """Return log class probabilities updated by log likelihoods, and the logs of the factors of their weights.

    Classes of a mixture are taken as independent of its states.

    prior, gains: (num, num_classes). Without classes the factors are 1.
    """
    if prior.shape[1] == 0:
        return prior.copy(), np.zeros(len(prior))
    logs = prior + gains
    log_factors = np.logaddexp.reduce(logs, axis=1)
    return logs - log_factors[:, np.newaxis], log_factors
