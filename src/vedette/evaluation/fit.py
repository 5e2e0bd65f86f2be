"""Fit of the assumed model to a run: tests of each sensor against the tracks, without the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vedette.evaluation.innovations import Match, SensorFit, by_label, sensor_fits
from vedette.evaluation.scans import rows_of_record
from vedette.evaluation.sensor_agreement import disagreement_warnings
from vedette.evaluation.unexplained_courses import unexplained_course_warnings
from vedette.internal.quantities import QUANTITIES
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats
from vedette.models.sensor import SensorModel
from vedette.recorded.stationary import stationary_places
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_sensors
from vedette.scenarios.sections.recording import recorded_sensors, returns_models
from vedette.simulation.records import RunRecord

_SURE = 6.0  # standard errors of a finding; of independent blocks, as errors are correlated in time
_BLOCK = 10  # successive matches of a track in one block
_MIN_BLOCKS = 5
_LEAST_BIAS = 0.25  # of the noise's standard deviation; smaller ones cost no accuracy
_SPREADS = (0.6, 1.5)  # of the assumed standard deviation; no finding within them
_LEAST_DIFFERENCE = 0.1  # of the share of detected targets
_RETURNS = 0.1  # further measurements a track and scan
_LEAST_EXCESS = 0.5  # unexplained measurements a scan above the clutter rate; and as a share of it
_MANY_PLACES = 3  # stationary places; fewer may be targets at rest
_EDGE = 3  # matches at each end of a track, which depend on what was detected


class Finding(NamedTuple):
    """A fault of the assumed model.

    test: name of the test. sensor: its name, or `` for several. text: sentence with the number and the cure.
    """

    test: str
    sensor: str
    text: str


class Fit(NamedTuple):
    """Findings of a run, and what was searched: the tests with the number of matches of each."""

    findings: tuple[Finding, ...]
    searched: str

    def to_dict(self) -> dict[str, Any]:
        """Return the fit as plain data."""
        return {"findings": [each._asdict() for each in self.findings], "searched": self.searched}

    @classmethod
    def from_dict(cls, data: Any) -> Fit | None:
        """Return the fit of plain data; None if there is none, as in runs of simulated scans."""
        if not isinstance(data, Mapping):
            return None
        return cls(tuple(Finding(**each) for each in data["findings"]), data["searched"])

    def lines(self, num_warnings: int = 0) -> list[str]:
        """Return the texts of the findings; without any, one line that names the tests.

        num_warnings: warnings of the scenario that were shown; then nothing is called faultless.
        """
        if self.findings:
            return [each.text for each in self.findings]
        if num_warnings:
            return [f"nothing beside {pluralise(num_warnings, 'warning')} found; searched: {self.searched}"]
        return [f"no fault found; searched: {self.searched}"]


class _Mean(NamedTuple):
    """Mean of some values and its standard error from blocks."""

    value: float
    error: float

    def away_from(self, value: float) -> float:
        """Return the distance to a value in standard errors."""
        return abs(self.value - value) / max(self.error, 1e-300)


def fit_of_run(record: RunRecord, scenario: Scenario) -> Fit:
    """Return what the assumed model does not explain in a run.

    Filters of labelled tracks are needed; for others, and for runs of one scan, nothing is searched. Raises
    `VedetteError` for scans that cannot be read or drawn again.
    """
    if record.num_scans < 2 or not any(each.labels.size for each in record.estimates):
        return Fit((), "nothing, as no track spans two scans")
    filters = [each.filter for each in build_sensors(scenario)]
    names = scenario.model.sensor_names
    models = tuple(each.sensor for each in filters)
    fits = sensor_fits(record, rows_of_record(record, scenario), models, filters[0].targets.motion)
    findings = [Finding("agreement", "", text) for text in disagreement_warnings(record, scenario)]
    for name, fit, model in zip(names, fits, models, strict=True):
        findings += (Finding(test, name, f"{name}: {text}") for test, text in _of_sensor(fit, model, len(names)))
    findings += (Finding("fast targets", "", text) for text in unexplained_course_warnings(record, scenario))
    findings += _stationary_findings(scenario)
    num = sum(len(fit.matches) for fit in fits)
    tests = "bias, noise, motion, detection, several returns, clutter"
    if scenario.model.recording is not None:
        tests += ", agreement of sensors, fast targets, stationary echoes"
    return Fit(tuple(findings), f"{tests} ({num} pairs of a track and a scan)")


def _stationary_findings(scenario: Scenario) -> Iterator[Finding]:
    """Yield findings of places that a sensor measures all through a recording."""
    model = scenario.model
    if model.recording is None:
        return
    recording = model.recording.build(model, scenario.folder)
    for s, (site, own) in enumerate(zip(recorded_sensors(model), returns_models(model), strict=True)):
        places, masks = stationary_places(recording, s, site, own)
        if len(places) >= _MANY_PLACES:
            num = sum(int(mask.sum()) for mask in masks) / len(masks)
            yield Finding(
                "stationary echoes",
                site.name,
                f"{site.name}: {len(places)} places give {num:.1f} measurements a scan all through the recording, as "
                "land, buoys and anchored ships do: `recording: {ignore: stationary}` leaves them out",
            )


def _of_sensor(fit: SensorFit, model: SensorModel, num_sensors: int) -> Iterator[tuple[str, str]]:
    """Yield the findings of a sensor as test and text."""
    if components := model.measurement.components:
        yield from _innovation_findings(fit, components, num_sensors)
    yield from _detection_findings(fit)
    yield from _clutter_findings(fit, model.clutter.rate)


def _innovation_findings(fit: SensorFit, components: Sequence[str], num_sensors: int) -> Iterator[tuple[str, str]]:
    """Yield findings of bias, noise and motion, one for each component at most."""
    tracks = [[each for each in track if each.innovation is not None] for track in by_label(fit.matches)]
    for i, (name, noise) in enumerate(zip(components, fit.noise_stds, strict=True)):
        quantity = QUANTITIES[name]
        own = [np.array([_component(each, i) for each in track]).reshape(-1, 2) for track in tracks]
        mean, squares = _mean([each[:, 0] for each in own]), _mean([each[:, 0] ** 2 / each[:, 1] for each in own])
        spread = math.sqrt(squares.value)
        lag = _mean([each[1:, 0] * each[:-1, 0] / each[1:, 1] for each in own])
        if num_sensors > 1 and mean.away_from(0.0) > _SURE and abs(mean.value) > _LEAST_BIAS * noise:
            yield (
                "bias",
                f"{_plural(name)} are {_signed(name, mean.value)} off its tracks ({mean.away_from(0.0):.0f} standard "
                "errors): `vedette track --calibrate` estimates it",
            )
        elif squares.away_from(1.0) <= _SURE or _SPREADS[0] <= spread <= _SPREADS[1]:
            continue
        elif lag.value > 0.3 * squares.value and lag.away_from(0.0) > _SURE and spread > 1.0:
            yield (
                "motion",
                f"errors of {_plural(name)} continue from scan to scan (correlation {lag.value / squares.value:.1f}): "
                "targets turn or accelerate more than `motion` assumes: raise its noise, or `--max-target-speed`",
            )
        else:
            yield (
                "noise",
                f"{_plural(name)} spread {_with_two_digits(spread)} times as much about its tracks as noise and motion "
                f"explain (noise {_with_two_digits(noise * quantity.per_si)} {quantity.unit}): `vedette "
                "track --calibrate` estimates it",
            )


def _component(match: Match, i: int) -> tuple[float, float]:
    assert match.innovation is not None
    return float(match.innovation[i]), float(match.cov[i, i])


def _detection_findings(fit: SensorFit) -> Iterator[tuple[str, str]]:
    """Yield findings of the probability of detection and of several measurements of a target."""
    tracks = [track[_EDGE:-_EDGE] for track in by_label(fit.matches) if len(track) > 4 * _EDGE]
    likely = [
        np.array([1.0 - (1.0 - each.probability) * math.exp(-each.by_chance) for each in track]) for track in tracks
    ]
    made = [np.array([each.num_inside > 0 for each in track], float) for track in tracks]
    excess = _mean([a - b for a, b in zip(made, likely, strict=True)])
    if abs(excess.value) > _LEAST_DIFFERENCE and excess.away_from(0.0) > _SURE:
        assumed = _mean(likely).value
        yield (
            "detection",
            f"detects its tracks in {assumed + excess.value:.0%} of scans where {assumed:.0%} is assumed: `vedette "
            "track --calibrate` estimates it",
        )
    more = _mean(
        [
            np.array([max(each.num_inside - 1, 0) - each.probability * each.by_chance for each in track], float)
            for track in tracks
        ]
    )
    if more.value > _RETURNS and more.away_from(0.0) > _SURE:
        yield (
            "several returns",
            f"tracks have {more.value:.1f} further measurements a scan beside them, more than clutter explains: if a "
            "target gives several returns, give the sensor its `extent` in m",
        )


def _clutter_findings(fit: SensorFit, rate: float) -> Iterator[tuple[str, str]]:
    """Yield a finding of the number of measurements that no track explains."""
    expected, found = rate * fit.num_scans, fit.unexplained
    error = math.sqrt(max(expected, 1.0))
    least = max(_LEAST_EXCESS * expected, _LEAST_EXCESS * fit.num_scans)
    if abs(found - expected) > max(least, _SURE * error):
        yield (
            "clutter",
            f"{found / fit.num_scans:.2g} measurements a scan lie beside all tracks, where clutter of {rate:.2g} is "
            "assumed: `vedette track --calibrate` estimates it",
        )


def _mean(tracks: Sequence[Floats]) -> _Mean:
    """Return the mean of all values, with an error from blocks of successive values of a track; infinite for few."""
    blocks = [block for each in tracks for block in np.split(each, range(_BLOCK, len(each), _BLOCK)) if len(block)]
    if len(blocks) < _MIN_BLOCKS:
        return _Mean(0.0, math.inf)
    sums, sizes = np.array([block.sum() for block in blocks]), np.array([len(block) for block in blocks])
    mean = float(sums.sum() / sizes.sum())
    residuals = sums - mean * sizes
    variance = float((residuals**2).sum()) * len(blocks) / (len(blocks) - 1)
    return _Mean(mean, math.sqrt(variance) / float(sizes.sum()))


def _plural(name: str) -> str:
    """Return the plural of a quantity: bearings, range rates, positions x."""
    return f"positions {name}" if name in ("x", "y") else f"{name.replace('_', ' ')}s"


def _with_two_digits(value: float) -> str:
    """Return a positive number with two significant digits or more, and without an exponent: `1.0`, `0.021`, `120`."""
    return f"{value:.{max(0, 1 - math.floor(math.log10(max(value, 1e-9))))}f}"


def _signed(name: str, value: float) -> str:
    """Return a difference in the unit of files with its direction: `1.0 deg clockwise`."""
    quantity = QUANTITIES[name]
    size = f"{_with_two_digits(abs(value) * quantity.per_si)} {quantity.unit}"
    if name == "bearing":
        return f"{size} {'anticlockwise' if value > 0.0 else 'clockwise'}"
    return f"{size} {'more' if value > 0.0 else 'less'}"
