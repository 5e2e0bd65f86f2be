"""Figures of a report, for the page and for files."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from vedette.campaigns.cells import Campaign, Cell
from vedette.errors import InputError
from vedette.evaluation import Summary, summarise
from vedette.evaluation.comparison import typical_run
from vedette.evaluation.figures import (
    SweepCurve,
    consistency_figure,
    cost_figure,
    differences_figure,
    distributions_figure,
    mean_rewards_figure,
    ospa_figure,
    roses_figure,
    sweep_figure,
    tracks_figure,
)
from vedette.evaluation.figures.cost import MIN_FOR_TAILS
from vedette.evaluation.figures.distributions import MAX_DOTS
from vedette.evaluation.figures.style import shown_decisions, strategy_label
from vedette.internal.text import elided, pluralise
from vedette.kernels.base.types import Floats
from vedette.reports.groups import Group, Strategy, axis_label, axis_unit, describe_settings
from vedette.reports.tables import nees_over_runs, stage_seconds
from vedette.simulation.records import RunRecord


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure with its texts."""

    name: str  # fit for a file name
    title: str  # heading
    caption: str  # description of the figure, its bands and marks
    figure: Figure  # Matplotlib figure

    @property
    def is_wide(self) -> bool:
        """Whether it takes the width of a page rather than of a column."""
        return bool(self.figure.get_figwidth() > 5.1)


def group_drawings(group: Group) -> Iterator[Drawing]:
    """Yield every figure of the runs of a group."""
    yield from error_drawings(group)
    yield from _decision_drawings(group)
    yield from _reward_drawings(group)
    yield from _tracks_drawings(group)
    if any(each.ensemble.measures for each in group.strategies):
        yield from _consistency_drawings(group.strategies)
    costs = {strategy.label: stage_seconds(strategy) for strategy in group.strategies}
    if any(costs.values()):
        caption = (
            "Wall time of each stage, a scan or a decision: median, and the range from the 5th to the 95th percentile "
            f"where there are at least {MIN_FOR_TAILS} values."
        )
        yield Drawing("cost", "Cost", caption, cost_figure({name: stages for name, stages in costs.items() if stages}))


def _tracks_drawings(group: Group) -> Iterator[Drawing]:
    for strategy, record in typical_records(group):
        typical = ", the typical one: its mean OSPA is the median" if group.comparison is not None else ""
        caption = f"{strategy.name}, {record.source}{typical}."
        figure = tracks_figure(record, titles=(f"{elided(strategy.name)}, {record.source}",), scene=strategy.scene)
        yield Drawing(f"tracks-{strategy.cell.name}", f"Tracks, {strategy.name}", caption, figure)


def error_drawings(group: Group) -> Iterator[Drawing]:
    """Yield only the figures of the error, or none without a comparison."""
    if group.comparison is None:
        return
    comparison = group.comparison
    over = f"Mean OSPA over {comparison.num_runs} paired runs" if comparison.num_runs > 1 else "OSPA of one paired run"
    bands = "bands of one standard error" if comparison.num_runs > 1 else "one run, so no bands"
    together = " Strategies that are equal for a while share a line with dashes of their colours."
    yield Drawing(
        "ospa",
        "OSPA against time",
        f"{over} with its localisation and cardinality parts; {bands}."
        f"{together if len(comparison.strategies) > 1 else ''}",
        ospa_figure(comparison, parts=("total", "localisation", "cardinality")),
    )
    if len(comparison.strategies) > 1 and comparison.num_runs > 1:
        yield Drawing(
            "differences",
            "What the decisions brought",
            "Above: mean OSPA from the first decision on, close up, with bands of one standard error. Below: each "
            f"strategy minus {strategy_label(comparison.strategies[0])}, run by run, with the 95 % confidence interval "
            "of the mean at each scan by itself.",
            differences_figure(comparison),
        )
    differences = ""
    if len(comparison.strategies) > 1 and comparison.num_runs > 1:
        differences = (
            " Below: the paired differences with mean and 95 % confidence interval; an interval that holds 0 tells "
            "nothing apart."
        )
    elif len(comparison.strategies) > 1:
        differences = " Below: the differences, which one run gives no confidence interval."
    first = f" (of the first {MAX_DOTS})" if comparison.num_runs > MAX_DOTS else ""
    yield Drawing(
        "distributions",
        "Run by run",
        f"Mean OSPA of each run. A dot is a run{first}, the box holds the middle half with the median, the diamond "
        f"is the mean.{differences}",
        distributions_figure(comparison),
    )


def _decision_drawings(group: Group) -> Iterator[Drawing]:
    if group.comparison is None:
        return
    try:
        figure = roses_figure(group.comparison, group.strategies[0].scene)
    except InputError:  # no decisions, or no sensor with a choice
        return
    yield Drawing(
        "decisions",
        "Where the sensors were sent",
        "Share of the runs that chose each action at each decision; areas are in proportion to shares. Sensors that "
        "can but stand are left out, and more than six are taken together.",
        figure,
    )


