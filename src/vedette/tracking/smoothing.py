"""Smoothing of whole tracks: estimates of each scan given also the scans after it, of a whole run or with a fixed lag.

H. E. Rauch, F. Tung and C. T. Striebel, "Maximum Likelihood Estimates of Linear Dynamic Systems", AIAA Journal 3, 1965.
C.-J. Kim, "Dynamic Linear Models with Markov-Switching", Journal of Econometrics 60, 1994: modes.
"""

from collections import deque
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB, Estimate, LabelledDensity, as_lmb
from vedette.densities.tracks import places_of, take_tracks
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.smoothing import SmoothedTracks, smoothed_tracks
from vedette.models import Modes, MotionModel, TargetModel, motion_of_filter
from vedette.models.arguments import instance, positive, real, reject

_MAX_COMPONENTS = 10  # of the marginal density of a label at a scan
_LEAST_SHARE = 0.5  # of the filter's existence probability, below which later scans refute an estimate


class TraceEntry(NamedTuple):
    """One scan of a trace: what a tracker believes after it."""

    time: float  # s
    density: LabelledDensity  # such as `State.fused`
    estimate: Estimate  # extracted from it


class _Scan(NamedTuple):
    """The parts of a scan that a smoother needs."""

    time: float  # s
    marginals: LMB  # of all labels
    estimate: Estimate


class _Tracks(NamedTuple):
    """The tracks at a scan, given all scans."""

    time: float  # s
    all_labels: Ints  # (num_labels, 2) of the density, whether they have a track or not
    all_existence: Floats  # (num_labels,)
    labels: Ints  # (num_tracks, 2) in increasing order
    existence: Floats  # (num_tracks,)
    smoothed: SmoothedTracks
    class_probs: Floats  # (num_tracks, num_classes)


class FixedLagSmoother:
    """A smoother of the scans of a tracker, one after the other, in memory bounded by the lag.

    A track ends at the last estimate of its label that later scans do not refute: the existence probability given all
    scans is at least half of the filter's. It is smoothed from there back to the first density that has the label. It
    therefore also has estimates at scans at which the filter did not report it, before it was confirmed and in gaps.
    The density of a label at a scan is its marginal over all hypotheses, of up to ten components.

    Attributes:
        targets: models of the tracker's targets.
        lag_s: time after which the estimates of a scan are final, s. None: the end of the run.

    Raises:
        InputError: no target model, or a lag that is not above 0.
    """

    def __init__(self, targets: TargetModel, lag_s: float | None = None) -> None:
        instance("targets", targets, TargetModel)
        self.targets = targets
        self.lag_s = None if lag_s is None else positive("lag_s", lag_s)
        self._scans: deque[_Scan] = deque()

    def add(self, time: float, density: LabelledDensity, estimate: Estimate) -> tuple[Estimate, ...]:
        """Add a scan, and return the smoothed estimates of the scans that are final now, in order of time.

        Raises `InputError` for a density without labels or of other targets, an estimate of labels that the density
        does not have, or a time before the last.
        """
        now = real("time", time)
        if self._scans and now < self._scans[-1].time:
            last = self._scans[-1].time
            raise InputError(f"time: expected one from that of the last scan on, {last:g} s; got {now:g}")
        self._scans.append(_Scan(now, _marginals(density, estimate, self.targets), estimate))
        if self.lag_s is None:
            return ()
        return self._take(sum(scan.time + self.lag_s <= now for scan in self._scans))

    def finish(self) -> tuple[Estimate, ...]:
        """Return the smoothed estimates of all scans that are left."""
        return self._take(len(self._scans))

    def _take(self, number: int) -> tuple[Estimate, ...]:
        """Return the smoothed estimates of the first scans, and forget these scans."""
        found: list[Estimate] = []
        tracks = None
        for i in reversed(range(len(self._scans) if number else 0)):
            tracks = _smoothed_scan(self._scans[i], self.targets, tracks)
            if i < number:
                found.append(_estimate_of(tracks))
        for _ in range(number):
            self._scans.popleft()
        return tuple(reversed(found))


def smooth(trace: Iterable[TraceEntry], targets: TargetModel, lag_s: float | None = None) -> tuple[Estimate, ...]:
    """Return the smoothed estimates of all scans of a trace, see `FixedLagSmoother`.

    Args:
        trace: of all scans in order of time, from `vedette.recorded.Tracking.run` or an own loop.
        targets: models of the targets, as in the filters.
        lag_s: time of later scans that an estimate uses, s. None: the whole trace.

    Raises:
        InputError: no target model, a lag that is not above 0, a density without labels, or times that decrease.
    """
    smoother = FixedLagSmoother(targets, lag_s)
    early = [estimate for entry in trace for estimate in smoother.add(*entry)]
    return (*early, *smoother.finish())


