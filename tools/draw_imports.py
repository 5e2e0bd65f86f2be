"""Draw which room of the library imports which, from the source: `docs/images/imports.svg`.

usage: python3 tools/draw_imports.py

The rooms stand on a diagonal. A room's imports leave it to the right and come down on the room that is imported; an
import that runs back up would show on the left of the diagonal, in red. The order of the rooms is that of the contract
in pyproject.toml. Wants what `python3 dev.py setup` and a check install (grimp comes with import-linter).
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
PLACE = ROOT / "docs" / "images" / "imports.svg"
WIDTH, HEIGHT, STEP, ROW = 92, 22, 46, 30  # of a box, and from one to the next, in pixels
STYLE = (
    "text{font:13px sans-serif;fill:#222}.box{fill:#e8eef6;stroke:#45678f}path.down{stroke:#9db2cb;fill:none}"
    ".dot{fill:#45678f}path.up{stroke:#c00;fill:none}.dot.up{fill:#c00}"
)
ARROW = '<marker id="arrow" markerWidth="7" markerHeight="7" refX="6" refY="3" orient="auto">'
ARROW += '<path class="dot" d="M0 0L6 3L0 6z"/></marker>'


@dataclass(frozen=True)
class Rooms:
    """The rooms of a package, each before all that it imports, and which imports which."""

    package: str
    names: list[str]
    imports: set[tuple[str, str]]

    @property
    def upward(self) -> list[tuple[str, str]]:
        """Imports that run back up: none in a house that can be taken down from the top."""
        return [pair for pair in self.imports if self.names.index(pair[0]) > self.names.index(pair[1])]


def rooms_of(package: str, order: list[str]) -> Rooms:
    """The rooms of a package as its source has them; `order` decides where the imports leave a choice."""
    graph = grimp.build_graph("vedette", cache_dir=None)
    names = {name.removeprefix(f"{package}.") for name in graph.find_children(package)}
    imports = set()
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            importer, room = (name.removeprefix(f"{package}.").split(".")[0] for name in (module, imported))
            if importer != room and names.issuperset((importer, room)):
                imports.add((importer, room))
    return Rooms(package, _ordered(names, imports, order), imports)


def _ordered(names: set[str], imports: set[tuple[str, str]], order: list[str]) -> list[str]:
    placed: list[str] = []
    while len(placed) < len(names):
        waiting = [name for name in names if name not in placed]
        free = [name for name in waiting if not any((other, name) in imports for other in waiting)]
        placed.append(min(free or waiting, key=lambda name: (order.index(name) if name in order else len(order), name)))
    return placed


def contract_order(number: int) -> list[str]:
    """The names in a layers contract of pyproject.toml, from the top."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    return re.findall(r"(\w+)\b(?!\.)", " ".join(contracts[number]["layers"]))


def drawing() -> str:
    """The drawing of the whole house, and of the kernels below it, as SVG."""
    parts, top = [], 10
    for rooms in (rooms_of("vedette", contract_order(0)), rooms_of("vedette.kernels", contract_order(1))):
        parts += [f'<text x="10" y="{top + 14}">{rooms.package}</text>', *_chart(rooms, top + 26)]
        top += 40 + ROW * len(rooms.names)
    width = 20 + WIDTH + STEP * (len(rooms_of("vedette", contract_order(0)).names) - 1)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{top}" viewBox="0 0 {width} {top}">'
    return "\n".join(
        [head, f"<style>{STYLE}</style>", ARROW, '<rect width="100%" height="100%" fill="#fff"/>', *parts, "</svg>", ""]
    )


def _chart(rooms: Rooms, top: int) -> list[str]:
    lines, dots, boxes = [], [], []
    for importer, imported in sorted(rooms.imports):
        above, below = rooms.names.index(importer), rooms.names.index(imported)
        x = 10 + STEP * below + WIDTH // 2
        y = top + ROW * above + HEIGHT // 2
        kind = "down" if above < below else "up"
        way = f"M{10 + STEP * above + WIDTH // 2} {y}H{x}V{top + ROW * below + (kind == 'up') * HEIGHT}"
        lines.append(f'<path class="{kind}" d="{way}" marker-end="url(#arrow)"/>')
        title = f"<title>{importer} imports {imported}</title>"
        dots.append(f'<circle class="dot {kind}" cx="{x}" cy="{y}" r="4">{title}</circle>')
    for index, name in enumerate(rooms.names):
        x, y = 10 + STEP * index, top + ROW * index
        boxes.append(f'<rect class="box" x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="4"/>')
        boxes.append(f'<text x="{x + WIDTH // 2}" y="{y + 16}" text-anchor="middle">{name}</text>')
    return [*lines, *dots, *boxes]


if __name__ == "__main__":
    PLACE.write_text(drawing(), "utf-8")
    print(PLACE)
