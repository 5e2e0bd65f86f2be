"""The yardsticks that come with the library: campaigns on published scenes, with the figures published of them."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from vedette.campaigns.results import CampaignResults
from vedette.campaigns.scores import StrategyScore, score_markdown, score_strategies
from vedette.campaigns.spec import CampaignSpec, load_spec
from vedette.evaluation.tails import tails

_PUBLISHED = Path(__file__).with_name("published.toml")


@dataclass(frozen=True, slots=True)
class Yardstick:
    """A campaign on a published scene.

    Attributes:
        spec: the campaign; its name is that of the yardstick.
        title: what it is about, in a line.
        source: where the published figures come from; empty where there are none.
        remark: what sets them apart from those of the campaign.
        published: methods as they are published, the best first.
    """

    spec: CampaignSpec
    title: str
    source: str
    remark: str
    published: tuple[StrategyScore, ...]


@cache
def yardsticks() -> dict[str, Yardstick]:
    """All that come with the library, by name."""
    published = tomllib.loads(_PUBLISHED.read_text(encoding="utf-8"))
    return {
        name: Yardstick(
            spec=load_spec(name),
            title=said["title"],
            source=said["source"],
            remark=said["remark"],
            published=tuple(map(_published, said["rows"])),
        )
        for name, said in published.items()
    }


def _published(row: dict[str, str | float]) -> StrategyScore:
    """A row of the file; what it does not say is not known."""

    def number(key: str) -> float | None:
        return float(row[key]) if key in row else None

    return StrategyScore(
        label=f"published: {row['method']}",
        ospa=float(row["ospa"]),
        standard_error=number("standard_error"),
        worst=number("worst"),
        difference=None,
        cardinality_error=float(row["cardinality_error"]),
        tracked=None,
        decision_seconds=number("decision_seconds"),
        num_runs=int(row["runs"]),
    )


def yardstick_markdown(results: CampaignResults, yardstick: Yardstick) -> str:
    """What was reached beside what is published, a table for each setting of the campaign, as Markdown."""
    lines = [f"# {yardstick.title}", ""]
    for group in results.comparisons():
        title = results.title(group)
        scores = (*score_strategies(group), *yardstick.published)
        table = score_markdown(scores, group.comparison.unit, group.labels[0])
        lines += [*([f"## {title}", ""] if title else []), table, tails(group.comparison), ""]
    return "\n".join([*lines, "\n\n".join(provenance(yardstick)), ""])


def provenance(yardstick: Yardstick) -> tuple[str, ...]:
    """Lines on where the published figures come from, and what sets them apart."""
    source = f"Published: {yardstick.source}." if yardstick.source else ""
    return tuple(line for line in (source, yardstick.remark) if line)
