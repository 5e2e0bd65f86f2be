"""Times of recordings: seconds of the day over midnight, milliseconds, and scans too far apart for seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.recorded import Conventions, RecordedScans, RecordedSensor, as_table, parse_scans
from vedette.recorded.reports import parse_reports
from vedette.recorded.tables import across_midnight
from vedette.scenarios.from_recording import scenario_from_recording

CLOCK = np.arange(86_250.0, 86_550.0, 5.0)


def read(times: Floats, name: str = "time", **units: str) -> RecordedScans:
    columns = {name: times.tolist(), "x": times.tolist(), "y": times.tolist()}
    return parse_scans(as_table(columns), (RecordedSensor("C", "position", (0.0,) * 3),), Conventions({}, units))


def test_seconds_of_the_day_increase_over_midnight() -> None:
    found = read(CLOCK % 86_400.0)
    np.testing.assert_array_equal(found.times, CLOCK - CLOCK[0])
    assert found.start == CLOCK[0]
    assert "times are seconds of the day and pass midnight: 30 rows counted from the day before" in found.notes[0]
    rows = {"time": CLOCK[::-1] % 86_400.0, "id": ["a"] * len(CLOCK), "x": CLOCK, "y": CLOCK}
    np.testing.assert_array_equal(parse_reports(as_table(rows)).times, CLOCK)


@pytest.mark.parametrize(
    "times",
    [
        np.arange(0.0, 86_400.0, 600.0),  # one day
        np.random.default_rng(0).permutation(np.arange(0.0, 86_400.0, 600.0)),
        np.array([0.0, 50_000.0, 100_000.0]),  # not of a day
        1.4e9 + CLOCK,
    ],
)
def test_other_times_stay(times: Floats) -> None:
    np.testing.assert_array_equal(across_midnight(times), times)


def test_three_days_in_order() -> None:
    times = np.arange(80_000.0, 300_000.0, 500.0)
    np.testing.assert_array_equal(across_midnight(times % 86_400.0), times)


def test_times_have_units() -> None:
    times = np.array([0.0, 2500.0, 5000.0])
    for found in (read(times, "time_ms"), read(times, time="ms"), read(1e3 * times, "time_us")):
        np.testing.assert_allclose(found.times, [0.0, 2.5, 5.0])


def test_scans_so_slow_that_times_are_in_another_unit_are_refused(tmp_path: Path) -> None:
    """Targets at the assumed speed would cross everything that was measured between two scans."""
    rows = [f"{2500 * k},{200.0 + 25.0 * k},0.0" for k in range(40)]
    (tmp_path / "scans.csv").write_text("\n".join(["time,x,y", *rows, ""]), "utf-8")
    text = (
        "sensors: [{name: C, position: [0.0, 0.0], measurement: {kind: position}, "
        "noise: {kind: constant, std: [5., 5.]}}]"
    )
    (tmp_path / "sensors.yaml").write_text(text, "utf-8")
    with pytest.raises(InputError, match=r"got 2500 s \(median\): give `recording: \{units: \{time: ms\}\}`"):
        scenario_from_recording(tmp_path / "sensors.yaml", tmp_path / "scans.csv")
    (tmp_path / "sensors.yaml").write_text(f"recording: {{units: {{time: ms}}}}\n{text}", "utf-8")
    found = scenario_from_recording(tmp_path / "sensors.yaml", tmp_path / "scans.csv")
    assert found.recording.times[-1] == pytest.approx(97.5)
