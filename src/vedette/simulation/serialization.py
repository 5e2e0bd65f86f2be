"""A run as files, an Arrow file a table: those of a saved run's folder, and what a campaign keeps of a run."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from vedette.errors import InputError
from vedette.internal.reading import error_summary
from vedette.internal.text import shown
from vedette.kernels.base.types import Floats
from vedette.simulation.arrow import Columns, read_table, write_table
from vedette.simulation.decision_tables import DECISION_TABLES
from vedette.simulation.records import RunRecord, RunSummary
from vedette.simulation.tables import (
    LAYOUTS,
    OPTIONAL,
    SUMMARY_TABLES,
    TIMINGS,
    check_record,
    record_of,
    summary_of,
    tables_of,
    timing_table,
    timings_of,
)

# Of saved runs and of campaigns; another wherever a table gains, loses or renames a column. A table that may be missing
# needs none: programs of before it was there pass it over, and what they wrote reads as it did.
FORMAT_VERSION = 6
# What the tables of a format lack of those of the next, and what stands there in runs of that format, NaN where it is
# not known: by it they are upgraded (`vedette.simulation.upgrading`). What was released once stays here.
LACKING: dict[int, dict[str, dict[str, float]]] = {5: {"sensors": {"factoring_error": math.nan}}}
ENDING = ".arrow"
_FILES = frozenset(f"{name}{ENDING}" for name in (*LAYOUTS, *OPTIONAL))
SUMMARY_FILES = frozenset(f"{name}{ENDING}" for name in SUMMARY_TABLES)  # that `decode_summary` reads


def encode_run(record: RunRecord) -> dict[str, bytes]:
    """File names and contents: all of a run but `run_facts` and its timings. Equal runs give equal bytes.

    Raises `InputError` for a record that contradicts itself or holds an invalid plan.
    """
    check_record(record)
    layouts = {**LAYOUTS, **OPTIONAL}
    return {f"{name}{ENDING}": write_table(table, layouts[name]) for name, table in tables_of(record).items()}


def decode_run(
    facts: Mapping[str, Any], files: Mapping[str, bytes], place: str, timings: bytes | None = None
) -> RunRecord:
    """The record back from its files; without `timings`, as `encode_timings` gives them, it has none.

    Raises `InputError`, naming `place` and the file, for files that are missing, damaged or do not fit together.
    """
    tables, spent = _tables(facts, files, place, timings)
    with _errors_naming(place):
        record = record_of(facts, tables, spent)
        check_record(record)
    return record


def decode_summary(
    facts: Mapping[str, Any], files: Mapping[str, bytes], place: str, timings: bytes | None = None
) -> RunSummary:
    """What is compared and reported of a run, from its files, in a third of the time; raises as `decode_run`.

    Tables of targets and tracks are not looked at.
    """
    tables, spent = _tables(facts, files, place, timings, SUMMARY_FILES)
    with _errors_naming(place):
        return summary_of(facts, tables, spent)


def _tables(
    facts: Mapping[str, Any],
    files: Mapping[str, bytes],
    place: str,
    timings: bytes | None,
    wanted: Collection[str] = _FILES,
) -> tuple[dict[str, Columns], dict[str, Floats]]:
    """The tables of the wanted files that there are, and the timings."""
    tables = {}
    for name, layout in {**LAYOUTS, **OPTIONAL}.items():
        file = f"{name}{ENDING}"
        if file not in wanted:
            continue
        if file in files:
            tables[name] = read_table(files[file], layout, f"{place}/{file}")
        elif name in LAYOUTS and not (name in DECISION_TABLES and facts.get("recording") is not None):
            raise InputError(f"{place}: expected a file {file}; got {shown(', '.join(files)) if files else 'none'}")
    return tables, {} if timings is None else decode_timings(timings, f"{place}/timings{ENDING}")


@contextmanager
def _errors_naming(place: str) -> Iterator[None]:
    """What files of no run raise, as errors that name the place."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
    except Exception as error:  # they can raise nearly anything on the way to a run
        raise InputError(
            f"{place}: expected the files of a run; they do not fit together: {error_summary(error)}"
        ) from error


def encode_timings(record: RunRecord) -> bytes:
    """The seconds of every stage and scan: the one thing of a run that its seed does not fix."""
    return write_table(timing_table(record), TIMINGS)


def decode_timings(content: bytes, place: str) -> dict[str, Floats]:
    """The timings back from their bytes. Raises `InputError`, naming the place, for other bytes."""
    return timings_of(read_table(content, TIMINGS, place))
