"""Processes beside this one: deaf to Ctrl-C, with one thread for linear algebra, and gone when their parent is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from vedette.internal.processes import as_children
from waiting import PATIENCE, wait_until

PARENT = """
import os, sys, time
from concurrent.futures import ProcessPoolExecutor
from vedette.internal import processes

if __name__ == "__main__":
    processes._METHOD = sys.argv[1]
    processes.load_ahead()
    with processes.as_children():
        pool = ProcessPoolExecutor(1, processes.context(), initializer=processes.end_with_parent)
        print(pool.submit(os.getpid).result(), flush=True)
    pool.submit(time.sleep, 3600.0)
    time.sleep(3600.0)
"""


@pytest.mark.skipif(os.name == "nt", reason="processes end otherwise there")
@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_a_worker_ends_with_a_parent_that_is_killed(tmp_path: Path, method: str) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    with subprocess.Popen([sys.executable, script, method], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        assert is_there(worker)
        parent.send_signal(signal.SIGKILL)
        parent.wait(timeout=PATIENCE)
    wait_until(lambda: not is_there(worker), "the end of the worker")


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{process}/stat")
    return not state.exists() or " Z " not in state.read_text()  # ended, and not asked for by who took it over


PIPED: Any = {"stdin": subprocess.PIPE, "text": True}


@pytest.mark.skipif(os.name == "nt", reason="signals differ there")
def test_children_are_started_deaf_to_interrupts_and_with_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    before = signal.getsignal(signal.SIGINT)
    with as_children():
        child = subprocess.Popen([sys.executable, "-c", "import sys; sys.exit(sys.stdin.read() != 'go')"], **PIPED)
        assert (os.environ["OMP_NUM_THREADS"], os.environ["MKL_NUM_THREADS"]) == ("1", "3")
    assert signal.getsignal(signal.SIGINT) == before
    assert "OMP_NUM_THREADS" not in os.environ
    assert os.environ["MKL_NUM_THREADS"] == "3"
    child.send_signal(signal.SIGINT)
    child.communicate("go", timeout=PATIENCE)
    assert child.returncode == 0


@pytest.mark.skipif(sys.platform != "linux", reason="processes are not forks of a server there")
@pytest.mark.parametrize("of_server", [False, True])
def test_ctrl_c_while_processes_start_is_not_lost(of_server: bool) -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # what is started in the background ignores it
    reached = []

    def start() -> None:
        with as_children(of_server=of_server):
            signal.raise_signal(signal.SIGINT)
            reached.append("the end")

    try:
        with pytest.raises(KeyboardInterrupt):
            start()
        assert reached == ["the end"]
        assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_children_may_be_started_by_any_thread() -> None:
    found: list[str] = []

    def start() -> None:
        with as_children():
            found.append(os.environ["OMP_NUM_THREADS"])

    thread = threading.Thread(target=start)
    thread.start()
    thread.join()
    assert len(found) == 1
