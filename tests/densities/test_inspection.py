"""What densities and estimates say of themselves: lines, tables, targets and hypotheses, held against their arrays."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from vedette.densities import (
    GLMB,
    LMB,
    Estimate,
    FactoredGLMB,
    IidCluster,
    MultiBernoulli,
    Poisson,
    TrackHistory,
    TrackTable,
    as_lmb,
    map_estimate,
    track_histories,
)
from vedette.densities.containers import MultiTarget
from vedette.errors import InputError

MANY = 10_000
COLUMNS = ["x_m", "y_m", "vx_mps", "vy_mps", "std_x_m", "std_y_m", "std_vx_mps", "std_vy_mps"]


def gaussians(num: int, dim: int = 4) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(num)
    roots = rng.normal(size=(num, dim, dim))
    return 1e3 * rng.normal(size=(num, dim)), roots @ roots.transpose(0, 2, 1) + np.eye(dim)


def lmb_of(num: int, dim: int = 4) -> LMB:
    existence = np.random.default_rng(1).uniform(size=num)
    return LMB.from_bernoullis([(1 + i // 7, i % 7) for i in range(num)], existence, *gaussians(num, dim))


def glmb() -> GLMB:
    """Label (1, 0) has two tracks, one of them a mixture; (2, 0) has one that may be, and (2, 1) one that cannot."""
    means, covs = gaussians(5)
    mixtures = [([1.0], means[:1], covs[:1]), ([0.3, 0.7], means[1:3], covs[1:3])]
    mixtures += [([1.0], means[3:4], covs[3:4]), ([1.0], means[4:], covs[4:])]
    tracks = TrackTable.from_mixtures([(1, 0), (1, 0), (2, 0), (2, 1)], mixtures)
    return GLMB.from_hypotheses(tracks, [[0], [1, 2], [], [2]], [0.2, 0.4, 0.1, 0.3])


def unlabelled(num: int) -> list[MultiTarget]:
    weights, (means, covs) = np.full(num, 0.5), gaussians(num)
    return [
        Poisson.from_gaussians(weights, means, covs),
        IidCluster.from_gaussians([0.25, 0.75], np.full(num, 1.0 / num), means, covs),
        MultiBernoulli.from_gaussians(weights, means, covs),
    ]


def all_kinds(num: int) -> list[MultiTarget]:
    lmb = lmb_of(num)
    listed = GLMB.from_hypotheses(lmb.tracks, [list(range(num)), []], [0.5, 0.5])
    return [lmb, listed, FactoredGLMB.of(lmb), *unlabelled(num)]


@pytest.mark.parametrize("num", [1, 5, MANY])
def test_a_density_is_told_in_two_lines(num: int) -> None:
    for density in all_kinds(num):
        lines = repr(density).splitlines()
        assert len(lines) == 2
        assert max(map(len, lines)) <= 160
        assert lines[0].startswith(f"{type(density).__name__} of {num} ")
        assert lines[0].endswith(" targets expected")
        assert str(density) == repr(density)
        assert len(density._repr_html_()) < 10_000
        assert len(density) == num  # type: ignore[arg-type]


def test_the_likeliest_targets_come_first() -> None:
    labels, means = [(1, 0), (1, 1), (3, 2), (4, 0)], [[i, -2.5e8, 0, 0] for i in range(4)]
    lmb = LMB.from_bernoullis(labels, [0.5, 0.25, 0.99, 0.125], means, [np.eye(4)] * 4)
    first, second = repr(lmb).splitlines()
    assert first == "LMB of 4 labels, 1.865 targets expected"
    assert second.strip() == (
        "3.2: 0.99 at (2.0, -2.5e+08) ± (1.0, 1.0) m; 1.0: 0.5 at (0.0, -2.5e+08) ± (1.0, 1.0) m; "
        "1.1: 0.25 at (1.0, -2.5e+08) ± (1.0, 1.0) m; 1 more"
    )


def test_the_empty_ones_say_so() -> None:
    kinds = [LMB, GLMB, FactoredGLMB, Poisson, IidCluster, MultiBernoulli]
    for density in [kind.empty(4) for kind in kinds]:  # type: ignore[attr-defined]
        assert repr(density).endswith(" 0 targets expected")
        assert len(density) == 0
        assert set(map(len, density.to_table().values())) == {0}
        assert "<td>" not in density._repr_html_()
    assert repr(Estimate.empty(4)) == "Estimate of 0 targets"
    assert list(LMB.empty(4).targets()) == []


def test_targets_are_the_marginals_of_their_labels() -> None:
    belief = glmb()
    expected = as_lmb(belief)
    found = list(belief.targets())
    assert [target.label for target in found] == [(1, 0), (2, 0)]  # nobody holds (2, 1)
    assert len(belief) == 2
    np.testing.assert_allclose([target.existence for target in found], expected.existence, rtol=1e-12)
    np.testing.assert_allclose([target.mean for target in found], expected.tracks.means, rtol=1e-12)
    np.testing.assert_allclose([target.cov for target in found], expected.tracks.covs, rtol=1e-10)


def test_a_label_that_cannot_be_still_has_its_place() -> None:
    means, covs = gaussians(2)
    tracks = TrackTable.from_gaussians([(1, 0), (1, 0)], means, covs)
    belief = GLMB.from_hypotheses(tracks, [[0], [1], []], [0.0, 0.0, 1.0])
    (target,) = belief.targets()
    assert target.existence == 0.0
    np.testing.assert_allclose(target.mean, means.mean(axis=0))


@pytest.mark.parametrize("dim", [4, 5])
def test_those_of_an_lmb_are_its_tracks(dim: int) -> None:
    lmb = lmb_of(12, dim)
    for i, target in enumerate(lmb.targets()):
        assert target.label == tuple(lmb.tracks.labels[i])
        assert target.existence == lmb.existence[i]
        np.testing.assert_array_equal(target.mean, lmb.tracks.means[i])
        np.testing.assert_array_equal(target.cov, lmb.tracks.covs[i])
    table = lmb.to_table()
    assert list(table) == ["label", "existence", *COLUMNS]
    assert table["label"][8] == "2.1"
    assert table["y_m"] == lmb.tracks.means[:, 1].tolist()
    assert table["std_vx_mps"] == np.sqrt(lmb.tracks.covs[:, 2, 2]).tolist()


def test_states_without_velocities_have_no_columns_for_them() -> None:
    assert list(lmb_of(3, 2).to_table()) == ["label", "existence", "x_m", "y_m", "std_x_m", "std_y_m"]
    assert repr(lmb_of(1, 1)).count(",") == 1  # and a line has one coordinate


def test_unlabelled_ones_have_a_row_a_component() -> None:
    poisson, cluster, bernoullis = unlabelled(3)
    assert list(poisson.to_table()) == list(cluster.to_table()) == ["expected_number", *COLUMNS]
    assert poisson.to_table()["expected_number"] == pytest.approx([0.5, 0.5, 0.5])
    assert cluster.to_table()["expected_number"] == pytest.approx([0.25, 0.25, 0.25])
    assert list(bernoullis.to_table()) == ["existence", *COLUMNS]
    assert isinstance(bernoullis, MultiBernoulli)
    assert [target.label for target in bernoullis.targets()] == [None, None, None]


def test_the_hypotheses_of_a_glmb_are_those_that_it_lists() -> None:
    belief = glmb()
    found = list(belief.hypotheses())
    assert [hyp.weight for hyp in found] == pytest.approx([0.4, 0.3, 0.2, 0.1], abs=1e-12)
    assert [hyp.labels for hyp in found] == [((1, 0), (2, 0)), ((2, 0),), ((1, 0),), ()]
    assert [hyp.tracks.tolist() for hyp in found] == [[1, 2], [2], [0], []]
    assert [hyp.measurements for hyp in found] == [None] * 4


def test_measurements_are_told_where_they_are_known() -> None:
    belief, plain = glmb(), glmb().to_table()
    told = replace(belief, tracks=replace(belief.tracks, sources=np.array([[0, 4], [0, -1], [2, 0], [-1, 4]])))
    assert [hyp.measurements for hyp in told.hypotheses()] == [(None, 0), (0,), (4,), ()]
    assert told.to_table() == {**plain, "measurement": [None, 0]}  # missed with .4, the fifth with .2
    assert list(told.to_table())[:3] == ["label", "existence", "measurement"]
    assert "<th>measurement</th>" in told._repr_html_()
    predicted = replace(belief, tracks=replace(belief.tracks, sources=np.array([[0, -2], [1, -2], [2, -2], [-1, -2]])))
    assert [hyp.measurements for hyp in predicted.hypotheses()] == [None] * 4
    assert predicted.to_table() == plain


def test_the_hypotheses_of_a_product_are_all_its_label_sets() -> None:
    lmb = lmb_of(5)
    labels = [tuple(label) for label in lmb.tracks.labels.tolist()]
    expected = {
        tuple(itertools.compress(labels, there)): float(np.prod(np.where(there, lmb.existence, 1.0 - lmb.existence)))
        for there in itertools.product([False, True], repeat=5)
    }
    for density in (lmb, FactoredGLMB.of(lmb)):
        found = list(density.hypotheses())
        assert {hyp.labels: hyp.weight for hyp in found} == pytest.approx(expected, rel=1e-12)
        assert sorted((hyp.weight for hyp in found), reverse=True) == [hyp.weight for hyp in found]
        for hyp in found:
            assert [tuple(label) for label in density.tracks.labels[hyp.tracks].tolist()] == list(hyp.labels)


def test_of_very_many_hypotheses_the_likeliest_keep_their_probabilities() -> None:
    lmb = lmb_of(12)
    some, all_of_them = list(lmb.hypotheses(7)), list(lmb.hypotheses(5000))
    assert (len(some), len(all_of_them)) == (7, 4096)
    assert [hyp.weight for hyp in some] == pytest.approx([hyp.weight for hyp in all_of_them[:7]], rel=1e-12)
    assert sum(hyp.weight for hyp in all_of_them) == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(InputError, match="max_hypotheses"):
        list(lmb.hypotheses(0))


def test_estimates_and_histories_are_told_alike() -> None:
    lmb = lmb_of(6)
    estimate = map_estimate(lmb)
    assert len(estimate) == estimate.num_targets > 0
    assert repr(estimate).startswith(f"Estimate of {len(estimate)} targets\n  ")
    assert estimate.to_table()["x_m"] == estimate.means[:, 0].tolist()
    assert [target.label for target in estimate.targets()] == [tuple(label) for label in estimate.labels.tolist()]
    history = track_histories([estimate, estimate], np.array([1.0, 2.0]))[0]
    assert isinstance(history, TrackHistory)
    assert history.to_table()["time_s"] == [1.0, 2.0]
    assert len(repr(history)) <= 160
    assert repr(lmb.tracks) == "TrackTable of 6 tracks in 6 components, of 4 state components"


def test_what_a_density_tells_is_not_kept_in_it() -> None:
    lmb = lmb_of(4)
    before = lmb.existence_logit.tobytes(), lmb.tracks.means.tobytes()
    repr(lmb), lmb.to_table(), list(lmb.targets()), list(lmb.hypotheses())
    assert (lmb.existence_logit.tobytes(), lmb.tracks.means.tobytes()) == before
    assert not hasattr(lmb, "__dict__")
