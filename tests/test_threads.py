"""Work in pieces over threads: all of it once, the first fault, and an end when the user says so."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from vedette.internal.threads import run_chunks
from vedette.kernels.base.compile import JIT_ENABLED
from waiting import PATIENCE

each_number_of_threads = pytest.mark.parametrize("num_threads", [1, 2, 5])


@each_number_of_threads
@pytest.mark.parametrize("num_items", [0, 1, 2, 7, 1000])
def test_every_item_is_worked_on_once(num_items: int, num_threads: int) -> None:
    pieces: list[tuple[int, int]] = []
    run_chunks(lambda first, last: pieces.append((first, last)), num_items, num_threads)
    assert all(first < last for first, last in pieces)
    covered = sorted(pieces)
    assert all(before[1] == after[0] for before, after in pairwise(covered))
    if num_items:
        assert (covered[0][0], covered[-1][1]) == (0, num_items)
    else:
        assert not covered


@each_number_of_threads
def test_the_fault_of_the_first_item_is_raised(num_threads: int) -> None:
    """Whichever thread comes to one first; and no more is begun."""
    tried = []

    def work(first: int, last: int) -> None:
        for item in range(first, last):
            tried.append(item)
            if item in (30, 31, 33, 60):
                time.sleep(0.01 if item == 30 else 0.0)
                raise ValueError(item)
            time.sleep(0.001)

    for _ in range(5):
        tried.clear()
        with pytest.raises(ValueError, match=r"^30$"):
            run_chunks(work, 100_000, num_threads)
        assert len(tried) < 2000


@pytest.fixture
def heeding() -> Iterator[None]:
    """What is started in the background ignores Ctrl-C, and this test with it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@each_number_of_threads
@pytest.mark.usefixtures("heeding")
def test_an_interruption_is_answered_between_two_pieces(num_threads: int) -> None:
    done = np.zeros(100_000, np.bool_)

    def work(first: int, last: int) -> None:
        for item in range(first, last):
            time.sleep(0.001)
            done[item] = True
            if item == 50:
                signal.raise_signal(signal.SIGINT)

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        run_chunks(work, len(done), num_threads)
    assert threading.active_count() == before
    assert 0 < done.sum() < len(done) / 10


# Plans as docs/control.md does, with samples for a minute or more, and counts the cases that were worked on.
PROGRAM = """
import signal
import sys
import numpy as np

signal.signal(signal.SIGINT, signal.default_int_handler)  # what is started in the background ignores it
from vedette import models
from vedette.control import CauchySchwarzReward, IndependentPlanner, MobileSensor, PlanningSettings, pseudo_updates
from vedette.densities import LMB
from vedette.filters import LmbFilter
from vedette.fusion import Clmb
from vedette.tracking import State
from vedette.platforms import HeadingPlatform

region = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
sensor = models.SensorModel(
    models.bearing_range(), models.constant_noise([0.02, 10.0]), models.constant_detection(0.9),
    models.region_clutter(25.0, region, "bearing_range"),
)
targets = models.TargetModel(
    models.constant_velocity(5.0), models.constant_survival(0.98), models.BirthModel.none(4)
)
tracker = LmbFilter(targets, sensor)
num = 4
belief = LMB.from_bernoullis(
    [(1, i) for i in range(num)], [0.9] * num,
    [[100.0 * i, 30.0, 1.0, 0.0] for i in range(num)], [100.0 * np.eye(4)] * num,
)
settings = PlanningSettings(num_samples=30_000, association="full", num_threads=int(sys.argv[1]))
kernel, done = pseudo_updates.pseudo_update_lmb, []

def counted(prior, decision, association, first, last, results):
    if done:  # all is loaded: CPython ends by the signal where it met exec() of a string, caught or not
        print("planning", flush=True)
    kernel(prior, decision, association, first, last, results)
    done.append(last - first)

pseudo_updates.pseudo_update_lmb = counted
sensors = (MobileSensor(tracker, HeadingPlatform(50.0)),)
planner = IndependentPlanner(sensors, Clmb((1.0,)), settings, CauchySchwarzReward())
try:
    planner.plan(State((belief,), belief), [[-700.0, 0.0, 0.0]], rng=np.random.default_rng(1))
except KeyboardInterrupt:
    print("interrupted", sum(done), 13 * settings.num_samples)
"""


def one_line(stream: Any, wanted: str) -> str:
    return next(line for line in stream if line.startswith(wanted))


@pytest.mark.skipif(not JIT_ENABLED, reason="the cases are far slower")
@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize("num_threads", [1, 2])
def test_a_plan_is_left_when_it_is_interrupted(num_threads: int) -> None:
    command = [sys.executable, "-c", PROGRAM, str(num_threads)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            one_line(process.stdout, "planning")
            process.send_signal(signal.SIGINT)
            _, done, total = one_line(process.stdout, "interrupted").split()
            assert int(done) < int(total) / 10
            assert process.wait(timeout=PATIENCE) == 0
        finally:
            process.kill()
