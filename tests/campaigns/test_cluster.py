"""What is not taken for a scheduler."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from vedette.campaigns import cluster
from vedette.campaigns.cluster import remote_workers
from vedette.errors import InputError


@pytest.fixture
def listen() -> Iterator[Callable[[bytes], str]]:
    """Makes a server of this machine that answers every call with some bytes and holds the line; its address."""
    servers, calls = [], []

    def serve(server: socket.socket, answer: bytes) -> None:
        while True:
            try:
                call, _ = server.accept()
                calls.append(call)
                call.sendall(answer)
            except OSError:
                return

    def start(answer: bytes) -> str:
        server = socket.create_server(("127.0.0.1", 0))
        servers.append(server)
        threading.Thread(target=serve, args=(server, answer), daemon=True).start()
        return f"tcp://127.0.0.1:{server.getsockname()[1]}"

    yield start
    for each in (*servers, *calls):
        each.close()


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 200 OK\r\n\r\n" * 100, bytes(10_000), b"\xff" * 10_000])
def test_what_is_no_scheduler_is_named(
    listen: Callable[[bytes], str], answer: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_SECONDS", 1.0)
    address = listen(answer)
    with pytest.raises(InputError, match=f"no scheduler answers at {address}"), remote_workers(address, print):
        pass


def test_a_closed_port_is_named_also_inside_a_running_loop(free_port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_SECONDS", 1.0)

    async def inside() -> None:
        with (
            pytest.raises(InputError, match="no scheduler answers"),
            remote_workers(f"tcp://127.0.0.1:{free_port}", print),
        ):
            pass

    asyncio.run(inside())
