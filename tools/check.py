"""Run every check of the project, each as a stage with its time; started by `python3 dev.py check`.

usage: check.py [--list] [--one-by-one] [STAGE ...]

With no stage named, all but the long ones (`slow`, `fuzz`, `bounds`) are run. A stage that fails does not stop the
others. Two stages run side by side; what each prints goes to build/check/ and is shown when it ends. A stage alone, or
each of them with --one-by-one, shows it at once.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build"
LOGS = BUILD / "check"
GRACE = 10.0  # seconds that an interrupted stage has to tidy up

# Tests that start processes, and those of the program as a user runs it; the others are of the library's parts.
CAMPAIGNS = [f"tests/{name}" for name in ("campaigns", "fuzz", "test_extending.py", "test_faq.py", "test_project.py")]
CONTROL = ["tests/control"]
FILTERS = ["tests/filters", "tests/tracking"]
PROGRAM = [f"tests/{name}" for name in ("cli", "evaluation", "reports", "scenarios", "simulation", "test_examples.py")]


@dataclass(frozen=True)
class Stage:
    """A command that must exit with 0, and what it is for."""

    purpose: str
    command: list[str]
    environment: dict[str, str] = field(default_factory=dict)
    by_default: bool = True


def python(module: str, *arguments: str) -> list[str]:
    return [sys.executable, "-m", module, *arguments]


# Files and folders whose words are checked.
SPELLED = ("README.md", "CHANGELOG.md", "dev.py", "docs", "src", "tests", "benchmarks", "examples", "tools")


def lane(purpose: str, name: str, *, by_default: bool = True, **environment: str) -> Stage:
    """The marked tests under another way of compiling, with a kernel cache of its own."""
    environment["VEDETTE_CACHE_DIR"] = str(BUILD / f"kernels-{name}")
    return Stage(purpose, python("pytest", "-q", "-m", "lanes and not slow"), environment, by_default)


def tests(purpose: str, *places: str) -> Stage:
    return Stage(purpose, python("pytest", "-q", "--durations=10", *places))


# In the order in which they start. The tests of the library compile most kernels, while the other side is busy with
# what needs none of them; what starts processes begins when the kernels are there. The longest start first, so that
# none runs alone at the end.
STAGES = {
    "tests-library": tests(
        "models, densities, fusion and all below",
        "tests",
        *(f"--ignore={place}" for place in (*CAMPAIGNS, *CONTROL, *FILTERS, *PROGRAM)),
    ),
    "types": Stage("strict types of the library", python("mypy")),
    "types-tests": Stage("types of the tests", python("mypy", "--config-file", "tests/mypy.ini")),
    "jit-off": lane("kernels as plain Python", "jit-off", NUMBA_DISABLE_JIT="1"),
    # NumPy checks every index of the same tests in `jit-off`; this also checks those of the compiled code. An index is
    # out of bounds however well the code is optimised, and little optimisation compiles faster.
    "bounds": lane("kernels with bounds checks", "bounds", by_default=False, NUMBA_BOUNDSCHECK="1", NUMBA_OPT="1"),
    "tests-program": tests("command line, scenarios, reports, examples", *PROGRAM),
    "tests-filters": tests("filters and trackers", *FILTERS),
    "tests-campaigns": tests("campaigns, fuzzers, extensions, the project itself", *CAMPAIGNS),
    "tests-control": tests("decisions: futures, rewards, searches, planners", *CONTROL),
    "docs": Stage("the site of the documentation, without warnings", [sys.executable, "tools/docs.py"]),
    "format": Stage("the layout of the source", python("ruff", "format", "--check", "--output-format=concise", ".")),
    "prose": Stage("turns of phrase and lengths of guides", [sys.executable, "tools/prose.py"]),
    "spelling": Stage("frequent misspellings", python("codespell_lib", *SPELLED)),
    "lint": Stage("likely mistakes", python("ruff", "check", "--output-format=concise", ".")),
    "imports": Stage(
        "which package may import which", [str(Path(sys.executable).with_name("lint-imports")), "--no-logo"]
    ),
    "slow": Stage("tests that take long", python("pytest", "-q", "-m", "slow"), by_default=False),
    "fuzz": Stage(
        "random files, scans and results folders, an hour each",
        python("pytest", "-q", "-s", "-m", "fuzz", "--fuzz-seconds=3600"),
        by_default=False,
    ),
}


class Outcome(NamedTuple):
    """How a stage ended: seconds that it took, and seconds of processor time of all its processes."""

    name: str
    passed: bool
    seconds: float
    cpu: float | None


class Running:
    """A stage that has been started; what it prints is passed through, or kept in a file until it ends.

    cpu: seconds of processor time of all its processes, once it has ended; None where the system does not tell.
    """

    cpu: float | None = None

    def __init__(self, name: str, *, apart: bool) -> None:
        self.name = name
        self._purpose, self._start = STAGES[name].purpose, time.perf_counter()
        self._log = LOGS / f"{name}.log" if apart else None
        print(f"{'--' if apart else '=='} {name}: {self._purpose}", flush=True)
        with self._log.open("wb") if self._log else nullcontext() as output:
            self.process = subprocess.Popen(
                STAGES[name].command,
                cwd=ROOT,
                env={**os.environ, **STAGES[name].environment},
                stdout=output,
                stderr=subprocess.STDOUT if apart else None,
            )

    def ended(self, seconds: float = 0.0) -> bool:
        """Whether it has come to its end, within so many seconds from now."""
        deadline = time.monotonic() + seconds
        while self._poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        return self.process.returncode is not None

    def _poll(self) -> int | None:
        if self.process.returncode is not None or sys.platform == "win32":
            return self.process.poll()
        number, status, used = os.wait4(self.process.pid, os.WNOHANG)
        if number:
            self.process.returncode = os.waitstatus_to_exitcode(status)
            self.cpu = used.ru_utime + used.ru_stime
        return self.process.returncode

    def tell(self) -> Outcome:
        """Show what was kept of its output, and how it ended."""
        seconds, status = time.perf_counter() - self._start, self.process.returncode
        if self._log is not None:
            print(f"\n== {self.name}: {self._purpose}", flush=True)
            print(self._log.read_text("utf-8", errors="replace"), end="")
        verdict = "passed" if status == 0 else f"FAILED with status {status}"
        print(f"== {self.name}: {verdict} in {seconds:.1f} s\n", flush=True)
        return Outcome(self.name, status == 0, seconds, self.cpu)


@contextmanager
def ended_at_last(running: list[Running]) -> Iterator[None]:
    """Leave no stage behind: an interrupted one tidies up, and says how far it came."""
    try:
        yield
    finally:
        deadline = time.monotonic() + GRACE
        for one in running:
            if not one.ended(max(0.0, deadline - time.monotonic())):
                one.process.terminate()
                one.process.wait()
            one.tell()


def run(names: list[str], at_once: int) -> list[Outcome]:
    """Run the stages named, so many side by side."""
    LOGS.mkdir(parents=True, exist_ok=True)
    waiting, running, outcomes = list(names), list[Running](), list[Outcome]()
    with ended_at_last(running):
        while waiting or running:
            while waiting and len(running) < at_once:
                running.append(Running(waiting.pop(0), apart=at_once > 1))
            time.sleep(0.05)
            for one in [one for one in running if one.ended()]:
                running.remove(one)
                outcomes.append(one.tell())
    return outcomes


def summary(outcomes: list[Outcome]) -> str:
    """A line a stage, those that took the most processor time first."""
    lines = [f"{'stage':16}{'':8}{'elapsed':>10}{'processor':>12}"]
    for one in sorted(outcomes, key=lambda one: -(one.cpu or 0.0)):
        cpu = "-" if one.cpu is None else f"{one.cpu:.0f} s"
        lines.append(f"{one.name:16}{'passed' if one.passed else 'FAILED':8}{one.seconds:8.0f} s{cpu:>12}")
    return "\n".join(lines)


def main(arguments: list[str]) -> int:
    """Run the stages named; returns the exit status."""
    if "--list" in arguments:
        print("\n".join(f"{name:14} {stage.purpose}" for name, stage in STAGES.items()))
        return 0
    named = [name for name in arguments if name != "--one-by-one"]
    unknown = [name for name in named if name not in STAGES]
    if unknown:
        print(f"error: unknown stage {', '.join(unknown)}; expected some of {', '.join(STAGES)}", file=sys.stderr)
        return 2
    names = named or [name for name, stage in STAGES.items() if stage.by_default]
    alone = len(names) == 1 or "--one-by-one" in arguments
    start = time.perf_counter()
    try:
        outcomes = run(names, 1 if alone else 2)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    failed = [one.name for one in outcomes if not one.passed]
    verdict = f"FAILED: {', '.join(failed)}" if failed else "all passed"
    print(summary(outcomes))
    print(f"check of {len(names)} stages in {time.perf_counter() - start:.0f} s: {verdict}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
