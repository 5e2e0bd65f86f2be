"""How long a start takes, in CPU seconds (user and system, with all processes that it starts), each in a fresh process.

    python benchmarks/start.py                              # warm: kernels compiled before
    python benchmarks/start.py --against ../other/src       # turn about with another checkout
    python benchmarks/start.py --cold                       # also with nothing compiled at all (minutes)

Least and median of the repeats. Bytecode is written to a folder of its own before anything is timed, as where Python
may write beside the sources; `--no-bytecode` times a start where it may not (PYTHONDONTWRITEBYTECODE).
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from timing import Measure, Once

import vedette

_OWN = Path(__file__).resolve().parents[1] / "src"

_PROGRAM = "import sys; from vedette.cli import app; sys.argv = {!r}; app()"

# Ends a run with its first scan, whichever the version.
_FIRST_SCAN = """
import os, sys
def main():
    from vedette.tracking import Distributed
    step = Distributed.step
    def first(*arguments, **options):
        step(*arguments, **options)
        os._exit(0)
    Distributed.step = first
    from vedette.cli import app
    sys.argv = ["vedette", "run", "paper-a"]
    app()
if __name__ == "__main__":
    main()
"""


def programs_of(folder: Path) -> dict[str, str]:
    """Programs to time, by name."""
    return {
        "vedette --help": _PROGRAM.format(["vedette", "--help"]),
        "import vedette.control": "import vedette.control",
        "import vedette.evaluation.runs": "import vedette.evaluation.runs",
        "run paper-a to its first scan": _FIRST_SCAN,
        "run paper-a": _PROGRAM.format(["vedette", "run", "paper-a"]),
        "run paper-a --out, with figures": _PROGRAM.format(
            ["vedette", "run", "paper-a", "--out", str(folder / "run"), "--overwrite"]
        ),
    }


def cpu_seconds(program: str, environment: dict[str, str], folder: Path) -> float:
    """Of a fresh interpreter that runs `program`, and of its children."""
    script = folder / "start_program.py"
    script.write_text(program, encoding="utf-8")
    with subprocess.Popen([sys.executable, str(script)], env=environment, stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"failed with status {process.returncode}: {program}")
    return usage.ru_utime + usage.ru_stime


def environment_of(source: Path, folder: Path, *, bytecode: bool, cache: Path | None = None) -> dict[str, str]:
    """What a process of one checkout is started with."""
    environment = os.environ | {"PYTHONPATH": str(source), "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}
    environment |= {"PYTHONDONTWRITEBYTECODE": "" if bytecode else "1"}
    return environment | ({"VEDETTE_CACHE_DIR": str(cache)} if cache else {})


def prepared(name: str) -> Once:
    """What gives the CPU seconds of one of the programs, with the library of this process and kernels compiled."""
    folder = tempfile.TemporaryDirectory()
    place = Path(folder.name)
    program = programs_of(place)[name]
    environment = environment_of(Path(vedette.__file__).parents[1], place, bytecode=True)
    cpu_seconds(program, environment, place)

    def once(held: tempfile.TemporaryDirectory[str] = folder) -> float:
        return cpu_seconds(program, environment, Path(held.name))

    return once


def measures() -> Iterator[Measure]:
    """A start of each program."""
    for name in programs_of(Path()):
        yield Measure("start", name, partial(prepared, name), unit="s", rounds=5, long=name.startswith("run paper-a"))


def turn_about(
    programs: dict[str, str], sources: list[Path], folder: Path, *, repeats: int, bytecode: bool
) -> Iterator[tuple[str, list[list[float]]]]:
    """For each program the seconds of each checkout, one after the other, after one that warms up."""
    environments = [environment_of(source, folder, bytecode=bytecode) for source in sources]
    for environment in environments:
        cpu_seconds(programs["run paper-a --out, with figures"], environment, folder)
    for name, program in programs.items():
        seconds: list[list[float]] = [[] for _ in sources]
        for _ in range(repeats):
            for mine, environment in zip(seconds, environments, strict=True):
                mine.append(cpu_seconds(program, environment, folder))
        yield name, seconds


def told(seconds: list[float]) -> str:
    """Least and median."""
    return f"{min(seconds):8.2f} {statistics.median(seconds):8.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, help="the `src` folder of another checkout")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--cold", action="store_true", help="also from an empty kernel cache")
    parser.add_argument("--no-bytecode", action="store_true", help="Python may not keep compiled modules")
    options = parser.parse_args()
    sources = [_OWN, *([options.against.resolve()] if options.against else [])]
    heads = ["this", "other"][: len(sources)]
    print(f"{'CPU seconds':34}" + "".join(f"{head + ' least':>9}{'median':>9}  " for head in heads))
    with tempfile.TemporaryDirectory() as name:
        folder, bytecode = Path(name), not options.no_bytecode
        programs = programs_of(folder)
        for what, seconds in turn_about(programs, sources, folder, repeats=options.repeats, bytecode=bytecode):
            print(f"{what:34}" + "  ".join(map(told, seconds)), flush=True)
        if options.cold:
            cold = []
            for index, source in enumerate(sources):
                environment = environment_of(source, folder, bytecode=bytecode, cache=folder / f"cold-{index}")
                cold.append([cpu_seconds(programs["run paper-a"], environment, folder)])
            print(f"{'run paper-a, nothing compiled':34}" + "  ".join(map(told, cold)))


if __name__ == "__main__":
    main()
