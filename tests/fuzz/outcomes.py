"""What may come of any input: a value, or a named error that a person can read, within bounded time."""

from __future__ import annotations

import re
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from vedette.errors import VedetteError
from waiting import PATIENCE

_T = TypeVar("_T")
_PRIVATE = re.compile(
    r"np\.(float|int|str|bool)|array\(|dtype|Traceback|object at 0x|<class|<function|pydantic|ruamel|"
    r"ValidationError|Error\(|\b_[A-Z]\w+\b|JsonValue|function-after|datetime\.\w+\(|NoneType|tagged-union"
)
_LONGEST_LINE, _MOST_LINES = 4000, 400
# Work is a few hundredths of a second, and seconds for the largest files.
SECONDS = PATIENCE


def outcome(call: Callable[[], _T]) -> _T | None:
    """What the call returns; None where it ends with an error of the library's whose message can be read."""
    try:
        return call()
    except VedetteError as error:
        check_message(error)
    return None


def check_message(error: VedetteError) -> None:
    """Fail unless the message is short, printable, and in words."""
    text = str(error)
    lines = text.split("\n")
    assert text.strip(), f"an empty message of {type(error).__name__}"
    assert len(lines) <= _MOST_LINES, f"a message of {len(lines)} lines, from {text[:300]!r}"
    for line in lines:
        assert len(line) <= _LONGEST_LINE, f"a line of {len(line)} letters, from {line[:300]!r}"
        assert line.isprintable(), f"a message that cannot be printed: {line[:1000]!r}"
        assert not (found := _PRIVATE.search(line)), f"{found[0]} in a message: {line[:1000]}"


@contextmanager
def bounded(what: Any, seconds: float = SECONDS) -> Iterator[None]:
    """Fail where the body takes far longer than anything sensible does."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: Any) -> None:
        raise AssertionError(f"still at work after {seconds} s: {str(what)[:500]}")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
