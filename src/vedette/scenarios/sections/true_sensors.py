"""What a sensor is in truth, where the filters' model of it differs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from vedette.plausible import told_elsewhere
from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import Section
from vedette.scenarios.sections.clutter import Clutter
from vedette.scenarios.sections.detection import Detection
from vedette.scenarios.sections.sensing import WITHOUT_PLACE, Measurement, Noise
from vedette.scenarios.sections.sensor_checks import (
    clutter_box_findings,
    clutter_findings,
    noise_findings,
    same_measurement_findings,
)

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import Region, SensorModel
    from vedette.simulation import TrueSensor as TrueSensorModel


class TrueSensor(Section):
    """The sensor that is simulated; what it does not say is as the filters know it."""

    measurement: Measurement | None = Field(default=None, description="What it measures [-].")
    noise: Noise | None = Field(default=None, description="Measurement noise [-].")
    detection: Detection | None = Field(default=None, description="Probability of detection [-].")
    clutter: Clutter | None = Field(default=None, description="False measurements [-].")
    first_detection: Detection | None = Field(
        default=None, description="Probability of detection at its first scan alone; none: as at the others [-]."
    )
    detection_of: Literal["state", "measurement"] = Field(
        default="state",
        description="Where the probability of detection is taken: at the target's true state, or at the position that "
        "was measured of it, noise included (of a position or bearing_range measurement) [-].",
    )

    def findings_beside(self, known: Measurement) -> Iterator[Finding]:
        """What is wrong with it beside the measurement that the filters know."""
        if self.measurement is not None:
            yield from same_measurement_findings(self.measurement, known, ("truth", "measurement"))
        measurement = self._like(known)
        if self.noise is not None:
            yield from noise_findings(measurement, self.noise, ("truth", "noise"))
        if self.clutter is not None:
            yield from clutter_findings(measurement, self.clutter, ("truth", "clutter"))
            yield from clutter_box_findings(measurement, self.clutter, ("truth", "clutter"))
        if self.detection_of == "measurement" and measurement.kind in WITHOUT_PLACE:
            wanted = f"state, as a {measurement.kind} measurement does not say where the target is"
            yield ("truth", "detection_of"), wanted, describe(self.detection_of)

    def _like(self, known: Measurement) -> Measurement:
        """What noise and clutter are for: the filters' kind, which a measurement of the user's own stands in for."""
        return known if self.measurement is None or known.kind != "custom" else self.measurement

    def build(self, known: SensorModel, measurement: Measurement, region: Region, folder: Path) -> TrueSensorModel:
        """The sensor, beside the filters' model and their section of the measurement.

        Raises:
            InputError: a custom model that cannot be had, or parts that do not fit together.
        """
        from vedette.simulation.true_sensors import TrueSensor as Made

        like = self._like(measurement)
        measured = known.measurement if self.measurement is None else self.measurement.build(folder)
        parts: dict[str, Any] = {
            "measurement": measured,
            "noise": known.noise if self.noise is None else self.noise.build(like, folder),
            "detection": known.detection if self.detection is None else self.detection.build(folder),
            "clutter": self.clutter.build(measured, like.kind, region, folder) if self.clutter else known.clutter,
        }
        with told_elsewhere():
            # The filters' method may need a Jacobian; nothing is filtered with this model.
            model = replace(known, method="auto", **parts)
        first = None if self.first_detection is None else self.first_detection.build(folder)
        return Made(model, first, self.detection_of)
