"""The scenes and strategies of `benchmarks/deciding.py`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from vedette.scenarios import GeneratedScene, Scenario, load_scenario, parse_scenario, replace_fields, scene_text
from vedette.scenarios.generated import PATTERNS, VIEWS
from vedette.scenarios.sections.fusion import Fusion
from vedette.scenarios.sections.tracking import Filter

Fields = dict[str, Any]

# The filter where nothing is said.
NOTHING_SAID = Filter().model_dump(mode="json")

OWN, LMB, USUAL, SILENT = "own filter", "LMB", "default filter", "nothing said"
FILTERS: dict[str, Fields] = {
    OWN: {},
    LMB: {"filter": {"kind": "lmb"}, "fusion": {"kind": "clmb"}},
    USUAL: {"filter": NOTHING_SAID, "fusion": {"kind": "cm_delta_glmb"}},
    SILENT: {
        "filter": NOTHING_SAID,
        "fusion": Fusion().model_dump(mode="json"),
        **dict.fromkeys(("control.horizon_steps", "control.horizon_period")),
    },
}
# Numbers of sensors of the random layouts; of each the next of these motions, views, times between decisions.
SIZES = (2, 2, 2, 2, 2, 2, 3, 3, 3, 4, 4, 5, 5, 6, 8, 8, 10, 12, 16, 20)
MOTIONS, EVERY = ("still", "moving", "turning"), (10, 5, 1)
TURN_RATE, TURN_NOISE = 5.0, 0.5  # degree/s, and how far the filters allow it to change
REWARDS: dict[str, Fields] = {
    "loss": {"kind": "expected_loss"},
    "gospa": {"kind": "expected_gospa"},
    "cs": {"kind": "cauchy_schwarz"},
    "cs-k": {"kind": "cauchy_schwarz", "unit_volume": "reference"},
}
RULES = ("nearest", "assigned_target", "centroid")
DEPTHS = (2, 3)


@dataclass(frozen=True)
class Scene:
    """What is run.

    Attributes:
        name: by which it is asked for.
        group: of the scenes that are put together in the overview.
        scenario: that is run.
        share: of the runs asked for that are enough here, for scenes that take long.
    """

    name: str
    group: str
    scenario: Callable[[], Scenario]
    share: float = 1.0


def strategies(scenario: Scenario) -> dict[str, Fields]:
    """The planners of the table by name, as a scenario's section `planners` has them."""
    cutoff, named = scenario.model.ospa.cutoff, scenario.model.control.reward
    loss = {**REWARDS["loss"], "cutoff": cutoff}
    if named.kind == "expected_loss":  # which what a target not found is worth goes with
        loss = named.model_dump(mode="json")
    found: dict[str, Fields] = {}
    for reward, fields in {**REWARDS, "loss": loss}.items():
        scaled = {**fields, "cutoff": cutoff} if fields["kind"] == "expected_gospa" else fields
        found[f"jdm {reward}"] = {"kind": "joint", "reward": scaled}
        found[f"idm {reward}"] = {"kind": "independent", "reward": scaled, "others": "absent"}
    found["idm stay"] = {"kind": "independent", "reward": loss, "others": "stay"}
    found["greedy loss"] = {"kind": "joint", "reward": loss, "search": {"kind": "sequential_greedy"}}
    given = scenario.model.control.lookahead
    own = {} if given is None else given.model_dump(mode="json", exclude={"depth"})
    for depth in DEPTHS:
        found[f"lookahead {depth}"] = {"kind": "lookahead", **own, "depth": depth, "reward": loss}
    for rule in RULES:
        found[f"rule {rule}"] = {"kind": rule}
    if len(scenario.model.sensors) == 2:
        for pair in product((1, 2, 3, 4), repeat=2):
            if pair[0] != pair[1]:
                found[f"pair {pair[0]} {pair[1]}"] = {"kind": "assigned_target", "targets": list(pair)}
    for depth in (1, 2):
        found[f"oracle {depth}"] = {"kind": "oracle", "depth": depth}
    found["true targets"] = {"kind": "true_targets", "reward": loss}
    return found


def layout(number: int) -> Scenario:
    """A random layout, of its number alone: who sees how far, how targets move, how often the sensors decide."""
    size, motion = SIZES[number], MOTIONS[number % len(MOTIONS)]
    scene = GeneratedScene(
        num_sensors=size,
        pattern=PATTERNS[number % 2],
        view=VIEWS[number // 2 % 2],
        decide_every=EVERY[number // 3 % len(EVERY)],
        seed=1000 + number,
    )
    given = Scenario(parse_scenario(scene_text(scene)))
    fields: Fields = {
        "name": f"layout-{number}-{size}-{scene.view}-{motion}-{scene.decide_every}",
        "time.num_steps": 40,
    }
    fields["control.decision_steps"] = [step for step in given.model.decision_steps if step < 40]
    if number % 2:
        fields["filter"] = NOTHING_SAID
    if scene.view == "full" and number % 4 == 1:
        fields["fusion"] = {"kind": "cm_delta_glmb"}
    states = np.array([track.state for track in given.model.targets.tracks])
    if motion == "still":
        states[:, 2:] = 0.0
    if motion == "turning":
        signs = np.where(np.arange(len(states)) % 2, 1.0, -1.0)
        states = np.column_stack([states, np.radians(TURN_RATE) * signs])
        fields["motion"] = {"kind": "coordinated_turn", "sigma_v": 0.3, "sigma_turn_rate_deg": TURN_NOISE}
    stds = [20.0, 20.0, 1.0, 1.0] + ([np.radians(2.0)] if motion == "turning" else [])
    fields["birth.sites"] = [{"existence": 0.8, "mean": list(row), "std": stds} for row in states.tolist()]
    disturbed = motion != "still"
    fields["targets.tracks"] = [
        {"state": list(row), "std": stds, "process_noise": disturbed} for row in states.tolist()
    ]
    if given.model.birth.from_measurements is not None and motion == "turning":
        fields["birth.from_measurements.std"] = [20.0, 20.0, 6.0, 6.0, np.radians(TURN_RATE)]
    return replace_fields(given, fields)


def scenes() -> Iterator[Scene]:
    """All of them, in the order of the table."""
    for name, (filters, fields) in product(("paper-a", "paper-e"), FILTERS.items()):
        title = f"{name}, {filters}"
        yield Scene(title, name, cache(lambda name=name, fields=fields: replace_fields(load_scenario(name), fields)))
    for number, size in enumerate(SIZES):
        title = f"layout {number}"
        yield Scene(title, "layouts", cache(lambda number=number: layout(number)), 1.0 if size <= 5 else 0.3)
    for name, share in (
        ("eight-mobile", 0.3),
        ("six-cameras", 1.0),
        ("beyond-the-gap", 0.3),
        ("two-searchers", 0.1),
        ("solent", 0.3),
    ):
        yield Scene(name, name, cache(lambda name=name: load_scenario(name)), share)
    for view, size, pattern in product(VIEWS, (2, 3, 5, 8, 20), PATTERNS):
        scene = GeneratedScene(num_sensors=size, pattern=pattern, view=view)
        made = cache(lambda scene=scene: Scenario(parse_scenario(scene_text(scene))))
        yield Scene(scene.name, f"generated, {view}", made, 1.0 if size <= 5 else 0.3)
