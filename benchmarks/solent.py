"""The Solent as a harbour watches it: radars calibrated by their scans, ships tracked and boats sent, by commands.

    python benchmarks/solent.py [--out DIR] [--runs N] [--workers N] [--peers-python PYTHON] [--write docs/solent.md]

The scene is `solent-patrol`, but that its radars have biases that nobody knows (`BIASES`). Ten minutes of scans are
recorded while the boats keep to a rule of thumb; `vedette calibrate` finds from them what the radars are like, and with
that ships are tracked and boats decide for half an hour, run by run beside the same with the biases known and with no
word of them. `DIR` holds every file: what was told of the radars, the scans, what was found, the three scenarios, the
campaign, its report, a replay, a video and the tracks. Called again it goes on.

With `--peers-python`, an interpreter that has Stone Soup, its multi-sensor tracker takes the scans of the first runs
(`solent_peer.py`).
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pages import write_between

from vedette.campaigns import open_results
from vedette.evaluation import ospa
from vedette.evaluation.figures import build_scene, save_figure, tracks_figure
from vedette.evaluation.runs import run_scenario
from vedette.evaluation.statistics import summarise
from vedette.evaluation.tail_summary import tail_sentence
from vedette.evaluation.track_table import table_of_run, write_tracks
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.dumping import dump_data
from vedette.scenarios.yaml_reader import read_yaml
from vedette.simulation import Experiment, RunRecord, Scan
from vedette.simulation.replay import scans_of

Data = dict[str, Any]
Scans = Sequence[Sequence[Scan | None]]

BIASES: dict[str, dict[str, float]] = {
    "Southsea": {"range": 150.0, "bearing_deg": -1.0},
    "boat 1": {"range": -80.0, "bearing_deg": 2.0, "clock": 0.5},
    "boat 2": {"range": 60.0, "bearing_deg": -1.5, "clock": -0.5},
}
# What is told of every radar, none of it true.
TOLD_NOISE: Data = {
    "kind": "range_dependent",
    "sigma_range": 30.0,
    "eta_range": 0.0,
    "sigma_bearing_deg": 1.0,
    "eta_bearing": 0.0,
}
TOLD_PROBABILITY, TOLD_RATE = 0.8, 8.0
WORDS = {"range": "range, m", "bearing_deg": "bearing, degrees", "clock": "clock, s"}
WORDS |= {"sigma_range": "range, m", "sigma_bearing_deg": "bearing, degrees"}
STRATEGIES = ("jdm", "idm", "nearest", "assigned_target", "centroid", "random", "constant", "oracle", "true_targets")
RECORDED = 600.0  # s
PEER = Path(__file__).with_name("solent_peer.py").resolve()
SEED = 5
FROM_TIME = 120.0  # s, of the first decision
PARTS = ("bias", "noise", "detection", "clutter")
NO_BIAS = {"range": 0.0, "bearing_deg": 0.0, "clock": 0.0, "x": 0.0, "y": 0.0}


def told(data: Data) -> list[Data]:
    """The sensors as they are told to be."""
    found = []
    for own in data["sensors"]:
        detection = {**own["detection"], "probability": TOLD_PROBABILITY}
        found.append(
            {**own, "noise": TOLD_NOISE, "detection": detection, "clutter": {**own["clutter"], "rate": TOLD_RATE}}
        )
    return found


def in_truth(data: Data, sensors: list[Data]) -> list[Data]:
    """Sensors that are as the scene has them, biases added, whatever filters know of them."""
    parts = ("noise", "detection", "clutter")
    return [
        {**known, "true_parameters": {**{part: own[part] for part in parts}, "bias": BIASES[own["name"]]}}
        for own, known in zip(data["sensors"], sensors, strict=True)
    ]


def record_patrol(data: Data, beside: Path, folder: Path) -> None:
    """scans.csv, of ten minutes, and radars.yaml, what is told of who made them."""
    steps, times = round(RECORDED / data["time"]["step_period"]), data["control"]["decision_times"]
    start = {**data, "sensors": in_truth(data, told(data)), "time": {**data["time"], "num_steps": steps}}
    start["control"] = {**data["control"], "decision_times": [time for time in times if time < RECORDED]}
    (folder / "patrol.yaml").write_text(dump_data(start, beside), "utf-8")
    scenario = load_scenario(folder / "patrol.yaml")
    record = run_scenario(scenario, "nearest", seed=SEED)
    instants = zip(record.times.tolist(), scans_of(record, build_experiment(scenario)), record.poses, strict=True)
    with (folder / "scans.csv").open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["time", "sensor", "range_m", "bearing_deg", "own_x", "own_y", "own_heading_deg"])
        for time, scans, poses in instants:
            for own, scan, (x, y, heading) in zip(data["sensors"], scans, poses.tolist(), strict=True):
                if scan is None:
                    continue
                place = [f"{x:.2f}", f"{y:.2f}", f"{math.degrees(heading):.2f}"]
                rows = [[f"{far:.2f}", f"{math.degrees(angle):.4f}"] for angle, far in scan.measurements.tolist()]
                out.writerows([time, own["name"], *row, *place] for row in rows or [["", ""]])
    known = {name: data[name] for name in ("origin", "region", "motion", "survival", "birth", "filter", "ospa")}
    parts = ("name", "position", "heading_deg", "noise", "detection", "clutter")
    sensors = [{part: own[part] for part in parts} for own in told(data)]
    text = dump_data({"recording": {"bearings": "east"}, **known, "sensors": sensors})
    (folder / "radars.yaml").write_text(text, "utf-8")


def write_scene(data: Data, beside: Path, folder: Path, runs: int) -> None:
    """scene.yaml, with the radars as they were found to be, and two campaigns on it."""
    found = read_yaml((folder / "calibrated.yaml").read_text("utf-8"), "calibrated.yaml").data["sensors"]
    sensors = {
        "biases known": [{**own, "bias": BIASES[own["name"]]} for own in data["sensors"]],
        "calibrated": [
            own | {part: each[part] for part in PARTS} for own, each in zip(data["sensors"], found, strict=True)
        ],
        "as assumed": told(data),
    }
    scene = {**data, "name": "solent", "sensors": in_truth(data, sensors["calibrated"])}
    scene["ospa"] = {**data["ospa"], "first_scan": 1 + round(FROM_TIME / data["time"]["step_period"])}
    (folder / "scene.yaml").write_text(dump_data(scene, beside), "utf-8")
    head = f'scenarios = ["scene.yaml"]\nruns = {runs}\n'
    planners = ", ".join(f'"{name}"' for name in STRATEGIES)
    (folder / "strategies.toml").write_text(f'name = "strategies"\n{head}planners = [{planners}]\n', "utf-8")
    text = f'name = "biases"\n{head}planners = ["jdm"]\ncompare = "variant"\n'
    for name, known in sensors.items():
        fields = {f"sensors.{s}.{part}": own.get(part, {}) for s, own in enumerate(known) for part in PARTS}
        fields |= {key: {**NO_BIAS, **value} for key, value in fields.items() if key.endswith("bias")}
        text += f'\n[[variants]]\nname = "{name}"\nset = {inline(fields)}\n'
    (folder / "biases.toml").write_text(text, "utf-8")


def inline(value: Any) -> str:
    """A value as TOML has it on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f'"{key}" = {inline(each)}' for key, each in value.items() if each is not None) + " }"
    return json.dumps(value)


