"""Reported classes and measured sizes of targets, on scenes drawn at random.

    python benchmarks/classes.py                    # 20 scenes a row
    python benchmarks/classes.py --first 1000       # others
    python benchmarks/classes.py --write docs/evidence/classes.md

A scene has 3 to 10 targets of 5 to 25 m/s that meet within 200 m of the centre, P_D of .7 to .95, 2 to 20 false plots a
scan, noise of 25 m, and 60 scans every 4 s. Targets have one of three classes; a plot reports the right one with a
probability of .6 to .95, and a size (15, 60 and 150 m with standard deviations of 5, 20 and 40 m). False plots report
classes at random and sizes of 105 m with a standard deviation of 55 m. "Too sure" assumes a probability of .99 for the
right class.

Prints OSPA (c = 500 m), the number of changes of a target's label in a scene, the share of estimates whose most
probable class is right, and the same of those whose class has a probability of at least .9, with that mean probability.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pages import table_of_scenes
from plot_accuracy import Rows, _ospa

from vedette.evaluation import track_recording
from vedette.kernels.base.types import Floats
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.simulation.records import RunRecord

PERIOD, SCANS, NOISE = 4.0, 60, 25.0
NAMES = ("small", "middle", "large")
SIZES = np.array([[15.0, 5.0], [60.0, 20.0], [150.0, 40.0]])


class Variant(NamedTuple):
    """A row of the table: which columns are read, and whether the confusion is assumed too small."""

    words: str
    columns: tuple[str, ...]
    too_sure: bool = False


VARIANTS = [
    Variant("neither", ()),
    Variant("class", ("class",)),
    Variant("size", ("size_m",)),
    Variant("class and size", ("class", "size_m")),
    Variant("class, too sure", ("class",), too_sure=True),
]


class Scene:
    """Targets, their classes, and all plots of a radar."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.num, self.detection = int(rng.integers(3, 11)), rng.uniform(0.7, 0.95)
        self.clutter, self.right = rng.uniform(2.0, 20.0), rng.uniform(0.6, 0.95)
        self.probs = rng.dirichlet([3.0, 3.0, 3.0])
        self.classes = rng.choice(3, self.num, p=self.probs)
        way, speed = rng.uniform(-np.pi, np.pi, self.num), rng.uniform(5.0, 25.0, self.num)
        self.velocities = speed[:, None] * np.column_stack([np.cos(way), np.sin(way)])
        middle = rng.uniform(0.45, 0.55, self.num)[:, None] * SCANS * PERIOD
        self.starts = rng.uniform(-200.0, 200.0, (self.num, 2)) - middle * self.velocities
        self.rows = [row for k in range(SCANS) for row in self._plots(PERIOD * k, rng)]

    def at(self, time: float) -> Floats:
        """(num, 2) m."""
        return np.asarray(self.starts + time * self.velocities)

    @property
    def confusion(self) -> Floats:
        return np.full((3, 3), (1.0 - self.right) / 2.0) + (self.right - (1.0 - self.right) / 2.0) * np.eye(3)

    def _plots(self, time: float, rng: np.random.Generator) -> Rows:
        plots, confusion = Rows(), self.confusion
        for place, own in zip(self.at(time), self.classes.tolist(), strict=True):
            if rng.random() < self.detection:
                x, y = place + rng.normal(0.0, NOISE, 2)
                reported = NAMES[rng.choice(3, p=confusion[own])]
                plots.append({"x_m": x, "y_m": y, "class": reported, "size_m": max(rng.normal(*SIZES[own]), 1.0)})
        for x, y in rng.uniform(-6e3, 6e3, (rng.poisson(self.clutter), 2)).tolist():
            plots.append(
                {"x_m": x, "y_m": y, "class": NAMES[rng.choice(3)], "size_m": max(rng.normal(105.0, 55.0), 1.0)}
            )
        return [{"time": time, **plot} for plot in plots]


def named(probs: Floats) -> dict[str, float]:
    """Probabilities of the classes by name."""
    return dict(zip(NAMES, probs.tolist(), strict=True))


