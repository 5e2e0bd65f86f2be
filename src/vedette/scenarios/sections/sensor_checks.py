"""Whether the parts of a sensor fit together."""

from __future__ import annotations

import math
from collections.abc import Iterator

from vedette.scenarios.faults import Finding, Path, describe
from vedette.scenarios.sections.clutter import Clutter
from vedette.scenarios.sections.sensing import Measurement, Noise


def noise_findings(measurement: Measurement, noise: Noise, path: Path) -> Iterator[Finding]:
    """Whether the noise at `path` is for what is measured."""
    kind, dim = measurement.kind, measurement.dim
    if noise.kind == "range_dependent" and kind in ("position", "custom"):
        others = "constant, by_axis or custom" if kind == "position" else "constant or custom"
        yield path, f"{others} noise for a {kind} measurement", "range_dependent noise"
    elif noise.kind == "by_axis" and kind not in ("position", "custom"):
        yield path, f"range_dependent, constant or custom noise for a {kind} measurement", "by_axis noise"
    elif noise.kind == "constant" and dim is not None and len(noise.std) != dim:
        yield (*path, "std"), _components(measurement, dim), describe(noise.std)
    elif noise.kind == "constant":
        for component in measurement.angular:
            if (std := noise.std[component]) > math.pi:
                meant = "exchanged" if min(noise.std) < math.pi else "in degrees"
                wanted = f"a bearing's standard deviation in radians, up to pi ({meant}?)"
                yield (*path, "std", component), wanted, describe(std)
    elif noise.kind == "range_dependent" and measurement.angular and noise.sigma_bearing_deg > 180.0:
        wanted = "a bearing's standard deviation in degrees, up to 180"
        yield (*path, "sigma_bearing_deg"), wanted, describe(noise.sigma_bearing_deg)


def clutter_findings(measurement: Measurement, clutter: Clutter, path: Path) -> Iterator[Finding]:
    """Whether the clutter at `path` is for what is measured."""
    kind = measurement.kind
    if clutter.kind == "region" and kind == "custom":
        yield path, "measurement_space or custom clutter for a custom measurement", "region clutter"
    if clutter.kind == "around_sensor" and kind not in ("position", "bearing_range"):
        wanted = f"region, measurement_space or custom clutter for a {kind} measurement"
        yield path, wanted if kind != "custom" else wanted.replace("region, ", ""), "around_sensor clutter"


def clutter_box_findings(measurement: Measurement, clutter: Clutter, path: Path) -> Iterator[Finding]:
    """Whether the bounds of clutter in measurement space are a box of the measurement's components."""
    if clutter.kind != "measurement_space":
        return
    low, high, dim = clutter.low, clutter.high, measurement.dim
    for name, values in (("low", low), ("high", high)):
        if dim is not None and len(values) != dim:
            yield (*path, name), _components(measurement, dim), describe(values)
    if dim is None and len(low) != len(high):
        yield (*path, "high"), f"as many numbers as low, {len(low)}", describe(high)
    for j, (least, most) in enumerate(zip(low, high, strict=False)):
        if most <= least:
            yield (*path, "high", j), f"a number above low, {least:g}", describe(most)
        elif j in measurement.angular and most - least > 2.0 * math.pi * (1.0 + 1e-9):
            yield (*path, "high", j), f"an angle of at most 2 pi above low, {least:g}", describe(most)


def same_measurement_findings(true: Measurement, known: Measurement, path: Path) -> Iterator[Finding]:
    """Whether the true measurement is one that the filter's model can take for its own."""
    both_known = true.dim is not None and known.dim is not None
    if both_known and (true.dim, true.angular) != (known.dim, known.angular):
        yield (*path, "kind"), f"{known.kind} or custom, as the filter takes it for that", describe(true.kind)


def _components(measurement: Measurement, dim: int) -> str:
    numbers = "1 number" if dim == 1 else f"{dim} numbers"
    return f"{numbers}, as a {measurement.kind} measurement has"
