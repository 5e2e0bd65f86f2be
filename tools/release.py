"""Make what is released, in dist/, and try each file in a clean environment; started by `python3 dev.py release`.

usage: release.py [SCENARIO ...]

The source distribution; of it the wheel of pure Python, and a wheel for this Python and system that holds kernels: for
the scenarios named (or those that people begin with), and for each level of processor that this one can run.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from numba.core.codegen import get_host_cpu_features

from vedette import __version__
from vedette.kernels.base.cache_paths import LEVELS, supports_level

ROOT = Path(__file__).resolve().parents[1]
DIST, KERNELS = ROOT / "dist", ROOT / "build" / "compiled-kernels"
FIRST_FIGURE = Path("run") / "figures" / "tracks.png"
TRIALS = ("paper-a", "shore-radar")  # what the README and `vedette init` begin with
CHEAP_STAGES = ("format", "lint", "imports")


class ReleaseError(Exception):
    """What was made cannot be used; the message says what was found."""


def call(command: list[object], folder: Path, environment: Mapping[str, object]) -> str:
    """Run a program; returns what it printed. `ReleaseError` with that where it fails."""
    result = subprocess.run(
        [str(each) for each in command],
        cwd=folder,
        env={name: str(value) for name, value in environment.items()},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding="utf-8",
        errors="replace",
    )
    if result.returncode:
        raise ReleaseError(f"{result.stdout}\nerror: {' '.join(map(str, command))}: exit status {result.returncode}")
    return result.stdout


def build(kind: str, source: Path, scratch: Path, environment: Mapping[str, object] = os.environ) -> Path:
    """The one file that hatchling builds of a folder, moved to dist/."""
    made = Path(tempfile.mkdtemp(dir=scratch))
    call([sys.executable, "-m", "hatchling", "build", "--target", kind, "--directory", made], source, environment)
    (built,) = made.iterdir()
    return Path(shutil.move(built, DIST / built.name))


def compile_kernels(scenarios: list[str]) -> list[str]:
    """Compile into `KERNELS` for every level that this processor can run, as it has to; returns the levels."""
    shutil.rmtree(KERNELS, ignore_errors=True)
    levels = [level for level in LEVELS if supports_level(level, get_host_cpu_features())]
    for level in levels:
        print(f"compiling for {level} ...", flush=True)
        # No features but those of the level: Numba would add this processor's own.
        processor = {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": "", "VEDETTE_CACHE_DIR": KERNELS}
        call([sys.executable, ROOT / "tools" / "compile_kernels.py", *scenarios], ROOT, {**os.environ, **processor})
    return levels


class CleanEnvironment:
    """A virtual environment with one file installed and what it needs, and a folder to work in."""

    def __init__(self, file: Path, extra: str, place: Path) -> None:
        self.folder = Path(tempfile.mkdtemp(dir=place))
        self._scripts = self.folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
        call([sys.executable, "-m", "venv", self.folder / "venv"], self.folder, os.environ)
        start = time.perf_counter()
        self("python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"{file}{extra}")
        self.seconds = time.perf_counter() - start

    def __call__(self, program: str, *arguments: object, **more: object) -> str:
        strange = ("NUMBA_", "VEDETTE_", "PYTHON")
        clean = {name: value for name, value in os.environ.items() if not name.startswith(strange)}
        environment = {**clean, "VEDETTE_CACHE_DIR": self.folder / "cache", **more}
        return call([self._scripts / program, *arguments], self.folder, environment)

    def first_figure(self, *arguments: str, compiles: bool, **more: object) -> str:
        """Run a scenario to its first figure. `ReleaseError` unless kernels are compiled as they should be, or not."""
        start = time.perf_counter()
        output = self("vedette", "run", *arguments, "--out", "run", "--overwrite", **more)
        seconds = time.perf_counter() - start
        if not (self.folder / FIRST_FIGURE).is_file():
            raise ReleaseError(f"{output}\nerror: expected a figure {FIRST_FIGURE}; there is none")
        if ("compiling kernels" in output) is not compiles:
            raise ReleaseError(f"{output}\nerror: expected kernels {'to be compiled' if compiles else 'of the wheel'}")
        said = " ".join((*arguments, *(f"{name}={value}" for name, value in more.items())))
        return f"installed in {self.seconds:.0f} s, first figure of {said} after another {seconds:.0f} s"


def try_source(file: Path, unpacked: Path, scratch: Path) -> str:
    """It installs, and what it unpacks to passes cheap stages of the check."""
    installed = CleanEnvironment(file, "", scratch)
    if __version__ not in installed("vedette", "--version"):
        raise ReleaseError(f"{file.name}: expected version {__version__}")
    call([sys.executable, "tools/check.py", *CHEAP_STAGES], unpacked, {**os.environ, "PYTHONPATH": unpacked / "src"})
    return f"installed in {installed.seconds:.0f} s, stages {', '.join(CHEAP_STAGES)} of its check passed"


def main(scenarios: list[str]) -> int:
    """Make and try everything; returns the exit status."""
    if f"## [{__version__}] - 2" not in (ROOT / "CHANGELOG.md").read_text("utf-8"):
        print(f"note: CHANGELOG.md has no date for {__version__} yet", file=sys.stderr)
    DIST.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="vedette-release-") as name:
        scratch = Path(name)
        try:
            source = build("sdist", ROOT, scratch)
            with tarfile.open(source) as archive:
                archive.extractall(scratch, filter="data")
            unpacked = scratch / source.name.removesuffix(".tar.gz")
            pure = build("wheel", unpacked, scratch)
            levels = compile_kernels(scenarios)
            compiled = build("wheel", unpacked, scratch, {**os.environ, "VEDETTE_COMPILED_KERNELS": KERNELS})
            print(f"{source.name}: {try_source(source, unpacked, scratch)}", flush=True)
            begun = CleanEnvironment(compiled, "[report]", scratch)
            for level in levels:
                processor = {} if level == levels[0] else {"NUMBA_CPU_NAME": level}
                for trial in scenarios or TRIALS:
                    told = begun.first_figure(trial, compiles=False, **processor)
                    print(f"{compiled.name}: {told}", flush=True)
            anew = CleanEnvironment(pure, "[report]", scratch)
            print(
                f"{pure.name}: {anew.first_figure('linear-10', '--planner', 'stationary', compiles=True)}", flush=True
            )
        except ReleaseError as error:
            print(error, file=sys.stderr)
            return 1
    for file in (source, pure, compiled):
        print(f"{file.relative_to(ROOT)}: {file.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
