"""Fit of live streams: findings where the model is right, and the time until a drifting sensor is named.

    python benchmarks/live_fit.py [--right FIRST LAST] [--drift FIRST LAST] [--workers N]

The streams are those of the scenes of `benchmarks/fit.py` with one scan a second, for ten minutes if the model is
right. In the others the bearings of the first sensor drift by .1 standard deviations a scan from 100 s on, up to 6.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
from fit import fields_of
from scenes import own

from vedette.evaluation.runs import run_scenario
from vedette.evaluation.scans import rows_of_record
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.live import build_live_loop
from vedette.recorded import Conventions
from vedette.scenarios import Scenario
from vedette.scenarios.from_recording import LiveScenario
from vedette.simulation.records import RunRecord

START, DRIFT, LARGEST = 100.0, 0.1, 6.0  # s, standard deviations a scan, and at most
SECONDS, SECONDS_OF_DRIFT = 600, 300


class Stream(NamedTuple):
    """Findings of a stream as (time, text), the CPU time of a line, ms, and what was searched at the end."""

    found: list[tuple[float, str]]
    cpu: float
    searched: str


def stream_of(number: int, drifts: bool) -> Stream:
    """Return what the loop finds in a stream."""
    with suppress_unit_warnings():
        seconds = SECONDS_OF_DRIFT if drifts else SECONDS
        fields = fields_of(number, "bearing" if drifts else "", rate=1.0, num_scans=seconds)
        scenario = own(f"stream {number}", fields, fusion={"kind": "sequential"}).scenario(0)
        record = run_scenario(scenario, "stationary", seed=number)
        std_deg = fields["sensors"][0]["noise"]["sigma_bearing_deg"] if drifts else 0.0
        lines = list(_lines(scenario, record, std_deg))
        known = LiveScenario(scenario, Conventions({}, {}, "east"), {})
        loop = build_live_loop(known, "stationary")
        found, state, begin = list[tuple[float, str]](), loop.initial(), time.process_time()
        for line in lines:
            state, answers = loop.process(state, line)
            for answer in answers:
                assert "error" not in answer, answer
                found += [(answer["time"], text) for text in answer.get("fit", {}).get("new", ())]
        return Stream(found, 1000.0 * (time.process_time() - begin) / len(lines), state.fit.searched)


def _lines(scenario: Scenario, record: RunRecord, std_deg: float) -> Iterator[bytes]:
    """Yield the lines of the scans of a run, with a drift of the bearings of the first sensor."""
    for instant, rows in zip(record.times.tolist(), rows_of_record(record, scenario), strict=True):
        drift = np.radians(std_deg) * min(max(0.0, DRIFT * (instant - START)), LARGEST)
        for s, measured in enumerate(rows):
            if measured is not None:
                moved = measured + np.array([drift, 0.0]) * (s == 0)
                if std_deg:
                    moved[:, 0] = np.remainder(moved[:, 0] + np.pi, 2.0 * np.pi) - np.pi
                yield json.dumps({"sensor": s + 1, "time": instant, "measurements": moved.tolist()}).encode()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--right", type=int, nargs=2, default=(1, 20), metavar=("FIRST", "LAST"))
    parser.add_argument("--drift", type=int, nargs=2, default=(1, 20), metavar=("FIRST", "LAST"))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    for drifts, (first, last) in ((False, options.right), (True, options.drift)):
        numbers = range(first, last + 1)
        with ProcessPoolExecutor(options.workers) as pool:
            for number, stream in zip(numbers, pool.map(stream_of, numbers, [drifts] * len(numbers)), strict=True):
                print("drift" if drifts else "right", number, stream, flush=True)
