"""One campaign with its report, for all tests that only look."""

from __future__ import annotations

from pathlib import Path

import pytest

from reports.examples import campaign_of, results_of
from vedette.campaigns.results import CampaignResults
from vedette.reports import write_report


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> CampaignResults:
    folder = tmp_path_factory.mktemp("campaign") / "results"
    return results_of(folder, campaign_of(planners=["jdm", "idm", "random"], runs=3))


@pytest.fixture(scope="session")
def report(results: CampaignResults, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(results, path)
    return path
