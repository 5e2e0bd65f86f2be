"""A small valid scenario that tests change, and the sections of one field."""

from __future__ import annotations

from typing import Any


def kinds(union: Any) -> dict[str, Any]:
    """The sections of a type made by `one_of`, by kind."""
    return {section.model_fields["kind"].default: section for section in union.__origin__.__args__}


MINIMAL = """\
name: small
time: {num_steps: 20, step_period: 0.5, start: 2.0}
region: {x_min: -100.0, x_max: 100.0, y_min: -50.0, y_max: 50.0}
motion: {kind: constant_velocity, sigma_v: 1.0}
survival: {kind: constant, probability: 0.95}
birth:
  steps: [1, 5]
  sites:
    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}
targets:
  kind: scripted
  tracks:
    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}
sensor_defaults:
  noise: {kind: constant, std: [0.02, 3.0]}
sensors:
  - {name: north, position: [0.0, 40.0], heading_deg: 4.0}
  - {name: south, position: [0.0, -40.0]}
filter: {kind: m_delta_glmb}
fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}
estimator: {kind: marginal, threshold: 0.6}
control: {decision_steps: [4, 8]}
ospa: {cutoff: 50.0, first_scan: 5, last_scan: 20}
"""


def changed(*changes: tuple[str, str]) -> str:
    """`MINIMAL` with each text replaced by another; each must occur once."""
    text = MINIMAL
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text