def tracked(folder: Path, scene: Scene, variant: Variant) -> RunRecord:
    """The record of the recording, written as a user has it."""
    columns = ["time", "x_m", "y_m", *variant.columns]
    lines = [",".join(columns), *(",".join(str(row[name]) for name in columns) for row in scene.rows)]
    (folder / "scans.csv").write_text("\n".join(lines), "utf-8")
    confusion = 0.005 + 0.985 * np.eye(3) if variant.too_sure else scene.confusion
    tables = []
    if "class" in variant.columns:
        rows = {
            name: dict(zip(NAMES, map(float, row), strict=True)) for name, row in zip(NAMES, confusion, strict=True)
        }
        tables.append(f"confusion: {rows | {'clutter': dict.fromkeys(NAMES, 1.0 / 3.0)}}")
    if "size_m" in variant.columns:
        sizes = {name: {"mean": mean, "std": std} for name, (mean, std) in zip(NAMES, SIZES.tolist(), strict=True)}
        tables.append(f"size: {sizes | {'clutter': {'mean': 105.0, 'std': 55.0}}}")
    sensor = (
        f"measurement: {{kind: position}}, noise: {{kind: constant, std: [{NOISE}, {NOISE}]}}, "
        f"detection: {{kind: constant, probability: {scene.detection}}}, "
        f"clutter: {{kind: region, rate: {scene.clutter}}}"
    )
    sensor += f", classification: {{{', '.join(tables)}}}" * bool(tables)
    text = f"region: {{x_min: -6e3, x_max: 6e3, y_min: -6e3, y_max: 6e3}}\nclasses: {named(scene.probs)}\n" + (
        f"sensors:\n  - {{name: R, position: [0.0, 0.0], {sensor}}}\n"
    )
    (folder / "radar.yaml").write_text(text.replace("'", ""), "utf-8")
    found = scenario_from_recording(folder / "radar.yaml", folder / "scans.csv", speed=25.0)
    return track_recording(found.scenario, found.recording)


def of_scene(folder: Path, seed: int, variant: Variant) -> Floats:
    """(7,) OSPA, m; changes of labels; estimates, right ones; those of at least .9, right ones, their probability."""
    scene = Scene(seed)
    record, ospa, changes = tracked(folder, scene, variant), list[float](), 0
    before = dict[int, tuple[int, ...]]()
    sure = list[float]()
    counts = np.zeros(4)
    for time, estimate in zip(record.times.tolist(), record.estimates, strict=True):
        if time < 40.0:
            continue
        off = estimate.means[:, np.newaxis, :2] - scene.at(time)
        distances = np.hypot(off[..., 0], off[..., 1])
        ospa.append(_ospa(distances))
        for i, target in enumerate(distances.argmin(axis=1).tolist()):
            if distances[i, target] > 4.0 * NOISE or distances[:, target].argmin() != i:
                continue
            label = tuple(estimate.labels[i].tolist())
            changes += before.get(target, label) != label
            before[target] = label
            probs = estimate.class_probs[i]
            is_right, is_sure = probs.argmax() == scene.classes[target], probs.max() >= 0.9
            counts += [1.0, is_right, is_sure, is_right and is_sure]
            if is_sure:
                sure.append(float(probs.max()))
    return np.array([np.mean(ospa), changes, *counts, np.sum(sure)])


def table(runs: int, first: int) -> str:
    """As Markdown."""
    columns = (
        "columns that are read",
        "OSPA, m",
        "changes of label",
        "class right, %",
        "called .9, %",
        "of these, %",
    )
    lines = [f"| {' | '.join(columns)} |", f"| --- |{' ---: |' * (len(columns) - 1)}"]
    with tempfile.TemporaryDirectory() as name:
        for variant in VARIANTS:
            found = np.array([of_scene(Path(name), seed, variant) for seed in range(first, first + runs)])
            error, changes = found[:, :2].mean(axis=0)
            num, right, sure, right_sure, total = found[:, 2:].sum(axis=0)
            called = f"{100.0 * right_sure / sure:.1f} (called {100.0 * total / sure:.1f})" if sure else "-"
            lines.append(
                f"| {variant.words} | {error:.1f} | {changes:.2f} | {100.0 * right / num:.1f} | "
                f"{100.0 * sure / num:.1f} | {called} |"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    table_of_scenes(__doc__, "classes.py", table)
