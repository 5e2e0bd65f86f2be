"""Radio networks: who hears whom; scans and beliefs that are lost or late; consensus."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tracking.scenes import assert_same_lmb, filters, lmb, rngs, scans_of, sensor, targets
from vedette.densities import LMB, FactoredGLMB, as_glmb
from vedette.errors import InputError
from vedette.filters import MultiSensorGlmbFilter, SequentialLmbFilter
from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb, FusionLimits, LabelMatchedFusion, ParallelUpdate
from vedette.fusion.rebasing import rebase, with_labels_of
from vedette.models import MeasurementBirth
from vedette.tracking import BeliefNetwork, Central, Distributed, Network, ScanNetwork, State, Tracker
from vedette.tracking.base import belief_bytes
from vedette.tracking.network import NEVER, belief_parts, hop_counts, message_bytes, metropolis_weights

EQUAL = (1 / 3, 1 / 3, 1 / 3)
MERGING = Clmb(EQUAL, field_of_view_weighting=True)
WORLD = targets()
SENSORS = tuple(sensor(std, prob, 0.5) for std, prob in ((5.0, 0.8), (8.0, 0.7), (4.0, 0.6)))
LINE = np.array([[0.0, 50.0, 0.0], [100.0, 50.0, 0.0], [200.0, 50.0, 0.0]])  # 100 m from each to the next
TRUTH = np.array([[3.0, -4.0, 2.0, 1.0], [95.0, 5.0, -1.0, 2.0]])


def follow(tracker: Any, num_steps: int = 6, hear: Any = None, poses: Any = LINE) -> list[State]:
    """The states after each step; the scans are the same for every tracker."""
    rng, state, states = np.random.default_rng(4), tracker.initial(), []
    assert isinstance(tracker, Tracker)
    for step in range(1, num_steps + 1):
        truth = TRUTH.copy()
        truth[:, :2] += step * truth[:, 2:]
        scans: Any = scans_of(truth, SENSORS, LINE, rng)
        at = poses(step) if callable(poses) else poses
        state, info = tracker.step(state, scans, at, float(step), rngs=rngs(3, step))
        assert len(info.bytes_sent) == 3
        states.append(state)
    return states


def scan_network(network: Network, kind: Any = SequentialLmbFilter) -> ScanNetwork:
    merging = MERGING if kind is SequentialLmbFilter else CmDeltaGlmb(EQUAL)
    return ScanNetwork(kind(WORLD, SENSORS), network, merging)


def belief_network(fusion: Any, network: Network) -> BeliefNetwork:
    return BeliefNetwork(filters(WORLD, SENSORS), fusion, network, MERGING)


def test_hop_counts_and_arrivals() -> None:
    network, rng = Network(radio_range=120.0, max_hops=1, delay=2), np.random.default_rng(0)
    links = network.links(LINE, rng)
    np.testing.assert_array_equal(links, [[0, 1, 0], [1, 0, 1], [0, 1, 0]])
    np.testing.assert_array_equal(hop_counts(links), [[0, 1, 2], [1, 0, 1], [2, 1, 0]])
    np.testing.assert_array_equal(network.arrivals(hop_counts(links), 7), [[7, 9, NEVER], [9, 7, 9], [NEVER, 9, 7]])
    np.testing.assert_array_equal(Network(120.0).arrivals(hop_counts(links), 7), np.full((3, 3), 7))
    apart = Network(90.0).links(LINE, rng)
    assert not apart.any()
    np.testing.assert_array_equal(hop_counts(apart), np.where(np.eye(3, dtype=bool), 0, NEVER))
    # Of one message each of 10, 20 and 30 bytes: with one hop each is sent by its source alone, with two by the middle
    # as well, and without any link by nobody.
    assert network.bytes_sent(hop_counts(links), [10, 20, 30]) == (10, 20, 30)
    assert Network(120.0, max_hops=2).bytes_sent(hop_counts(links), [10, 20, 30]) == (30, 60, 50)
    assert Network(90.0).bytes_sent(hop_counts(apart), [10, 20, 30]) == (0, 0, 0)
    assert Network(120.0, consensus_rounds=4).bytes_sent(hop_counts(links), [10, 20, 30]) == (120, 120, 120)


def test_links_fail_with_the_given_probability() -> None:
    network, rng = Network(link_loss_probability=0.3), np.random.default_rng(3)
    drawn = np.array([network.links(LINE, rng) for _ in range(4000)])
    assert (drawn == drawn.swapaxes(1, 2)).all()
    share = drawn[:, *np.triu_indices(3, 1)].mean()
    assert abs(share - 0.7) < 5.0 * math.sqrt(0.21 / 12000)


def test_metropolis_weights_keep_the_mean() -> None:
    links = np.array([[0, 1, 0, 0], [1, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 0]], np.bool_)
    weights = metropolis_weights(links)
    expected = np.array([[2, 1, 0, 0], [1, 1, 1, 0], [0, 1, 2, 0], [0, 0, 0, 3]]) / 3.0
    np.testing.assert_allclose(weights, expected, rtol=1e-15)
    limit = np.linalg.matrix_power(weights, 200)
    np.testing.assert_allclose(limit[:3, :3], 1 / 3, atol=1e-12)


@pytest.mark.parametrize("network", [Network(), Network(120.0), Network(max_hops=2)])
@pytest.mark.parametrize("kind", [SequentialLmbFilter, MultiSensorGlmbFilter])
def test_a_fully_connected_network_equals_the_central_filter(kind: Any, network: Network) -> None:
    central = follow(Central(kind(WORLD, SENSORS)))
    for state, expected in zip(follow(scan_network(network, kind)), central, strict=True):
        assert all(belief is state.fused for belief in state.local)
        np.testing.assert_array_equal(state.fused.tracks.means, expected.fused.tracks.means)


def test_late_scans_are_processed_at_their_own_time() -> None:
    """Each sensor's belief is that of a central filter that has heard what has reached it by then."""
    states = follow(scan_network(Network(120.0, delay=1)), num_steps=5)
    hops = hop_counts(Network(120.0).links(LINE, np.random.default_rng(0)))
    for now, state in enumerate(states, start=1):
        for i in range(3):
            central, belief, rng = SequentialLmbFilter(WORLD, SENSORS), None, np.random.default_rng(4)
            belief = central.initial()
            for step in range(1, now + 1):
                truth = TRUTH.copy()
                truth[:, :2] += step * truth[:, 2:]
                scans: Any = scans_of(truth, SENSORS, LINE, rng)
                heard = [scan if step + hops[i, j] <= now else None for j, scan in enumerate(scans)]
                belief, _ = central.step(belief, heard, LINE, 1.0, step, rng=rng)
            assert_same_lmb(state.local[i], belief, 1e-12)


