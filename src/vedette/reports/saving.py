"""The figures of a report as files for a paper."""

from __future__ import annotations

from pathlib import Path

from vedette.campaigns.results import CampaignResults
from vedette.evaluation.figures import save_figure
from vedette.kernels.types import Floats
from vedette.reports.drawings import group_drawings, sweep_drawings
from vedette.reports.groups import Group, gather


def write_figures(results: CampaignResults, folder: Path) -> tuple[Path, ...]:
    """Write every figure of the report into `folder` as PDF, SVG and PNG; the same results give the same bytes.

    With several groups, the names of files begin with that of the group. Returns the files written.

    Raises:
        InputError: the folder cannot be written.
    """
    written: list[Path] = []
    errors: dict[str, Floats] = {}
    several = len(results.campaign.groups()) > 1
    for group in gather(results):
        errors.update(run_errors(group))
        for drawing in group_drawings(group):
            stem = f"{group.name}-{drawing.name}" if several else drawing.name
            written += save_figure(drawing.figure, folder / stem)
    for drawing in sweep_drawings(results.campaign, errors):
        written += save_figure(drawing.figure, folder / drawing.name)
    return tuple(written)


def run_errors(group: Group) -> dict[str, Floats]:
    """(num_runs,) mean OSPA of the runs of each cell of a group, m; empty without runs in common."""
    if group.comparison is None:
        return {}
    comparison = group.comparison
    return {
        each.cell.name: comparison.run_means(each.label)
        for each in group.strategies
        if each.label in comparison.strategies
    }
