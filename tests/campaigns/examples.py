"""Campaigns small enough for tests: few scans, few samples, runs of some 20 ms."""

from __future__ import annotations

from typing import Any

from vedette.campaigns.cells import Campaign, resolve
from vedette.campaigns.spec import spec_from_data

SPEC: dict[str, Any] = {
    "name": "small",
    "scenarios": ["paper-a"],
    "planners": ["idm", "stationary"],
    "runs": 4,
    "set": {"time.num_steps": 12, "control.decision_steps": [10], "control.num_samples": 2, "ospa.last_scan": 12},
}


def small_campaign(**changes: Any) -> Campaign:
    """Two strategies, four runs, twelve scans, one decision."""
    return resolve(spec_from_data({**SPEC, **changes}))
