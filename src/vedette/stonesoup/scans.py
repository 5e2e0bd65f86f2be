"""Conversion of Stone Soup detections and ground truth into scans, poses and truth."""

import datetime
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.recorded.detections import elements_of
from vedette.simulation.truth import Truth
from vedette.stonesoup.converting import ConvertedModels
from vedette.stonesoup.motions import StateLayout
from vedette.stonesoup.sensors import convert_pose, measured_quantities, measurement_model_of


class Scans(NamedTuple):
    """The scans of one time, as trackers take them."""

    time: float  # s, since the first scan
    scans: tuple[Floats | None, ...]  # one per sensor: (num, meas_dim); None if it did not scan
    poses: Floats  # (num_sensors, 3)
    detections: tuple[tuple[Any, ...], ...]  # one per sensor: of Stone Soup, in the order of the rows


@dataclass(slots=True)
class ScanConverter:
    """Converts times with sets of detections into scans, one after the other.

    A detection belongs to the sensor in its `metadata["sensor"]`, or without one, to the sensor with its current
    measurement model. The pose is that of the detection's measurement model, or for an empty scan that of the sensor
    itself.

    Attributes:
        models: of the sensors.
        every_sensor_scans: whether all sensors scan at each time, those without detections with an empty scan. False:
            only sensors with detections scan, and an empty set belongs to no sensor.
        start: the time of 0 s. None: the first time.
    """

    models: ConvertedModels
    every_sensor_scans: bool = True
    start: datetime.datetime | None = None
    _poses: dict[int, Floats] = field(default_factory=dict)

    def at(self, time: datetime.datetime, detections: Iterable[Any]) -> Scans:
        """Return the scans of one time.

        Raises:
            InputError: an invalid detection. The message names the detection and its attribute, what was expected and
                the value.
        """
        if self.start is None:
            self.start = time
        models, found = self.models, list(detections)
        rows: list[list[tuple[tuple[float, ...], Any]]] = [[] for _ in models.sensors]
        poses: dict[int, Floats] = {}
        for number, detection in enumerate(found, start=1):
            place = f"detections of {time}, detection {number}"
            s = self._sensor(detection, place)
            model = getattr(detection, "measurement_model", None) or measurement_model_of(models.sources[s])
            wanted = measured_quantities(measurement_model_of(models.sources[s]))
            rows[s].append((elements_of(detection, wanted, model, place), detection))
            pose = convert_pose(model)
            if not np.allclose(poses.setdefault(s, pose), pose, rtol=1e-12, atol=1e-9):
                raise InputError(
                    f"{place}, measurement_model: expected one place of sensor {models.names[s]} at a time"
                )
        for s, source in enumerate(models.sources):
            if s not in poses and (source is not measurement_model_of(source) or s not in self._poses):
                poses[s] = convert_pose(measurement_model_of(source))
        self._poses |= poses
        scans, kept = [], []
        for s, own in enumerate(rows):
            own.sort(key=lambda row: row[0])  # sets are unordered
            scanned = own or self.every_sensor_scans or len(rows) == 1
            values = np.array([values for values, _ in own]).reshape(len(own), models.sensors[s].meas_dim)
            scans.append(values if scanned else None)
            kept.append(tuple(detection for _, detection in own))
        seconds = (time - self.start).total_seconds()
        return Scans(seconds, tuple(scans), np.array([self._poses[s] for s in range(len(rows))]), tuple(kept))

    def _sensor(self, detection: Any, place: str) -> int:
        names, metadata = self.models.names, getattr(detection, "metadata", None) or {}
        if "sensor" in metadata and str(metadata["sensor"]) in names:
            return names.index(str(metadata["sensor"]))
        if len(names) == 1:
            return 0
        model = getattr(detection, "measurement_model", None)
        alike = [s for s, source in enumerate(self.models.sources) if _same(model, measurement_model_of(source))]
        if len(alike) != 1:
            wanted = f"{', '.join(names)}, or the measurement_model of one of them"
            raise InputError(f'{place}, metadata["sensor"]: expected one of {wanted}; got {metadata.get("sensor")}')
        return alike[0]


def _same(model: Any, other: Any) -> bool:
    """Return True if two measurement models are of one sensor: kind, position, direction and noise."""
    if model is None or type(model) is not type(other):
        return False
    return np.array_equal(convert_pose(model), convert_pose(other)) and np.array_equal(model.covar(), other.covar())


def convert_truth(
    paths: Iterable[Any],
    times: Iterable[datetime.datetime],
    layout: StateLayout,
    *,
    start: datetime.datetime | None = None,
) -> Truth:
    """Convert ground truth paths of Stone Soup into the truth of a run. A path exists at the times of its states.

    Args:
        paths: `GroundTruthPath`s, or anything that iterates over states with a `timestamp` and a `state_vector`.
        times: of the scans, increasing.
        layout: of the states.
        start: the time of 0 s. None: the first.
    """
    moments = list(times)
    start = moments[0] if start is None and moments else start
    where = {moment: k for k, moment in enumerate(moments)}
    states: list[dict[int, Any]] = [{} for _ in moments]
    # Sets are unordered; paths have an id.
    for number, path in enumerate(sorted(paths, key=lambda path: (path[0].timestamp, str(getattr(path, "id", ""))))):
        for state in path:
            if state.timestamp in where:
                states[where[state.timestamp]][number] = np.asarray(state.state_vector, np.float64).ravel()
    offsets = np.concatenate([[0], np.cumsum([len(there) for there in states])]).astype(np.int64)
    rows = [vector for there in states for vector in there.values()]
    dim = len(layout.order)
    table = layout.states(np.array(rows).reshape(len(rows), -1)) if rows else np.empty((0, dim))
    ids = np.array([number for there in states for number in there], np.int64)
    seconds = np.array([(moment - start).total_seconds() for moment in moments if start is not None])
    made = Truth(seconds, offsets, ids, table)
    made.validate()
    return made
