"""Matching of labels across sensors, before a fusion that goes by labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB, LabelledDensity, as_lmb, track_moments
from vedette.densities.batches import DensityBatch
from vedette.densities.conversions import with_resolved_labels
from vedette.densities.label_sets import Label
from vedette.fusion.base import Fusion, FusionInfo, PrevalidatedBeliefs, check_beliefs
from vedette.fusion.views import FieldsOfView
from vedette.internal.probabilities import chi_squared_quantile
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.distances import near_pairs
from vedette.models.arguments import chance, instance, sequence

GATE_PROBABILITY = 0.999  # that two estimates of one target are within the gate
LIKELY = 0.5  # existence from which a label is matched before the others
# Sensor s makes labels whose index is at least this times s + 1.
OWN_LABELS = 1_000_000
_COMPONENTS = 10  # of a track whose names are settled
_TIE = 1e-6  # between costs, in favour of equal labels


class _Targets(NamedTuple):
    """The labels of a belief with one Gaussian each."""

    labels: list[Label]
    existence: Floats  # (num_labels,)
    means: Floats  # (num_labels, dim)
    covs: Floats  # (num_labels, dim, dim)

    @classmethod
    def of(cls, belief: LabelledDensity) -> _Targets:
        lmb = as_lmb(belief)
        labels = [tuple(label) for label in lmb.tracks.labels.tolist()]
        return cls(labels, lmb.existence, *track_moments(lmb.tracks))


def match_labels(
    beliefs: Sequence[LabelledDensity], *, gate_probability: float = GATE_PROBABILITY
) -> list[LabelledDensity]:
    """The sensors' beliefs with one label for what is one target by its place.

    The first sensor's labels stay as they are. Each further sensor's labels are assigned to those found so far, at the
    least sum of d'S^-1 d + log det S with S = P_a + P_b over the whole state, of one Gaussian a label; those that are
    likely to exist first, the others among what is left; of equal sums, equal labels. Only pairs with d'S^-1 d within
    the gate are assigned, as many as can be. What is assigned takes the label that it is assigned to. What is not keeps
    its own, unless that is taken: then it gets one of its birth step and an index of the sensor's own, from
    1 000 000 (sensor + 1) on.

    A label is told by the density of the sensor that is surest of it so far. Beliefs that have been matched come back
    as they are. Densities are not changed, and no two labels of a sensor become one.

    gate_probability: that two independent estimates of one target are within the gate.

    Raises `InputError` for something other than labelled densities of one state dimension, a density that is not valid,
    or a probability outside (0, 1).
    """
    names = common_names(beliefs, gate_probability=gate_probability)
    return [relabelled(belief, own) for belief, own in zip(beliefs, names, strict=True)]


def common_names(
    beliefs: Sequence[LabelledDensity], *, gate_probability: float = GATE_PROBABILITY
) -> list[dict[Label, Label]]:
    """For each sensor, the label that `match_labels` gives to each of its labels. Raises as that."""
    if not isinstance(beliefs, PrevalidatedBeliefs):
        beliefs = sequence("beliefs", beliefs, "densities, one a sensor")
    check_beliefs(beliefs, (GLMB, LMB, FactoredGLMB), len(beliefs))
    chance("gate_probability", gate_probability)
    if not beliefs:
        return []
    gate = chi_squared_quantile(beliefs[0].state_dim, gate_probability)
    owns = [_Targets.of(belief) for belief in beliefs]
    found, common = owns[0], [{label: label for label in owns[0].labels}]
    for sensor in range(1, len(beliefs)):
        own = owns[sensor]
        names = _names(own, found, _pairs(own, found, gate), sensor)
        common.append(dict(zip(own.labels, names, strict=True)))
        found = _joined(found, own._replace(labels=names))
    return common


def _pairs(own: _Targets, found: _Targets, gate: float) -> dict[int, int]:
    """Place in `found` of those of a sensor's labels that are assigned."""
    near = near_pairs(own.means, own.covs, found.means, found.covs, gate)
    rows, columns, costs = near.firsts, near.seconds, near.squares + near.log_dets
    place = {label: i for i, label in enumerate(found.labels)}
    same = np.array([place.get(label, -1) for label in own.labels], np.int64)
    costs[same[rows] == columns] -= _TIE
    pairs = dict[int, int]()
    likely = (own.existence[rows] >= LIKELY) & (found.existence[columns] >= LIKELY)
    for among in (likely, np.ones(len(rows), np.bool_)):
        free = among & ~np.isin(rows, list(pairs.keys())) & ~np.isin(columns, list(pairs.values()))
        _assign(rows[free], columns[free], costs[free], pairs)
    return pairs


