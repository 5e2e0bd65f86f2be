"""The site of the documentation: whole, working from disk and on a phone, and served while pages are written."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from types import ModuleType

import pytest
from ruamel.yaml import YAML

from reports.browser import Browser, Page, chromium
from scripts import load
from waiting import PATIENCE, heed_interrupts, wait_until

ROOT = Path(__file__).resolve().parents[1]
needs_browser = pytest.mark.skipif(chromium() is None, reason="no chromium or chrome on PATH to open the pages in")


@pytest.fixture
def docs(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "tools")
    return load("tools/docs.py")


def small_project(place: Path, **pages: str) -> Path:
    """A folder with these pages, set up as the project's own."""
    written = {"index": "# Welcome\n\nNothing of the kind.\n", "birds": "# Birds\n\nThe cormorant dives.\n", **pages}
    shutil.copytree(ROOT / "docs" / "assets", place / "docs" / "assets")
    for name, text in written.items():
        (place / "docs" / f"{name}.md").write_text(text, "utf-8")
    yaml = YAML()
    settings = yaml.load(ROOT / "mkdocs.yml")
    settings["nav"] = ["index.md", "birds.md"]
    settings["plugins"] = ["search", "offline"]
    yaml.dump(settings, place / "mkdocs.yml")
    return place


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole site, built apart from the project's own."""
    project = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "docs", project / "docs")
    for name in ("mkdocs.yml", "CHANGELOG.md"):
        shutil.copy(ROOT / name, project)
    (project / "src").symlink_to(ROOT / "src")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "tools")
        assert load("tools/docs.py").build(project) == []
    return project / "build" / "site"


@needs_browser
def test_the_search_finds_pages_from_disk(tmp_path: Path, docs: ModuleType, browser: Browser) -> None:
    project = small_project(tmp_path)
    assert docs.build(project) == []
    page = browser.open(project / "build" / "site" / "index.html")
    assert found(page, "cormorant")[0].startswith("Birds")
    assert page.complaints() == []
    assert {address for address in page.requests() if not address.startswith(("file:", "data:", "about:"))} == set()


@needs_browser
@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("Lmb", "LMB"),
        ("expected loss", "expected_loss"),
        ("bearing_range", "bearing_range"),
        ("late", "Late scans"),
        ("OutOfSequenceInfo", "OutOfSequenceInfo"),
        ("late scans", "Late scans"),
        ("vedette live", "Live scans: vedette live"),
        ("vedette track", "Recorded scans: vedette track"),
        ("keep_out", "keep_out"),
        ("custom reward", "A custom reward"),
    ],
)
def test_a_thing_is_found_before_what_mentions_it(site: Path, browser: Browser, words: str, first: str) -> None:
    assert found(browser.open(site / "index.html"), words)[0].startswith(first)


@needs_browser
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize(
    "name", ["index", "control", "extending", "fields/control", "reference/models", "reproduction"]
)
def test_a_page_fits_a_phone_and_has_the_systems_colours(site: Path, browser: Browser, name: str, dark: bool) -> None:
    page = browser.open(site / f"{name}.html", width=390, height=844, dark=dark)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    background, text = (
        sum(map(int, re.findall(r"\d+", page.evaluate(f"getComputedStyle(document.{of}"))[:3]))
        for of in ("body).backgroundColor", "querySelector('article p')).color")
    )
    assert (background < 150 < 350 < text) if dark else (text < 400 < 700 < background)
    colours = "new Set([...document.querySelectorAll('pre code span')].map((one) => getComputedStyle(one).color)).size"
    assert page.evaluate(colours) != 1
    assert page.complaints() == []


def found(page: Page, words: str) -> list[str]:
    """What the search of a page lists, the first first."""
    page.evaluate("document.querySelector('.md-search__button').click()")
    results = "[...(document.activeElement.shadowRoot ?? document).querySelectorAll('ol a, li a')]"
    wait_until(lambda: page.evaluate("document.activeElement.shadowRoot !== null"), "the search's window")
    page.call("Input.insertText", text=words)
    wait_until(lambda: page.evaluate(f"{results}.length > 0"), f"results for {words}")
    texts: list[str] = page.evaluate(f"{results}.map((one) => one.textContent.trim())")
    return texts


def test_what_leads_nowhere_or_elsewhere_is_a_fault(tmp_path: Path, docs: ModuleType) -> None:
    text = (
        '# Stray\n\n<script src="https://example.org/x.js"></script> <a href="gone.html">x</a> ![](images/none.png)\n'
    )
    told = docs.build(small_project(tmp_path / "one", stray=text))
    assert told == [
        "docs/stray.md: is not in the navigation of mkdocs.yml",
        "stray.html: leads nowhere: gone.html",
        "stray.html: would be fetched: https://example.org/x.js",
        "stray.html: leads nowhere: images/none.png",
    ]
    for number, link in enumerate(("(gone.md)", "(birds.md#nobody)")):
        (told,) = docs.build(small_project(tmp_path / str(number), index=f"# Welcome\n\n[there]{link}\n"))
        assert "does not exist" in told


def test_pages_are_served_and_laid_out_again_when_they_change(tmp_path: Path) -> None:
    project = small_project(tmp_path)
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT / 'tools')!r}); import docs, pathlib; "
        f"docs.serve(pathlib.Path({str(project)!r}), 0, show=False)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    ) as server:
        try:
            assert server.stdout is not None
            address = re.findall(r"http://\S+/", server.stdout.readline())[0]

            def shown() -> str:
                with urllib.request.urlopen(address + "birds.html", timeout=PATIENCE) as answer:
                    text: str = answer.read().decode()
                    return text

            wait_until(lambda: answers(shown) and "The cormorant dives" in shown(), "the page")
            (project / "docs" / "birds.md").write_text("# Birds\n\nThe heron waits.\n", "utf-8")
            wait_until(lambda: "The heron waits" in shown(), "the changed page")
            server.send_signal(signal.SIGINT)
            assert server.wait(PATIENCE) == 0
            assert not answers(shown)
        finally:
            server.kill()


def answers(request: object) -> bool:
    """Whether an address answers."""
    try:
        request()  # type: ignore[operator]
    except OSError:
        return False
    return True


def test_formulas_are_typeset_without_a_network(tmp_path: Path, docs: ModuleType) -> None:
    project = small_project(tmp_path, index="# Welcome\n\nThe cormorant dives, $w^2$ deep:\n\n$$a < b$$\n")
    assert docs.build(project) == []
    page = (project / "build" / "site" / "index.html").read_text("utf-8")
    assert "<msup><mi>w</mi><mn>2</mn></msup>" in page
    assert '<div class="formula"><math' in page
    assert "<mi>a</mi><mo>&#x0003C;</mo><mi>b</mi>" in page
