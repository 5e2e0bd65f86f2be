"""Specification of a campaign as data, read from TOML or made in Python."""

import itertools
import math
import os
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, JsonValue

from vedette.errors import InputError, ScenarioError
from vedette.internal.reading import read_text
from vedette.internal.text import elided, printable
from vedette.scenarios.diagnostics import Finding, describe, shown_key
from vedette.scenarios.sections.base import Name, Section, Whole, check
from vedette.scenarios.sections.planners import STRATEGIES
from vedette.scenarios.validation import read_section

BUILTIN_FOLDER = Path(__file__).parent / "builtin"
_MOST_BYTES = 2_000_000
# A cell is a scenario with its filters built; building this many takes minutes.
_MOST_CELLS, _MOST_VALUES = 10_000, 1000

# Device names of Windows, which are reserved in every folder and with every extension.
_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(1, 10))}

ShortName = Annotated[Name, Field(max_length=60)]
Names = Annotated[tuple[Name, ...], Field(strict=False, min_length=1)]
Fields = dict[str, JsonValue]


class Variant(Section):
    """One entry of a list of settings that belong together."""

    name: ShortName = Field(description="What tables and figures call it [-].")
    set: Fields = Field(default={}, description="Scenario fields by path, and their values [-].")


class CampaignSpec(Section):
    """Scenario x planner x filter x fusion x variant x every combination of the grid, each run `runs` times.

    At the same run number all of them meet the same truth and the same noise. An axis that is left out has one value:
    what the scenario says. Paths of scenario fields are those of `vedette.scenarios.overrides.replace_fields`.
    """

    name: ShortName = Field(description="What the campaign is called [-].")
    scenarios: Names = Field(description="Built-in scenarios by name, or files relative to the specification [-].")
    planners: Names = Field(
        default=("jdm", "idm", "random"),
        description=f"Strategies: {', '.join(STRATEGIES)}, or those of the scenarios' own [-].",
    )
    runs: Annotated[Whole, Field(ge=1, le=1_000_000)] = Field(description="Paired runs of each [-].")
    seed: Annotated[Whole, Field(ge=0)] = Field(default=0, description="With the run number it fixes every draw [-].")
    filters: Names | None = Field(default=None, description="Values of filter.kind [-].")
    fusions: Names | None = Field(default=None, description="Values of fusion.kind [-].")
    set: Fields = Field(default={}, description="Scenario fields by path, changed everywhere [-].")
    grid: dict[str, Annotated[tuple[JsonValue, ...], Field(strict=False, min_length=1)]] = Field(
        default={}, description="Scenario fields by path, and the values of each: every combination is run [-]."
    )
    variants: Annotated[tuple[Variant, ...], Field(strict=False)] = Field(
        default=(), description="Settings that belong together: each entry is run [-]."
    )
    compare: str | None = Field(
        default=None,
        description="Axis whose values are compared; none: planner, or the one that has several values [-].",
    )

    @check
    def _fields_alone(self) -> Iterator[Finding]:
        for name in sorted({"scenario", "planner", "filter", "fusion", "variant"} & self.grid.keys()):
            yield ("grid",), "paths of scenario fields", describe(name)

    @check
    def _names_of_files(self) -> Iterator[Finding]:
        places: list[tuple[tuple[str | int, ...], str]] = [(("name",), self.name)]
        places += [(("variants", i, "name"), variant.name) for i, variant in enumerate(self.variants)]
        for place, name in places:
            if name.startswith(("-", ".")):
                expected = "a name that begins with neither a dash nor a dot, as files and folders are named after it"
                yield place, expected, describe(name)
            elif name.partition(".")[0].strip().lower() in _DEVICES:
                yield (
                    place,
                    "a name that files can have everywhere; under Windows this one is a device's",
                    describe(name),
                )

    @check
    def _each_value_once(self) -> Iterator[Finding]:
        for axis, values in self.axes().items():
            if len(values) > _MOST_VALUES:
                yield (axis,), f"at most {_MOST_VALUES} values", str(len(values))
                return
            twice = [value for i, value in enumerate(values) if value in values[:i]]
            if twice:
                yield (axis,), "each value once", f"{describe(twice[0])} again"

    @check
    def _not_too_many(self) -> Iterator[Finding]:
        if (cells := math.prod(map(len, self.axes().values()))) > _MOST_CELLS:
            yield (), f"at most {_MOST_CELLS} combinations of settings", str(cells)

    @check
    def _comparable(self) -> Iterator[Finding]:
        comparable = [axis for axis in self.axes() if axis != "scenario"]  # runs of two scenarios are not paired
        if self.compare is not None and self.compare not in comparable:
            why = ", as runs of two scenarios are no pairs" if self.compare == "scenario" else ""
            yield ("compare",), f"one of {', '.join(map(shown_key, comparable))}{why}", describe(self.compare)

    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Return every axis and its values, in the order in which cells are made. Scenario and planner are always
        present.
        """
        axes: dict[str, tuple[Any, ...]] = {"scenario": self.scenarios, "planner": self.planners}
        for axis, values in (("filter", self.filters), ("fusion", self.fusions)):
            if values is not None:
                axes[axis] = values
        if self.variants:
            axes["variant"] = tuple(variant.name for variant in self.variants)
        return {**axes, **self.grid}

    def settings(self) -> list[dict[str, Any]]:
        """Return the value of each axis for every cell, in order, the last axis fastest."""
        axes = self.axes()
        return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def parse_spec(text: str, file: str = "<text>") -> CampaignSpec:
    """Read a specification from TOML text. Messages call it `file`.

    Raises:
        InputError: the text is not TOML, or fields are invalid. The message lists them, one per line.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file}: expected TOML; {elided(printable(str(error)), 300)}") from None
    except RecursionError:
        raise InputError(f"{file}: expected TOML; got brackets inside brackets hundreds of times over") from None
    except ValueError:  # an invalid date, or a number with thousands of digits
        raise InputError(f"{file}: expected TOML; got a date or number that cannot be") from None
    return spec_from_data(data, file)


def spec_from_data(data: Any, place: str = "campaign") -> CampaignSpec:
    """Return the specification from plain data. Raises `InputError` as `parse_spec`."""
    if not isinstance(data, Mapping):
        raise InputError(f"{place}: expected a mapping, got {describe(data)}")
    spec, faults = read_section(CampaignSpec, data)
    if faults:
        raise InputError(str(ScenarioError(list(dict.fromkeys(f"{place}: {fault.message}" for fault in faults)))))
    return spec


def builtin_specs() -> dict[str, Path]:
    """Return the names of the campaigns that come with the library, and their files."""
    return {file.stem: file for file in sorted(BUILTIN_FOLDER.glob("*.toml"), key=lambda file: file.stem)}


def load_spec(name_or_path: Path | str) -> CampaignSpec:
    """Read a specification of the library by its name, or a custom one from its TOML file.

    Raises `InputError` as `parse_spec`, and if the file does not exist.
    """
    builtin = builtin_specs()
    path = builtin.get(str(name_or_path), Path(name_or_path))
    if not os.path.exists(path):  # also False for an invalid path
        raise InputError(f"{path}: no such file; expected a campaign file or one of {', '.join(builtin)}")
    return parse_spec(read_text(path, "campaign file", _MOST_BYTES), str(path))
