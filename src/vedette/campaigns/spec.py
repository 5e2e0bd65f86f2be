"""What a campaign is to run: its specification as data, read from TOML or made in Python."""

from __future__ import annotations

import math
import tomllib
from datetime import date, time
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Field, JsonValue, ValidationError, field_validator

from vedette.errors import InputError
from vedette.evaluation.runs import STRATEGIES
from vedette.scenarios.diagnostics import suggestion
from vedette.scenarios.faults import describe, named
from vedette.scenarios.sections.base import Name, Section, Whole, expected
from vedette.text import elided, listed, plain, printable

_MOST_BYTES = 2_000_000
# A cell is a scenario with its filters built: this many take minutes before the first run.
_MOST_CELLS, _MOST_VALUES = 10_000, 1000

ShortName = Annotated[Name, Field(max_length=60)]
Names = Annotated[tuple[Name, ...], Field(strict=False, min_length=1)]
Fields = dict[str, JsonValue]

_WHAT = {
    "missing": "a value, as it is required",
    "extra_forbidden": "one of {known}",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text in quotes",
    "tuple_type": "a list",
    "dict_type": "a table",
    "list_type": "a list",
    "too_short": "at least one entry",
    "greater_than_equal": "a number of at least {ge}",
    "less_than_equal": "a number of at most {le}",
    "expected": "{expected}",
    "finite_number": "a finite number",
    "invalid-json-value": "text, a number, true or false, a list or a table",
    "too_long": "at most {max_length} characters",
}
_UNIONS = ("float", "int", "str", "bool", "list", "dict")


class Variant(Section):
    """One entry of a list of settings that belong together."""

    name: ShortName = Field(description="What tables and figures call it [-].")
    set: Fields = Field(default={}, description="Scenario fields by path, and their values [-].")


class CampaignSpec(Section):
    """Scenario x planner x filter x fusion x variant x every combination of the grid, each run `runs` times.

    At the same run number all of them meet the same truth and the same noise. An axis that is left out has one value:
    what the scenario says. Paths of scenario fields are those of `vedette.scenarios.overrides.with_fields`.
    """

    name: ShortName = Field(description="What the campaign is called [-].")
    scenarios: Names = Field(description="Built-in scenarios by name, or files relative to the specification [-].")
    planners: Names = Field(
        default=("jdm", "idm", "random"), description="Strategies: " + ", ".join(STRATEGIES) + " [-]."
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

    @field_validator("planners")
    @classmethod
    def _known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for index, name in enumerate(names):
            if name not in STRATEGIES:
                raise expected(f"one of {', '.join(STRATEGIES)}", at=(index,), got=f"'{named(name)}'")
        return names

    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Every axis and its values, in the order in which cells are made; scenario and planner are always there."""
        axes: dict[str, tuple[Any, ...]] = {"scenario": self.scenarios, "planner": self.planners}
        for axis, values in (("filter", self.filters), ("fusion", self.fusions)):
            if values is not None:
                axes[axis] = values
        if self.variants:
            axes["variant"] = tuple(variant.name for variant in self.variants)
        return {**axes, **self.grid}


def parse_spec(text: str, file: str = "<text>") -> CampaignSpec:
    """Read a specification from TOML text; `file` is what messages call it.

    Raises:
        InputError: text that is no TOML, or every field that is faulty, one a line.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file}: expected TOML; {elided(printable(str(error)), 300)}") from None
    except RecursionError:
        raise InputError(f"{file}: expected TOML; got brackets inside brackets hundreds of times over") from None
    except ValueError:  # a date that no calendar has, a number of thousands of digits
        raise InputError(f"{file}: expected TOML; got a date or number that cannot be") from None
    return spec_from_data(data, file)


def spec_from_data(data: Any, place: str = "campaign") -> CampaignSpec:
    """The specification in plain data. Raises `InputError` as `parse_spec`."""
    try:
        spec = CampaignSpec.model_validate(data)
    except ValidationError as error:
        details = error.errors(include_url=False)
        raise InputError(listed(list(dict.fromkeys(f"{place}: {_fault(detail)}" for detail in details)))) from None
    _check_axes(spec, place)
    return spec


def load_spec(path: Path | str) -> CampaignSpec:
    """Read a specification from its TOML file. Raises `InputError` as `parse_spec`, and where there is no such file."""
    file = Path(path)
    try:
        if (size := file.stat().st_size) > _MOST_BYTES:
            raise InputError(f"{file}: expected a campaign file of at most {_MOST_BYTES} bytes; got {size}")
        return parse_spec(file.read_bytes().decode("utf-8-sig"), str(file))
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: expected UTF-8 text; byte {error.start} is not") from None
    except OSError as error:
        raise InputError(f"{file}: expected a readable campaign file; got {error.strerror}") from None


def _fault(detail: Any) -> str:
    loc, context = detail["loc"], detail.get("ctx", {})
    loc += tuple(context.get("at", ()))
    if detail["type"] == "finite_number":  # the member of a union that was tried
        loc = tuple(part for part in loc if part not in _UNIONS)
    field = ".".join(named(str(part)) for part in loc) or "the specification"
    model: type[BaseModel] = Variant if loc[:1] == ("variants",) else CampaignSpec
    known = [name for name in model.model_fields if name != "kind"]
    template = _WHAT.get(detail["type"], detail["msg"])
    what = template.format(known=", ".join(known), **context)
    if detail["type"] == "missing":
        return f"{field}: expected {what}; got nothing"
    if detail["type"] == "extra_forbidden":
        hint = suggestion(str(loc[-1]), known)
        return f"{field}: expected {what}; got an unknown key" + (f" ({hint})" if hint else "")
    return f"{field}: expected {what}; got {context.get('got') or _shown(detail['input'])}"


def _shown(value: Any) -> str:
    """A value of the file in a few words."""
    if isinstance(value, date | time):
        return f"the date or time {value}"
    return describe(value) if isinstance(value, list | dict) and value else named(plain(value))


def _check_axes(spec: CampaignSpec, place: str) -> None:
    reserved = {"scenario", "planner", "filter", "fusion", "variant"} & spec.grid.keys()
    if reserved:
        raise InputError(f"{place}: grid: expected paths of scenario fields; got {sorted(reserved)[0]!r}")
    for axis, values in spec.axes().items():
        seen: list[Any] = []
        if len(values) > _MOST_VALUES:
            raise InputError(f"{place}: {named(axis)}: expected at most {_MOST_VALUES} values; got {len(values)}")
        for value in values:
            if value in seen:
                raise InputError(f"{place}: {named(axis)}: expected each value once; got {_shown(value)} again")
            seen.append(value)
    if (cells := math.prod(map(len, spec.axes().values()))) > _MOST_CELLS:
        raise InputError(f"{place}: expected at most {_MOST_CELLS} combinations of settings; got {cells}")
    comparable = [axis for axis in spec.axes() if axis != "scenario"]  # runs of two scenarios are no pairs
    if spec.compare is not None and spec.compare not in comparable:
        why = ", as runs of two scenarios are no pairs" if spec.compare == "scenario" else ""
        known = ", ".join(map(named, comparable))
        raise InputError(f"{place}: compare: expected one of {known}{why}; got '{named(spec.compare)}'")
