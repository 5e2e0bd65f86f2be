"""True targets drawn from the model that the filters have, and the labels that name them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vedette.densities import existence_probabilities
from vedette.models import BirthModel, TargetModel
from vedette.simulation import CLUTTER, Scan, Truth
from vedette.simulation.truth import moved_states

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class PriorTargets:
    """Targets drawn from a target model, so that an exact filter of this model is calibrated.

    At each scan a target survives and moves, with process noise, as the model says. Then each birth site gives birth
    with its probability; the first scan counts as one period of births, as in the trackers. The id of the target
    born at (step, site) is (step - 1) * num_sites + site.
    """

    model: TargetModel

    def truth(self, times: ArrayLike, *, rng: np.random.Generator) -> Truth:
        """Return the targets alive at each of (num_scans,) times in s."""
        scans, birth = np.asarray(times, np.float64), self.model.birth
        periods = np.diff(scans, prepend=scans[0] - (self.model.birth.period or 1.0))
        ids, states = np.empty(0, np.int64), np.empty((0, birth.state_dim))
        alive: list[Ints] = []
        rows: list[Floats] = []
        for step, dt in enumerate(periods.tolist(), start=1):
            ids, states = self._survivors(ids, states, dt, rng)
            sites, starts = born_at(birth, step, dt, rng)
            ids = np.concatenate([ids, (step - 1) * birth.num_sites + sites])
            states = np.concatenate([states, starts])
            alive.append(ids)
            rows.append(states)
        offsets = np.concatenate([[0], np.cumsum([len(own_ids) for own_ids in alive])])
        return Truth(scans, offsets.astype(np.int64), np.concatenate(alive), np.concatenate(rows))

    def _survivors(self, ids: Ints, states: Floats, dt: float, rng: np.random.Generator) -> tuple[Ints, Floats]:
        """Ids and states, `dt` seconds later, of the targets that are still alive then."""
        if len(ids) == 0:
            return ids, states
        lives = rng.random(len(ids)) < self.model.survival.prob(states, dt)
        ids, states = ids[lives], states[lives]
        noise = rng.standard_normal(states.shape)
        return ids, moved_states(self.model.motion, states, dt, noise, np.ones(len(ids), np.bool_))


def born_at(birth: BirthModel, step: int, dt: float, rng: np.random.Generator) -> tuple[Ints, Floats]:
    """Draw the births of one step: (num_born,) sites, and (num_born, state_dim) states.

    dt: s since the last step. With a period, a site gives birth with probability 1 - (1 - r)^(dt / period).
    """
    chances = birth.existence
    if birth.period is not None:
        chances = 1.0 - (1.0 - chances) ** (dt / birth.period)
    drawn = rng.random(birth.num_sites) < chances
    factors = np.linalg.cholesky(birth.covs)
    starts = birth.means + (factors @ rng.standard_normal(birth.means.shape)[:, :, None])[:, :, 0]
    sites = np.flatnonzero(drawn & birth.is_active(step))
    return sites, starts[sites]


@dataclass
class Names:
    """Which label is which true target, in one run.

    A label (step, index) with index < num_sites is the target born at that step and site. Another one is a first
    detection: index - num_sites is the row of its measurement in the scans of the step, joined in the order of the
    sensors. It names a target if this was the first measurement ever made of it, and nothing otherwise.

    Attributes:
        birth: of the targets.
        first: the target of each first detection, by label.
        detected: ids of the targets that have been measured.
        by_site: ids of the targets whose site label the belief has held; they are not named by a first detection.
        num_rows: number of measurements so far.
        num_site_labels: number of site labels so far.
    """

    birth: BirthModel
    first: dict[tuple[int, int], int] = field(default_factory=dict)
    detected: set[int] = field(default_factory=set)
    by_site: set[int] = field(default_factory=set)
    num_rows: int = 0
    num_site_labels: int = 0

    def take(self, step: int, scans: Sequence[Scan | None]) -> None:
        """Add the births and the scans of a step, counted from 1; None for a sensor that did not scan."""
        num_sites = self.birth.num_sites
        self.num_site_labels += num_sites if self.birth.is_active(step) else 0
        origins = [origin for scan in scans if scan is not None for origin in scan.origins.tolist()]
        for row, target in enumerate(origins):
            if target != CLUTTER and target not in self.detected:
                self.detected.add(target)
                self.first[(step, num_sites + row)] = target
        self.num_rows += len(origins)

    def label_scores(self, belief: Any, alive: Ints) -> tuple[Floats, Floats]:
        """Existence of each possible label as believed, and whether it exists (0 or 1); both (num_labels,).

        Labels that the belief could hold but does not are believed not to exist. With `belief.undetected` these are
        first detections, and otherwise (step, site).

        alive: (num_targets,) ids of the targets alive now.
        """
        labels, believed = existence_probabilities(belief)
        by_site = labels[:, 1] < self.birth.num_sites
        held = [self.target_of(label) for label in map(tuple, labels.tolist())]
        self.by_site.update(target for target, site in zip(held, by_site.tolist(), strict=True) if site)
        living = set(alive.tolist())
        exists = [target in living for target in held]
        if getattr(belief, "undetected", None) is None:
            others, missed = self.num_site_labels - len(labels), living.difference(held)
        else:
            others = self.num_rows - int(np.count_nonzero(~by_site))
            exists = [e and (s or t not in self.by_site) for e, s, t in zip(exists, by_site, held, strict=True)]
            missed = (living & self.detected).difference(held, self.by_site)
        found = np.zeros(len(labels) + others)
        found[: len(labels)] = exists
        found[len(labels) : len(labels) + len(missed)] = 1.0
        return np.concatenate([believed, np.zeros(others)]), found

    def target_of(self, label: tuple[int, int]) -> int:
        """Return the id of the target of a label, -1 where a first detection is of none."""
        step, index = label
        if index < self.birth.num_sites:
            return (step - 1) * self.birth.num_sites + index
        return self.first.get(label, -1)
