"""Retention of one hypothesis for every possible association of a label, so that improbable tracks survive a scan.

The heaviest hypotheses are many variations on a few associations. A target whose first measurements fit its birth
badly starts in a hypothesis far down the list. If it is cut there, it is lost for good, since no later hypothesis holds
its track. Therefore the heaviest hypothesis of every association is kept as well. An association is a label together
with its result at the scan: missed, or detected as a given measurement, theta(label) of Vo, Vo, Hoang 2017.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import ABSENT, Options, make_dual_work, solve_assignment, with_options
from vedette.kernels.association.children import Children, Parents, append_child, grown_children, is_full, widest_parent
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints


class Associations(NamedTuple):
    """The numbered associations of a scan."""

    of_option: Ints  # (num_options,) number of each option's association, -1 if absent
    num: int  # upper bound on their number


@kernel
def associations_of_options(labels: Ints, options: Options) -> Associations:
    """Number the associations. Options of rows of one label with one measurement share one. labels: (num_rows, 2)."""
    firsts, num_labels = np.empty(len(labels), np.int64), 0
    numbers, places = np.empty(options.offsets[len(labels)], np.int64), options.num_measurements + 1
    for row in range(len(labels)):
        found = num_labels - 1
        while found >= 0:
            first = firsts[found]
            if labels[first, 0] == labels[row, 0] and labels[first, 1] == labels[row, 1]:
                break
            found -= 1
        if found < 0:
            found = num_labels
            firsts[num_labels] = row
            num_labels += 1
        for option in range(options.offsets[row], options.offsets[row + 1]):
            column = options.columns[option]
            numbers[option] = -1 if column == ABSENT else found * places + column + 1
    return Associations(numbers, num_labels * places)


@kernel
def _best_parents(options: Options, parents: Parents) -> tuple[Ints, Floats]:
    """For each row, the parent that may give it the heaviest choice (-1: none), and the bound, ignoring collisions."""
    best_parent = filled_ints(len(options.offsets) - 1, -1)
    best_bound = np.empty(len(best_parent))
    for parent in range(len(parents.log_weights)):
        bound = parents.log_weights[parent]
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            first = options.offsets[parents.rows[i]]
            bound += options.log_weights[first] if first < options.offsets[parents.rows[i] + 1] else -math.inf
        for i in range(parents.offsets[parent], parents.offsets[parent + 1]):
            row = parents.rows[i]
            if bound > -math.inf and (best_parent[row] < 0 or bound > best_bound[row]):
                best_parent[row], best_bound[row] = parent, bound
    return best_parent, best_bound


@kernel
def _candidates(
    options: Options, numbers: Ints, best_parent: Ints, best_bound: Floats, is_covered: Ints, floor: float
) -> tuple[Ints, Ints]:
    """Row and option (-1: none) that may give each uncovered association its heaviest choice.

    Only those whose bound is at least `floor`. numbers: association of each option.
    """
    its_row, its_option = filled_ints(len(is_covered), -1), filled_ints(len(is_covered), -1)
    bounds = np.empty(len(is_covered))
    for row in range(len(best_parent)):
        if best_parent[row] < 0:
            continue
        first = options.offsets[row]
        for option in range(first, options.offsets[row + 1]):
            # The best parent's bound, with this option in place of the row's best option.
            bound = best_bound[row] - options.log_weights[first] + options.log_weights[option]
            number = numbers[option]
            if number < 0 or is_covered[number] == 1 or bound < floor:
                continue
            if its_row[number] < 0 or bound > bounds[number]:
                its_row[number], its_option[number], bounds[number] = row, option, bound
    return its_row, its_option


@kernel
def _with_spare_row(options: Options) -> Options:
    """Return the same options and one more row, the last, with one option that the caller fills in."""
    num_rows = len(options.offsets) - 1
    num = options.offsets[num_rows]
    offsets, columns, log_weights = np.empty(num_rows + 2, np.int64), np.empty(num + 1, np.int64), np.empty(num + 1)
    for row in range(num_rows + 1):
        offsets[row] = options.offsets[row]
    offsets[num_rows + 1] = num + 1
    for option in range(num):
        columns[option] = options.columns[option]
        log_weights[option] = options.log_weights[option]
    return with_options(options, offsets, columns, log_weights, options.entries, options.num_measurements)


@kernel
def add_uncovered(
    options: Options, associations: Associations, parents: Parents, children: Children, max_log_gap: float
) -> Children:
    """Return the children and, for every association that none of them holds, a heavy choice that holds it.

    It is the best choice with the track and the parent of the largest bound, at most `max_log_gap` below the heaviest
    child.
    """
    numbers, best = associations.of_option, -math.inf
    for child in range(children.filled[0]):
        best = max(best, children.log_weights[child])
    is_covered = filled_ints(associations.num, 0)
    for i in range(children.filled[1]):
        if numbers[children.options[i]] >= 0:
            is_covered[numbers[children.options[i]]] = 1
    best_parent, best_bound = _best_parents(options, parents)
    its_row, its_option = _candidates(options, numbers, best_parent, best_bound, is_covered, best - max_log_gap)
    # A row that must take one option is a row with no other option: the spare row replaces it in the assignment.
    forced = _with_spare_row(options)
    spare_row, spare = len(options.offsets) - 1, options.offsets[len(options.offsets) - 1]
    widest = widest_parent(parents)
    work, rows = make_dual_work(widest, options.num_measurements), np.empty(widest, np.int64)
    for number in range(associations.num):
        option, parent, place = its_option[number], -1, -1
        if option < 0:
            continue
        parent = best_parent[its_row[number]]
        start, count = parents.offsets[parent], parents.offsets[parent + 1] - parents.offsets[parent]
        for i in range(count):
            rows[i] = parents.rows[start + i]
            if rows[i] == its_row[number]:
                rows[i] = spare_row
                place = i
        forced.columns[spare], forced.log_weights[spare] = options.columns[option], options.log_weights[option]
        log_weight = parents.log_weights[parent] - solve_assignment(forced, rows[:count], work)
        if log_weight < best - max_log_gap or log_weight == -math.inf:
            continue
        if is_full(children, count):
            children = grown_children(children, count)
        at = append_child(children, parent, count, log_weight)
        for i in range(count):
            children.options[at + i] = option if i == place else work.row_option[i]
    return children


@kernel
def mark_heaviest(
    children: Children,
    order: Ints,
    associations: Associations,
    num_safe: int,
    most: int,
    max_log_gap: float,
    marks: Ints,
) -> int:
    """Mark with 1 the heaviest child of each association that the `num_safe` heaviest do not hold. Return their number.

    At most `most` children, each at most `max_log_gap` below the first. order: the candidate children, heaviest first.
    """
    seen = filled_ints(associations.num, 0)
    num_marked = 0
    for place in range(len(order)):
        child = order[place]
        gap = children.log_weights[order[0]] - children.log_weights[child]
        if num_marked == most or gap > max_log_gap:
            break
        is_needed = 0
        for i in range(children.offsets[child], children.offsets[child + 1]):
            number = associations.of_option[children.options[i]]
            if number >= 0 and seen[number] == 0:
                seen[number] = 1
                is_needed = 1
        # Safe children cover their associations already; marking starts with those that would be cut.
        if place >= num_safe:
            marks[child] = is_needed
            num_marked += is_needed
    return num_marked
