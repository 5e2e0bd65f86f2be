"""Features of measurements that differ between classes of targets: reported classes and sizes."""

import math
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, reject

_STRONGEST = 700.0  # largest size of a log likelihood ratio, so that an impossible value stays a finite number


@dataclass(frozen=True, slots=True)
class ClassFeatures:
    """Evidence of a sensor's measurements about the class of a target: a reported class, a size, or both.

    Attributes:
        class_probs: (num_classes,) probability of each class of target, which sum to 1. They weigh the classes in what
            false measurements report, if that is not given.
        reports: names of the classes that the sensor reports, or () if it reports none.
        confusion: for each class of target the probability of each report, which sum to 1.
        clutter_confusion: the same for false measurements. (): as targets.
        sizes: for each class of target mean and standard deviation of the measured size, m, or () without sizes.
        clutter_size: the same for false measurements. (): as targets.

    Raises:
        InputError: other shapes, probabilities that are negative or do not sum to 1, a deviation that is not positive.
    """

    class_probs: tuple[float, ...]
    reports: tuple[str, ...] = ()
    confusion: tuple[tuple[float, ...], ...] = ()
    clutter_confusion: tuple[float, ...] = ()
    sizes: tuple[tuple[float, float], ...] = ()
    clutter_size: tuple[float, float] | tuple[()] = ()

    def __post_init__(self) -> None:
        num = len(self.class_probs)
        rows = [("class_probs", self.class_probs, (num,))]
        if self.reports:
            rows += [(f"confusion[{k}]", row, (len(self.reports),)) for k, row in enumerate(self.confusion)]
        if self.clutter_confusion:
            rows.append(("clutter_confusion", self.clutter_confusion, (len(self.reports),)))
        for name, given, shape in rows:
            probs = float_array(f"ClassFeatures.{name}", given, shape)
            if (probs < 0.0).any() or abs(probs.sum() - 1.0) > 1e-6:
                raise reject(f"ClassFeatures.{name}", "probabilities that sum to 1", probs.tolist())
        for name, table in (("confusion", self.confusion), ("sizes", self.sizes)):
            if table and len(table) != num:
                raise reject(f"ClassFeatures.{name}", f"one row for each of {num} classes", table)
        for k, (_, std) in enumerate([*self.sizes, *([self.clutter_size] if self.clutter_size else [])]):
            if not 0.0 < std < math.inf:
                raise reject(f"ClassFeatures.sizes[{k}]", "a standard deviation above 0", std)

    def log_ratios(self, report: int | None = None, size: float | None = None) -> Floats:
        """Return the log likelihood ratio, target over false measurement, for each class, shape (num_classes,).

        report: index in `reports`. size: m. None: not known.
        """
        ratios = np.zeros(len(self.class_probs))
        if report is not None:
            probs = np.array([row[report] for row in self.confusion])
            false = self.clutter_confusion[report] if self.clutter_confusion else float(probs @ self.class_probs)
            with np.errstate(divide="ignore", invalid="ignore"):
                ratios += _bounded(np.log(probs) - np.log(false))
        if size is not None:
            logs = np.array([_log_gaussian(size, *each) for each in self.sizes])
            clutter = (
                _log_gaussian(size, *self.clutter_size)
                if self.clutter_size
                else float(np.logaddexp.reduce(logs + np.log(self.class_probs)))
            )
            ratios += _bounded(logs - clutter)
        return ratios


def _bounded(logs: Floats) -> Floats:
    """Return log ratios within `_STRONGEST`. A report that neither targets nor clutter can have is no evidence."""
    return np.clip(np.nan_to_num(logs, nan=0.0, posinf=_STRONGEST, neginf=-_STRONGEST), -_STRONGEST, _STRONGEST)


def _log_gaussian(value: float, mean: float, std: float) -> float:
    return -0.5 * ((value - mean) / std) ** 2 - math.log(std) - 0.5 * math.log(2.0 * math.pi)
