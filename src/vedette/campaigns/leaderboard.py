"""Leaderboard of a benchmark: entrants and the library's own strategies on each scene, and tables of them."""

import csv
import hashlib
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vedette.campaigns.benchmark import OWN, Scene
from vedette.campaigns.results import CampaignResults, open_results
from vedette.evaluation import Summary, paired_difference, summarise
from vedette.evaluation.comparison import compare_scored_scans
from vedette.evaluation.ensembles import Ensemble
from vedette.evaluation.tail_summary import TailSummary, lost_at_end, summarise_tail, tail_header
from vedette.internal.text import markdown_table, named_in, with_minus
from vedette.kernels.base.types import Floats
from vedette.scenarios.dumping import dump_scenario
from vedette.simulation.storage import versions

COUNTED = ("filter_steps", "fusions", "rewards")
# With fewer runs an interval is meaningless.
_LEAST_RUNS = 5
# Below this mean NEES, the estimates came without covariances: see `vedette.tracking.ProgramFilter`.
_SAYS_NOTHING = 1e-6


@dataclass(frozen=True, slots=True)
class LeaderboardRow:
    """Result of one strategy on a scene, over all attempted runs. A lost run counts with the cutoff as its error."""

    label: str  # name of the strategy
    is_own: bool  # whether it is one of the library's own strategies
    num_runs: int  # number of runs, and of those that could not be finished
    num_lost: int
    ospa: Summary  # mean over scans and runs, with its 95 % interval
    tail: TailSummary  # median and worst run of the same, and the share of runs that end with a lost target
    difference: Summary | None  # paired difference in OSPA to the first strategy. None: it is the first
    cardinality_error: float  # mean number of estimates minus that of targets. NaN: no run was finished
    # mean NEES of positions over 2, with its interval: 1 if covariances are consistent. None: estimates have no
    # covariances
    nees: Summary | None
    seconds: float  # median wall time of a decision, or of the filters and fusion of a scan, s, also of a program
    counts: Mapping[str, float]  # mean number per decision of each of `COUNTED`. NaN: not known
    reason: str  # reason why the first lost run was lost


@dataclass(frozen=True, slots=True)
class SceneTable:
    """All strategies on a scene, the reference first."""

    scene: Scene  # the scene
    unit: str  # unit of OSPA
    digest: str  # SHA-256 of the scenario without the entrants
    # SHA-256 of the campaign of each entrant, by folder: scene, command and the files that it names
    entrants: Mapping[str, str]
    standings: tuple[LeaderboardRow, ...]  # row of each strategy


def scene_table(scene: Scene, folder: Path) -> SceneTable | None:
    """Return the table of a scene from the folder of a benchmark, or None if the first strategy has no run there."""
    place = folder / scene.name
    folders = [each for each in sorted(place.iterdir()) if each.is_dir()] if place.is_dir() else []
    opened = [open_results(each) for each in sorted(folders, key=lambda each: (each.name != OWN, each.name))]
    tried = [each for results in opened for each in _tried(scene, results)]
    if not tried or tried[0][0].label != scene.beside[0]:
        return None
    first = tried[0][1]
    scenario = opened[0].campaign.cells[0].scenario
    model = scenario.model.model_copy(update={"planners": {}, "metrics": {}})
    text = dump_scenario(model, folder=scenario.folder)
    others = [replace(row, difference=_difference(ospa, first)) for row, ospa in tried[1:]]
    standings = (tried[0][0], *others)
    entrants = {each.folder.name: str(each.manifest["digest"]) for each in opened if each.folder.name != OWN}
    return SceneTable(scene, scenario.model.ospa.unit, hashlib.sha256(text.encode()).hexdigest(), entrants, standings)


def _tried(scene: Scene, results: CampaignResults) -> Iterator[tuple[LeaderboardRow, dict[int, float]]]:
    """Yield the row of each strategy with runs, without a difference, and its OSPA by run, lost runs at the cutoff."""
    for cell in results.campaign.cells:
        label = str(cell.settings["planner" if scene.role == "planner" else "variant"])
        lost = {each.run: each.message for each in results.failures() if each.cell == cell.name}
        ospa = dict.fromkeys(lost, float(cell.scenario.model.ospa.cutoff))
        ensemble = results.ensemble(cell.name) if results.finished(cell.name) else None
        cardinality = nees = seconds = np.empty(0)
        lost_targets = np.ones(len(lost))
        if ensemble is not None:
            comparison = compare_scored_scans(cell.scenario, {label: ensemble})
            ospa |= dict(zip(ensemble.runs.tolist(), comparison.run_means(label).tolist(), strict=True))
            lost_targets = np.append(lost_targets, lost_at_end(comparison, label))
            cardinality = comparison.run_means(label, "cardinality_error")
            nees = comparison.run_means(label, "position_nees_mean") / 2.0
            nees, seconds = nees[~np.isnan(nees)], _spent(scene, ensemble)
        if not ospa:
            continue
        standing = LeaderboardRow(
            label,
            results.folder.name == OWN,
            len(ospa),
            len(lost),
            summarise([ospa[run] for run in sorted(ospa)]),
            summarise_tail(list(ospa.values()), lost_targets),
            None,
            _mean(cardinality),
            summarise(nees) if len(nees) and nees.mean() > _SAYS_NOTHING else None,
            float(np.median(seconds)) if len(seconds) else np.nan,
            {name: _mean(np.asarray(() if ensemble is None else ensemble.counts.get(name, ()))) for name in COUNTED},
            lost[min(lost)] if lost else "",
        )
        yield standing, ospa


