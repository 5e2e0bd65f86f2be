"""Runs as Arrow files, one per table: the files of a saved run, and of a run stored in a campaign."""

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
    record_of,
    summary_of,
    tables_of,
    timing_table,
    timings_of,
)

# Version of saved runs and campaigns; it changes whenever a table gains, loses or renames a column. A new optional
# table needs no new version: earlier programs ignore it, and their files stay readable.
FORMAT_VERSION = 7
ENDING = ".arrow"
_FILES = frozenset(f"{name}{ENDING}" for name in (*LAYOUTS, *OPTIONAL))
SUMMARY_FILES = frozenset(f"{name}{ENDING}" for name in SUMMARY_TABLES)  # read by `decode_summary`


def encode_run(record: RunRecord) -> dict[str, bytes]:
    """Return file names and contents of a run, without `run_facts` and timings. Equal runs give equal bytes.

    Raises `InputError` for a record that contradicts itself or holds an invalid plan.
    """
    record.check()
    layouts = {**LAYOUTS, **OPTIONAL}
    return {f"{name}{ENDING}": write_table(table, layouts[name]) for name, table in tables_of(record).items()}


def decode_run(
    facts: Mapping[str, Any], files: Mapping[str, bytes], place: str, timings: bytes | None = None
) -> RunRecord:
    """Return the record from its files. Without `timings` (from `encode_timings`) it has none.

    Raises `InputError`, naming `place` and the file, for files that are missing, damaged or inconsistent.
    """
    tables, seconds = _tables(facts, files, place, timings)
    with _errors_naming(place):
        record = record_of(facts, tables, seconds)
        record.check()
    return record


def decode_summary(
    facts: Mapping[str, Any], files: Mapping[str, bytes], place: str, timings: bytes | None = None
) -> RunSummary:
    """Return the summary of a run from its files, in a third of the time of `decode_run`. Raises as `decode_run`.

    Tables of targets and tracks are not read.
    """
    tables, seconds = _tables(facts, files, place, timings, SUMMARY_FILES)
    with _errors_naming(place):
        return summary_of(facts, tables, seconds)


def _tables(
    facts: Mapping[str, Any],
    files: Mapping[str, bytes],
    place: str,
    timings: bytes | None,
    wanted: Collection[str] = _FILES,
) -> tuple[dict[str, Columns], dict[str, Floats]]:
    """Return the wanted tables that exist, and the timings."""
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
    """Context manager that turns errors about inconsistent files into `InputError` with the place."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}: {error}") from error
    except Exception as error:  # inconsistent files can raise nearly any error
        raise InputError(
            f"{place}: expected the files of a run; they do not fit together: {error_summary(error)}"
        ) from error


def encode_timings(record: RunRecord) -> bytes:
    """Return the wall times of every stage and scan, the only content of a run that its seed does not determine."""
    return write_table(timing_table(record), TIMINGS)


def decode_timings(content: bytes, place: str) -> dict[str, Floats]:
    """Return the timings from their bytes. Raises `InputError`, naming the place, for other bytes."""
    return timings_of(read_table(content, TIMINGS, place))
