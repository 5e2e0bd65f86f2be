"""The model is tested against the latest scans of a stream: a drift is named, and goes; nothing else is changed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from live.examples import answered, crossing, line, small
from vedette.evaluation.fit import Finding
from vedette.live import LiveLoop, LiveState, PersistentLoop
from vedette.live.fit import LiveFit


def remarks(live: LiveLoop, lines: list[bytes]) -> list[dict[str, Any]]:
    """Answers with findings."""
    answers = map(json.loads, answered(live, lines))
    return [answer for answer in answers if "fit" in answer]


def final(live: LiveLoop, lines: list[bytes]) -> LiveState:
    state = live.initial()
    for one in lines:
        state, _ = live.process(state, one)
    return state


def test_a_drifting_sensor_is_named_within_two_minutes(tmp_path: Path) -> None:
    first, *_ = remarks(small(tmp_path), crossing(180, drift=1.0))
    assert 60.0 < first["time"] <= 180.0
    names = [each["sensor"] for each in first["fit"]["findings"]]
    assert "sensor 1" in names or any("sensor 1" in text for text in first["fit"]["new"])
    assert first["fit"]["gone"] == []


def test_a_right_model_has_no_finding_and_a_bounded_window(tmp_path: Path) -> None:
    fit = final(small(tmp_path), crossing(200)).fit
    assert fit.found == ()
    assert "pairs of a track and a scan" in fit.searched
    assert 100 < len(fit.compared) <= 140
    assert fit.before is not None
    assert fit.before.time == 194.0


def test_tracks_are_those_of_a_loop_without_tests(tmp_path: Path) -> None:
    live, lines = small(tmp_path), crossing(60)
    assert answered(live, lines) == answered(replace(live, assumed=None), lines)


def test_a_fault_of_the_tests_stops_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> None:
        raise RuntimeError("no inverse")

    monkeypatch.setattr("vedette.live.fit.compared", fails)
    state = final(small(tmp_path), crossing(20))
    assert (state.num_errors, state.timeline.num_processed) == (0, 40)
    assert state.fit.searched.startswith("nothing, as RuntimeError: no inverse")


def test_late_scans_are_tested_at_their_time(tmp_path: Path) -> None:
    live, lines = small(tmp_path), crossing(40)
    late = [*lines[:20], *(lines[i] for k in range(20, 80, 2) for i in (k + 1, k))]
    times = [[each.time for each in final(live, some).fit.compared] for some in (lines, late)]
    assert times[0] == times[1] == [float(k) for k in range(1, 35)]


def test_findings_last_until_the_window_has_none_of_their_scans() -> None:
    finding = Finding("bias", "east", "east: 2 deg off")
    one, other = LiveFit(found=((finding, 0),)), LiveFit(found=((finding._replace(text="east: 3.5 deg off"), 0),))
    assert one.without(LiveFit().fit.findings) == [finding]
    assert len(other.without(one.fit.findings)) == 1  # another number of digits
    assert one.without([finding._replace(text="east: 4 deg off")]) == []


def test_the_window_and_findings_are_in_snapshots(tmp_path: Path) -> None:
    lines, file = crossing(190, drift=1.0), tmp_path / "state"
    whole = final(small(tmp_path), lines)
    for part in (lines[:201], lines[201:]):
        loop = PersistentLoop(small(tmp_path), snapshot=file)
        for one in part:
            loop.process(one)
        loop.close()
    assert loop.state.fit.found == whole.fit.found != ()
    assert len(loop.state.fit.compared) == len(whole.fit.compared)


def test_a_silent_sensor_is_named(tmp_path: Path) -> None:
    lines = [one for k, one in enumerate(crossing(150)) if k % 2 or k < 160]
    last = [each for each in remarks(small(tmp_path), [*lines, line(2, 150.0)])][-1]
    assert any(text.startswith("sensor 1 ends ") for text in last["fit"]["new"])
