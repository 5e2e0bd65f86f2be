"""Sections about sensor models: measurement, noise, detection and clutter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from vedette.internal.quantities import COMPONENTS, HEIGHT_DEPENDENT, PLACED, angles, in_file
from vedette.scenarios.diagnostics import Finding, Path, describe
from vedette.scenarios.sections.base import Positive, Section, check
from vedette.scenarios.sections.derived import Part, derived, one_of

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.models import NoiseModel


def components(measurement: Measurement) -> tuple[int | None, tuple[int, ...]]:
    """Return the number of components of a measurement (None for a custom one), and those known to be angles."""
    names = COMPONENTS.get(measurement.kind, ())
    return len(names) or None, angles(names)


class RangeDependentNoise(Section):
    """Standard deviations that grow with the distance d (paper section IV), evaluated at the predicted state.

    Range: sigma_range + eta_range d^2. Bearing: sigma_bearing + eta_bearing d. The others are constant. The squares of
    the first two have extent^2 and (extent / d)^2 added.
    """

    kind: Literal["range_dependent"] = Field(default="range_dependent", description="Kind of noise [-].")
    sigma_range: Positive = Field(default=10.0, description="Range, standard deviation at distance 0 [m].")
    eta_range: float = Field(default=5e-5, ge=0.0, description="Range, growth with the square of distance [1/m].")
    sigma_bearing_deg: Positive = Field(default=1.0, description="Bearing, the same at distance 0 [deg].")
    eta_bearing: float = Field(default=5e-6, ge=0.0, description="Bearing, growth with distance [rad/m].")
    sigma_range_rate: Positive | None = Field(
        default=None, description="Range rate, at every distance; needed where it is measured [m/s]."
    )
    sigma_elevation_deg: Positive | None = Field(
        default=None, description="Elevation, at every distance; needed where it is measured [deg]."
    )
    sigma_altitude: Positive | None = Field(
        default=None, description="Altitude, at every distance; needed where it is measured [m]."
    )

    extent: float = Field(
        default=0.0,
        ge=0.0,
        description="Standard deviation of the reflecting point of large targets, along and across [m].",
    )

    def build(self, folder: FilePath, *, kind: str, **_: Any) -> NoiseModel:
        """Return the measurement noise: the components that the kind of measurement has."""
        from vedette.models import range_dependent_noise

        parts: dict[str, dict[str, float | None]] = {
            "range": {"sigma_range": self.sigma_range, "eta_range": self.eta_range},
            "bearing": {"sigma_bearing": math.radians(self.sigma_bearing_deg), "eta_bearing": self.eta_bearing},
            "range_rate": {"sigma_range_rate": self.sigma_range_rate},
            "elevation": {"sigma_elevation": math.radians(self.sigma_elevation_deg or 0.0)},
            "altitude": {"sigma_altitude": self.sigma_altitude},
        }
        own: dict[str, Any] = {"extent": self.extent}
        for name in COMPONENTS[kind]:
            own |= parts[name]
        return range_dependent_noise(**own)


class _Clutter(Part):
    """False measurements, so many a scan."""

    rate: float = Field(
        default=25.0,
        ge=0.0,
        le=1e6,
        description="Mean number of clutter measurements a scan; around a sensor, in the figure [-].",
    )


@derived("vedette.models.sensor_clutter:around_sensor")
class ClutterAroundSensor(_Clutter):
    """Poisson clutter, uniform over a disc or a square around the sensor, or the part of it about its heading.

    For a position, bearing_range or bearing_range_rate measurement. It moves and turns with the sensor.
    """

    kind: Literal["around_sensor"] = Field(default="around_sensor", description="Kind of clutter [-].")

    @check
    def _one_figure(self) -> Iterator[Finding]:
        if (self.radius is None) == (self.half_side is None):
            yield (), "either radius or half_side", "neither" if self.radius is None else "both"


if TYPE_CHECKING:
    Measurement = Part
    Noise = Part
    Detection = Part
    Clutter = Part
else:
    Measurement = one_of("measurement", "models", "vedette.models:MeasurementModel")
    Noise = one_of("noise", "models", "vedette.models:NoiseModel", own=(RangeDependentNoise,))
    Detection = one_of("detection", "models", "vedette.models:DetectionModel")
    Clutter = one_of("clutter", "models", "vedette.models:ClutterModel", own=(ClutterAroundSensor,), parent=_Clutter)


_THIRDS = {"range_rate": "range rates", "elevation": "elevations", "altitude": "altitudes"}


def noise_findings(measurement: Measurement, noise: Noise, path: Path) -> Iterator[Finding]:
    """Yield faults if the noise at `path` does not suit the measurement."""
    kind, (dim, angular) = measurement.kind, components(measurement)
    third = next((name for name in COMPONENTS.get(kind, ())[2:] if name in _THIRDS), None)
    if noise.kind == "range_dependent" and kind in ("position", "position_altitude", "custom"):
        others = "constant, by_axis or custom" if kind == "position" else "constant or custom"
        yield path, f"{others} noise for a {kind} measurement", "range_dependent noise"
    elif noise.kind == "range_dependent" and third and getattr(noise, f"sigma_{in_file(third)}") is None:
        wanted = f"a number above 0, as {_THIRDS[third]} are measured"
        yield (*path, f"sigma_{in_file(third)}"), wanted, "none"
    elif noise.kind == "by_axis" and kind not in ("position", "custom"):
        yield path, f"range_dependent, constant or custom noise for a {kind} measurement", "by_axis noise"
    elif noise.kind == "constant" and dim is not None and len(noise.std) != dim:
        yield (*path, "std"), _components(measurement, dim), describe(noise.std)
    elif noise.kind == "constant":
        for component in angular:
            if (std := noise.std[component]) > math.pi:
                meant = "exchanged" if min(noise.std) < math.pi else "in degrees"
                wanted = f"a bearing's standard deviation in radians, up to pi ({meant}?)"
                yield (*path, "std", component), wanted, describe(std)
    elif noise.kind == "range_dependent" and angular and noise.sigma_bearing_deg > 180.0:
        wanted = "a bearing's standard deviation in degrees, up to 180"
        yield (*path, "sigma_bearing_deg"), wanted, describe(noise.sigma_bearing_deg)


def clutter_findings(measurement: Measurement, clutter: Clutter, path: Path) -> Iterator[Finding]:
    """Yield faults if the clutter at `path` does not suit the measurement."""
    kind = measurement.kind
    if clutter.kind == "region" and kind == "custom":
        yield path, "measurement_space or custom clutter for a custom measurement", "region clutter"
    if clutter.kind == "around_sensor" and (kind not in PLACED or kind in HEIGHT_DEPENDENT):
        wanted = f"region, measurement_space or custom clutter for a {kind} measurement"
        yield path, wanted if kind != "custom" else wanted.replace("region, ", ""), "around_sensor clutter"
    folded = getattr(measurement, "max_unambiguous_range_rate", None)
    most = getattr(clutter, "max_range_rate", None)
    if folded is not None and most is not None and most > folded:
        yield (*path, "max_range_rate"), f"at most {folded:g}, where range rates are folded", describe(most)
    if clutter.kind == "measurement_space":
        yield from _box_findings(measurement, clutter.low, clutter.high, path)


def _box_findings(
    measurement: Measurement, low: Sequence[float], high: Sequence[float], path: Path
) -> Iterator[Finding]:
    """Yield faults if the bounds of clutter in measurement space are not a box of the measurement's components."""
    dim, angular = components(measurement)
    for name, values in (("low", low), ("high", high)):
        if dim is not None and len(values) != dim:
            yield (*path, name), _components(measurement, dim), describe(values)
    if dim is None and len(low) != len(high):
        yield (*path, "high"), f"as many numbers as low, {len(low)}", describe(high)
    for j, (least, most) in enumerate(zip(low, high, strict=False)):
        if most <= least:
            yield (*path, "high", j), f"a number above low, {least:g}", describe(most)
        elif j in angular and most - least > 2.0 * math.pi * (1.0 + 1e-9):
            yield (*path, "high", j), f"an angle of at most 2 pi above low, {least:g}", describe(most)


def same_measurement_findings(true: Measurement, known: Measurement, path: Path) -> Iterator[Finding]:
    """Yield faults if the true measurement is not compatible with the filter's model."""
    if "custom" not in (true.kind, known.kind) and components(true) != components(known):
        yield (*path, "kind"), f"{known.kind} or custom, as the filter takes it for that", describe(true.kind)


def _components(measurement: Measurement, dim: int) -> str:
    numbers = "1 number" if dim == 1 else f"{dim} numbers"
    return f"{numbers}, as a {measurement.kind} measurement has"
