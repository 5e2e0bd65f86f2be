"""The tutorial as a notebook: runs the page, writes what each block prints below it, and makes the notebook of it.

usage: python tools/notebook.py
"""

from __future__ import annotations

import io
import json
import re
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))  # a script's own folder, also where this is loaded by its path

from readme import portable

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/tutorial.md"
NOTEBOOK = ROOT / "docs/notebooks/tutorial.ipynb"
INSTALL = "It needs Vedette in the environment of its kernel: `pip install .` in the project's folder.\n"

# A block of Python, and what it printed where it printed anything.
_BLOCK = re.compile(r"```python\n(?P<code>.*?)```\n(?:\n```text\n(?P<printed>.*?)```\n)?", re.DOTALL)


def executed(page: str) -> str:
    """The page with what its blocks print when they run, one after the other, as one program."""
    names: dict[str, Any] = {"__name__": "__main__"}

    def run(block: re.Match[str]) -> str:
        code, output = block["code"], io.StringIO()
        with redirect_stdout(output):
            exec(compile(code, PAGE.name, "exec"), names)
        printed = "\n".join(line.rstrip() for line in output.getvalue().splitlines())
        return f"```python\n{code}```\n" + (f"\n```text\n{printed}\n```\n" if printed else "")

    return _BLOCK.sub(run, page)


def notebook(page: str) -> str:
    """The notebook of an executed page: text and code in turn, each with its output."""
    cells, end = list[dict[str, Any]](), 0
    for block in _BLOCK.finditer(page):
        cells += [_text(page[end : block.start()]), _code(block["code"], block["printed"])]
        end = block.end()
    cells.append(_text(page[end:]))
    told = [cell for cell in cells if cell["source"]]
    for number, cell in enumerate(told):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": told, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def _text(markdown: str) -> dict[str, Any]:
    own = re.sub(r"The page is one Python program\..*?\n\n", f"{INSTALL}\n", markdown, flags=re.DOTALL)
    return {"cell_type": "markdown", "metadata": {}, "source": _lines(portable(own, None))}


def _code(code: str, printed: str | None) -> dict[str, Any]:
    outputs = [{"name": "stdout", "output_type": "stream", "text": [*_lines(printed), "\n"]}] if printed else []
    return {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": outputs, "source": _lines(code)}


def _lines(text: str) -> list[str]:
    return text.strip("\n").splitlines(keepends=True)


def main() -> None:
    page = executed(PAGE.read_text("utf-8"))
    PAGE.write_text(page, "utf-8")
    NOTEBOOK.parent.mkdir(exist_ok=True)
    NOTEBOOK.write_text(notebook(page), "utf-8")


if __name__ == "__main__":
    main()
