"""The page on the architecture is true of the source."""

from __future__ import annotations

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


def test_no_file_of_control_does_so_for_a_type_either() -> None:
    graph = grimp.build_graph("vedette", cache_dir=None)
    names = graph.find_descendants("vedette.control")
    imports = {name: graph.find_modules_directly_imported_by(name) & names for name in names}
    TopologicalSorter(imports).prepare()
