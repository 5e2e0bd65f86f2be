"""The tables of a report as text: Markdown for people, CSV for programs."""

from __future__ import annotations

from pathlib import Path

from vedette.campaigns.results import CampaignResults
from vedette.errors import InputError
from vedette.evaluation.tables import decisions_markdown, strategy_csv, strategy_markdown
from vedette.files import write_whole
from vedette.reports.groups import Group, gather

MARKDOWN, CSV = "summary.md", "summary.csv"


def write_summary(results: CampaignResults, folder: Path) -> tuple[Path, ...]:
    """Write the comparison of every group into `summary.md` and, unrounded, `summary.csv`; returns both.

    Raises:
        InputError: the folder cannot be written.
    """
    groups = [group for group in gather(results) if group.comparison is not None]
    compared = {group.name: group.comparison for group in groups if group.comparison is not None}
    contents = {MARKDOWN: "\n".join(map(_markdown, groups)), CSV: strategy_csv(compared)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in contents.items():
            write_whole(folder / name, lambda file, text=text: file.write(text.encode()))  # type: ignore[misc]
    except OSError as error:
        raise InputError(f"{folder}: expected a place to write a summary; got {error}") from error
    return tuple(folder / name for name in contents)


def _markdown(group: Group) -> str:
    assert group.comparison is not None
    parts = [f"## {group.title}\n" if group.title else "", strategy_markdown(group.comparison)]
    if len(group.comparison.decision_times):
        parts.append(decisions_markdown(group.comparison))
    return "\n".join(part for part in parts if part)
