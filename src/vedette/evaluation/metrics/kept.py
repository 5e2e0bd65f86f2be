"""Measures of a run as the bytes of an Arrow file, kept beside the run that they can always be computed from again."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vedette.errors import InputError
from vedette.evaluation.metrics.run import COLUMNS, RunMetrics
from vedette.internal.reading import error_summary
from vedette.kernels.base.types import Floats
from vedette.simulation.arrow import Kind, Layout, read_metadata, read_table, write_table

_VERSION = "1"  # another wherever a built-in measure is defined otherwise
_SET = " ".join((_VERSION, *COLUMNS))  # what this version of the program measures
_LAYOUT = Layout({}, {"": Kind.NUMBER})


def encode_metrics(metrics: RunMetrics) -> bytes:
    """Equal measures give equal bytes."""
    columns = {name: column.astype(np.float64) for name, column in metrics.columns().items()}
    return write_table(columns, _LAYOUT, {"built_in": _SET, "own": " ".join(metrics.own)})  # type: ignore[arg-type] # arrays alone


def has_metrics(content: bytes, own: Iterable[str]) -> bool:
    """Whether all that this version of the program measures is there, and one's own measures of these names."""
    try:
        there = read_metadata(content)
        return there["built_in"] == _SET and set(own) <= set(there["own"].split())
    except Exception:  # damage can raise nearly anything in there
        return False


def decode_metrics(content: bytes, num_scans: int) -> tuple[RunMetrics | None, dict[str, Floats]]:
    """The measures back from their bytes, and those of one's own among them.

    None for those of another version of this program, which measured otherwise; one's own are there still.

    Raises `InputError` for other bytes, and measures of another number of scans.
    """
    try:
        built_in = read_metadata(content)["built_in"]
    except Exception as error:  # damage can raise nearly anything in there
        raise InputError(
            f"metrics: expected measures as an Arrow file; it is damaged: {error_summary(error)}"
        ) from error
    columns = {name: np.asarray(column) for name, column in read_table(content, _LAYOUT, "metrics").items()}
    if any(len(column) != num_scans for column in columns.values()):
        got = len(next(iter(columns.values())))
        raise InputError(f"metrics: expected one entry for each of {num_scans} scans; got {got}")
    own = {name: column for name, column in columns.items() if name not in built_in.split()}
    if built_in != _SET:
        return None, own
    for name, dtype in COLUMNS.items():
        if name not in columns or not (dtype == np.float64 or np.array_equal(np.rint(columns[name]), columns[name])):
            raise InputError(f"metrics, column {name}: expected {'' if dtype == np.float64 else 'whole '}numbers")
        columns[name] = columns[name].astype(dtype)
    return RunMetrics.from_columns(columns), own
