"""Vedette and other libraries on the same scans: crowds of growing size, and objects that eight sensors observe.

    python benchmarks/peers.py [--peers-python PYTHON] [--crowd N ...] [--objects N ...] [--seeds N] [--figure FILE]

Peers are `stonesoup` (its GM-PHD filter) and `multisensor-lmb-filters-rs` (LMB filters in Rust). They are optional: a
message says which one is not installed, and its rows are left out. They may be installed for another Python, given by
`--peers-python` or the variable `PEERS_PYTHON`; see `benchmarks/peer_filters.py`.

Crowds are those of `benchmarks/crowd.py`. All filters receive births at the measurements of the previous scan. The time
of Vedette includes making them, that of the peers does not. The eight sensors are those of
`benchmarks/eight_sensors.py`. Time is the median CPU time of a step in a run, then the median over runs (bars: least
and largest run). OSPA, with c = 25 m (crowd) or 5 m and p = 1, is the mean from the sixth scan on, then over runs
(bars and ±: two standard errors). Runs of one seed have the same targets and scans for all filters.
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
from itertools import product
from pathlib import Path

import numpy as np
from crowd import CUTOFF, FROM_STEP, NAMES, prepared, tracked
from eight_sensors import RULES, SIDE, box_run, box_scene

from vedette.evaluation import ospa
from vedette.evaluation.figures.style import COLOURS, line_style
from vedette.scenarios import GeneratedCrowd

# Longest step of a peer in s: a longer one ends its run, and larger scenes are not tried.
PATIENCE = 10.0
DEFAULT = f"Vedette, {NAMES['factored_glmb']} (default)"
FIRST_BOX = 42  # seed of the first scene with eight sensors


@dataclass(frozen=True)
class Row:
    """Time and OSPA of one filter in one scene, by seed."""

    scene: str
    filter: str
    num_targets: int
    milliseconds: tuple[float, ...]  # median of a run's scans
    ospa: tuple[float, ...]  # mean of a run's scans

    @property
    def ospa_error(self) -> float:
        """Two standard errors of the mean OSPA; 0 for one run."""
        num = len(self.ospa)
        return 2.0 * float(np.std(self.ospa, ddof=1)) / num**0.5 if num > 1 else 0.0


def pooled(rows: Sequence[Row]) -> list[Row]:
    """Return one row for each scene, filter and number of targets, with the runs of all its rows."""
    by_key: dict[tuple[str, str, int], list[Row]] = {}
    for row in rows:
        by_key.setdefault((row.scene, row.filter, row.num_targets), []).append(row)
    return [
        Row(*key, sum((row.milliseconds for row in group), ()), sum((row.ospa for row in group), ()))
        for key, group in by_key.items()
    ]


# Vedette


def own_box(num_objects: int, num_steps: int, seed: int) -> Iterator[Row]:
    """Return the rows of Vedette's fusions of eight sensors."""
    truth, scans = box_scene(num_objects, num_steps, FIRST_BOX + seed)
    for rule in RULES:
        box_run(rule, scans[:3])
        seconds, estimates = box_run(rule, scans)
        found = [estimate.means[:, :2] for estimate in estimates]
        yield scored("8 sensors", f"Vedette, {rule}", truth, seconds, found, cutoff=5.0)


def own_crowd(num_targets: int, num_steps: int, seed: int) -> Iterator[Row]:
    """Return the rows of Vedette's filters of crowds."""
    for kind in ("lmb", *(kind for kind in NAMES if kind not in ("lmb", "delta_glmb"))):
        crowd = GeneratedCrowd(num_targets=num_targets, num_steps=num_steps)
        experiment, truth, scans = prepared(crowd, kind, seed)
        tracked(experiment, scans[:8])
        _, seconds, estimates = tracked(experiment, scans)
        true = [truth.at(k)[1][:, :2] for k in range(num_steps)]
        found = [np.empty((0, 2))] * (FROM_STEP - 1) + [estimate.means[:, :2] for estimate in estimates]
        name = DEFAULT if kind == "factored_glmb" else f"Vedette, {NAMES[kind]}"
        yield scored("crowd", name, true, seconds, found, cutoff=CUTOFF)


