"""Sections about the true models of a sensor, and the biases of its scans."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pydantic import Field

from vedette.internal.quantities import COMPONENTS, ONLY_MEASURED, PLACED, in_file
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.derived import Part, derived
from vedette.scenarios.sections.scan_times import Correlation
from vedette.scenarios.sections.sensing import (
    Clutter,
    Detection,
    Measurement,
    Noise,
    clutter_findings,
    noise_findings,
    same_measurement_findings,
)

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.models import Region, SensorModel
    from vedette.simulation import TrueSensor as TrueSensorModel


Names: TypeAlias = tuple[str, ...]  # of the components of a state


def build_parts(
    section: Any, like: Measurement, region: Region, folder: Path, state: Names, known: Any = None
) -> dict[str, Any]:
    """Return the models of measurement, noise, detection and clutter that a section gives, by these names.

    like: the measurement to which noise and clutter apply. state: components of the motion. known: the measurement
    model if the section gives none.
    """
    model = known if section.measurement is None else section.measurement.build(folder, state_components=state)
    given = {"measurement": model, "angular": model.angular, "kind": like.kind, "region": region}
    found = {name: part for name in ("noise", "detection", "clutter") if (part := getattr(section, name)) is not None}
    folded = getattr(like, "max_unambiguous_range_rate", None)
    if folded is not None and getattr(found.get("clutter"), "max_range_rate", folded) is None:
        found["clutter"] = found["clutter"].model_copy(update={"max_range_rate": folded})
    parts = {name: part.build(folder, **given) for name, part in found.items()}
    return {"measurement": model, **parts}


@derived("vedette.models.bias:Bias")
class BiasSection(Part):
    """What the scans of a sensor say too much."""

    def findings_beside(self, measurement: Measurement) -> Iterator[Finding]:
        """Yield faults of the bias for a sensor with this measurement."""
        measured = COMPONENTS.get(measurement.kind, ())
        for component in (name for name in ONLY_MEASURED if name not in measured):
            if value := getattr(self, name := in_file(component)):
                words = component.replace("_", " ")
                yield (name,), f"0, as no {words} is measured ({measurement.kind})", describe(value)


class TrueSensor(Section):
    """The sensor that is simulated; what it does not say is as the filters know it."""

    measurement: Measurement | None = Field(default=None, description="What it measures [-].")
    noise: Noise | None = Field(default=None, description="Measurement noise [-].")
    detection: Detection | None = Field(default=None, description="Probability of detection [-].")
    clutter: Clutter | None = Field(default=None, description="False measurements [-].")
    bias: BiasSection | None = Field(
        default=None, description="What its scans say too much; none: what the filters take off [-]."
    )
    first_detection: Detection | None = Field(
        default=None, description="Probability of detection at its first scan alone; none: as at the others [-]."
    )
    correlation: Correlation | None = Field(
        default=None, description="Of errors and visibility; none: as the filters know it [-]."
    )
    detection_of: Literal["state", "measurement"] = Field(
        default="state",
        description="Where the probability of detection is taken: at the target's true state, or at the position that "
        "was measured of it, noise included (of a position, bearing_range or bearing_range_rate measurement) [-].",
    )

    def findings_beside(self, known: Measurement) -> Iterator[Finding]:
        """Yield faults of the true sensor for the measurement that the filters assume."""
        if self.measurement is not None:
            yield from same_measurement_findings(self.measurement, known, ("true_parameters", "measurement"))
        if self.bias is not None:
            for path, wanted, came in self.bias.findings_beside(known):
                yield ("true_parameters", "bias", *path), wanted, came
        measurement = self._like(known)
        if self.noise is not None:
            yield from noise_findings(measurement, self.noise, ("true_parameters", "noise"))
        if self.clutter is not None:
            yield from clutter_findings(measurement, self.clutter, ("true_parameters", "clutter"))
        if self.detection_of == "measurement" and measurement.kind not in (*PLACED, "custom"):
            wanted = f"state, as a {measurement.kind} measurement does not say where the target is"
            yield ("true_parameters", "detection_of"), wanted, describe(self.detection_of)

    def _like(self, known: Measurement) -> Measurement:
        """Return the measurement for noise and clutter: the filters' or, in place of a custom one, the true one."""
        return known if self.measurement is None or known.kind != "custom" else self.measurement

    def build(self, known: SensorModel, sensor: Any, region: Region, folder: Path, state: Names) -> TrueSensorModel:
        """Return the true sensor, given the filters' model and the section of the sensor. state: see `build_parts`.

        Raises:
            InputError: a custom model that cannot be loaded, or parts that do not fit together.
        """
        from vedette.models.bias import NO_BIAS
        from vedette.simulation.true_sensors import TrueSensor as Made

        like = self._like(sensor.measurement)
        parts = build_parts(self, like, region, folder, state, known.measurement)
        with suppress_unit_warnings():
            # The filters' method may need a Jacobian; nothing is filtered with this model.
            model = replace(known, method="auto", **parts)
        first = None if self.first_detection is None else self.first_detection.build(folder)
        left = NO_BIAS if self.bias is None else self.bias.build() - sensor.bias.build()
        lasts = self.correlation or sensor.correlation
        return Made(model, first, self.detection_of, left, lasts.noise_s, lasts.stays_s)
