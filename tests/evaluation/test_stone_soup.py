"""The measures against the values of Stone Soup, another implementation; reference/stone_soup.py made the cases."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import reference.tracks
from evaluation.test_trajectories import make_estimate, make_truth
from vedette.evaluation import continuity_of_run, gospa, gospa_of_run, match_run, nees, ospa

CASES: dict[str, Any] = json.loads((Path(reference.tracks.__file__).parent / "stone_soup.json").read_text("utf-8"))
SETS = CASES["sets"]


@pytest.mark.parametrize("case", SETS)
def test_gospa_and_its_costs(case: dict[str, Any]) -> None:
    result = gospa(case["estimates"], case["truths"], cutoff=case["cutoff"], order=case["order"])
    theirs = case["gospa"]
    assert result.total == pytest.approx(theirs["distance"])
    assert result.localisation == pytest.approx(theirs["localisation"])
    assert result.missed == pytest.approx(theirs["missed"])
    assert result.false == pytest.approx(theirs["false"])


@pytest.mark.parametrize("case", SETS)
def test_ospa(case: dict[str, Any]) -> None:
    """Stone Soup pairs by the least sum of distances whatever the order; in these cases that pairing is the best."""
    result = ospa(case["estimates"], case["truths"], cutoff=case["cutoff"], order=case["order"])
    assert result.total == pytest.approx(case["ospa"])


@pytest.mark.parametrize("case", CASES["mahalanobis"])
def test_nees(case: dict[str, Any]) -> None:
    error = np.array(case["mean"]) - case["true"]
    assert nees([error], [case["cov"]]) == pytest.approx([case["squared"]])


@pytest.mark.parametrize("case", CASES["clear_mot"])
def test_clear_mot(case: dict[str, Any]) -> None:
    num_scans, cutoff = case["num_scans"], case["cutoff"]
    alive, positions = np.zeros((3, num_scans), np.bool_), np.zeros((3, num_scans, 2))
    for target, scan, x, y in case["truths"]:
        alive[target, scan], positions[target, scan] = True, (x, y)
    truth = make_truth(alive, positions)
    found = sorted(case["tracks"])
    rows = [[row for row in found if row[1] == scan] for scan in range(num_scans)]
    estimates = [make_estimate([row[0] for row in at], [row[2:] for row in at]) for at in rows]
    distances = match_run(truth, estimates, cutoff=cutoff, order=1.0).distances
    assert distances.mean() == pytest.approx(case["motp"])
    series = gospa_of_run(truth, estimates, cutoff=cutoff, order=1.0)
    breaks = continuity_of_run(truth, estimates, cutoff=cutoff, order=1.0)
    faults = series.num_missed.sum() + series.num_false.sum() + breaks.label_switches.sum()
    assert 1.0 - faults / alive.sum() == pytest.approx(case["mota"])
