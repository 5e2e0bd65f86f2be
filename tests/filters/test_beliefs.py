"""Whether beliefs are true, and how that is measured (`benchmarks/beliefs.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np
import pytest
from beliefs import main
from places import expected_in_cells, gaussians_in_cells, true_in_cells, undetected_in_cells
from prior_targets import Names, PriorTargets
from random_scenes import four_sites, random_scene
from scenes import own, site
from scipy.stats import multivariate_normal

from calibration import ENOUGH, EXISTENCES, NUMBERS, Bins, Calibration, Case, binned, calibration, cases
from vedette.densities import (
    LMB,
    IidCluster,
    MultiBernoulli,
    Poisson,
    UndetectedIntensity,
    UndetectedTargets,
    existence_probabilities,
)
from vedette.filters import Limits
from vedette.models import BirthModel, CellGrid, Region, TargetModel, constant_survival, constant_velocity
from vedette.scenarios import replace_fields
from vedette.scenarios.build import build_experiment
from vedette.simulation import CLUTTER, Scan, SimulationRun

CASES = {case.name: case for case in cases()}
UNLIMITED = {name: min(value, 10**9) for name, value in asdict(Limits.none()).items() if name != "max_position_std"}
EXACT = Case(
    "exact", {"filter.kind": "delta_glmb"} | {f"filter.limits.{name}": value for name, value in UNLIMITED.items()}
)
GRID = CellGrid(Region(-500.0, 500.0, -400.0, 400.0), 5, 4)
NUM_DRAWS = 800
COV = np.diag([100.0, 100.0, 4.0, 4.0])


def label_bins(believed, found, values_a_run) -> Bins:
    """Of (num_runs,) existences, each believed so many times in its run, and whether their targets exist."""
    values = np.column_stack([believed, found])
    return Bins(EXISTENCES, values_a_run * np.array([binned(EXISTENCES, *row[:, None]) for row in values]))


def test_bins_hold_believed_and_true_means() -> None:
    bins = label_bins([0.6] * 40 + [0.95] * 30, [1.0] * 10 + [0.0] * 30 + [1.0] * 30, 25)
    rows = bins.rows()
    # By hand: 0.4 too little in ten runs and 0.6 too much in thirty, 25 values each; the runs are independent.
    excess = 25.0 * np.array([0.4] * 10 + [-0.6] * 30 + [0.0] * 30)
    error = np.sqrt(70.0 * excess.var(ddof=1)) / 1000.0
    np.testing.assert_allclose(rows[3], [1000, 0.6, 0.25, error])
    np.testing.assert_allclose(rows[5, :3], [750, 0.95, 1.0])
    assert np.isnan(rows[0, 1:3]).all()
    assert bins.worst == pytest.approx((0.35, error))
    assert bins.verdict == "fail"


def test_bins_of_few_values_are_not_judged() -> None:
    few = label_bins([0.6] * 20, [0.0] * 20, ENOUGH // 20)
    assert np.isnan(few.worst[0])
    assert few.verdict == "pass"
    assert label_bins([0.6] * 20, [0.0] * 20, ENOUGH // 20 + 1).verdict == "fail"
    assert label_bins([0.6] * 20, [1.0, 0.0] * 10, 100).verdict == "unclear"


def test_ranks_are_compared_with_the_uniform_distribution() -> None:
    places = Bins(NUMBERS, np.zeros((4, len(NUMBERS) - 1, 3)))
    numbers = np.zeros((4, 25, 4))
    numbers[:, :, 0] = ((np.arange(100.0) + 0.5) / 100.0).reshape(4, 25)
    even = Calibration(None, places, numbers, 0.0)
    assert even.rank_deviation == pytest.approx(0.005)
    assert replace(even, numbers=np.full((4, 25, 4), 0.7)).rank_deviation == pytest.approx(0.7)


def test_the_truth_is_drawn_from_the_model() -> None:
    means = np.array([[0.0, 0.0, 0.0, 0.0], [1e4, 0.0, 0.0, 0.0]])
    birth = BirthModel(np.array([0.1, 0.4]), means, np.stack([COV, COV]), period=2.0)
    model = TargetModel(constant_velocity(2.0), constant_survival(0.8, period=0.5), birth)
    targets, rng = PriorTargets(model), np.random.default_rng(3)
    born, lived, starts, moves = [], [], [], []
    for _ in range(400):
        truth = targets.truth(np.arange(10.0, 12.5, 0.5), rng=rng)
        truth.validate()
        for scan in range(5):
            ids, states = truth.at(scan)
            new = ids // 2 == scan
            born.append((scan == 0, *np.bincount(ids[new] % 2, minlength=2)))
            starts.append(states[new] - means[ids[new] % 2])
            if scan:
                before, states_before = truth.at(scan - 1)
                assert np.isin(ids[~new], before).all()
                lived.append(np.isin(before, ids))
                moves.append(states[~new] - model.motion.propagate(states_before[np.isin(before, ids)], 0.5))
    first, *counts = np.array(born).T
    for count, chance in zip(counts, birth.existence, strict=True):
        assert count[first == 1].mean() == pytest.approx(chance, abs=0.06)  # one period
        assert count[first == 0].mean() == pytest.approx(1.0 - (1.0 - chance) ** 0.25, abs=0.03)
    assert np.concatenate(lived).mean() == pytest.approx(0.8, abs=0.03)
    np.testing.assert_allclose(np.concatenate(starts).std(axis=0), [10.0, 10.0, 2.0, 2.0], rtol=0.1)
    noise = model.motion.noise_covs(np.zeros((1, 4)), 0.5)[0]
    np.testing.assert_allclose(np.cov(np.concatenate(moves).T), noise, atol=0.1)


class Undetected(LMB):
    """A belief with an intensity of undetected targets."""

    __slots__ = ()
    undetected = Poisson.empty(4)


def belief_of(kind: type[LMB], existence: dict[tuple[int, int], float]) -> LMB:
    means, covs = np.zeros((len(existence), 4)), np.tile(COV, (len(existence), 1, 1))
    return kind.from_bernoullis(list(existence), list(existence.values()), means, covs)


def two_sites(*steps: int) -> BirthModel:
    return BirthModel(np.full(2, 0.1), np.zeros((2, 4)), np.tile(COV, (2, 1, 1)), frozenset(steps) or None)


def scan_of(*origins: int) -> Scan:
    return Scan(np.zeros((len(origins), 2)), np.array(origins, np.int64))


def test_labels_of_sites_are_the_targets_born_there() -> None:
    names = Names(two_sites(1, 3))
    for step in (1, 2, 3):
        names.take(step, (scan_of(),))
    # Four labels are possible; of the targets (1, 0), (1, 1) and (3, 1), the second is dead and the last not in it.
    believed, found = names.label_scores(belief_of(LMB, {(1, 0): 0.7, (1, 1): 0.2}), np.array([0, 5]))
    np.testing.assert_allclose(believed, [0.7, 0.2, 0.0, 0.0])
    np.testing.assert_allclose(found, [1.0, 0.0, 1.0, 0.0])


def test_first_detections_are_labels_of_measurements() -> None:
    names = Names(two_sites())
    names.take(1, (scan_of(CLUTTER, 1), None, scan_of(1, 0)))  # first of targets 1 and 0: rows 1 and 3
    names.take(2, (scan_of(0, 2), None, scan_of(CLUTTER)))
    labels = {(1, 3): 0.9, (1, 4): 0.1, (1, 5): 0.8, (2, 3): 0.6}
    believed, found = names.label_scores(belief_of(Undetected, labels), np.array([0, 1, 2]))
    np.testing.assert_allclose(believed, [0.9, 0.1, 0.8, 0.6, 0.0, 0.0, 0.0])  # seven measurements
    np.testing.assert_allclose(found, [1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    # Target 0 is dead, and the one of (2, 3) has not been kept.
    del labels[(2, 3)]
    _, found = names.label_scores(belief_of(Undetected, labels), np.array([1, 2]))
    np.testing.assert_allclose(found, [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    # A target that the belief names by its site is not named by its first detection.
    _, found = names.label_scores(belief_of(Undetected, {(1, 1): 0.5, (1, 3): 0.5}), np.array([1]))
    np.testing.assert_allclose(found, [1.0, 0.0, *[0.0] * 6])


def test_the_mass_of_gaussians_in_cells_is_that_of_the_normal_distribution() -> None:
    covs = np.array([[[90.0**2, s * 0.9 * 9000.0], [s * 0.9 * 9000.0, 100.0**2]] for s in (1.0, -1.0, 0.0)])
    means, weights = np.array([[30.0, -50.0], [-200.0, 120.0], [480.0, 0.0]]), np.array([0.5, 2.0, 1.0])
    x, y = np.linspace(-500.0, 500.0, 6), np.linspace(-400.0, 400.0, 5)
    expected = np.zeros((4, 5))
    for weight, mean, cov in zip(weights, means, covs, strict=True):
        below = multivariate_normal(mean, cov).cdf(np.stack(np.meshgrid(x, y), axis=-1))
        expected += weight * np.diff(np.diff(below, axis=0), axis=1)
    states = np.hstack([means, np.zeros((3, 2))])
    whole = np.tile(COV, (3, 1, 1))
    whole[:, :2, :2] = covs
    np.testing.assert_allclose(gaussians_in_cells(weights, states, whole, GRID), expected.ravel(), atol=2e-3)


def test_numbers_in_cells_are_those_of_any_density() -> None:
    means, covs = np.array([[-400.0, -300.0, 0.0, 0.0], [0.0, 100.0, 0.0, 0.0]]), np.stack([COV, COV])
    found = {
        "LMB": LMB.from_bernoullis([[1, 0], [1, 1]], [0.5, 0.25], means, covs),
        "multi-Bernoulli": MultiBernoulli.from_gaussians([0.5, 0.25], means, covs),
        "Poisson": Poisson.from_gaussians([0.5, 0.25], means, covs),
        "cluster": IidCluster.from_gaussians([0.25, 0.75], [2.0 / 3.0, 1.0 / 3.0], means, covs),
    }
    for density in found.values():
        numbers = expected_in_cells(density, GRID).reshape(4, 5)
        assert numbers[0, 0] == pytest.approx(0.5)
        assert numbers[2, 2] == pytest.approx(0.25)
        assert numbers.sum() == pytest.approx(0.75)
    states = np.array([[-400.0, -300.0], [0.0, 100.0], [0.0, 101.0], [600.0, 0.0]])
    np.testing.assert_array_equal(np.flatnonzero(true_in_cells(states, GRID)), [0, 12])
    assert true_in_cells(states, GRID).sum() == 3.0


def test_undetected_targets_are_spread_over_cells() -> None:
    own_cells = CellGrid(Region(-500.0, 500.0, -400.0, 600.0), 2, 2)  # 500 m by 500 m
    numbers = undetected_in_cells(UndetectedIntensity(own_cells, np.array([1.0, 0.0, 0.0, 3.0])), GRID).reshape(4, 5)
    np.testing.assert_allclose(numbers[0], [0.16, 0.16, 0.08, 0.0, 0.0])
    np.testing.assert_allclose(numbers[3], [0.0, 0.0, 0.24, 0.48, 0.48])
    np.testing.assert_allclose(numbers[2], [0.08, 0.08, 0.04 + 0.12, 0.24, 0.24])
    gaussian = UndetectedTargets(Poisson.from_gaussians([0.3], [[0.0, 100.0, 0.0, 0.0]], [COV]), (0, 0))
    assert undetected_in_cells(gaussian, GRID)[12] == pytest.approx(0.3)


def test_scenes_are_drawn_by_number() -> None:
    models = [random_scene(number).scenario(0).model for number in range(1, 41)]
    assert [random_scene(number).scenario(0).model for number in (7, 40)] == [models[6], models[39]]
    sensors = [sensor for model in models for sensor in model.sensors]
    assert {len(model.sensors) for model in models} == {1, 2, 3}
    assert {sensor.measurement.kind for sensor in sensors} == {"position", "bearing_range"}
    assert {sensor.detection.kind for sensor in sensors} == {"constant", "limited_range", "limited_sector"}
    assert all(0.4 <= sensor.detection.probability <= 0.98 for sensor in sensors)
    assert all(1.0 <= sensor.clutter.rate <= 60.0 for sensor in sensors)
    existences = [born.existence for model in models for born in model.birth.sites]
    assert min(existences) >= 0.003
    assert max(existences) <= 0.2
    assert {1.0, 0.05} <= {model.time.step_period for model in models}
    assert {None, 1.0} == {model.birth.period for model in models}


def test_one_site_and_one_scan_have_the_posterior_in_closed_form() -> None:
    r, detection, clutter, std = 0.4, 0.6, 20.0, 30.0
    fields = {"time.num_steps": 1, "birth.sites": [site((20.0, 30.0), std, r)]}
    fields |= {"sensors.*.detection.probability": detection, "sensors.*.clutter.rate": clutter}
    scene = own("one site", fields)
    experiment = build_experiment(replace_fields(scene.scenario(0), EXACT.fields))
    experiment = replace(experiment, targets=PriorTargets(experiment.tracker.targets))
    predicted = multivariate_normal([20.0, 30.0], (std**2 + 10.0**2) * np.eye(2))
    for run in range(20):
        moment = SimulationRun(experiment, seed=1, run=run).step()
        ratios = detection * predicted.pdf(moment.measurements[0]) / (clutter / 1e6)
        odds = r / (1.0 - r) * (1.0 - detection + np.sum(ratios))
        labels, existence = existence_probabilities(moment.state.fused)
        assert labels.tolist() == [[1, 0]]
        assert existence[0] == pytest.approx(odds / (1.0 + odds), rel=1e-6)
    assert_calibrated(calibration(scene, EXACT, [1], NUM_DRAWS), allowed=0.0, errors=4.0)


@pytest.mark.parametrize(("num_steps", "runs"), [(2, 600), pytest.param(3, 1000, marks=pytest.mark.slow)])
def test_the_exact_filter_is_calibrated(num_steps: int, runs: int) -> None:
    fields = {
        "time": {"num_steps": num_steps, "step_period": 0.5, "start": 1.0},
        "survival.probability": 0.8,
        "birth.sites": [site((0.0, 0.0), 20.0, 0.3), site((25.0, 0.0), 20.0, 0.2)],
        "birth.period": 1.0,
        "sensors.*.detection.probability": 0.6,
        "sensors.*.clutter.rate": 0.5,
    }
    found = calibration(own("two sites", fields), EXACT, [1], runs)
    assert_calibrated(found, allowed=0.0, errors=4.0)
    assert abs(found.bias) < 4.0 * found.rms_error / np.sqrt(runs)
    assert found.rank_deviation < 0.04


@pytest.mark.parametrize("number", [1, 3, 5])
def test_beliefs_of_the_default_filter_are_not_grossly_untrue(number: int) -> None:
    found = calibration(random_scene(number), CASES["default"], [1, 2], 15)
    assert_calibrated(found, allowed=0.05, errors=3.0)
    assert found.rank_deviation < 0.25
    assert abs(found.bias) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("detection", [0.7, 0.95])
def test_beliefs_of_the_default_filter_are_true_of_four_sites(detection: float) -> None:
    found = calibration(four_sites(detection), CASES["default"], [1], 200)
    assert_calibrated(found, allowed=0.05, errors=2.0)
    assert found.rank_deviation < 0.06


def first_detections(scans: Sequence[Scan], r: float, detection: float, intensity: float) -> list[float]:
    """Posterior that each measurement of two sensors is a target's first; prior std 30 m, noise 10 m."""
    alone = multivariate_normal([0.0, 0.0], 1000.0 * np.eye(2))
    both = multivariate_normal(np.zeros(4), np.kron([[1000.0, 900.0], [900.0, 1000.0]], np.eye(2)))
    first, second = (detection * alone.pdf(scan.measurements.reshape(-1, 2)) / intensity for scan in scans)
    first, second = np.atleast_1d(first), np.atleast_1d(second)
    pairs = np.array([[np.concatenate([a, b]) for b in scans[1].measurements] for a in scans[0].measurements])
    joint = np.zeros((len(first), len(second)))
    if joint.size:
        joint[:] = (detection / intensity) ** 2 * both.pdf(pairs).reshape(joint.shape)
    missed = 1.0 - detection
    weights = r * np.concatenate([first * missed + joint.sum(axis=1), second * missed])
    return list(weights / (1.0 - r + r * missed**2 + weights.sum()))


