"""Every search keeps to its mask, asks for nothing twice, and uses the seams that a problem offers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vedette.control import (
    AutomaticSearch,
    CoordinateAscent,
    CrossEntropy,
    ExhaustiveSearch,
    JointProblem,
    JointSearch,
    Mask,
    SequentialGreedy,
)
from vedette.control.search.problem import all_joint_actions
from vedette.errors import InputError

Joint = tuple[int, ...]

SEARCHES: tuple[JointSearch, ...] = (
    ExhaustiveSearch(),
    CoordinateAscent(0),
    CoordinateAscent(),
    SequentialGreedy(),
    SequentialGreedy("best_first"),
    CrossEntropy(num_samples=15, elite_fraction=0.2, smoothing=0.9),
    AutomaticSearch(),
)


@dataclass
class Watched:
    """Sensors that see targets with probabilities (num_courses, num_targets) each; keeps what it was asked for.

    The reward, the expected number of targets seen by anyone, is monotone and submodular in the sensors that look.
    """

    seen: tuple[Any, ...]
    mask: Mask | None = None
    asked: list[Joint] = field(default_factory=list)
    parts: list[Joint] = field(default_factory=list)
    lines: int = 0

    def reward(self, joint: Joint) -> float:
        missed = np.ones(self.seen[0].shape[1])
        for own, action in zip(self.seen, joint, strict=True):
            missed *= 1.0 - own[action] if action >= 0 else 1.0
        return float((1.0 - missed).sum())

    def evaluate(self, actions: Any) -> Any:
        self.asked.extend(map(tuple, actions.tolist()))
        return np.array([self.reward(joint) for joint in map(tuple, actions.tolist())])

    def partial(self, actions: Any) -> Any:
        self.parts.extend(map(tuple, actions.tolist()))
        return np.array([self.reward(joint) for joint in map(tuple, actions.tolist())])

    def line(self, through: Joint, sensor: int) -> Any:
        self.lines += 1
        num = len(self.seen[sensor])
        return np.array([self.reward((*through[:sensor], a, *through[sensor + 1 :])) for a in range(num)])

    def independent(self) -> Joint:
        own = self.mask.single if self.mask else [np.ones(len(seen), bool) for seen in self.seen]
        alone = [np.where(may, seen.sum(axis=1), -1.0) for may, seen in zip(own, self.seen, strict=True)]
        return tuple(int(values.argmax()) for values in alone)

    def problem(self, **seams: Any) -> JointProblem:
        shape = tuple(len(own) for own in self.seen)
        return JointProblem(shape, self.evaluate, self.independent, self.mask, partial=self.partial, **seams)


def watched(shape: Joint, seed: int, mask: Mask | None = None) -> Watched:
    draw = np.random.default_rng(seed)
    return Watched(tuple(draw.random((num, 3)) for num in shape), mask)


def random_mask(shape: Joint, seed: int, share: float) -> Mask:
    draw = np.random.default_rng(seed)
    single = tuple(draw.random(num) >= share for num in shape)
    pairs = [(i, j) for j in range(len(shape)) for i in range(j)]
    return Mask(single, {(i, j): draw.random((shape[i], shape[j])) >= share for i, j in pairs if draw.random() < 0.7})


def allowed(mask: Mask, shape: Joint) -> Iterator[Joint]:
    """All allowed joint actions, in plain words."""
    for joint in np.ndindex(*shape):
        alone = all(own[action] for own, action in zip(mask.single, joint, strict=True))
        if alone and all(table[joint[i], joint[j]] for (i, j), table in mask.together.items()):
            yield joint


SHAPES = st.lists(st.integers(1, 4), min_size=1, max_size=4).map(tuple)
SEEDS = st.integers(0, 2**32 - 1)


@given(SHAPES, SEEDS, st.sampled_from([0.1, 0.4, 0.7]))
def test_violations_are_counted(shape: Joint, seed: int, share: float) -> None:
    mask = random_mask(shape, seed, share)
    actions = all_joint_actions(shape)
    expected = [
        sum(not own[action] for own, action in zip(mask.single, joint, strict=True))
        + sum(not table[joint[i], joint[j]] for (i, j), table in mask.together.items())
        for joint in actions.tolist()
    ]
    assert mask.violations(actions).tolist() == expected
    assert mask.allows(actions).tolist() == [number == 0 for number in expected]


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
@given(shape=SHAPES, seed=SEEDS, share=st.sampled_from([0.1, 0.4]))
def test_nothing_that_is_forbidden_is_evaluated_or_taken(
    search: JointSearch, shape: Joint, seed: int, share: float
) -> None:
    scene = watched(shape, seed, random_mask(shape, seed, share))
    assert scene.mask is not None
    may = set(allowed(scene.mask, shape))
    found = search.search(scene.problem(), rng=np.random.default_rng(seed))
    assert len(set(scene.asked)) == len(scene.asked)
    if may:
        assert found in may
        assert set(scene.asked) <= may


@pytest.mark.parametrize("search", SEARCHES, ids=repr)
@given(shape=SHAPES, seed=SEEDS)
def test_where_nothing_is_allowed_as_little_as_can_be_is_violated(search: JointSearch, shape: Joint, seed: int) -> None:
    """Of courses that are allowed: a sensor without any has all."""
    mask = random_mask(shape, seed, 0.75)
    mask = Mask(tuple(own if own.any() else np.ones_like(own) for own in mask.single), mask.together)
    found = search.search(watched(shape, seed, mask).problem(), rng=np.random.default_rng(seed))
    assert mask.violations(np.array([found]))[0] == mask.violations(all_joint_actions(shape)).min()


@given(SHAPES, SEEDS, st.sampled_from([0.0, 0.1, 0.4]))
def test_the_exhaustive_search_forms_what_is_allowed_in_printed_order(shape: Joint, seed: int, share: float) -> None:
    scene = watched(shape, seed, random_mask(shape, seed, share))
    assert scene.mask is not None
    may = list(allowed(scene.mask, shape))
    found = ExhaustiveSearch(10**6).search(scene.problem(), rng=np.random.default_rng(seed))
    if may:
        assert scene.asked == may
        assert scene.reward(found) == pytest.approx(max(map(scene.reward, may)), rel=1e-9)


def test_a_bound_on_joint_actions_is_on_those_allowed() -> None:
    mask = Mask((np.array([True, False, False]),) * 2 + (np.ones(3, bool),))
    scene = watched((3, 3, 3), 1, mask)
    ExhaustiveSearch(3).search(scene.problem(), rng=np.random.default_rng(1))
    with pytest.raises(InputError, match="at most 2 for an exhaustive search; got more than that, of 3 of 3 sensors"):
        ExhaustiveSearch(2).search(scene.problem(), rng=np.random.default_rng(1))


@given(SHAPES, SEEDS, st.sampled_from([None, 0.2]))
def test_lines_and_compiled_ascents_lead_where_evaluations_do(shape: Joint, seed: int, share: float | None) -> None:
    mask = None if share is None else random_mask(shape, seed, share)
    plain, lined, compiled = (watched(shape, seed, mask) for _ in range(3))
    expected = CoordinateAscent().search(plain.problem(), rng=np.random.default_rng(3))
    found = CoordinateAscent().search(lined.problem(line=lined.line), rng=np.random.default_rng(3))
    assert found == expected
    assert lined.asked == []
    assert lined.lines > 0
    twin = watched(shape, seed, mask)

    def ascend(start: Joint) -> Joint:
        return CoordinateAscent(0).search(
            twin.problem()._replace(independent=lambda: start), rng=np.random.default_rng()
        )

    found = CoordinateAscent().search(compiled.problem(ascend=ascend), rng=np.random.default_rng(3))
    assert compiled.reward(found) == pytest.approx(plain.reward(expected), rel=1e-9)
    assert len(compiled.asked) <= 4


@pytest.mark.parametrize("order", ["sensor_order", "best_first"])
@given(shape=SHAPES, seed=SEEDS)
def test_greedy_has_half_of_the_best_and_as_much_as_it_says(order: Any, shape: Joint, seed: int) -> None:
    scene = watched(shape, seed)
    found = SequentialGreedy(order).search(scene.problem(), rng=np.random.default_rng(seed))
    best = max(map(scene.reward, np.ndindex(*shape)))
    assert 0.5 * best - 1e-12 <= scene.reward(found) <= best + 1e-12
    assert len(set(scene.parts)) == len(scene.parts)
    assert scene.asked == []


@given(SHAPES, SEEDS)
def test_the_greedy_order_is_as_printed(shape: Joint, seed: int) -> None:
    scene = watched(shape, seed)
    found = SequentialGreedy().search(scene.problem(), rng=np.random.default_rng(seed))
    at = [-1] * len(shape)
    for sensor, num in enumerate(shape):
        rewards = [scene.reward((*at[:sensor], action, *at[sensor + 1 :])) for action in range(num)]
        at[sensor] = int(np.argmax(rewards))
    assert found == tuple(at)


@given(SHAPES, SEEDS)
def test_best_first_is_greedy_over_all_sensors(shape: Joint, seed: int) -> None:
    """The plain way looks at every sensor again in each round."""
    scene = watched(shape, seed)
    found = SequentialGreedy("best_first").search(scene.problem(), rng=np.random.default_rng(seed))
    at = [-1] * len(shape)
    for _ in shape:
        options = [
            (scene.reward((*at[:s], action, *at[s + 1 :])), s, action)
            for s, num in enumerate(shape)
            for action in range(num)
            if at[s] < 0
        ]
        _, sensor, action = max(options, key=lambda option: option[0])
        at[sensor] = action
    assert found == tuple(at)


def test_greedy_needs_rewards_of_undecided_sensors() -> None:
    problem = watched((2, 2), 1).problem()._replace(partial=None)
    with pytest.raises(InputError, match="search: expected rewards of sensors that have not decided"):
        SequentialGreedy().search(problem, rng=np.random.default_rng(1))


@given(SHAPES, SEEDS)
def test_cross_entropy_is_no_worse_than_independent(shape: Joint, seed: int) -> None:
    scene = watched(shape, seed)
    found = CrossEntropy(num_samples=10).search(scene.problem(), rng=np.random.default_rng(seed))
    assert scene.reward(found) >= max(map(scene.reward, scene.asked)) - 1e-9
    assert scene.independent() in scene.asked
    assert len(set(scene.asked)) == len(scene.asked)


def test_cross_entropy_draws_to_the_best_and_stops() -> None:
    scene = watched((6,) * 5, 2)
    best = max(map(scene.reward, np.ndindex(*(6,) * 5)))
    search = CrossEntropy(num_samples=200)
    found = search.search(scene.problem(), rng=np.random.default_rng(4))
    assert scene.reward(found) > 0.99 * best
    assert len(scene.asked) < 0.15 * 6**5
    again = search.search(watched((6,) * 5, 2).problem(), rng=np.random.default_rng(4))
    assert again == found


@pytest.mark.parametrize(
    ("shape", "exhaustive"), [((4, 5), True), ((3, 3, 3), True), ((3, 3, 4), False), ((2,) * 4, False)]
)
def test_automatic_is_exhaustive_up_to_three_sensors(shape: Joint, exhaustive: bool) -> None:
    scene, twin = watched(shape, 3), watched(shape, 3)
    found = AutomaticSearch(30).search(scene.problem(), rng=np.random.default_rng(1))
    search = ExhaustiveSearch() if exhaustive else CoordinateAscent(2)
    assert found == search.search(twin.problem(), rng=np.random.default_rng(1))
    assert scene.asked == twin.asked


@pytest.mark.parametrize("search", SEARCHES[1:], ids=repr)
def test_a_hundred_sensors(search: JointSearch) -> None:
    """12^100 joint actions fit into no table and no integer."""
    draw = np.random.default_rng(5)
    values = draw.random((100, 12))
    problem = JointProblem(
        (12,) * 100,
        lambda actions: values[np.arange(100), actions].sum(axis=1),
        lambda: tuple(values.argmax(axis=1).tolist()),
        partial=lambda actions: np.where(actions < 0, 0.0, values[np.arange(100), actions]).sum(axis=1),
    )
    assert search.search(problem, rng=draw) == tuple(values.argmax(axis=1).tolist())
    conflicts = {(s, s + 1): ~np.eye(12, dtype=bool) for s in range(99)}  # no two neighbours the same
    mask = Mask(tuple(draw.random(12) < 0.8 for _ in range(100)), conflicts)
    found = search.search(problem._replace(mask=mask), rng=draw)
    assert mask.allows(np.array([found]))[0]


def test_joint_actions_of_more_sensors_than_arrays_have_axes() -> None:
    assert all_joint_actions((1,) * 70 + (2,)).tolist() == [[0] * 71, [0] * 70 + [1]]
    assert all_joint_actions(()).shape == (1, 0)
    with pytest.raises(InputError, match="= 12000000"):
        ExhaustiveSearch().search(JointProblem((12, 1000, 1000), len, tuple), rng=np.random.default_rng(1))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("together", "message"),
    [
        ({(1, 0): np.ones((2, 2), bool)}, r"mask: expected pairs of sensors below 2; got \(1, 0\)"),
        ({(0, 2): np.ones((2, 2), bool)}, r"mask: expected pairs of sensors below 2; got \(0, 2\)"),
        ({(0, 1): np.ones((2, 3), bool)}, r"mask of sensors \(0, 1\): expected shape \(2, 2\); got \(2, 3\)"),
    ],
)
def test_masks_that_are_none(together: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Mask((np.ones(2, bool),) * 2, together)
