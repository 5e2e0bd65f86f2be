"""All filters as one: how each is made, stepped through scans of one sensor, believes in a target and counts."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from vedette import models
from vedette.densities import (
    GLMB,
    LMB,
    FactoredGLMB,
    IidCluster,
    MultiBernoulli,
    Poisson,
    cardinality_distribution,
    existence_probabilities,
)
from vedette.filters import (
    CbMemberFilter,
    CphdFilter,
    DeltaGlmbFilter,
    FactoredGlmbFilter,
    Limits,
    LmbFilter,
    MultiSensorGlmbFilter,
    MultiSensorLmbFilter,
    PhdFilter,
    SequentialFactoredFilter,
    SequentialLmbFilter,
)

POSE = np.zeros(3)
NEAR = [[10.0, 10.0]]  # of the first site
REGION = models.Region(-100.0, 100.0, -100.0, 100.0)
CENTRAL: dict[Any, Any] = {
    MultiSensorGlmbFilter: GLMB,
    MultiSensorLmbFilter: LMB,
    SequentialLmbFilter: LMB,
    SequentialFactoredFilter: FactoredGLMB,
}
PMB: Any = partial(FactoredGlmbFilter, max_split_error=2.0)  # in scenarios an lmb with births: poisson
LABELLED: dict[Any, Any] = {
    DeltaGlmbFilter: GLMB,
    LmbFilter: LMB,
    FactoredGlmbFilter: FactoredGLMB,
    PMB: FactoredGLMB,
}
UNLABELLED: dict[Any, Any] = {PhdFilter: Poisson, CphdFilter: IidCluster, CbMemberFilter: MultiBernoulli}
BELIEFS = LABELLED | UNLABELLED | CENTRAL  # what each believes in


@models.model_function("prob_detection")
def given(state, pose, params):
    return params[0]


def birth(num: int = 2, dim: int = 4, existence: Any = 0.3) -> models.BirthModel:
    means = np.full((num, dim), 10.0) + 40.0 * np.arange(num)[:, None]
    return models.BirthModel(np.full(num, existence), means, np.tile(20.0 * np.eye(dim), (num, 1, 1)))


def sensor(**parts: Any) -> models.SensorModel:
    """Of positions; any part may be another."""
    chosen: dict[str, Any] = {
        "measurement": models.position(),
        "noise": models.constant_noise([3.0, 3.0]),
        "detection": models.constant_detection(0.9),
        "clutter": models.region_clutter(2.0, REGION, "position"),
        **parts,
    }
    return models.SensorModel(**chosen)


def targets(**parts: Any) -> models.TargetModel:
    """Two sites of births; any part may be another."""
    motion = parts.get("motion", models.constant_velocity(1.0))
    return models.TargetModel(
        motion, parts.get("survival", models.constant_survival(0.95)), parts.get("birth", birth())
    )


def make(kind: Any, limits: Limits | None = None, **parts: Any) -> Any:
    """A filter of a kind; one of several sensors has one."""
    own = {name: parts.pop(name) for name in ("motion", "survival", "birth") if name in parts}
    seen = sensor(**parts)
    return kind(targets(**own), (seen,) if kind in CENTRAL else seen, limits or Limits())


def step(
    tracker: Any,
    scan: Any = NEAR,
    belief: Any = None,
    pose: Any = POSE,
    dt: Any = 1.0,
    number: Any = 1,
    rng: Any = 0,
) -> Any:
    """Belief and report after a scan of the one sensor; from no target, unless it is said otherwise."""
    prior = tracker.initial() if belief is None else belief
    rng = np.random.default_rng(rng) if rng == 0 else rng
    seen = ([scan], [pose]) if type(tracker) in CENTRAL else (scan, pose)
    return tracker.step(prior, *seen, dt, number, rng=rng)


def expected_number(belief: Any) -> float:
    numbers = cardinality_distribution(belief)
    return float(numbers @ np.arange(len(numbers)))


def existences(belief: Any) -> Any:
    """Of each label; of the targets together where there are no labels."""
    if isinstance(belief, LMB):
        return belief.existence
    if isinstance(belief, Poisson | IidCluster | MultiBernoulli):
        return np.array([belief.expected_number])
    return existence_probabilities(belief)[1]


def believed(kind: Any, existence: float, means: Any, covs: Any) -> Any:
    """Targets that are there with this probability; of a GLMB and an i.i.d. cluster all or none."""
    num, container = len(means), BELIEFS[kind]
    means, covs = np.asarray(means, np.float64), np.asarray(covs, np.float64)
    if container is IidCluster:
        numbers = [1.0 - existence, *[0.0] * (num - 1), existence]
        return IidCluster.from_gaussians(numbers, np.full(num, 1.0 / num), means, covs)
    if container in (Poisson, MultiBernoulli):
        return container.from_gaussians(np.full(num, existence), means, covs)
    lmb = LMB.from_bernoullis([(0, i) for i in range(num)], np.full(num, existence), means, covs)
    if container is GLMB:
        hyps = [(range(num), existence), ([], 1.0 - existence)]
        kept = [hyp for hyp in hyps if hyp[1] > 0.0]
        return GLMB.from_hypotheses(lmb.tracks, [labels for labels, _ in kept], [weight for _, weight in kept])
    return FactoredGLMB.of(lmb) if container is FactoredGLMB else lmb


def components(belief: Any) -> tuple[Any, Any, Any]:
    """Log weights, means and covariances of all Gaussians."""
    table = getattr(belief, "tracks", belief)
    return table.log_weights, table.means, table.covs


def arrays(belief: Any) -> list[Any]:
    """All that a belief holds."""
    tracks = getattr(belief, "tracks", None)
    names = [name for name in type(belief).__match_args__ if name not in ("tracks", "undetected")]
    own = [] if tracks is None else [getattr(tracks, name) for name in type(tracks).__match_args__]
    undetected = getattr(belief, "undetected", None)
    if undetected is not None:
        own += [*undetected.intensity.to_kernel(), np.array(undetected.next_label)]
        own += [] if undetected.cells is None else [undetected.cells.expected]
    return [part for part in (*own, *(getattr(belief, name) for name in names)) if part is not None]
