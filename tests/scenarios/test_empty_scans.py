"""Scans without a row: found where a sensor has a period, and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from vedette.recorded import Conventions, RecordedScans, RecordedSensor, as_table, parse_scans

Rows = list[tuple[float, float, float]]


def one_target(seed: int, *, period: float = 2.0, detection: float = 0.6, jitter: float = 0.0) -> tuple[Rows, int]:
    """Rows (time, x, y) of 300 scans of a moving target; the number of empty scans between the first and last row."""
    rng = np.random.default_rng(seed)
    times = period * (np.arange(300) + rng.normal(0.0, jitter, 300))
    rows = [(float(t), *(0.5 * t + rng.normal(0.0, 1.0, 2)).tolist()) for t in times if rng.random() < detection]
    inside = np.count_nonzero((times >= rows[0][0]) & (times <= rows[-1][0]))
    return rows, int(inside) - len(rows)


def read(rows: Sequence[tuple[float, float | None, float | None]], **conventions: str) -> RecordedScans:
    columns = {name: [row[k] for row in rows] for k, name in enumerate(("time", "x", "y"))}
    sensor = RecordedSensor("C", "position", (0.0, 0.0, 0.0))
    return parse_scans(as_table(columns), (sensor,), Conventions({}, {}, **conventions))  # type: ignore[arg-type]


def sizes(recording: RecordedScans) -> list[int]:
    return [len(scan) for (scan,) in recording.scans if scan is not None]


@pytest.mark.parametrize(("detection", "jitter"), [(0.6, 0.0), (0.6, 0.05), (0.25, 0.0), (0.9, 0.1)])
def test_all_empty_scans_of_a_sensor_with_a_period_are_found(detection: float, jitter: float) -> None:
    for seed in range(5):
        rows, num_empty = one_target(seed, detection=detection, jitter=jitter)
        found = read(rows)
        assert abs(sizes(found).count(0) - num_empty) <= (1 if jitter else 0)
        text = f"C {len(found.times)} scans, of them {sizes(found).count(0)} without a row (one each "
        assert found.empty[0].startswith(text)


def test_a_gap_too_long_for_chance_is_an_outage() -> None:
    rows, num_empty = one_target(0)
    later = [(time + 1000.0 * (time > 300.0), x, y) for time, x, y in rows]
    assert sizes(read(later)).count(0) <= num_empty
    assert read(later).empty[0].endswith("; not in 1 longer gap, taken for outages)")


def test_a_sensor_that_sometimes_scans_twice_within_half_a_period_has_none() -> None:
    """Its other scans alone are as regular as those of a sensor with a period."""
    rows, _ = one_target(0, detection=0.95)
    assert read(rows).empty
    again = [(time + 0.05, x, y) for time, x, y in rows[40::60]]
    assert not read(sorted([*rows, *again])).empty


def test_rows_of_empty_cells_and_the_setting_leave_the_scans_as_they_are() -> None:
    rows, _ = one_target(0)
    assert 0 not in sizes(read(rows, empty_scans="none"))
    marked = read([*rows, (rows[-1][0] + 2.0, None, None)])
    assert (sizes(marked).count(0), marked.empty) == (1, ())


@pytest.mark.parametrize("resolution", [0.0, 1.0])
def test_a_sensor_to_which_targets_report_has_no_period(resolution: float) -> None:
    """Ships report every ten seconds, each at its own time, which some receivers round to seconds."""
    rng, rows = np.random.default_rng(1), Rows()
    for phase in rng.uniform(0.0, 10.0, 5).tolist():
        place = rng.uniform(-1000.0, 1000.0, 2)
        for time in np.arange(phase, 600.0, 10.0).tolist():
            at = time + rng.normal(0.0, 0.5)
            rows.append((round(at) if resolution else at, *(place + 2.0 * at + rng.normal(0.0, 5.0, 2)).tolist()))
    assert 0 not in sizes(read(sorted(rows)))
