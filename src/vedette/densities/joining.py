"""Factors of several densities side by side: gathered so that no label is in two of the groups."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vedette.densities.checks import distinct_labels, offsets_of
from vedette.densities.factored import FactoredGLMB
from vedette.densities.label_sets import take_factors
from vedette.kernels.base.types import Bools, Ints


class JoinedFactors(NamedTuple):
    """The smallest groups of the factors of several densities of which no two share a label, in increasing order of
    their first labels. Each density is the product of its parts in the groups; factors without labels are in none.

    densities: whose factors they are. groups: for each density, (num_factors,) the group of each factor, or -1.
    alone: (num_groups,) whether all factors in the group are of its only label, laid out as by
    `FactoredGLMB.from_lmb`.
    """

    densities: tuple[FactoredGLMB, ...]
    groups: tuple[Ints, ...]
    alone: Bools

    def places(self) -> Ints:
        """(number of groups that are alone, num_densities) factor of each density there, -1 where it has none."""
        number = np.cumsum(self.alone) - 1
        places = np.full((int(self.alone.sum()), len(self.densities)), -1, np.int64)
        for d, groups in enumerate(self.groups):
            factors = np.flatnonzero(groups >= 0)
            factors = factors[self.alone[groups[factors]]]
            places[number[groups[factors]], d] = factors
        return places

    def parts(self, group: int) -> list[FactoredGLMB]:
        """What each density has in a group."""
        return [
            take_factors(density, np.flatnonzero(groups == group))
            for density, groups in zip(self.densities, self.groups, strict=True)
        ]


def join_factors(densities: Sequence[FactoredGLMB]) -> JoinedFactors:
    """The factors of densities of one state dimension, at least one, gathered."""
    distinct, place = distinct_labels(np.concatenate([density.tracks.labels for density in densities]))
    firsts = offsets_of([density.tracks.num_tracks for density in densities])
    places = [place[low:high] for low, high in pairwise(firsts.tolist())]
    sizes = [np.diff(density.track_offsets) for density in densities]
    root, before = np.arange(len(distinct)), np.empty(0, np.int64)
    while not np.array_equal(root, before):
        before = root.copy()
        for density, own, counts in zip(densities, places, sizes, strict=True):
            if len(own):
                least = np.minimum.reduceat(root[own], density.track_offsets[:-1][counts > 0])
                np.minimum.at(root, own, np.repeat(least, counts[counts > 0]))
        root = root[root]  # a shortcut through those that are joined already
    _, group_of_label = np.unique(root, return_inverse=True)
    groups = []
    for density, own, counts in zip(densities, places, sizes, strict=True):
        found = np.full(density.num_factors, -1, np.int64)
        found[counts > 0] = group_of_label[own[density.track_offsets[:-1][counts > 0]]]
        groups.append(found)
    alone = np.ones(len(np.unique(root)), np.bool_)
    for density, found in zip(densities, groups, strict=True):
        alone[found[(found >= 0) & ~density.is_bernoulli]] = False
    return JoinedFactors(tuple(densities), tuple(groups), alone)


__all__ = ["JoinedFactors", "join_factors"]
