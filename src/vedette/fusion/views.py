"""What each sensor could see when it scanned: what fusions under limited fields of view go by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vedette.densities import Labelled, TrackTable
from vedette.densities.factored import LABELLED
from vedette.kernels.base.types import Floats
from vedette.models import SensorModel
from vedette.models.arguments import float_array, one_a_sensor, reject, sequence


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """The sensors at one time, from where they scanned.

    Attributes:
        sensors: what each sensor sees, in the order of the beliefs.
        poses: (num_sensors, pose_dim) where each was.
        scanned: whether each sensor scanned at this time; one that did not saw nothing.
        prediction: the belief that all sensors' beliefs were updated from, each by its own scan alone; None where there
            is no such belief.

    Raises:
        InputError: no sensor, another number of poses or scans than of sensors, or poses that are not finite.
    """

    sensors: tuple[SensorModel, ...]
    poses: Floats
    scanned: tuple[bool, ...]
    prediction: Labelled | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "sensors", sequence("views.sensors", self.sensors, "at least one SensorModel"))
        num = len(self.sensors)
        if num == 0 or not all(isinstance(sensor, SensorModel) for sensor in self.sensors):
            raise reject("views.sensors", "at least one SensorModel", self.sensors)
        object.__setattr__(self, "poses", float_array("views.poses", self.poses, (num, None)))
        one_a_sensor(num, **{"views.scanned": self.scanned})
        if not isinstance(self.prediction, Labelled | None):
            raise reject("views.prediction", f"{LABELLED}, or None", type(self.prediction).__name__)

    def if_all_scanned(self) -> Views:
        """What the sensors would see if each had scanned."""
        return replace(self, scanned=(True,) * len(self.sensors))

    def detection(self, tracks: TrackTable) -> Floats:
        """(num_tracks, num_sensors) mean probability of detection over each track's density; 0 without a scan."""
        return np.stack([self.detection_by(sensor, tracks) for sensor in range(len(self.sensors))], axis=1)

    def detection_by(self, sensor: int, tracks: TrackTable) -> Floats:
        """(num_tracks,) mean probability of detection by one sensor over each track's density; 0 without a scan."""
        if not self.scanned[sensor] or tracks.num_tracks == 0:
            return np.zeros(tracks.num_tracks)
        chances = self.sensors[sensor].mean_detection(tracks.means, tracks.covs, self.poses[sensor])
        if len(chances) == tracks.num_tracks:
            return chances
        return np.asarray(np.add.reduceat(np.exp(tracks.log_weights) * chances, tracks.offsets[:-1]))
