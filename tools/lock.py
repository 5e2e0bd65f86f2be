"""Renew the locked dependencies in `requirements/`. Needs `uv` on the path, which nothing else here does.

usage: python3 tools/lock.py             keep what is locked; add and drop what pyproject.toml asks for
       python3 tools/lock.py --upgrade   move everything to its newest version
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADER = "# Locked for Python 3.11 to 3.15 on every platform by tools/lock.py; do not edit.\n"
OPTIONS = [
    "--universal",
    "--python-version=3.11",
    "--fork-strategy=fewest",
    "--generate-hashes",
    "--no-emit-index-url",
    "--no-emit-find-links",
    "--no-header",
    "--no-annotate",
    "--quiet",
]


def compile_lock(name: str, *selection: str) -> None:
    """Resolve a selection of pyproject.toml's dependencies into `requirements/NAME.txt`."""
    target = ROOT / "requirements" / f"{name}.txt"
    command = ["uv", "pip", "compile", "pyproject.toml", *selection, *OPTIONS, *sys.argv[1:]]
    subprocess.run([*command, "--output-file", str(target)], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    target.write_text(HEADER + target.read_text("utf-8").removeprefix(HEADER), "utf-8")


if __name__ == "__main__":
    compile_lock("runtime", "--extra", "all", "--group", "build")
    # The check runs on the very versions that a user gets.
    compile_lock("check", "--extra", "all", "--group", "check", "--constraint", "requirements/runtime.txt")
