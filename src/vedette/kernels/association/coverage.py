"""A hypothesis for every way in which a target may be seen, so that an unlikely track lives until evidence decides.

The heaviest hypotheses are many variations on a few themes. A target whose first measurements fit its birth badly
starts in a hypothesis far down the list; cut there, it is lost for good, since no later hypothesis holds its track. So
the heaviest hypothesis of every theme is kept besides. A theme is a label together with what the scan did to it:
missed, or detected as this measurement.
"""

from __future__ import annotations

import math

import numpy as np

from vedette.kernels.association.assignment import ABSENT, Options, make_dual_work, solve_assignment
from vedette.kernels.association.ranked import Children, Parents, append_child, grown_children, is_full
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Ints


@kernel
def themes_of_options(labels: Ints, options: Options, num_columns: int) -> tuple[Ints, int]:
    """Number of each option's theme, -1 if absent, and how many themes there may be. labels: (num_rows, 2)."""
    firsts, num_labels = np.empty(len(labels), np.int64), 0
    themes = np.empty(options.offsets[len(labels)], np.int64)
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
            themes[option] = -1 if column == ABSENT else found * (num_columns + 1) + column + 1
    return themes, num_labels * (num_columns + 1)


@kernel
def _best_parents(options: Options, parents: Parents) -> tuple[Ints, Floats]:
    """For each row, the parent that may give it the heaviest choice and the bound, ignoring collisions; -1: none."""
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
    options: Options, themes: Ints, best_parent: Ints, best_bound: Floats, is_covered: Ints, floor: float
) -> tuple[Ints, Ints]:
    """Row and option (-1: none) that may give each uncovered theme its heaviest choice, of those bounded by `floor`."""
    theme_rows, theme_options = filled_ints(len(is_covered), -1), filled_ints(len(is_covered), -1)
    bounds = np.empty(len(is_covered))
    for row in range(len(best_parent)):
        if best_parent[row] < 0:
            continue
        first = options.offsets[row]
        for option in range(first, options.offsets[row + 1]):
            bound = best_bound[row] - options.log_weights[first] + options.log_weights[option]
            theme = themes[option]
            if theme < 0 or is_covered[theme] == 1 or bound < floor:
                continue
            if theme_rows[theme] < 0 or bound > bounds[theme]:
                theme_rows[theme], theme_options[theme], bounds[theme] = row, option, bound
    return theme_rows, theme_options


@kernel
def _with_spare_row(options: Options) -> Options:
    """The same options and one more row, the last, of one option that is to be filled in."""
    num_rows = len(options.offsets) - 1
    num = options.offsets[num_rows]
    offsets, columns, log_weights = np.empty(num_rows + 2, np.int64), np.empty(num + 1, np.int64), np.empty(num + 1)
    for row in range(num_rows + 1):
        offsets[row] = options.offsets[row]
    offsets[num_rows + 1] = num + 1
    for option in range(num):
        columns[option] = options.columns[option]
        log_weights[option] = options.log_weights[option]
    return Options(offsets, columns, log_weights, options.entries, options.component_log_weights, options.whitened)


@kernel
def add_uncovered(
    options: Options,
    themes: Ints,
    num_themes: int,
    parents: Parents,
    children: Children,
    num_columns: int,
    max_log_gap: float,
) -> Children:
    """The children and, for every theme that none of them holds, a heavy choice that holds it: the best one with the
    track and the parent of the largest bound. Choices more than `max_log_gap` under the heaviest child are left out.
    """
    max_rows, best = 0, -math.inf
    for parent in range(len(parents.log_weights)):
        max_rows = max(max_rows, parents.offsets[parent + 1] - parents.offsets[parent])
    for log_weight in children.log_weights:
        best = max(best, log_weight)
    is_covered = filled_ints(num_themes, 0)
    for option in children.options:
        if themes[option] >= 0:
            is_covered[themes[option]] = 1
    best_parent, best_bound = _best_parents(options, parents)
    theme_rows, theme_options = _candidates(options, themes, best_parent, best_bound, is_covered, best - max_log_gap)
    forced = _with_spare_row(options)
    spare_row, spare = len(options.offsets) - 1, options.offsets[len(options.offsets) - 1]
    work = make_dual_work(max_rows, num_columns)
    rows = np.empty(max_rows, np.int64)
    used = np.empty(2, np.int64)
    used[0], used[1] = len(children.parents), len(children.options)
    for theme in range(num_themes):
        option, parent, place = theme_options[theme], -1, -1
        if option < 0:
            continue
        parent = best_parent[theme_rows[theme]]
        start, count = parents.offsets[parent], parents.offsets[parent + 1] - parents.offsets[parent]
        for i in range(count):
            rows[i] = parents.rows[start + i]
            if rows[i] == theme_rows[theme]:
                rows[i] = spare_row
                place = i
        forced.columns[spare], forced.log_weights[spare] = options.columns[option], options.log_weights[option]
        log_weight = parents.log_weights[parent] - solve_assignment(forced, rows[:count], work)
        if log_weight < best - max_log_gap or log_weight == -math.inf:
            continue
        if is_full(children, used, count):
            children = grown_children(children, used, count)
        at = append_child(children, used, parent, count, log_weight)
        for i in range(count):
            children.options[at + i] = option if i == place else work.row_option[i]
    num = used[0]
    return Children(
        children.parents[:num], children.offsets[: num + 1], children.options[: used[1]], children.log_weights[:num]
    )


@kernel
def mark_heaviest(
    children: Children,
    order: Ints,
    themes: Ints,
    num_themes: int,
    num_safe: int,
    most: int,
    max_log_gap: float,
    marks: Ints,
) -> int:
    """Mark with 1 the heaviest child of each theme that the `num_safe` heaviest do not hold, at most `most` children,
    none more than `max_log_gap` under the first; their number. order: the children to look at, heaviest first.
    """
    seen = filled_ints(num_themes, 0)
    num_marked = 0
    for place in range(len(order)):
        child = order[place]
        gap = children.log_weights[order[0]] - children.log_weights[child]
        if num_marked == most or gap > max_log_gap:
            break
        is_needed = 0
        for i in range(children.offsets[child], children.offsets[child + 1]):
            theme = themes[children.options[i]]
            if theme >= 0 and seen[theme] == 0:
                seen[theme] = 1
                is_needed = 1
        if place >= num_safe:
            marks[child] = is_needed
            num_marked += is_needed
    return num_marked
