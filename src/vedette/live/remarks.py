"""Remarks about clients, limited in number so that no client can fill the screen or a log with them."""

import time
from collections.abc import Callable
from typing import Protocol

REMARK_INTERVAL = 60.0  # between two remarks of one kind and address
_MAX_ADDRESSES = 16  # addresses per kind that have separate remarks


class NamedClient(Protocol):
    """A client that remarks are about."""

    name: str
    address: str


class Remarks:
    """Filter that passes on one remark per kind, address and minute, with the number of those left out.

    From the 17th address of a kind on, addresses share their remarks, which also limits the remarks of many addresses.

    Args:
        emit: receives each remark that is passed on.
    """

    def __init__(self, emit: Callable[[str], object]) -> None:
        self._emit = emit
        self._entries: dict[
            tuple[str, str], list[float]
        ] = {}  # by kind and address: time of the last one, number since

    def __call__(self, client: NamedClient, kind: str, detail: str = "") -> None:
        """Remark that a client did something.

        Args:
            client: the client. The remark begins with its name.
            kind: what the client did, with the same words for all remarks of a kind.
            detail: further text for this remark.
        """
        now = time.monotonic()
        entry = self._entry(kind, client.address, now)
        if entry[0] and now - entry[0] < REMARK_INTERVAL:
            entry[1] += 1
            return
        more = f" (and {entry[1]:.0f} more such lines were left out)" if entry[1] else ""
        entry[:] = now, 0.0
        self._emit(f"{client.name} {kind}{detail}{more}")

    def _entry(self, kind: str, address: str, now: float) -> list[float]:
        if (kind, address) not in self._entries:
            old = [key for key, (last, num) in self._entries.items() if not num and now - last >= REMARK_INTERVAL]
            for key in old:
                del self._entries[key]
            if sum(known_kind == kind for known_kind, _ in self._entries) >= _MAX_ADDRESSES:
                address = ""
        return self._entries.setdefault((kind, address), [0.0, 0.0])
