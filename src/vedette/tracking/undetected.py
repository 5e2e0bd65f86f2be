"""Tracker that maintains the intensity of undetected targets where beliefs have none, for planners that search."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vedette.densities import UndetectedIntensity
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.prediction import survival_probabilities
from vedette.kernels.steps.undetected import take_out_detected
from vedette.models import SensorModel, UndetectedModel, kernel_motion
from vedette.models.arguments import float_array, reject
from vedette.tracking.base import StageTimer, State, TrackerInfo, TrackerWrapper
from vedette.tracking.births import unexplained_measurements
from vedette.tracking.lost_labels import expected_in_cells, expected_lost_targets, lost_labels


@dataclass(frozen=True, slots=True, eq=False)
class UndetectedTargetTracker(TrackerWrapper):
    """Wrapper of a tracker whose states also have the intensity of undetected targets (`State.undetected`).

    The beliefs are bit for bit those of the wrapped tracker. A scan multiplies the expected number in each cell by the
    mean over the cell of 1 - P_D. The wrapped tracker processes its measurements. Labels that the tracker drops become
    undetected again (`expected_lost_targets`). With births from measurements, birth candidates count as undetected
    until they are born, because they are found only if they are observed again: a measurement that is unexplained with
    probability p counts as p times the largest existence of such a birth. All scans are used at once, even if a network
    delivers them late or not at all.

    Attributes:
        tracker: tracker of the detected targets.
        model: model of the undetected targets: initial number, motion, appearance and disappearance.

    Raises:
        InputError: `tracker` is not a tracker, or `model` is not an `UndetectedModel` with a fixed birth rate.
    """

    model: UndetectedModel
    _centres: Floats = field(init=False, repr=False)  # (num_cells, state_dim)
    _nodes: Floats = field(init=False, repr=False)  # (num_cells, num_nodes, state_dim)
    _node_weights: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        TrackerWrapper.__post_init__(self)
        if not isinstance(self.model, UndetectedModel):
            raise reject("model", "an UndetectedModel", self.model)
        if self.model.is_learnt:
            wanted = "a number, as it is the beliefs of filters with an intensity of undetected targets that learn it"
            raise reject("UndetectedModel.birth_rate", wanted, self.model.birth_rate)
        object.__setattr__(self, "_centres", self.model.grid.states(self.targets.state_dim, 1)[:, 0].copy())
        object.__setattr__(self, "_nodes", self.model.grid.states(self.targets.state_dim))
        object.__setattr__(self, "_node_weights", self.model.grid.node_weights())

    def initial(self) -> State:
        """Return the wrapped tracker's first state, with the model's initial undetected targets."""
        return replace(self.tracker.initial(), undetected=UndetectedIntensity(self.model.grid, self.model.initial()))

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Step the wrapped tracker, then update the undetected targets for the same scans. See `Tracker.step`.

        Raises:
            InputError: a state without `undetected`, or with one on another grid, and the errors of the tracker.
        """
        after, info = self.tracker.step(state, scans, poses, time, rngs=rngs)
        timer = StageTimer()
        with timer.timing("targets not yet found"):
            expected = self._predicted(state, time)
            pose_array = float_array("poses", poses, (len(self.sensors), None))
            scanned = [each[:2] for each in zip(self.sensors, pose_array, scans, strict=True) if each[2] is not None]
            for sensor, pose in scanned:
                inputs = sensor.to_kernel(), pose, self._nodes, self._node_weights
                expected = take_out_detected(*inputs, expected[np.newaxis])[0]
            expected = expected + self._lost(state, after, scanned, float(time)) + self._new(after, scans, pose_array)
        seconds = {**info.seconds, **timer.seconds}
        undetected = UndetectedIntensity(self.model.grid, expected)
        return replace(after, undetected=undetected), replace(info, seconds=seconds)

    def _predicted(self, state: State, time: float) -> Floats:
        """Expected number in each cell before the scans of a time, (num_cells,), or the initial one for the first."""
        before, grid = state.undetected, self.model.grid
        if before is None:
            raise InputError("state.undetected: expected an UndetectedIntensity, as of initial(); got None")
        if before.grid != grid:
            raise InputError(f"state.undetected: expected one of the model's grid, {grid}; got one of {before.grid}")
        if state.time is None:
            return before.expected
        dt = float(time) - state.time
        if dt == 0.0:
            return before.expected
        return self.model.predict(before.expected, dt, self._survival(dt))

    def _survival(self, dt: float) -> Floats | float:
        """Probability of surviving `dt` seconds: in each cell, shape (num_cells,), or one number for all cells."""
        if self.model.survival is not None:
            return float(self.model.survival**dt)
        motion = kernel_motion(self.targets.motion, self.targets.survival)
        return survival_probabilities(motion, dt, self._centres)

    def _lost(
        self, before: State, after: State, scanned: Sequence[tuple[SensorModel, Floats]], time: float
    ) -> Floats | float:
        """Expected number in each cell of targets whose labels were dropped, (num_cells,), or 0."""
        lost = lost_labels(before.fused, (*after.local, after.fused))
        if before.time is None or lost is None or lost.tracks.num_tracks == 0:
            return 0.0
        return expected_lost_targets(lost, self.targets, scanned, time - before.time, self.model.grid)

    def _new(self, after: State, scans: Sequence[Any], poses: Floats) -> Floats | float:
        """Expected number in each cell of birth candidates from measurements, (num_cells,), or 0."""
        birth = self.targets.birth.from_measurements
        if birth is None:
            return 0.0
        measurements = unexplained_measurements(birth, after.fused, self.sensors, scans, poses, self.targets.motion)
        return expected_in_cells(
            measurements.states[:, :2], birth.max_existence * measurements.probabilities, self.model.grid
        )