def _assign(rows: Ints, columns: Ints, costs: Floats, pairs: dict[int, int]) -> None:
    """Add as many of the allowed pairs (num,) of rows and columns as can be, at the least sum of costs."""
    row_names, row = np.unique(rows, return_inverse=True)
    column_names, column = np.unique(columns, return_inverse=True)
    alone = (np.bincount(row)[row] == 1) & (np.bincount(column)[column] == 1)  # nothing else is near either
    pairs.update(zip(rows[alone].tolist(), columns[alone].tolist(), strict=True))
    if alone.all():
        return
    if alone.any():
        _assign(rows[~alone], columns[~alone], costs[~alone], pairs)
        return
    from scipy.optimize import linear_sum_assignment  # here, as it takes a third of a second to load

    # More than any change of the allowed pairs can save.
    forbidden = costs.max() + (np.ptp(costs) + 1.0) * min(len(row_names), len(column_names))
    block = np.full((len(row_names), len(column_names)), forbidden)
    block[row, column] = costs
    for r, c in zip(*linear_sum_assignment(block), strict=True):
        if block[r, c] < forbidden:
            pairs[int(row_names[r])] = int(column_names[c])


def _names(own: _Targets, found: _Targets, pairs: dict[int, int], sensor: int) -> list[Label]:
    """The new label of each of a sensor's labels."""
    taken = set(found.labels)
    names: dict[int, Label] = {i: found.labels[place] for i, place in pairs.items()}
    alone = [i for i in range(len(own.labels)) if i not in pairs]
    free = [i for i in alone if own.labels[i] not in taken]
    names |= {i: own.labels[i] for i in free}
    taken |= {own.labels[i] for i in free}
    for i in alone:
        if i not in names:
            step, index = own.labels[i]
            # From its own index on, so that it gets the same label at every scan.
            index = OWN_LABELS * (sensor + 1) + index % OWN_LABELS
            while (step, index) in taken:
                index += 1
            names[i] = step, index
            taken.add(names[i])
    return [names[i] for i in range(len(own.labels))]


def _joined(found: _Targets, own: _Targets) -> _Targets:
    """All labels so far, each with the density of the sensor that is surest of it; of equals the first."""
    place = {label: i for i, label in enumerate(found.labels)}
    new = [i for i, label in enumerate(own.labels) if label not in place]
    existence, means, covs = (
        np.concatenate([getattr(found, name), getattr(own, name)[new]]) for name in ("existence", "means", "covs")
    )
    for i, label in enumerate(own.labels):
        at = place.get(label)
        if at is not None and own.existence[i] > existence[at]:
            existence[at], means[at], covs[at] = own.existence[i], own.means[i], own.covs[i]
    return _Targets([*found.labels, *(own.labels[i] for i in new)], existence, means, covs)


def relabelled(belief: LabelledDensity, names: dict[Label, Label]) -> LabelledDensity:
    """The belief under other labels, of which no two are the same; labels without a new name keep theirs."""
    if all(old == new for old, new in names.items()):
        return belief
    # A GLMB's table may have labels that are in no hypothesis.
    labels = [names.get(label, label) for label in map(tuple, belief.tracks.labels.tolist())]
    return belief.with_labels(np.array(labels, np.int64))


@dataclass(frozen=True, slots=True)
class LabelMatchedFusion:
    """A fusion by labels of beliefs whose labels need not agree: they are matched first (`match_labels`).

    For sensors that take targets up at different steps, or make labels of their own, and do not go on from the fused
    belief. A tracker that keeps what `match` gives as the sensors' beliefs keeps labels stable over time, also where
    the sensor that led a label loses it, and lets decisions go by the labels of the `rule` alone.

    Attributes:
        rule: the fusion.
        gate_probability: as of `match_labels`.

    Raises `InputError` for a gate that is no probability.
    """

    rule: Fusion
    gate_probability: float = GATE_PROBABILITY
    matches_labels: ClassVar[bool] = True  # labels need not agree across sensors

    def __post_init__(self) -> None:
        instance("rule", self.rule, Fusion)
        chance("gate_probability", self.gate_probability)

    def match(self, beliefs: Sequence[LabelledDensity]) -> list[LabelledDensity]:
        """The beliefs under common labels; products of GLMBs with the names settled that they leave open.

        Of several labels that may be one target's, each by itself would be matched as an improbable target.
        """
        given = sequence("beliefs", beliefs, "densities, one a sensor")
        settled = [with_resolved_labels(belief, _COMPONENTS) for belief in given]
        return match_labels(settled, gate_probability=self.gate_probability)

    def fuse(self, beliefs: Sequence[LabelledDensity], views: FieldsOfView | None = None) -> tuple[Any, FusionInfo]:
        """The fusion of the beliefs under common labels; see the rule's. Raises as `match_labels` and the rule."""
        return self.rule.fuse(PrevalidatedBeliefs(self.match(beliefs)), views)

    def precompute(self, cases: Sequence[DensityBatch], prediction: GLMB | LMB) -> None:
        """None: which labels match differs from case to case. Of matched beliefs, ask the rule."""
        return None
