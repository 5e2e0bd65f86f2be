"""Diagnostics of one or more runs: what filters and fusion truncated, dropped or lost, and whether it matters."""

import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from vedette.evaluation.health import HealthSums, health_sums, percent
from vedette.evaluation.metrics.consistency import nees_of_matching
from vedette.evaluation.metrics.matching import match_run
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats
from vedette.kernels.labelled.set_fusion import LOST, SURE
from vedette.scenarios import Scenario
from vedette.scenarios.new_targets import MOST_LATE, NewTargets, new_targets
from vedette.simulation.health import Health
from vedette.simulation.records import RunRecord

Level = Literal["ok", "note", "check"]
_CHECK_ABOVE = 0.01  # share or number above which a truncation should be checked
_FEW_DROPPED, _MOST_DROPPED = 0.1, 0.5  # shares of the expected births
_FEW_ERRORS, _WRONG_RATIO = 30, 1.5  # estimates of known targets; error over its bar
_UNLIKELY = 0.01  # probability of so few reported targets


class Diagnostic(NamedTuple):
    """One check of one or more runs."""

    name: str  # what is checked
    meaning: str  # what it means, in a sentence
    text: str  # the result with its numbers
    level: Level  # `ok`; `note`: it happened, and rarely costs accuracy; `check`: it may cost accuracy


def run_diagnostics(health: Health, sensors: Sequence[str] = ()) -> tuple[Diagnostic, ...]:
    """Return every diagnostic of one run. sensors: their names."""
    return diagnostics(health_sums([health]), sensors)


def record_diagnostics(record: RunRecord, scenario: Scenario | None) -> tuple[Diagnostic, ...]:
    """Return every diagnostic of one run. Without the scenario, those of new targets and of errors are left out."""
    if scenario is None:
        return run_diagnostics(record.health)
    of_filters = run_diagnostics(record.health, scenario.model.sensor_names)
    return (*of_filters, *birth_diagnostics(record, scenario), *_error_diagnostics(record, scenario))


def _error_diagnostics(record: RunRecord, scenario: Scenario) -> Iterator[Diagnostic]:
    """Yield the diagnostic of errors of a recording with known targets. Of simulated runs, NEES is a metric."""
    if record.recording is None:
        return
    ospa = scenario.model.ospa
    matching = match_run(record.truth, record.estimates, cutoff=ospa.cutoff, order=ospa.order)
    if (num := len(matching.scans)) < _FEW_ERRORS:
        return
    ratio = math.sqrt(0.5 * nees_of_matching(record.truth, matching, position_only=True).mean())
    yield Diagnostic(
        "Error bars",
        "Root mean square of the errors of positions over what the covariances of the estimates say: 1 if they are "
        "right, above if targets move or sensors err otherwise than the models assume.",
        f"errors are {ratio:.2g} times what the covariances say, in {num} estimates of known targets",
        "ok" if 1.0 / _WRONG_RATIO < ratio < _WRONG_RATIO else _level(ratio, _WRONG_RATIO),
    )


def birth_diagnostics(record: RunRecord, scenario: Scenario) -> Iterator[Diagnostic]:
    """Yield the diagnostics of new targets of one run, by the births that the filter assumes."""
    labels = {tuple(label) for estimate in record.estimates for label in estimate.labels.tolist()}
    yield from new_target_diagnostics(new_targets(scenario, record.num_scans), record.health, len(labels))


def diagnostics_line(results: Sequence[Diagnostic]) -> str:
    """Return the diagnostics that are not `ok` in one line, or `no limit reached, nothing truncated` if all are."""
    shown = [f"{each.name[0].lower()}{each.name[1:]}: {each.text}" for each in results if each.level != "ok"]
    return "; ".join(shown) or "no limit reached, nothing truncated"


def diagnostics(health: HealthSums, sensors: Sequence[str] = ()) -> tuple[Diagnostic, ...]:
    """Return every diagnostic of some runs, those of the fusion first. sensors: names, by default `sensor 1` and so on.

    A scan counts in a share if the event happened at any sensor.
    """
    names = sensors or [f"sensor {number + 1}" for number in range(len(health.unknown_labels))]
    return (*_fusion_diagnostics(health, names), *_filter_diagnostics(health), *_measurement_diagnostics(health))


def _level(value: float, check_above: float = 0.0) -> Level:
    """Return `check` above `check_above`, `note` above 0, and with infinite `check_above` never `check`."""
    return "check" if value > check_above else "note" if value > 0.0 else "ok"


def _scans(share: float) -> str:
    return f"{percent(share)} of scans"


def _bound(share: float) -> str:
    """Return an upper bound on a share in words."""
    return "less than 1 %" if share < 0.01 else f"at most {percent(share)}"


def _worst(shares: Floats, names: Sequence[str]) -> str:
    worst = int(np.argmax(shares))
    return f"{percent(float(shares[worst]))} at {names[worst]}" if shares[worst] else "0 %"


