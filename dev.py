#!/usr/bin/env python3
"""Set up and run Vedette from a bare clone. Needs Python 3.11 to 3.14 and nothing else.

usage: python3 dev.py COMMAND [ARGUMENTS]

    reproduce [ARGUMENTS]   run the paper's experiment and draw its figures (`vedette reproduce`)
    check [STAGE ...]       run the whole check, or only the stages named (`check --list` names them)
    vedette [ARGUMENTS]     run any other command of the program
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

OLDEST, NEWEST = (3, 11), (3, 14)

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


def fingerprint(extent: str) -> str:
    """Changes when an environment set up for `extent` would have to be set up again."""
    digest = hashlib.sha256(f"{platform.python_version()} {sys.platform} {ROOT}".encode())
    for path in (lock_file(extent), ROOT / "pyproject.toml", ROOT / "dev.py"):
        digest.update(path.read_bytes())
    return f"{extent} {digest.hexdigest()}"


def is_ready(extent: str) -> bool:
    """Whether the environment holds the present lock of `extent`."""
    return PYTHON.exists() and STAMP.is_file() and fingerprint(extent) in STAMP.read_text("utf-8").splitlines()


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


def make_venv() -> None:
    """Make `.venv` anew, unless what is there was made by this very Python."""
    config = VENV / "pyvenv.cfg"
    if PYTHON.exists() and config.is_file() and f"version = {platform.python_version()}" in config.read_text("utf-8"):
        return
    interpreter = getattr(sys, "_base_executable", sys.executable)  # not the one inside the .venv to be cleared
    call(
        [interpreter, "-m", "venv", "--clear", str(VENV)],
        "If the venv module is missing, your system packages it apart (Debian, Ubuntu: apt install python3-venv).",
    )


def set_up(extent: str) -> None:
    """Install the locked dependencies of `extent` and the project itself into `.venv`; instant when already there."""
    if is_ready(extent):
        return
    with exclusive(ROOT / ".venv.lock"):
        if is_ready(extent):  # another process did it while this one waited
            return
        print(f"Setting up {VENV} (once; a minute or two, most of it download) ...", file=sys.stderr, flush=True)
        make_venv()
        STAMP.unlink(missing_ok=True)
        pip = [str(PYTHON), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input", "--no-user"]
        call(
            [*pip, "--require-hashes", "--only-binary", ":all:", "--requirement", str(lock_file(extent))],
            "Is a package registry within reach, and is this one of the platforms that the packages are built for?",
        )
        call([*pip, "--no-index", "--no-deps", "--no-build-isolation", "--editable", str(ROOT)], "See above.")
        done = [fingerprint("runtime")] if extent == "runtime" else [fingerprint("runtime"), fingerprint("check")]
        STAMP.write_text("\n".join(done) + "\n", "utf-8")


def main(arguments: list[str]) -> int:
    """Run one command; returns the exit status."""
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print((__doc__ or "").strip())
        return 0 if arguments else 2
    command, rest = arguments[0], arguments[1:]
    if command not in ("reproduce", "check", "vedette", "setup"):
        print(f"error: unknown command {command!r}\n\n{(__doc__ or '').strip()}", file=sys.stderr)
        return 2
    try:
        set_up("check" if command in ("check", "setup") else "runtime")
    except SetupError as error:
        print(error, file=sys.stderr)
        return 1
    if command == "setup":
        print(f"ready: {VENV}")
        return 0
    if command == "check":
        return subprocess.call([str(PYTHON), str(ROOT / "tools" / "check.py"), *rest], cwd=ROOT)
    program = [str(SCRIPTS / "vedette")]
    return subprocess.call([*program, *(["reproduce", *rest] if command == "reproduce" else rest)])


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
