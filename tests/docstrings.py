"""The docstrings of the source, taken apart."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

SRC = Path(__file__).resolve().parents[1] / "src"
HEADINGS = ("Args", "Attributes", "Returns", "Yields", "Raises")
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Documented:
    """A module, class or function with its docstring.

    Attributes:
        place: file and name.
        node: its syntax tree.
        is_public: neither it nor what holds it, up to the module, is private; kernels are not.
        text: the docstring, without its indentation; None where there is none.
        sections: of it, see `sections_of`.
    """

    place: str
    node: ast.Module | ast.ClassDef | Function
    is_public: bool
    text: str | None
    sections: dict[str, list[tuple[str, str]]]


def documented() -> Iterator[Documented]:
    """Everything in the source that may have a docstring."""
    for path in sorted(SRC.rglob("*.py")):
        tree = ast.parse(path.read_text("utf-8"))
        name = path.relative_to(SRC).as_posix()
        yield from _walk(tree, name, "/kernels/" not in name)


def _walk(node: ast.Module | ast.ClassDef | Function, place: str, is_public: bool) -> Iterator[Documented]:
    text = ast.get_docstring(node)
    yield Documented(place, node, is_public, text, sections_of(text or ""))
    for child in node.body:
        if isinstance(child, ast.ClassDef | Function):
            is_open = is_public and not child.name.startswith("_") and not isinstance(node, Function)
            yield from _walk(child, f"{place}: {child.name}", is_open)


def sections_of(text: str) -> dict[str, list[tuple[str, str]]]:
    """Heading -> entries (name, text), in the order of the docstring.

    A line that neither begins an entry nor is indented as one that goes on is an entry without text.
    """
    found: dict[str, list[tuple[str, str]]] = {}
    entries: list[tuple[str, str]] | None = None
    for line in text.splitlines():
        heading = re.fullmatch(r"(\w+):", line)
        if heading and heading[1] in HEADINGS:
            entries = found.setdefault(heading[1], [])
        elif line and not line.startswith(" "):
            entries = None
        elif entries is not None and (entry := re.match(r"    (\S[^:]*):(?: (.*))?$", line)):
            entries.append((entry[1], entry[2] or ""))
        elif entries is not None and line.strip() and not line.startswith(" " * 8):
            entries.append((line.strip(), ""))
        elif entries and line.strip():
            name, so_far = entries[-1]
            entries[-1] = (name, f"{so_far} {line.strip()}")
    return found


def names_in(entries: list[tuple[str, str]]) -> list[str]:
    """The names that entries describe; one may describe several, with commas between them."""
    return [name.strip().strip("*`") for entry, _ in entries for name in entry.split(",")]


def parameters(node: Function) -> list[str]:
    """Names of a function's parameters but `self` and `cls`."""
    given = node.args
    named = [argument.arg for argument in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    extra = [argument.arg for argument in (given.vararg, given.kwarg) if argument is not None]
    return [name for name in (*named, *extra) if name not in ("self", "cls")]


def attributes(node: ast.ClassDef, classes: Mapping[str, ast.ClassDef]) -> dict[str, bool]:
    """What instances of a class have: fields, properties and what its methods set; whether each is a declared field.

    `classes` are those by whose names its bases are looked up.
    """
    found: dict[str, bool] = {}
    for base in node.bases:
        name = ast.unparse(base).split("[")[0]
        if name in classes and classes[name] is not node:
            found |= attributes(classes[name], classes)
    for child in node.body:
        if isinstance(child, ast.AnnAssign) and isinstance(child.target, ast.Name):
            found[child.target.id] = "ClassVar" not in ast.unparse(child.annotation)
        elif isinstance(child, Function):
            if any(ast.unparse(decorator).endswith("property") for decorator in child.decorator_list):
                found.setdefault(child.name, False)
            for inner in ast.walk(child):
                if isinstance(inner, ast.Attribute) and isinstance(inner.ctx, ast.Store):
                    found.setdefault(inner.attr, False)
    return found
