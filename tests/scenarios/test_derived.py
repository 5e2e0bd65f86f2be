"""Sections that are made from the declarations of the parts: what a part says of its fields is said once."""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

import vedette
from scenarios.minimal import kinds
from scenarios.test_schema import sections
from vedette.errors import InputError
from vedette.models import fields
from vedette.scenarios import list_builtin, load_scenario
from vedette.scenarios.sections import base
from vedette.scenarios.sections.deciding import AnyConstraint, AnyReward, AnySearch
from vedette.scenarios.sections.derived import Derived, derived
from vedette.scenarios.sections.sensing import Clutter, Detection, Measurement, Noise
from vedette.scenarios.sections.tracking import Assignment
from vedette.scenarios.sections.world import Motion, Survival

SRC = Path(vedette.__file__).parents[1]
TOOLS = Path(__file__).parents[2] / "tools"

NUMBERS = (-1, 0, 1, 2, 0.5, -0.5, 1.5, 1.0 - 1e-9, 1e-9, 250, float("nan"), "x", True)
TYPES = (
    "Count",
    "Natural",
    "Repeats",
    "Real",
    "Positive",
    "NonNegative",
    "Probability",
    "Chance",
    "Share",
    "Portion",
    "L1Error",
    "EnoughSamples",
    "Limit",
)

AFTER = """
import json, sys
sys.path.insert(0, {tools!r})
from pathlib import Path
from docs_fields import FieldPages
from vedette.errors import ScenarioError
from vedette.scenarios import json_schema, load_scenario, replace_fields
from vedette.scenarios.build import build_sensors

scenario = load_scenario("two-searchers")
changed = replace_fields(scenario, {{"filter.limits.max_forgotten": 9}})
try:
    replace_fields(scenario, {{"filter.limits.max_forgotten": 0}})
except ScenarioError as error:
    refused = str(error)
print(json.dumps({{
    "schema": json_schema()["$defs"]["FilterLimits"]["properties"]["max_forgotten"],
    "row": [row for row in FieldPages(Path()).fill("<!-- fields: FilterLimits -->").split("\\n") if "forgotten" in row],
    "filters": [build_sensors(each)[0].filter.limits.max_forgotten for each in (scenario, changed)],
    "refused": refused,
}}))
"""


