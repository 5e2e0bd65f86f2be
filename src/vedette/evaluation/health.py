"""What filters and fusion reported over a run or several, as numbers and in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats
from vedette.simulation.health import Health
from vedette.text import counted

# From here on what was cut off is more than a trifle.
_MUCH = 0.01


class Reported(Protocol):
    """What has a health, such as the record of a run."""

    @property
    def num_sensors(self) -> int:
        """That are reported."""
        ...

    @property
    def health(self) -> Health:
        """What the filters and the fusion reported."""
        ...


@dataclass(frozen=True, slots=True)
class HealthSummary:
    """Over all scans of some runs; a share of scans counts a scan at which it happened at any sensor.

    Attributes:
        num_scans: of all runs.
        cap_met, search_cut, inexact: share of the scans at which a filter held as much as it may, its ranking search
            was cut short, an LMB cluster was not summed exactly.
        mean_discarded, worst_discarded: upper bound on the share of a filter's weight that was cut off; NaN where it is
            not known.
        mean_factoring, worst_factoring: upper bound on the L1 error that a factored filter made by taking labels as
            independent; NaN where it is not known.
        worst_dropped: expected number of targets in labels that a filter dropped at one scan.
        duplicates, clutter_raised: measurements in all.
        missing_sets: (num_sensors,) share of the fused label sets (CLMB: labels) that the sensor lacks.
        unknown_labels: (num_sensors,) share of the scans at which the sensor lacks a label that another one has.
        lost: share of the scans at which the fusion lost a label that a sensor was sure of.
        worst_lost: most such labels at a scan.
        disjoint: share of the scans at which no label set is held by every sensor.
        worst_fusion_discarded: most weight that the fusion cut off.
        sensors: what they are called.
    """

    num_scans: int
    cap_met: float
    search_cut: float
    inexact: float
    mean_discarded: float
    worst_discarded: float
    mean_factoring: float
    worst_factoring: float
    worst_dropped: float
    duplicates: int
    clutter_raised: int
    missing_sets: Floats
    unknown_labels: Floats
    lost: float
    worst_lost: int
    disjoint: float
    worst_fusion_discarded: float
    sensors: tuple[str, ...]


def summarise_health(records: Sequence[Reported], sensors: Sequence[str] = ()) -> HealthSummary:
    """The reports of runs with the same sensors, which are called `sensors`, or else `sensor 1` and so on.

    Raises `InputError` for no run or other numbers of sensors.
    """
    if len({record.num_sensors for record in records}) != 1:
        raise InputError("records: expected one run or more, of equally many sensors")

    def joined(name: str) -> Floats:
        return np.concatenate([getattr(record.health, name) for record in records]).astype(np.float64)

    def share(at_sensors: Bools) -> float:
        return float(at_sensors.reshape(len(at_sensors), -1).any(axis=1).mean())

    discarded, factoring = joined("discarded_weight_bound"), joined("factoring_error")
    known, factoring = discarded[~np.isnan(discarded)], factoring[~np.isnan(factoring)]
    lost = joined("fusion_num_lost_labels")
    return HealthSummary(
        num_scans=len(discarded),
        cap_met=share(joined("cap_met") > 0),
        search_cut=share(joined("search_cut") > 0),
        inexact=share(joined("num_inexact_clusters") > 0),
        mean_discarded=float(known.mean()) if len(known) else np.nan,
        worst_discarded=float(known.max()) if len(known) else np.nan,
        mean_factoring=float(factoring.mean()) if len(factoring) else np.nan,
        worst_factoring=float(factoring.max()) if len(factoring) else np.nan,
        worst_dropped=float(joined("dropped_existence").max()),
        duplicates=int(joined("num_duplicates").sum()),
        clutter_raised=int(joined("num_clutter_raised").sum()),
        missing_sets=joined("num_missing_sets").sum(axis=0) / max(1.0, float(joined("fusion_num_sets").sum())),
        unknown_labels=(joined("num_missing_labels") > 0).mean(axis=0),
        lost=share(lost > 0),
        worst_lost=int(lost.max()),
        disjoint=share(joined("fusion_empty_intersection") > 0),
        worst_fusion_discarded=float(joined("fusion_discarded_weight").max()),
        sensors=tuple(sensors) or tuple(f"sensor {number + 1}" for number in range(records[0].num_sensors)),
    )


def health_line(record: Reported, sensors: Sequence[str] = ()) -> str:
    """A run's health in a line: `health: all exact`, or what was cut off, missing or left out."""
    health = summarise_health([record], sensors)
    statements = _statements(health, lambda share: f"{round(share * health.num_scans)} of {health.num_scans} scans")
    return f"health: {'; '.join(text for text, _ in statements) or 'all exact'}"