def _marginals(density: LabelledDensity, estimate: Estimate, targets: TargetModel) -> LMB:
    """Return the marginal densities of all labels. Raises `InputError` as `FixedLagSmoother.add` does."""
    if not isinstance(density, LabelledDensity):
        raise reject("density", "one with labels, a GLMB, an LMB or a FactoredGLMB", type(density).__name__)
    if density.state_dim != targets.state_dim or density.tracks.modes.max(initial=0) >= _num_modes(targets.motion):
        got = f"{density.state_dim} and modes up to {density.tracks.modes.max(initial=0)}"
        raise reject("density", f"states and modes of targets.motion, of dimension {targets.state_dim}", got)
    lmb = as_lmb(density, max_components=_MAX_COMPONENTS)
    unknown = estimate.labels[places_of(estimate.labels, lmb.tracks.labels) < 0]
    if len(unknown):
        raise reject("estimate.labels", "labels of the density", unknown.tolist())
    return lmb


def _smoothed_scan(scan: _Scan, targets: TargetModel, later: _Tracks | None) -> _Tracks:
    """Return the tracks of a scan given all scans after it: those of `later` that it has, and those that end here."""
    time, marginals, estimate = scan
    existence = marginals.existence if later is None else _smoothed_existence(scan, targets, later)
    found: list[tuple[Any, ...]] = []
    if later is not None:
        places = places_of(later.labels, marginals.tracks.labels)
        kept = np.flatnonzero(places >= 0)
        smoothed = SmoothedTracks(*(part[kept] for part in later.smoothed))
        if later.time > time:
            motion = motion_of_filter(targets.motion, targets.survival)
            own = take_tracks(marginals.tracks, places[kept]).to_kernel()
            smoothed = smoothed_tracks(own, motion, later.time - time, smoothed)
        found.append((later.labels[kept], existence[places[kept]], *smoothed, later.class_probs[kept]))
    places = places_of(estimate.labels, marginals.tracks.labels)
    ends = existence[places] >= _LEAST_SHARE * marginals.existence[places]
    if later is not None:
        ends &= places_of(estimate.labels, later.labels) < 0
    ended = estimate.means, estimate.covs, _padded(estimate.mode_probs, targets.motion), estimate.class_probs
    found.append((estimate.labels[ends], existence[places[ends]], *(part[ends] for part in ended)))
    found = [part for part in found if len(part[0])] or found[-1:]
    labels, exist, means, covs, modes, classes = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort(labels.T[::-1])
    smoothed = SmoothedTracks(means[order], covs[order], modes[order])
    return _Tracks(time, marginals.tracks.labels, existence, labels[order], exist[order], smoothed, classes[order])


def _smoothed_existence(scan: _Scan, targets: TargetModel, later: _Tracks) -> Floats:
    """Return the existence probability of each label given all scans, (num_labels,).

    A target that exists later exists now, and one that does not may have died in between: with the probability r after
    the scan, r' given all scans later and that of survival s, it is r' + (1 - r') r (1 - s) / (1 - r s).
    """
    tracks, now = scan.marginals.tracks, scan.marginals.existence
    places = places_of(tracks.labels, later.all_labels)
    then = np.where(places >= 0, np.append(later.all_existence, 0.0)[places], 0.0)
    if later.time == scan.time:
        return then
    survival = targets.survival.prob(tracks.means[tracks.offsets[:-1]], later.time - scan.time)
    dead = 1.0 - now * survival
    died = np.divide(now * (1.0 - survival), dead, out=np.zeros_like(dead), where=dead > 0.0)
    return np.asarray(then + (1.0 - then) * died)


def _padded(mode_probs: Floats, motion: MotionModel) -> Floats:
    """Return the probabilities of modes with a column for each mode, one without modes."""
    return np.pad(mode_probs, ((0, 0), (0, _num_modes(motion) - mode_probs.shape[1])))


def _num_modes(motion: MotionModel) -> int:
    return len(motion.motions) if isinstance(motion, Modes) else 1


def _estimate_of(tracks: _Tracks) -> Estimate:
    means, covs, modes = tracks.smoothed
    modes = modes if modes.shape[1] > 1 else modes[:, :0]
    return Estimate(tracks.labels, means, covs, tracks.existence, tracks.class_probs, modes)