def _fusion_diagnostics(health: HealthSums, sensors: Sequence[str]) -> Iterator[Diagnostic]:
    lost, disjoint = health.lost / health.num_scans, health.disjoint / health.num_scans
    max_lost = f", up to {pluralise(int(health.worst_lost), 'target')}" if lost else ""
    yield Diagnostic(
        "Targets lost by fusion",
        f"A label with an existence probability of {SURE:g} or more at one sensor has less than {LOST:g} after fusion, "
        "because another sensor lacks it or does not see there.",
        f"{_scans(lost)}{max_lost}",
        _level(lost, _CHECK_ABOVE),
    )
    yield Diagnostic(
        "No common label set",
        "No label set is held by every sensor.",
        _scans(disjoint),
        _level(disjoint),
    )
    yield Diagnostic(
        "Fused weight truncated",
        "Share of the fused weight beyond max_hypotheses, at the worst scan.",
        percent(health.worst_fusion_discarded),
        _level(health.worst_fusion_discarded, _CHECK_ABOVE),
    )
    yield Diagnostic(
        "Label sets missing at a sensor",
        "Share of the fused label sets (CLMB: labels) that a sensor lacks, for the sensor that lacks most.",
        _worst(health.num_missing_sets / max(1, health.num_sets), sensors),
        _level(float(health.num_missing_sets.max()), math.inf),
    )
    yield Diagnostic(
        "Labels unknown to a sensor",
        "Share of the scans at which a sensor lacks a label that another sensor has.",
        _worst(health.unknown_labels / health.num_scans, sensors),
        _level(float(health.unknown_labels.max()), math.inf),
    )


def _filter_diagnostics(health: HealthSums) -> Iterator[Diagnostic]:
    yield Diagnostic(
        "Posterior truncated",
        "The filter reached its limits, or left out improbable hypotheses. The weight is an upper bound, and "
        "not the error: a campaign with ten times as many hypotheses measures what the limits cost.",
        _truncation(health),
        _truncation_level(health),
    )
    yield Diagnostic(
        "Association search cut short",
        "The ranking of associations stopped at max_search_nodes.",
        _scans(health.search_truncated / health.num_scans),
        _level(health.search_truncated),
    )
    yield Diagnostic(
        "Cluster approximated",
        "An LMB cluster was too large for an exact sum; the heaviest joint choices were summed.",
        _scans(health.inexact / health.num_scans),
        _level(health.inexact),
    )
    worst, mean = health.worst_factoring / 2.0, health.factoring / max(1, health.num_factoring) / 2.0
    is_known = not math.isnan(worst)
    yield Diagnostic(
        "Independence error",
        "Upper bound on the share of the weight that a filter moves when it treats labels as independent, per scan.",
        (f"{_bound(worst)} (mean {_bound(mean)})" if worst else "none") if is_known else "not known",
        ("check" if mean > 5.0 * _CHECK_ABOVE else _level(worst, math.inf)) if is_known else "note",
    )
    yield Diagnostic(
        "Targets dropped",
        "Expected number of targets in the labels that a filter dropped, at the worst scan.",
        f"up to {health.worst_dropped:.2g} per scan" if health.worst_dropped else "none",
        _level(health.worst_dropped, _CHECK_ABOVE),
    )


def _truncation(health: HealthSums) -> str:
    if math.isnan(health.worst_discarded):
        weight = "weight not known"
    elif health.worst_discarded:
        weight = f"weight {_bound(health.worst_discarded)} (mean {_bound(health.discarded / health.num_discarded)})"
    else:
        weight = "weight 0 %"
    if not health.limit_reached:
        return weight
    return f"{weight}, limit reached at {_scans(health.limit_reached / health.num_scans)}"


def _truncation_level(health: HealthSums) -> Level:
    if health.worst_discarded > 0.0:  # neither zero nor unknown
        return _level(health.worst_discarded, _CHECK_ABOVE)
    return "check" if health.limit_reached else "note" if math.isnan(health.worst_discarded) else "ok"


def _measurement_diagnostics(health: HealthSums) -> Iterator[Diagnostic]:
    yield Diagnostic(
        "Repeated measurements",
        "Measurements that repeat another one and were left out.",
        str(health.duplicates),
        _level(health.duplicates),
    )
    yield Diagnostic(
        "Clutter raised",
        "Measurements at places where the clutter intensity was raised to its floor.",
        str(health.clutter_raised),
        _level(health.clutter_raised, math.inf),
    )


def new_target_diagnostics(targets: NewTargets | None, health: Health, num_labels: int) -> Iterator[Diagnostic]:
    """Yield the diagnostics of new targets. targets: those that are expected in these scans, None if not known."""
    from scipy.special import gammaincc

    late = 0.0 if targets is None else targets.late_share
    yield Diagnostic(
        "New targets",
        "Median number of detections until the existence probability of a new target exceeds one half, by the assumed "
        "births, clutter, noise and detection; and the number that it gives in the run, its life or its time in view.",
        "not known" if targets is None else targets.describe(),
        "check" if late > MOST_LATE else _level(late, math.inf),
    )
    births, expected = (0.0, 0.0) if targets is None else (targets.births.sum(), targets.reported.sum())
    dropped = health.dropped_existence.sum(axis=0).mean() / births if births else 0.0
    yield Diagnostic(
        "Births dropped",
        "Expected number of targets in dropped labels, in all scans, as a share of the expected number of births.",
        f"{percent(min(dropped, 1.0))} of {births:.2g} expected, by filter.limits" if births else "not known",
        _level(dropped if dropped > _FEW_DROPPED else 0.0, _MOST_DROPPED),
    )
    chance = float(gammaincc(num_labels + 1, expected))  # of so few, for a Poisson number
    yield Diagnostic(
        "Targets reported",
        "Labels in the estimates, and the number expected from the assumed births, without those that come too late to "
        "be reported.",
        f"{num_labels or 'none'}, {expected:.2g} expected (probability {chance:.1g})",
        "ok" if chance > _UNLIKELY else _level(1.0, math.inf if num_labels else 0.0),
    )
