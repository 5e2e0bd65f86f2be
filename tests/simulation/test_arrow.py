"""Tables put below one another, and written by their buffers: as pyarrow itself would."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from vedette.errors import InputError
from vedette.simulation import arrow
from vedette.simulation.arrow import Columns, Kind, Layout, read_table, stacked, to_arrow, write_table

LAYOUT = Layout(
    {"name": Kind.TEXT, "place": Kind.INTEGER, "truth": Kind.TRUTH, "number": Kind.NUMBER},
    {"value": Kind.VALUE, "count": Kind.COUNT},
)
PARTS: list[dict[str, Any]] = [
    {"name": "one", "place": np.array([3, 4, 5]), "truth": np.array([True, False, True]), "number": 0.5, "count_0": 7},
    {
        "name": ["ä", ""],
        "place": 1,
        "truth": False,
        "number": np.array([np.nan, 2.0]),
        "value_0": np.array([1.0, np.nan]),
    },
    {"name": "none", "place": np.empty(0, np.int64), "truth": True, "number": 1.0},
    {"name": "single", "place": 9, "truth": True, "number": -np.inf},
]
TABLE: dict[str, list[Any]] = {
    "name": ["one", "one", "one", "ä", "", "single"],
    "place": [3, 4, 5, 1, 1, 9],
    "truth": [True, False, True, False, False, True],
    "number": [0.5, 0.5, 0.5, np.nan, 2.0, -np.inf],
    "count_0": [7, 7, 7, None, None, None],
    "value_0": [None, None, None, 1.0, None, None],
}


def expected() -> pa.RecordBatch:
    value = pa.array(np.array([np.nan, np.nan, np.nan, 1.0, np.nan, np.nan]), from_pandas=True)
    return pa.record_batch({name: pa.array(values) for name, values in TABLE.items()} | {"value_0": value})


def test_tables_below_one_another_are_what_pyarrow_makes_of_the_rows() -> None:
    columns = stacked(PARTS, LAYOUT)
    assert list(columns) == list(TABLE)
    assert write_table(columns, LAYOUT) == written(expected())


def written(batch: pa.RecordBatch) -> bytes:
    out = pa.BufferOutputStream()
    with pa.ipc.new_file(out, batch.schema) as writer:
        writer.write_batch(batch)
    content: bytes = out.getvalue().to_pybytes()
    return content


def test_tables_are_read_back_with_what_they_lack() -> None:
    back = read_table(write_table(stacked(PARTS, LAYOUT), LAYOUT), LAYOUT, "here")
    for name, values in TABLE.items():
        missing = -1 if name == "count_0" else np.nan
        whole = [missing if value is None else value for value in values]
        np.testing.assert_array_equal(back[name], whole)
        assert name == "name" or back[name].flags.writeable  # type: ignore[union-attr]


def test_no_rows_have_all_columns() -> None:
    names = ["name", "value_1", "place", "truth", "number"]
    none = stacked([], LAYOUT, names)
    assert list(none) == names
    assert to_arrow(none, LAYOUT).schema.types == [pa.string(), pa.float64(), pa.int64(), pa.bool_(), pa.float64()]


def test_nan_is_nothing_where_that_is_asked_for() -> None:
    columns: Columns = {"number": np.array([np.nan, 1.0]), "place": np.array([1, 2])}
    found = to_arrow(columns, Layout({"number": Kind.NUMBER, "place": Kind.INTEGER}), nan_is_null=True)
    assert found.to_pydict() == {"number": [None, 1.0], "place": [1, 2]}


def test_more_text_than_offsets_can_say_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arrow, "_MOST_TEXT", 5)
    with pytest.raises(InputError, match="expected at most 5 bytes; got 6"):
        to_arrow({"name": ["abc", "def"]}, LAYOUT)


def test_a_column_that_is_not_among_the_names_is_named() -> None:
    with pytest.raises(InputError, match="column 'value_0': expected one of name, place"):
        stacked([{"name": "one", "place": 1, "value_0": 2.0}], LAYOUT, ["name", "place"])
