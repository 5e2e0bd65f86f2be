"""The built documentation works when it is opened from disk."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import pytest

from reports.browser import Browser, chromium
from waiting import PATIENCE

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = chromium()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two pages, built as the documentation is."""
    place = tmp_path_factory.mktemp("documentation")
    pages = place / "pages"
    (pages / "assets").mkdir(parents=True)
    for name in ("style.css", "search-from-disk.js"):
        (pages / "assets" / name).write_bytes((ROOT / "docs/assets" / name).read_bytes())
    (pages / "index.md").write_text("# Welcome\n\nNothing of the kind.\n")
    (pages / "birds.md").write_text("# Birds\n\nThe cormorant dives, $w^2$ deep:\n\n$$a < b$$\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what mkdocs itself imports
        from mkdocs.commands.build import build
        from mkdocs.config import load_config

        settings: dict[str, Any] = {"docs_dir": str(pages), "site_dir": str(place / "site"), "plugins": ["search"]}
        build(load_config(str(ROOT / "mkdocs.yml"), nav=["index.md", "birds.md"], **settings))
    return place / "site"


def test_formulas_are_typeset_without_a_network(site: Path) -> None:
    page = (site / "birds.html").read_text("utf-8")
    assert "<msup><mi>w</mi><mn>2</mn></msup>" in page
    assert '<div class="formula"><math' in page
    assert "<mi>a</mi><mo>&#x0003C;</mo><mi>b</mi>" in page


@pytest.mark.skipif(PROGRAM is None, reason="no chromium or chrome on PATH to open the pages in")
def test_the_search_finds_pages_from_disk(site: Path) -> None:
    assert PROGRAM is not None
    with Browser(PROGRAM) as browser:
        page = browser.open(site / "search.html", query="q=cormorant")
        page.evaluate(
            f"new Promise((done, fail) => {{ const end = performance.now() + {1000 * PATIENCE:.0f}; const look = () => "
            "document.querySelector('#mkdocs-search-results article, #mkdocs-search-results > p') ? done() : "
            "performance.now() > end ? fail(new Error('it never ends')) : setTimeout(look, 10); look(); })"
        )
        found = page.evaluate("document.getElementById('mkdocs-search-results').textContent")
        assert "Birds" in found
        assert "cormorant dives" in found
        page.click("#mkdocs-search-results a")
        assert [text for text in page.complaints() if "exception" in str(text).lower()] == []