def vedette(folder: Path, *words: str) -> None:
    """A command, as one would give it in the folder."""
    print(f"$ vedette {shlex.join(words)}", flush=True)
    subprocess.run([sys.executable, "-c", "from vedette.cli import app; app()", *words], cwd=folder, check=True)


def show(folder: Path) -> None:
    """A run of what decides best, as a page, a video and files of tracks; and the report of all."""
    vedette(folder, "run", "scene.yaml", "--planner", "jdm", "--seed", "0", "--out", "jdm", "--quiet")
    vedette(folder, "report", "jdm", "--out", "replay.html", "--quiet")
    vedette(folder, "report", "strategies-results", "--out", "report.html", "--quiet")
    ending = "mp4" if shutil.which("ffmpeg") else "gif"
    vedette(folder, "video", "jdm", "--out", f"patrol.{ending}", "--quiet")
    scenario = load_scenario(folder / "scene.yaml")
    columns = table_of_run(run_scenario(scenario, "jdm", seed=0), scenario)
    write_tracks(folder / "tracks.geojson", columns)


def picture(folder: Path) -> None:
    """The same half hour with what was told of the radars and with what was found."""
    results = open_results(folder / "biases-results")
    cells = {str(cell.settings["variant"]): cell.name for cell in results.campaign.cells}
    records = [results.record(cells[name], 0) for name in ("as assumed", "calibrated")]
    scene = build_scene(load_scenario(folder / "scene.yaml"), "jdm")
    figure = tracks_figure(*records, titles=["biases unknown", "calibrated by its own scans"], scene=scene)
    save_figure(figure, folder / "solent", formats=("png",))


