"""Who is let in to the workers of this machine, and what is not taken for a scheduler."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from vedette.campaigns import clients
from vedette.campaigns.clients import local_workers, remote_workers
from vedette.campaigns.scratch import scratch_folder
from vedette.errors import InputError
from waiting import PATIENCE

KNOCK = """
import sys
from distributed import Client
try:
    with Client(sys.argv[1], timeout=float(sys.argv[2])) as client:
        print("let in:", client.submit(lambda: 7).result())
except OSError as error:
    print("refused")
"""


def test_workers_take_no_work_from_another_process() -> None:
    with local_workers(1) as client:
        address = client.cluster.scheduler_address
        assert address.startswith("tls://127.0.0.1:")
        assert client.submit(sum, [3, 4]).result(timeout=PATIENCE) == 7
        for without_credentials in (address, address.replace("tls://", "tcp://")):
            knock = [sys.executable, "-W", "ignore", "-c", KNOCK, without_credentials, "10"]
            said = subprocess.run(knock, capture_output=True, text=True, check=False, timeout=PATIENCE)
            assert "let in" not in said.stdout
            assert "refused" in said.stdout or "TLS" in said.stderr, said


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
    monkeypatch.setattr(clients, "_CONNECT_SECONDS", 1.0)
    address = listen(answer)
    with pytest.raises(InputError, match=f"no scheduler answers at {address}"), remote_workers(address):
        pass


def test_a_closed_port_is_named_also_inside_a_running_loop(free_port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, "_CONNECT_SECONDS", 1.0)

    async def inside() -> None:
        with pytest.raises(InputError, match="no scheduler answers"), remote_workers(f"tcp://127.0.0.1:{free_port}"):
            pass

    asyncio.run(inside())


HOLD = """
import sys
from vedette.campaigns.scratch import scratch_folder
with scratch_folder() as folder:
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(os.name == "nt", reason="processes end otherwise there")
def test_folders_of_killed_campaigns_are_taken_away_by_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    somebody_elses = tmp_path / "vedette-workers-without-a-lock"
    somebody_elses.mkdir()
    holding = [subprocess.Popen([sys.executable, "-c", HOLD], stdin=-1, stdout=-1, text=True) for _ in range(2)]
    try:
        killed, living = (Path(process.stdout.readline().strip()) for process in holding if process.stdout)
        (killed / "worker-space").mkdir()
        holding[0].send_signal(signal.SIGKILL)
        holding[0].wait(timeout=PATIENCE)
        assert killed.is_dir()
        with scratch_folder() as mine:
            assert {path.name for path in tmp_path.iterdir()} == {living.name, Path(mine).name, somebody_elses.name}
    finally:
        for process in holding:
            process.kill()
            process.communicate()
    assert not Path(mine).exists()