def _spent(scene: Scene, ensemble: Ensemble) -> Floats:
    """Wall time of each decision, or of the filters and fusion of each scan, s."""
    if scene.role == "planner":
        return np.asarray(ensemble.seconds.get("planning", ()), np.float64)
    return np.add(ensemble.seconds["filter"], ensemble.seconds["fusion"], dtype=np.float64)


def _difference(ospa: Mapping[int, float], first: Mapping[int, float]) -> Summary | None:
    """Return the paired difference of a strategy to the first, over their common runs, or None without any."""
    common = sorted(ospa.keys() & first.keys())
    if not common:
        return None
    return paired_difference([ospa[run] for run in common], [first[run] for run in common]).summary


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else np.nan


def header(table: SceneTable) -> tuple[str, ...]:
    """Return the column names of `row`."""
    unit, first = table.unit, table.scene.beside[0]
    time_title = "ms a decision" if table.scene.role == "planner" else "ms a scan"
    ospa_titles = named_in("OSPA", unit), named_in(f"More than {first}", unit), "95 %"
    names = (*ospa_titles, *tail_header(unit), "N error", "NEES", "NEES, 95 %", time_title)
    counts = ("Filter steps", "Fusions", "Rewards") if table.scene.role == "planner" else ()
    return (table.scene.role.capitalize(), *names, *counts, "Lost", "Runs")


def row(table: SceneTable, standing: LeaderboardRow) -> tuple[str, ...]:
    """Return one row under `header`, with empty cells where values are not known."""
    more, nees = standing.difference, standing.nees
    counts = [_known(standing.counts[name], ",.0f") for name in COUNTED] if table.scene.role == "planner" else []
    return (
        standing.label,
        _known(float(standing.ospa.mean), ".2f"),
        "" if more is None else _known(float(more.mean), "+.2f"),
        "" if more is None else _interval(more, "+.2f"),
        *standing.tail.cells(),
        _known(standing.cardinality_error, "+.2f"),
        "" if nees is None else _known(float(nees.mean), ".2f"),
        "" if nees is None else _interval(nees, ".2f"),
        _known(1e3 * standing.seconds, ".3g"),
        *counts,
        str(standing.num_lost) if standing.num_lost else "",
        str(standing.num_runs),
    )


def _known(value: float, form: str) -> str:
    return "" if np.isnan(value) else with_minus(format(value, form))


def _interval(summary: Summary, form: str) -> str:
    """Return the interval in words, empty for fewer than `_LEAST_RUNS` runs."""
    return (
        ""
        if np.isnan(summary.low) or summary.num_runs < _LEAST_RUNS
        else f"{_known(float(summary.low), form)} to {_known(float(summary.high), form)}"
    )


def benchmark_provenance(tables: Sequence[SceneTable], seed: int) -> dict[str, str]:
    """Return seed, versions, and SHA-256 of the scenarios and entrants of the tables, by name."""
    facts = {"seed": str(seed), **versions()}
    for table in tables:
        facts[f"scene {table.scene.name}"] = table.digest
        facts |= {f"{table.scene.role} {name}, {table.scene.name}": digest for name, digest in table.entrants.items()}
    return facts


def benchmark_markdown(tables: Sequence[SceneTable], facts: Mapping[str, str]) -> str:
    """Return all tables as Markdown."""
    lines = ["# The benchmark of the field", ""]
    for table in tables:
        lines += [f"## {table.scene.name}", "", f"{table.scene.about}.", ""]
        lines += [markdown_table(header(table), [row(table, standing) for standing in table.standings]), ""]
        lines += [f"Lost, {standing.label}: {standing.reason}\n" for standing in table.standings if standing.reason]
    return "\n".join([*lines, "## Of what", "", *(f"- {name}: `{value}`" for name, value in facts.items()), ""])


def benchmark_csv(tables: Sequence[SceneTable]) -> str:
    """Return all rows as CSV with full precision, one line per scene and strategy."""
    out = io.StringIO()
    names = [
        "ospa",
        "ospa_low",
        "ospa_high",
        "median",
        "worst",
        "share_lost",
        "difference",
        "difference_low",
        "difference_high",
        "cardinality_error",
    ]
    names += ["nees", "nees_low", "nees_high", "seconds", *COUNTED, "num_lost", "num_runs"]
    write = csv.writer(out, lineterminator="\n").writerow
    write(("scene", "scene_sha256", "role", "strategy", "is_own", "unit", *names))
    for table in tables:
        for standing in table.standings:
            summaries = [standing.ospa, standing.difference, standing.nees]
            parts = [["", "", ""] if each is None else [each.mean, each.low, each.high] for each in summaries]
            numbers = [
                *parts[0],
                *standing.tail,
                *parts[1],
                standing.cardinality_error,
                *parts[2],
                standing.seconds,
                *standing.counts.values(),
            ]
            texts = [("" if value == "" or np.isnan(value) else repr(float(value))) for value in numbers]
            start = [table.scene.name, table.digest, table.scene.role, standing.label, int(standing.is_own), table.unit]
            write([*start, *texts, standing.num_lost, standing.num_runs])
    return out.getvalue()