def test_first_detections_of_two_sensors_exist_as_often_as_their_posterior_says() -> None:
    r, detection, clutter = 0.5, 0.6, 12.0
    fields = {"time.num_steps": 1, "birth.sites": [site((0.0, 0.0), 30.0, r)]}
    fields |= {"sensors.*.detection.probability": detection, "sensors.*.clutter.rate": clutter}
    experiment = build_experiment(own("one site", fields, 2, {"kind": "sequential"}).scenario(0))
    experiment = replace(experiment, targets=PriorTargets(experiment.tracker.targets))
    sums, num_first = [], 0
    for run in range(NUM_DRAWS):
        world = SimulationRun(experiment, seed=1, run=run)
        scans = [scan for scan in world.step().scans if scan is not None]
        names = Names(experiment.tracker.targets.birth)
        names.take(1, scans)
        existence = first_detections(scans, r, detection, clutter / 1e6)
        belief = belief_of(Undetected, {(1, 1 + row): chance for row, chance in enumerate(existence)})
        sums.append(binned(EXISTENCES, *names.label_scores(belief, world.truth.at(0)[0])))
        num_first += len(names.first)
    assert num_first / NUM_DRAWS == pytest.approx(r * (1.0 - (1.0 - detection) ** 2), abs=0.05)
    number, believed, true, error = Bins(EXISTENCES, np.array(sums)).rows().T
    assert (number[[0, 2, 3]] > 100).all()
    assert (np.abs(believed - true)[number > 100] < 4.0 * error[number > 100]).all()