def scored(
    scene: str,
    name: str,
    truth: Sequence[np.ndarray],
    seconds: Sequence[float],
    found: Sequence[np.ndarray],
    *,
    cutoff: float,
) -> Row:
    """Return the row of one run, over its scans from `FROM_STEP` on, as far as the run went."""
    pairs = list(zip(found, truth, strict=False))[FROM_STEP - 1 :]
    distances = [ospa(estimate, true, cutoff=cutoff, order=1.0).total for estimate, true in pairs]
    median = 1e3 * float(np.median(seconds[FROM_STEP - 1 :]))
    return Row(scene, name, len(truth[0]), (median,), (float(np.mean(distances)),))


# Peers, each in a process of the Python that it is installed for


def peer_rows(python: str, peer: str, scene: str, num_targets: int, num_steps: int, seed: int) -> list[Row] | str:
    """Return the rows of a peer's filters, or why there are none."""
    if scene == "crowd":
        crowd = GeneratedCrowd(num_targets=num_targets, num_steps=num_steps)
        _, true, own = prepared(crowd, "lmb", seed)
        truth, scans = [true.at(k)[1][:, :2] for k in range(num_steps)], [[scan] for scan in own]
        half, cutoff = float(np.sqrt(num_targets / crowd.density) * 500.0), CUTOFF
    else:
        truth, scans = box_scene(num_targets, num_steps, FIRST_BOX + seed)
        half, cutoff = SIDE, 5.0
    with tempfile.TemporaryDirectory() as folder:
        scans_file, found_file = Path(folder) / "scans.npz", Path(folder) / "found.npz"
        named = {f"{k}_{s}": scan for k, of_all in enumerate(scans) for s, scan in enumerate(of_all)}
        np.savez(scans_file, **named)  # type: ignore[arg-type]
        script = str(Path(__file__).with_name("peer_filters.py"))
        options = {"peer": peer, "scene": scene, "half": half, "patience": PATIENCE, "number": num_targets}
        ended = subprocess.run(
            [python, script, json.dumps(options), str(scans_file), str(found_file)],
            capture_output=True,
            text=True,
            check=False,
            env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        )
        if ended.returncode:
            return (ended.stderr.strip().splitlines() or ["it ended without a message"])[-1]
        with np.load(found_file) as found:
            rows = []
            for name in found["names"].tolist():
                seconds = found[f"{name}_seconds"].tolist()
                positions = [found[f"{name}_{k}"] for k in range(len(seconds))]
                if len(seconds) < FROM_STEP:
                    print(f"{peer}, {name}, {num_targets}: {max(seconds):.0f} s per step, stopped", flush=True)
                    continue
                rows.append(scored(scene, f"{peer}, {name}", truth, seconds, positions, cutoff=cutoff))
            return rows


PEERS = {"Stone Soup": "stonesoup", "multisensor-lmb-filters-rs": "multisensor_lmb_filters_rs"}


def is_installed(python: str, module: str) -> bool:
    """Return True if that Python has a module."""
    look = f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"
    return subprocess.run([python, "-c", look], check=False).returncode == 0


def all_rows(
    python: str, sizes: Sequence[int], objects: Sequence[int], num_steps: int, seeds: Sequence[int]
) -> Iterator[Row]:
    """Yield a row for each run: every filter in turn on the scans of one seed, then the next seed."""
    stopped: set[tuple[str, str]] = set()
    installed = [peer for peer, module in PEERS.items() if is_installed(python, module)]
    for peer, module in PEERS.items():
        if peer not in installed:
            print(f"{peer}: left out, as {module} is not installed for {Path(python).name}", flush=True)
    for scene, numbers, own in (("crowd", sizes, own_crowd), ("8 sensors", objects, own_box)):
        for number, seed in product(numbers, seeds):
            yield from own(number, num_steps, seed)
            for peer in (peer for peer in installed if (peer, scene) not in stopped):
                if scene == "8 sensors" and peer == "Stone Soup":
                    continue
                rows = peer_rows(python, peer, scene, number, num_steps, seed)
                if isinstance(rows, str):
                    print(f"{peer}, {scene}: left out: {rows}", flush=True)
                elif rows:
                    yield from rows
                if not rows or isinstance(rows, str):
                    stopped.add((peer, scene))


