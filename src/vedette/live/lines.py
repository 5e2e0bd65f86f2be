"""Splitting of bytes from any source into lines, in bounded memory."""

import asyncio
import contextlib
import os
import threading
from collections.abc import AsyncIterator
from typing import Any

from vedette.live.messages import MAX_LINE_BYTES

CHUNK = 1 << 16


class LineSplitter:
    """Splitter of arriving bytes into lines, in bounded memory: at most `max_bytes + 1` bytes of a line are kept."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes, self._part = max_bytes, bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Return the lines that these bytes complete, stripped, without empty ones."""
        lines = []
        *ended, last = data.split(b"\n")
        for piece in ended:
            self._append(piece)
            lines.append(bytes(self._part).strip())
            self._part.clear()
        self._append(last)
        return [line for line in lines if line]

    def rest(self) -> list[bytes]:
        """Return the last line if it has no end."""
        return self.feed(b"\n")

    def _append(self, piece: bytes) -> None:
        self._part += piece[: self._max_bytes + 1 - len(self._part)]


async def iter_lines(source: Any) -> AsyncIterator[bytes]:
    """Yield the lines of a binary file such as standard input, which is read ahead by one chunk."""
    loop, chunks, room = asyncio.get_running_loop(), asyncio.Queue[bytes](), threading.Semaphore(1)
    try:  # a buffered file would stay locked while it waits for data, even at the end of the process
        number = source.fileno()
    except OSError:
        number = None

    def read() -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            data = b"-"
            while data:
                data = source.read(CHUNK) if number is None else os.read(number, CHUNK)
                room.acquire()
                loop.call_soon_threadsafe(chunks.put_nowait, data)

    threading.Thread(target=read, daemon=True).start()
    splitter = LineSplitter(MAX_LINE_BYTES)
    while data := await chunks.get():
        room.release()
        for line in splitter.feed(data):
            yield line
    for line in splitter.rest():
        yield line
