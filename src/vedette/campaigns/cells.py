"""Cells of a campaign, each one strategy in one setting, and their construction from a specification."""

import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vedette.campaigns.shards import WHOLE, Shard
from vedette.campaigns.spec import CampaignSpec, spec_from_data
from vedette.errors import InputError, ScenarioError
from vedette.internal.representation import SummaryRepr
from vedette.internal.text import pluralise, unique_name
from vedette.scenarios import Scenario, list_builtin, load_scenario
from vedette.scenarios.build import build_planner
from vedette.scenarios.dumping import dump_scenario, scenario_files
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.sections import ScenarioModel

_LONGEST_NAME = 120
_SECTIONS = {"filter": "filter.kind", "fusion": "fusion.kind"}


@dataclass(frozen=True, slots=True)
class Cell:
    """One strategy in one setting. Its runs are numbered from 0.

    Attributes:
        name: unique in the campaign, and fit for a file name.
        settings: value of each axis. All cells of a campaign have the same axes.
        scenario: scenario with the fields of the cell set.
        planner: name of the strategy.
    """

    name: str
    settings: dict[str, Any]
    scenario: Scenario
    planner: str

    @property
    def words(self) -> str:
        """Description of the strategy, such as `joint decisions, expected loss`."""
        return self.scenario.model.describe_strategy(self.planner)


@dataclass(frozen=True, slots=True, repr=False)
class Campaign(SummaryRepr):
    """A specification with its cells.

    Attributes:
        name, seed, num_runs: as specified.
        cells: in the order of the specification, the last axis fastest.
        axes: each axis and its values.
        compare: the axis whose values are compared. The first value is the reference.
        spec: the specification as plain data, including defaults.
        shard: the shard of the runs to execute, by default all.
    """

    name: str
    seed: int
    num_runs: int
    cells: tuple[Cell, ...]
    axes: dict[str, tuple[Any, ...]]
    compare: str
    spec: dict[str, Any]
    shard: Shard = WHOLE

    def _summary(self) -> str:
        return f"{self.name}: {pluralise(len(self.cells), 'cell')}, {pluralise(self.total, 'run')}"

    def _detail(self) -> str:
        return "; ".join(f"{axis}: {', '.join(map(str, values))}" for axis, values in self.axes.items())

    @property
    def total(self) -> int:
        """Number of runs to execute, over all cells."""
        return sum(len(self.runs(index)) for index in range(len(self.cells)))

    def runs(self, index: int) -> Sequence[int]:
        """Return the increasing numbers of the runs to execute of the cell with that index."""
        return self.shard.runs(index, len(self.cells), self.num_runs)

    @property
    def default_folder(self) -> str:
        """Default results folder."""
        return results_folder(self.name)

    @property
    def default_shards(self) -> str:
        """Default folder of the shards' folders."""
        return f"{safe_name(self.name)}-shards"

    @property
    def tasks(self) -> tuple[tuple[Cell, int], ...]:
        """All runs, those of equal number of all cells together, so that pairs come early."""
        return tuple((cell, run) for run in range(self.num_runs) for cell in self.cells)

    def cell(self, name: str) -> Cell:
        """Return the cell of that name. Raises `InputError` if there is none."""
        for cell in self.cells:
            if cell.name == name:
                return cell
        raise InputError(f"cell: expected one of {', '.join(cell.name for cell in self.cells)}; got {name!r}")

    def groups(self) -> tuple[tuple[Cell, ...], ...]:
        """Return the groups of cells that differ only in the compared axis, in the order of the specification."""
        groups: dict[str, list[Cell]] = {}
        for cell in self.cells:
            shared = {axis: value for axis, value in cell.settings.items() if axis != self.compare}
            groups.setdefault(json.dumps(shared, sort_keys=True), []).append(cell)
        return tuple(tuple(cells) for cells in groups.values())

    def with_runs(self, num_runs: int) -> "Campaign":
        """Return the campaign with another number of runs. Raises `InputError` for an invalid number."""
        spec_from_data({**self.spec, "runs": num_runs})
        return replace(self, num_runs=num_runs, spec={**self.spec, "runs": num_runs})

    def texts(self) -> tuple[str, ...]:
        """Return the scenario of each cell as self-contained YAML.

        Custom metrics are left out, as they do not affect a run.
        """
        scenarios = {id(cell.scenario): cell.scenario for cell in self.cells}  # strategies share scenarios
        texts = {key: dump_scenario(_unmeasured(each), folder=each.folder) for key, each in scenarios.items()}
        return tuple(texts[id(cell.scenario)] for cell in self.cells)

    def digest(self, texts: Sequence[str] = ()) -> str:
        """Return the SHA-256 of everything that determines a run: seed, and planner, scenario and files of each cell.

        The number of runs is not included, as more runs leave earlier ones unchanged. texts: result of `texts`, if
        known.
        """
        cells = zip(self.cells, texts or self.texts(), strict=True)
        return digest_of(
            self.seed, [(cell.name, cell.planner, text, contents_of(cell.scenario)) for cell, text in cells]
        )


