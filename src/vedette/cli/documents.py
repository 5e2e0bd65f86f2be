"""Results as plain data for `--json`: the content of the terminal tables, unrounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vedette.campaigns.results import CampaignResults, GroupComparison
    from vedette.evaluation.fit import Fit
    from vedette.scenarios import Scenario
    from vedette.simulation.records import RunRecord


def run_document(record: RunRecord, scenario: Scenario | None, fit: Fit | None = None) -> dict[str, Any]:
    """Return the document of a run: scans, decisions, mean OSPA over the scans that count, run times, diagnostics.

    Without the scenario, OSPA has no unit and sensors have numbers. fit: of the model to recorded scans.
    """
    from vedette.evaluation.comparison import counted_scans, decided_actions
    from vedette.evaluation.diagnostics import record_diagnostics
    from vedette.evaluation.ensembles import PARTS

    decisions = [
        {
            "time_s": decision.time,
            "actions": [dict(row) for row in choice],
            "expected_rewards": [
                {"mean": mean, "standard_error": error} for mean, error in decision.plan.expected_rewards
            ],
            "notes": decision.plan.notes,
        }
        for decision, choice in zip(record.decisions, decided_actions(record), strict=True)
    ]
    counted = counted_scans(record, scenario)
    window = record.times[counted]
    unit = scenario.model.ospa.unit if scenario else ""
    means = dict(zip(PARTS, record.ospa[counted].mean(axis=0), strict=True))
    return {
        "scenario": record.scenario,
        "planner": record.planner,
        "seed": record.seed,
        "run": record.run,
        "recording": None if record.recording is None else record.recording._asdict(),
        "scans": record.num_scans,
        "stopped": record.stopped,
        "decisions": decisions,
        "ospa": {"unit": unit, "from_s": window[0], "to_s": window[-1], **means},
        "seconds": {stage: seconds.sum() for stage, seconds in record.timings.items()},
        "diagnostics": [
            {"name": each.name, "level": each.level, "text": each.text} for each in record_diagnostics(record, scenario)
        ],
        "fit": None if fit is None else fit.to_dict(),
    }


def results_document(opened: CampaignResults, groups: Sequence[GroupComparison]) -> dict[str, Any]:
    """Return the document of a campaign: its comparisons by group, and the runs that are missing."""
    from vedette.evaluation.tables import strategy_numbers

    campaign = opened.campaign
    missing = {cell.name: len(opened.missing(cell.name)) for cell in campaign.cells}
    return {
        "campaign": campaign.name,
        "seed": campaign.seed,
        "folder": opened.folder,
        "runs": campaign.total,
        "finished": campaign.total - sum(missing.values()),
        "missing": {name: number for name, number in missing.items() if number},
        "failed": [asdict(failure) for failure in opened.failures()],
        "comparisons": [
            {
                "settings": group.settings,
                "unit": group.comparison.unit,
                "strategies": [strategy_numbers(group.comparison, name) for name in group.comparison.strategies],
            }
            for group in groups
        ],
    }
