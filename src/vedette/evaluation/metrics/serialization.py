"""Serialisation of a run's metrics as an Arrow file, stored next to the run. They can be computed again from it."""

from collections.abc import Iterable

import numpy as np

from vedette.errors import InputError
from vedette.evaluation.metrics.run import COLUMNS, RunMetrics
from vedette.internal.reading import error_summary
from vedette.kernels.base.types import Floats
from vedette.simulation.arrow import Kind, Layout, read_metadata, read_table, write_table

_VERSION = "1"  # changes with the definition of a built-in metric
_SET = " ".join((_VERSION, *COLUMNS))  # built-in metrics of this version
_LAYOUT = Layout({}, {"": Kind.NUMBER})


def encode_metrics(metrics: RunMetrics) -> bytes:
    """Return the metrics as bytes. Equal metrics give equal bytes."""
    columns = {name: column.astype(np.float64) for name, column in metrics.columns().items()}
    return write_table(columns, _LAYOUT, {"built_in": _SET, "own": " ".join(metrics.custom)})  # type: ignore[arg-type] # arrays only


def has_metrics(content: bytes, custom: Iterable[str]) -> bool:
    """Return True if the bytes have all metrics of this version, and custom metrics with these names."""
    try:
        metadata = read_metadata(content)
        return metadata["built_in"] == _SET and set(custom) <= set(metadata["own"].split())
    except Exception:  # damaged bytes can raise almost any exception
        return False


def decode_metrics(content: bytes, num_scans: int) -> tuple[RunMetrics | None, dict[str, Floats]]:
    """Return the metrics from their bytes, and the custom ones among them.

    The metrics are None if another version with other definitions wrote them. The custom ones are returned all the
    same.

    Raises `InputError` for other bytes, and for metrics of another number of scans.
    """
    try:
        built_in = read_metadata(content)["built_in"]
    except Exception as error:  # damaged bytes can raise almost any exception
        raise InputError(
            f"metrics: expected measures as an Arrow file; it is damaged: {error_summary(error)}"
        ) from error
    columns = {name: np.asarray(column) for name, column in read_table(content, _LAYOUT, "metrics").items()}
    if any(len(column) != num_scans for column in columns.values()):
        got = len(next(iter(columns.values())))
        raise InputError(f"metrics: expected one entry for each of {num_scans} scans; got {got}")
    custom = {name: column for name, column in columns.items() if name not in built_in.split()}
    if built_in != _SET:
        return None, custom
    for name, dtype in COLUMNS.items():
        if name not in columns or not (dtype == np.float64 or np.array_equal(np.rint(columns[name]), columns[name])):
            raise InputError(f"metrics, column {name}: expected {'' if dtype == np.float64 else 'whole '}numbers")
        columns[name] = columns[name].astype(dtype)
    return RunMetrics.from_columns(columns), custom
