"""Build the site of the documentation in build/site/, from the pages of docs/ and tables generated from the source.

usage: docs.py                        build it; any fault is an error
       docs.py serve [PORT] [--open]  serve it on this machine, rebuilt when a page changes, until Ctrl-C
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import docs_signatures
from docs_fields import FieldPages

ROOT = Path(__file__).resolve().parents[1]
CHANGELOG = "CHANGELOG.md"
PORT = 8000


class Page(HTMLParser):
    """The anchors, links and loaded files of a built page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names = {""}
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.names |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        self.loads += [given["src"]] if "src" in given else []
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload", "preconnect"):
            self.loads.append(given["href"])


def lay_out(root: Path) -> list[str]:
    """Write the pages of docs/ into build/pages/, with their marks replaced by tables, and the changelog.

    Files that have not changed are left alone, so that a server does not build them again. Returns the names of pages.
    """
    fields, target, kept = FieldPages(root / "docs"), root / "build" / "pages", set()
    contents = {path.relative_to(root / "docs"): path.read_bytes() for path in _files(root / "docs")}
    for name, content in contents.items():
        if name.suffix == ".md":
            contents[name] = docs_signatures.fill(fields.fill(content.decode())).encode()
    if (root / CHANGELOG).is_file():
        contents[Path("changelog.md")] = changelog((root / CHANGELOG).read_text("utf-8")).encode()
    for name, content in contents.items():
        copy = target / name
        kept.add(copy)
        if not copy.is_file() or copy.read_bytes() != content:
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(content)
    for left in [path for path in _files(target) if path not in kept]:
        left.unlink()
    return sorted(path.relative_to(target).as_posix() for path in kept if path.suffix == ".md")


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def changelog(text: str) -> str:
    """Return the changelog as a page: links count from docs/, and the search leaves it out."""
    return "---\nsearch:\n  exclude: true\n---\n\n" + text.replace("](docs/", "](")


def build(root: Path) -> list[str]:
    """Build the site and return its faults."""
    pages = lay_out(root)
    missing = FieldPages(root / "docs").faults() if (root / "docs" / "fields").is_dir() else []
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--clean"]
    made = subprocess.run(
        command, cwd=root, env=_environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    if made.returncode:
        return [made.stdout]
    return [*missing, *unlisted(root, pages), *faults(root / "build" / "site")]


def _environment() -> dict[str, str]:
    """Return an environment in which Markdown finds the module `formulas`."""
    paths = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def unlisted(root: Path, pages: list[str]) -> list[str]:
    """Return a message for each page that is missing in the navigation."""
    from ruamel.yaml import YAML

    listed = set(_leaves(YAML(typ="safe").load(root / "mkdocs.yml")["nav"]))
    return [f"docs/{page}: is not in the navigation of mkdocs.yml" for page in pages if page not in listed]


def _leaves(entry: Any) -> Iterator[str]:
    if isinstance(entry, str):
        yield entry
    else:
        for inner in entry.values() if isinstance(entry, dict) else entry:
            yield from _leaves(inner)


def faults(site: Path) -> list[str]:
    """Return a message for each broken link, and each file that a browser would download."""
    pages = {path: Page(path.read_text("utf-8")) for path in sorted(site.rglob("*.html")) if path.name != "404.html"}
    found = []
    for path, page in pages.items():
        where = path.relative_to(site).as_posix()
        for link in dict.fromkeys(page.links + page.loads):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loads and parts.scheme != "data":
                    found.append(f"{where}: would be fetched: {link}")
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file():
                found.append(f"{where}: leads nowhere: {link}")
            elif target in pages and unquote(parts.fragment) not in pages[target].names:
                found.append(f"{where}: no such place in the page: {link}")
    return found


def serve(root: Path, port: int, *, show: bool) -> None:
    """Serve the site at an address of this machine until Ctrl-C, and copy pages again when they change."""
    lay_out(root)
    address = f"127.0.0.1:{free_port(port)}"
    command = [sys.executable, "-m", "zensical", "serve", "--dev-addr", address, *(["--open"] if show else [])]
    with subprocess.Popen(command, cwd=root, env=_environment(), stdout=subprocess.DEVNULL) as server:
        print(f"the documentation is at http://{address}/ until Ctrl-C", flush=True)
        try:
            while server.poll() is None:
                time.sleep(0.5)
                lay_out(root)
        except KeyboardInterrupt:
            pass
        finally:
            server.terminate()


def free_port(wanted: int) -> int:
    """Return the port, or another one if it is in use."""
    with socket.socket() as trial:
        taken = trial.connect_ex(("127.0.0.1", wanted)) == 0
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0 if taken else wanted))
        return int(trial.getsockname()[1])


def main(arguments: list[str]) -> int:
    """Build or serve the site; return the exit status."""
    if arguments[:1] == ["serve"]:
        ports = [int(one) for one in arguments[1:] if one != "--open"]
        serve(ROOT, ports[0] if ports else PORT, show="--open" in arguments)
        return 0
    found = build(ROOT)
    print("\n".join(found) if found else "the documentation is in build/site/; it can be opened from disk")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
