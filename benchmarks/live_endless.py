"""What a live loop takes up after 10^4, 10^5 and 10^6 scans: memory, its snapshot and its open files.

    python benchmarks/live_endless.py [--scans N]
    python benchmarks/live_endless.py --write docs/evidence/live-scans.md

Two sensors that measure positions see four targets, each of which comes and goes every few minutes; one scan in ten is
late by up to 20 s, some beyond the window, and one line in a thousand is damaged. `vedette.live.PersistentLoop` takes
the lines one after the other, with a snapshot every second and a record, which is all that may grow. Resident memory is
that of this process, from /proc (Linux).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pages import write_between

from vedette.live import PersistentLoop, build_live_loop, encode_line
from vedette.scenarios.from_recording import scenario_from_sensors

SCENE = """
region: {x_min: -1000.0, x_max: 1000.0, y_min: -1000.0, y_max: 1000.0}
sensor_defaults:
  measurement: {kind: position}
  noise: {kind: constant, std: [10.0, 10.0]}
  detection: {kind: constant, probability: 0.9}
  clutter: {kind: region, rate: 1.0}
sensors: [{position: [0.0, 0.0]}, {position: [300.0, 0.0]}]
filter: {kind: lmb}
"""
NUM_TARGETS, WINDOW = 4, 10.0  # s
PRESENT, ABSENT = 200.0, 60.0  # s


def lines(num: int) -> Iterator[bytes]:
    """So many scans, a second between those of a sensor."""
    rng = np.random.default_rng(7)
    for k in range(num):
        now = (k // 2) * 1.0 + (k % 2) * 0.5
        if k % 1000 == 999:
            yield b'{"sensor": 1, "time": '
        told = now - rng.uniform(0.0, 20.0) if rng.random() < 0.1 else now
        found = [rng.uniform(-1000.0, 1000.0, 2) for _ in range(rng.poisson(1.0))]
        for t in range(NUM_TARGETS):
            turn = told + 70.0 * t
            if turn % (PRESENT + ABSENT) < PRESENT and rng.random() < 0.9:
                angle = turn * 5.0 / (300.0 + 100.0 * t) + t
                place = (300.0 + 100.0 * t) * np.array([math.cos(angle), math.sin(angle)])
                found.append(place + rng.normal(0.0, 10.0, 2))
        yield json.dumps(
            {"sensor": k % 2 + 1, "time": told, "measurements": [each.tolist() for each in found]}
        ).encode()


def resident() -> float:
    """MB."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def table(scans: int) -> Iterator[str]:
    """The lines of the table."""
    yield "| scans | resident, MB | snapshot, kB | record, MB | files | tracks | errors | late | dropped | a second |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    marks = [10**power for power in range(3, 10) if 10**power <= scans]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.yaml").write_text(SCENE, "utf-8")
        live = build_live_loop(scenario_from_sensors(folder / "scene.yaml"), max_delay=WINDOW)
        persistent = PersistentLoop(live, snapshot=folder / "state", snapshot_interval=1.0, record=folder / "came")
        begun, num = time.perf_counter(), 0
        for line in lines(scans):
            answers = persistent.process(line)
            for answer in answers:
                encode_line(answer)
            num += "error" not in answers[0]
            if num in marks:
                marks.remove(num)
                persistent.save()
                timeline = persistent.state.timeline
                sizes = [(folder / "state").stat().st_size / 1e3, (folder / "came").stat().st_size / 1e6]
                counts = [
                    len(answers[0]["tracks"]),
                    persistent.state.num_errors,
                    timeline.num_late,
                    timeline.num_dropped,
                ]
                cells = [f"{num:,}", f"{resident():.0f}", f"{sizes[0]:.0f}", f"{sizes[1]:.1f}"]
                cells += [str(len(os.listdir("/proc/self/fd"))), *map(str, counts)]
                yield "| " + " | ".join([*cells, f"{num / (time.perf_counter() - begun):.0f}"]) + " |"
        persistent.close()


def main() -> None:
    """Read the arguments and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=1_000_000)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    found = []
    for row in table(given.scans):
        print(row, flush=True)
        found.append(row)
    if given.write is not None:
        write_between(given.write, "live_endless.py", "\n".join(found))


if __name__ == "__main__":
    main()
