"""Page of a live loop: the replay view with the present state instead of a run."""

import hashlib
import json
import math
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vedette.control import Plan, Planner
from vedette.evaluation.diagnostics import diagnostics_line, new_target_diagnostics, run_diagnostics
from vedette.evaluation.figures.scene import build_scene
from vedette.evaluation.scans import UNKNOWN
from vedette.kernels.base.types import HEIGHT, Floats, place_of
from vedette.live import Answer, LiveLoop, LiveState
from vedette.reports.html import render
from vedette.reports.replay import (
    decimals_for,
    decision_data,
    estimate_data,
    height_data,
    measurement_data,
    pose_data,
    rounded_list,
    sensor_data,
)
from vedette.scenarios import Scenario
from vedette.scenarios.new_targets import new_targets
from vedette.scenarios.sections.tracking import UNLABELLED
from vedette.simulation.health import Health
from vedette.simulation.records import Decision
from vedette.simulation.scans import Scan
from vedette.tracking import State, Timeline

_HEALTH_OF = 100  # number of latest scans
_STEPS_OF_EXTENT = 10.0


@dataclass(slots=True)
class LastPlanCache:
    """Planner that stores its last plan. Plans are those of the wrapped planner."""

    planner: Planner
    last: Plan | None = None
    num_plans: int = 0

    @property
    def name(self) -> str:
        """Name of the planner."""
        return self.planner.name

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the plan of the wrapped planner."""
        self.last = self.planner.plan(state, poses, rng=rng)
        self.num_plans += 1
        return self.last


class LiveScreen:
    """Content of the pages of a live loop.

    Args:
        scenario: scenario of the loop.
        live: the loop. Use `live` of this screen instead, which makes its plans visible here.
        state: returns the state of the loop.

    Attributes:
        live: the loop to run.
        page: the HTML page, with sensors and zones but no scan.
    """

    def __init__(self, scenario: Scenario, live: LiveLoop, state: Callable[[], LiveState]) -> None:
        self._scenario, self._state = scenario, state
        self._planner = None if live.planner is None else LastPlanCache(live.planner)
        self.live = live if self._planner is None else replace(live, planner=self._planner)
        self._fault = ""
        self._labels, self._new_targets = deque[set[str]](maxlen=_HEALTH_OF), new_targets(scenario, _HEALTH_OF)
        self._decided: tuple[Plan | None, dict[str, Any] | None] = (None, None)
        model = scenario.model
        self._names, self._sections = model.sensor_names, model.sensors
        self._height = place_of(HEIGHT, model.motion.components)
        strategy = "" if live.planner is None else live.planner.name
        scene = build_scene(scenario, strategy)
        run: dict[str, Any] = {
            "live": True,
            "strategy": strategy or "no decisions",
            "group": model.name,
            "run": 0,
            "labelled": model.filter.kind not in UNLABELLED,
            "zones": [[zone.kind, [rounded_list(corner, 3) for corner in zone.corners]] for zone in scene.zones],
            "sensors": [sensor_data(*each) for each in zip(self._names, self._sections, strict=True)],
            "recorded": True,
            "known": False,
            "origin": None if model.origin is None else [model.origin.lon, model.origin.lat],
            **({"compass": True} if model.by_compass else {}),
            **({"heights": {"estimates": [], "truth": []}} if HEIGHT in model.motion.components else {}),
            "utc": None,
            "names": [],
            "ospa_unit": "",
            "reward": scene.reward,
            "typical": False,
            **{name: [] for name in ("times", "truth", "estimates", "poses", "scans", "ospa", "axes", "decisions")},
        }
        run["scene"] = self._scene = hashlib.sha256(json.dumps(run).encode()).hexdigest()[:16]
        self.page = render("live.html", [run], scripts=("scripts", "live"), name=model.name, untrusted=()).encode()

    def note(self, answers: Iterable[Answer]) -> None:
        """Store the error of the last line that was refused, and the labels of the latest scans."""
        for answer in answers:
            self._fault = answer.get("error", self._fault)
            if "tracks" in answer:
                self._labels.append({track["label"] for track in answer["tracks"]})

    def frame(self) -> bytes:
        """Return the present state as JSON."""
        state = self._state()
        timeline = state.timeline
        belief, poses, newest = timeline.state, timeline.poses, timeline.newest or 0.0
        time = None if state.start is None or belief.time is None else belief.time + state.start
        estimates = None if time is None else self.live.estimate(belief.fused, belief.step)
        extent = self._extent(poses[:, :2], np.empty((0, 2)) if estimates is None else estimates.means[:, :2])
        decimals = decimals_for(extent)
        frame = {
            "scene": self._scene,
            "time": time,
            "utc": 0.0 if state.is_utc else None,
            "extent": rounded_list(extent, decimals),
            "estimates": []
            if estimates is None
            else [[*estimate_data(estimates, i, decimals), 0, 0.0] for i in range(len(estimates.labels))],
            "heights": [] if estimates is None or self._height < 0 else height_data(estimates, self._height),
            "poses": [pose_data(*each, decimals) for each in zip(poses, self._sections, strict=True)],
            "scans": self._scans(timeline, decimals),
            "decision": self._decision_data(poses),
            "health": self._health(timeline),
            "fit": state.fit.fit.lines(),
            # Time since the latest scan of each sensor, s, by the clock of the scans; None before its first.
            "silence": [None if math.isinf(last) else round(newest - last, 3) for last in state.latest],
            "fault": self._fault,
            "counts": {
                "lines": state.num_lines,
                "not taken": state.num_errors,
                "scans": timeline.num_processed,
                "late": timeline.num_late,
                "too late": timeline.num_dropped,
                "repeated": timeline.num_repeated,
            },
        }
        return json.dumps(frame, allow_nan=False, separators=(",", ":")).encode()

    def _extent(self, *positions: Floats) -> tuple[float, float, float, float]:
        """Return x_min, x_max, y_min, y_max, m, of the region and points beyond, in steps that keep the view stable."""
        region = self._scenario.model.region
        low, high = np.array([region.x_min, region.y_min]), np.array([region.x_max, region.y_max])
        points = np.concatenate([low[np.newaxis], high[np.newaxis], *positions])
        points = points[np.isfinite(points).all(axis=1)]
        step = float((high - low).max()) / _STEPS_OF_EXTENT
        below, above = (np.maximum(0.0, low - points).max(axis=0), np.maximum(0.0, points - high).max(axis=0))
        (x_min, y_min), (x_max, y_max) = low - step * np.ceil(below / step), high + step * np.ceil(above / step)
        return float(x_min), float(x_max), float(y_min), float(y_max)

    def _scans(self, timeline: Timeline, decimals: int) -> list[list[list[float]]]:
        """Return the measurements at the latest scan time."""
        if not timeline.entries:
            return [[] for _ in self._sections]
        latest = timeline.entries[-1]
        scans = [latest.scans.get(s) for s in range(len(self._sections))]
        drawn = (
            None if scan is None else Scan(scan.measurements, np.full(len(scan.measurements), UNKNOWN))
            for scan in scans
        )
        return [
            measurement_data(scan, section.measurement.kind, pose, decimals)
            for scan, section, pose in zip(drawn, self._sections, latest.poses, strict=True)
        ]

    def _decision_data(self, poses: Floats) -> dict[str, Any] | None:
        if self._planner is None:
            return None
        plan = self._planner.last
        if plan is not None and plan is not self._decided[0]:
            axes = dict[str, dict[str, Any]]()
            data = decision_data(Decision(1, 0.0, poses, plan.without_evidence(explained=True)), axes, self._names)
            self._decided = (plan, {**data, "axes": list(axes.values()), "number": self._planner.num_plans})
        return self._decided[1]

    def _health(self, timeline: Timeline) -> str:
        """Return the diagnostics of the latest scans in one line."""
        latest = timeline.entries[-_HEALTH_OF:]
        if not latest:
            return ""
        health = Health.unreported(len(latest), len(self._sections))
        for index, instant in enumerate(latest):
            health.note_filters(index, instant.info.filters)
            health.note_fusion(index, instant.info.fusion)
        results = run_diagnostics(health, self._names)
        if len(self._labels) == _HEALTH_OF:
            health.dropped_existence[:] *= _HEALTH_OF / len(latest)
            of_targets = new_target_diagnostics(self._new_targets, health, len(set().union(*self._labels)))
            results += tuple(each for each in of_targets if each.level == "check")
        return diagnostics_line(results)
