"""Crowds as scenario files."""

from __future__ import annotations

from vedette.scenarios.generated_crowd import GeneratedCrowd
from vedette.scenarios.generated_text import WORLD

_STD = 5.0  # m, of a measurement
_DEATHS = 0.01  # a target and scan
# More than deaths, for the births that make up for them and for who enters at the edges.
_BIRTHS = 0.02
# Births from measurements stay for some scans each, nearly all of them of clutter; most at the first scans.
_LABELS_A_MEASUREMENT, _MORE_LABELS = 4, 200


def crowd_text(crowd: GeneratedCrowd) -> str:
    """The scenario file of a crowd, with comments. It lists no target, so that it is as short for 10,000 as for ten."""
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
    seen = "the position" if crowd.measured == "position" else "bearing and range"
    return (
        f"A crowd of {crowd.num_targets:,} targets, {crowd.density:g} a km^2; one still sensor measures {seen} of each."
    )


def _command(crowd: GeneratedCrowd) -> str:
    usual, options = GeneratedCrowd(), [f"--targets {crowd.num_targets}", f"--density {crowd.density:g}"]
    options += [] if crowd.clutter == usual.clutter else [f"--clutter {crowd.clutter:g}"]
    options += [] if crowd.measured == usual.measured else [f"--measured {crowd.measured}"]
    options += [] if crowd.num_steps == usual.num_steps else [f"--steps {crowd.num_steps}"]
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
  {{kind: crowd, number: {number}, std: [3.0, 3.0], death_probability: {deaths}}}    # m/s

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
