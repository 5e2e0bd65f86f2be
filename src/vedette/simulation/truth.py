"""True targets: the truth of a run, and targets that follow a motion model."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from vedette.internal.representation import SummaryRepr
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models import Modes, MotionModel
from vedette.models.arguments import float_array, generator, reject
from vedette.simulation.true_motion import detection_factors_of, manoeuvring_target, moved_states

# s. Start times and scan times come from different sums; they count as equal within this tolerance.
TIME_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Truth(SummaryRepr):
    """The targets alive at each scan, scan by scan.

    Attributes:
        times: (num_scans,) s, increasing.
        offsets: (num_scans + 1,) targets of scan `k` are the rows `offsets[k]:offsets[k + 1]`.
        ids: (total,) id of the target, at least 0, at most once per scan.
        states: (total, state_dim) state of the target, position first.
        detection_factors: (total,) factor of the target's mode on its probability of detection. None: all 1.
    """

    times: Floats
    offsets: Ints
    ids: Ints
    states: Floats
    detection_factors: Floats | None = None

    @property
    def num_scans(self) -> int:
        """Number of scans."""
        return len(self.times)

    @property
    def scans(self) -> Ints:
        """(total,) scan of each row, counted from 0."""
        return np.repeat(np.arange(self.num_scans), np.diff(self.offsets))

    def at(self, scan: int) -> tuple[Ints, Floats]:
        """(n,) ids and (n, state_dim) states of the targets alive at scan `scan`, counted from 0."""
        if not 0 <= scan < self.num_scans:
            raise reject("scan", f"a scan from 0 to {self.num_scans - 1}", scan)
        rows = slice(self.offsets[scan], self.offsets[scan + 1])
        return self.ids[rows], self.states[rows]

    def detection_factors_at(self, scan: int) -> Floats:
        """(n,) factors on the probabilities of detection of the targets of `at`."""
        first, end = self.offsets[scan : scan + 2].tolist()
        return np.ones(end - first) if self.detection_factors is None else self.detection_factors[first:end]

    def first(self, num_scans: int) -> "Truth":
        """Return the truth of the first scans."""
        return self.between(0, num_scans)

    def between(self, first: int, end: int) -> "Truth":
        """Return the truth of the scans from `first`, counted from 0, to the one before `end`."""
        rows = slice(self.offsets[first], self.offsets[end])
        offsets = self.offsets[first : end + 1] - self.offsets[first]
        factors = None if self.detection_factors is None else self.detection_factors[rows]
        return Truth(self.times[first:end], offsets, self.ids[rows], self.states[rows], factors)

    def validate(self) -> None:
        """Raise `InputError` unless the arrays fit together as described above."""
        scan_times(self.times)
        offsets = self.offsets
        if len(offsets) != self.num_scans + 1 or offsets[0] != 0 or (np.diff(offsets) < 0).any():
            raise reject("Truth.offsets", f"{self.num_scans + 1} counts from 0, never falling", offsets)
        float_array("Truth.states", self.states, (int(offsets[-1]), None))
        if self.ids.shape != (offsets[-1],) or (self.ids < 0).any():
            raise reject("Truth.ids", f"{offsets[-1]} ids of at least 0", self.ids)
        scans = self.scans
        order = np.lexsort((self.ids, scans))
        twice = (np.diff(self.ids[order]) == 0) & (np.diff(scans[order]) == 0)
        if twice.any():
            scan = int(scans[order][:-1][twice][0])
            raise reject("Truth.ids", f"each id once in scan {scan}", self.at(scan)[0])

    @classmethod
    def from_arrays(
        cls, times: Floats, alive: Bools, states: Floats, detection_factors: Floats | None = None
    ) -> "Truth":
        """Return the truth for (num_targets, num_scans) flags and (num_targets, num_scans, state_dim) states.

        Row i is target i. detection_factors: (num_targets, num_scans), or None as in `Truth`.
        """
        scans, targets = np.nonzero(alive.T)
        offsets = np.concatenate([[0], np.cumsum(alive.sum(axis=0))]).astype(np.int64)
        factors = None if detection_factors is None else detection_factors[targets, scans]
        return cls(times, offsets, targets.astype(np.int64), np.ascontiguousarray(states[targets, scans]), factors)


class TargetSource(Protocol):
    """Source of the targets of a simulated run."""

    def truth(self, times: ArrayLike, *, rng: np.random.Generator) -> Truth:
        """Return the targets at each of (num_scans,) increasing scan times in seconds."""


def scan_times(times: ArrayLike) -> Floats:
    """(num_scans,) checked scan times, at least one, increasing."""
    values = float_array("times", times, (None,))
    if len(values) == 0 or (np.diff(values) <= 0.0).any():
        raise reject("times", "one or more increasing times", values.tolist())
    return values


@dataclass(frozen=True, slots=True, eq=False)
class ScriptedTargets:
    """Targets that start from given states and follow a motion model.

    Attributes:
        motion: motion model. Of one with modes, targets without process noise keep the first mode.
        initial_states: (num_targets, state_dim) state of each at its start time.
        start_times: (num_targets,) s. None: the first scan.
        end_times: (num_targets,) last time of each, included, s. Infinite or None: to the end.
        process_noise: whether the motion's process noise is applied, one flag, or one per target.
        initial_stds: (num_targets, state_dim) standard deviations of the initial states, which each run draws anew
            around `initial_states`, components independent. None: all zero.
    """

    motion: MotionModel
    initial_states: Floats
    start_times: Floats | None = None
    end_times: Floats | None = None
    process_noise: bool | Sequence[bool] = False
    initial_stds: Floats | None = None

    def __post_init__(self) -> None:
        states = float_array("ScriptedTargets.initial_states", self.initial_states, (None, self.motion.state_dim))
        num = len(states)
        object.__setattr__(self, "initial_states", states)
        if self.start_times is not None:
            starts = float_array("ScriptedTargets.start_times", self.start_times, (num,))
            object.__setattr__(self, "start_times", starts)
        ends = np.full(num, np.inf) if self.end_times is None else self.end_times
        ends = float_array("ScriptedTargets.end_times", ends, (num,), finite=False)
        object.__setattr__(self, "end_times", ends)
        if self.start_times is not None and (ends < self.start_times).any():
            raise reject("ScriptedTargets.end_times", "times from start_times on", ends.tolist())
        flags = np.array(self.process_noise)
        if flags.dtype != np.bool_ or flags.shape not in ((), (num,)):
            raise reject("ScriptedTargets.process_noise", f"one boolean, or {num}", self.process_noise)
        if self.initial_stds is not None:
            stds = float_array("ScriptedTargets.initial_stds", self.initial_stds, states.shape)
            if (stds < 0.0).any():
                raise reject("ScriptedTargets.initial_stds", "numbers of at least 0", stds.tolist())
            object.__setattr__(self, "initial_stds", stds)

    def truth(self, times: ArrayLike, *, rng: np.random.Generator) -> Truth:
        """Propagate each target from its start time through the scans.

        Initial states are drawn if `initial_stds` is given, and process noise is added where `process_noise` is set.

        Raises:
            InputError: the scan times do not increase.
            ModelError: a motion function raised, or returned a state that is not finite.
        """
        scans = scan_times(times)
        generator(rng)
        num = len(self.initial_states)
        starts = np.full(num, scans[0]) if self.start_times is None else self.start_times
        ends = np.asarray(self.end_times)
        noisy = np.broadcast_to(np.array(self.process_noise), (num,))
        alive = (scans >= starts[:, None] - TIME_TOLERANCE) & (scans <= ends[:, None] + TIME_TOLERANCE)
        states = np.zeros((num, len(scans), self.motion.state_dim))
        first = self.initial_states
        if self.initial_stds is not None:
            first = first + self.initial_stds * rng.standard_normal(first.shape)
        elapsed = _elapsed(scans, np.asarray(starts), alive)
        if isinstance(self.motion, Modes):
            modes = np.zeros(alive.shape, np.int64)
            for i, own in enumerate(rng.spawn(num)):
                states[i], modes[i] = manoeuvring_target(self.motion, first[i], elapsed[i], own if noisy[i] else None)
            return Truth.from_arrays(scans, alive, states, detection_factors_of(self.motion, modes))
        normals = np.zeros_like(states)
        # Ordered by target and then by time, so that the noise of a target does not depend on the lives of the others.
        moves = (elapsed > 0.0) & noisy[:, None]
        normals[moves] = rng.standard_normal((np.count_nonzero(moves), self.motion.state_dim))
        state = np.array(first)
        for scan, (steps, is_alive) in enumerate(zip(elapsed.T, alive.T, strict=True)):
            for dt in set(steps.tolist()) - {0.0}:
                due = steps == dt
                state[due] = moved_states(self.motion, state[due], dt, normals[due, scan], noisy[due])
            states[is_alive, scan] = state[is_alive]
        return Truth.from_arrays(scans, alive, states)


def _elapsed(scans: Floats, starts: Floats, alive: Bools) -> Floats:
    """(num_targets, num_scans) time by which a target moves before a scan, s, or 0 if it does not.

    It is the time since its previous scan or its start.
    """
    elapsed, since = np.zeros(alive.shape), starts.copy()
    for scan, time in enumerate(scans.tolist()):
        due = alive[:, scan] & (time - since > TIME_TOLERANCE)
        elapsed[due, scan] = time - since[due]
        since[due] = time
    return elapsed