def assert_calibrated(found: Calibration, allowed: float, errors: float) -> None:
    """No mean of a bin is wrong by more than `allowed` and a number of standard errors, but for rounding."""
    for bins in (found.labels, found.places):
        if bins is not None:
            number, believed, true, error = bins.rows()[bins.rows()[:, 0] > ENOUGH].T
            # A bin where no run has a target has an error of 0; one more target would not have been surprising.
            excess = np.abs(believed - true) - errors * np.maximum(error, 1.0 / number)
            assert (excess <= allowed).all(), f"believed {believed.round(3)}, true {true.round(3)}"


def test_a_table_is_written_into_a_page(tmp_path, capsys) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- from benchmarks/beliefs.py -->\n<!-- to here -->\nafter\n", encoding="utf-8")
    main(["--scene", "6", "--seeds", "1", "--runs", "1", "--filters", "LMB", "CPHD", "--bins", "--write", str(page)])
    text, printed = page.read_text(encoding="utf-8"), capsys.readouterr().out
    rows = [line for line in text.splitlines() if line.startswith("| 6: overlapping, 10/s, 1 sensor | ")]
    assert [row.split(" | ")[1] for row in rows] == ["LMB", "CPHD"]
    assert all(row in printed for row in rows)
    assert "| LMB | " in text
    assert text.endswith("<!-- to here -->\nafter\n")
    with pytest.raises(SystemExit, match=r"expected some of default, LMB, .*; got glmb"):
        main(["--filters", "glmb"])


@pytest.mark.slow
@pytest.mark.parametrize("num_sensors", [1, 2])
def test_every_case_can_be_asked(num_sensors: int) -> None:
    scene = four_sites(0.9, num_sensors)
    for case in CASES.values():
        if case.fits(scene):
            found = calibration(scene, case, [1], 1)
            assert (found.labels is not None) == case.has_labels
            assert ((found.numbers[:, :, 0] >= 0.0) & (found.numbers[:, :, 0] <= 1.0 + 1e-9)).all()
            assert np.isfinite(found.numbers).all()


def test_beliefs_that_are_grossly_untrue_fail() -> None:
    hasty = Case("hasty", {"filter.kind": "delta_glmb", "filter.limits.max_hypotheses": 3})
    found = calibration(four_sites(0.7), hasty, [1], 40)
    assert found.verdict == "fail"
    with pytest.raises(AssertionError, match="believed"):
        assert_calibrated(found, allowed=0.05, errors=3.0)
