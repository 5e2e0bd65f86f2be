"""Measures of one's own: a name, and a function of a run's record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.errors import VedetteError
from vedette.evaluation.metrics.run import COLUMNS
from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array, reject
from vedette.simulation.arrow import RUN_COLUMNS
from vedette.simulation.records import Measure, RunRecord
from vedette.simulation.tables import LAYOUTS


@dataclass(frozen=True, slots=True)
class Metric:
    """One measure more, with a column of its own wherever there are measures.

    Attributes:
        name: of its column, a Python identifier; its unit, if it has one, at the end (`_m` m, `_s` s, `_rad` rad).
        function: of the record of a run, gives (num_scans,) numbers; NaN where it has no value.

    Raises:
        InputError: a name that is no identifier, or that another column has.
    """

    name: str
    function: Measure

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise reject("metric.name", "a Python identifier", self.name)
        if self.name in RUN_COLUMNS or self.name in COLUMNS or LAYOUTS["scans"].kind(self.name) is not None:
            raise reject("metric.name", "a name that no column has", self.name)

    def of(self, record: RunRecord) -> Floats:
        """(num_scans,) the measure of a run.

        Raises `InputError`, with the name, for anything but one number a scan, and `VedetteError` where the function
        itself raises.
        """
        try:
            answer = self.function(record)
        except VedetteError:
            raise
        except Exception as error:
            raise VedetteError(f"metric {self.name}: {type(error).__name__}: {error}") from error
        values = as_array(f"metric {self.name}", answer, "fiu", "numbers").astype(np.float64)
        if values.shape != (record.num_scans,):
            raise reject(
                f"metric {self.name}", f"a number for each of {record.num_scans} scans", f"shape {values.shape}"
            )
        if np.isinf(values).any():
            raise reject(f"metric {self.name}", "finite numbers, or NaN", values)
        return values
