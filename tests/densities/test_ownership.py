"""Densities own their arrays: nothing a caller does later gets past the checks, to kernels that go without them."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np
import pytest

from densities.examples import random_glmb, random_lmb
from filters.examples import linear_scene
from vedette.densities import GLMB, LMB, FactoredGLMB, IidCluster, MultiBernoulli, Poisson, TrackTable
from vedette.densities.containers import for_kernel, unchecked
from vedette.errors import InputError
from vedette.filters import DeltaGlmbFilter, LmbFilter

SCENE = linear_scene()
TRACKS = TrackTable.from_gaussians([[0, 0], [0, 1]], np.zeros((2, 4)), [np.eye(4)] * 2)
ONE_EACH = (np.zeros(2), np.zeros((2, 4)), np.array([np.eye(4)] * 2))


def densities() -> list[Any]:
    glmb = GLMB.from_hypotheses(TRACKS, [[0], [0, 1]], [0.4, 0.6])
    lmb = LMB(TRACKS, np.array([1.0, -1.0]))
    return [
        TRACKS,
        replace(TRACKS, sources=np.array([[-1, -2], [3, 0]])),
        glmb,
        lmb,
        FactoredGLMB.of(lmb),
        MultiBernoulli(lmb.existence_logit, TRACKS.offsets, *ONE_EACH),
        Poisson(*ONE_EACH),
        IidCluster(np.log([0.5, 0.5]), np.log([0.5, 0.5]), *ONE_EACH[1:]),
    ]


def arrays(density: Any) -> dict[str, Any]:
    found = {name: getattr(density, name) for name in density.__match_args__}
    return {name: value for name, value in found.items() if isinstance(value, np.ndarray)}


def after_a_scan(kind: Any, belief: Any) -> Any:
    """At the default settings."""
    rng = np.random.default_rng(1)
    return kind(SCENE.targets, SCENE.sensor).step(belief, SCENE.scans[0], SCENE.pose, 1.0, 2, rng=rng)[0]


def bundled(bundle: Any) -> list[Any]:
    return [bundle] if isinstance(bundle, np.ndarray) else [array for part in bundle for array in bundled(part)]


@pytest.mark.parametrize("density", densities(), ids=lambda density: type(density).__name__)
def test_nobody_else_can_write_to_a_density(density: Any) -> None:
    for name, array in arrays(density).items():
        given = array.copy()
        field, _, column = name.partition(".")
        value = getattr(density, field)._replace(**{column: given}) if column else given
        held = attrgetter(name)(replace(density, **{field: value}))
        assert not held.flags.writeable
        assert not np.shares_memory(held, given)
        with pytest.raises(ValueError, match="read-only"):
            held[...] = 0


@pytest.mark.parametrize("density", densities(), ids=lambda density: type(density).__name__)
@pytest.mark.parametrize("protocol", [2, pickle.HIGHEST_PROTOCOL])
def test_pickled_and_copied_it_is_the_same_and_its_own(density: Any, protocol: int) -> None:
    for made in (pickle.loads(pickle.dumps(density, protocol)), copy.deepcopy(density), copy.copy(density)):
        for name, array in arrays(density).items():
            np.testing.assert_array_equal(attrgetter(name)(made), array)
            assert not attrgetter(name)(made).flags.writeable
        assert all(array.flags.writeable and array.flags.c_contiguous for array in bundled(made.to_kernel()))


def test_what_is_unpickled_is_checked() -> None:
    """A pickle in which an index points beyond the tracks: kernels would read memory that is nobody's."""
    bad = unchecked(GLMB, TRACKS, np.array([0, 1]), np.array([10**9]), np.zeros(1))
    with pytest.raises(InputError, match=r"hyp_tracks\[0\]"):
        pickle.loads(pickle.dumps(bad))


def test_buffers_that_a_pickle_leaves_outside_are_copied() -> None:
    """As joblib and multiprocessing leave them: read-only, or another process's."""
    lmb, buffers = LMB(TRACKS, np.array([1.0, -1.0])), list[Any]()
    plain = pickle.dumps((lmb.tracks.means, lmb.existence_logit), 5, buffer_callback=buffers.append)
    means, logits = pickle.loads(plain, buffers=[bytes(buffer.raw()) for buffer in buffers])
    assert not logits.flags.writeable
    made = LMB(replace(TRACKS, means=means), logits)
    stepped, same = (after_a_scan(LmbFilter, belief) for belief in (made, lmb))
    np.testing.assert_array_equal(stepped.existence_logit, same.existence_logit)


def test_indices_changed_after_construction_do_not_reach_a_kernel() -> None:
    """It ended the process: a kernel read where the changed index pointed."""
    offsets, indices, weights = np.array([0, 1]), np.array([0]), np.zeros(1)
    belief = GLMB(TRACKS, offsets, indices, weights)
    expected = after_a_scan(DeltaGlmbFilter, belief)
    indices[0], offsets[1], weights[0] = 10**9, 10**9, np.nan
    found = after_a_scan(DeltaGlmbFilter, belief)
    np.testing.assert_array_equal(found.hyp_log_weights, expected.hyp_log_weights)


@pytest.mark.parametrize("layout", [np.asfortranarray, lambda covs: covs[:, ::-1, ::-1]])
def test_arrays_of_any_layout_are_taken(layout: Any) -> None:
    made = replace(TRACKS, covs=layout(TRACKS.covs))
    np.testing.assert_array_equal(made.covs, layout(TRACKS.covs))
    assert made.to_kernel().components.covs.flags.c_contiguous


def test_parts_of_a_density_are_arrays_of_their_own() -> None:
    """A factor is cut out of larger arrays, whose bases are not of its shape."""
    rng = np.random.default_rng(3)
    factored = FactoredGLMB.from_factors([random_glmb(rng, 2, 4, 1)], 2)
    for factor in (*factored.factors, *FactoredGLMB.of(random_lmb(rng, 3)).factors):
        factor.validate()
        for name, array in arrays(factor).items():
            np.testing.assert_array_equal(for_kernel(array), array, err_msg=name)
