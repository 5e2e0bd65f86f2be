"""Vedette and the PMBM and PMB filters of García-Fernández et al. on the same scans.

    python benchmarks/pmbm.py [--runs N]
    python benchmarks/pmbm.py --write-scans FOLDER [--runs N]     # scans as text, for another program
    python benchmarks/pmbm.py --record FOLDER [--out FILE]        # scores of that program's estimates, as JSON

The scene is that of Williams (2015) and García-Fernández et al. (2018): four targets, one of which appears every ten
scans from the first on, are within a metre of each other in the middle of the run, where the first one disappears. Each
run has new targets. The filters have the models that generate the scans, and one wide birth site.

The table has the mean squared GOSPA (cutoff 10 m, order 2, alpha 2): the mean over the scans of a run, then over runs.
All other columns are paired differences to PMBM with their standard errors. The columns of PMBM and PMB are recorded in
`benchmarks/results/pmbm.json`; those of Vedette are computed on the same scans.

`--write-scans` writes `settings.txt`, with a line "number P_D clutter births" for each setting, and a file
`NUMBER-RUN.txt` for each run, with a line "scan x y" for each measurement. `--record` reads estimates of the same form
from `NUMBER-RUN.PMBM.txt` and `NUMBER-RUN.PMB.txt`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from compared import Timed

from vedette.evaluation import gospa
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.scenarios import Scenario, parse_scenario, replace_fields
from vedette.scenarios.build import build_experiment

RECORDED = Path(__file__).with_name("results") / "pmbm.json"
OTHERS = ("PMBM", "PMB")
SIDE, NUM_SCANS, NUM_TARGETS, BETWEEN_BIRTHS = 300.0, 81, 4, 10
NOISE_DENSITY, MEETING_STD = 0.02, 0.5  # m^2/s^3; m and m/s, of the states in the middle of the run
CUTOFF, STREAM = 10.0, 7511
SCENE = f"""
format: 1
name: pmbm
time: {{num_steps: {NUM_SCANS}}}
region: {{x_min: 0.0, x_max: {SIDE}, y_min: 0.0, y_max: {SIDE}}}
motion: {{kind: constant_velocity, sigma_v: {NOISE_DENSITY**0.5}, noise_model: continuous_white}}
survival: {{kind: constant, probability: 0.99}}
birth: {{sites: [{{existence: 0.005, mean: [100.0, 100.0, 0.0, 0.0], std: [150.0, 150.0, 1.0, 1.0]}}]}}
targets: {{kind: scripted, tracks: [{{state: [150.0, 150.0, 0.0, 0.0]}}]}}
sensors:
- position: [0.0, 0.0]
  measurement: {{kind: position}}
  noise: {{kind: constant, std: [1.0, 1.0]}}
  detection: {{kind: constant, probability: 0.9}}
  clutter: {{kind: region, rate: 10.0}}
