"""Figures of a report as files for a paper, and its tables as Markdown and CSV."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from vedette.campaigns.results import CampaignResults
from vedette.errors import InputError
from vedette.evaluation.figures import overview_figure, save_figure
from vedette.evaluation.tables import decisions_markdown, strategy_csv, strategy_markdown
from vedette.internal.files import write_file
from vedette.kernels.base.types import Floats
from vedette.reports.drawings import Drawing, group_drawings, sweep_drawings, typical_records
from vedette.reports.groups import Group, comparison_groups, group_of_run
from vedette.scenarios import Scenario
from vedette.simulation.records import RunRecord

MARKDOWN, CSV = "summary.md", "summary.csv"


def write_summary(results: CampaignResults, folder: Path) -> tuple[Path, ...]:
    """Write the comparison of every group into `summary.md` and, unrounded, `summary.csv`, and return both paths.

    Raises:
        InputError: the folder cannot be written.
    """
    groups = [group for group in comparison_groups(results) if group.comparison is not None]
    compared = {group.name: group.comparison for group in groups if group.comparison is not None}
    contents = {MARKDOWN: "\n".join(map(_markdown, groups)), CSV: strategy_csv(compared)}
    for name, text in contents.items():
        write_file(folder / name, lambda file, text=text: file.write(text.encode()), make_folder=True)  # type: ignore[misc]
    return tuple(folder / name for name in contents)


def _markdown(group: Group) -> str:
    assert group.comparison is not None
    parts = [f"## {group.title}\n" if group.title else "", strategy_markdown(group.comparison)]
    if len(group.comparison.decision_times):
        parts.append(decisions_markdown(group.comparison))
    return "\n".join(part for part in parts if part)


_LONGEST_NAME, _START, _END = 75, 45, 20  # bytes


def write_figures(results: CampaignResults, path: str | Path) -> tuple[Path, ...]:
    """Write every figure of the report into a folder as PDF, SVG and PNG. Equal results give equal bytes.

    With several groups, file names begin with that of the group. Returns the files written.

    Raises:
        InputError: the folder cannot be written.
    """
    folder = _made(path)
    written: list[Path] = []
    errors: dict[str, Floats] = {}
    several_groups = len(results.campaign.groups()) > 1
    for group in comparison_groups(results):
        errors.update(run_errors(group))
        prefix = f"{group.name}-" if several_groups else ""
        written += _save(group_drawings(group), folder, prefix)
        if group.comparison is not None:  # one figure of what the page shows separately
            first, record = typical_records(group)[0]
            overview = overview_figure(record, group.comparison, strategy=first.label, scene=first.scene)
            written += save_figure(overview, folder / _file_name(f"{prefix}overview"))
    return (*written, *_save(sweep_drawings(results.campaign, errors), folder))


def write_run_figures(record: RunRecord, scenario: Scenario, path: str | Path) -> tuple[Path, ...]:
    """Write every figure of the report of a single run, otherwise as `write_figures`."""
    return tuple(_save(group_drawings(group_of_run(record, scenario)), _made(path)))


def _made(path: str | Path) -> Path:
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"path: expected a folder to write figures into; got {folder}: {error.strerror}") from error
    return folder


def _save(drawings: Iterable[Drawing], folder: Path, prefix: str = "") -> list[Path]:
    return [
        file
        for drawing in drawings
        for file in save_figure(drawing.figure, folder / _file_name(f"{prefix}{drawing.name}"))
    ]


def _file_name(name: str) -> str:
    """Return a name for a file. A long one is shortened to both ends with a digest between them."""
    if len(name.encode()) <= _LONGEST_NAME:
        return name
    digest = hashlib.sha256(name.encode()).hexdigest()[:8]
    start, end = name.encode()[:_START], name.encode()[-_END:]
    return f"{start.decode(errors='ignore')}-{digest}-{end.decode(errors='ignore')}"


def run_errors(group: Group) -> dict[str, Floats]:
    """(num_runs,) mean OSPA of the runs of each cell of a group, empty without common runs."""
    if group.comparison is None:
        return {}
    comparison = group.comparison
    return {
        strategy.cell.name: comparison.run_means(strategy.label)
        for strategy in group.strategies
        if strategy.label in comparison.strategies
    }
