"""The schema: every field described, kinds that cannot be confused with keys, and defaults that are the library's."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin

import pytest
from pydantic import BaseModel

from vedette.control import PlanningSettings
from vedette.control.settings import IDEAL_MODES
from vedette.densities import marginal_estimate
from vedette.filters import Limits
from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb, ParallelUpdate
from vedette.fusion.powers import _MERGE_DISTANCE
from vedette.recorded import Cleaning
from vedette.recorded import RecordedTargets as RecordedSource
from vedette.scenarios import json_schema
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.control import Control
from vedette.scenarios.sections.fusion import Fusion, FusionLimits
from vedette.scenarios.sections.scoring import MarginalEstimator
from vedette.scenarios.sections.targets import RecordedTargets
from vedette.scenarios.sections.tracking import FilterLimits
from vedette.scenarios.validation import known_kinds, union_members


def sections(section: type[BaseModel] = ScenarioModel) -> Iterator[type[BaseModel]]:
    """All that a file may hold, from the outside in."""
    yield section
    for field in section.model_fields.values():
        for inner in held(field.annotation):
            yield from sections(inner)


def held(annotation: Any) -> Iterator[type[BaseModel]]:
    """The sections in the type of a field."""
    for option in union_members(annotation):
        if isinstance(option, type) and issubclass(option, BaseModel):
            yield option
        elif get_origin(option) in (tuple, dict):
            yield from (section for item in get_args(option) for section in held(item))


@pytest.mark.parametrize("section", dict.fromkeys(sections()), ids=lambda section: section.__name__)
def test_every_field_says_what_it_is_and_in_which_unit(section: type[BaseModel]) -> None:
    assert section.__doc__
    for name, field in section.model_fields.items():
        assert field.description, name
        assert field.description.rstrip().endswith("]."), name
        assert not field.description.startswith(" "), name


def test_no_kind_is_also_a_key_of_its_section() -> None:
    """But for modes, whose faults are tested (test_modes.py)."""
    for section in sections():
        assert not set(known_kinds(section)) & section.model_fields.keys() - {"modes"}


def test_json_schema_describes_fields_and_forbids_others() -> None:
    schema = json_schema()
    assert schema["additionalProperties"] is False
    assert {"name", "time", "region", "birth", "targets", "sensors"} == set(schema["required"])
    assert "sensor_defaults" in schema["properties"]
    for section in schema["$defs"].values():
        for name, field in section.get("properties", {}).items():
            assert "description" in field, name


def test_default_limits_are_those_of_the_library() -> None:
    assert FilterLimits().build() == Limits()


def test_default_planning_settings_are_those_of_the_library() -> None:
    assert Control().build((5, 2.0)) == PlanningSettings()


DEFAULT_FUSIONS = [
    ("cm_delta_glmb", CmDeltaGlmb((0.5, 0.5))),
    ("clmb", Clmb((0.5, 0.5))),
    ("arithmetic_average", ArithmeticAverage((0.5, 0.5))),
    ("parallel", ParallelUpdate()),
]


@pytest.mark.parametrize(("kind", "expected"), DEFAULT_FUSIONS)
def test_default_fusions_are_those_of_the_library(kind: Any, expected: Any) -> None:
    built: Any = Fusion(kind=kind).build(2, Path())
    assert type(built) is type(expected)
    for field in dataclasses.fields(expected):
        got, wanted = getattr(built, field.name), getattr(expected, field.name)
        assert got == wanted or math.isclose(got, wanted), field.name


def described(section: type[BaseModel], field: str) -> str:
    return section.model_fields[field].description or ""


def test_the_distances_of_merging_that_the_schema_states_are_those_of_the_fusion() -> None:
    component_wise, quadrature = _MERGE_DISTANCE["component_wise"], _MERGE_DISTANCE["quadrature"]
    stated = f"none: {component_wise:g} for component_wise, {quadrature:g} for quadrature powers"
    assert stated in described(FusionLimits, "merge_distance")
    assert _MERGE_DISTANCE.keys() == set(get_args(Fusion.model_fields["mixture_power"].annotation))


def test_the_schema_says_of_ideal_measurements_what_the_kernel_does() -> None:
    """Never clutter; two kinds by chance, one by the threshold (the tests of the kernel hold that)."""
    assert "never with clutter" in described(Control, "ideal_measurements")
    assert get_args(Control.model_fields["ideal_measurements"].annotation) == tuple(IDEAL_MODES)


DEFAULTS: list[tuple[type[BaseModel], Any, dict[str, str]]] = [
    (RecordedTargets, Cleaning, {"max_gap": "max_gap", "min_speed": "min_speed", "max_speed": "max_speed"}),
    (RecordedTargets, RecordedSource, {"time_origin": "time_origin"}),
    (Fusion, Clmb, {"mixture_power": "mixture_power", "missing_existence": "missing_existence"}),
    (MarginalEstimator, marginal_estimate, {"threshold": "threshold"}),
]


def default_of(made: Any, name: str) -> Any:
    return inspect.signature(made).parameters[name].default


@pytest.mark.parametrize(("section", "made", "names"), DEFAULTS, ids=lambda part: getattr(part, "__name__", ""))
def test_defaults_are_those_of_the_code(section: type[BaseModel], made: Any, names: dict[str, str]) -> None:
    for field, name in names.items():
        assert section.model_fields[field].default == default_of(made, name), field
