"""Does it pay to decide jointly? Strategies on generated scenes of more and more sensors (docs/deciding.md).

    python benchmarks/deciding.py --runs 50 --workers 2
    python benchmarks/deciding.py --sensors 2 3 --patterns crowd --views limited --every 5 --runs 5

Writes each scene (`vedette generate`), runs the strategies on it in a folder that is kept (`--out`), and goes on with
what is there; then prints a Markdown table for each scene, and one of all of them. Runs are paired: at the same
number every strategy meets the same truth, drawn anew in each run. OSPA has one standard error over the runs; "worst
run" is the largest mean of a run; "more than" is the paired difference to the first strategy; "N error" the number of
estimates minus that of targets; "tracked" the share of all targets, seen or not, that have an estimate; "s a decision"
the median wall time of a decision of all sensors, in a process of one thread.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import campaign_tables

from vedette.campaigns import CampaignResults, CampaignSpec
from vedette.campaigns.results import GroupComparison
from vedette.campaigns.scores import score_markdown, score_row, score_strategies
from vedette.scenarios.generated import PATTERNS, VIEWS, GeneratedScene
from vedette.scenarios.generated_text import scene_text

RUNS = 50
# What the scenes leave to the campaign.
SETTINGS: dict[str, Any] = {
    "control.reward": {"kind": "expected_loss", "cutoff": 100.0},
    "planners": {"greedy": {"kind": "joint", "search": {"kind": "sequential_greedy"}}},
}


def scenes(given: argparse.Namespace) -> Iterator[GeneratedScene]:
    """The scenes that the options ask for, small ones first."""
    for num_sensors, pattern, view, every in itertools.product(given.sensors, given.patterns, given.views, given.every):
        yield GeneratedScene(num_sensors=num_sensors, pattern=pattern, view=view, decide_every=every, seed=given.seed)


def campaign_on(scene: GeneratedScene, file: Path, given: argparse.Namespace) -> CampaignSpec:
    """The strategies on one scene."""
    return CampaignSpec(
        name=f"deciding-{scene.name}",
        scenarios=(file.name,),
        planners=tuple(given.planners),
        runs=RUNS,
        compare="planner",
        set={**SETTINGS, **({} if given.samples is None else {"control.num_samples": given.samples})},
    )


def table(results: CampaignResults, group: GroupComparison) -> Iterator[str]:
    """The table of one scene."""
    yield score_markdown(score_strategies(results, group), group.comparison.unit, group.labels[0])
    yield f"{group.comparison.num_runs} paired runs of {group.comparison.scenario}."


def overview(all_results: Sequence[CampaignResults], planners: Sequence[str]) -> Iterator[str]:
    """One row a scene: the error of the first strategy, and how much more the others have."""
    first, *others = planners
    yield f"| Scene | {first} | " + " | ".join(f"{name} more by" for name in others) + " | runs |"
    yield "| --- |" + " ---: |" * (len(planners) + 1)
    for results in all_results:
        for group in results.comparisons():
            reference, *scores = score_strategies(results, group)
            parts = [score_row(reference)[1], *(score_row(score)[3] for score in scores), str(reference.num_runs)]
            yield f"| {group.comparison.scenario} | " + " | ".join(parts) + " |"


def main() -> None:
    parser = campaign_tables.parser(__doc__ or "", "deciding-results")
    parser.add_argument("--sensors", type=int, nargs="+", default=[2, 3, 5, 8, 20], help="numbers of sensors")
    parser.add_argument("--patterns", nargs="+", choices=PATTERNS, default=PATTERNS, help="of the targets")
    parser.add_argument("--views", nargs="+", choices=VIEWS, default=VIEWS, help="of the sensors")
    parser.add_argument("--every", type=int, nargs="+", default=[1], help="scans between decisions")
    parser.add_argument(
        "--planners", nargs="+", default=["jdm", "greedy", "idm", "random", "fixed"], help="the first is compared to"
    )
    parser.add_argument("--samples", type=int, help="of a decision, instead of the scenes'")
    parser.add_argument("--seed", type=int, default=0, help="of the scenes")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    done = []
    for scene in scenes(given):
        file = given.out / f"{scene.name}.yaml"
        file.write_text(scene_text(scene), encoding="utf-8")
        results = campaign_tables.run(campaign_on(scene, file, given), given.out / scene.name, given, given.out)
        campaign_tables.print_tables(results, table)
        done.append(results)
    print(*overview(done, given.planners), sep="\n")


if __name__ == "__main__":
    main()
