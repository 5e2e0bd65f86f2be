"""Fit of the assumed model to a run: tests of each sensor against the tracks, without the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vedette.evaluation.block_means import BLOCK, SURE, blocks, mean_of
from vedette.evaluation.fit_by_place import LEAST_EXCESS, clutter_by_place, detection_by_place
from vedette.evaluation.innovations import Assumed, Compared, Instant, Matches, SensorFit, compared, joined
from vedette.evaluation.manoeuvres import manoeuvre_warnings
from vedette.evaluation.scan_periods import period_findings
from vedette.evaluation.scans import rows_of_record
from vedette.evaluation.sensor_agreement import disagreement_warnings
from vedette.evaluation.unexplained_courses import unexplained_course_warnings
from vedette.internal.quantities import QUANTITIES
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Ints
from vedette.recorded.stationary import stationary_places
from vedette.scenarios import Scenario
from vedette.scenarios.recorded_data import recorded_scans, recorded_sensors, returns_models
from vedette.simulation.records import RunRecord

NOTHING = "nothing, as no track spans two scans"
_TESTS = (
    "bias, noise, motion, manoeuvres, detection and clutter, both also by place, several returns, periods, agreement "
    "of sensors, fast targets"
)
_MOST_SCANS, _STRETCH = 5000, 100  # that are looked at, in stretches of successive ones
_LEAST_BIAS = 0.25  # of the noise's standard deviation; smaller ones cost no accuracy
_SPREADS = (0.6, 1.5)  # of the assumed standard deviation; no finding within them
_LEAST_DIFFERENCE = 0.1  # of the share of detected targets
_BY_CHANCE = 0.01  # highest probability of a finding of manoeuvres in a run without any
_RETURNS = 0.5  # further measurements of a target in a scan; two targets that cross slowly have some, too
_MANY_PLACES = 5  # stationary places; fewer may be targets at rest
_EDGE = 3  # matches at each end of a track, which depend on what was detected


class Finding(NamedTuple):
    """A fault of the assumed model."""

    test: str  # name of the test
    sensor: str  # its name, or `` for several
    text: str  # sentence with the number and the cure


class Fit(NamedTuple):
    """Findings of a run, and what was searched: the tests with the number of matches of each."""

    findings: tuple[Finding, ...]
    searched: str

    def to_dict(self) -> dict[str, Any]:
        """Return the fit as plain data."""
        return {"findings": [each._asdict() for each in self.findings], "searched": self.searched}

    @classmethod
    def from_dict(cls, data: Any) -> Fit | None:
        """Return the fit of plain data, or None if there is none, as in runs of simulated scans."""
        if not isinstance(data, Mapping):
            return None
        return cls(tuple(Finding(**each) for each in data["findings"]), data["searched"])

    def lines(self, num_warnings: int = 0) -> list[str]:
        """Return the texts of the findings, or without any, one line that names the tests.

        num_warnings: warnings of the scenario that were shown. Then nothing is called faultless.
        """
        if self.findings:
            return [each.text for each in self.findings]
        if num_warnings:
            return [f"nothing beside {pluralise(num_warnings, 'warning')} found; searched: {self.searched}"]
        return [f"no fault found; searched: {self.searched}"]


def fit_of_run(record: RunRecord, scenario: Scenario) -> Fit:
    """Return what the assumed model does not explain in a run.

    Filters of labelled tracks are needed. For others, and for runs of one scan, nothing is searched. Of a long run
    stretches of successive scans are looked at. Raises `VedetteError` for scans that cannot be read or drawn again.
    """
    rows, assumed = rows_of_record(record, scenario), Assumed.of(scenario)
    instants = list(map(Instant, record.times.tolist(), record.poses, rows, record.estimates))
    part = 1 + (len(instants) - 1) // _MOST_SCANS
    pairs = (pair for k, pair in enumerate(pairwise(instants)) if k // _STRETCH % part == 0)
    times = [record.times[[instant[s] is not None for instant in rows]] for s in range(record.num_sensors)]
    fit = fit_of([compared(*pair, assumed) for pair in pairs], assumed, times)
    if scenario.model.recording is None:
        return fit
    return Fit((*fit.findings, *_stationary_findings(scenario)), f"stationary echoes, {fit.searched}")


def fit_of(instants: Sequence[Compared], assumed: Assumed, times: Sequence[ArrayLike] | None = None) -> Fit:
    """Return what the assumed model does not explain in some instants, in order of time.

    times: of all scans of each sensor in a run, s. None: the instants are a window of the latest scans.
    """
    if not any(len(each.labels) for each in instants):
        return Fit((), NOTHING)
    names, kinds = assumed.scenario.model.sensor_names, [x.measurement.kind for x in assumed.scenario.model.sensors]
    findings, num = [Finding("agreement", "", text) for text in disagreement_warnings(instants, names, kinds)], 0
    for s, name in enumerate(names):
        if fits := [fit for each in instants if (fit := each.fits[s]) is not None]:
            fit = joined(fits)
            num += len(fit.matches.labels)
            findings += (Finding(test, name, f"{name}: {text}") for test, text in _of_sensor(fit, s, assumed))
    if {"agreement", "bias"}.isdisjoint(each.test for each in findings):  # which move tracks from sensor to sensor
        level = _BY_CHANCE if times is not None else 0.1 * _BY_CHANCE  # streams are tested again and again
        findings += (Finding("manoeuvres", "", text) for text in manoeuvre_warnings(instants, assumed, level))
    findings += (Finding("fast targets", "", text) for text in unexplained_course_warnings(instants, assumed))
    scanned = times or [[each.time for each in instants if each.fits[s] is not None] for s in range(len(names))]
    findings += (Finding("period", *each) for each in period_findings(scanned, names, from_start=times is not None))
    return Fit(tuple(findings), f"{_TESTS} ({num} pairs of a track and a scan)")


def _stationary_findings(scenario: Scenario) -> Iterator[Finding]:
    """Yield findings of places that a sensor measures all through a recording."""
    model = scenario.model
    recording = recorded_scans(model, scenario.folder)
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


def _of_sensor(fit: SensorFit, s: int, assumed: Assumed) -> Iterator[tuple[str, str]]:
    """Yield the findings of a sensor as test and text."""
    tracks, model, compass = fit.matches.by_label(), assumed.sensors[s], assumed.scenario.model.by_compass
    if components := model.measurement.components:
        yield from _innovation_findings(fit, tracks, components, len(assumed.sensors))
    yield from _detection_finding(fit.matches, tracks, compass)
    yield from _returns_finding(fit)
    if (text := clutter_by_place(fit, model, assumed.motion.state_dim, compass)) is not None:
        yield "clutter by place", text
    else:
        yield from _clutter_finding(fit, model.clutter.rate)


def _innovation_findings(
    fit: SensorFit, tracks: Sequence[Ints], components: Sequence[str], num_sensors: int
) -> Iterator[tuple[str, str]]:
    """Yield findings of bias, noise and motion, one for each component at most."""
    measured = [track[~np.isnan(fit.matches.innovations[track, 0])] for track in tracks]
    for i, (name, noise) in enumerate(zip(components, fit.noise_stds.tolist(), strict=True)):
        quantity = QUANTITIES[name]
        own = [(fit.matches.innovations[track, i], fit.matches.variances[track, i]) for track in measured]
        mean = mean_of(blocks([errors for errors, _ in own]), drifts=True)
        squares = mean_of(blocks([errors**2 / variances for errors, variances in own]))
        spread = math.sqrt(squares.value)
        lag = mean_of(blocks([errors[1:] * errors[:-1] / variances[1:] for errors, variances in own]))
        if num_sensors > 1 and mean.is_surely(0.0, _LEAST_BIAS * noise):
            yield (
                "bias",
                f"{_plural(name)} are {_signed(name, mean.value)} off its tracks ({mean.away_from(0.0):.0f} standard "
                "errors): `vedette track --calibrate` estimates it",
            )
        elif not squares.is_surely(1.0, 0.0) or _SPREADS[0] <= spread <= _SPREADS[1]:
            continue
        elif lag.is_surely(0.0, 0.0) and lag.value > 0.3 * squares.value and spread > 1.0:
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


def _detection_finding(matches: Matches, tracks: Sequence[Ints], compass: bool) -> Iterator[tuple[str, str]]:
    """Yield a finding of the probability of detection, or of the place where it differs."""
    inner = [track[_EDGE:-_EDGE] for track in tracks if len(track) > 4 * _EDGE]
    chances = 1.0 - (1.0 - matches.probabilities) * np.exp(-matches.by_chance)
    columns = chances, 1.0 * (matches.numbers > 0), *matches.offsets.T
    likely, made, *offsets = (blocks([column[track] for track in inner]) for column in columns)
    excess = mean_of(np.column_stack([made[:, 0] - likely[:, 0], made[:, 1]]))
    means = np.column_stack([each[:, 0] / each[:, 1] for each in offsets])
    if (text := detection_by_place(means, made, likely, compass)) is not None:
        yield "detection by place", text
    elif excess.is_surely(0.0, _LEAST_DIFFERENCE):
        assumed = mean_of(likely).value
        yield (
            "detection",
            f"detects its tracks in {assumed + excess.value:.0%} of scans where {assumed:.0%} is assumed: `vedette "
            "track --calibrate` estimates it",
        )


def _returns_finding(fit: SensorFit) -> Iterator[tuple[str, str]]:
    """Yield a finding of several measurements of a target, which may have several tracks."""
    further = mean_of(np.add.reduceat(fit.further, np.arange(0, len(fit.further), BLOCK), axis=0))
    if further.value > 0.0 and further.is_surely(0.0, _RETURNS):
        yield (
            "several returns",
            f"targets have {further.value:.1f} further measurements a scan beside them, more than clutter explains: if "
            "a target gives several returns, give the sensor its `extent` in m",
        )


def _clutter_finding(fit: SensorFit, rate: float) -> Iterator[tuple[str, str]]:
    """Yield a finding of the number of measurements that no track explains."""
    num_scans, found = len(fit.counts), int(fit.counts.sum())
    expected = rate * num_scans
    least = LEAST_EXCESS * max(expected, num_scans)
    if abs(found - expected) > max(least, SURE * math.sqrt(max(expected, 1.0))):
        yield (
            "clutter",
            f"{found / num_scans:.2g} measurements a scan lie beside all tracks, where clutter of {rate:.2g} is "
            "assumed: `vedette track --calibrate` estimates it",
        )


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
