"""Concatenation of rows of a scan with their options, such as first detections after tracks."""

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.options import room_for_updated
from vedette.kernels.association.predicted import Rows, make_rows
from vedette.kernels.base.arrays import grown_floats, grown_ints
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.gaussian.components import copy_components
from vedette.kernels.gaussian.innovation import copy_innovation
from vedette.kernels.gaussian.marks import copy_updated_marks, marks_like


@kernel
def joined_rows(rows: Rows, options: Options, new: Rows, new_options: Options) -> tuple[Rows, Options]:
    """Return rows and their options, followed by others of the same scan."""
    num_rows, num_new = len(rows.log_absent), len(new.log_absent)
    num, num_components = rows.offsets[num_rows], rows.offsets[num_rows] + new.offsets[num_new]
    meas_dim = rows.innovation.predicted.shape[1]
    out = make_rows(num_rows + num_new, num_components, rows.components, meas_dim)
    _copy_rows(rows, out, 0, 0)
    _copy_rows(new, out, num_rows, num)
    num_options, num_entries = options.offsets[num_rows], len(options.component_log_weights)
    end_options, end_entries = num_options + new_options.offsets[num_new], num_entries + new.offsets[num_new]
    offsets = np.zeros(num_rows + num_new + 1, np.int64)
    columns, entries = grown_ints(options.columns, end_options), grown_ints(options.entries, end_options)
    log_weights = grown_floats(options.log_weights, end_options)
    component_log_weights = grown_floats(options.component_log_weights, end_entries)
    whitened = np.empty((len(component_log_weights), meas_dim))
    all_options = Options(
        offsets,
        columns,
        log_weights,
        entries,
        component_log_weights,
        whitened,
        room_for_updated(out, len(component_log_weights)),
        marks_like(options.marks, len(component_log_weights)),
        options.num_measurements,
    )
    for entry in range(num_entries):
        copy_entry(options, entry, all_options, entry)
    for row in range(num_rows):
        offsets[row + 1] = options.offsets[row + 1]
    for row in range(num_new):
        offsets[num_rows + row + 1] = num_options + new_options.offsets[row + 1]
    for option in range(new_options.offsets[num_new]):
        columns[num_options + option] = new_options.columns[option]
        log_weights[num_options + option] = new_options.log_weights[option]
        entry = new_options.entries[option]
        entries[num_options + option] = num_entries + entry if entry >= 0 else -1
    for entry in range(new.offsets[num_new]):
        component_log_weights[num_entries + entry] = new_options.component_log_weights[entry]
        copy_entry(new_options, entry, all_options, num_entries + entry)
    return out, all_options


@inlined
def copy_entry(source: Options, entry: int, out: Options, at: int) -> None:
    """Copy residual and marks of an entry, and its updated moments if both have components that bend."""
    for a in range(source.whitened.shape[1]):
        out.whitened[at, a] = source.whitened[entry, a]
    copy_updated_marks(source.marks, entry, out.marks, at)
    if source.updated.shape[0] > 0 and out.updated.shape[0] > 0:
        for i in range(source.updated.shape[1]):
            for j in range(source.updated.shape[2]):
                out.updated[at, i, j] = source.updated[entry, i, j]


@kernel
def _copy_rows(source: Rows, out: Rows, first: int, start: int) -> None:
    """Write rows, starting at row `first` and component `start`."""
    for row in range(len(source.log_absent)):
        out.labels[first + row, 0], out.labels[first + row, 1] = source.labels[row, 0], source.labels[row, 1]
        out.log_absent[first + row] = source.log_absent[row]
        out.offsets[first + row + 1] = start + source.offsets[row + 1]
    num = source.offsets[len(source.log_absent)]
    copy_components(source.components, 0, num, out.components, start)
    for c in range(num):
        copy_innovation(source.innovation, c, out.innovation, start + c)
