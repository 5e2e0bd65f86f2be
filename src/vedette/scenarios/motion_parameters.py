"""Parameters of modes of motion that `calibrate` estimates: mean stays, and the noise of each motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vedette.calibration.parameters import TARGETS, Parameter
from vedette.scenarios.sections.world import ModesMotion

# Fields of a motion that its process noise is proportional to, with their units. Those of `constant_velocity` are
# m/s^1.5 with white noise in continuous time.
_NOISES = {
    "sigma_v": "m/s^2",
    "sigma_climb": "m/s^2",
    "sigma_a": "m/s^2",
    "sigma_turn_rate_deg": "deg/s^2",
    "sigma": "m",
    "speed": "m/s",
}
_UNKNOWN, _USUAL = 1.0, 1.0  # standard deviations of logarithms: of unknown ones, and before any recording


def motion_parameters(motion: Any, scale: float) -> Iterator[Parameter]:
    """Yield the stays and noises of a section of motion with modes, none of another motion.

    scale: factor on the prior standard deviation.
    """
    if not isinstance(motion, ModesMotion):
        return
    for name, mode in motion.modes.items():
        found = {} if mode.stay_s is None else {"stay_s": (mode.stay_s, "s")}
        for field, unit in _NOISES.items():
            if (start := getattr(mode.motion, field, 0.0)) > 0.0:
                found[f"motion.{field}"] = start, unit
        for field, (start, unit) in found.items():
            own = f"modes.{name}.{field}"
            yield Parameter(TARGETS, "motion", name, own, unit, start, 1.0, "log", _UNKNOWN, scale * _USUAL)


def with_motion_values(motion: Any, parameters: Sequence[Parameter], values: Sequence[float]) -> Any:
    """Return a section of motion with these values of those parameters that are its."""
    for each, value in zip(parameters, values, strict=True):
        if each.kind == "motion":
            field = each.name.removeprefix(f"modes.{each.component}.").split(".")
            motion = _replaced(motion, ["modes", each.component, *field], value)
    return motion


def _replaced(section: Any, path: Sequence[str], value: float) -> Any:
    """Return a section, or a mapping of them, with another value at a path of field names."""
    first, *rest = path
    if isinstance(section, Mapping):
        return {**section, first: _replaced(section[first], rest, value)}
    inner = _replaced(getattr(section, first), rest, value) if rest else value
    return section.model_copy(update={first: inner})
