"""Answers of the live loop: lines of JSON about tracks and plans."""

import json
import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, TypeAlias

import numpy as np

from vedette.control import Plan
from vedette.densities import Estimate
from vedette.errors import VedetteError
from vedette.kernels.base.types import CLIMB, HEIGHT, VY
from vedette.platforms.compass import Compass, courses_of
from vedette.recorded import Origin

Answer: TypeAlias = dict[str, Any]
_NAMES = {"px": "x", "py": "y", "vx": "vx", "vy": "vy", HEIGHT: "z", CLIMB: "vz"}  # of the components of a state


def track_answers(
    estimate: Estimate,
    classes: Sequence[str],
    modes: Sequence[str],
    origin: Origin | None,
    compass: Compass | None,
    state: Sequence[str],
) -> list[Answer]:
    """Return an entry for each estimated target, with place in degrees and course if known. state: of the motion."""
    places = {_NAMES[name]: place for place, name in enumerate(state) if name in _NAMES}
    stds = np.sqrt(np.diagonal(estimate.covs, axis1=1, axis2=2))[:, list(places.values())]
    tracks: list[Answer] = []
    for label, mean, std, existence in zip(
        estimate.labels.tolist(), estimate.means.tolist(), stds.tolist(), estimate.existence.tolist(), strict=True
    ):
        components = {name: mean[place] for name, place in places.items()}
        tracks.append({"label": ".".join(map(str, label)), **components, "std": std, "existence": existence})
    for track, probs in zip(tracks, estimate.class_probs.tolist() if classes else (), strict=False):
        track["classes"] = dict(zip(classes, probs, strict=True))
    for track, probs in zip(tracks, estimate.mode_probs.tolist() if modes else (), strict=False):
        track["modes"] = dict(zip_longest(modes, probs, fillvalue=0.0))
    if origin is not None and tracks:
        for track, (lon, lat) in zip(tracks, origin.to_degrees(estimate.means[:, :2]).tolist(), strict=True):
            track.update(lon=lon, lat=lat)
    if compass is not None and len(state) > VY:
        for track, (course, speed) in zip(tracks, courses_of(compass, estimate.means).tolist(), strict=True):
            track.update(course_deg=course, speed_mps=speed)
    return tracks


def plan_answer(plan: Plan, names: Sequence[str]) -> Answer:
    """Return the actions of a plan, its expected rewards and why it was chosen. names: of the sensors."""
    actions = [
        {"sensor": name, **dict(zip(own.columns, row.tolist(), strict=True))}
        for name, own, row in zip(names, plan.actions, plan.chosen_actions, strict=True)
    ]
    rewards = [{"mean": mean, "standard_error": error} for mean, error in plan.expected_rewards]
    answer = {"planner": plan.planner, "actions": actions, "expected_rewards": rewards, "notes": plan.notes}
    return {**answer, "why": _explanation(plan)}


def _explanation(plan: Plan) -> str:
    try:
        return str(plan.explain())
    except VedetteError as error:
        return f"not known: {error}"


def encode_line(answer: Answer) -> bytes:
    """Return an answer as a line of JSON, with its end. Numbers that are not finite become null."""
    try:
        text = json.dumps(answer, ensure_ascii=False, allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(answer), ensure_ascii=False, allow_nan=False)
    return text.encode("utf-8", "replace") + b"\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
