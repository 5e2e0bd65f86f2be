"""The tutorial prints what it says it prints, and its notebook is made of it."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[1]


def load_tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("notebook", ROOT / "tools/notebook.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool


def test_page_and_notebook_are_as_the_tool_makes_them() -> None:
    tool, page = load_tool(), (ROOT / "docs/tutorial.md").read_text("utf-8")
    assert tool.executed(page) == page, "have it run: python tools/notebook.py"
    assert tool.notebook(page) == tool.NOTEBOOK.read_text("utf-8"), "have it made: python tools/notebook.py"


def test_what_a_block_prints_stands_below_it_on_the_page_and_in_the_notebook() -> None:
    tool = load_tool()
    page = "# A\n\n[one](b.md)\n\n```python\nx = 2\nprint(x)\n```\n\n```text\nold\n```\n"
    page += "\nthen\n\n```python\ny = x\n```\n\nend\n"
    executed = tool.executed(page)
    assert executed == page.replace("old", "2")
    cells = json.loads(tool.notebook(executed))["cells"]
    assert [cell["cell_type"] for cell in cells] == ["markdown", "code", "markdown", "code", "markdown"]
    assert cells[0]["source"] == ["# A\n", "\n", "one"]
    assert cells[1]["outputs"] == [{"name": "stdout", "output_type": "stream", "text": ["2", "\n"]}]
    assert cells[3]["outputs"] == []
    assert len({cell["id"] for cell in cells}) == len(cells)
