"""Tails of runs: the median and the worst run, and the share of runs that end with a lost target."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vedette.evaluation.comparison import Comparison
from vedette.internal.text import named_in
from vedette.kernels.base.types import Floats


class TailSummary(NamedTuple):
    """Mean OSPA of the median and of the worst run, and the share of runs that end with a lost target.

    A target is lost at the end if it has no estimate within the cutoff at the last scan that counts. NaN: unknown.
    """

    median: float
    worst: float
    lost: float

    def cells(self) -> tuple[str, str, str]:
        """Return the three values as text, empty if unknown."""
        numbers = ["" if np.isnan(each) else f"{each:.2f}" for each in (self.median, self.worst)]
        return (numbers[0], numbers[1], "" if np.isnan(self.lost) else f"{100.0 * self.lost:.0f} %")


def tail_header(unit: str) -> tuple[str, str, str]:
    """Return the names of the columns of `TailSummary.cells`."""
    return named_in("Median run", unit), named_in("Worst run", unit), "Runs that end with a lost target"


def summarise_tail(means: ArrayLike, lost: ArrayLike = ()) -> TailSummary:
    """Return the tail of runs from the mean OSPA of each, and whether each ends with a lost target (1 or 0).

    NaN stands for an unknown mean, and lost is empty if unknown.
    """
    known_means, ends_lost = np.asarray(means, np.float64), np.asarray(lost, np.float64)
    known_means = known_means[~np.isnan(known_means)]
    median_and_worst = (
        (float(np.median(known_means)), float(known_means.max())) if len(known_means) else (np.nan, np.nan)
    )
    return TailSummary(*median_and_worst, float(ends_lost.mean()) if len(ends_lost) else np.nan)


def strategy_tail(comparison: Comparison, strategy: str) -> TailSummary:
    """Return the tail of the runs of a strategy."""
    return summarise_tail(comparison.run_means(strategy), lost_at_end(comparison, strategy))


def lost_at_end(comparison: Comparison, strategy: str) -> Floats:
    """Return 1 for each run that ends with a lost target, else 0, (num_runs,), empty if runs have no such measure."""
    if "num_missed" not in comparison.measures:
        return np.empty(0)
    last = int(np.flatnonzero(comparison.counted)[-1])
    return np.asarray(comparison.values(strategy, "num_missed")[:, last] > 0.0, np.float64)


def tail_sentence(comparison: Comparison) -> str:
    """Return the tails of all strategies in a sentence, empty for a single run."""
    if comparison.num_runs == 1:
        return ""
    return tail_text({name: strategy_tail(comparison, name) for name in comparison.strategies}, comparison.unit)


def tail_text(tails: Mapping[str, TailSummary], unit: str) -> str:
    """Return tails by strategy in a sentence. unit: of OSPA."""
    texts = [f"{name} {', '.join(filter(None, tail.cells()))}" for name, tail in tails.items()]
    has_lost = any(not np.isnan(tail.lost) for tail in tails.values())
    lost = ", share of runs that end with a lost target" if has_lost else ""
    return f"{named_in('Median and worst run', unit)}{lost}: {'; '.join(texts)}."
