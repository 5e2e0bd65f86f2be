"""The page on the architecture is true of the source."""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
from graphlib import TopologicalSorter
from pathlib import Path
from types import ModuleType

import grimp
import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/architecture.md").read_text("utf-8")


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    """The program that draws."""
    spec = importlib.util.spec_from_file_location("draw_imports", ROOT / "tools/draw_imports.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(("package", "contract"), [("vedette", 0), ("vedette.kernels", 1)])
def test_every_room_has_its_sentence_and_none_imports_back_up(tool: ModuleType, package: str, contract: int) -> None:
    rooms = tool.rooms_of(package, tool.contract_order(contract))
    assert len(rooms.imports) > 10
    assert rooms.upward == []
    rows = "\n".join(re.findall(r"^\|([^|]*)\|", PAGE, re.MULTILINE))
    assert [name for name in rooms.names if f"`{name}/`" not in rows and f"`{name}.py`" not in rows] == []


def test_an_import_that_runs_back_up_is_found(tool: ModuleType) -> None:
    pairs = {("above", "below"), ("below", "above")}
    rooms = tool.Rooms("house", ["above", "below"], pairs)
    assert rooms.upward == [("below", "above")]


def test_the_page_has_the_order_of_the_contracts(tool: ModuleType) -> None:
    flat = " ".join(PAGE.split())
    for contract in (0, 1):
        names = tool.contract_order(contract)
        chain = next(text for text in re.findall(r"(?:\w+(?:, \w+)*(?: <- )?)+", flat) if f"{names[-1]} <- " in text)
        assert set(re.findall(r"\w+", chain)) >= set(names)


def test_the_drawing_is_of_the_present_source(tool: ModuleType) -> None:
    assert tool.drawing() == tool.PLACE.read_text("utf-8"), "have it drawn: python3 tools/draw_imports.py"


def test_no_file_imports_what_imports_it() -> None:
    """At run time, within functions too; what is imported for its type alone may go round."""
    graph = grimp.build_graph("vedette", exclude_type_checking_imports=True, cache_dir=None)
    order = TopologicalSorter({name: graph.find_modules_directly_imported_by(name) for name in graph.modules})
    order.prepare()  # raises CycleError, which names the files


@pytest.mark.parametrize("package", ["vedette.control", "vedette.scenarios"])
def test_no_file_of_these_does_so_for_a_type_either(package: str) -> None:
    graph = grimp.build_graph("vedette", cache_dir=None)
    names = graph.find_descendants(package) | {package}
    imports = {name: graph.find_modules_directly_imported_by(name) & names for name in names}
    TopologicalSorter(imports).prepare()


KINDS = {"GLMB", "LMB", "FactoredGLMB"}


def _kinds_asked_for(source: str) -> list[int]:
    """Lines that ask which labelled density something is: by isinstance, issubclass, a comparison or a case."""
    lines = []
    for node in ast.walk(ast.parse(source)):
        asked: list[ast.AST] = []
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) > 1:
            asked = [node.args[1]] if node.func.id in ("isinstance", "issubclass") else []
        elif isinstance(node, ast.Compare):
            asked = [node.left, *node.comparators]
        elif isinstance(node, ast.MatchClass):
            asked = [node.cls]
        else:
            continue
        named = {name.id for part in asked for name in ast.walk(part) if isinstance(name, ast.Name)}
        lines += [node.lineno] if named & KINDS else []
    return lines


def test_nobody_but_densities_asks_which_labelled_density_one_is() -> None:
    source = ROOT / "src/vedette"
    others = [file for file in source.rglob("*.py") if file.parent != source / "densities"]
    assert len(others) > 300
    found = {str(file.relative_to(source)): _kinds_asked_for(file.read_text("utf-8")) for file in others}
    assert {name: lines for name, lines in found.items() if lines} == {}


@pytest.mark.parametrize(
    "asks",
    ["isinstance(x, LMB)", "isinstance(x, GLMB | LMB)", "issubclass(k, (Poisson, FactoredGLMB))", "type(x) is LMB"],
)
def test_who_asks_which_labelled_density_one_is_is_found(asks: str) -> None:
    assert _kinds_asked_for(f"found = {asks}") == [1]
    assert _kinds_asked_for(f"match x:\n    case LMB():\n        found = {asks}") == [2, 3]
