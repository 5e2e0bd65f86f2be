"""Published comparisons that come with the library: campaigns on published scenes, with their figures and claims."""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

from vedette.campaigns.cells import Campaign
from vedette.campaigns.results import CampaignResults
from vedette.campaigns.scores import StrategyScore, score_markdown, score_strategies
from vedette.campaigns.spec import CampaignSpec, load_spec
from vedette.evaluation import Comparison
from vedette.evaluation.actions import describe_choice
from vedette.evaluation.health import percent
from vedette.evaluation.statistics import CONFIDENCE
from vedette.evaluation.tail_summary import tail_sentence
from vedette.internal.text import with_minus, with_unit

_PUBLISHED = Path(__file__).with_name("published.toml")


class PublishedOrder(NamedTuple):
    """Published claim that strategy `better` has a smaller error than strategy `than`. `text` states it in words."""

    text: str
    better: str
    than: str


class PublishedDecision(NamedTuple):
    """Published actions of a planner at a time, s, in the words of `describe_choice`."""

    planner: str
    time: float
    actions: str


class CheckedClaim(NamedTuple):
    """A published claim, its outcome in these runs, and the evidence."""

    claim: str
    outcome: Literal["reproduced", "not reproduced", "undecided"]
    evidence: str


@dataclass(frozen=True, slots=True)
class PublishedComparison:
    """A campaign on a published scene, with the published figures."""

    spec: CampaignSpec  # specification of the campaign, which has the name of the comparison
    title: str  # topic in one line
    source: str  # source of the published figures, empty if there are none
    remark: str  # differences between the published figures and those of the campaign
    published: tuple[StrategyScore, ...]  # published methods, the best first
    claims: tuple[PublishedOrder, ...] = ()  # other published statements: orders of strategies, and actions
    decisions: tuple[PublishedDecision, ...] = ()


@cache
def published_comparisons() -> dict[str, PublishedComparison]:
    """Return all published comparisons that come with the library, by name."""
    published = tomllib.loads(_PUBLISHED.read_text(encoding="utf-8"))
    return {
        name: PublishedComparison(
            spec=load_spec(name),
            title=entry["title"],
            source=entry["source"],
            remark=entry["remark"],
            published=tuple(map(_published, entry["rows"])),
            claims=tuple(PublishedOrder(**each) for each in entry.get("claims", ())),
            decisions=tuple(PublishedDecision(**each) for each in entry.get("decisions", ())),
        )
        for name, entry in published.items()
    }


def published_comparison_of(campaign: Campaign) -> PublishedComparison | None:
    """Return the published comparison that a campaign runs, or None for other campaigns."""
    match = published_comparisons().get(campaign.name)
    return match if match is not None and list(match.spec.scenarios) == list(campaign.axes["scenario"]) else None


def checked_claims(reference: PublishedComparison, comparison: Comparison) -> tuple[CheckedClaim, ...]:
    """Return the published claims about the compared strategies, each with its outcome over the paired runs."""
    return (*_checked_orders(reference, comparison), *_checked_decisions(reference, comparison))


def _checked_orders(reference: PublishedComparison, comparison: Comparison) -> Iterator[CheckedClaim]:
    for text, better, than in reference.claims:
        if not {better, than} <= set(comparison.strategies) or comparison.num_runs < 2:
            continue
        paired = comparison.difference(than, better)
        mean, low, high = (float(getattr(paired.summary, field)) for field in ("mean", "low", "high"))
        shown = with_unit(with_minus(f"{mean:+.2f}"), comparison.unit)
        interval = with_unit(with_minus(f"{low:+.2f} to {high:+.2f}"), comparison.unit)
        evidence = f"{than} minus {better}: {shown}, 95 % interval {interval}"
        is_significant = paired.p_value <= 1.0 - CONFIDENCE
        yield CheckedClaim(
            text, "undecided" if not is_significant else "reproduced" if mean > 0.0 else "not reproduced", evidence
        )


def _checked_decisions(reference: PublishedComparison, comparison: Comparison) -> Iterator[CheckedClaim]:
    times = comparison.decision_times.tolist()
    for planner, time, actions in reference.decisions:
        if planner not in comparison.strategies or time not in times:
            continue
        shares = comparison.decision_shares(planner, times.index(time))
        words = {describe_choice(choice): share for choice, share in shares.items()}
        first = next(iter(words))
        evidence = f"chosen in {percent(words.get(actions, 0.0))} of the runs"
        if first != actions:
            evidence += f", ({first}) in {percent(words[first])}"
        claim = f"{planner} chooses ({actions}) at {time:g} s"
        yield CheckedClaim(claim, "reproduced" if first == actions else "not reproduced", evidence)


def _published(row: dict[str, str | float]) -> StrategyScore:
    """Return the score in a row of the file. Missing values are None."""

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


def published_markdown(results: CampaignResults, reference: PublishedComparison) -> str:
    """Return the results next to the published figures as Markdown, with a table for each setting of the campaign."""
    lines = [f"# {reference.title}", ""]
    for group in results.comparisons():
        title = results.title(group)
        scores = (*score_strategies(group), *reference.published)
        table = score_markdown(scores, group.comparison.unit, group.labels[0])
        lines += [*([f"## {title}", ""] if title else []), table, tail_sentence(group.comparison), ""]
    return "\n".join([*lines, "\n\n".join(provenance(reference)), ""])


def provenance(reference: PublishedComparison) -> tuple[str, ...]:
    """Return lines on the source of the published figures and their differences from the campaign."""
    source = f"Published: {reference.source}." if reference.source else ""
    return tuple(line for line in (source, reference.remark) if line)
