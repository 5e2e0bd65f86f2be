"""The fused density predicted to the end of the horizon, from which every decision starts."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from vedette.densities import LMB, Labelled, track_moments
from vedette.densities.containers import for_kernel, unchecked
from vedette.densities.conversions import collapsed
from vedette.densities.label_sets import possible
from vedette.densities.tracks import gaussian_tracks, single_gaussians
from vedette.filters.inputs import model_errors
from vedette.kernels.base.types import Lmb
from vedette.kernels.planning.reach import Paths, predict_paths
from vedette.models import MotionModel, constant_survival, kernel_motion

_Labelled = TypeVar("_Labelled", bound=Labelled)

# No deaths over the horizon. All decisions share this model, so that the cached kernel input of a motion is found.
ALWAYS_SURVIVES = constant_survival(1.0)


class Prediction(NamedTuple):
    """A fused LMB over the horizon, without birth or death."""

    fused: LMB  # that it is of
    now: Lmb  # the same of one Gaussian a label, as kernels take it
    paths: Paths  # of its labels
    end: LMB  # at the end of the horizon, of one Gaussian a label

    @classmethod
    def of(cls, fused: LMB, motion: MotionModel, num_steps: int, period: float) -> Prediction:
        """Predict over `num_steps` steps of `period` seconds. Call it within `model_errors`."""
        tracks, logits = single_gaussians(fused.tracks).to_kernel(), fused.existence_logit
        own = kernel_motion(motion, ALWAYS_SURVIVES)
        paths = predict_paths(own, float(period), int(num_steps), tracks.components.means, tracks.components.covs)
        end = unchecked(LMB, gaussian_tracks(tracks.labels, paths.means[:, -1], paths.covs[:, -1]), logits)
        return cls(fused, Lmb(tracks, for_kernel(logits)), paths, end)


def predicted(fused: _Labelled, motion: MotionModel, num_steps: int, period: float) -> _Labelled:
    """The fused density at the end of the horizon, without birth or death (paper, "pseudo-prediction").

    Tracks are first collapsed to one Gaussian each (GLMBs are marginalised), as those of the pseudo-updates are. Label
    sets of weight zero are left out of a GLMB.
    """
    single = possible(collapsed(fused))
    means, covs = track_moments(single.tracks)
    with model_errors():
        paths = predict_paths(kernel_motion(motion, ALWAYS_SURVIVES), float(period), int(num_steps), means, covs)
    tracks = gaussian_tracks(single.tracks.labels, paths.means[:, -1], paths.covs[:, -1])
    return single.with_fields(tracks=tracks)
