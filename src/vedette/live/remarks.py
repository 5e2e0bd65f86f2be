"""Remarks about clients, limited in number so that no client can fill the screen or a log with them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

SECONDS = 60.0  # between two remarks of one kind and address
_MOST_ADDRESSES = 16  # addresses per kind that have separate remarks


class Named(Protocol):
    """A client that remarks are about."""

    name: str
    address: str


class Remarks:
    """Filter that passes on one remark per kind, address and minute, with the number of those left out.

    From the 17th address of a kind on, addresses share their remarks, which also limits the remarks of many addresses.

    Args:
        tell: receives each remark that is passed on.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._known: dict[tuple[str, str], list[float]] = {}  # by kind and address: time of the last one, number since

    def __call__(self, client: Named, kind: str, detail: str = "") -> None:
        """Remark that a client did something.

        Args:
            client: the client; the remark begins with its name.
            kind: what the client did, with the same words for all remarks of a kind.
            detail: further text for this remark.
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
