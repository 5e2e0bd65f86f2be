"""What central filters share: one belief, updated by the scans that several sensors have taken at one time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from vedette.errors import InputError
from vedette.filters.blind import NO_POSE, NO_SCAN, blind_sensor
from vedette.filters.inputs import check_scan
from vedette.filters.limits import Limits
from vedette.kernels.base.types import Floats
from vedette.models import SensorModel, TargetModel
from vedette.models.arguments import generator, pose_vector


class Look(NamedTuple):
    """One sensor's scan from one pose."""

    name: str
    sensor: SensorModel
    scan: Floats
    pose: Floats


@dataclass(frozen=True, slots=True, eq=False)
class MultiSensorFilter:
    """The parts of a filter of several sensors.

    Attributes:
        targets: how targets move, live on and appear.
        sensors: what each sensor sees of them; they may measure different things.
        limits: caps and thresholds.

    Raises:
        InputError: a part of another kind, or no sensor.
    """

    targets: TargetModel
    sensors: tuple[SensorModel, ...]
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        for name, kind in (("targets", TargetModel), ("limits", Limits)):
            value = getattr(self, name)
            if not isinstance(value, kind):
                raise InputError(f"{name}: expected a {kind.__name__}; got {type(value).__name__}")
        if not isinstance(self.sensors, Sequence) or len(self.sensors) == 0:
            raise InputError(f"sensors: expected a sequence of at least one SensorModel; got {self.sensors!r}")
        for s, sensor in enumerate(self.sensors):
            if not isinstance(sensor, SensorModel):
                raise InputError(f"sensors[{s}]: expected a SensorModel; got {type(sensor).__name__}")
        object.__setattr__(self, "sensors", tuple(self.sensors))

    def _looks(self, scans: Any, poses: Any, rng: Any) -> tuple[list[Look], int]:
        """What each sensor that scanned saw and from where, and how many measurements repeat another.

        Where none scanned, a blind look, with which an update is the prediction.
        """
        generator(rng)
        for name, given in (("scans", scans), ("poses", poses)):
            if given is None or len(given) != len(self.sensors):
                came = "None" if given is None else len(given)
                raise InputError(f"{name}: expected {len(self.sensors)}, one a sensor; got {came}")
        looks, num_duplicates = [], 0
        for s, sensor in enumerate(self.sensors):
            if scans[s] is None:
                continue
            try:
                scan, num = check_scan(scans[s], sensor.measurement)
            except InputError as error:
                raise InputError(f"scans[{s}]: {error}") from None
            looks.append(Look(f"sensor {s}", sensor, scan, pose_vector(f"poses[{s}]", poses[s])))
            num_duplicates += num
        return looks or [Look("no sensor", blind_sensor(), NO_SCAN, NO_POSE)], num_duplicates


def log_likelihood(log_total: float, log_clutters: Sequence[float], looks: Sequence[Look]) -> float:
    """From joint weights relative to clutter to a density of the scans."""
    return log_total + sum(
        log_clutter - look.sensor.clutter.rate for log_clutter, look in zip(log_clutters, looks, strict=True)
    )
