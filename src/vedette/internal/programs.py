"""External programs in any language that exchange lines of JSON over a pipe: docs/benchmark.md."""

import json
import os
import shlex
import signal
import subprocess
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import IO, Any, NoReturn, TypeAlias

import numpy as np

from vedette.errors import InputError, VedetteError
from vedette.internal.reading import parse_json
from vedette.internal.text import elided, printable

PROTOCOL = "vedette 1"
MOST_BYTES = 2**24  # maximum length of an answer
_LAST_WORDS = 500  # bytes of standard error to keep
_FAREWELL_SECONDS = 1.0  # for a program to end after the end of its input
# One thread each, as there are as many runs as processors.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "JULIA_NUM_THREADS")

# Waits for a line, and kills a process group if its input ends without one, that is, if the holder was killed.
_GUARD = ("/bin/sh", "-c", 'read line || kill -s KILL -- "-$0"')

_Questions: TypeAlias = "SimpleQueue[bytes | None]"


class Program:
    """External program that answers each line of JSON with a line of JSON. Ends with this object, or with this process.

    Args:
        command: the program and its arguments.
        folder: working directory of the program.

    Raises:
        InputError: the command cannot be started.
    """

    def __init__(self, command: Sequence[str], folder: Path) -> None:
        self.name = elided(shlex.join(command), 100)
        self.answered = 0
        self._said = bytearray()
        self._questions: _Questions = SimpleQueue()
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        environment, pipe = {**dict.fromkeys(_THREADS, "1"), **os.environ}, subprocess.PIPE
        try:  # in a new session: Ctrl-C reaches this process only, which then ends the program
            child = subprocess.Popen(
                list(command), cwd=folder, env=environment, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
            )
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"command: expected a program that can be started; got {self.name}: {reason}") from None
        self._child, self._guard = child, _guard_of(child)
        Thread(target=_talk, args=(child, self._questions, self._answers), daemon=True).start()
        assert child.stderr is not None
        self._listener = Thread(target=_listen, args=(child.stderr, self._said), daemon=True)
        self._listener.start()
        self._end = weakref.finalize(self, _end, child, self._guard, self._questions)

    def ask(self, question: Mapping[str, Any], seconds: float) -> dict[str, Any]:
        """Return the answer to a question. If it is late, or not a JSON object, the program is ended.

        Raises `VedetteError` with what was expected, what was received, and the end of the program's standard error.
        """
        self.answered += 1
        self._questions.put(json.dumps(question, separators=(",", ":"), allow_nan=False).encode() + b"\n")
        try:
            line = self._answers.get(timeout=seconds)
        except Empty:
            self.refuse(f"an answer within {seconds:g} s", "none (is what it prints flushed?)")
        if len(line) > MOST_BYTES:
            self.refuse(f"a line of at most {MOST_BYTES} bytes", "a longer one")
        if not line.endswith(b"\n"):
            self.refuse("a line", f"{_shown(line)} and {self._ended()}" if line else self._ended())
        try:
            answer = parse_json(line)
        except ValueError as error:
            self.refuse("a JSON object", f"{_shown(line)} ({error})")
        if not isinstance(answer, dict):
            self.refuse("a JSON object", _shown(line))
        return answer

    def refuse(self, wanted: str, got: str) -> NoReturn:
        """End the program because of its last answer. Raises `VedetteError` that explains why."""
        self._end.detach()
        self._questions.put(None)
        _kill(self._child, self._guard)
        self._listener.join(_FAREWELL_SECONDS)
        words = printable(self._said.decode(errors="replace").strip()[-_LAST_WORDS:])
        said = f"; it said last: {words}" if words else ""
        raise VedetteError(f"program {self.name}, answer {self.answered}: expected {wanted}; got {got}{said}")

    def _ended(self) -> str:
        """Return in words how the program ended."""
        try:
            return f"its end, with status {self._child.wait(_FAREWELL_SECONDS)}"
        except subprocess.TimeoutExpired:
            return "the end of its output"


def start_program(
    command: Sequence[str], folder: Path, role: str, scene: Mapping[str, Any], rng: np.random.Generator, seconds: float
) -> Program:
    """Return a program that has received its role and its scene, and has answered that it is ready.

    rng: the program's seed is drawn from it. Raises as `Program` and `Program.ask`.
    """
    program = Program(command, folder)
    told = {"protocol": PROTOCOL, "role": role, "seed": int(rng.integers(2**31)), "scene": scene}
    if program.ask(told, seconds).get("ready") is not True:
        program.refuse('"ready": true, in answer to its first line', "another answer")
    return program


def _shown(line: bytes) -> str:
    return elided(printable(line[:300].decode(errors="replace").strip()), 100) or "an empty line"


def _talk(child: subprocess.Popen[bytes], questions: _Questions, answers: SimpleQueue[bytes]) -> None:
    """Pass on questions and answers in a thread, so that the caller need not wait. The question None ends the input."""
    assert child.stdin is not None
    assert child.stdout is not None
    with child.stdout:
        for question in iter(questions.get, None):
            with suppress(OSError):  # the program has ended; its last line is still read
                child.stdin.write(question)
                child.stdin.flush()
            answers.put(child.stdout.readline(MOST_BYTES + 1))
        with suppress(OSError):
            child.stdin.close()


def _listen(stream: IO[bytes], said: bytearray) -> None:
    """Keep the last bytes of a stream, and read the rest, so that the program never blocks on it."""
    with stream:
        while part := os.read(stream.fileno(), 4096):
            said += part
            del said[:-_LAST_WORDS]


def _guard_of(child: subprocess.Popen[bytes]) -> subprocess.Popen[bytes] | None:
    """Return a process that kills a program, and the processes it has started, if this process is killed."""
    if not hasattr(os, "killpg"):
        return None
    nothing = subprocess.DEVNULL
    return subprocess.Popen(
        [*_GUARD, str(child.pid)], stdin=subprocess.PIPE, stdout=nothing, stderr=nothing, start_new_session=True
    )


def _end(child: subprocess.Popen[bytes], guard: subprocess.Popen[bytes] | None, questions: _Questions) -> None:
    """Close the program's input. Kill the program if it does not end by itself."""
    questions.put(None)
    with suppress(subprocess.TimeoutExpired):
        child.wait(_FAREWELL_SECONDS)
    _kill(child, guard)


def _kill(child: subprocess.Popen[bytes], guard: subprocess.Popen[bytes] | None) -> None:
    """End a program if it still runs, and kill the processes that it has started in any case."""
    if guard is not None:
        with suppress(OSError):
            guard.communicate(b"\n")
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(child.pid, signal.SIGKILL)
    if child.poll() is None:
        child.kill()
        child.wait()