def calibration_table(folder: Path) -> Iterator[str]:
    """What was found of the radars, beside what is true."""
    sensors = read_yaml((folder / "calibrated.yaml").read_text("utf-8"), "calibrated.yaml").data["sensors"]
    truth = {own.name: own for own in load_scenario("solent-patrol").model.sensors}
    yield "| radar | parameter | assumed | truth | estimate |"
    yield "| --- | --- | ---: | ---: | ---: |"
    for found in sensors:
        name, rows = found["name"], list[tuple[str, float, float, float]]()
        for key, value in BIASES[name].items():
            rows.append((f"bias, {WORDS[key]}", 0.0, value, found["bias"].get(key, 0.0)))
        for key in ("sigma_range", "sigma_bearing_deg"):
            rows.append((f"noise, {WORDS[key]}", TOLD_NOISE[key], getattr(truth[name].noise, key), found["noise"][key]))
        own, probability = truth[name], found["detection"]["probability"]
        rows.append(("detection", TOLD_PROBABILITY, own.detection.model_dump()["probability"], probability))
        rows.append(
            ("false measurements per scan", TOLD_RATE, own.clutter.model_dump()["rate"], found["clutter"]["rate"])
        )
        for words, *numbers in rows:
            yield f"| {name} | {words} | " + " | ".join(f"{number:.3g}" for number in numbers) + " |"


def table_of(folder: Path, name: str) -> Iterator[str]:
    """Error, and share of the ships in sight that are tracked, of each cell of a campaign, and against the first."""
    [group] = open_results(folder / f"{name}-results").comparisons()
    comparison, [first, *_] = group.comparison, group.labels
    yield f"| {'radars' if name == 'biases' else 'strategy'} | OSPA (m) | more (m) | in sight and tracked |"
    yield "| --- | ---: | ---: | ---: |"
    for label in group.labels:
        total, tracked = comparison.summary(label), comparison.summary(label, "tracked_fraction")
        more = None if label == first else comparison.difference(label, first).summary
        cells = [label, f"{total.mean:.2f} ± {total.standard_error:.2f}"]
        cells += ["" if more is None else f"{more.mean:+.2f} ± {more.standard_error:.2f}", f"{tracked.mean:.1%}"]
        yield "| " + " | ".join(cells) + " |"
    yield ""
    yield f"{comparison.num_runs} paired runs. {tail_sentence(comparison)}"


