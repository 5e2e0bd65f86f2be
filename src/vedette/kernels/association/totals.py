"""Total weight of all joint choices of a scan, including those that were not found."""

import math

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.children import Children, Parents
from vedette.kernels.association.joint_totals import log_contested_share, make_total_work
from vedette.kernels.association.search import SearchCaps
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Bools, Floats
from vedette.kernels.gaussian.linalg import log_sum

# Largest log of a weight that can be summed with others in double precision.
_MOST_LOG = 600.0
# Rounding error of relative weights, and of the logs of equal weights.
ROUNDING = 1e-12


@kernel
def log_row_totals(options: Options) -> Floats:
    """Log total weight of each row's options, shape (num_rows,)."""
    totals = np.empty(len(options.offsets) - 1)
    for row in range(len(totals)):
        totals[row] = log_sum(options.log_weights[options.offsets[row] : options.offsets[row + 1]])
    return totals


@kernel
def log_total_bound(log_totals: Floats, parents: Parents) -> float:
    """Log total weight of all joint choices if rows could share measurements: an upper bound on the true total.

    log_totals: of the rows, as in `log_row_totals`.
    """
    bounds = np.empty(len(parents.log_weights))
    for parent in range(len(bounds)):
        bounds[parent] = parents.log_weights[parent]
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            bounds[parent] += log_totals[parents.rows[i]]
    return log_sum(bounds)


@inlined
def log_heaviest_left(children: Children, caps: SearchCaps, cut: bool) -> float:
    """Log of an upper bound on the weight of any joint choice that the ranking left out, -inf if there are none.

    children: as ranked, heaviest first. cut: True if ranking stopped at its bound on nodes.
    """
    num = children.filled[0]
    if num == 0:
        return math.inf
    is_stopped = cut or num >= caps.max_hypotheses
    return children.log_weights[num - 1] if is_stopped else children.log_weights[0] - caps.max_log_gap


@kernel
def log_weight_bound(
    options: Options, parents: Parents, children: Children, log_totals: Floats, log_next: float, log_bound: float
) -> float:
    """Log of an upper bound on the weight of all joint choices, including those that were found.

    It is equal to that weight if no cluster of a parent has more than `MAX_CONTESTED` contested measurements, and if
    the search has left nothing out.

    Args:
        options, parents: of the scan.
        children: those that were found, each once.
        log_totals: of the rows, as in `log_row_totals`.
        log_next: no choice left out is heavier than this. -inf: none is left out. inf: not known.
        log_bound: as in `log_total_bound`, for all parents, including those that were cut before.
    """
    num, best = children.filled[0], -math.inf
    for child in range(num):
        best = max(best, children.log_weights[child])
    if num == 0 or log_bound - best > _MOST_LOG:
        return log_bound
    found, in_all = np.zeros(len(parents.log_weights)), 0.0
    for child in range(num):
        weight = math.exp(children.log_weights[child] - best)
        found[children.parents[child]] += weight
        in_all += weight
    most, few = _left_at_most(options, parents, found, log_totals, best, log_next)
    before = math.exp(log_bound - best) - np.sum(most)
    left = before if before > ROUNDING * np.sum(most) else 0.0
    # Where the remainder is negligible, an exact sum is not needed.
    worth = few > ROUNDING * in_all / len(found)
    if np.any(worth):
        widest, num_rows = _sizes(parents, worth)
        work = make_total_work(options, widest, num_rows)
        for parent in range(len(found)):
            if not worth[parent]:
                continue
            rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
            weight = most[parent] * math.exp(log_contested_share(options, rows, log_totals, work))
            less = weight - found[parent]
            few[parent] = min(less, few[parent]) if less > ROUNDING * weight else 0.0
    for parent in range(len(found)):
        left += max(few[parent], 0.0)
    return min(log_bound, best + math.log(in_all + left))


@kernel
def _sizes(parents: Parents, worth: Bools) -> tuple[int, int]:
    """Return the number of rows of the widest parent that needs a sum, and of all of them."""
    widest, num_rows = 0, 0
    for parent in range(len(worth)):
        if worth[parent]:
            num = parents.offsets[parent + 1] - parents.offsets[parent]
            widest, num_rows = max(widest, num), num_rows + num
    return widest, num_rows


@kernel
def _left_at_most(
    options: Options, parents: Parents, found: Floats, log_totals: Floats, best: float, log_next: float
) -> tuple[Floats, Floats]:
    """For each parent a bound on its weight, and one on the weight of its joint choices that were not found.

    Both relative to exp(best), as is `found`, the weight of those that were found.
    """
    most, few, log_counts = np.empty(len(found)), np.empty(len(found)), np.empty(len(log_totals))
    for row in range(len(log_counts)):
        log_counts[row] = math.log(max(1, options.offsets[row + 1] - options.offsets[row]))
    for parent in range(len(found)):
        log_all, log_count = parents.log_weights[parent], 0.0
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            row = parents.rows[i]
            log_all += log_totals[row]
            log_count += log_counts[row]
        most[parent] = math.exp(log_all - best)
        few[parent] = min(math.exp(min(log_count + log_next - best, _MOST_LOG)), most[parent] - found[parent])
    return most, few
