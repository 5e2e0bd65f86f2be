"""Weight that a sum over the heaviest joint choices of a cluster leaves out: its bound, and safe marginals."""

import math

from vedette.kernels.association.assignment import ABSENT, DualWork, Options, solve_assignment
from vedette.kernels.base.compile import borrowing, inlined
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import log_add, log_sum

# Log weight of an option that is taken only if there is no other.
_FORBIDDEN = -1e200
_LIKELIEST = 6  # options of a row that are compared with those of another row
_ROUNDING = 1e-12


@inlined
def _share_contested(options: Options, row: int, other: int, log_total: float, log_other: float) -> float:
    """Share of the choices of two rows in which both take one measurement, over the likeliest ones of each."""
    contested = 0.0
    for mine in range(options.offsets[row], min(options.offsets[row] + _LIKELIEST, options.offsets[row + 1])):
        for its in range(options.offsets[other], min(options.offsets[other] + _LIKELIEST, options.offsets[other + 1])):
            if options.columns[mine] >= 0 and options.columns[mine] == options.columns[its]:
                contested += math.exp(options.log_weights[mine] - log_total + options.log_weights[its] - log_other)
    return contested


@borrowing
def _log_uncontested(options: Options, rows: Ints, work: DualWork) -> float:
    """Upper bound on the log share of the joint choices without a shared measurement, if rows could share them.

    Each row is paired with the unpaired row with which it competes most. The choices in which no pair shares a
    measurement include all those in which no two rows do, and pairs are independent of one another.
    """
    log_totals, taken, log_share = work.row_dual, work.row_option, 0.0
    for i in range(len(rows)):
        log_totals[i] = log_sum(options.log_weights[options.offsets[rows[i]] : options.offsets[rows[i] + 1]])
        taken[i] = 0
    for i in range(len(rows)):
        most, partner = 0.0, -1
        for j in range(i + 1, len(rows)):
            if taken[i] == 0 and taken[j] == 0:
                contested = _share_contested(options, rows[i], rows[j], log_totals[i], log_totals[j])
                if contested > most:
                    most, partner = contested, j
        if partner >= 0:
            taken[partner] = 1
            log_share += math.log1p(-min(most, 1.0 - _ROUNDING))  # never all, despite rounding
    return log_share


@borrowing
def log_left_out_bound(options: Options, rows: Ints, log_summed: float, log_next: float, work: DualWork) -> float:
    """Upper bound on the log of the total weight of the joint choices that were not summed.

    It is the lesser of two bounds: the weight of all joint choices in which only pairs of rows may not share
    measurements, minus the weight summed, and the number of joint choices times exp(`log_next`), the largest weight of
    any left out.
    """
    log_all, log_count = _log_uncontested(options, rows, work), 0.0
    for row in rows:
        start, stop = options.offsets[row], options.offsets[row + 1]
        log_all += log_sum(options.log_weights[start:stop])
        log_count += math.log(stop - start)
    if log_all <= log_summed:
        return -math.inf
    # log (exp(all) - exp(summed)), without cancellation.
    return min(log_all + math.log(-math.expm1(log_summed - log_all)), log_count + log_next)


@inlined
def _sides(options: Options, row: int, marginals: Floats) -> tuple[int, float, float]:
    """Return the option of absence (-1: there is none), its log marginal, and the largest of the other options."""
    option_absent, absent, present = -1, -math.inf, -math.inf
    for option in range(options.offsets[row], options.offsets[row + 1]):
        if options.columns[option] == ABSENT:
            option_absent, absent = option, marginals[option]
        else:
            present = max(present, marginals[option])
    return option_absent, absent, present


@borrowing
def has_closed_side(options: Options, rows: Ints, marginals: Floats) -> bool:
    """Return True if some row that may be absent or present has probability zero of one of them."""
    for row in rows:
        option_absent, absent, present = _sides(options, row, marginals)
        both_possible = option_absent >= 0 and options.offsets[row + 1] - options.offsets[row] > 1
        if both_possible and (absent == -math.inf or present == -math.inf):
            return True
    return False


@borrowing
def _heaviest_absent(options: Options, rows: Ints, at: int, option_absent: int, work: DualWork) -> float:
    """Return the log weight of the heaviest joint choice in which row `rows[at]` is absent."""
    last = len(rows) - 1
    # The order of rows does not affect an assignment: the row is moved to the end and left out.
    rows[at], rows[last] = rows[last], rows[at]
    cost = solve_assignment(options, rows[:last], work)
    rows[at], rows[last] = rows[last], rows[at]
    return options.log_weights[option_absent] - cost


@borrowing
def _heaviest_present(options: Options, rows: Ints, at: int, option_absent: int, work: DualWork) -> tuple[int, float]:
    """Return the option of row `rows[at]` in the heaviest joint choice with it present, and that choice's log weight.

    Absence is temporarily moved to the end of the row, with a weight below every possible one.
    """
    columns, log_weights, last = options.columns, options.log_weights, options.offsets[rows[at] + 1] - 1
    log_absent = log_weights[option_absent]
    for option in range(option_absent, last):
        columns[option], log_weights[option] = columns[option + 1], log_weights[option + 1]
    columns[last], log_weights[last] = ABSENT, _FORBIDDEN
    log_weight, chosen = -solve_assignment(options, rows, work), work.row_option[at]
    for option in range(last, option_absent, -1):
        columns[option], log_weights[option] = columns[option - 1], log_weights[option - 1]
    columns[option_absent], log_weights[option_absent] = ABSENT, log_absent
    if chosen == last or log_weight <= 0.5 * _FORBIDDEN:
        return chosen, -math.inf
    return (chosen + 1 if chosen >= option_absent else chosen), log_weight


@borrowing
def open_sides(options: Options, rows: Ints, log_summed: float, work: DualWork, marginals: Floats) -> None:
    """Ensure that no row is certainly present, or certainly absent, only because all summed choices agree on it.

    If none has it absent (or none has it present), the heaviest choice that does, found by one assignment, is added to
    this row's marginals. Its weight is at most what was left out, so that marginals stay within the share left out of
    the true ones, and a row's other options keep their proportions. A side without any possible choice stays
    impossible.
    """
    for at in range(len(rows)):
        start, stop = options.offsets[rows[at]], options.offsets[rows[at] + 1]
        option, absent, present = _sides(options, rows[at], marginals)
        if option < 0 or stop - start == 1 or (absent > -math.inf and present > -math.inf):
            continue
        if absent == -math.inf:
            log_weight = _heaviest_absent(options, rows, at, option, work)
        else:
            option, log_weight = _heaviest_present(options, rows, at, option, work)
        if log_weight == -math.inf:
            continue
        share = log_weight - log_summed
        scale = log_add(0.0, share)
        for other in range(start, stop):
            marginals[other] -= scale
        marginals[option] = share - scale
