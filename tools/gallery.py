"""The pictures of the gallery: each example draws its own.

usage: python tools/gallery.py [NAME ...]     such as own_motion; all by default
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs/images/gallery"


def main(names: list[str]) -> None:
    PICTURES.mkdir(exist_ok=True)
    for name in names or drawing():
        print(f"== {name}", flush=True)
        script = ROOT / "examples" / f"{name}.py"
        subprocess.run([sys.executable, str(script), "--picture", str(PICTURES / f"{name}.png")], check=True)


def drawing() -> list[str]:
    """The examples that draw a picture."""
    scripts = sorted((ROOT / "examples").glob("*.py"))
    return [script.stem for script in scripts if "show(main, draw)" in script.read_text("utf-8")]


if __name__ == "__main__":
    main(sys.argv[1:])
