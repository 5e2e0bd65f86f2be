"""A Stone Soup tracker that uses Vedette's filters and fusion rules."""

import datetime
from collections import Counter
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.tracker.base import Tracker, _TrackerMixInUpdate
from stonesoup.types.array import CovarianceMatrix, StateVector
from stonesoup.types.detection import MissedDetection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.types.track import Track
from stonesoup.types.update import GaussianStateUpdate

from vedette.densities import marginal_estimate
from vedette.densities.estimates import joined_mode_probs
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.measurement import wrap_periodic
from vedette.models.sensor import with_default_detection_at
from vedette.stonesoup.converting import ConvertedModels
from vedette.stonesoup.scans import ScanConverter, Scans
from vedette.tracking import State, TrackerInfo
from vedette.tracking import Tracker as VedetteTracker

# Squared distance in standard deviations of the noise, up to four components: exceeded by one detection in 10^4.
_NEAR = 23.5


class LabelledTracker(_TrackerMixInUpdate, Tracker):  # type: ignore[misc] # Stone Soup is untyped
    """Stone Soup tracker whose tracks are the labels of an LMB or GLMB filter of one or several sensors.

    A label has a track from the time its existence exceeds `existence_threshold` until it no longer exceeds
    `end_threshold`, with a state at every time. It then also has the earlier states since it exceeded `end_threshold`,
    like tracks of Stone Soup's initiators. Its `id` is the label ("birth step.index"), if it returns "birth step.index
    (2)", and `metadata["existence"]` the probability. With modes of motion, `metadata["modes"]` has the probability of
    each, by name. The state is a `GaussianStateUpdate`. As a filter averages over associations, its hypothesis names
    the detection that is nearest to the updated state in standard deviations of the sensor's noise, over all sensors,
    or a `MissedDetection` if none is near. The prediction in it is the predicted last state of the track. A new track
    has none.
    """

    detector: Any = Property(doc="Yields times and sets of detections: a detector, reader, simulator or list.")
    models: Any = Property(doc="What `vedette.stonesoup.convert` made of the transition model and sensors.")
    tracker: Any = Property(
        default=None, doc="Of `vedette.tracking`, with these targets and sensors; default `models.tracker()`."
    )
    existence_threshold: float = Property(default=0.5, doc="Probability of a target above which it gets a track.")
    end_threshold: float = Property(default=0.1, doc="Probability at or below which its track ends.")
    every_sensor_scans: bool = Property(
        default=True,
        doc="Whether all sensors scan at each time; False: those that have detections, and an empty set is of nobody.",
    )
    seed: int = Property(default=0, doc="Of filters that draw.")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if not isinstance(self.models, ConvertedModels):
            raise InputError(f"models: expected what convert() made; got {type(self.models).__name__}")
        if self.tracker is None:
            self.tracker = self.models.tracker()
        if not isinstance(self.tracker, VedetteTracker):
            raise InputError(f"tracker: expected one of vedette.tracking; got {type(self.tracker).__name__}")
        own = tuple(
            sensor if given.detection_at is None else with_default_detection_at(sensor, given.detection_at)
            for sensor, given in zip(self.models.sensors, self.tracker.sensors, strict=False)
        )
        if self.tracker.targets != self.models.targets or self.tracker.sensors != own:
            raise InputError("tracker: expected one of models.targets and models.sensors; got one of others")
        self.state: State = self.tracker.initial()
        self.info: TrackerInfo | None = None
        self._mode_names: tuple[str, ...] = getattr(self.models.targets.motion, "names", ())
        self._scans = ScanConverter(self.models, self.every_sensor_scans)
        if not 0.0 <= self.end_threshold <= self.existence_threshold < 1.0:
            given = f"{self.end_threshold} and {self.existence_threshold}"
            raise InputError(f"end_threshold: expected 0 <= end_threshold <= existence_threshold < 1; got {given}")
        streams = np.random.SeedSequence(self.seed).spawn(len(self.models.sensors))
        self._rngs = [np.random.default_rng(stream) for stream in streams]
        self._current: dict[tuple[int, int], Track] = {}
        self._confirmed: set[tuple[int, int]] = set()
        self._ended: Counter[tuple[int, int]] = Counter()

    @property
    def tracks(self) -> set[Track]:
        """Tracks of the targets that currently exist."""
        return {track for label, track in self._current.items() if label in self._confirmed}

    def update_tracker(self, time: datetime.datetime, detections: Any) -> tuple[datetime.datetime, set[Track]]:
        """Update with the detections of a time, and return the time and the tracks."""
        given = self._scans.at(time, detections)
        self.state, self.info = self.tracker.step(self.state, given.scans, given.poses, given.time, rngs=self._rngs)
        before, self._current = self._current, {}
        estimate = marginal_estimate(self.state.fused, self.end_threshold)
        modes = joined_mode_probs([estimate], len(self._mode_names))
        for label, mean, cov, existence, own in zip(
            map(tuple, estimate.labels.tolist()), estimate.means, estimate.covs, estimate.existence, modes, strict=True
        ):
            if existence > self.existence_threshold:
                self._confirmed.add(label)
            track = before.pop(label, None) or self._new(label)
            hypothesis = SingleHypothesis(self._prediction(track, time), self._nearest(mean, given, time))
            vector, spread = self._in_their_order(mean, cov)
            update = GaussianStateUpdate(vector, spread, timestamp=time, hypothesis=hypothesis)
            if track.states and track.timestamp == time:  # scans of one time that were passed separately
                track[-1] = update
            else:
                track.append(update)
            track.metadata["existence"] = float(existence)
            if self._mode_names:
                track.metadata["modes"] = dict(zip(self._mode_names, own.tolist(), strict=True))
            self._current[label] = track
        self._ended.update(before.keys() & self._confirmed)
        self._confirmed -= before.keys()
        return time, self.tracks

    def _new(self, label: tuple[int, int]) -> Track:
        before = self._ended[label]
        return Track(id=f"{label[0]}.{label[1]}" + (f" ({before + 1})" if before else ""))

    def _in_their_order(self, mean: Floats, cov: Floats) -> tuple[StateVector, CovarianceMatrix]:
        back = self.models.layout.inverse()
        return StateVector(back.states(mean[np.newaxis])[0]), CovarianceMatrix(back.covs(cov[np.newaxis])[0])

    def _prediction(self, track: Track, time: datetime.datetime) -> GaussianStatePrediction | None:
        if not track.states:
            return None
        last, layout = track.states[-1], self.models.layout
        before = layout.states(np.asarray(last.mean, np.float64).T)[0], layout.covs([last.covar])[0]
        moved = self.models.predicted(*before, (time - last.timestamp).total_seconds())
        return GaussianStatePrediction(*self._in_their_order(*moved), timestamp=time)

    def _nearest(self, mean: Floats, given: Scans, time: datetime.datetime) -> Any:
        """Return the detection nearest to a state, or a missed one."""
        best, found = _NEAR, None
        for sensor, scan, pose, detections in zip(
            self.models.sensors, given.scans, given.poses, given.detections, strict=True
        ):
            if scan is None or not len(scan):
                continue
            off = wrap_periodic(scan - sensor.measurement.measure(mean, pose), sensor.measurement.periods)
            precision = np.linalg.inv(sensor.noise.covs(mean, pose, sensor.meas_dim)[0])
            distances = np.einsum("ni,ij,nj->n", off, precision, off)
            if distances.min() < best:
                best, found = float(distances.min()), detections[int(distances.argmin())]
        return MissedDetection(timestamp=time) if found is None else found
