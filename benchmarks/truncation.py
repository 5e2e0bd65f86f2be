"""What the truncation of the delta-GLMB costs in accuracy and time, on many draws of scans of recorded truths.

    python benchmarks/truncation.py [--family lin30] [--draws N]

The targets are those of a recorded file (see benchmarks/recorded_scans.py); detections, noise and clutter are drawn
anew by its parameters, the same for every row. OSPA with c = 100 m and p = 1, mean over 100 scans: mean over the draws
with its standard error, and the worst draw; CPU time of a step, median.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from vedette.filters import DeltaGlmbFilter, Limits, LmbFilter

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from filters import recorded


def heaviest(most: int) -> dict[str, Any]:
    return {"limits": Limits(max_hypotheses=most, min_track_weight=1.0)}


ROWS: dict[str, tuple[type, dict[str, Any]]] = {
    "the 300 heaviest": (DeltaGlmbFilter, heaviest(300)),
    "the 1000 heaviest": (DeltaGlmbFilter, heaviest(1000)),
    "the 3000 heaviest": (DeltaGlmbFilter, heaviest(3000)),
    "default, 100": (DeltaGlmbFilter, {"limits": Limits(max_hypotheses=100)}),
    "default, 300": (DeltaGlmbFilter, {}),
    "default, 1000": (DeltaGlmbFilter, {"limits": Limits(max_hypotheses=1000)}),
    "Gibbs, the 300 heaviest": (DeltaGlmbFilter, {"assignment": "gibbs", **heaviest(300)}),
    "Gibbs, default, 300": (DeltaGlmbFilter, {"assignment": "gibbs"}),
    "M-delta-GLMB, default, 300": (DeltaGlmbFilter, {"marginalised": True}),
    "LMB": (LmbFilter, {}),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--family", choices=("lin30", "lin60", "ct15"), default="lin30")
    parser.add_argument("--draws", type=int, default=40)
    options = parser.parse_args()
    folder = recorded.sources().get("others", recorded.OWN)
    seeds = recorded.seeds(options.family, folder)
    original = recorded.load(options.family, seeds[0], folder)
    draws = [recorded.redraw(original, rng=np.random.default_rng(draw)) for draw in range(options.draws)]
    print(f"{'hypotheses kept':28s}  OSPA m          worst  ms per scan")
    for name, (kind, parts) in ROWS.items():
        ospas, seconds = [], []
        for recording in draws:
            estimates, spent = recorded.run(recorded.make_filter(kind, recording, "auto", **parts), recording)
            ospas.append(recorded.mean_ospa(estimates, recording))
            seconds += spent
        error = np.std(ospas, ddof=1) / np.sqrt(len(ospas))
        print(
            f"{name:28s}  {np.mean(ospas):5.2f} +- {error:4.2f}  {max(ospas):7.2f}  {1e3 * np.median(seconds):9.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