fusion: {{kind: none}}
ospa: {{cutoff: {CUTOFF}, order: 2.0}}
"""
FILTERS: dict[str, dict[str, Any]] = {
    "default": {},
    "default, marginal .4": {"estimator": {"kind": "marginal", "threshold": 0.4}},
    "default, least_gospa": {"estimator": {"kind": "least_gospa"}},
    "lmb, births: poisson": {"filter.kind": "lmb", "filter.births": "poisson"},
    "lmb": {"filter.kind": "lmb"},
    "delta_glmb": {"filter.kind": "delta_glmb"},
}


@dataclass(frozen=True)
class Setting:
    """The numbers that differ between settings."""

    detection: float
    clutter: float  # false measurements a scan
    births: float  # expected number a scan

    @property
    def name(self) -> str:
        return f"P_D {self.detection:g}, clutter {self.clutter:g}, births {self.births:g}"


SETTINGS = (
    Setting(0.9, 10.0, 0.005),  # the authors' own
    Setting(0.7, 10.0, 0.005),
    Setting(0.9, 50.0, 0.005),
    Setting(0.9, 10.0, 0.0005),
)


def drawn_targets(rng: np.random.Generator) -> list[np.ndarray]:
    """Draw the positions of the targets present at each scan, (num_targets, 2), from the middle of the run outwards."""
    middle = NUM_SCANS // 2
    states = rng.normal(0.0, MEETING_STD, (NUM_TARGETS, 2, 2))
    states[:, 0] += SIDE / 2.0
    factor = np.linalg.cholesky(NOISE_DENSITY * np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]]))
    step = np.array([[1.0, 1.0], [0.0, 1.0]])
    positions = np.empty((NUM_SCANS, NUM_TARGETS, 2))
    positions[middle] = states[:, 0]
    forward = backward = states
    for k in range(1, middle + 1):
        noise = rng.normal(size=(2, *states.shape))
        forward = step @ forward + factor @ noise[0]
        backward = np.linalg.inv(step) @ (backward + factor @ noise[1])
        positions[middle + k], positions[middle - k] = forward[:, 0], backward[:, 0]
    first, last = BETWEEN_BIRTHS * np.arange(NUM_TARGETS), np.full(NUM_TARGETS, NUM_SCANS)
    last[0] = middle
    return [positions[k, (first <= k) & (k < last)] for k in range(NUM_SCANS)]


def drawn_run(setting: Setting, run: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the true positions and the scans of a run; all settings have the same targets in a run."""
    truth = drawn_targets(np.random.default_rng([STREAM, run]))
    rng = np.random.default_rng([STREAM, run, SETTINGS.index(setting)])
    scans = []
    for targets in truth:
        detected = targets[rng.random(len(targets)) < setting.detection]
        false = rng.uniform(0.0, SIDE, (rng.poisson(setting.clutter), 2))
        scans.append(np.round(np.vstack([detected + rng.normal(size=detected.shape), false]), 4))
    return truth, scans


def as_text(points: Sequence[np.ndarray]) -> str:
    """Return a line "scan x y" for each point, with scans counted from 1."""
    return "".join(f"{k} {x:.4f} {y:.4f}\n" for k, of_scan in enumerate(points, 1) for x, y in of_scan)


def parsed(text: str) -> list[np.ndarray]:
    """Return the points of each scan from lines "scan x y"."""
    rows = np.array([line.split() for line in text.splitlines() if line.strip()], float).reshape(-1, 3)
    if not np.isin(rows[:, 0], np.arange(1, NUM_SCANS + 1)).all():
        raise ValueError(f"expected scans 1 to {NUM_SCANS}; got {rows[:, 0].min():g} to {rows[:, 0].max():g}")
    return [rows[rows[:, 0] == k, 1:] for k in range(1, NUM_SCANS + 1)]


def checksum(setting: Setting, runs: int) -> str:
    """Return the SHA-256 checksum of the scans of a setting."""
    return hashlib.sha256("".join(as_text(drawn_run(setting, run)[1]) for run in range(runs)).encode()).hexdigest()


def score(truth: Sequence[np.ndarray], found: Sequence[np.ndarray]) -> float:
    """Return the mean over scans of the squared GOSPA."""
    pairs = zip(found, truth, strict=True)
    return float(np.mean([gospa(points, true, cutoff=CUTOFF, order=2.0).total ** 2 for points, true in pairs]))


def own_score(setting: Setting, fields: dict[str, Any], run: int, num_scans: int = NUM_SCANS) -> tuple[float, float]:
    """Return the score of one of Vedette's filters on the first scans of a run, and its median time per scan in s."""
    models = {
        "birth.sites.0.existence": setting.births,
        "sensors.*.detection.probability": setting.detection,
        "sensors.*.clutter.rate": setting.clutter,
    }
    truth, scans = drawn_run(setting, run)
    with suppress_unit_warnings():
        experiment = build_experiment(replace_fields(Scenario(parse_scenario(SCENE)), {**models, **fields}))
        timed = Timed(experiment.tracker, [])
        rngs = [np.random.default_rng(0)]
        state, found = timed.initial(), []
        for k, scan in enumerate(scans[:num_scans]):
            state, _ = timed.step(state, [scan], experiment.poses, float(experiment.times[k]), rngs=rngs)
            found.append(experiment.estimate(state.fused, k + 1).means[:, :2])
    return score(truth[:num_scans], found), float(np.median(timed.seconds))


