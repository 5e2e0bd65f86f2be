"""Ours beside other libraries on the same scans: a crowd of growing size, and fifty objects seen by eight sensors.

    python benchmarks/peers.py [--peers-python PYTHON] [--crowd N ...] [--objects N] [--figure FILE]

Peers are `stonesoup` (its GM-PHD filter) and `multisensor-lmb-filters-rs` (LMB filters in Rust). Neither is needed by
anything else: where one is not installed a line says so, and its rows are left out. They may be installed for another
Python, whose path `--peers-python` or the variable `PEERS_PYTHON` gives; see `benchmarks/peer_filters.py`.

Crowds are those of `benchmarks/crowd.py`. Births are made of what was measured one scan before, for all alike: ours
are part of our time, for the peers they are made outside of theirs. The eight sensors are those of
`benchmarks/eight_sensors.py`. CPU time of a step, median; OSPA with c = 25 m (crowd) or 5 m and p = 1, mean from the
sixth scan on.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from crowd import CUTOFF, FROM_STEP, NAMES, prepared, tracked
from eight_sensors import RULES, SIDE, box_run, box_scene

from vedette.evaluation import ospa
from vedette.evaluation.figures.style import COLOURS, line_style
from vedette.scenarios import GeneratedCrowd

# Steps that take longer end a peer's run; and sizes beyond are not tried.
PATIENCE = 10.0


@dataclass(frozen=True)
class Row:
    """What one filter took and reached."""

    scene: str
    filter: str
    num_targets: int
    milliseconds: float
    ospa: float


# Ours


def our_box(num_objects: int, num_steps: int) -> Iterator[Row]:
    truth, scans = box_scene(num_objects, num_steps)
    for rule in RULES:
        box_run(rule, scans[:3])
        seconds, estimates = box_run(rule, scans)
        found = [estimate.means[:, :2] for estimate in estimates]
        yield scored("8 sensors", f"Vedette, {rule}", truth, seconds, found, cutoff=5.0)


def our_crowd(num_targets: int, num_steps: int) -> Iterator[Row]:
    for kind in ("lmb", *(kind for kind in NAMES if kind not in ("lmb", "delta_glmb"))):
        crowd = GeneratedCrowd(num_targets=num_targets, num_steps=num_steps)
        experiment, truth, scans = prepared(crowd, kind)
        tracked(experiment, scans[:8])
        _, seconds, estimates = tracked(experiment, scans)
        true = [truth.at(k)[1][:, :2] for k in range(num_steps)]
        found = [np.empty((0, 2))] * (FROM_STEP - 1) + [estimate.means[:, :2] for estimate in estimates]
        yield scored("crowd", f"Vedette, {NAMES[kind]}", true, seconds, found, cutoff=CUTOFF)


def scored(
    scene: str,
    name: str,
    truth: Sequence[np.ndarray],
    seconds: Sequence[float],
    found: Sequence[np.ndarray],
    *,
    cutoff: float,
) -> Row:
    """Of as many steps as there are; from `FROM_STEP` on."""
    pairs = list(zip(found, truth, strict=False))[FROM_STEP - 1 :]
    distances = [ospa(mine, true, cutoff=cutoff, order=1.0).total for mine, true in pairs]
    median = 1e3 * float(np.median(seconds[FROM_STEP - 1 :]))
    return Row(scene, name, len(truth[0]), median, float(np.mean(distances)))


# Peers, each in a process of the Python that it is installed for


def peer_rows(python: str, peer: str, scene: str, num_targets: int, num_steps: int) -> list[Row] | str:
    """The rows of a peer's filters; or, in words, why there are none."""
    if scene == "crowd":
        crowd = GeneratedCrowd(num_targets=num_targets, num_steps=num_steps)
        _, true, own = prepared(crowd, "lmb")
        truth, scans = [true.at(k)[1][:, :2] for k in range(num_steps)], [[scan] for scan in own]
        half, cutoff = float(np.sqrt(num_targets / crowd.density) * 500.0), CUTOFF
    else:
        truth, scans = box_scene(num_targets, num_steps)
        half, cutoff = SIDE, 5.0
    with tempfile.TemporaryDirectory() as place:
        given, taken = Path(place) / "scans.npz", Path(place) / "found.npz"
        named = {f"{k}_{s}": scan for k, of_all in enumerate(scans) for s, scan in enumerate(of_all)}
        np.savez(given, **named)  # type: ignore[arg-type]
        script = str(Path(__file__).with_name("peer_filters.py"))
        told = {"peer": peer, "scene": scene, "half": half, "patience": PATIENCE, "number": num_targets}
        ended = subprocess.run(
            [python, script, json.dumps(told), str(given), str(taken)],
            capture_output=True,
            text=True,
            check=False,
            env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        )
        if ended.returncode:
            return (ended.stderr.strip().splitlines() or ["it ended without a word"])[-1]
        with np.load(taken) as found:
            rows = []
            for name in found["names"].tolist():
                seconds = found[f"{name}_seconds"].tolist()
                places = [found[f"{name}_{k}"] for k in range(len(seconds))]
                if len(seconds) < FROM_STEP:
                    print(f"{peer}, {name}, {num_targets}: {max(seconds):.0f} s a step, given up", flush=True)
                    continue
                rows.append(scored(scene, f"{peer}, {name}", truth, seconds, places, cutoff=cutoff))
            return rows


