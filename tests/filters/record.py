"""Write the recorded scans of `recordings/`, from the parameters that its README states.

    PYTHONPATH=src:tests python -m filters.record

The targets move without process noise. Numbers are kept in single precision: a tenth of a millimetre at 1 km.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from filters import recorded
from vedette.simulation import ScriptedTargets, simulate_scan

SEEDS = (1, 2, 3)
NUM_SCANS = 100

# First and last scan; px, py in m, vx, vy in m/s; a turn rate in deg/s.
LINEAR = [
    (1, 70, -4, 6, 8, -12),
    (1, 100, 407, -603, -12, 9),
    (1, 70, -806, -208, 17, 6),
    (20, 100, -195, 804, 9, -14),
    (20, 100, 8, 2, -6, -11),
    (20, 100, 397, -591, 4, 13),
    (40, 100, -798, -205, 11, -7),
    (40, 100, -208, 801, -10, -6),
    (60, 100, -2, -7, 14, 5),
    (60, 100, 406, -596, -15, -4),
    (80, 100, -791, -197, 5, 16),
    (80, 100, -199, 794, 13, 8),
]
TURNING = [
    (1, 100, 980, 1470, -9, -11, 0.2),
    (10, 100, -240, 1015, 18, 4, -0.6),
    (10, 100, -1485, 260, 12, 8, -0.9),
    (10, 66, -1460, 245, 38, 3, 0.0),
    (20, 80, 265, 740, 9, 6, 0.5),
    (40, 100, -260, 985, -11, -9, 0.9),
    (40, 100, 1010, 1490, -3, -11, 0.4),
    (40, 80, 240, 755, -42, 5, -0.4),
    (60, 100, 985, 1515, -45, -8, 0.3),
    (60, 100, 255, 765, -35, 14, 0.6),
]
NEAR = [
    (1, 70, -78, -22, 1.0, 1.2),
    (1, 70, -21, 78, -0.6, -1.8),
    (20, 80, 1, 2, -0.8, -0.6),
    (20, 80, 41, -58, 0.3, 1.4),
    (40, 90, -81, -18, 1.4, 0.4),
    (40, 90, 38, -61, -1.3, 1.6),
    (60, 100, -79, -21, 0.9, -0.9),
    (60, 100, -19, 82, 1.5, -0.7),
    (60, 100, -1, -1, 1.2, 0.8),
    (60, 100, 39, -60, -0.9, -0.4),
]
TARGETS = {"lin30": LINEAR, "lin60": LINEAR, "ct15": TURNING, "mslin3": NEAR}


def parameters_of(family: str) -> dict[str, Any]:
    """What the files state beside truth and scans, by the names that the recorded files of other programs use."""
    common = {"family": np.array(family), "K": np.array(float(NUM_SCANS)), "T": np.array(1.0)}
    if family == "mslin3":
        sites = np.array([[-80.0, -20.0], [-20.0, 80.0], [0.0, 0.0], [40.0, -60.0]])
        return common | {
            "P_D": np.array([0.67, 0.70, 0.73]),
            "P_S": np.array(0.95),
            "R_sensor": np.moveaxis(np.array([16.0, 9.0, 4.0])[:, None, None] * np.eye(2), 0, 2),
            "Qproc": np.kron([[1 / 3, 1 / 2], [1 / 2, 1.0]], np.eye(2)),
            "lambda_c": np.full(3, 5.0),
            "region": np.array([[-100.0, 100.0]] * 2),
            "n_sensors": np.array(3.0),
            "r_birth": np.full(4, 0.03),
            "m_birth": np.column_stack([sites, np.zeros((4, 2))]).T,
            "P_birth": np.repeat(100.0 * np.eye(4)[:, :, None], 4, axis=2),
        }
    if family == "ct15":
        sites = np.array([[-1500.0, 250.0], [-250.0, 1000.0], [250.0, 750.0], [1000.0, 1500.0]])
        return common | {
            "P_D": np.array([0.98]),
            "P_S": np.array(0.99),
            "R": np.diag([np.radians(2.0) ** 2, 100.0]),
            "sigma_vel": np.array(5.0),
            "sigma_turn": np.radians(1.0),
            "lambda_c": np.array([15.0]),
            "range_c": np.array([[-np.pi / 2, np.pi / 2], [0.0, 2000.0]]),
            "r_birth": np.array([0.02, 0.02, 0.03, 0.03]),
            "m_birth": _spread(sites, 5),
            "P_birth": np.repeat(np.diag([50.0] * 4 + [np.radians(6.0)])[:, :, None] ** 2, 4, axis=2),
        }
    sites = np.array([[0.1 if family == "lin30" else 0.0] * 2, [400.0, -600.0], [-800.0, -200.0], [-200.0, 800.0]])
    return common | {
        "P_D": np.array([0.98]),
        "P_S": np.array(0.99),
        "R": 100.0 * np.eye(2),
        "Q": 25.0 * np.kron(np.eye(2), np.outer([0.5, 1.0], [0.5, 1.0])),
        "lambda_c": np.array([float(family[3:])]),
        "range_c": np.array([[-1000.0, 1000.0]] * 2),
        "r_birth" if family == "lin30" else "w_birth": np.full(4, 0.03),
        "m_birth": _spread(sites, 4),
        "P_birth": np.repeat(100.0 * np.eye(4)[:, :, None], 4, axis=2),
    }


def _spread(sites: Any, dimension: int) -> Any:
    """(dimension, 4) birth means [px vx py vy ...] at rest."""
    means = np.zeros((dimension, len(sites)))
    means[0], means[2] = sites.T
    return means


def contents(family: str, seed: int) -> dict[str, Any]:
    """The arrays of a file."""
    parameters = parameters_of(family)
    targets = np.array(TARGETS[family], dtype=np.float64)
    states = targets[:, 2:].copy()
    if family == "ct15":
        states[:, 4] = np.radians(states[:, 4])
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(sorted(TARGETS).index(family),)))
    times = np.arange(1.0, NUM_SCANS + 1.0)
    motion = recorded.motion_model(parameters, "auto")
    truth = ScriptedTargets(motion, states, targets[:, 0], targets[:, 1]).truth(times, rng=rng)
    sensors = recorded.sensor_models(parameters, "auto")
    scans, scan_numbers, sensor_numbers = [], [], []
    for step in range(NUM_SCANS):
        for number, sensor in enumerate(sensors, start=1):
            seen = simulate_scan(truth.at(step)[1], recorded.POSE, sensor, rng=rng).measurements
            scans.append(seen)
            scan_numbers += [step + 1] * len(seen)
            sensor_numbers += [number] * len(seen)
    order = list(range(4)) if family == "mslin3" else recorded.STATE_ORDER[states.shape[1]]
    found = parameters | {
        "seed": np.array(float(seed)),
        "Z": np.concatenate(scans).T.astype(np.float32),
        "Zk": np.array(scan_numbers, dtype=np.uint8),
        "X_true": truth.states[:, order].T.astype(np.float32),
        "Xk_true": np.repeat(np.arange(1, NUM_SCANS + 1), np.diff(truth.offsets)).astype(np.uint8),
        "track_true": (truth.ids + 1).astype(np.uint8),
    }
    return found | ({"Zs": np.array(sensor_numbers, dtype=np.uint8)} if len(sensors) > 1 else {})


def main() -> None:
    recorded.OWN.mkdir(exist_ok=True)
    for family in TARGETS:
        for seed in SEEDS:
            path: Path = recorded.OWN / f"meas_{family}_s{seed}.npz"
            np.savez_compressed(path, **contents(family, seed))
            print(path.name, path.stat().st_size)


if __name__ == "__main__":
    main()
