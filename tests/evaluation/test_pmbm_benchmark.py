"""The comparison with recorded PMBM and PMB filters (`benchmarks/pmbm.py`)."""

from __future__ import annotations

import json
import math

import numpy as np
import pmbm
import pytest


def test_recorded_scores_are_of_the_scans_that_are_drawn() -> None:
    recorded = json.loads(pmbm.RECORDED.read_text("utf-8"))
    assert {"repository", "commit", "program"} <= set(recorded)
    assert [row["setting"] for row in recorded["settings"]] == [setting.name for setting in pmbm.SETTINGS]
    for setting, row in zip(pmbm.SETTINGS, recorded["settings"], strict=True):
        assert row["runs"] >= 2
        assert all(len(row[name]) == row["runs"] for name in pmbm.OTHERS)
        assert row["scans_sha256"] == pmbm.checksum(setting, row["runs"])


def test_targets_appear_one_by_one_and_meet_in_the_middle() -> None:
    truth, scans = pmbm.drawn_run(pmbm.SETTINGS[0], 1)
    assert [len(truth[k - 1]) for k in (1, 10, 11, 31, 40, 41, 81)] == [1, 1, 2, 4, 4, 3, 3]
    assert np.abs(truth[40] - 150.0).max() < 5.0 * pmbm.MEETING_STD
    assert len(scans) == pmbm.NUM_SCANS


def test_scans_and_estimates_are_read_as_written(tmp_path) -> None:
    setting = pmbm.SETTINGS[0]
    pmbm.write_scans(tmp_path, 1)
    truth, scans = pmbm.drawn_run(setting, 0)
    read = pmbm.parsed((tmp_path / "1-0.txt").read_text("utf-8"))
    assert all(np.array_equal(first, second) for first, second in zip(read, scans, strict=True))
    assert (tmp_path / "settings.txt").read_text("utf-8").splitlines()[0] == "1 0.9 10 0.005"
    (tmp_path / "1-0.PMBM.txt").write_text(pmbm.as_text(truth), encoding="utf-8")
    (tmp_path / "1-0.PMB.txt").write_text("", encoding="utf-8")
    first, *others = pmbm.scores_of_files(tmp_path)
    assert (first["runs"], first["PMBM"]) == (1, [0.0])
    missed = 0.5 * pmbm.CUTOFF**2 * sum(map(len, truth)) / pmbm.NUM_SCANS
    assert first["PMB"] == [pytest.approx(missed, abs=1e-4)]
    assert all(row["runs"] == 0 for row in others)
    with pytest.raises(ValueError, match=r"expected scans 1 to 81; got 3 to 82"):
        pmbm.parsed("3 1.0 2.0\n82 1.0 2.0\n")


@pytest.mark.parametrize("name", pmbm.FILTERS)
def test_every_filter_has_a_score(name: str) -> None:
    score, _ = pmbm.own_score(pmbm.SETTINGS[0], pmbm.FILTERS[name], run=0, num_scans=6)
    assert math.isfinite(score)
    assert score > 0.0


def test_the_table_has_paired_differences() -> None:
    rows = [{"setting": "scene", "runs": 2, "scans_sha256": "", "PMBM": [10.0, 14.0], "default": [9.0, 11.0]}]
    header, _, row, together = pmbm.table(rows)
    assert header == "| setting | runs | PMBM | default |"
    assert row == "| scene | 2 | 12.00 | \u22122.00 ± 1.00 |"
    assert together == "| all | 2 | 12.00 | \u22122.00 ± 1.00 |"