def health_findings(records: Sequence[Reported], sensors: Sequence[str] = ()) -> tuple[str, ...]:
    """What of the health of some runs may have cost accuracy, in words; none where nothing did."""
    statements = _statements(summarise_health(records, sensors), lambda share: f"{percent(share)} of the scans")
    return tuple(text for text, is_much in statements if is_much)


def percent(share: float) -> str:
    """A share as a whole number of percent; no share but 0 and 1 is written as 0 % or 100 %."""
    if 0.0 < share < 0.01:
        return "<1 %"
    if 0.99 < share < 1.0:
        return ">99 %"
    return f"{share:.0%}".replace("%", " %")


def _at_most(bound: float) -> str:
    """An upper bound on a share, in words."""
    return "less than 1 %" if bound < 0.01 else f"at most {percent(bound)}"


def _statements(health: HealthSummary, scans: Callable[[float], str]) -> list[tuple[str, bool]]:
    """Everything that was not exact, the gravest first, and whether it is more than a trifle."""
    found = [*_of_fusion(health, scans), *_of_filters(health, scans)]
    if health.duplicates:
        found.append((f"measurements left out because they repeat another: {health.duplicates}", True))
    if health.clutter_raised:
        found.append((f"measurements whose clutter was raised to its floor: {health.clutter_raised}", False))
    return found


def _of_fusion(health: HealthSummary, scans: Callable[[float], str]) -> Iterator[tuple[str, bool]]:
    if health.lost:
        yield (
            f"at {scans(health.lost)} GCI lost a target that one sensor was sure of and another was not (up to "
            f"{counted(health.worst_lost, 'target')} at a scan)",
            health.lost > _MUCH,
        )
    if health.disjoint:
        yield f"at {scans(health.disjoint)} the sensors had no label set in common", True
    worst = int(np.argmax(health.missing_sets))
    if health.missing_sets[worst]:
        share = percent(float(health.missing_sets[worst]))
        yield f"{share} of label sets were missing at {health.sensors[worst]}", False
    cut = health.worst_fusion_discarded
    if cut:
        yield f"up to {percent(cut)} of the fused weight was cut off at a scan", cut > _MUCH


def _of_filters(health: HealthSummary, scans: Callable[[float], str]) -> Iterator[tuple[str, bool]]:
    if health.search_cut:
        yield f"the ranking search was cut short at {scans(health.search_cut)}", True
    if health.inexact:
        yield f"an LMB cluster was too large to be summed exactly at {scans(health.inexact)}", True
    worst = health.worst_discarded
    cap = f"a cap was met at {scans(health.cap_met)}" if health.cap_met else ""
    if worst > 0.0:  # neither none nor unknown
        on_average = _at_most(health.mean_discarded)
        bound = f"{_at_most(worst)} of a filter's weight was cut off at a scan ({on_average} on average)"
        yield f"{cap}, and {bound}" if cap else bound, worst > _MUCH
    elif cap:
        yield cap, True
    elif np.isnan(worst):
        yield "how much weight was cut off is not known", False
    if np.isnan(health.worst_factoring):
        yield "how much weight was moved by taking labels as independent is not known", False
    elif health.worst_factoring:
        mean = health.mean_factoring
        yield (
            f"taking labels as independent moved {_at_most(health.worst_factoring / 2.0)} of a filter's weight at a "
            f"scan ({_at_most(mean / 2.0)} on average)",
            mean > 10.0 * _MUCH,
        )
    if health.worst_dropped:
        yield (
            f"up to {health.worst_dropped:.2g} targets were dropped with their labels at a scan",
            health.worst_dropped > _MUCH,
        )
