"""Remarks about clients, so few that no client can fill the screen or a log with them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

SECONDS = 60.0  # between two remarks of one kind and address
_MOST_ADDRESSES = 16  # of one kind, with remarks of their own


class Named(Protocol):
    """What remarks are about."""

    name: str
    address: str


class Remarks:
    """Passes on one remark of a kind and address a minute, with the number of those in between.

    From the 17th address on, addresses share their remarks, so that many addresses are no flood either.

    Args:
        tell: receives each remark that is passed on.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._known: dict[tuple[str, str], list[float]] = {}  # by kind and address: time of the last one, number since

    def __call__(self, client: Named, kind: str, detail: str = "") -> None:
        """Remark that a client did something.

        Args:
            client: whose name begins the remark.
            kind: what it did, the same words for all of a kind.
            detail: what else is to be said of this one.
        """
        now = time.monotonic()
        known = self._of(kind, client.address, now)
        if known[0] and now - known[0] < SECONDS:
            known[1] += 1
            return
        more = f" (and {known[1]:.0f} more such lines were left out)" if known[1] else ""
        known[:] = now, 0.0
        self._tell(f"{client.name} {kind}{detail}{more}")

    def _of(self, kind: str, address: str, now: float) -> list[float]:
        if (kind, address) not in self._known:
            old = [key for key, (last, num) in self._known.items() if not num and now - last >= SECONDS]
            for key in old:
                del self._known[key]
            if sum(of == kind for of, _ in self._known) >= _MOST_ADDRESSES:
                address = ""
        return self._known.setdefault((kind, address), [0.0, 0.0])