PEERS = {"Stone Soup": "stonesoup", "multisensor-lmb-filters-rs": "multisensor_lmb_filters_rs"}


def is_installed(python: str, module: str) -> bool:
    """Whether that Python has a module."""
    look = f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"
    return subprocess.run([python, "-c", look], check=False).returncode == 0


def all_rows(python: str, sizes: Sequence[int], objects: Sequence[int], num_steps: int) -> Iterator[Row]:
    """Ours and those of the peers that are there, as they come."""
    given_up: set[str] = set()
    there = {peer: is_installed(python, module) for peer, module in PEERS.items()}
    for peer, found in there.items():
        if not found:
            print(f"{peer}: left out, as {PEERS[peer]} is not installed for {Path(python).name}", flush=True)
    for scene, numbers, ours in (("crowd", sizes, our_crowd), ("8 sensors", objects, our_box)):
        for number in numbers:
            yield from ours(number, num_steps)
            for peer in (peer for peer in PEERS if there[peer] and (peer, scene) not in given_up):
                if scene == "8 sensors" and peer == "Stone Soup":
                    continue
                rows = peer_rows(python, peer, scene, number, num_steps)
                if isinstance(rows, str):
                    print(f"{peer}, {scene}: left out: {rows}", flush=True)
                elif rows:
                    yield from rows
                if not rows or isinstance(rows, str):
                    given_up.add((peer, scene))


def table(rows: Sequence[Row]) -> str:
    """As Markdown."""
    lines = ["| scene | targets | filter | ms per scan | OSPA, m |", "|---|---:|---|---:|---:|"]
    lines += [
        f"| {row.scene} | {row.num_targets:,} | {row.filter} | {row.milliseconds:,.2f} | {row.ospa:.2f} |"
        for row in rows
    ]
    return "\n".join(lines)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Of crowds: OSPA and time against the number of targets, ours beside the peers'."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (time, error) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    crowd = [row for row in rows if row.scene == "crowd"]
    for number, name in enumerate(dict.fromkeys(row.filter for row in crowd)):
        own = [row for row in crowd if row.filter == name]
        numbers = [row.num_targets for row in own]
        look = {
            "marker": "osD^vP"[number % 6],
            "color": COLOURS[number % 6],
            "linestyle": line_style(number),
            "label": name,
        }
        time.plot(numbers, [row.milliseconds for row in own], **look)
        error.plot(numbers, [row.ospa for row in own], **look)
    time.set(xscale="log", yscale="log", xlabel="targets", ylabel="CPU time per scan (ms)")
    error.set(
        xscale="log", xlabel="targets", ylabel="OSPA (m), cutoff 25 m", ylim=(0.0, 1.2 * max(row.ospa for row in crowd))
    )
    for each in (time, error):
        each.grid(True, which="major", alpha=0.4)
    figure.legend(*time.get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(path, dpi=110)
    print(f"wrote {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers-python", default=os.environ.get("PEERS_PYTHON", sys.executable))
    parser.add_argument("--crowd", type=int, nargs="*", default=(10, 30, 100, 300, 1000))
    parser.add_argument("--objects", type=int, nargs="*", default=(10, 20, 50))
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--figure", type=Path, help="file to draw")
    given = parser.parse_args()
    rows = []
    for row in all_rows(given.peers_python, given.crowd, given.objects, given.steps):
        print(f"{row.scene:10s} {row.num_targets:6d} {row.filter:40s} {row.milliseconds:10.2f} ms {row.ospa:7.2f} m")
        sys.stdout.flush()
        rows.append(row)
    print(table(rows))
    if given.figure:
        draw(rows, given.figure)


if __name__ == "__main__":
    main()
