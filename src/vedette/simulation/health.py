"""Reports of the filters and the fusion of a run: truncation errors, clutter floors, missing labels."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.filters import FilterInfo
from vedette.fusion.base import FusionInfo
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats, Ints
from vedette.simulation.arrow import Kind

_FUSION = "fusion_"  # prefix of the names for the fusion as a whole


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Health(SummaryRepr):
    """Reports of all filters and fusions of a run, with names and meaning as in `FilterInfo` and `FusionInfo`.

    Arrays have the shape (num_scans, num_sensors), those of the fusion as a whole (`fusion_...`) (num_scans,). Booleans
    are 0 or 1. Without a fusion, or with a custom one that reports no `FusionInfo`, its numbers are 0. The report of
    one filter for all sensors is repeated for every sensor, its numbers of measurements only for the first.
    """

    log_likelihood: Floats  # log likelihood of the scan, given the prior
    num_hypotheses: Ints  # size of the posterior
    num_tracks: Ints  # size of the posterior
    truncation_error_bound: Floats  # upper bound on the truncated share of posterior weight, or NaN if unknown
    dropped_existence: Floats  # expected number of targets in dropped labels
    num_clutter_floored: Ints  # measurements whose clutter intensity was raised to its floor
    num_duplicates: Ints  # measurements left out because they repeat another
    num_inexact_clusters: Ints  # clusters of an LMB not summed exactly
    search_truncated: Ints  # whether the ranking search stopped early
    limit_reached: Ints  # whether the posterior reached its maximum size
    # upper bound on the L1 error of treating labels as independent, for factored densities
    independence_error_bound: Floats
    num_missing_sets: Ints  # label sets that another sensor has and this one does not (for CLMB, labels)
    num_missing_labels: Ints  # labels that this sensor does not know at all
    bytes_sent: Ints  # bytes that this sensor sent by radio, or to the fusion centre, or 0 if not counted
    fusion_num_sets: Ints  # label sets that were fused (for CLMB, labels)
    fusion_num_lost_labels: Ints  # labels that are certain at a sensor and not in the fused density
    fusion_empty_intersection: Ints  # whether no label set is held by every sensor
    fusion_log_normaliser: Floats  # log of the set integral of the product of the powers
    fusion_discarded_weight: Floats  # probability of the fused label sets that were truncated

    def _summary(self) -> str:
        num_scans, num_sensors = self.num_tracks.shape
        return f"of {pluralise(num_scans, 'scan')}, {pluralise(num_sensors, 'sensor')}"

    @classmethod
    def unreported(cls, num_scans: int, num_sensors: int) -> "Health":
        """Return reports that are all zero, to be filled scan by scan."""
        shapes = {name: (num_scans,) if name in FUSION_COLUMNS else (num_scans, num_sensors) for name in _DTYPES}
        arrays: dict[str, Any] = {name: np.zeros(shape, _DTYPES[name]) for name, shape in shapes.items()}
        return cls(**arrays)

    def first(self, num_scans: int) -> "Health":
        """Return the reports of the first scans."""
        return Health(**{name: getattr(self, name)[:num_scans] for name in _DTYPES})

    def note_filters(self, scan: int, infos: Sequence[FilterInfo]) -> None:
        """Record the reports of the filters, one per sensor or one for all. Scans are counted from 0.

        Raises `InputError` for another number of reports, or another type.
        """
        num = self.num_tracks.shape[1]
        if len(infos) not in (1, num) or [info for info in infos if not isinstance(info, FilterInfo)]:
            kinds = [type(info).__name__ for info in infos]
            raise InputError(
                f"TrackerInfo.filters: expected a FilterInfo of each of {num} sensors, or of all; got {kinds}"
            )
        for name, reported in zip(_OF_FILTER, zip(*map(_reported, infos), strict=True), strict=True):
            array = getattr(self, name)
            array[scan] = reported
            if len(infos) == 1 and name in _OF_SCANS:
                array[scan, 1:] = 0

    def note_fusion(self, scan: int, info: Any) -> None:
        """Record the report of a fusion, if it is a `FusionInfo`."""
        if isinstance(info, FusionInfo):
            self.num_missing_sets[scan] = info.missing_sets
            self.num_missing_labels[scan] = info.missing_labels
            for name in FUSION_COLUMNS:
                getattr(self, name)[scan] = getattr(info, name.removeprefix(_FUSION))

    def note_sent(self, scan: int, bytes_sent: Sequence[int]) -> None:
        """Record the bytes sent by each sensor. Nothing is counted if `bytes_sent` is empty.

        Raises `InputError` unless there is one number per sensor.
        """
        num = self.bytes_sent.shape[1]
        if len(bytes_sent) not in (0, num):
            raise InputError(f"TrackerInfo.bytes_sent: expected {num}, one a sensor, or none; got {len(bytes_sent)}")
        self.bytes_sent[scan] = bytes_sent or 0

    def check(self, num_scans: int, num_sensors: int) -> None:
        """Raise `InputError` unless every array has its shape and type."""
        for name, dtype in _DTYPES.items():
            array = getattr(self, name)
            shape = (num_scans,) if name in FUSION_COLUMNS else (num_scans, num_sensors)
            if array.shape != shape or array.dtype != dtype:
                raise InputError(f"record.health.{name}: expected {dtype} of {shape}; got {array.dtype} {array.shape}")


_DTYPES = {field.name: np.dtype(np.float64 if field.type == Floats else np.int64) for field in fields(Health)}
_KINDS = {name: Kind.NUMBER if dtype == np.float64 else Kind.INTEGER for name, dtype in _DTYPES.items()}
_OF_SCANS = ("num_clutter_floored", "num_duplicates")  # summed over the sensors
_OF_FILTER = tuple(field.name for field in fields(FilterInfo) if field.name in _DTYPES)
_reported = attrgetter(*_OF_FILTER)

# The columns of the tables of sensors and of scans.
FUSION_COLUMNS = {name: kind for name, kind in _KINDS.items() if name.startswith(_FUSION)}
SENSOR_COLUMNS = {name: kind for name, kind in _KINDS.items() if name not in FUSION_COLUMNS}
