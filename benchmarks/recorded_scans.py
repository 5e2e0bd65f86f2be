"""OSPA and CPU time of the filters on recorded scans, beside the figures of the programs that made them.

    python benchmarks/recorded_scans.py [--family NAME] [--redraws N] [--markdown]

Of this project's own files (tests/filters/recordings), and of those of other programs where they are at hand: in the
folder that VEDETTE_RECORDED_SCANS names, or in shared/reference beside the checkout (docs/recorded-scans.md).
OSPA with c = 100 m and p = 1, mean over 100 scans, then mean and standard deviation over the files; CPU time of a step,
median over scans and files. With `--redraws` the targets of each file are seen anew N times, detections, noise and
clutter drawn by its parameters: mean with standard error, standard deviation, best and worst over all draws.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from vedette.filters import (
    DeltaGlmbFilter,
    LmbFilter,
    MultiSensorGlmbFilter,
    MultiSensorLmbFilter,
    SequentialLmbFilter,
)

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from filters import recorded

# Published with the files: mean OSPA (standard deviation), median CPU ms a scan (GNU Octave, Gibbs sampler in C).
TOOLBOXES = {
    ("lin30", "delta-GLMB"): "11.70 (0.28), 13 files, 128 ms",
    ("lin30", "LMB"): "12.54 (3.0), 13 files, 31 ms",
    ("lin60", "delta-GLMB"): "CPHD 18.4 (1.1), 5 files, 125 ms",
    ("ct15", "delta-GLMB, EKF"): "24.6 (0.6), 5 files, 519 ms",
    ("ct15", "delta-GLMB, UKF"): "24.6 (0.65), 5 files, 648 ms",
    ("ct15", "LMB, EKF"): "24.7 (0.8), 5 files, 30 ms",
    ("mslin3", "LMB, central"): "iterated corrector 5.7 (0.9), 5 files, 252 ms; parallel update 7.2 (1.3), 47 ms",
}

LINEAR: dict[str, tuple[type, dict[str, Any]]] = {
    "delta-GLMB": (DeltaGlmbFilter, {}),
    "delta-GLMB, Gibbs": (DeltaGlmbFilter, {"assignment": "gibbs"}),
    "M-delta-GLMB": (DeltaGlmbFilter, {"marginalised": True}),
    "LMB": (LmbFilter, {}),
}
CURVED: dict[str, tuple[type, dict[str, Any]]] = {
    f"{name}, {method.upper()}": (kind, {"method": method})
    for name, kind in (("delta-GLMB", DeltaGlmbFilter), ("LMB", LmbFilter))
    for method in ("ekf", "ukf", "ckf")
}
CENTRAL: dict[str, tuple[type, dict[str, Any]]] = {
    "LMB, central": (MultiSensorLmbFilter, {}),
    "LMB, sensor after sensor": (SequentialLmbFilter, {}),
    "delta-GLMB, central": (MultiSensorGlmbFilter, {}),
}
FAMILIES = {"lin30": LINEAR, "lin60": LINEAR, "ct15": CURVED, "mslin3": CENTRAL}


def recordings(family: str, folder: Path, redraws: int) -> list[recorded.Recording]:
    """The files, or draws of each with seeds that tell its number."""
    files = {seed: recorded.load(family, seed, folder) for seed in recorded.seeds(family, folder)}
    if not redraws:
        return list(files.values())
    return [
        recorded.redraw(file, rng=np.random.default_rng([seed, draw]))
        for seed, file in files.items()
        for draw in range(redraws)
    ]


def row(source: str, folder: Path, family: str, name: str, redraws: int) -> list[str]:
    kind, options = FAMILIES[family][name]
    ospas, seconds = [], []
    for recording in recordings(family, folder, redraws):
        if FAMILIES[family] is CENTRAL:
            estimates, spent = recorded.run_central(recorded.make_central(kind, recording, **options), recording)
        else:
            estimates, spent = recorded.run(recorded.make_filter(kind, recording, **options), recording)
        ospas.append(recorded.mean_ospa(estimates, recording))
        seconds += spent
    each = " ".join(f"{value:.2f}" for value in ospas)
    summary = f"{np.mean(ospas):.2f} ({np.std(ospas, ddof=1):.2f})" if len(ospas) > 1 else each
    if redraws:
        error = np.std(ospas, ddof=1) / np.sqrt(len(ospas))
        summary = f"{np.mean(ospas):.2f} +- {error:.2f} ({np.std(ospas, ddof=1):.2f})"
        each = f"{len(ospas)} draws, {min(ospas):.2f} to {max(ospas):.2f}"
    theirs = TOOLBOXES.get((family, name), "") if source == "others" else ""
    return [source, family, name, summary, each, f"{1e3 * np.median(seconds):.2f}", theirs]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table")
    parser.add_argument("--family", choices=FAMILIES, help="one family alone")
    parser.add_argument("--redraws", type=int, default=0, metavar="N", help="see the targets of each file anew N times")
    options = parser.parse_args()
    families = [options.family] if options.family else list(FAMILIES)
    rows = [["files", "family", "filter", "OSPA m (sd)", "each file", "ms per scan", "toolboxes"]]
    for source, folder in recorded.sources().items():
        for family in families:
            if recorded.seeds(family, folder):
                rows += [row(source, folder, family, name, options.redraws) for name in FAMILIES[family]]
    if options.markdown:
        rows.insert(1, ["---"] * len(rows[0]))
    widths = [max(len(entries[i]) for entries in rows) for i in range(len(rows[0]))]
    for entries in rows:
        cells = [entry.ljust(width) for entry, width in zip(entries, widths, strict=True)]
        print(f"| {' | '.join(cells)} |" if options.markdown else "  ".join(cells).rstrip())


if __name__ == "__main__":
    main()
