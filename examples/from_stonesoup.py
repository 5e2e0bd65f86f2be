"""Stone Soup's simulator and plotter around a filter of this library.

    python examples/from_stonesoup.py [--picture FILE]

Needs `pip install 'vedette[stonesoup]'`.
"""

from __future__ import annotations

import datetime

import numpy as np
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.plotter import Plotter
from stonesoup.simulator.simple import MultiTargetGroundTruthSimulator, SimpleDetectionSimulator
from stonesoup.types.state import GaussianState

from vedette.stonesoup import LabelledTracker, convert

START = datetime.datetime(2026, 1, 1)


def main() -> tuple[set, set]:
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.05)] * 2, seed=1)
    measurement = LinearGaussian(4, (0, 2), np.diag([25.0, 25.0]), seed=1)
    anywhere = GaussianState([0.0] * 4, np.diag([4e4, 25.0, 4e4, 25.0]), timestamp=START)
    truth = MultiTargetGroundTruthSimulator(motion, anywhere, number_steps=40, initial_number_targets=5, seed=2)
    box = np.array([[-800.0, 800.0], [-800.0, 800.0]])
    detector = SimpleDetectionSimulator(truth, measurement, box, clutter_rate=5.0, seed=3)

    prior = GaussianState([0.0] * 4, np.diag([100.0, 25.0, 100.0, 25.0]))
    tracker = LabelledTracker(detector, convert(motion, [measurement], births=prior, clutter=detector))
    tracks, paths = set(), set()
    for _, current in tracker:
        tracks |= current
        paths |= set(truth.groundtruth_paths)

    for track in sorted(tracks, key=lambda track: track.id):
        print(f"label {track.id}: {len(track)} states, existence at the end {track.metadata['existence']:.3f}")
    return paths, tracks


def draw(found: tuple[set, set]):
    """By Stone Soup's own plotter."""
    paths, tracks = found
    plotter = Plotter()
    plotter.plot_ground_truths(paths, [0, 2])
    plotter.plot_tracks(tracks, [0, 2])
    return plotter.fig


if __name__ == "__main__":
    from pictures import show

    show(main, draw)
