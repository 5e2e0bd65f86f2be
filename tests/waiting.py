"""How tests wait for other processes, and interrupt them."""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Callable

# Seconds: far beyond what anything waited for takes, so that a busy machine is never taken for a fault.
PATIENCE = 600.0


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Until the condition holds; `what` says what was waited for in vain."""
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"waited {PATIENCE:g} s in vain: {what}")
        time.sleep(0.02)


def wait_for_port(port: int) -> None:
    """Until something listens at a port of this machine."""

    def is_open() -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0

    wait_until(is_open, f"something that listens at port {port}")


def heed_interrupts() -> None:
    """As a program started from a terminal does; one started in the background is told to ignore them."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
