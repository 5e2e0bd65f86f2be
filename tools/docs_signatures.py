"""Signatures from the source for pages of the documentation, and links in pages of the Python API.

`<!-- model functions -->` is replaced by the table of compiled functions, `<!-- protocols -->` by all public protocols.
In a page with the line `::: PACKAGE`, names in the last column of tables link to their descriptions below, except
types and constants, which have none.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import textwrap
from types import FunctionType
from typing import Any

ROOMS = ("models", "platforms", "densities", "filters", "fusion", "tracking", "control", "simulation")
# What takes a function of each kind, as class and attribute.
TAKEN_BY = {
    "transition": "models.MotionModel.transition",
    "transition_jacobian": "models.MotionModel.transition_jacobian",
    "process_noise_cov": "models.MotionModel.process_noise_cov",
    "prob_survival": "models.SurvivalModel.function",
    "measurement": "models.MeasurementModel.function",
    "measurement_jacobian": "models.MeasurementModel.jacobian",
    "measurement_noise_cov": "models.NoiseModel.function",
    "prob_detection": "models.DetectionModel.function",
    "mean_prob_detection": "models.DetectionModel.mean_function",
    "log_clutter_intensity": "models.ClutterModel.log_intensity",
    "association_marginals": "filters.CustomMarginals.function",
    "label_reward": "control.LabelReward.function",
}


def fill(markdown: str) -> str:
    """Return a page with its marks replaced, and with links in the tables of a page of the Python API."""
    for mark, make in (("<!-- model functions -->", model_functions), ("<!-- protocols -->", protocols)):
        if mark in markdown:
            markdown = markdown.replace(mark, make())
    package = re.search(r"^::: (\S+)$", markdown, re.MULTILINE)
    return markdown if package is None else with_links(markdown, package[1])


def with_links(markdown: str, package: str) -> str:
    """Return a page in which each row of a table links the names of a package in its last column."""
    link = rf"[`\1`](#{package}.\1)"
    return re.sub(
        r"^(\| (?!types and constants)[^|`]+ \| )(.*)$",
        lambda row: row[1] + re.sub(r"(?<!\[)`(\w+)`", link, row[2]),
        markdown,
        flags=re.MULTILINE,
    )


def model_functions() -> str:
    """Return a table of the kinds of compiled functions, with arguments, result and the class that takes them."""
    from vedette.kernels.base.compile import SIGNATURES
    from vedette.models import functions

    results = dict(re.findall(r"^\| `(\w+)` \| [^|]+ \| ([^|]+) \|$", functions.__doc__ or "", re.MULTILINE))
    rows = ["| kind | function of | result | used in |", "| --- | --- | --- | --- |"]
    for kind, place in TAKEN_BY.items():
        room, taker, attribute = place.split(".")
        named = inspect.getattr_static(getattr(importlib.import_module(f"vedette.{room}"), taker), attribute)
        assert named is not None
        link = f"[`{taker}.{attribute}`](reference/{room}.md#vedette.{room}.{taker})"
        rows.append(f"| `{kind}` | `{', '.join(SIGNATURES[kind][0])}` | {results[kind]} | {link} |")
    if set(SIGNATURES) != set(TAKEN_BY):
        raise ValueError(f"tools/docs_signatures.py: expected the kinds {set(SIGNATURES)}; got {set(TAKEN_BY)}")
    return "\n".join(rows)


def protocols() -> str:
    """Return each public protocol with a summary, and its members with their types."""
    parts = []
    for room in ROOMS:
        module = importlib.import_module(f"vedette.{room}")
        found = [(name, one) for name in module.__all__ if is_protocol(one := getattr(module, name))]
        parts += [f"### `{room}`"] if found else []
        for name, protocol in found:
            summary = (inspect.getdoc(protocol) or "").split("\n\n")[0].replace("\n", " ")
            code = "\n".join(f"    {line}" for member in members(protocol) for line in member.split("\n"))
            parts.append(f"#### [`{name}`](reference/{room}.md#vedette.{room}.{name})\n\n{summary}")
            parts.append(f"```python\nclass {name}(Protocol):\n{code}\n```")
    return "\n\n".join(parts)


def is_protocol(one: Any) -> bool:
    """Return True if this is a protocol."""
    return isinstance(one, type) and bool(getattr(one, "_is_protocol", False))


def members(protocol: type) -> list[str]:
    """Return the lines of a protocol's attributes and methods, inherited ones first."""
    found: dict[str, str] = {}
    for base in reversed(protocol.__mro__):
        if not is_protocol(base):
            continue
        stated = [item for item in _definition(base).body if isinstance(item, ast.AnnAssign)]
        found |= {line.partition(":")[0]: line for item in stated if (line := ast.unparse(item))}
        for name, member in vars(base).items():
            if isinstance(member, property) and member.fget is not None:
                found[name] = f"{name}: {ast.unparse(_definition(member.fget).returns)}"
            elif isinstance(member, FunctionType) and (not name.startswith("_") or name == "__call__"):
                found[name] = _method(name, member)
    return list(found.values())


def _method(name: str, function: FunctionType) -> str:
    """Return `def name(...) -> ...: ...`, with one argument per line if it is long."""
    given, node = inspect.signature(function), _definition(function)
    stated_in = [own for own in ast.walk(node.args) if isinstance(own, ast.arg)]
    stated = {own.arg: ast.unparse(own.annotation) for own in stated_in if own.annotation}
    parameters = [own.replace(annotation=stated.get(own.name, own.annotation)) for own in given.parameters.values()]
    line = f"def {name}{given.replace(parameters=parameters, return_annotation=ast.unparse(node.returns))}: ..."
    line = line.replace("'", "")
    if len(line) <= 88:
        return line
    head, _, result = line.removeprefix(f"def {name}(").rpartition(") -> ")
    arguments = re.split(r", (?![^\[]*\])", head)
    return "\n".join([f"def {name}(", *(f"    {argument}," for argument in arguments), f") -> {result}"])


def _definition(thing: Any) -> Any:
    """Return the syntax tree of a class or function: its annotations as they are in the source."""
    return ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0]
