"""Time-varying biases: estimated per window of a recording, or online from incoming scans."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vedette.calibration.calibrating import Calibration, calibrate
from vedette.calibration.parameters import Parameter, Problem
from vedette.internal.quantities import COMPONENTS
from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, positive
from vedette.models.fields import Checked, Positive
from vedette.models.scan_rows import values_of, with_values
from vedette.recorded.scan_times import RecordedScan, group_by_time, poses_at_sites, remove_bias
from vedette.tracking import SensorScan
from vedette.tracking.out_of_sequence import copy_scan, scan_name

_KEPT = 4.0  # number of windows whose estimates are kept


class CalibrationWindow(NamedTuple):
    """Calibration of the part of a recording from `begin` to before `end`, s after its first scan."""

    begin: float
    end: float
    calibration: Calibration


def calibrate_windows(
    problem: Problem, seconds: float, progress: Callable[[], None] = lambda: None
) -> Iterator[CalibrationWindow]:
    """Calibrate the parts of a recording separately, in order of time.

    Args:
        problem: the recording and the parameters.
        seconds: approximate duration of a part, s. All parts have the same. inf: the whole recording.
        progress: see `calibrate`.

    Raises:
        InputError: seconds that are not a number above 0.
        VedetteError: as `calibrate`.
    """
    if seconds != math.inf:
        positive("seconds", seconds)
    whole = math.nextafter(float(problem.recording.times[-1]), math.inf)
    bounds = np.linspace(0.0, whole, max(1, round(whole / seconds)) + 1).tolist()
    for begin, end in pairwise(bounds):
        own = problem.recording.between(begin, end)
        if own.scans:
            yield CalibrationWindow(begin, end, calibrate(replace(problem, recording=own), progress))


def warm_started(problem: Problem, calibration: Calibration) -> Problem:
    """Return the problem with each parameter starting at its estimate, if it is better than the assumed value."""
    found = {replace(each.parameter, start=0.0): each.value for each in calibration.estimates if each.is_better}
    parameters = [replace(each, start=found.get(replace(each, start=0.0), each.start)) for each in problem.parameters]
    return replace(problem, parameters=tuple(parameters))


class WindowEstimate(NamedTuple):
    """Parameters estimated from one window.

    time: middle of the window, s. values, stds: (num_parameters,) with standard deviations, NaN for parameters that
    were not estimated.
    """

    time: float
    values: Floats
    stds: Floats


@dataclass(frozen=True, slots=True, eq=False)
class BiasEstimatorState:
    """State of an `OnlineBiasEstimator`.

    Attributes:
        parameters: the parameters, each starting at its latest estimate.
        scans: scans of the last window, in order of arrival.
        newest: latest time of all scans, s, or None before the first.
        due: time from which the next estimate is due, s.
        pieces: estimates of the last windows, in order of time.
        latest: latest calibration, or None before the first.
        num_estimates: number of calibrations so far.
    """

    parameters: tuple[Parameter, ...]
    scans: tuple[SensorScan, ...] = ()
    newest: float | None = None
    due: float = math.inf
    pieces: tuple[WindowEstimate, ...] = ()
    latest: Calibration | None = None
    num_estimates: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class OnlineBiasEstimator(Checked):
    """Estimates the sensors' biases from incoming scans at regular intervals, and removes them from the scans.

    Biases of measurements and positions are estimated from the first full window on. Clocks, noise, detection and
    clutter stay at the parameters' start values, as a window contains little information about them. See `warm_started`
    to start from a longer recording. The estimate of a window is the bias at its middle. From there it is extrapolated
    linearly through the estimate of the window before, with the change d shrunk by d^2 / (d^2 + var d).

    Attributes:
        problem: the sensors and their parameters, see `vedette.scenarios.calibration.build_problem`. Its recording
            gives the zero of the bearings.
        window: duration of the scans that an estimate uses, s.
        every: time between estimates, s.

    Raises:
        InputError: not a problem, or times that are not positive.
    """

    problem: Problem
    window: Positive = 60.0
    every: Positive = 30.0

    def initial(self) -> BiasEstimatorState:
        """Return the state before the first scan: biases at the parameters' start values."""
        return BiasEstimatorState(self.problem.parameters)

    def process(self, state: BiasEstimatorState, scan: SensorScan) -> tuple[BiasEstimatorState, SensorScan]:
        """Process a scan, and estimate the biases again if that is due.

        Args:
            state: state after the call before.
            scan: scan of one sensor, as received.

        Returns:
            The new state, and the scan without the sensor's biases, for a tracker.

        Raises:
            InputError: an unknown sensor, or a time, pose or measurements that the sensor cannot have.
            VedetteError: as `calibrate`.
        """
        scan = self._checked(scan)
        newest = scan.time if state.newest is None else max(state.newest, scan.time)
        due = scan.time + self.window if state.newest is None else state.due
        scans = tuple(each for each in (*state.scans, scan) if each.time > newest - self.window)
        state = replace(state, scans=scans, newest=newest, due=due)
        if newest >= due:
            state = self._found(state)
        return state, self.corrected(state, scan)

    def corrected(self, state: BiasEstimatorState, scan: SensorScan) -> SensorScan:
        """Return the scan without the biases estimated for its time. Raises as `process`."""
        own = self._checked(scan)
        site = self.problem.with_biases(self.biases(state, own.time))[own.sensor]
        recorded_scan = RecordedScan(own.time, own.sensor, own.measurements, own.pose)
        without = remove_bias(recorded_scan, site, self.problem.recording.bearings[scan.sensor])
        return SensorScan(scan.sensor, without.time, without.scan, without.pose)

    def _checked(self, scan: SensorScan) -> SensorScan:
        own = copy_scan(scan, len(self.problem.sites))
        dim = len(COMPONENTS[self.problem.sites[own.sensor].kind])
        measured = values_of(own.measurements) if len(own.measurements) else np.empty((0, dim))
        values = float_array(f"{scan_name(own)}: scan", measured, (None, dim))
        return replace(own, measurements=with_values(own.measurements, values))

    def biases(self, state: BiasEstimatorState, time: float) -> Floats:
        """(num_parameters,) values of the parameters at a time.

        They are extrapolated to at most a window after the last window.
        """
        values = np.array([each.start for each in state.parameters])
        for i, each in enumerate(state.parameters):
            pieces = [piece for piece in state.pieces if math.isfinite(piece.stds[i])]
            if each.kind != "bias" or not pieces:
                continue
            last = pieces[-1]
            values[i] = last.values[i]
            before = [piece for piece in pieces if piece.time <= last.time - self.window]
            if before:
                change, spread = last.values[i] - before[-1].values[i], math.hypot(last.stds[i], before[-1].stds[i])
                ahead = min(time - last.time, 1.5 * self.window) / (last.time - before[-1].time)
                values[i] += ahead * change * change**2 / (change**2 + spread**2)
        return values

    def _found(self, state: BiasEstimatorState) -> BiasEstimatorState:
        """Return the state with the estimates of the last window."""
        assert state.newest is not None
        recorded, start = self.problem.recording, min(scan.time for scan in state.scans)
        recorded_scans = [
            RecordedScan(each.time - start, each.sensor, each.measurements, each.pose) for each in state.scans
        ]
        poses = poses_at_sites(self.problem.sites, recorded_scans)
        window = group_by_time(recorded_scans, poses, start, recorded.is_utc, (), recorded.bearings)
        problem = replace(self.problem, recording=window, parameters=state.parameters)
        drifts = [each for each in state.parameters if each.kind == "bias" and each.component != "clock"]
        calibration = calibrate(problem, only=drifts)
        parameters = warm_started(problem, calibration).parameters
        stds = np.full(len(parameters), math.nan)
        for each in calibration.estimates:
            stds[[p.sensor == each.parameter.sensor and p.name == each.parameter.name for p in parameters]] = each.std
        middle = start + 0.5 * float(window.times[-1])
        piece = WindowEstimate(middle, np.array([each.start for each in parameters]), stds)
        kept = tuple(each for each in state.pieces if each.time > middle - _KEPT * self.window)
        due = state.due + self.every * (1.0 + math.floor((state.newest - state.due) / self.every))
        found = replace(state, parameters=parameters, due=due, pieces=(*kept, piece), latest=calibration)
        return replace(found, num_estimates=state.num_estimates + 1)
