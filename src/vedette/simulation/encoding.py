"""A run as texts of CSV and JSON, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.reading import said
from vedette.simulation.columns import Columns, Kind, csv_header, read_csv, write_csv
from vedette.simulation.decisions import read_decisions, write_decisions
from vedette.simulation.records import RunRecord
from vedette.simulation.tabulation import TABLES, check_record, record_of, tables_of

DECISIONS, TIMINGS = "decisions.json", "timings.csv"


def encode_run(record: RunRecord) -> dict[str, str]:
    """File names and contents. Raises `InputError` for a record that contradicts itself or holds an invalid plan."""
    check_record(record)
    texts = {f"{name}.csv": write_csv(columns) for name, columns in tables_of(record).items()}
    texts[TIMINGS] = write_csv(timing_columns(record))
    return texts | {DECISIONS: write_decisions(record.decisions, indent=1)}


def decode_run(run: Mapping[str, Any], files: Mapping[str, str], place: str) -> RunRecord:
    """The record back from its texts. Raises `InputError`, naming `place` and the file, for texts that do not fit."""
    tables = {
        name: read_csv(_text(files, f"{name}.csv", place), kinds, f"{place}/{name}.csv")
        for name, kinds in TABLES.items()
    }
    timings = _read_timings(_text(files, TIMINGS, place), f"{place}/{TIMINGS}")
    try:
        record = record_of(run, tables, read_decisions(_text(files, DECISIONS, place)), timings)
        check_record(record)
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
    except Exception as error:  # files of no run can raise nearly anything on the way to one
        raise InputError(f"{place}: expected the files of a run; they do not fit together: {said(error)}") from error
    return record


def timing_columns(record: RunRecord) -> Columns:
    """Step and seconds by stage, `<stage>_s`."""
    seconds = {f"{stage}_s": spent for stage, spent in record.timings.items()}
    return {"step": np.arange(1, record.num_scans + 1), **seconds}


def timings_of(columns: Mapping[str, Any]) -> dict[str, Floats]:
    """The timings back from their columns."""
    return {name.removesuffix("_s"): seconds for name, seconds in columns.items() if name.endswith("_s")}


def _read_timings(text: str, file: str) -> dict[str, Floats]:
    kinds = {name: Kind.NUMBER for name in csv_header(text) if name.endswith("_s")}
    return timings_of(read_csv(text, kinds, file))


def _text(files: Mapping[str, str], name: str, place: str) -> str:
    if name not in files:
        raise InputError(f"{place}: expected a file {name}; the manifest names {', '.join(files) or 'none'}")
    return files[name]
