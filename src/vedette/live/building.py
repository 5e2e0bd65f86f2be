"""The live loop of a scenario."""

from __future__ import annotations

from typing import Any

from vedette.control import ConstraintReportingPlanner, RequiresTruth
from vedette.errors import InputError
from vedette.internal.quantities import COMPONENTS
from vedette.live.loop import Live
from vedette.models.arguments import reject
from vedette.recorded.extents import box_of
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.of_recording import OfSensors
from vedette.scenarios.sections.planners import Named
from vedette.scenarios.sections.recording import sites_of
from vedette.tracking import LateScans


def live_of(
    known: OfSensors,
    planner: str = "jdm",
    *,
    window: float = 30.0,
    ahead: float = 60.0,
    decide_every: float | None = None,
    seed: int = 0,
    num_threads: int = 0,
) -> Live:
    """The loop of a scenario of scans that are to come.

    Args:
        known: see `vedette.scenarios.of_recording.scenario_of_sensors`.
        planner: of decisions, where there are any: at the scenario's times, or every so many seconds.
        window: s that a scan may be late.
        ahead: s that it may be ahead of all others.
        decide_every: s from one decision to the next; None: as the scenario says.
        seed: of filters that draw, and of decisions.
        num_threads: share a decision; 0: one a processor.

    Raises:
        InputError: parts that do not fit together, measurements of a kind that lines cannot tell, or a planner that
            knows the targets.
    """
    model = known.scenario.model
    sites = tuple(sites_of(model))
    for site in sites:
        if site.kind not in COMPONENTS:
            raise reject(f"sensor {site.name}", f"measurements of kind {', '.join(COMPONENTS)}", site.kind)
    experiment = build_experiment(known.scenario)
    decides = None
    if decide_every is not None or experiment.decision_steps:
        decides = build_planner(known.scenario, planner, num_threads)
        inside: Any = decides
        while isinstance(
            inside, Named | ConstraintReportingPlanner
        ):  # which pass the truth on, and need none themselves
            inside = inside.planner
        if isinstance(inside, RequiresTruth):
            raise InputError(f"planner: expected one that does not know the targets; got {planner}")
    return Live(
        LateScans(experiment.tracker, experiment.poses, window, seed),
        sites,
        experiment.estimate,
        known.conventions,
        None if model.origin is None else model.origin.build(),
        first=float(experiment.times[0]),
        planner=decides,
        decision_times=tuple(float(experiment.times[step - 1]) for step in experiment.decision_steps),
        decide_every=decide_every,
        ahead=ahead,
        seed=seed,
        within=box_of(model.region.build().corners),
    )
