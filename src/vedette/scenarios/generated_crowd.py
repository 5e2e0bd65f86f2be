"""Generated crowds: any number of targets, of a given density, before one sensor."""

import math
from dataclasses import dataclass

from vedette.errors import InputError
from vedette.scenarios.generated import WORLD, check_whole

MEASURED = ("position", "bearing_range")
MAX_TARGETS = 100_000
DENSITIES = (1e-3, 1e6)  # targets per km^2
_SQUARE_KM = 1e6  # m^2


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratedCrowd:
    """Settings of a crowd; equal settings give the same file, and equal seeds of runs the same targets and scans.

    Targets are spread evenly over a square whose area grows with their number, so that crowds of ten and of ten
    thousand are equally hard and differ only in size. They move at about 4 m/s; from one scan to the next (1 s) one in
    a hundred dies, and as many are born. One still sensor detects each with probability 0.95, with noise of 5 m,
    among false measurements.

    Attributes:
        num_targets: 1 to 100,000, at the first scan and on average.
        density: targets per km^2, 0.001 to 1,000,000; at 25 the next target is 100 m away on average.
        clutter: false measurements per target and scan, 0 to 100.
        measured: "position", or "bearing_range" from outside the square.
        num_steps: scans, 1 to 10,000.
    """

    num_targets: int = 100
    density: float = 25.0
    clutter: float = 0.3
    measured: str = "position"
    num_steps: int = 40

    def __post_init__(self) -> None:
        if self.measured not in MEASURED:
            raise InputError(f"measured: expected one of {', '.join(MEASURED)}; got {self.measured!r}")
        check_whole("num_targets", self.num_targets, 1, MAX_TARGETS)
        check_whole("num_steps", self.num_steps, 1, 10_000)
        for name, (least, most) in (("density", DENSITIES), ("clutter", (0.0, 100.0))):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                raise InputError(f"{name}: expected a number from {least:g} to {most:g}; got {value!r}")

    @property
    def side(self) -> float:
        """Side of the square, m."""
        return math.sqrt(self.num_targets / self.density * _SQUARE_KM)

    @property
    def name(self) -> str:
        """Name such as `crowd-1000`; settings that are not the default are appended."""
        default, parts = GeneratedCrowd(), ["crowd", str(self.num_targets)]
        parts += [] if self.density == default.density else [f"density-{self.density:g}"]
        parts += [] if self.clutter == default.clutter else [f"clutter-{self.clutter:g}"]
        parts += [] if self.measured == default.measured else ["bearing-range"]
        parts += [] if self.num_steps == default.num_steps else [f"steps-{self.num_steps}"]
        return "-".join(parts)


_STD = 5.0  # m, standard deviation of a measurement
_DEATHS = 0.01  # probability per target and scan
# More than the deaths: births replace them, and other targets enter at the edges.
_BIRTHS = 0.02
# Births from measurements, nearly all from clutter, remain for some scans each; most are at the first scans.
_LABELS_A_MEASUREMENT, _MORE_LABELS = 4, 200


def crowd_text(crowd: GeneratedCrowd) -> str:
    """Return the scenario file of a crowd, with comments. It lists no targets, so it is short for any number."""
    half = 0.5 * crowd.side
    return _TEMPLATE.format(
        summary=_summary(crowd),
        command=_command(crowd),
        name=crowd.name,
        num_steps=crowd.num_steps,
        low=f"{-half:.3f}",
        high=f"{half:.3f}",
        number=crowd.num_targets,
        deaths=_DEATHS,
        survival=1.0 - _DEATHS,
        expected=f"{_BIRTHS * crowd.num_targets:g}",
        sensing=_sensing(crowd),
        rate=f"{crowd.clutter * crowd.num_targets:.10g}",
        max_labels=int(_LABELS_A_MEASUREMENT * (1.0 + crowd.clutter) * crowd.num_targets) + _MORE_LABELS,
    )


def _summary(crowd: GeneratedCrowd) -> str:
    measurement = "the position" if crowd.measured == "position" else "bearing and range"
    return (
        f"A crowd of {crowd.num_targets:,} targets, {crowd.density:g} a km^2; "
        f"one still sensor measures {measurement} of each."
    )


def _command(crowd: GeneratedCrowd) -> str:
    default, options = GeneratedCrowd(), [f"--targets {crowd.num_targets}", f"--density {crowd.density:g}"]
    options += [] if crowd.clutter == default.clutter else [f"--clutter {crowd.clutter:g}"]
    options += [] if crowd.measured == default.measured else [f"--measurement {crowd.measured}"]
    options += [] if crowd.num_steps == default.num_steps else [f"--steps {crowd.num_steps}"]
    return f"vedette crowd {' '.join(options)}"


def _sensing(crowd: GeneratedCrowd) -> str:
    if crowd.measured == "position":
        return _POSITION.format(std=_STD)
    return _BEARING_RANGE.format(place=f"{-crowd.side:.3f}", std=_STD, bearing=f"{_STD / crowd.side:.10g}")


_POSITION = """\
  - position: [0.0, 0.0]    # m; where it stands does not matter to what it measures
    measurement: {{kind: position}}
    noise: {{kind: constant, std: [{std}, {std}]}}    # m"""

_BEARING_RANGE = """\
  - position: [0.0, {place}]                        # m; a side from the middle of the square
    heading_deg: 90.0
    measurement: {{kind: bearing_range}}
    noise: {{kind: constant, std: [{bearing}, {std}]}}    # rad, m; as far across as along in the middle"""

_TEMPLATE = (
    """\
# {summary}
#
#   {command}
#
# What a scan costs where targets are many, and alike in number to an area whatever their number: a square whose side
# grows with it. Nothing here moves but the targets, and there is nothing to decide.
#
"""
    + WORLD
    + """
survival: {{kind: constant, probability: {survival}}}

birth:                # where a measurement is that no track explains: as few or many as there are
  from_measurements: {{expected: {expected}, max_existence: 0.03, std: [5.0, 5.0, 3.0, 3.0]}}

targets:              # drawn anew in each run; one that leaves the square enters anew on the other side
  {{kind: uniform, number: {number}, std: [3.0, 3.0], death_probability: {deaths}}}    # m/s

sensors:
{sensing}
    detection: {{kind: constant, probability: 0.95}}
    clutter: {{kind: region, rate: {rate}}}    # a scan

filter:
  kind: lmb
  limits: {{max_labels: {max_labels}}}    # of targets and of what may become one

fusion: {{kind: none}}

estimator: {{kind: marginal, threshold: 0.5}}

ospa: {{cutoff: 25.0, order: 1.0}}    # m
"""
)
