"""Reports of filters and fusion, summed over one or more runs."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.simulation.health import Health


class HealthSums(NamedTuple):
    """Reports of filters and fusion over all scans of some runs: numbers of scans, sums, and worst values.

    A scan counts once if the event happened at any sensor. The worst of no value is NaN.

    Attributes:
        num_scans: of all runs.
        limit_reached, search_truncated, inexact: scans at which a filter reached a limit, its ranking search was cut
            short, an LMB cluster was not summed exactly.
        discarded, num_discarded, worst_discarded: upper bound on the share of a filter's weight that was truncated: sum
            over scans and sensors with a known value, their number, and the largest value.
        factoring, num_factoring, worst_factoring: the same of the L1 error of a factored filter from treating labels as
            independent.
        worst_dropped: expected number of targets in labels that a filter dropped at one scan.
        duplicates, clutter_raised: numbers of measurements.
        num_missing_sets: (num_sensors,) fused label sets (CLMB: labels) that the sensor lacks.
        num_sets: number of fused label sets.
        unknown_labels: (num_sensors,) scans at which the sensor lacks a label that another one has.
        lost: scans at which the fusion lost a label that a sensor was sure of.
        worst_lost: most such labels at a scan.
        disjoint: scans at which no label set is held by every sensor.
        worst_fusion_discarded: most weight that the fusion truncated.
    """

    num_scans: int
    limit_reached: int
    search_truncated: int
    inexact: int
    discarded: float
    num_discarded: int
    worst_discarded: float
    factoring: float
    num_factoring: int
    worst_factoring: float
    worst_dropped: float
    duplicates: int
    clutter_raised: int
    num_missing_sets: Floats
    num_sets: int
    unknown_labels: Floats
    lost: int
    worst_lost: float
    disjoint: int
    worst_fusion_discarded: float


def health_sums(healths: Sequence[Health]) -> HealthSums:
    """Return the sums of runs with the same sensors. Raises `InputError` for no run or different numbers of sensors."""
    if len({health.num_tracks.shape[1] for health in healths}) != 1:
        raise InputError("records: expected one run or more, of equally many sensors")

    def concatenated(name: str) -> Floats:
        return np.concatenate([getattr(health, name) for health in healths])

    def scans(name: str) -> int:
        positive = concatenated(name) > 0
        return int(positive.reshape(len(positive), -1).any(axis=1).sum())

    discarded, factoring = concatenated("truncation_error_bound"), concatenated("independence_error_bound")
    lacking = concatenated("num_missing_labels") > 0
    return HealthSums(
        len(lacking),
        scans("limit_reached"),
        scans("search_truncated"),
        scans("num_inexact_clusters"),
        *_sum_and_worst(discarded),
        *_sum_and_worst(factoring),
        float(concatenated("dropped_existence").max()),
        int(concatenated("num_duplicates").sum()),
        int(concatenated("num_clutter_floored").sum()),
        concatenated("num_missing_sets").sum(axis=0, dtype=np.float64),
        int(concatenated("fusion_num_sets").sum()),
        lacking.sum(axis=0, dtype=np.float64),
        scans("fusion_num_lost_labels"),
        float(concatenated("fusion_num_lost_labels").max()),
        scans("fusion_empty_intersection"),
        float(concatenated("fusion_discarded_weight").max()),
    )


def _sum_and_worst(values: Floats) -> tuple[float, int, float]:
    known = values[~np.isnan(values)]
    return float(known.sum()), len(known), float(np.fmax.reduce(known, initial=np.nan))


def add_health_sums(parts: Sequence[HealthSums]) -> HealthSums:
    """Return the sums over all runs of several sums. Raises like `health_sums`."""
    if len({part.unknown_labels.shape for part in parts}) != 1:
        raise InputError("records: expected one run or more, of equally many sensors")
    columns = dict(zip(HealthSums._fields, zip(*parts, strict=True), strict=True))
    return HealthSums(
        **{
            name: np.fmax.reduce(values) if name.startswith("worst_") else sum(values)
            for name, values in columns.items()
        }
    )


def percent(share: float) -> str:
    """Return a share as a whole number of percent. Only 0 and 1 become 0 % and 100 %."""
    if 0.0 < share < 0.01:
        return "<1 %"
    if 0.99 < share < 1.0:
        return ">99 %"
    return f"{share:.0%}".replace("%", " %")