def table(rows: Sequence[Row]) -> str:
    """Return a Markdown table."""
    lines = ["| scene | targets | filter | ms per scan | OSPA, m |", "|---|---:|---|---:|---:|"]
    for row in rows:
        ospa_text = f"{np.mean(row.ospa):.2f}" + (f" ± {row.ospa_error:.2f}" if len(row.ospa) > 1 else "")
        time = f"{np.median(row.milliseconds):,.2f}"
        lines.append(f"| {row.scene} | {row.num_targets:,} | {row.filter} | {time} | {ospa_text} |")
    return "\n".join(lines)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw time and OSPA of crowds against the number of targets, the default filter on top."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (time, error) = plt.subplots(1, 2, figsize=(9.0, 4.0), layout="constrained")
    crowd = [row for row in rows if row.scene == "crowd"]
    for number, name in enumerate(dict.fromkeys(row.filter for row in crowd)):
        own = [row for row in crowd if row.filter == name]
        numbers = np.array([row.num_targets for row in own])
        medians = np.array([np.median(row.milliseconds) for row in own])
        least, most = ([reach(row.milliseconds) for row in own] for reach in (min, max))
        is_default = name == DEFAULT
        look = {
            "marker": "osD^vP"[number % 6],
            "color": COLOURS[number % 6],
            "linestyle": line_style(number),
            "label": name,
            "capsize": 3.0,
            "linewidth": 2.5 if is_default else 1.5,
            "zorder": 4 if is_default else 2,
            "markerfacecolor": COLOURS[number % 6] if is_default else "white",
        }
        time.errorbar(numbers, medians, [medians - least, most - medians], **look)
        # Side by side, so that filters of equal OSPA remain visible.
        shifted = numbers * 1.06 ** (number - 1.5)
        error.errorbar(shifted, [np.mean(row.ospa) for row in own], [row.ospa_error for row in own], **look)
    time.set(xscale="log", yscale="log", xlabel="targets", ylabel="CPU time per scan (ms)")
    top = 1.15 * max(float(np.mean(row.ospa)) + row.ospa_error for row in crowd)
    error.set(xscale="log", xlabel="targets", ylabel="OSPA (m), cutoff 25 m", ylim=(0.0, top))
    for axes in (time, error):
        axes.grid(True, which="major", alpha=0.4)
    figure.legend(*time.get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    figure.savefig(path, dpi=110)
    print(f"wrote {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers-python", default=os.environ.get("PEERS_PYTHON", sys.executable))
    parser.add_argument("--crowd", type=int, nargs="*", default=(10, 30, 100, 300, 1000))
    parser.add_argument("--objects", type=int, nargs="*", default=(10, 20, 50))
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--seeds", type=int, default=5, help="runs of each size, with other targets and scans")
    parser.add_argument("--figure", type=Path, help="file to draw")
    options = parser.parse_args()
    rows = []
    for row in all_rows(options.peers_python, options.crowd, options.objects, options.steps, range(options.seeds)):
        time, ospa_mean = row.milliseconds[0], row.ospa[0]
        print(f"{row.scene:10s} {row.num_targets:6d} {row.filter:40s} {time:10.2f} ms {ospa_mean:7.2f} m", flush=True)
        rows.append(row)
    rows = pooled(rows)
    print(table(rows))
    if options.figure:
        draw(rows, options.figure)


if __name__ == "__main__":
    main()
