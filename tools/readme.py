"""The README as a package index shows it: away from the repository, where links to its files lead nowhere.

Hatchling calls this while it builds. With a `Source` among the project's URLs in pyproject.toml, links and pictures
lead there; without one, a link is left as its text, and a picture as its description.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

# A picture or a link to a file of the repository: "!" or nothing, text, target.
_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?![a-z]+:|#)([^)\s]+)\)")


def portable(text: str, source: str | None) -> str:
    """Markdown text whose links to files of the repository lead to its source, or are taken out where none is known."""

    def elsewhere(link: re.Match[str]) -> str:
        is_picture, words, target = link.groups()
        if source is not None:
            return f"{is_picture}[{words}]({source.rstrip('/')}/{'raw' if is_picture else 'blob'}/main/{target})"
        return f"*{' '.join(words.split())}*" if is_picture else words

    return _LINK.sub(elsewhere, text)


class ReadmeHook(MetadataHookInterface):
    """Fills in the field `readme` of the project."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Called by hatchling with the project's table of pyproject.toml."""
        text = Path(self.root, "README.md").read_text("utf-8")
        source = metadata.get("urls", {}).get("Source")
        metadata["readme"] = {"content-type": "text/markdown", "text": portable(text, source)}
