"""All metrics of a run at each scan, and custom metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from vedette.errors import VedetteError
from vedette.evaluation.metrics.consistency import nees_of_matching
from vedette.evaluation.metrics.matching import match_run
from vedette.evaluation.metrics.point_gospa import gospa_of_matching
from vedette.evaluation.metrics.track_ospa import ospa2_of_run
from vedette.evaluation.metrics.tracked_fraction import waiting_times
from vedette.evaluation.metrics.trajectories import continuity
from vedette.internal.representation import SummaryRepr
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import as_array, reject
from vedette.simulation.arrow import RUN_COLUMNS
from vedette.simulation.records import Measure, RunRecord
from vedette.simulation.tables import LAYOUTS


@dataclass(frozen=True, slots=True)
class Metric:
    """A custom metric, with its own column in all tables of metrics.

    Attributes:
        name: name of its column, a Python identifier. It ends with the unit, if any (`_m` m, `_s` s, `_rad` rad).
        function: function of the record of a run that returns (num_scans,) numbers, or NaN where it has no value.

    Raises:
        InputError: a name that is not an identifier, or is that of another column.
    """

    name: str
    function: Measure

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise reject("metric.name", "a Python identifier", self.name)
        if self.name in RUN_COLUMNS or self.name in COLUMNS or LAYOUTS["scans"].kind(self.name) is not None:
            raise reject("metric.name", "a name that no column has", self.name)

    def evaluate(self, record: RunRecord) -> Floats:
        """Return the metric of a run, (num_scans,).

        Raises `InputError`, with the name, unless the function returns one number per scan, and `VedetteError` if the
        function itself raises.
        """
        try:
            result = self.function(record)
        except VedetteError:
            raise
        except Exception as error:
            raise VedetteError(f"metric {self.name}: {type(error).__name__}: {error}") from error
        values = as_array(f"metric {self.name}", result, "fiu", "numbers").astype(np.float64)
        if values.shape != (record.num_scans,):
            raise reject(
                f"metric {self.name}", f"a number for each of {record.num_scans} scans", f"shape {values.shape}"
            )
        if np.isinf(values).any():
            raise reject(f"metric {self.name}", "finite numbers, or NaN", values)
        return values


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RunMetrics(SummaryRepr):
    """Metrics of a run at each scan. Every array is (num_scans,). OSPA is in the run's record.

    With cutoff c and order p, the three GOSPA costs add up to `gospa_m ** p`. Their unit is m ** p, metres for p = 1.
    A pair is an estimate and a target matched within c.

    Attributes:
        gospa_m: GOSPA distance with alpha = 2, m.
        gospa_localisation: cost of the distances of matched pairs, m ** p.
        gospa_missed: cost of targets without a partner, c ** p / 2 each, m ** p.
        gospa_false: cost of estimates without a partner, c ** p / 2 each, m ** p.
        num_missed: number of targets without a partner.
        num_false: number of estimates without a partner.
        ospa2_m: OSPA(2) distance over the window that ends at the scan, m.
        cardinality_error: number of estimates minus number of targets.
        nees_mean: mean NEES of the full state over the pairs, or NaN without pairs.
        nees_count: number of pairs in `nees_mean`. 0 at all scans if estimated and true states differ in dimension.
        position_nees_mean: mean NEES of the position over all pairs, or NaN without pairs.
        position_nees_max: largest NEES of the position, or NaN without pairs.
        label_switches: number of targets matched to another label than at their last match.
        fragmentations: number of targets matched again after a break.
        seconds_to_track: mean time until the targets that appear at the scan are first tracked (`TimeToTrack`).
        custom: custom metrics by name.
    """

    gospa_m: Floats
    gospa_localisation: Floats
    gospa_missed: Floats
    gospa_false: Floats
    num_missed: Ints
    num_false: Ints
    ospa2_m: Floats
    cardinality_error: Ints
    nees_mean: Floats
    nees_count: Ints
    position_nees_mean: Floats
    position_nees_max: Floats
    label_switches: Ints
    fragmentations: Ints
    seconds_to_track: Floats
    custom: dict[str, Floats] = field(default_factory=dict)

    @property
    def num_scans(self) -> int:
        """Number of scans."""
        return len(self.gospa_m)

    def columns(self) -> dict[str, NDArray[np.float64] | NDArray[np.int64]]:
        """Return the arrays by name, in the order above: float64, or int64 for counts. Custom metrics come last."""
        return {**{name: getattr(self, name) for name in COLUMNS}, **self.custom}

    def with_custom(self, record: RunRecord, added: Sequence[Metric]) -> "RunMetrics":
        """Return the metrics with custom metrics of the run's record added. Those with the same names are replaced.

        Raises `InputError` or `VedetteError` as `Metric.evaluate` does.
        """
        return replace(self, custom={**self.custom, **{metric.name: metric.evaluate(record) for metric in added}})

    @classmethod
    def from_columns(cls, columns: Mapping[str, NDArray[np.float64] | NDArray[np.int64]]) -> "RunMetrics":
        """Return the metrics from the arrays that `columns` returns, in any order.

        Raises `InputError` for a missing name, a wrong type, or unequal lengths.
        """
        if not columns.keys() >= COLUMNS.keys():
            raise reject("columns", ", ".join(COLUMNS), ", ".join(columns))
        num_scans = len(columns["gospa_m"])
        for name, column in columns.items():
            dtype = COLUMNS.get(name, np.dtype(np.float64))
            if column.dtype != dtype or column.shape != (num_scans,):
                got = f"{column.dtype} in shape {column.shape}"
                raise reject(f"columns.{name}", f"{dtype} in shape {(num_scans,)}", got)
        custom = {name: column for name, column in columns.items() if name not in COLUMNS}
        return cls(**{name: columns[name] for name in COLUMNS}, custom=custom)  # type: ignore[arg-type] # checked above


COLUMNS = {
    each.name: np.dtype(np.float64 if each.type == Floats else np.int64)
    for each in fields(RunMetrics)
    if each.name != "custom"
}


def measure(
    record: RunRecord, *, cutoff: float, order: float, window: int, custom: Sequence[Metric] = ()
) -> RunMetrics:
    """Return all metrics of a run, from one matching per scan and a matching of tracks for OSPA(2).

    Args:
        record: the run.
        cutoff: c > 0, m, finite.
        order: p >= 1, finite.
        window: number of scans in the window of OSPA(2), at least 1.
        custom: custom metrics with different names.

    Raises:
        InputError: an argument out of range, a number of estimates other than one per scan, a position that is not
            finite, or a custom metric without one number per scan.
        NumericalError: an estimate's covariance is not symmetric and positive definite.
    """
    truth = record.truth
    matching = match_run(truth, record.estimates, cutoff=cutoff, order=order)
    gospa = gospa_of_matching(matching, cutoff, order)
    ospa2 = ospa2_of_run(truth, record.estimates, cutoff=cutoff, order=order, window=window)
    full = nees_of_matching(truth, matching, position_only=False)
    position = nees_of_matching(truth, matching, position_only=True)
    breaks = continuity(truth, matching)
    metrics = RunMetrics(
        gospa_m=gospa.total,
        gospa_localisation=gospa.localisation,
        gospa_missed=gospa.missed,
        gospa_false=gospa.false,
        num_missed=gospa.num_missed,
        num_false=gospa.num_false,
        ospa2_m=np.ascontiguousarray(ospa2[:, 0]),
        cardinality_error=matching.num_estimates - matching.num_targets,
        nees_mean=matching.mean_by_scan(full),
        nees_count=np.bincount(matching.scans[~np.isnan(full)], minlength=matching.num_scans),
        position_nees_mean=matching.mean_by_scan(position),
        position_nees_max=matching.max_by_scan(position),
        label_switches=breaks.label_switches,
        fragmentations=breaks.fragmentations,
        seconds_to_track=waiting_times(truth, matching),
    )
    return metrics.with_custom(record, custom)
