"""Sequences of actions: the actions of a platform over several decisions, as one action."""

from dataclasses import dataclass

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.fields import Count, Positive, check_fields
from vedette.platforms.base import Platform, actions_at, check_platform, course_of, prices_of, scans_of

# Maximum number of sequences listed; it grows as a power of the number of actions.
MAX_SEQUENCES = 1_000_000

# Tolerance for the time of a decision, as a fraction of a period, because sums of periods are rounded.
_AT_ONCE = 1e-9


@dataclass(frozen=True, slots=True)
class Sequences:
    """Several successive actions of another platform, as one action.

    At the time of a later decision the platform has the pose that its previous action led to. After the last one the
    action continues.

    Attributes:
        platform: the platform whose actions are combined. Its later actions are those at the pose where it then is, so
            sequences are the paths through a tree.
        period: s, from the beginning of an action to that of the next.
        depth: number of actions.

    Raises:
        InputError: no platform, a period that is not above 0, a depth below 1.
    """

    platform: Platform
    period: Positive
    depth: Count

    def __post_init__(self) -> None:
        check_platform("platform", self.platform)
        check_fields(self)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the platform for each stage, counted from 1: `heading_deg_1`, `heading_deg_2`, ..."""
        return tuple(f"{name}_{stage}" for stage in range(1, self.depth + 1) for name in self.platform.columns)

    def actions(self, pose: Floats) -> Floats:
        """Return (num_sequences, depth * num_columns of the platform), the last stage fastest.

        Raises `InputError` for more than a million sequences, and for invalid actions or poses.
        """
        rows, poses = np.empty((1, 0)), pose[np.newaxis]
        own: list[Floats] = []
        for stage in range(self.depth):
            if stage > 0:
                poses = self._ends(poses, own)
            own = [actions_at("platform", self.platform, at).values for at in poses]
            if (num := sum(map(len, own))) > MAX_SEQUENCES:
                raise InputError(
                    f"depth: expected at most {MAX_SEQUENCES} sequences of actions; got {num} after {stage + 1} of "
                    f"{self.depth} decisions"
                )
            rows = np.hstack([np.repeat(rows, [len(actions) for actions in own], axis=0), np.concatenate(own)])
        return rows

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return the courses of the actions one after the other, each from the end of the one before."""
        return self._followed(pose, action, times)[0]

    def prices(self, actions: Floats) -> Floats:
        """Return prices (num_sequences,), the sums over their actions."""
        num = len(self.platform.columns)
        stages = [actions[:, stage * num : (stage + 1) * num] for stage in range(self.depth)]
        return np.asarray(sum(prices_of("platform", self.platform, rows) for rows in stages))

    def scans(self, pose: Floats, actions: Floats, times: Floats) -> Bools:
        """Return (num_sequences, num_times) whether their successive actions let the sensor scan."""
        return np.array([self._followed(pose, action, times)[1] for action in actions])

    def _followed(self, pose: Floats, action: Floats, times: Floats) -> tuple[Floats, Bools]:
        """Return poses (num_times, pose_dim) of a sequence, and (num_times,) whether the sensor scans."""
        poses, stages, num = np.tile(pose, (len(times), 1)), self._stages(times), len(self.platform.columns)
        scans, at = np.ones(len(times), np.bool_), pose
        for stage in range(self.depth):
            own, row = stages == stage, action[stage * num : (stage + 1) * num]
            moments = np.append(times[own] - stage * self.period, self.period)
            course = course_of("platform", self.platform, at, row, moments)
            scans[own] = scans_of("platform", self.platform, at, row[np.newaxis], moments[:-1])[0]
            poses[own], at = course[:-1], course[-1]
        return poses, scans

    def _ends(self, poses: Floats, actions: list[Floats]) -> Floats:
        """Return the poses at the end of the actions from each pose, when the next ones begin."""
        end, pairs = np.array([self.period]), zip(poses, actions, strict=True)
        ends = [course_of("platform", self.platform, at, row, end)[0] for at, own in pairs for row in own]
        return np.array(ends)

    def _stages(self, times: Floats) -> Ints:
        """Return (num_times,) the index of the present action, counted from 0."""
        begun = np.ceil(times / self.period - _AT_ONCE) - 1.0
        return np.asarray(np.clip(begun, 0, self.depth - 1).astype(np.int64))