def test_a_filter_parameter_is_written_once(tmp_path: Path) -> None:
    """A field of `Limits` is in the schema, the docs, the overrides and at the filter."""
    shutil.copytree(SRC / "vedette", tmp_path / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    file = tmp_path / "vedette" / "filters" / "limits.py"
    source = file.read_text("utf-8")
    source, entries = re.subn(
        r"(\n        max_labels: )", r"\n        max_forgotten: labels forgotten.\1", source, count=1
    )
    source, lines = re.subn(r"(\n    max_labels: )", r"\n    max_forgotten: Count = 7\1", source, count=1)
    assert entries == lines == 1
    file.write_text(source, "utf-8")
    program = AFTER.format(tools=str(TOOLS))
    own = {**os.environ, "PYTHONPATH": str(tmp_path)}
    ran = subprocess.run([sys.executable, "-c", program], env=own, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    found: dict[str, Any] = json.loads(ran.stdout)
    assert found["schema"]["default"] == 7
    assert found["schema"]["description"] == "Labels forgotten [-]."
    assert found["row"] == ["| `max_forgotten` | Labels forgotten [-]. | integer | `7` |"]
    assert found["filters"] == [7, 9]
    assert "filter.limits.max_forgotten: expected a number of at least 1, got 0" in found["refused"]


def test_every_part_that_is_marked_is_a_kind() -> None:
    unions = (AnyReward, AnyConstraint, AnySearch, Motion, Survival, Measurement, Noise, Detection, Clutter, Assignment)
    found = sorted(kind for union in unions for kind in kinds(union) if kind != "custom")
    own = ["keep_out", "modes", "range_dependent", "revisit", "stay_inside"]  # not marked: written out
    sources = [file.read_text("utf-8") for file in (SRC / "vedette").rglob("*.py") if file.name != "derived.py"]
    marked = [kind for source in sources for kind in re.findall(r'(?m)^@part\(\s*"(\w+)"', source)]
    assert sorted([*marked, *own]) == found


@pytest.mark.parametrize("section", dict.fromkeys(sections()), ids=lambda section: section.__name__)
def test_sections_go_to_workers_by_their_names(section: type[BaseModel]) -> None:
    assert pickle.loads(pickle.dumps(section)) is section


def test_a_plain_number_is_refused() -> None:
    """What it may be is not said, and it would be missing from the file unseen."""
    with pytest.raises(TypeError, match=r"Delay\.start: expected a type of .*; got float"):
        derived("vedette.tracking.delays:Delay")(Derived)


KIND = '''
"""The last of all joint actions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vedette.control.search.problem import JointProblem
from vedette.models.fields import Count, check_fields, part


@part("last", "search")
@dataclass(frozen=True, slots=True)
class LastSearch:
    """The last of all.

    Attributes:
        times: how often it is looked at.
    """

    times: Count = 3

    def __post_init__(self) -> None:
        check_fields(self)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The last of every sensor's."""
        return tuple(num - 1 for num in problem.shape)
'''

AFTER_KIND = """
import json
from vedette.scenarios import json_schema, load_scenario, replace_fields
from vedette.scenarios.build import build_planner

changed = replace_fields(load_scenario("two-searchers"), {"control.search": {"kind": "last", "times": 4}})
search = build_planner(changed, "jdm").search
print(json.dumps([type(search).__name__, search.times, json_schema()["$defs"]["LastSearch"]["properties"]["times"]]))
"""


METHOD = '''
"""Every track by itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.kernels.association.marginals import Association
from vedette.kernels.base.types import Floats, Ints
from vedette.models.fields import Positive, check_fields, part
from vedette.models.functions import model_function


@model_function("association_marginals")
def each_alone(offsets: Ints, columns: Ints, log_weights: Floats, params: Floats, out: Floats) -> float:
    """params: sharpness."""
    for row in range(len(offsets) - 1):
        total = 0.0
        for option in range(offsets[row], offsets[row + 1]):
            total += math.exp(params[0] * log_weights[option])
        for option in range(offsets[row], offsets[row + 1]):
            out[option] = params[0] * log_weights[option] - math.log(total)
    return 0.0


@part("alone", "assignment")
@dataclass(frozen=True, slots=True)
class Alone:
    """Tracks that do not know of each other.

    Attributes:
        sharpness: power of each weight.
    """

    sharpness: Positive = 1.0
    finds: ClassVar[str] = "marginals"

    def __post_init__(self) -> None:
        check_fields(self)

    def to_kernel(self) -> Association:
        """The same, as kernels take it."""
        return Association(each_alone, np.array([self.sharpness]))
'''

AFTER_METHOD = """
import json
import numpy as np
from vedette.errors import ScenarioError
from vedette.scenarios import json_schema, load_scenario, replace_fields
from vedette.scenarios.build import build_sensors

fields = {"filter.kind": "lmb", "filter.assignment": {"kind": "alone", "sharpness": 0.5}}
try:
    replace_fields(load_scenario("two-searchers"), fields | {"filter.kind": "factored_glmb"})
except ScenarioError as error:
    refused = str(error)
local = build_sensors(replace_fields(load_scenario("two-searchers"), fields))[0].filter
local.step(local.initial(), [], [0.0, 0.0, 0.0], 1.0, 1, rng=np.random.default_rng(0))
default = json_schema()["$defs"]["AloneAssignment"]["properties"]["sharpness"]["default"]
print(json.dumps([local.assignment.sharpness, default, refused]))
"""


def test_an_association_method_is_one_file(tmp_path: Path) -> None:
    """As plain Python, since compiling a filter with it takes a minute; `test_assignment.py` compiles such methods."""
    shutil.copytree(SRC / "vedette", tmp_path / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "vedette" / "filters" / "alone.py").write_text(METHOD, "utf-8")
    own = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1"}
    ran = subprocess.run([sys.executable, "-c", AFTER_METHOD], env=own, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    sharpness, default, refused = json.loads(ran.stdout)
    assert (sharpness, default) == (0.5, 1.0)
    assert "filter.assignment.kind: expected ranked, as the filter is factored_glmb" in refused


def test_a_kind_is_one_file(tmp_path: Path) -> None:
    shutil.copytree(SRC / "vedette", tmp_path / "vedette", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "vedette" / "control" / "search" / "last.py").write_text(KIND, "utf-8")
    own = {**os.environ, "PYTHONPATH": str(tmp_path)}
    ran = subprocess.run([sys.executable, "-c", AFTER_KIND], env=own, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    name, times, field = json.loads(ran.stdout)
    assert (name, times, field["default"]) == ("LastSearch", 4, 3)
    assert field["description"] == "How often it is looked at [-]."


@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("value", NUMBERS)
def test_a_file_and_a_constructor_take_the_same_numbers(name: str, value: Any) -> None:
    try:
        TypeAdapter(getattr(base, name), config={"strict": True, "allow_inf_nan": False}).validate_python(value)
        in_file = True
    except ValidationError:
        in_file = False
    check = getattr(fields, name).__metadata__[0]
    try:
        check("field", value)
        in_python = True
    except InputError:
        in_python = False
    assert in_file == in_python


def test_scenarios_can_be_handed_to_another_process() -> None:
    scenarios = [load_scenario(name) for name in list_builtin()]
    code = "import pickle, sys; print(*(each.model.model_dump_json() for each in pickle.load(sys.stdin.buffer)))"
    told = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(scenarios), capture_output=True, check=True)
    assert told.stdout.decode().strip() == " ".join(each.model.model_dump_json() for each in scenarios)
