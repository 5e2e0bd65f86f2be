"""Tables of a report: errors and other metrics per strategy, computation time, and the most frequent decisions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vedette.evaluation import AverageNees, average_nees, summarise
from vedette.evaluation.comparison import mean_of_known
from vedette.evaluation.ensembles import Ensemble
from vedette.evaluation.figures.cost import MIN_FOR_TAILS
from vedette.evaluation.figures.style import strategy_label
from vedette.evaluation.health import percent
from vedette.evaluation.metrics.run import COLUMNS
from vedette.evaluation.tables import decision_rows, header, strategy_rows
from vedette.evaluation.tail_summary import strategy_tail, tail_header
from vedette.internal.text import elided_apart, with_error, with_minus
from vedette.kernels.base.types import Bools, Floats
from vedette.reports.groups import Group, Strategy

_BY_CHANCE = 1e-3  # probability of the largest value below which the filter counts as inconsistent
_DIFFERENCES = range(4, 7)  # columns of `strategy_rows` that compare with the first strategy
_LONGEST_NAME = 32  # characters; the page shows the full name of longer ones as a tooltip

# (num_runs,) value of each run of an ensemble over the counted scans; NaN if it has none.
Measure = Callable[[Ensemble, Bools], Floats]


@dataclass(frozen=True, slots=True)
class Table:
    """Cells of text under a header. The first column names the rows."""

    caption: str  # description of the numbers
    header: tuple[str, ...]  # one entry per column
    rows: tuple[tuple[str, ...], ...]  # as long as the header
    notes: tuple[str, ...] = ()  # descriptions of the rows where the names do not suffice. May be empty
    is_words: bool = False  # whether the cells are words rather than numbers

    @property
    def short_header(self) -> tuple[str, ...]:
        """The header with long names elided."""
        return elided_apart(self.header, _LONGEST_NAME)

    @property
    def short_names(self) -> tuple[str, ...]:
        """Names of the rows. Long ones are elided if a name occurs in several rows."""
        names = [row[0] for row in self.rows]
        distinct = list(dict.fromkeys(names))
        if len(distinct) == len(names):
            return tuple(names)
        short = dict(zip(distinct, elided_apart(distinct, _LONGEST_NAME), strict=True))
        return tuple(short[name] for name in names)


def _mean(name: str) -> Measure:
    return lambda ensemble, counted: ensemble.values(name)[:, counted].mean(axis=1)


def _total(name: str) -> Measure:
    return lambda ensemble, counted: ensemble.values(name)[:, counted].sum(axis=1)


def _mean_size(ensemble: Ensemble, counted: Bools) -> Floats:
    return np.asarray(np.abs(ensemble.values("cardinality_error")[:, counted]).mean(axis=1))


def _mean_of_known(name: str) -> Measure:
    return lambda ensemble, counted: mean_of_known(ensemble.values(name)[:, counted])


@dataclass(frozen=True, slots=True)
class _Kind:
    """One metric of a run: name, description, value, and whether it requires labels."""

    name: str
    note: str
    value: Measure
    needs_labels: bool = False


def _kinds(order: float) -> tuple[_Kind, ...]:
    """Return the metrics of a run. `order` is that of OSPA, and the parts of GOSPA have that power."""
    power = "m" if order == 1.0 else f"m^{order:g}"
    bias = "estimated minus true number of targets, mean over the scans"
    return (
        _Kind("GOSPA (m)", "mean over the scans, alpha = 2", _mean("gospa_m")),
        _Kind(f"  localisation ({power})", "part of GOSPA", _mean("gospa_localisation")),
        _Kind(f"  missed targets ({power})", "part of GOSPA", _mean("gospa_missed")),
        _Kind(f"  false targets ({power})", "part of GOSPA", _mean("gospa_false")),
        _Kind("OSPA(2) (m)", "mean over the windows that end at the scans", _mean("ospa2_m"), needs_labels=True),
        _Kind("Cardinality error", bias, _mean("cardinality_error")),
        _Kind("Cardinality error, size", "the same without its sign", _mean_size),
        _Kind("Label switches a run", "a target goes on under another label", _total("label_switches"), True),
        _Kind("Fragmentations a run", "a target is found again after a break", _total("fragmentations")),
        _Kind("Seconds to track", "until a late target is first tracked", _mean_of_known("seconds_to_track")),
    )


def _own_kinds(strategies: Sequence[Strategy]) -> Iterator[_Kind]:
    """Yield the custom metrics that every run has."""
    for name in strategies[0].ensemble.measures:
        if name not in COLUMNS and all(name in each.ensemble.measures for each in strategies):
            yield _Kind(name, "a measure of one's own, mean over the scans", _mean_of_known(name))


def error_table(group: Group) -> Table | None:
    """Return OSPA and its parts, and the paired differences, or None without common runs."""
    if group.comparison is None:
        return None
    several_runs = group.comparison.num_runs > 1
    rows = tuple(
        (
            strategy_label(name),
            *(with_minus(cell) for cell in cells),
            *(strategy_tail(group.comparison, name).cells() if several_runs else ()),
        )
        for name, *cells in strategy_rows(group.comparison)
    )
    first = strategy_label(group.comparison.strategies[0])
    counted = group.comparison.times[group.comparison.counted]
    over = f"over t = {counted[0]:g} to {counted[-1]:g} s"
    caption = (
        f"Mean over {group.comparison.num_runs} paired runs and {over}, ± one standard error."
        if several_runs
        else f"1 {'paired ' if len(rows) > 1 else ''}run, mean {over}."
    )
    if len(rows) > 1:
        won = f", run by run, so above 0 where {first} is better; runs won: by {first}." if several_runs else "."
        caption += f" Difference: strategy minus {first}{won}"
    if several_runs:
        caption += " A target is lost at the end where it has no estimate within the cutoff at the last of these scans."
    more = tail_header(group.comparison.unit) if several_runs else ()
    names = (*header(group.comparison), *more)
    if len(rows) == 1:  # drop the differences
        columns = [column for column in range(len(names)) if column not in _DIFFERENCES]
        names, rows = tuple(names[column] for column in columns), (tuple(rows[0][column] for column in columns),)
    return Table(caption, names, rows)


def measure_table(group: Group) -> Table | None:
    """Return the metrics other than OSPA, one column per strategy, or None if there are none."""
    strategies = [strategy for strategy in group.strategies if strategy.ensemble.measures]
    if not strategies:
        return None
    score = strategies[0].cell.scenario.model.ospa
    kinds = (*_kinds(score.order), *_own_kinds(strategies))
    rows = [(kind.name, *(_over_runs(kind, strategy) for strategy in strategies)) for kind in kinds]
    notes = [kind.note for kind in kinds]
    for name, note, dim in _consistency_kinds(strategies):
        rows.append((name, *(_consistency(strategy, dim) for strategy in strategies)))
        notes.append(note)
        if dim == 2:
            rows += _spread_rows(strategies)
            notes += ["of the means at the scans of all runs", "of a single estimate, with its run and time"]
    several_runs = any(strategy.ensemble.num_runs > 1 for strategy in strategies)
    over = "Mean over the runs ± one standard error" if several_runs else "One run"
    caption = (
        f"{over}, over the same scans as above; cutoff {score.cutoff:g} m, order "
        f"{score.order:g}, window of OSPA(2) {score.window} scans. NEES / dimension is 1 for a consistent "
        "filter; in brackets, the share of the scans whose average over the runs lies in its 95 % interval."
    )
    return Table(caption, ("Measure", *(strategy.name for strategy in strategies)), tuple(rows), tuple(notes))


def _consistency_kinds(strategies: Sequence[Strategy]) -> list[tuple[str, str, int]]:
    kinds = [("Position NEES / 2", "squared error over what the covariance says", 2)]
    dims = {each.record(int(each.ensemble.runs[0])).truth.states.shape[1] for each in strategies}
    if len(dims) == 1 and any(each.ensemble.measures["nees_count"].any() for each in strategies):
        dim = dims.pop()
        kinds.append((f"State NEES / {dim}", "the same of the whole state", dim))
    return kinds


def nees_over_runs(strategy: Strategy, dim: int) -> AverageNees:
    """Return the NEES averaged over the runs at each scan: of the position for `dim` 2, otherwise of the full state."""
    ensemble = strategy.ensemble
    if dim == 2:
        return average_nees(ensemble.values("position_nees_mean"), ensemble.num_pairs(), dim=dim)
    return average_nees(ensemble.values("nees_mean"), ensemble.measures["nees_count"], dim=dim)


def _consistency(strategy: Strategy, dim: int) -> str:
    average = nees_over_runs(strategy, dim)
    known = strategy.counted & (average.count > 0)
    if not known.any():
        return "\N{EN DASH}"
    mean = float((average.mean[known] * average.count[known]).sum() / average.count[known].sum()) / dim
    return f"{mean:.2f} ({percent(float(average.consistent[known].mean()))})"


@dataclass(frozen=True, slots=True)
class NeesSpread:
    """Spread of the position NEES of a strategy, divided by its dimension 2."""

    median: float  # median of the means at the scans of all runs
    largest: float  # largest value of a single estimate
    run: int  # run and time of that estimate, the time in s
    time: float
    is_by_chance: bool  # whether a consistent filter exceeds it in more than one of a thousand such comparisons


def nees_spread(strategy: Strategy) -> NeesSpread | None:
    """Return the spread over the counted scans, or None if no estimate is matched."""
    ensemble, counted = strategy.ensemble, strategy.counted
    means, largest = (ensemble.values(f"position_nees_{name}")[:, counted] / 2.0 for name in ("mean", "max"))
    if np.isnan(largest).all():
        return None
    run, scan = np.unravel_index(np.nanargmax(largest), largest.shape)
    pairs = ensemble.num_pairs()[:, counted].sum()
    return NeesSpread(
        median=float(np.nanmedian(means)),
        largest=float(largest[run, scan]),
        run=int(ensemble.runs[run]),
        time=float(ensemble.times[counted][scan]),
        is_by_chance=bool(pairs * np.exp(-largest[run, scan]) > _BY_CHANCE),  # half of chi-squared(2) is exponential
    )


def _spread_rows(strategies: Sequence[Strategy]) -> Iterator[tuple[str, ...]]:
    spreads = [nees_spread(spread) for spread in strategies]
    yield "  median", *("\N{EN DASH}" if spread is None else f"{spread.median:.2f}" for spread in spreads)
    origins = [None if spread is None else f"(run {spread.run}, {spread.time:g} s)" for spread in spreads]
    yield (
        "  largest",
        *(
            f"{spread.largest:.4g} {origin}" if spread else "\N{EN DASH}"
            for spread, origin in zip(spreads, origins, strict=True)
        ),
    )


def _over_runs(kind: _Kind, strategy: Strategy) -> str:
    if kind.needs_labels and not strategy.has_labels:
        return "\N{EN DASH}"
    values = kind.value(strategy.ensemble, strategy.counted)
    known = values[~np.isnan(values)]
    if not len(known):
        return "\N{EN DASH}"
    summary = summarise(known)
    return with_minus(with_error(float(summary.mean), float(summary.standard_error)))


def stage_seconds(strategy: Strategy) -> dict[str, NDArray[np.float32]]:
    """Return the seconds of each stage over all runs: planning at decisions, other stages at every scan."""
    named = {
        f"{stage}, a {'decision' if stage == 'planning' else 'scan'}": seconds
        for stage, seconds in strategy.ensemble.seconds.items()
    }
    return {stage: seconds for stage, seconds in named.items() if seconds.any()}


def cost_table(group: Group) -> Table | None:
    """Return the time of each stage: median and 95th percentile, a column per strategy (None if nothing was timed)."""
    seconds_of = {strategy.name: stage_seconds(strategy) for strategy in group.strategies}
    stages = list(dict.fromkeys(stage for seconds in seconds_of.values() for stage in seconds))
    if not stages:
        return None
    rows = tuple((stage, *(_milliseconds(seconds.get(stage)) for seconds in seconds_of.values())) for stage in stages)
    caption = (
        "Wall time in milliseconds: median of n values, and where there are at least "
        f"{MIN_FOR_TAILS} of them the 95th percentile in brackets."
    )
    return Table(caption, ("Stage", *seconds_of), rows)


def _milliseconds(seconds: NDArray[np.float32] | None) -> str:
    if seconds is None:
        return "\N{EN DASH}"
    middle, high = (np.quantile(seconds, (0.5, 0.95)) * 1e3).tolist()
    tail = f" ({_three_digits(high)})" if len(seconds) >= MIN_FOR_TAILS else ""
    return f"{_three_digits(middle)}{tail}, n = {len(seconds)}"


def _three_digits(value: float) -> str:
    """Return a number with at least three significant digits, without exponent."""
    return f"{value:.0f}" if value >= 1000.0 else f"{value:.3g}"


def decision_table(group: Group) -> Table | None:
    """Return the most frequent choices at each decision, or None if no decision was made."""
    if group.comparison is None:
        return None
    rows = [
        (strategy_label(strategy), when, with_minus(shares))
        for strategy in group.comparison.strategies
        for when, shares in decision_rows(group.comparison, strategy)
    ]
    if not rows:
        return None
    caption = (
        "What the sensors were sent to do, in order, and the share of the runs that chose it; at most three a decision."
    )
    return Table(caption, ("Strategy", "Time", "Actions"), tuple(rows), is_words=True)
