"""Count turns of phrase that readers stumble over, by file, and fail if a file gets more of them.

usage: python3 tools/prose.py            fail if a file has more than `tools/prose.json` allows
       python3 tools/prose.py --show     print the phrases of each file, most first
       python3 tools/prose.py --lower    write the present counts to `tools/prose.json` where they are lower

Reads README.md, docs/ (without decisions, code blocks and code in lines), and the docstrings and comments of
src/vedette. Guides of the site have at most 1,200 words, or as many as `tools/prose.json` allows.
"""

from __future__ import annotations

import ast
import io
import json
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ALLOWED = ROOT / "tools/prose.json"
MOST_WORDS = 1200
# A person's verb or pronoun for a thing, a clause in place of a noun, an old word where there is a common one.
PATTERNS = re.compile(
    "|".join(
        (
            r"\b(?:who|whoever|whom|nobody|somebody)\b",
            r"\b(?:but for|as of|so many|beside|at hand|in turn|what it is|of which|no longer|as before)\b",
            r"\bof (?:one's|your) own\b",
            r"\b(?:is|are|was|were|be|been) (?:told|said|asked|believed|meant)\b",
            r"\b(?:tells|says|hears|believes) (?:of|so|nothing|how|what|that|which)\b",
        )
    ),
    re.IGNORECASE,
)
RIDDLES = re.compile(r"(?:What|Whether|Where|Who|Whose|How|Of|As|That|Those|Its)\b")  # a first line of a docstring


def prose_of_page(text: str) -> str:
    """Return a page without code blocks and code in its lines."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def prose_of_source(text: str) -> Iterator[tuple[str, bool]]:
    """Yield docstrings and comments, and True for a docstring."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (found := ast.get_docstring(node)):
            yield re.sub(r"`[^`\n]*`", "", found), True
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield re.sub(r"`[^`\n]*`", "", token.string), False


def places(path: Path) -> list[str]:
    """Return the turns of phrase in a file."""
    text = path.read_text("utf-8")
    if path.suffix == ".md":
        return PATTERNS.findall(prose_of_page(text))
    found = list[str]()
    for prose, is_docstring in prose_of_source(text):
        found += PATTERNS.findall(prose)
        if is_docstring and RIDDLES.match(prose):
            found.append(prose.splitlines()[0])
    return found


def files() -> list[Path]:
    """Return the files that are read."""
    pages = [path for path in (ROOT / "docs").rglob("*.md") if not {"decisions", "reference"} & set(path.parts)]
    return [ROOT / "README.md", *sorted(pages), *sorted((ROOT / "src/vedette").rglob("*.py"))]


def guides() -> list[Path]:
    """Return the pages of the part "Guides" of the site."""
    part = re.search(r"^  - Guides:\n((?: {6}.*\n)+)", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert part is not None
    return [ROOT / "docs" / name for name in re.findall(r"(\S+\.md)$", part.group(1), re.MULTILINE)]


def main() -> int:
    """Compare the counts with those that are allowed; return 1 if a file has more."""
    given = {str(path.relative_to(ROOT)): places(path) for path in files()}
    words = {str(path.relative_to(ROOT)): len(path.read_text("utf-8").split()) for path in guides()}
    counts = {
        "phrases": {name: len(found) for name, found in given.items() if found},
        "words": {name: number for name, number in words.items() if number > MOST_WORDS},
    }
    if "--show" in sys.argv:
        for name in sorted(counts["phrases"], key=lambda name: -counts["phrases"][name]):
            print(f"{counts['phrases'][name]} {name}: {'; '.join(given[name])}")
    allowed = json.loads(ALLOWED.read_text("utf-8"))
    if "--lower" in sys.argv:
        for kind, own in counts.items():
            allowed[kind] = {name: min(most, own[name]) for name, most in allowed[kind].items() if name in own}
        ALLOWED.write_text(json.dumps(allowed, indent=1) + "\n", "utf-8")
    faults = [
        f"{name}: expected at most {allowed[kind].get(name, MOST_WORDS if kind == 'words' else 0)} {kind}; got {number}"
        for kind, own in counts.items()
        for name, number in own.items()
        if number > allowed[kind].get(name, 0)
    ]
    print("\n".join(faults) or f"{sum(map(len, given.values()))} phrases in {len(counts['phrases'])} files")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