def _reward_drawings(group: Group) -> Iterator[Drawing]:
    for strategy in group.strategies:
        figure = _rewards(strategy)
        if figure is not None:
            runs = pluralise(strategy.ensemble.num_runs, "run")
            caption = (
                f"Rewards that {strategy.name} decided on, averaged over {runs}. The area of a mark is the share of "
                "the runs that chose the action; joint rewards of more than two sensors are the largest over the "
                "others. Sensors without a choice are left out; of more than six, those with the most at stake are "
                "drawn."
            )
            yield Drawing(f"rewards-{strategy.cell.name}", f"Rewards, {strategy.name}", caption, figure)


def _rewards(strategy: Strategy) -> Figure | None:
    """Return the figure of the mean rewards.

    None for strategies that evaluate no actions or have only one, and if actions differ between runs.
    """
    try:
        decisions = shown_decisions(len(strategy.ensemble.rewards))
        return mean_rewards_figure([strategy.ensemble.rewards[index].mean() for index in decisions], strategy.scene)
    except InputError:
        return None


def typical_records(group: Group) -> tuple[tuple[Strategy, RunRecord], ...]:
    """Return for each strategy the run with the median of the mean OSPA, or without a comparison its first run."""
    typical = []
    for strategy in group.strategies:
        index = 0 if group.comparison is None else typical_run(group.comparison, strategy.label)
        typical.append((strategy, strategy.record(int(strategy.ensemble.runs[index]))))
    return tuple(typical)


def paired_records(group: Group) -> tuple[tuple[Strategy, RunRecord], ...]:
    """Return under each strategy the run that is typical of the first, or without comparison, the first of each."""
    comparison = group.comparison
    if comparison is None:
        return typical_records(group)
    first = group.strategies[0]
    run = int(first.ensemble.runs[typical_run(comparison, first.label)])
    return tuple((strategy, strategy.record(run)) for strategy in group.strategies)


def _consistency_drawings(strategies: Sequence[Strategy]) -> Iterator[Drawing]:
    """Yield one figure for all strategies, or one for each if their scan times differ."""
    times = strategies[0].ensemble.times
    caption = (
        "Normalised squared error of the estimated positions, averaged over the runs; 1 where covariances are right. "
        "Band: where 95 % of the averages of a consistent filter lie."
    )
    if all(np.array_equal(strategy.ensemble.times, times) for strategy in strategies):
        averages = {strategy.label: nees_over_runs(strategy, 2) for strategy in strategies}
        yield Drawing("consistency", "Consistency", caption, consistency_figure(times, averages))
        return
    for strategy in strategies:
        figure = consistency_figure(strategy.ensemble.times, {strategy.label: nees_over_runs(strategy, 2)})
        yield Drawing(f"consistency-{strategy.cell.name}", f"Consistency, {strategy.name}", caption, figure)


def sweep_drawings(campaign: Campaign, errors: Mapping[str, Floats]) -> Iterator[Drawing]:
    """Yield figures of the mean OSPA against every numeric axis with several values.

    Args:
        campaign: the campaign.
        errors: mean OSPA of the paired runs, by cell name. Cells without are left out.
    """
    cells = [cell for cell in campaign.cells if cell.name in errors]
    for axis, values in campaign.axes.items():
        if len(values) < 2 or not all(
            isinstance(value, int | float) and not isinstance(value, bool) for value in values
        ):
            continue
        panels = _panels(campaign, cells, axis)
        for number, (shared, curves) in enumerate(panels.items()):
            drawn = [SweepCurve(name, *_curve(line, axis, errors)) for name, line in curves.items()]
            if max(len(curve.values) for curve in drawn) < 2:
                continue
            label, suffix = axis_label(axis), f"-{number + 1}" if len(panels) > 1 else ""
            unit = f" ({axis_unit(cells[0], axis)})" if axis_unit(cells[0], axis) else ""
            where = f" ({shared})" if shared else ""
            caption = f"Mean OSPA over the runs against {label}{where}; bars are 95 % confidence intervals."
            name = f"sweep-{label.replace(' ', '-')}{suffix}"
            of_score = next(iter(curves.values()))[0].scenario.model.ospa.unit
            figure = sweep_figure(drawn, label.capitalize() + unit, of_score)
            yield Drawing(name, f"Sweep of {label}{where}", caption, figure)


def _panels(campaign: Campaign, cells: Sequence[Cell], axis: str) -> dict[str, dict[str, list[Cell]]]:
    """Return for each setting of the other axes, and each strategy, its cells along the axis."""
    other_axes = [name for name, values in campaign.axes.items() if len(values) > 1 and name != axis]
    lines = campaign.compare if campaign.compare in other_axes else ("planner" if "planner" in other_axes else "")
    panels: dict[str, dict[str, list[Cell]]] = {}
    for cell in cells:
        shared = describe_settings(cell, (name for name in other_axes if name != lines))
        curve = str(cell.settings[lines]) if lines else cell.planner
        panels.setdefault(shared, {}).setdefault(curve, []).append(cell)
    return panels


def _curve(cells: Sequence[Cell], axis: str, errors: Mapping[str, Floats]) -> tuple[Floats, tuple[Summary, ...]]:
    values = np.array([float(cell.settings[axis]) for cell in cells])
    return values, tuple(summarise(errors[cell.name]) for cell in cells)
