"""Biases that change: found window by window of a recording, or followed while scans come in."""

from __future__ import annotations

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
from vedette.models.arguments import float_array, instance, positive
from vedette.recorded.instants import Look, in_order, without_bias
from vedette.tracking import SensorScan
from vedette.tracking.late import name_of, own_scan

_KEPT = 4.0  # windows for which what was found is remembered


class CalibrationWindow(NamedTuple):
    """What was found of a part of a recording, from `begin` to before `end`, s after its first scan."""

    begin: float
    end: float
    calibration: Calibration


def calibrate_windows(
    problem: Problem, seconds: float, watch: Callable[[], None] = lambda: None
) -> Iterator[CalibrationWindow]:
    """Calibrate the parts of a recording one after the other, each by itself.

    Args:
        problem: the recording and the parameters.
        seconds: of a part; all are equally long, about so; inf: of the whole.
        watch: see `calibrate`.

    Raises:
        InputError: seconds that are no number above 0.
        VedetteError: as of `calibrate`.
    """
    if seconds != math.inf:
        positive("seconds", seconds)
    whole = math.nextafter(float(problem.recording.times[-1]), math.inf)
    bounds = np.linspace(0.0, whole, max(1, round(whole / seconds)) + 1).tolist()
    for begin, end in pairwise(bounds):
        own = problem.recording.between(begin, end)
        if own.scans:
            yield CalibrationWindow(begin, end, calibrate(replace(problem, recording=own), watch))


def warm_started(problem: Problem, calibration: Calibration) -> Problem:
    """The problem whose parameters start where they were found."""
    found = {replace(each.parameter, start=0.0): each.value for each in calibration.estimates}
    parameters = [replace(each, start=found.get(replace(each, start=0.0), each.start)) for each in problem.parameters]
    return replace(problem, parameters=tuple(parameters))


class WindowEstimate(NamedTuple):
    """The parameters as a window has them.

    time: s, its middle. values, stds: (num_parameters,) with standard deviations, NaN where they were not found.
    """

    time: float
    values: Floats
    stds: Floats


@dataclass(frozen=True, slots=True, eq=False)
class BiasEstimatorState:
    """What is known of the sensors so far.

    Attributes:
        parameters: each starting where it was last found.
        scans: of the last window, as they came.
        newest: s, the latest time of all; None before the first.
        due: s, from which on biases are found again.
        pieces: of the last windows, in order of time.
        latest: what was found last; None before anything was.
        num_estimates: how often.
    """

    parameters: tuple[Parameter, ...]
    scans: tuple[SensorScan, ...] = ()
    newest: float | None = None
    due: float = math.inf
    pieces: tuple[WindowEstimate, ...] = ()
    latest: Calibration | None = None
    num_estimates: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class OnlineBiasEstimator:
    """Takes scans as they come, finds the sensors' biases in the last of them every so often, and takes them off.

    Biases of what is measured and of places are followed, from the first full window on. Clocks, noise, detection and
    clutter, of which a window says little, are as the parameters start: see `warm_started` for what a longer recording
    says of them. Within a window biases are constant, as of its middle; from there on they go straight, through what
    was found in the window before it, as far as the change stands out of the errors: by d^2 / (d^2 + var d) of it.

    Attributes:
        problem: the sensors and their parameters, as of `vedette.scenarios.calibrated.problem_of`; of its recording
            where bearings count from.
        window: s, of the scans that biases are found in.
        every: s from one time to the next.

    Raises:
        InputError: something else than a problem, no positive times.
    """

    problem: Problem
    window: float = 60.0
    every: float = 30.0

    def __post_init__(self) -> None:
        instance("problem", self.problem, Problem)
        positive("window", self.window)
        positive("every", self.every)

    def initial(self) -> BiasEstimatorState:
        """Before the first scan: biases as the parameters start."""
        return BiasEstimatorState(self.problem.parameters)

    def take(self, state: BiasEstimatorState, scan: SensorScan) -> tuple[BiasEstimatorState, SensorScan]:
        """Take a scan, and find the biases again where that is due.

        Args:
            state: as the call before left it.
            scan: of one sensor, as it came.

        Returns:
            The state with it, and the scan as the sensor would have made it without its biases, for a tracker.

        Raises:
            InputError: a sensor that there is not, a time, a pose or measurements that no scan of it has.
            VedetteError: as of `calibrate`.
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
        """The scan without the biases of its time, as they are known; errors as of `take`."""
        own = self._checked(scan)
        site = self.problem.with_biases(self.biases(state, own.time))[own.sensor]
        look = Look(own.time, own.sensor, own.measurements, own.pose)
        without = without_bias(look, site, self.problem.recording.bearings[scan.sensor])
        return SensorScan(scan.sensor, without.time, without.scan, without.pose)

    def _checked(self, scan: SensorScan) -> SensorScan:
        own = own_scan(scan, len(self.problem.sites))
        shape = None, len(COMPONENTS[self.problem.sites[own.sensor].kind])
        measured = own.measurements if own.measurements.size else np.empty((0, shape[1]))
        return replace(own, measurements=float_array(f"{name_of(own)}: scan", measured, shape))

    def biases(self, state: BiasEstimatorState, time: float) -> Floats:
        """(num_parameters,) the values of the parameters at a time, at most a window after the last that were found."""
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
        """The state with what the last window says."""
        assert state.newest is not None
        recorded, start = self.problem.recording, min(scan.time for scan in state.scans)
        looks = [Look(each.time - start, each.sensor, each.measurements, each.pose) for each in state.scans]
        sites = self.problem.sites
        poses = np.zeros((len(sites), max(map(len, [*(site.pose for site in sites), *(look.pose for look in looks)]))))
        for s, site in enumerate(sites):
            poses[s, : len(site.pose)] = site.pose
        window = in_order(looks, poses, start, recorded.is_utc, (), recorded.bearings)
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
