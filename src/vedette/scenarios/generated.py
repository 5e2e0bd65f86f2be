"""Generated scenes: any number of sensors and targets, made from a seed by the same rules."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vedette.errors import InputError
from vedette.scenarios.sections.tracking import FilterLimits

PATTERNS = ("spread", "crowd")
VIEWS = ("full", "limited")
_MAX_SENSORS, _MAX_TARGETS = 1000, 2000

NUM_STEPS = 60
_SIDE = 500.0  # m, side of the square that each sensor adds
_GROUP_SIZE = 4  # targets that start or end at one place
_SPEEDS = (3.0, 8.0)  # m/s
# Additive recurrence of least discrepancy in two dimensions (M. Roberts, 2018), the plastic number's first two powers.
_PLASTIC = 1.3247179572447460
_STRIDE = (1.0 / _PLASTIC, 1.0 / _PLASTIC**2)


def check_whole(name: str, value: object, least: int, most: int) -> None:
    """Raise `InputError` unless a value is a whole number within bounds."""
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise InputError(f"{name}: expected a whole number from {least} to {most}; got {value!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratedScene:
    """Settings of a generated scene; equal settings give the same file.

    Every sensor adds a square of 500 m, so that density, speeds and ranges are the same for two sensors and for a
    hundred. Targets move at 3 to 8 m/s for 60 scans of 1 s in groups of up to four: `spread` groups start at one place
    and part, `crowd` groups start apart and meet. Their first states are drawn anew in each run, and their motion is
    disturbed; the filters know both distributions. Sensors start spread over the square and take steps of 20 m/s in
    eight directions, or stay.

    Attributes:
        num_sensors: 1 to 1000.
        pattern: "spread" or "crowd".
        view: "full": every sensor sees everything, less accurately with distance; "limited": 250 m, with a soft edge.
        num_targets: 1 to 2000; None: two per sensor.
        decide_every: scans between decisions, 1 to 59; the horizon ends at the next decision, or at the last scan.
        seed: of places and courses, at least 0.
    """

    num_sensors: int
    pattern: str = "spread"
    view: str = "limited"
    num_targets: int | None = None
    decide_every: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        for name, known in (("pattern", PATTERNS), ("view", VIEWS)):
            if getattr(self, name) not in known:
                raise InputError(f"{name}: expected one of {', '.join(known)}; got {getattr(self, name)!r}")
        bounds = {
            "num_sensors": (1, _MAX_SENSORS),
            "num_targets": (1, _MAX_TARGETS),
            "decide_every": (1, NUM_STEPS - 1),
            "seed": (0, 2**63),
        }
        for name, (least, most) in bounds.items():
            if name != "num_targets" or self.num_targets is not None:
                check_whole(name, getattr(self, name), least, most)

    @property
    def total_targets(self) -> int:
        """Number of targets."""
        return 2 * self.num_sensors if self.num_targets is None else self.num_targets

    @property
    def max_labels(self) -> int | None:
        """Number of labels that a filter needs for targets and two scans of clutter; None if the default is enough."""
        needed = self.total_targets + 2 * self.num_sensors
        return needed if needed > FilterLimits().max_labels else None

    @property
    def side(self) -> float:
        """Side of the square of sensors and groups, m."""
        return _SIDE * math.sqrt(self.num_sensors)

    @property
    def name(self) -> str:
        """Name such as `crowd-limited-8`; settings that are not the default are appended."""
        parts = [self.pattern, self.view, str(self.num_sensors)]
        parts += [] if self.num_targets is None else [f"targets-{self.num_targets}"]
        parts += [] if self.decide_every == 1 else [f"every-{self.decide_every}"]
        parts += [] if self.seed == 0 else [f"seed-{self.seed}"]
        return "-".join(parts)

    def places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the sensors' starts, (num_sensors, 2) m, and mean first states [px, py, vx, vy], (num_targets, 4)."""
        rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(self.num_sensors, self.total_targets)))
        sensors = self._spread_out(self.num_sensors, rng)
        num = self.total_targets
        groups = np.arange(num) // _GROUP_SIZE
        centres = self._spread_out(int(groups[-1]) + 1, rng)
        first = rng.uniform(0.0, 2.0 * np.pi, len(centres))[groups]
        courses = first + 2.0 * np.pi * (np.arange(num) % _GROUP_SIZE + rng.uniform(-0.25, 0.25, num)) / _GROUP_SIZE
        velocities = rng.uniform(*_SPEEDS, num)[:, None] * np.stack([np.cos(courses), np.sin(courses)], axis=1)
        if self.pattern == "spread":
            return sensors, np.hstack([centres[groups], velocities])
        return sensors, np.hstack([centres[groups] + (NUM_STEPS - 1) * velocities, -velocities])

    def _spread_out(self, num: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return places spread evenly over the square, shape (num, 2)."""
        shares = (rng.uniform(size=2) + np.arange(num)[:, None] * np.array(_STRIDE)) % 1.0
        return np.asarray((shares - 0.5) * self.side)


_SENSOR_SPEED = 20.0  # m/s
_MARGIN = 500.0  # m, from the square to the edge of the region: about as far as a target moves
_NUMBERS_PER_LINE = 25


def scene_text(scene: GeneratedScene) -> str:
    """Return the scenario file of a scene, with comments."""
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
        decisions=_wrap_list(range(scene.decide_every, NUM_STEPS, scene.decide_every)),
        limits="" if scene.max_labels is None else f", limits: {{max_labels: {scene.max_labels}}}",
    )


def _command(scene: GeneratedScene) -> str:
    options = [f"--sensors {scene.num_sensors}", f"--pattern {scene.pattern}", f"--field-of-view {scene.view}"]
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


def _wrap_list(numbers: range) -> str:
    """Return a list as text, over as many lines as it needs."""
    lines = [", ".join(map(str, numbers[i : i + _NUMBERS_PER_LINE])) for i in range(0, len(numbers), _NUMBERS_PER_LINE)]
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

# The sections that all generated scenes share.
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
  platform: {{kind: grid_moves, length: {length}, speed: {speed}}}     # m, m/s; or stay
  stationary_until_first_decision: true
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
  tracked_of_all: {{kind: tracked_fraction, min_detection_probability: 0.0}}   # of all targets, seen or not
"""
)