def test_groups_that_meet_again_merge_their_beliefs() -> None:
    """Sensor 1 alone sees target 1, sensor 3 target 2; apart they know one each, together both."""
    near = tuple(sensor(3.0, 0.95, 0.1, max_range=120.0) for _ in range(3))
    poses = np.array([[0.0, 60.0, 0.0], [600.0, 600.0, 0.0], [100.0, -100.0, 0.0]])
    for tracker in (
        ScanNetwork(SequentialLmbFilter(WORLD, near), Network(50.0), MERGING),
        BeliefNetwork(filters(WORLD, near), ParallelUpdate(), Network(50.0), MERGING),
    ):
        rng, state = np.random.default_rng(2), tracker.initial()
        for step in range(1, 7):
            at = poses if step < 5 else poses * 0.2  # within 50 m... of each other but the second
            truth = TRUTH.copy()
            truth[:, :2] += step * truth[:, 2:]
            state, _ = tracker.step(state, scans_of(truth, near, at, rng), at, float(step), rngs=rngs(3))
            if step == 4:
                assert state.local[0] is not state.local[2]
                assert (state.fused.existence > 0.9).sum() == 2  # what is reported has both, whoever knows them
        assert state.local[0] is state.local[2] is not state.local[1]
        assert (state.local[0].existence > 0.9).sum() == 2


