"""Rewards of joint actions without forming a fused density: Cauchy-Schwarz divergence of fused pseudo-posteriors.

The same sums as `fusion.fuse` followed by `divergence.cauchy_schwarz` on the common support, over arrays that are laid
out once for all joint actions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_expit, logit

from vedette.control.layout import Laid, Layout, common_layout, lay_out
from vedette.control.priors import offsets_of
from vedette.control.pseudo import PseudoPosteriors
from vedette.control.threads import run_chunks
from vedette.densities import GLMB, LMB
from vedette.densities.checks import unchecked
from vedette.divergence import log_inner_product
from vedette.errors import InputError
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.information import row_size
from vedette.kernels.planning.fused_divergence import Cases, Prediction
from vedette.kernels.planning.rewards import reward_table, write_rows


@dataclass(frozen=True, slots=True, eq=False)
class FusedRewards:
    """Pseudo-posteriors of some sensors and the prediction, laid out for a kernel that rewards any joint actions.

    Attributes:
        cases, prediction: as `vedette.kernels.planning.fused_divergence` has them; the cases of one sensor follow
            another's.
        first_cases: (num_sensors,) first case of each sensor.
        num_samples, state_dim, log_unit_volume, is_lmb, num_threads: what the kernel is told besides.
    """

    cases: Cases
    prediction: Prediction
    first_cases: Ints
    num_samples: int
    state_dim: int
    log_unit_volume: float
    is_lmb: bool
    num_threads: int

    def __call__(self, actions: Ints) -> Floats:
        """(num_joint, num_samples) rewards of joint actions (num_joint, num_sensors)."""
        rewards = np.empty((len(actions), self.num_samples))

        def work(first: int, last: int) -> None:
            reward_table(
                self.cases, self.first_cases, actions, self.num_samples, self.prediction, self.state_dim,
                self.log_unit_volume, self.is_lmb, first, last, rewards,
            )  # fmt: skip

        run_chunks(work, len(rewards), self.num_threads)
        return rewards


def fused_rewards(
    posteriors: Sequence[PseudoPosteriors],
    prediction: GLMB | LMB,
    fusion: CmDeltaGlmb | Clmb,
    num_samples: int,
    unit_volume: float,
    num_threads: int,
) -> FusedRewards:
    """Lay out what the rewards of the sensors' joint actions depend on.

    Args:
        posteriors: one a sensor, all GLMB or all LMB as the fusion wants, of finite log weights (existences above 0).
        prediction: one Gaussian a track, marginalised if a GLMB.
        fusion: its weights, one a sensor and above 0, and its floor.
        num_samples: cases of each action.
        unit_volume: K.
        num_threads: that share the work; the result does not depend on it.

    Raises:
        InputError: prediction and posteriors have no label set in common.
        NumericalError: a covariance is not positive definite.
    """
    layout = common_layout(prediction, posteriors)
    if len(layout.sets) == 0 and isinstance(prediction, GLMB):
        raise InputError("fused belief: expected a label set in common with the local beliefs; got none")
    floor = float(logit(fusion.missing_existence)) if isinstance(fusion, Clmb) else fusion.missing_log_weight
    laid = [lay_out(own, layout, floor) for own in posteriors]
    num_cases = [len(own.log_weights) for own in posteriors]
    return FusedRewards(
        _cases(laid, fusion.weights, layout, num_threads),
        _prediction(layout, unit_volume),
        offsets_of(num_cases)[:-1].copy(),
        num_samples,
        prediction.state_dim,
        math.log(unit_volume),
        isinstance(prediction, LMB),
        num_threads,
    )


def _cases(laid: Sequence[Laid], weights: Sequence[float] | Floats, layout: Layout, num_threads: int) -> Cases:
    is_lmb = isinstance(layout.prediction, LMB)
    starts = offsets_of([len(one.log_weights) for one in laid])
    rows = np.empty((int(starts[-1]), len(layout.references), int(row_size(layout.references.shape[1]))))
    present, absent, held = [], [], []
    for one, weight, start in zip(laid, weights, starts.tolist(), strict=False):
        mine = rows[start : start + len(one.log_weights)]

        def work(first: int, last: int, one: Laid = one, weight: float = weight, mine: Floats = mine) -> None:
            write_rows(first, last, one.known, one.means, one.covs, layout.references, float(weight), mine)

        run_chunks(work, len(mine), num_threads)
        present.append(weight * (log_expit(one.log_weights) if is_lmb else one.log_weights))
        absent.append(weight * log_expit(-one.log_weights) if is_lmb else np.zeros_like(one.log_weights))
        held.append(np.tile(one.held, (len(mine), 1)))
    return Cases(layout.set_offsets, np.concatenate(present), np.concatenate(absent), np.concatenate(held), rows)


def _prediction(layout: Layout, unit_volume: float) -> Prediction:
    """The prediction laid out as the cases are."""
    common = layout.prediction
    if isinstance(common, LMB):
        members = np.arange(common.tracks.num_tracks)
        present, absent = log_expit(common.existence_logit), log_expit(-common.existence_logit)
    else:
        members = common.hyp_tracks
        present, absent = common.hyp_log_weights, np.zeros(common.num_hyps)
    means = np.ascontiguousarray(common.tracks.means[members])[np.newaxis]
    covs = np.ascontiguousarray(common.tracks.covs[members])[np.newaxis]
    rows = np.empty((1, len(members), int(row_size(common.state_dim))))
    write_rows(0, 1, np.ones(len(members), np.int64), means, covs, layout.references, 1.0, rows)
    return Prediction(present, absent, rows[0], 0.0, _log_self_product(common, unit_volume))


def _log_self_product(prediction: GLMB | LMB, unit_volume: float) -> float:
    """log <prediction, prediction> of an LMB, or of a GLMB that need not be normalised."""
    if isinstance(prediction, LMB):
        return log_inner_product(prediction, prediction, unit_volume=unit_volume)
    total = float(np.logaddexp.reduce(prediction.hyp_log_weights))
    log_weights = prediction.hyp_log_weights - total
    scaled = unchecked(GLMB, prediction.tracks, prediction.hyp_offsets, prediction.hyp_tracks, log_weights)
    return log_inner_product(scaled, scaled, unit_volume=unit_volume) + 2.0 * total
