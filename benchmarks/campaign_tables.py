"""What benchmarks that run campaigns share: campaigns in folders that are kept, a Markdown table of each setting."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

from vedette.campaigns import CampaignResults, CampaignSpec, open_results, resolve, run_campaign
from vedette.campaigns.results import GroupComparison

Table = Callable[[CampaignResults, GroupComparison], Iterator[str]]


def parser(description: str, out: str) -> argparse.ArgumentParser:
    """With the options that all of them have."""
    made = argparse.ArgumentParser(description=description.splitlines()[0])
    made.add_argument("--runs", type=int, help="of each cell, instead of the campaign's")
    made.add_argument("--workers", type=int, default=1, help="processes")
    made.add_argument("--out", type=Path, default=Path(out), help="folder of the results folders")
    return made


def run(spec: CampaignSpec, folder: Path, given: argparse.Namespace, beside: Path) -> CampaignResults:
    """The results of a campaign in `folder`, gone on with where it is there; its scenario files are in `beside`."""
    if given.runs is not None:
        spec = spec.model_copy(update={"runs": given.runs})
    outcome = run_campaign(resolve(spec, beside), folder, num_workers=given.workers)
    for failure in outcome.failed:
        print(f"failed: cell {failure.cell}, run {failure.run}: {failure.message}")
    return open_results(folder)


def print_tables(results: CampaignResults, table: Table) -> None:
    """The heading of a campaign, and under it the table of each of its settings."""
    print(f"\n## {results.campaign.name}\n")
    for group in results.comparisons():
        title = results.title(group)
        print(*([f"{title}:\n"] if title else []), *table(results, group), sep="\n")
        print(flush=True)
