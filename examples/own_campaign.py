"""A planner and a metric of your own in a campaign: paired runs against what is there, and a table of them.

    python examples/own_campaign.py [--picture FILE]

The planner is a class with `plan`; the metric is a function of a run's record that gives a number a scan. A scenario
names them, and from there on campaigns, tables and reports know them.
"""

from __future__ import annotations

import tempfile

import numpy as np

from vedette.campaigns import CampaignSpec, open_results, resolve, run_campaign
from vedette.control import Plan, RewardTable
from vedette.densities import marginal_estimate
from vedette.evaluation import Comparison
from vedette.platforms import Actions

RUNS = 5


class NearFarthest:
    """Every sensor goes where the farthest target will be the least far."""

    name = "near_farthest"

    def __init__(self, sensors, period: float = 10.0) -> None:
        self.sensors, self.times = sensors, np.array([period])

    def plan(self, state, poses, *, rng) -> Plan:
        targets = marginal_estimate(state.fused).means[:, :2]
        actions, chosen, tables = [], [], []
        for s, (sensor, pose) in enumerate(zip(self.sensors, poses, strict=True)):
            own = Actions(sensor.platform.columns, sensor.platform.actions(pose))
            ends = [sensor.platform.course(pose, action, self.times)[-1, :2] for action in own.values]
            values = np.array([-np.linalg.norm(targets - end, axis=1).max(initial=0.0) for end in ends])
            actions.append(own)
            chosen.append(int(values.argmax()))
            tables.append(RewardTable((s,), values, np.zeros(len(values))))
        return Plan(self.name, tuple(actions), tuple(chosen), tuple(tables), {})


def nearest_sensor_m(record) -> np.ndarray:
    """Mean distance of the targets from their nearest sensor, at each scan."""
    distances = np.full(record.num_scans, np.nan)
    for scan in range(record.num_scans):
        targets, sensors = record.truth.at(scan)[1][:, :2], record.poses[scan, :, :2]
        if len(targets):
            distances[scan] = np.linalg.norm(targets[:, None] - sensors, axis=2).min(axis=1).mean()
    return distances


SETTINGS = {
    "filter": {"kind": "lmb"},
    "fusion": {"kind": "clmb"},
    "control.reward": {"kind": "expected_loss", "cutoff": 100.0},
    "planners": {"near_farthest": {"kind": "custom", "function": "own_campaign:NearFarthest"}},
    "metrics": {"nearest_sensor_m": {"kind": "custom", "function": "own_campaign:nearest_sensor_m"}},
}
PLANNERS = ("jdm", "near_farthest", "centroid", "random")


def main() -> Comparison:
    spec = CampaignSpec(name="own", scenarios=("paper-a",), planners=PLANNERS, runs=RUNS, set=SETTINGS)
    with tempfile.TemporaryDirectory() as folder:
        run_campaign(resolve(spec), folder)
        results = open_results(folder)
        near: dict[str, list[float]] = {planner: [] for planner in PLANNERS}
        for run in results.runs():
            near[run.record.planner].append(run.metrics.custom["nearest_sensor_m"][10:].mean())
        (group,) = results.comparisons()
    comparison = group.comparison
    for planner in PLANNERS:
        more = "" if planner == "jdm" else f", {comparison.difference(planner).summary.mean:+6.2f} m to jdm"
        print(f"{planner:13} nearest sensor {np.mean(near[planner]):4.0f} m away{more}")
    return comparison


def draw(comparison: Comparison):
    from vedette.evaluation.figures import ospa_figure

    return ospa_figure(comparison)


if __name__ == "__main__":
    from pictures import show

    show(main, draw)