@pytest.mark.parametrize(
    "fusion", [ParallelUpdate(), Clmb(EQUAL), ArithmeticAverage(EQUAL, limits=FusionLimits(max_components=1))]
)
def test_consensus_converges_to_the_fusion_of_all_sensors(fusion: Any) -> None:
    """On a line of three, where two rounds reach everyone; the more rounds, the nearer, down to rounding."""
    central = follow(Distributed(filters(WORLD, SENSORS), fusion, feedback=True))
    errors = []
    for rounds in (2, 10, 80):
        states = follow(belief_network(fusion, Network(120.0, consensus_rounds=rounds)))
        error = 0.0
        for state, expected in zip(states, central, strict=True):
            for belief in state.local:
                np.testing.assert_array_equal(belief.tracks.labels, expected.fused.tracks.labels)
                error = max(error, np.abs(belief.existence - expected.fused.existence).max())
                error = max(error, np.abs(belief.tracks.means - expected.fused.tracks.means).max())
        errors.append(error)
    assert errors[0] > errors[1] > 1e-10 > errors[2]


@pytest.mark.parametrize("fusion", [ParallelUpdate(), Clmb(EQUAL)])
def test_a_fully_connected_belief_network_equals_the_distributed_tracker(fusion: Any) -> None:
    central = follow(Distributed(filters(WORLD, SENSORS), fusion, feedback=True))
    for state, expected in zip(follow(belief_network(fusion, Network())), central, strict=True):
        assert all(belief is state.fused for belief in state.local)
        assert_same_lmb(state.fused, expected.fused, 1e-12)


def test_late_beliefs_are_predicted_to_the_current_time() -> None:
    states = follow(belief_network(Clmb(EQUAL), Network(delay=1)), num_steps=4)
    local = filters(WORLD, SENSORS)
    # At step 1 nothing has arrived: each has its own. At step 2 it has those of step 1 of the others, a second older.
    rng = np.random.default_rng(4)
    beliefs: list[Any] = []
    for step in (1, 2):
        truth = TRUTH.copy()
        truth[:, :2] += step * truth[:, 2:]
        scans: Any = scans_of(truth, SENSORS, LINE, rng)
        before = [own.initial() for own in local] if step == 1 else beliefs[0]
        beliefs.append(
            [own.step(b, z, p, 1.0, step, rng=rng)[0] for own, b, z, p in zip(local, before, scans, LINE, strict=True)]
        )
    for i in range(3):
        assert_same_lmb(states[0].local[i], beliefs[0][i], 0.0)
        late = [beliefs[1][j] if j == i else local[j].predict(beliefs[0][j], 1.0, 2)[0] for j in range(3)]
        assert_same_lmb(states[1].local[i], Clmb(EQUAL).fuse(late)[0], 1e-12)


def test_connected_sensors_share_births() -> None:
    world = targets(existence=(), measured=MeasurementBirth(0.5, 0.1, np.array([10.0, 10.0, 5.0, 5.0])))
    for tracker in (
        ScanNetwork(SequentialLmbFilter(world, SENSORS), Network(), MERGING),
        BeliefNetwork(filters(world, SENSORS), ParallelUpdate(), Network(), MERGING),
    ):
        state = follow(tracker)[-1]
        assert all(belief is state.fused for belief in state.local)
        assert (state.fused.existence > 0.9).sum() == 2
        assert (state.fused.tracks.labels[:, 1] < 1_000_000).all()