def digest_of(seed: int, cells: Sequence[tuple[str, str, str, Sequence[str]]]) -> str:
    """Return the digest of a campaign from the name, planner, scenario as text and files' checksums of each cell."""
    return hashlib.sha256(json.dumps([seed, cells]).encode()).hexdigest()


def _unmeasured(scenario: Scenario) -> ScenarioModel:
    return scenario.model.model_copy(update={"metrics": {}})


def resolve(
    spec: CampaignSpec, folder: Path | str = ".", *, approve: Callable[[Scenario], None] = lambda scenario: None
) -> Campaign:
    """Load the scenarios, set the fields of each cell, and check that each cell can be built.

    Args:
        spec: the specification.
        folder: folder that scenario files in it are relative to.
        approve: receives the scenario of each cell before code that it names is run, and may raise.

    Raises:
        InputError: a missing scenario, an unknown field path, or an invalid combination. The message names the cell.
    """
    axes = spec.axes()
    loaded = {name: _load(name, number, Path(folder)) for number, name in enumerate(spec.scenarios)}
    changed: dict[str, Scenario] = {}
    varying = [axis for axis, values in axes.items() if len(values) > 1 or axis == "planner"]
    cells: list[Cell] = []
    for settings in spec.settings():
        name = unique_name(_name({axis: settings[axis] for axis in varying}, axes), {cell.name for cell in cells})
        cells.append(_cell(name, settings, loaded[settings["scenario"]], spec, changed, approve))
    # Only if requested the scenario, as runs of different scenarios are not paired.
    candidates = ("planner", *(axis for axis in axes if axis != "scenario"))
    compare = spec.compare or next((axis for axis in candidates if len(axes[axis]) > 1), "planner")
    return Campaign(spec.name, spec.seed, spec.runs, tuple(cells), axes, compare, spec.model_dump(mode="json"))


def _load(name: str, number: int, folder: Path) -> Scenario:
    try:
        return load_scenario(name if name in list_builtin() else folder / name)
    except InputError as error:
        raise InputError(f"scenarios.{number}: {error}") from None


def _cell(
    name: str,
    settings: Mapping[str, Any],
    scenario: Scenario,
    spec: CampaignSpec,
    changed: dict[str, Scenario],
    approve: Callable[[Scenario], None],
) -> Cell:
    """Return a cell. `changed` caches scenarios by their fields, as strategies share them."""
    fields = dict(spec.set)
    fields |= {_SECTIONS[axis]: settings[axis] for axis in _SECTIONS if axis in settings}
    for variant in spec.variants:
        if variant.name == settings.get("variant"):
            fields |= variant.set
    fields |= {axis: settings[axis] for axis in spec.grid}
    planner = settings["planner"]
    key = json.dumps([settings["scenario"], fields])
    try:
        if key not in changed:
            changed[key] = replace_fields(scenario, fields)
        approve(changed[key])
        build_planner(changed[key], planner)
    except ScenarioError as error:
        faults = list(dict.fromkeys(f"cell {name}: {fault}" for fault in error.faults))
        raise InputError(str(ScenarioError(faults))) from None
    except InputError as error:
        raise InputError(f"cell {name}: {error}") from None
    return Cell(name, dict(settings), changed[key], planner)


def _name(settings: Mapping[str, Any], axes: Mapping[str, tuple[Any, ...]]) -> str:
    """Return the values of the varying axes as a file name: `paper-e-jdm-clmb`, `jdm-num_samples-20`."""
    parts = []
    for axis, value in settings.items():
        if isinstance(value, list | dict):
            value = axes[axis].index(value) + 1
        is_named_axis = axis in ("scenario", "planner", "variant", *_SECTIONS)
        text = Path(value).stem if axis == "scenario" else str(value)
        parts.append(text if is_named_axis else f"{axis.rpartition('.')[2]}-{text}")
    text = safe_name("-".join(parts))
    if len(text) <= _LONGEST_NAME:
        return text
    return f"{text[: _LONGEST_NAME - 9]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def results_folder(name: str) -> str:
    """Return the default results folder of a campaign of that name."""
    return f"{safe_name(name)}-results"


def safe_name(text: str) -> str:
    """Return the text with characters that are unfit for a file name replaced by underscores."""
    return re.sub(r"[^\w.+-]+", "_", text)


def contents_of(scenario: Scenario) -> list[str]:
    """Return the SHA-256 of each file that a run of the scenario depends on. Raises `OSError` for a missing one."""
    return [
        hashlib.sha256(file.read_bytes()).hexdigest() for file in scenario_files(_unmeasured(scenario), scenario.folder)
    ]
