"""Runs of a campaign grouped for comparison, or a single run as a group of its own."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from pydantic import BaseModel

from vedette.campaigns.cells import Campaign, Cell
from vedette.campaigns.results import CampaignResults
from vedette.errors import InputError
from vedette.evaluation import Comparison
from vedette.evaluation.comparison import compare_scored_scans
from vedette.evaluation.ensembles import Ensemble, build_ensemble
from vedette.evaluation.figures.scene import Scene, build_scene
from vedette.evaluation.figures.style import strategy_label
from vedette.evaluation.runs import measure_run
from vedette.internal.text import unique_name
from vedette.kernels.base.types import Bools
from vedette.scenarios import Scenario
from vedette.scenarios.sections.tracking import UNLABELLED
from vedette.simulation.records import RunRecord


@dataclass(frozen=True, slots=True)
class Strategy:
    """One cell of a group with its runs."""

    cell: Cell  # strategy and setting
    label: str  # value of the compared axis, as text
    num_finished: int  # number of finished runs
    ensemble: Ensemble  # the common runs of the group, or all finished runs if there are no common ones
    counted: Bools  # (num_scans,) whether a scan counts in means over time, all of them without a comparison
    record: Callable[[int], RunRecord]  # function from the number of one of these runs to its record

    @property
    def name(self) -> str:
        """Label for display."""
        return strategy_label(self.label)

    @property
    def words(self) -> str:
        """Description of the planner, empty if another axis than the planner is compared."""
        return self.cell.words if self.label == self.cell.planner else ""

    @property
    def scene(self) -> Scene:
        """Scenario data for figures of its runs."""
        return build_scene(self.cell.scenario, self.cell.planner)

    @property
    def has_labels(self) -> bool:
        """Whether its estimates keep their labels from scan to scan."""
        return self.cell.scenario.model.filter.kind not in UNLABELLED


@dataclass(frozen=True, slots=True)
class Group:
    """Strategies that differ only in the compared axis."""

    name: str  # fit for a file name and an anchor, unique in the campaign
    title: str  # settings that distinguish the group from the others
    strategies: tuple[Strategy, ...]  # in the order of the specification, without those that have no finished run
    missing: tuple[str, ...]  # names of strategies without a finished run
    # over the common runs, with the labels as names of its strategies, or None if there are none
    comparison: Comparison | None
    reason: str  # why there is no comparison, empty if there is one


def comparison_groups(results: CampaignResults) -> Iterator[Group]:
    """Yield every group in the order of the specification, reading its runs when it is reached."""
    campaign = results.campaign
    used_slugs: set[str] = set()
    for cells in campaign.groups():
        slug = _file_part("-".join(str(cells[0].settings[axis]) for axis in varying_axes(campaign))) or "all"
        used_slugs.add(name := unique_name(slug, used_slugs))
        yield _group(results, cells, name, _title(campaign, cells[0]))


def _group(results: CampaignResults, cells: tuple[Cell, ...], name: str, title: str) -> Group:
    axis = results.campaign.compare
    labels = {cell.name: _label(axis, cell.settings[axis]) for cell in cells}
    finished = {cell.name: results.finished(cell.name) for cell in cells}
    common = sorted(set.intersection(*(set(runs) for runs in finished.values())))
    missing = tuple(strategy_label(label) for cell, label in labels.items() if not finished[cell])
    present = [cell for cell in cells if finished[cell.name]]
    ensembles = {labels[cell.name]: results.ensemble(cell.name, common or finished[cell.name]) for cell in present}
    comparison, reason = None, "no run number is finished for every one of them yet"
    if common:
        try:
            comparison, reason = compare_scored_scans(cells[0].scenario, ensembles), ""
        except InputError as error:  # for example different scan times
            reason = str(error)
    strategies = []
    for cell in present:
        label, record = labels[cell.name], partial(results.record, cell.name)
        counted = _counted(ensembles[label], comparison)
        strategies.append(Strategy(cell, label, len(finished[cell.name]), ensembles[label], counted, record))
    return Group(name, title, tuple(strategies), missing, comparison, reason)


def _counted(ensemble: Ensemble, comparison: Comparison | None) -> Bools:
    return np.ones(len(ensemble.times), bool) if comparison is None else comparison.counted


def group_of_run(record: RunRecord, scenario: Scenario) -> Group:
    """Return a run as a group of its own, without comparison partners, measured if the true targets are known.

    Raises:
        InputError: the run has other sensors than the scenario.
    """
    if record.num_sensors != (number := len(scenario.model.sensors)):
        raise InputError(f"run: expected the {number} sensors of its scenario; got {record.num_sensors}")
    settings = {"scenario": record.scenario, "planner": record.planner}
    cell = Cell(_file_part(record.planner) or "run", settings, scenario, record.planner)
    is_known = scenario.model.targets.kind != "unknown"
    ensemble = build_ensemble([(record.summary(), measure_run(record, scenario) if is_known else None)])
    comparison, reason = None, "nobody knows the targets"
    if is_known:
        try:
            comparison = compare_scored_scans(scenario, {record.planner: ensemble})
        except InputError as error:  # for example a run that stopped before the counted scans
            reason = str(error)
    strategy = Strategy(cell, record.planner, 1, ensemble, _counted(ensemble, comparison), lambda _: record)
    return Group("run", record.scenario, (strategy,), (), comparison, "" if comparison is not None else reason)


def varying_axes(campaign: Campaign) -> tuple[str, ...]:
    """Return the axes with several values, without the compared one."""
    return tuple(axis for axis, values in campaign.axes.items() if len(values) > 1 and axis != campaign.compare)


def describe_settings(cell: Cell, axes: Iterable[str]) -> str:
    """Return the values of axes of a cell in words: `paper-a, fusion clmb, clutter rate 20`."""
    return ", ".join(_describe(cell, axis) for axis in axes)


def _describe(cell: Cell, axis: str) -> str:
    if axis == "scenario":
        return cell.scenario.name
    value = cell.settings[axis]
    return str(value) if axis == "variant" else f"{axis_label(axis)} {_short(value)}"


def _label(axis: str, value: Any) -> str:
    """Return a value of the compared axis as text, numbers with the name of the axis."""
    return f"{axis_label(axis)} {_short(value)}" if isinstance(value, bool | int | float) else str(value)


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else strategy_label(str(value))


def axis_label(axis: str) -> str:
    """Return the last two parts of a field's path, or the name of an axis, in words: `clutter rate`."""
    parts = [part for part in axis.split(".") if part != "*" and not part.isdigit()]
    return " ".join(parts[-2:]).replace("_", " ")


def axis_unit(cell: Cell, axis: str) -> str:
    """Return the unit of the scenario field that an axis varies, from its description, empty if it has none."""
    section: Any = cell.scenario.model
    *path, name = axis.split(".")
    for part in path:
        if isinstance(section, tuple):
            section = section[0 if part == "*" else int(part)]
        else:
            section = getattr(section, part, None)
    field = type(section).model_fields.get(name) if isinstance(section, BaseModel) else None
    unit = re.search(r"\[([^\]]+)\]\.?$", (field.description if field else None) or "")
    return unit.group(1) if unit and unit.group(1) != "-" else ""


def _title(campaign: Campaign, cell: Cell) -> str:
    varying = varying_axes(campaign)
    shown = (axis for axis in cell.settings if axis in varying or axis == "scenario")
    return describe_settings(cell, shown) or campaign.name


def _file_part(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.")