def write_scans(folder: Path, runs: int) -> None:
    """Write the settings and the scans of all runs."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"{n} {s.detection:g} {s.clutter:g} {s.births:g}\n" for n, s in enumerate(SETTINGS, 1)]
    (folder / "settings.txt").write_text("".join(lines), encoding="utf-8")
    for number, setting in enumerate(SETTINGS, 1):
        for run in range(runs):
            (folder / f"{number}-{run}.txt").write_text(as_text(drawn_run(setting, run)[1]), encoding="utf-8")


def scores_of_files(folder: Path) -> list[dict[str, Any]]:
    """Return the scores of the runs of each setting that have estimates of all other filters."""
    rows = []
    for number, setting in enumerate(SETTINGS, 1):
        scores: dict[str, list[float]] = {name: [] for name in OTHERS}
        runs = 0
        while all((folder / f"{number}-{runs}.{name}.txt").exists() for name in OTHERS):
            truth, _ = drawn_run(setting, runs)
            for name, of_runs in scores.items():
                text = (folder / f"{number}-{runs}.{name}.txt").read_text("utf-8")
                of_runs.append(round(score(truth, parsed(text)), 4))
            runs += 1
        rows.append({"setting": setting.name, "runs": runs, "scans_sha256": checksum(setting, runs), **scores})
    return rows


def difference(ours: Sequence[float], theirs: Sequence[float]) -> str:
    """Return the mean of the paired differences and its standard error; below zero the first is better."""
    differences = np.subtract(ours, theirs)
    mean = f"{differences.mean():+.2f}".replace("-", "\u2212")
    return mean + (f" ± {differences.std(ddof=1) / len(differences) ** 0.5:.2f}" if len(differences) > 1 else "")


def table(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Return the lines of a Markdown table: scores of PMBM, and differences of the others to them."""
    names = [name for name in rows[0] if name not in ("setting", "runs", "scans_sha256", "PMBM")]
    yield "| setting | runs | PMBM | " + " | ".join(names) + " |"
    yield "|---|" + "---:|" * (len(names) + 2)
    together = {"setting": "all", "runs": sum(row["runs"] for row in rows)}
    together |= {name: [one for row in rows for one in row[name]] for name in ("PMBM", *names)}
    for row in (*rows, together):
        cells = [difference(row[name], row["PMBM"]) for name in names]
        yield f"| {row['setting']} | {row['runs']} | {np.mean(row['PMBM']):.2f} | " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, help="of each setting; default: those recorded")
    parser.add_argument("--write-scans", type=Path, metavar="FOLDER", help="write the scans and end")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="record the scores of estimates and end")
    parser.add_argument("--out", type=Path, default=RECORDED, help="file of --record")
    options = parser.parse_args()
    if options.write_scans:
        write_scans(options.write_scans, options.runs or 5)
        return
    recorded = json.loads(RECORDED.read_text("utf-8")) if RECORDED.exists() else {}
    if options.record:
        text = json.dumps({**recorded, "settings": scores_of_files(options.record)}, indent=2, ensure_ascii=False)
        options.out.write_text(text + "\n", encoding="utf-8")
        return
    rows: list[dict[str, Any]] = []
    seconds: dict[str, list[float]] = {name: [] for name in FILTERS}
    for setting, theirs in zip(SETTINGS, recorded["settings"], strict=True):
        if theirs["scans_sha256"] != checksum(setting, theirs["runs"]):
            print(f"{setting.name}: these scans are not the recorded ones, so the differences are not paired.")
        runs = min(options.runs or theirs["runs"], theirs["runs"])
        row = {**theirs, "runs": runs, **{name: theirs[name][:runs] for name in OTHERS}}
        for name, fields in FILTERS.items():
            found = [own_score(setting, fields, run) for run in range(runs)]
            row[name] = [one for one, _ in found]
            seconds[name] += [time for _, time in found]
        rows.append(row)
    print("\n".join(table(rows)))
    print("\nMedian CPU time per scan, ms: ", end="")
    print(", ".join(f"{name} {1e3 * np.median(times):.2f}" for name, times in seconds.items()))


if __name__ == "__main__":
    main()
