#!/usr/bin/env python3
"""Set up and run Vedette from a bare clone or source distribution. Needs Python 3.11 to 3.15 and nothing else.

usage: python3 dev.py COMMAND [ARGUMENTS]

    reproduce [ARGUMENTS]   run the paper's experiment and draw its figures (`vedette reproduce`)
    check [STAGE ...]       run the whole check, or only the stages named (`check --list` names them)
    docs [PORT] [--open]    show the documentation in a browser of this machine, anew when a page changes, until Ctrl-C
    vedette [ARGUMENTS]     run any other command of the program
    release [SCENARIO ...]  make source distribution and wheels, one with compiled kernels, in dist/, and try each
    setup                   only set up the environment for all of these

The first call makes `.venv` beside this file and installs the locked dependencies into it.
"""

import contextlib
import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

OLDEST, NEWEST = (3, 11), (3, 15)

# Before anything that an older Python would stumble over.
if not OLDEST <= sys.version_info[:2] <= NEWEST:
    sys.exit(
        "error: Vedette needs Python {}.{} to {}.{}; this is Python {}.{} ({}).\n"
        "Start this file with another, for example: python3.{} dev.py".format(
            *OLDEST, *NEWEST, *sys.version_info[:2], sys.executable, NEWEST[1]
        )
    )

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
SCRIPTS = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")
STAMP = VENV / "installed.txt"


class SetupError(Exception):
    """The environment cannot be made; the message says what to do."""


def lock_file(extent: str) -> Path:
    """The locked dependencies of an extent: `runtime`, or `check`, which holds all of `runtime` and more."""
    return ROOT / "requirements" / f"{extent}.txt"


def lock_marks(extent: str) -> set[str]:
    """What the stamp of an environment says when it holds the present locks of `extent`, by this Python."""
    extents = ("runtime",) if extent == "runtime" else ("runtime", "check")
    return {f"{name} {_digest(lock_file(name), platform.python_version(), sys.platform)}" for name in extents}


def project_mark() -> str:
    """What the stamp says when the project itself is installed as pyproject.toml has it."""
    return f"project {_digest(ROOT / 'pyproject.toml', str(ROOT))}"


def installed() -> set[str]:
    """The marks on the stamp; none for an environment that is missing or was left half made."""
    return set(STAMP.read_text("utf-8").splitlines()) if PYTHON.exists() and STAMP.is_file() else set()


def _digest(path: Path, *more: str) -> str:
    return hashlib.sha256(path.read_bytes() + "\0".join(more).encode()).hexdigest()


@contextlib.contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Hold a lock between processes, so that two first calls do not set up over each other."""
    with path.open("a+b") as handle:
        if sys.platform == "win32":
            import msvcrt

            while True:
                with contextlib.suppress(OSError):  # gives up by itself after ten seconds
                    msvcrt.locking(handle.fileno(), msvcrt.LK_LOCK, 1)
                    break
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def call(arguments: list[str], advice: str) -> None:
    """Run a step of the set-up; its output is shown only if it fails."""
    result = subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    if result.returncode:
        raise SetupError(f"{result.stdout.strip()}\n\nerror: {' '.join(arguments)}\nfailed. {advice}")


def set_up(extent: str) -> None:
    """Install the locked dependencies of `extent` and the project itself into `.venv`; instant when already there."""
    wanted = lock_marks(extent) | {project_mark()}
    if wanted <= installed():
        return
    with exclusive(ROOT / ".venv.lock"):
        present = installed()
        if wanted <= present:  # another process did it while this one waited
            return
        print(f"Setting up {VENV} (once; a minute or two, most of it download) ...", file=sys.stderr, flush=True)
        locks = {mark for mark in present if not mark.startswith("project ")}
        if not locks or not locks <= lock_marks("check"):
            make_venv()  # anew: installing a changed lock over the old one would leave what it no longer names
            locks = set()
        STAMP.unlink(missing_ok=True)
        install(extent, dependencies=not lock_marks(extent) <= locks)
        STAMP.write_text("\n".join(sorted(wanted | locks)) + "\n", "utf-8")


def make_venv() -> None:
    """Make an empty `.venv` in place of whatever is there."""
    interpreter = getattr(sys, "_base_executable", sys.executable)  # not the one inside the .venv to be cleared
    call(
        [interpreter, "-m", "venv", "--clear", str(VENV)],
        "If the venv module is missing, your system packages it apart (Debian, Ubuntu: apt install python3-venv).",
    )


def install(extent: str, *, dependencies: bool) -> None:
    """Install the project, and the dependencies locked for `extent` where they are asked for, into `.venv`."""
    pip = [str(PYTHON), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input", "--no-user"]
    if not sys.dont_write_bytecode:
        pip.append("--no-compile")  # Python compiles what it imports; compiling all modules takes longer than the rest
    if dependencies:
        source = ["--no-binary", "pyyaml"] if sys.version_info >= (3, 15) else []  # no wheel yet; needs no compiler
        call(
            [*pip, "--require-hashes", "--only-binary", ":all:", *source, "--requirement", str(lock_file(extent))],
            "Is a package registry within reach, and is this one of the platforms that the packages are built for?",
        )
    call(
        [*pip, "--no-index", "--no-deps", "--no-build-isolation", "--editable", str(ROOT)],
        "Is pyproject.toml, and all that it names, in place?",
    )


def attend(command: list[str], folder: Path | None = None) -> int:
    """Run a program to its end. Ctrl-C reaches it too: it is given the time to tidy up."""
    with subprocess.Popen(command, cwd=folder) as process:
        while True:
            with contextlib.suppress(KeyboardInterrupt):
                return process.wait()


def main(arguments: list[str]) -> int:
    """Run one command; returns the exit status."""
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print((__doc__ or "").strip())
        return 0 if arguments else 2
    command, rest = arguments[0], arguments[1:]
    if command not in ("reproduce", "check", "docs", "vedette", "release", "setup"):
        print(f"error: unknown command {command!r}\n\n{(__doc__ or '').strip()}", file=sys.stderr)
        return 2
    if command == "docs" and [one for one in rest if one != "--open" and not one.isdecimal()]:
        print(f"error: docs: expected a port, --open or nothing; got {' '.join(rest)}", file=sys.stderr)
        return 2
    try:
        set_up("runtime" if command in ("reproduce", "vedette") else "check")
    except SetupError as error:
        print(error, file=sys.stderr)
        return 1
    if command == "setup":
        print(f"ready: {VENV}")
        return 0
    if command in ("check", "release"):
        return attend([str(PYTHON), str(ROOT / "tools" / f"{command}.py"), *rest], ROOT)
    if command == "docs":
        return attend([str(PYTHON), str(ROOT / "tools" / "docs.py"), "serve", *rest], ROOT)
    program = [str(SCRIPTS / "vedette")]
    return attend([*program, *(["reproduce", *rest] if command == "reproduce" else rest)])


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
