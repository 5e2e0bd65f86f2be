"""Matching of labels across sensors, before a fusion that works by labels."""

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
from vedette.models.arguments import chance, sequence
from vedette.models.fields import Chance, Checked

GATE_PROBABILITY = 0.999  # probability that two estimates of one target are within the gate
LIKELY = 0.5  # labels of at least this existence are matched first
# New labels of sensor s have an index of at least this times s + 1.
OWN_LABELS = 1_000_000
_COMPONENTS = 10  # largest number of components of a track whose label is resolved
_TIE = 1e-6  # cost advantage of equal labels


class _Targets(NamedTuple):
    """The labels of a belief with one Gaussian each."""

    labels: list[Label]
    existence: Floats  # (num_labels,)
    means: Floats  # (num_labels, dim)
    covs: Floats  # (num_labels, dim, dim)

    @classmethod
    def of(cls, belief: LabelledDensity) -> "_Targets":
        lmb = as_lmb(belief)
        labels = [tuple(label) for label in lmb.tracks.labels.tolist()]
        return cls(labels, lmb.existence, *track_moments(lmb.tracks))


def match_labels(
    beliefs: Sequence[LabelledDensity], *, gate_probability: float = GATE_PROBABILITY
) -> list[LabelledDensity]:
    """Return the sensors' beliefs with one common label for tracks that agree in position, and so are one target.

    The first sensor keeps its labels. The labels of each further sensor are assigned to those found so far, at the
    least sum of d'S^-1 d + log det S with S = P_a + P_b over the whole state, with one Gaussian per label. Labels that
    are likely to exist are assigned first, then the others among the remaining ones. Equal labels win ties. Only pairs
    with d'S^-1 d within the gate are assigned, as many as possible. An assigned label takes the label it is assigned
    to. An unassigned one keeps its own, unless that is in use: then it gets its birth step and a new index of this
    sensor, at least 1 000 000 (sensor + 1).

    The density of each label found so far is that of the sensor with its largest existence. Beliefs that are matched
    already are returned unchanged. Densities are not changed, and no two labels of a sensor become one.

    gate_probability: probability that two independent estimates of one target are within the gate.

    Raises `InputError` for beliefs other than labelled densities of one state dimension, an invalid density, or a
    probability outside (0, 1).
    """
    names = common_labels(beliefs, gate_probability=gate_probability)
    return [relabelled(belief, own) for belief, own in zip(beliefs, names, strict=True)]


def common_labels(
    beliefs: Sequence[LabelledDensity], *, gate_probability: float = GATE_PROBABILITY
) -> list[dict[Label, Label]]:
    """For each sensor, the label that `match_labels` gives to each of its labels. Raises the same errors."""
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
        names = _common_labels(own, found, _pairs(own, found, gate), sensor)
        common.append(dict(zip(own.labels, names, strict=True)))
        found = _joined(found, own._replace(labels=names))
    return common


def _pairs(own: _Targets, found: _Targets, gate: float) -> dict[int, int]:
    """Return the place in `found` of each of a sensor's labels that is assigned."""
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
    """Add as many of the allowed pairs (num,) of rows and columns as possible, at the least sum of costs."""
    row_names, row = np.unique(rows, return_inverse=True)
    column_names, column = np.unique(columns, return_inverse=True)
    alone = (np.bincount(row)[row] == 1) & (np.bincount(column)[column] == 1)  # no other candidate for either
    pairs.update(zip(rows[alone].tolist(), columns[alone].tolist(), strict=True))
    if alone.all():
        return
    if alone.any():
        _assign(rows[~alone], columns[~alone], costs[~alone], pairs)
        return
    from scipy.optimize import linear_sum_assignment  # imported here because it takes a third of a second

    # More than any exchange of allowed pairs can save.
    forbidden = costs.max() + (np.ptp(costs) + 1.0) * min(len(row_names), len(column_names))
    block = np.full((len(row_names), len(column_names)), forbidden)
    block[row, column] = costs
    for r, c in zip(*linear_sum_assignment(block), strict=True):
        if block[r, c] < forbidden:
            pairs[int(row_names[r])] = int(column_names[c])


def _common_labels(own: _Targets, found: _Targets, pairs: dict[int, int], sensor: int) -> list[Label]:
    """Return the new label of each of a sensor's labels."""
    taken = set(found.labels)
    names: dict[int, Label] = {i: found.labels[place] for i, place in pairs.items()}
    alone = [i for i in range(len(own.labels)) if i not in pairs]
    free = [i for i in alone if own.labels[i] not in taken]
    names |= {i: own.labels[i] for i in free}
    taken |= {own.labels[i] for i in free}
    for i in alone:
        if i not in names:
            step, index = own.labels[i]
            # Derived from its own index, so that it gets the same label at every scan.
            index = OWN_LABELS * (sensor + 1) + index % OWN_LABELS
            while (step, index) in taken:
                index += 1
            names[i] = step, index
            taken.add(names[i])
    return [names[i] for i in range(len(own.labels))]


def _joined(found: _Targets, own: _Targets) -> _Targets:
    """Return all labels so far, each with the density of the sensor of largest existence, the first one on a tie."""
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
    """Return the belief under other labels, all distinct. Labels without a new name are kept."""
    if all(old == new for old, new in names.items()):
        return belief
    # The track table of a GLMB may contain labels that no hypothesis uses.
    labels = [names.get(label, label) for label in map(tuple, belief.tracks.labels.tolist())]
    return belief.with_labels(np.array(labels, np.int64))


@dataclass(frozen=True, slots=True)
class LabelMatchedFusion(Checked):
    """A fusion by labels that first matches labels across sensors (`match_labels`), so that they need not agree.

    For sensors that initiate targets at different steps or assign their own labels, and that do not continue from the
    fused belief. A tracker that keeps the result of `match` as the sensors' beliefs has labels that are stable over
    time, even if the sensor that introduced a label loses it, and decisions can then use the labels of `rule` directly.

    Attributes:
        rule: the fusion.
        gate_probability: see `match_labels`.

    Raises `InputError` for a gate that is not a probability.
    """

    rule: Fusion
    gate_probability: Chance = GATE_PROBABILITY
    matches_labels: ClassVar[bool] = True  # labels may differ across sensors

    def match(self, beliefs: Sequence[LabelledDensity]) -> list[LabelledDensity]:
        """Return the beliefs under common labels. Ambiguous labels of products of GLMBs are resolved first.

        Otherwise, each of several candidate labels of one target would be matched as an improbable target.
        """
        given = sequence("beliefs", beliefs, "densities, one a sensor")
        settled = [with_resolved_labels(belief, _COMPONENTS) for belief in given]
        return match_labels(settled, gate_probability=self.gate_probability)

    def fuse(self, beliefs: Sequence[LabelledDensity], views: FieldsOfView | None = None) -> tuple[Any, FusionInfo]:
        """Return the fusion by `rule` of the beliefs under common labels. Raises as `match_labels` and `rule`."""
        return self.rule.fuse(PrevalidatedBeliefs(self.match(beliefs)), views)

    def precompute(self, cases: Sequence[DensityBatch], prediction: GLMB | LMB) -> None:
        """Return None, as matches differ between cases. For matched beliefs, call the method of `rule`."""
        return None
