"""Networks of sensors that send their beliefs: fusion of the received beliefs, or consensus."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB
from vedette.errors import InputError
from vedette.filters import FilterInfo
from vedette.fusion import FieldsOfView, Fusion, FusionInfo, LabelMatchedFusion, requires_common_prior
from vedette.fusion.matching import common_labels, relabelled
from vedette.fusion.rebasing import rebase, with_labels_of
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import reject
from vedette.tracking.base import StageTimer, State, TrackerInfo, check_step
from vedette.tracking.births import birth_candidates, births_from_received_scans, combine_births
from vedette.tracking.distributed import check_birth_labels
from vedette.tracking.local import LocalFilters
from vedette.tracking.merging import merge_equally, select_views, with_weights
from vedette.tracking.network import NEVER, Network, hop_counts, message_bytes, metropolis_weights, received_from


class _SentMessages(NamedTuple):
    """The messages that the sensors sent at a step, and the steps at which the others receive them."""

    step: int
    time: float
    poses: Floats  # of the sensors at this step
    scanned: tuple[bool, ...]
    predictions: tuple[Any, ...]  # prediction that each belief was updated from, if the fusion divides by it; else None
    beliefs: tuple[Any, ...]
    arrives: Ints  # (num_sensors, num_sensors) from `Network.arrivals`


class _Memory(NamedTuple):
    """Birth candidates of each sensor for the next step, and the messages that may still be on their way."""

    births: tuple[LMB | None, ...]
    sent: tuple[_SentMessages, ...]


@dataclass(frozen=True, slots=True, eq=False)
class BeliefNetwork(LocalFilters):
    """Tracker with a filter at each sensor. Each sensor replaces its belief by the fusion of the beliefs it received.

    A sensor fuses the newest belief that it has received from each other sensor, predicted to the time of its own. If
    the fusion divides by the common prediction and the sensors' predictions differ (for example if two groups have met
    again, or after few rounds of consensus), the predictions are first merged, and the information of each scan is then
    added to the merged prediction.

    Consensus: after L rounds of averaging with Metropolis weights W, a sensor has the average of all sensors' inputs
    with the weights in its row of W^L. It is computed as that average. For sums, as in `ParallelUpdate`, the average is
    multiplied by the number of sensors in the group. As L grows, both converge to the result of all sensors together.

    Attributes:
        filters: one per sensor. All have the same target model.
        targets, sensors: as in `Tracker`.
        fusion: fusion of the received beliefs. Its weights are replaced by equal ones, or by those of the consensus.
        network: radio network between the sensors.
        merging: fusion of predictions with different histories, and of the sensors' beliefs into the one that is
            reported if they differ. Its weights are replaced in the same way.

    Raises:
        InputError: filters as in `Distributed`; a fusion without weights; a fusion that divides by the common
            prediction, with delayed messages; a fusion by label, if sensors label births from their own measurements.
    """

    fusion: Fusion
    network: Network
    merging: Fusion

    def __post_init__(self) -> None:
        LocalFilters.__post_init__(self)  # slots replace the class that super() looks for
        if not isinstance(self.network, Network):
            raise reject("network", "a Network", self.network)
        for rule in (self.fusion, self.merging):
            with_weights(rule, [1.0])
        check_birth_labels(self.fusion, self.targets)
        if requires_common_prior(self.fusion) and self.network.delay > 0:
            raise InputError("network.delay: expected 0, as the fusion divides by the prediction of the same time")

    def initial(self) -> State:
        """Return the state without targets: one belief, which all sensors share."""
        belief = self.filters[0].initial()
        return State((belief,) * len(self.filters), belief, memory=_Memory((None,) * len(self.filters), ()))

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Filter each sensor's scan, send the beliefs and fuse those that have arrived. See `Tracker.step`."""
        pose_array, dt = check_step(state, scans, poses, time, rngs, self, len(self.filters))
        if dt == 0.0 and self.network.delay > 0:
            expected = f"one after that of the last scan, {time:g} s, as beliefs that are late would count again"
            raise reject("time", expected, time)
        step, timer, num = state.step + 1, StageTimer(), len(self.filters)
        hops = hop_counts(self.network.links(pose_array, rngs[0]))
        with timer.timing("filter"):
            predictions, local, infos = self._filter(state, scans, pose_array, dt, rngs)
        scanned, arrives = tuple(scan is not None for scan in scans), self.network.arrivals(hops, step)
        sent = _SentMessages(step, float(time), pose_array, scanned, predictions, local, arrives)
        pending = (*state.memory.sent, sent)
        with timer.timing("fusion"):
            fused, reports = self._fuse_received(pending, hops)
            merged_belief, report = merge_equally(self.merging, self._for_fusion(fused), range(num), self._views(sent))
        with timer.timing("births"):
            before = state.memory.births if dt == 0.0 else (None,) * num
            births = self._births(before, fused, scans, pose_array, sent)
        max_delay = self.network.longest_delay(num)
        memory = _Memory(births, tuple(own for own in pending if own.step + max_delay > step))
        messages: list[tuple[Any, ...]] = [(belief,) for belief in local]
        if requires_common_prior(self.fusion) and len({id(own) for own in predictions}) > 1:
            messages = list(zip(local, predictions, strict=True))
        bytes_sent = message_bytes(self.network, hops, messages)
        info = TrackerInfo(infos, report or reports[0], timer.seconds, bytes_sent)
        return State(tuple(fused), merged_belief, step, float(time), memory), info

    def _filter(
        self, state: State, scans: Sequence[Any], poses: Floats, dt: float, rngs: Sequence[np.random.Generator]
    ) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[FilterInfo, ...]]:
        """Return the predictions (None unless the fusion divides by them), posteriors and reports of all sensors."""
        step, birth = state.step + 1, self.targets.birth
        predictions: list[Any] = []
        predicted: dict[tuple[int, int], Any] = {}
        results = []
        for s, (belief, candidates) in enumerate(zip(state.local, state.memory.births, strict=True)):
            births = birth_candidates(birth, step, dt, candidates)
            if not requires_common_prior(self.fusion):
                predictions.append(None)
                results.append(self._step_filter(s, belief, scans[s], poses[s], dt, step, births, rngs[s]))
                continue
            key = id(belief), id(candidates)  # sensors with the same belief share one prediction object
            if key not in predicted:
                predicted[key], _ = self._predict(s, belief, dt, step, births)
            predictions.append(predicted[key])
            results.append(self._update(s, predicted[key], scans[s], poses[s], rngs[s]))
        beliefs, infos = zip(*results, strict=True)
        return tuple(predictions), beliefs, infos

    def _fuse_received(self, pending: Sequence[_SentMessages], hops: Ints) -> tuple[list[Any], list[FusionInfo | None]]:
        """Return each sensor's fused belief and report. Sensors that fused the same messages share one object."""
        now, num = pending[-1], len(self.filters)
        shares = self._weights(hops)
        cache: dict[tuple[Any, ...], tuple[Any, FusionInfo | None]] = {}
        beliefs, reports = [], []
        for i in range(num):
            newest = [
                max((own for own in pending if own.arrives[i, j] <= now.step), key=lambda own: own.step, default=None)
                for j in range(num)
            ]
            messages = {j: sent for j, sent in enumerate(newest) if sent is not None and shares[i, j] > 0.0}
            weights = shares[i, list(messages)]
            if not requires_common_prior(self.fusion):  # of a mean
                weights = weights / weights.sum()
            key = (*((j, sent.step) for j, sent in messages.items()), *weights.tolist())
            if key not in cache:
                cache[key] = self._fuse(list(messages.values()), list(messages), weights)
            belief, report = cache[key]
            beliefs.append(belief)
            reports.append(report)
        return beliefs, reports

    def _fuse(
        self, messages: Sequence[_SentMessages], senders: Sequence[int], weights: Floats
    ) -> tuple[Any, FusionInfo | None]:
        """Return the fusion of these sensors' messages and its report.

        weights: of a mean, or of a sum if the fusion divides by the prediction.
        """
        views = select_views([self._views(sent) for sent in messages], senders)
        if not requires_common_prior(self.fusion):
            now = max(messages, key=lambda sent: sent.step)
            current = [self._current(sent, now, j) for sent, j in zip(messages, senders, strict=True)]
            if len(current) == 1:
                return current[0], None
            fused, report = with_weights(self.fusion, weights.tolist()).fuse(self._for_fusion(current), views)
            return self._as_filter_density(fused), report
        predictions = [sent.predictions[j] for sent, j in zip(messages, senders, strict=True)]
        posteriors = [sent.beliefs[j] for sent, j in zip(messages, senders, strict=True)]
        base = predictions[0]
        if any(prediction is not base for prediction in predictions):
            if isinstance(self.merging, LabelMatchedFusion):
                names = common_labels(predictions, gate_probability=self.merging.gate_probability)
                predictions = list(map(relabelled, predictions, names))
                posteriors = list(map(relabelled, posteriors, names))
            merging = with_weights(self.merging, (weights / weights.sum()).tolist())
            base, _ = merging.fuse(self._for_fusion(predictions), views.if_all_scanned())
            for prediction in predictions:
                base = with_labels_of(base, prediction)
        posteriors = [rebase(*pair, base) for pair in zip(posteriors, predictions, strict=True)]
        fused, report = with_weights(self.fusion, weights.tolist()).fuse(posteriors, replace(views, prediction=base))
        return self._drop_labels(fused), report

    def _views(self, sent: _SentMessages) -> FieldsOfView:
        return FieldsOfView(self.sensors, sent.poses, sent.scanned)

    def _current(self, sent: _SentMessages, now: _SentMessages, sensor: int) -> Any:
        """Return a sensor's belief, predicted without births to the time of the step `now`."""
        if sent is now:
            return sent.beliefs[sensor]
        no_births = LMB.empty(self.targets.birth)
        elapsed = now.time - sent.time
        return self._predict(sensor, sent.beliefs[sensor], elapsed, now.step, no_births)[0]

    def _weights(self, hops: Ints) -> Floats:
        """Weight that each sensor gives to each sensor of its group, received or not, (num_sensors, num_sensors)."""
        groups = hops < NEVER
        sizes = groups.sum(axis=1, keepdims=True)
        rounds = self.network.consensus_rounds
        shares = groups / sizes if rounds is None else np.linalg.matrix_power(metropolis_weights(hops == 1), rounds)
        return np.asarray(shares * sizes if requires_common_prior(self.fusion) else shares)

    def _births(
        self,
        earlier: Sequence[LMB | None],
        fused: Sequence[Any],
        scans: Sequence[Any],
        poses: Floats,
        sent: _SentMessages,
    ) -> tuple[LMB | None, ...]:
        """Return each sensor's birth candidates for the next step.

        Sensors with the same belief and the same received scans share one object. earlier: candidates from earlier
        scans of the same time.
        """
        birth, num = self.targets.birth, len(fused)
        if birth.from_measurements is None:
            return (None,) * num
        cache: dict[tuple[Any, ...], LMB | None] = {}
        births = []
        for i, belief in enumerate(fused):
            received = received_from(i, sent.arrives, sent.step)
            key = id(belief), id(earlier[i]), received
            if key not in cache:
                candidates = births_from_received_scans(
                    birth, belief, self.sensors, scans, poses, sent.step + 1, received, self.targets.motion
                )
                cache[key] = combine_births(birth, earlier[i], candidates)
            births.append(cache[key])
        return tuple(births)
