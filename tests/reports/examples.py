"""Small campaigns, run for real in this process and kept in a results folder."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from vedette.campaigns.cells import Campaign, resolve
from vedette.campaigns.results import CampaignResults, open_results
from vedette.campaigns.spec import spec_from_data
from vedette.campaigns.store import Store
from vedette.campaigns.tasks import CompletedRun, Task, perform
from vedette.scenarios import load_scenario


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
                assert isinstance(result, CompletedRun), result
                store.add(result.row)
    return open_results(folder)


# Two decisions on LMBs, whose rewards are sums over targets.
SUMS: dict[str, Any] = {
    "filter.kind": "lmb",
    "fusion.kind": "clmb",
    "time.num_steps": 13,
    "ospa.first_scan": 1,
    "ospa.last_scan": 13,
    "control.decision_steps": [10, 12],
    "control.num_samples": 8,
}

# A bearing-only sensor that sees a sector, and a range-only one that sees as far as its range.
MIXED_SENSORS: dict[str, Any] = {
    "sensors.0.measurement": {"kind": "bearing_only"},
    "sensors.0.noise": {"kind": "constant", "std": [0.02]},
    "sensors.0.clutter": {"kind": "measurement_space", "rate": 4.0, "low": [-3.14], "high": [3.14]},
    "sensors.0.detection": {"kind": "limited_sector", "probability": 0.95, "max_range": 1500.0, "half_width_deg": 60.0},
    "sensors.1.measurement": {"kind": "range_only"},
    "sensors.1.noise": {"kind": "constant", "std": [10.0]},
    "sensors.1.clutter": {"kind": "measurement_space", "rate": 4.0, "low": [0.0], "high": [2000.0]},
    "sensors.1.detection": {"kind": "limited_range", "probability": 0.95, "max_range": 1200.0},
}

# One sensor, and targets that turn at times.
MODES: dict[str, Any] = {
    **SUMS,
    "fusion": {"kind": "none"},
    "sensors": load_scenario("paper-a").model.model_dump(mode="json")["sensors"][:1],
    "motion": {
        "kind": "modes",
        "modes": {
            "cruise": {"motion": {"kind": "constant_velocity", "sigma_v": 1.0}, "stay_s": 20.0},
            "turn": {"motion": {"kind": "constant_turn", "turn_rate_deg": 15.0, "sigma_v": 1.0}, "stay_s": 8.0},
        },
    },
}