def test_the_information_of_a_scan_can_be_added_to_another_prediction() -> None:
    """A Kalman update of one prediction, taken over to another, is the update of the other by the same measurement."""
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(2, 4, 4))
    one, other = (root @ root.T + 4.0 * np.eye(4) for root in roots)
    measured, noise, observe = np.array([3.0, -1.0]), np.diag([2.0, 3.0]), np.eye(2, 4)

    def updated(mean: Any, cov: Any) -> tuple[Any, Any, float]:
        spread = observe @ cov @ observe.T + noise
        gain, residual = cov @ observe.T @ np.linalg.inv(spread), measured - observe @ mean
        log = -0.5 * (residual @ np.linalg.solve(spread, residual) + np.linalg.slogdet(spread)[1])
        return mean + gain @ residual, cov - gain @ spread @ gain.T, float(log)

    first, second = np.array([1.0, 2.0, 0.5, 0.0]), np.array([2.0, -3.0, 0.0, 1.0])
    mean, cov, log = updated(first, one)
    expected_mean, expected_cov, expected_log = updated(second, other)
    own = lmb([[1, 0], [1, 1]], [0.4, 0.2], [first, first], [one, one])
    posterior = lmb([[1, 0]], [0.4 * math.exp(log) / (0.4 * math.exp(log) + 0.6)], [mean], [cov])
    base = lmb([[1, 0], [1, 5]], [0.7, 0.1], [second, second], [other, other])
    moved = rebase(posterior, own, base)
    np.testing.assert_allclose(moved.tracks.means[0], expected_mean, rtol=1e-11)
    np.testing.assert_allclose(moved.tracks.covs[0], expected_cov, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(moved.existence_logit[0], math.log(0.7 / 0.3) + expected_log, rtol=1e-11)
    np.testing.assert_array_equal(moved.tracks.means[1], second)
    assert moved.existence[1] == pytest.approx(0.1, rel=1e-15)
    assert rebase(posterior, own, own) is posterior
    both = with_labels_of(base, own)
    np.testing.assert_array_equal(both.tracks.labels, [[1, 0], [1, 1], [1, 5]])
    np.testing.assert_allclose(both.existence, [0.7, 0.2, 0.1])


def test_bad_networks() -> None:
    for fields, name in (
        ({"radio_range": 0.0}, "radio_range"),
        ({"max_hops": 0}, "max_hops"),
        ({"link_loss_probability": 1.0}, "link_loss_probability"),
        ({"link_loss_probability": -0.1}, "link_loss_probability"),
        ({"delay": 1.5}, "delay"),
        ({"delay": -1}, "delay"),
        ({"consensus_rounds": 0}, "consensus_rounds"),
        ({"consensus_rounds": 3, "delay": 1}, "consensus_rounds"),
    ):
        with pytest.raises(InputError, match=f"Network.{name}: expected"):
            Network(**fields)
    with pytest.raises(InputError, match="without consensus"):
        scan_network(Network(consensus_rounds=2))
    with pytest.raises(InputError, match=r"network\.delay: expected 0"):
        belief_network(ParallelUpdate(), Network(delay=1))
    with pytest.raises(InputError, match="a dataclass with a field weights"):
        belief_network(object(), Network())


def test_late_scans_use_the_pose_at_their_own_time() -> None:
    """Sensor 2 saw the target before it went away; sensor 1 sees nothing there."""
    near = tuple(sensor(3.0, 0.95, 0.1, max_range=100.0) for _ in range(2))
    world = targets(existence=(0.5,))
    tracker = BeliefNetwork(
        filters(world, near), Clmb((0.5, 0.5), field_of_view_weighting=True), Network(delay=1), MERGING
    )
    state = tracker.initial()
    far, close = [1000.0, 0.0, 0.0], [0.0, 50.0, 0.0]
    for time, second in ((1.0, close), (2.0, far)):
        scans: Any = [np.empty((0, 2)), np.array([[1.0, -2.0]]) if second is close else np.empty((0, 2))]
        state, _ = tracker.step(state, scans, np.array([far, second]), time, rngs=rngs(2))
    assert state.local[0].existence[0] > 0.9


@pytest.mark.parametrize(
    "network", [Network(350.0, max_hops=1), Network(350.0, delay=1), Network(350.0, link_loss_probability=0.3)]
)
@pytest.mark.parametrize("rule", [Clmb(EQUAL), ArithmeticAverage(EQUAL)])
def test_labels_that_sensors_make_themselves_are_matched_in_a_network(rule: Any, network: Network) -> None:
    world = targets(existence=(), measured=MeasurementBirth(0.5, 0.1, np.array([10.0, 10.0, 5.0, 5.0])))
    sharp = tuple(sensor(3.0, 0.98, 0.1) for _ in range(3))
    with pytest.raises(InputError, match=r"fusion: expected one that matches labels"):
        BeliefNetwork(filters(world, sharp), rule, network, MERGING)
    tracker = BeliefNetwork(filters(world, sharp), LabelMatchedFusion(rule), network, MERGING)
    rng, state = np.random.default_rng(2), tracker.initial()
    poses = np.array([[-300.0, 0.0, 0.0], [0.0, 0.0, 0.0], [300.0, 0.0, 0.0]])
    for step in range(1, 9):
        truth = TRUTH.copy()
        truth[:, :2] += step * truth[:, 2:]
        state, _ = tracker.step(state, scans_of(truth, sharp, poses, rng), poses, float(step), rngs=rngs(3, step))
    assert [(belief.existence > 0.6).sum() for belief in (*state.local, state.fused)] == [2] * 4


def line_of_labels(*labels: int, moved: float = 0.0) -> LMB:
    """Labels (1, i) at 100 i m."""
    num = len(labels)
    means = np.array([[100.0 * i + moved, 0.0, 0.0, 0.0] for i in labels]).reshape(num, 4)
    return LMB.from_bernoullis([(1, i) for i in labels], np.full(num, 0.5), means, np.tile(np.eye(4), (num, 1, 1)))


def test_parts_that_others_already_have_are_not_sent() -> None:
    label, name = belief_bytes(line_of_labels(0)), 8
    links = Network(radio_range=120.0).links(LINE, np.random.default_rng(0))
    hops = hop_counts(links)
    shared, own = line_of_labels(0, 1, 2), line_of_labels(0, 1, 2, moved=1.0)
    assert label == 8 * (2 + 1 + 1 + 4 + 10)

    def sent(hears: int | None, *beliefs: LMB) -> tuple[int, ...]:
        return message_bytes(Network(120.0, hears), hops, [(belief,) for belief in beliefs])

    # Names are passed on by the one in the middle; of equal content nothing else is.
    assert sent(None, shared, shared, shared) == (9 * name, 9 * name, 9 * name)
    # One label that the first alone has goes to the second, and by the second to the third.
    more = line_of_labels(0, 1, 2, 3)
    assert sent(None, more, shared, shared) == (10 * name + label, 10 * name + label, 10 * name)
    assert sent(1, more, shared, shared) == (4 * name + label, 3 * name, 3 * name)
    # What both ends hold reaches the middle from one of them alone.
    assert sent(1, more, shared, more) == (4 * name + label, 3 * name, 4 * name)
    # All different: everything goes everywhere, the ends by way of the middle.
    apart = sent(None, own, shared, line_of_labels(0, 1, 2, moved=2.0))
    assert apart == (9 * name + 3 * label, 9 * name + 9 * label, 9 * name + 3 * label)


@pytest.mark.parametrize("factored", [False, True])
def test_parts_have_the_bytes_of_the_whole(factored: bool) -> None:
    belief: Any = line_of_labels(0, 1, 2)
    if factored:
        pair, _ = as_glmb(line_of_labels(7, 8), max_hypotheses=10)
        belief = FactoredGLMB.product([FactoredGLMB.of(belief), FactoredGLMB.of(pair)], 4)
    parts = belief_parts(belief)
    assert len(parts) == (4 if factored else 3)
    assert sum(parts.values()) == belief_bytes(belief)
    assert len(belief_parts(line_of_labels(0, 1, 2, moved=1e-12)).keys() & parts.keys()) == 0
