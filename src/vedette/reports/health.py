"""The health of a group's runs as a table: what the filters and the fusion cut off, and what a sensor lacked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vedette.evaluation.health import HealthSummary, health_findings, percent, summarise_health
from vedette.fusion.base import LOST, SURE
from vedette.kernels.base.types import Floats
from vedette.reports.groups import Group, Strategy
from vedette.reports.tables import Table, nees_over_runs, nees_spread
from vedette.scenarios.sections.fusion import ONE_BELIEF

_TRIFLE = 0.01  # share of the targets without an estimate, below which it is not said
_OFTEN = 0.2  # share of the scans at which covariances are too small, or too large, from which that is said


@dataclass(frozen=True, slots=True)
class _Row:
    """What is told, what it is, how it reads of a summary; whether it says something only where there is a fusion."""

    name: str
    note: str
    text: Callable[[HealthSummary], str]
    needs_fusion: bool = False


def _weight(share: float) -> str:
    return "unknown" if math.isnan(share) else percent(share)


def _worst_sensor(shares: Floats, names: Sequence[str]) -> str:
    worst = int(np.argmax(shares))
    return f"{percent(float(shares[worst]))} ({names[worst]})" if shares[worst] else "0 %"


_SCANS = "share of the scans, at any sensor"
_ROWS = (
    _Row("A cap was met", f"the posterior was as large as its limits allow; {_SCANS}", lambda h: percent(h.cap_met)),
    _Row("Search cut short", f"ranking stopped at max_search_nodes; {_SCANS}", lambda h: percent(h.search_cut)),
    _Row("Cluster not exact", f"summed over its heaviest joint choices only; {_SCANS}", lambda h: percent(h.inexact)),
    _Row(
        "Weight cut off at most, mean",
        "upper bound on the share of a filter's weight that its caps left out at a scan, mean over scans and sensors; "
        "how far it moves the estimates is another question (the report's documentation has a study of it)",
        lambda h: _weight(h.mean_discarded),
    ),
    _Row("Weight cut off at most, worst", "the same at the worst scan", lambda h: _weight(h.worst_discarded)),
    _Row(
        "Taken as independent at most, mean",
        "upper bound on the share of a factored filter's weight that was moved by it, mean over scans and sensors",
        lambda h: _weight(h.mean_factoring / 2.0),
    ),
    _Row(
        "Taken as independent at most, worst", "the same at the worst scan", lambda h: _weight(h.worst_factoring / 2.0)
    ),
    _Row(
        "Targets dropped, worst",
        "expected number of targets in labels that a filter dropped at a scan",
        lambda h: f"{h.worst_dropped:.2g}",
    ),
    _Row("Repeated measurements", "left out, in all runs", lambda h: str(h.duplicates)),
    _Row(
        "Clutter raised",
        "measurements where the clutter intensity was below its floor",
        lambda h: str(h.clutter_raised),
    ),
    _Row(
        "Label sets missing at a sensor",
        "share of the fused label sets (CLMB: labels) that the sensor which lacks most lacks",
        lambda h: _worst_sensor(h.missing_sets, h.sensors),
        needs_fusion=True,
    ),
    _Row(
        "Labels unknown to a sensor",
        "share of the scans at which the sensor where that is most frequent lacks a label that another has",
        lambda h: _worst_sensor(h.unknown_labels, h.sensors),
        needs_fusion=True,
    ),
    _Row(
        "Targets lost by the fusion",
        f"share of the scans at which a label that a sensor is sure of ({SURE:g} or more) has an existence below "
        f"{LOST:g} in the fused density, as another sensor lacks it or does not see there",
        lambda h: percent(h.lost),
        needs_fusion=True,
    ),
    _Row(
        "Targets lost, worst",
        "such labels at the worst scan",
        lambda h: str(h.worst_lost),
        needs_fusion=True,
    ),
    _Row(
        "No label set in common",
        "share of the scans at which no label set is held by every sensor",
        lambda h: percent(h.disjoint),
        needs_fusion=True,
    ),
    _Row(
        "Fused weight cut off, worst",
        "share of the fused weight beyond max_hypotheses at the worst scan",
        lambda h: percent(h.worst_fusion_discarded),
        needs_fusion=True,
    ),
)


def health_table(group: Group) -> Table | None:
    """What the filters and the fusion reported, a column a strategy; None where nothing has run."""
    if not (strategies := group.strategies):
        return None
    has_fusion = any(each.cell.scenario.model.fusion.kind not in ONE_BELIEF for each in strategies)
    summaries = [summarise_health(each.ensemble.health, each.scene.names) for each in strategies]
    rows = [row for row in _ROWS if has_fusion or not row.needs_fusion]
    caption = "What filters and fusion had to leave out, over all scans of all runs in common."
    return Table(
        caption,
        ("Report", *(each.name for each in strategies)),
        tuple((row.name, *(row.text(health) for health in summaries)) for row in rows),
        tuple(row.note for row in rows),
    )


def group_health(group: Group) -> tuple[tuple[str, str], ...]:
    """Name and findings, in a sentence, of each strategy whose filters or fusion left out more than a trifle.

    So has one that lost targets, one whose covariances are too small or too large, and one with an estimate that is
    farther off than its covariance allows.
    """
    said = (
        (each.name, (*health_findings(each.ensemble.health, each.scene.names), *_findings(each)))
        for each in group.strategies
    )
    return tuple((name, f"{'; '.join(findings)}.") for name, findings in said if findings)


def _findings(strategy: Strategy) -> Iterator[str]:
    if strategy.ensemble.measures:  # the targets are known
        yield from _lost_findings(strategy)
        yield from _consistency_findings(strategy)


def _lost_findings(strategy: Strategy) -> Iterator[str]:
    """Targets without an estimate, and the run where that is most frequent."""
    ensemble, counted = strategy.ensemble, strategy.counted
    alive = ensemble.num_targets[:, counted].sum(axis=1, dtype=np.float64)
    missed = ensemble.values("num_missed")[:, counted].sum(axis=1)
    if not alive.any() or missed.sum() < _TRIFLE * alive.sum():
        return
    shares = missed / np.maximum(alive, 1.0)
    worst = int(np.argmax(shares))
    yield (
        f"{percent(float(missed.sum() / alive.sum()))} of the targets, over the scans, have no estimate within the "
        f"cutoff, most in run {ensemble.runs[worst]} ({percent(float(shares[worst]))})"
    )


def _consistency_findings(strategy: Strategy) -> Iterator[str]:
    """Covariances that are wrong on average, and the estimate that is worst for its own, if not by chance."""
    average, counted = nees_over_runs(strategy, 2), strategy.counted
    known = counted & (average.count > 0)
    for said, outside in (("small", average.mean > average.upper), ("large", average.mean < average.lower)):
        share = float(outside[known].mean()) if known.any() else 0.0
        if share > _OFTEN:
            middle = float(np.median(average.mean[known])) / average.dim
            yield (
                f"covariances are too {said} at {percent(share)} of the scans, where 2.5 % may be by chance: position "
                f"NEES / 2, averaged over the runs, is {middle:.2f} in the middle, and 1 is consistent"
            )
    spread = nees_spread(strategy)
    if spread is not None and not spread.is_by_chance:
        yield (
            f"in run {spread.run} at {spread.time:g} s an estimate was far worse than its covariance says: position "
            f"NEES / 2 of {spread.largest:.4g}, where 1 is consistent and {spread.median:.2f} is the median"
        )
