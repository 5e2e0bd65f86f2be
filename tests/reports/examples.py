"""Small campaigns, run for real in this process and kept in a results folder."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from vedette.campaigns.cells import Campaign, resolve
from vedette.campaigns.results import CampaignResults, open_results
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.campaigns.tasks import Landed, Task, perform


def campaign_of(**fields: Any) -> Campaign:
    """The campaign of a specification: by default JDM and random control on `paper-a`."""
    spec = {"name": "example", "scenarios": ["paper-a"], "planners": ["jdm", "random"], "runs": 2, "seed": 0}
    return resolve(spec_from_data({**spec, **fields}))


def results_of(folder: Path, campaign: Campaign, *, skipped: Collection[tuple[str, int]] = ()) -> CampaignResults:
    """Run a campaign but for the skipped runs (cell and number), and open its results."""
    with Store.open(folder, campaign) as store:
        for cell, run in campaign.tasks:
            if (cell.name, run) not in skipped:
                (result,) = perform(Task(cell, campaign.seed, (run,), {}))
                assert isinstance(result, Landed), result
                store.add(result.cell, result.run, result.payload, result.timings)
    return open_results(folder)