def peer_table(folder: Path, python: str, runs: int) -> Iterator[str]:
    """Ours and Stone Soup's on the scans of the same runs, biases taken off and nothing late."""
    results, scenario = open_results(folder / "strategies-results"), load_scenario(folder / "scene.yaml")
    [cell] = [each for each in results.campaign.cells if each.planner == "jdm"]
    experiment, scores = build_experiment(scenario), dict[str, list[tuple[float, float]]]()
    for number in results.finished(cell.name)[:runs]:
        record = results.record(cell.name, number)
        spent = sum(record.timings[stage].sum() for stage in ("filter", "fusion"))
        scores.setdefault("Vedette, with late scans", []).append((counted(record, record.estimates, scenario), spent))
        write_peer_scans(folder / "peer-scans.npz", record, scans_of(record, experiment), experiment)
        subprocess.run([python, str(PEER), "peer-scans.npz", "peer-found.npz"], cwd=folder, check=True)
        with np.load(folder / "peer-found.npz") as found:
            for name in found["names"].tolist():
                places = [found[f"{name}_{k}"] for k in range(record.num_scans)]
                own = counted(record, places, scenario), float(found[f"{name}_seconds"])
                scores.setdefault(f"Stone Soup, {name}", []).append(own)
    yield "| tracker | OSPA (m) | CPU s a run |"
    yield "| --- | ---: | ---: |"
    for name, own in scores.items():
        total = summarise([score for score, _ in own])
        yield f"| {name} | {total.mean:.2f} ± {total.standard_error:.2f} | {np.mean([spent for _, spent in own]):.1f} |"


def write_peer_scans(
    path: Path, record: RunRecord, scans: Sequence[Sequence[Scan | None]], experiment: Experiment
) -> None:
    """The scans of a run in order, see `solent_peer.py`."""
    stds = [sensor.noise.least_stds for sensor in experiment.tracker.sensors]
    took = [(k, s, scan) for k, of_all in enumerate(scans) for s, scan in enumerate(of_all) if scan is not None]
    arrays = {f"scan_{n}": scan.measurements for n, (_, _, scan) in enumerate(took)}
    poses, noise = [record.poses[k, s, :2] for k, s, _ in took], [stds[s] for _, s, _ in took]
    np.savez(path, times=record.times, steps=[k for k, _, _ in took], poses=poses, noise=noise, **arrays)


def counted(record: RunRecord, found: Sequence[Any], scenario: Scenario) -> float:
    """Mean OSPA, m, of the steps that count."""
    section, distances = scenario.model.ospa, []
    for k in range(section.first_scan - 1, record.num_scans):
        places = found[k] if isinstance(found[k], np.ndarray) else found[k].means[:, :2]
        true = record.truth.at(k)[1][:, :2]
        distances.append(ospa(places, true, cutoff=section.cutoff, order=section.order).total)
    return float(np.mean(distances))


def main() -> None:
    """Read the arguments, and do it all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("solent-patrol"), help="folder of everything")
    parser.add_argument("--runs", type=int, default=20, help="of each strategy")
    parser.add_argument("--workers", type=int, default=0, help="processes; 0: one a processor")
    parser.add_argument("--peers-python", help="an interpreter that has Stone Soup")
    parser.add_argument("--peer-runs", type=int, default=5, help="that it takes")
    parser.add_argument("--write", type=Path, help="page of the documentation whose tables are replaced")
    given = parser.parse_args()
    scenario, folder = load_scenario("solent-patrol"), given.out
    data, beside = scenario.model.model_dump(mode="json"), scenario.folder
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "calibrated.yaml").exists():
        record_patrol(data, beside, folder)
        vedette(folder, "calibrate", "scans.csv", "--sensors", "radars.yaml", "--out", "calibrated.yaml")
    write_scene(data, beside, folder, given.runs)
    for name in ("biases", "strategies"):
        vedette(folder, "campaign", f"{name}.toml", "--workers", str(given.workers), "--quiet")
    if not (folder / "tracks.geojson").exists():
        show(folder)
    picture(folder)
    tables = {"calibrate": calibration_table(folder)}
    tables |= {name: table_of(folder, name) for name in ("biases", "strategies")}
    if given.peers_python is not None:
        tables["peers"] = peer_table(folder, given.peers_python, given.peer_runs)
    for name, lines in tables.items():
        text = "\n".join(lines)
        print(f"\n{text}", flush=True)
        if given.write is not None:
            write_between(given.write, f"solent.py {name}", text)


if __name__ == "__main__":
    main()
