"""Generated scenes as scenario files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vedette.scenarios.generated import NUM_STEPS, GeneratedScene

_SENSOR_SPEED = 20.0  # m/s
_MARGIN = 500.0  # m, of the region around the square: about as far as a target goes
_NUMBERS_A_LINE = 25


def scene_text(scene: GeneratedScene) -> str:
    """The scenario file of a scene, with comments."""
    sensors, states = scene.places()
    states_of_targets = [_row(state) for state in states]
    reach = round(0.5 * scene.side + _MARGIN)
    return _TEMPLATE.format(
        name=scene.name,
        command=_command(scene),
        summary=_summary(scene),
        num_steps=NUM_STEPS,
        low=f"{-reach:.1f}",
        high=f"{reach:.1f}",
        measured=_MEASURED_BIRTH if scene.view == "limited" else "",
        sites="\n".join(f"    - {{existence: 0.8, mean: {row}, {_SPREAD}}}" for row in states_of_targets),
        tracks="\n".join(f"    - {{state: {row}, {_SPREAD}, process_noise: true}}" for row in states_of_targets),
        length=f"{_SENSOR_SPEED * scene.decide_every:.1f}",
        speed=f"{_SENSOR_SPEED:.1f}",
        sensing=_SENSING[scene.view],
        sensors="\n".join(f"  - {{position: {_row(place)}}}" for place in sensors),
        decisions=_folded(range(scene.decide_every, NUM_STEPS, scene.decide_every)),
        limits="" if scene.max_labels is None else f", limits: {{max_labels: {scene.max_labels}}}",
    )


def _command(scene: GeneratedScene) -> str:
    options = [f"--sensors {scene.num_sensors}", f"--pattern {scene.pattern}", f"--view {scene.view}"]
    options += [] if scene.num_targets is None else [f"--targets {scene.num_targets}"]
    options += [] if scene.decide_every == 1 else [f"--decide-every {scene.decide_every}"]
    options += [] if scene.seed == 0 else [f"--seed {scene.seed}"]
    return f"vedette generate {' '.join(options)}"


def _summary(scene: GeneratedScene) -> str:
    going = "start together in groups and part" if scene.pattern == "spread" else "start apart and meet in groups"
    seeing = "see 250 m" if scene.view == "limited" else "see everything, the worse the farther it is"
    return f"Targets that {going} ({scene.total_targets}), and mobile sensors that {seeing} ({scene.num_sensors})."


def _row(values: NDArray[np.float64]) -> str:
    return f"[{', '.join(f'{value:.2f}' for value in values)}]"


def _folded(numbers: range) -> str:
    """A list over as many lines as it takes."""
    lines = [", ".join(map(str, numbers[i : i + _NUMBERS_A_LINE])) for i in range(0, len(numbers), _NUMBERS_A_LINE)]
    return f"[{lines[0]}]" if len(lines) == 1 else "[\n    " + ",\n    ".join(lines) + "\n  ]"


_SPREAD = "std: [20.0, 20.0, 1.0, 1.0]"

_MEASURED_BIRTH = "\n  from_measurements: {expected: 0.5, max_existence: 0.03, std: [20.0, 20.0, 6.0, 6.0]}"

_SENSING = {
    "full": """\
  detection:                # probability exp(-d^2 / (2 sigma^2))
    {kind: gaussian, sigma: 10000.0}                # m
  clutter: {kind: region, rate: 5.0}""",
    "limited": """\
  detection:
    {kind: soft_sector, probability: 0.95, max_range: 250.0, half_width_deg: 180.0, range_slope: 0.1}   # m, 1/m
  clutter: {kind: around_sensor, rate: 1.0, radius: 300.0}""",
}

# What all generated scenes have in common.
WORLD = """\
# Units: metres, seconds, m/s; angles in degrees where a key ends in _deg, else radians; x to the east, y to the north,
# headings counter-clockwise from east. `vedette schema` describes every key; a key left out has its default.

format: 1
name: {name}
description: >-
  {summary}

time: {{num_steps: {num_steps}, step_period: 1.0, start: 1.0}}   # scans, s, s

region:               # m
  {{x_min: {low}, x_max: {high}, y_min: {low}, y_max: {high}}}

motion: {{kind: constant_velocity, sigma_v: 0.3}}    # m/s^2, of filters and targets
"""

_TEMPLATE = (
    """\
# {summary}
#
#   {command}
#
# A square of 500 m a sensor. Where targets start is drawn anew in each run around the states below, and their motion is
# disturbed; the filters know how much of both.
#
"""
    + WORLD
    + """
survival: {{kind: constant, probability: 0.99}}

birth:                # [px, py, vx, vy], at the first scan
  steps: [1]{measured}
  sites:
{sites}

targets:
  kind: scripted
  tracks:             # state [px, py, vx, vy] at the first scan
{tracks}

sensor_defaults:
  heading_deg: 0.0
  platform: {{kind: steps, length: {length}, speed: {speed}}}     # m, m/s; or stay
  moves_from: first_decision
  measurement: {{kind: bearing_range}}
  noise:                    # standard deviations that grow with the distance d
    kind: range_dependent
    sigma_range: 10.0       # m;      range: sigma_range + eta_range d^2
    eta_range: 5.0e-5       # 1/m
    sigma_bearing_deg: 1.0  # degree; bearing: sigma_bearing + eta_bearing d
    eta_bearing: 5.0e-6     # rad/m
{sensing}

sensors:
{sensors}

filter: {{kind: lmb{limits}}}

fusion: {{kind: sequential}}

estimator: {{kind: marginal, threshold: 0.5}}

control:
  decision_steps: {decisions}

ospa: {{cutoff: 100.0, order: 1.0}}

metrics:
  tracked_of_all: {{kind: tracked_share, min_detection: 0.0}}   # of all targets, seen or not
"""
)
