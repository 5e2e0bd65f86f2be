"""Run every check of the project, each as a stage with its time; started by `python3 dev.py check`.

usage: check.py [--list] [STAGE ...]

With no stage named, all but the long ones (`slow`, `fuzz`) are run. A stage that fails does not stop the others.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build"


@dataclass(frozen=True)
class Stage:
    """A command that must exit with 0, and what it is for."""

    purpose: str
    command: list[str]
    environment: dict[str, str] = field(default_factory=dict)
    by_default: bool = True


def python(module: str, *arguments: str) -> list[str]:
    return [sys.executable, "-m", module, *arguments]


def lane(purpose: str, name: str, **environment: str) -> Stage:
    """The marked tests under another way of compiling, with a kernel cache of its own."""
    environment["VEDETTE_CACHE_DIR"] = str(BUILD / f"kernels-{name}")
    return Stage(purpose, python("pytest", "-q", "-m", "lanes and not slow"), environment)


STAGES = {
    "format": Stage("the layout of the source", python("ruff", "format", "--check", "--output-format=concise", ".")),
    "lint": Stage("likely mistakes", python("ruff", "check", "--output-format=concise", ".")),
    "types": Stage("strict types of the library", python("mypy")),
    "types-tests": Stage("types of the tests", python("mypy", "--config-file", "tests/mypy.ini")),
    "imports": Stage(
        "which package may import which", [str(Path(sys.executable).with_name("lint-imports")), "--no-logo"]
    ),
    "docs": Stage(
        "the documentation, without warnings", python("mkdocs", "build", "--strict", "-q", "-d", "build/site")
    ),
    "jit-off": lane("kernels as plain Python", "jit-off", NUMBA_DISABLE_JIT="1"),
    "bounds": lane("kernels with bounds checks", "bounds", NUMBA_BOUNDSCHECK="1"),
    "slow": Stage("tests that take long", python("pytest", "-q", "-m", "slow"), by_default=False),
    "fuzz": Stage(
        "random files, scans and results folders, an hour each",
        python("pytest", "-q", "-s", "-m", "fuzz", "--fuzz-seconds=3600"),
        by_default=False,
    ),
    "tests": Stage("everything else", python("pytest", "-q", "--durations=10")),
}


def run(name: str) -> tuple[bool, float]:
    """Run one stage, its output passed through; returns whether it passed, and its seconds."""
    stage = STAGES[name]
    print(f"== {name}: {stage.purpose}", flush=True)
    start = time.perf_counter()
    status = subprocess.call(stage.command, cwd=ROOT, env={**os.environ, **stage.environment})
    seconds = time.perf_counter() - start
    print(f"== {name}: {'passed' if status == 0 else f'FAILED with status {status}'} in {seconds:.1f} s\n", flush=True)
    return status == 0, seconds


def main(arguments: list[str]) -> int:
    """Run the stages named; returns the exit status."""
    if "--list" in arguments:
        print("\n".join(f"{name:12} {stage.purpose}" for name, stage in STAGES.items()))
        return 0
    unknown = [name for name in arguments if name not in STAGES]
    if unknown:
        print(f"error: unknown stage {', '.join(unknown)}; expected some of {', '.join(STAGES)}", file=sys.stderr)
        return 2
    names = arguments or [name for name, stage in STAGES.items() if stage.by_default]
    results = {name: run(name) for name in names}
    failed = [name for name, (passed, _) in results.items() if not passed]
    total = sum(seconds for _, seconds in results.values())
    verdict = f"FAILED: {', '.join(failed)}" if failed else "all passed"
    print(f"check of {len(results)} stages in {total:.0f} s: {verdict}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
