"""Share of the expected births that a cap on hypotheses cuts.

A delta-GLMB makes a label for each birth site at each step. Until a scan confirms or rejects them, every set of these
labels is a hypothesis. `birth.period` keeps the expected number of births the same for steps of any length, but shorter
steps make more labels, and the cap on hypotheses cuts their larger sets.
"""

import math

# Share of the expected births above which a scenario is refused, or a scenario or filter causes a warning.
MAX_CUT_SHARE = 0.05


def cut_share(num_labels: float, probability: float, max_sets: int) -> float:
    """Return the share of the expected births that is cut if the `max_sets` heaviest sets of labels are retained.

    For n labels of probability q each, the sets of k labels have the probability q^k (1 - q)^(n - k). Small sets are
    the heaviest, and the retained ones are normalised.

    Args:
        num_labels: number of unconfirmed labels, at least 0.
        probability: of each, in (0, 0.5). For larger ones the result is 0.
        max_sets: number of hypotheses retained.
    """
    n, expected = math.floor(num_labels), math.floor(num_labels) * probability
    if n == 0 or probability >= 0.5:
        return 0.0
    remaining, total, births = float(max_sets), 0.0, 0.0
    odds = probability / (1.0 - probability)
    for k in range(min(n, math.ceil(expected + 10.0 * math.sqrt(expected) + 20.0)) + 1):
        log_sets = math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
        num_sets = min(math.exp(min(log_sets, 700.0)), remaining)
        weight = num_sets * math.exp(k * math.log(odds))  # relative to the set without births
        remaining, total, births = remaining - num_sets, total + weight, births + k * weight
        if remaining <= 0.5:
            break
    return max(0.0, 1.0 - births / total / expected)
