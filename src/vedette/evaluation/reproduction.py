"""The paper's comparison as a folder: runs, tables, and the figures 3, 4 and 5."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from vedette.errors import InputError
from vedette.evaluation.comparison import Comparison, scored
from vedette.evaluation.figures import ospa_figure, overview_figure, reward_figure, save_figure, tracks_figure
from vedette.evaluation.tables import decision_rows, strategy_csv, strategy_markdown
from vedette.scenarios import Scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.simulation.records import RunRecord
from vedette.simulation.storage import save_run

MARK = "reproduction.json"
TABLE_MARKDOWN, TABLE_CSV = "strategies.md", "strategies.csv"


def check_target(folder: Path) -> None:
    """`InputError` unless the folder is new, empty, or an earlier reproduction, which may be replaced."""
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir()) and not (folder / MARK).is_file()):
        raise InputError(
            f"{folder}: expected a new folder or an earlier reproduction; it holds something else and is kept"
        )


def typical_run(comparison: Comparison, records: Sequence[RunRecord], strategy: str | None = None) -> RunRecord:
    """The run whose mean OSPA is the median (of an even number, the better of the two in the middle).

    `strategy` is what the comparison calls them; by default the planner's name.
    """
    means = comparison.run_means(records[0].planner if strategy is None else strategy)
    return records[int(np.argsort(means, kind="stable")[(len(means) - 1) // 2])]


def decisions_markdown(comparison: Comparison) -> str:
    """What each strategy decided, and how often."""
    lines = ["| Strategy | Time | Headings and share of the runs |", "| --- | --- | --- |"]
    for strategy in comparison.strategies:
        lines += [f"| {strategy} | {time} | {shares} |" for time, shares in decision_rows(comparison, strategy)]
    return "\n".join(lines) + "\n"


def write_reproduction(
    scenario: Scenario, runs: Mapping[str, Sequence[RunRecord]], seed: int, folder: Path
) -> Comparison:
    """Write everything into `folder`, which appears whole or not at all.

    Raises:
        InputError: the folder holds something else, or cannot be written.
    """
    check_target(folder)
    comparison = scored(scenario, runs)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as scratch:
            fresh = Path(scratch) / "new"
            _write_files(scenario, runs, comparison, seed, fresh)
            if folder.exists():
                folder.rename(Path(scratch) / "old")
            fresh.rename(folder)
    except OSError as error:
        raise InputError(f"{folder}: expected a place to write; got {error}") from error
    return comparison


def _write_files(
    scenario: Scenario, runs: Mapping[str, Sequence[RunRecord]], comparison: Comparison, seed: int, folder: Path
) -> None:
    text = dump_scenario(scenario.model, folder=scenario.folder)
    for records in runs.values():
        for record in records:
            save_run(record, folder / "runs" / f"{record.planner}-{record.run:04d}", scenario_text=text)
    markdown = f"{strategy_markdown(comparison)}\n{decisions_markdown(comparison)}"
    (folder / TABLE_MARKDOWN).write_text(markdown, "utf-8")
    (folder / TABLE_CSV).write_text(strategy_csv(comparison), "utf-8")
    (folder / "scenario.yaml").write_text(text, "utf-8")
    mark = {"scenario": scenario.name, "seed": seed, "runs": comparison.num_runs, "strategies": comparison.strategies}
    (folder / MARK).write_text(json.dumps(mark, indent=2) + "\n", "utf-8")
    draw_reproduction(runs, comparison, folder)


def draw_reproduction(runs: Mapping[str, Sequence[RunRecord]], comparison: Comparison, folder: Path) -> None:
    """The paper's figures: tracks of a typical run a strategy, its rewards at each decision, OSPA against time."""
    typical = {strategy: typical_run(comparison, records) for strategy, records in runs.items()}
    first = typical[comparison.strategies[0]]
    save_figure(overview_figure(first, comparison), folder / "overview")
    save_figure(ospa_figure(comparison), folder / "ospa")
    for strategy, record in typical.items():
        save_figure(tracks_figure(record), folder / f"tracks-{strategy}")
        draw_rewards(record, folder, f"rewards-{strategy}")


def draw_rewards(record: RunRecord, folder: Path, stem: str) -> None:
    """One figure a decision that was taken by rewards."""
    for decision in record.decisions:
        if decision.plan.tables:
            save_figure(reward_figure(decision.plan), folder / f"{stem}-{decision.time:g}s")
