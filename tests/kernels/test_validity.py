"""The quick check of labelled densities passes none that their own checks refuse, and all that filters make."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from vedette.densities import GLMB, LMB, TrackTable
from vedette.densities.containers import unchecked
from vedette.errors import InputError
from vedette.kernels.labelled.validity import is_valid_glmb, is_valid_lmb

LABELS = np.array([[1, 0], [1, 2], [3, 0]])
pytestmark = pytest.mark.lanes


def table() -> TrackTable:
    """Three tracks, the second a mixture."""
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(4, 3, 3))
    covs = roots @ roots.transpose(0, 2, 1) + np.eye(3)
    halves = np.log([1.0, 0.25, 0.75, 1.0])
    return TrackTable(LABELS, np.array([0, 1, 3, 4]), halves, rng.normal(size=(4, 3)), covs)


def glmb() -> GLMB:
    return GLMB.from_hypotheses(table(), [[0, 1], [2], []], [0.5, 0.3, 0.2])


def lmb() -> LMB:
    return LMB(table(), np.array([-np.inf, 0.3, np.inf]))


def changed(density: Any, **fields: Any) -> Any:
    """With other arrays, which nobody checks."""
    kind = type(density)
    return unchecked(kind, *(fields.get(name, getattr(density, name)) for name in kind.__match_args__))


def entry(array: Any, place: Any, value: float) -> Any:
    array = array.copy()
    array[place] = value
    return array


def of_tracks(tracks: TrackTable) -> Iterator[TrackTable]:
    """Tracks with one fault each."""
    yield changed(tracks, offsets=entry(tracks.offsets, 0, 1))
    yield changed(tracks, offsets=entry(tracks.offsets, 1, 3))
    yield changed(tracks, offsets=entry(tracks.offsets, 3, 5))
    yield changed(tracks, offsets=tracks.offsets[:-1])
    yield changed(tracks, labels=np.zeros((3, 3), np.int64))
    yield changed(tracks, log_weights=entry(tracks.log_weights, 1, np.log(0.25) + 1e-8))
    for value in (np.nan, np.inf):
        yield changed(tracks, log_weights=entry(tracks.log_weights, 0, value))
        yield changed(tracks, means=entry(tracks.means, (2, 1), value))
        yield changed(tracks, covs=entry(tracks.covs, (2, 1, 0), value))
    yield changed(tracks, covs=entry(tracks.covs, (0, 1, 0), tracks.covs[0, 1, 0] + 1e-6))
    yield changed(tracks, covs=-tracks.covs)
    yield changed(tracks, covs=tracks.covs[:, :2, :2])


def spoilt() -> Iterator[Any]:
    """Densities with one fault each."""
    for density in (glmb(), lmb()):
        for tracks in of_tracks(density.tracks):
            yield changed(density, tracks=tracks)
    sets, own = glmb(), lmb()
    yield changed(sets, hyp_offsets=entry(sets.hyp_offsets, 1, 4))
    yield changed(sets, hyp_tracks=entry(sets.hyp_tracks, 0, 3))
    yield changed(sets, hyp_tracks=entry(sets.hyp_tracks, 0, -1))
    yield changed(sets, hyp_tracks=entry(sets.hyp_tracks, 0, 1))
    yield changed(sets, hyp_log_weights=sets.hyp_log_weights + 1e-8)
    yield changed(sets, hyp_log_weights=entry(sets.hyp_log_weights, 1, np.nan))
    yield changed(own, existence_logit=entry(own.existence_logit, 1, np.nan))
    yield changed(own, existence_logit=own.existence_logit[:2])
    yield changed(own, tracks=changed(own.tracks, labels=LABELS[[1, 0, 2]]))


def is_valid(density: Any) -> bool:
    return bool((is_valid_lmb if density.is_lmb else is_valid_glmb)(density.to_kernel()))


def test_densities_pass() -> None:
    assert is_valid(glmb())
    assert is_valid(lmb())
    assert is_valid(LMB.empty(3))
    assert is_valid(GLMB.empty(3))


@pytest.mark.parametrize("density", list(spoilt()))
def test_a_fault_does_not_pass(density: Any) -> None:
    with pytest.raises(InputError):
        density.validate(error=InputError)
    assert not is_valid(density)


def test_what_is_nearly_singular_is_left_to_the_checks_that_tell_more() -> None:
    for least, passes in ((1e-10, True), (1e-15, False)):
        covs = np.tile(np.ones((3, 3)) + least * np.eye(3), (4, 1, 1))
        assert is_valid(changed(lmb(), tracks=changed(table(), covs=covs))) == passes
