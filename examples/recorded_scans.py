"""Recorded scans: two radars' rows in a CSV file, in nautical miles and compass degrees, to tracks.

    python examples/recorded_scans.py [--picture FILE]

`examples/recording` has the scans, ten lines about the sensors, and the ships' own reports to be scored against. The
command of the same is `vedette track scans.csv --sensors radars.yaml --truth truth.csv`.
"""

from __future__ import annotations

from pathlib import Path

from vedette.evaluation import track_recording
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording
from vedette.simulation import RunRecord

FILES = Path(__file__).parent / "recording"


def main() -> tuple[RecordingScenario, RunRecord]:
    found = scenario_from_recording(FILES / "radars.yaml", FILES / "scans.csv", FILES / "truth.csv")
    record = track_recording(found.scenario, found.recording)
    for section, text in found.assumed.items():
        print(f"assumed {section}: {text}")
    print(f"{found.recording.num_measurements} measurements in {record.num_scans} scans,", end=" ")
    print(f"{record.estimates[-1].num_targets} ships at the end, OSPA {record.ospa[:, 0].mean():.1f} m")
    return found, record


def draw(result: tuple[RecordingScenario, RunRecord]):
    from vedette.evaluation.figures import build_scene, tracks_figure

    found, record = result
    return tracks_figure(record, titles=["Recorded scans"], scene=build_scene(found.scenario, record.planner))


if __name__ == "__main__":
    from pictures import show

    show(main, draw)
