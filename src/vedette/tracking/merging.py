"""Beliefs of different pasts as one, and a fusion under other weights than its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

from vedette.errors import InputError
from vedette.fusion import Fusion, FusionInfo, Matched, Views


def merged(
    merging: Fusion, beliefs: Sequence[Any], sensors: Sequence[int], views: Views
) -> tuple[Any, FusionInfo | None]:
    """The one belief of these sensors under equal weights, and what was done; the first where all are the same object.

    views: of all sensors.
    """
    if all(belief is beliefs[0] for belief in beliefs):
        return beliefs[0], None
    equal = with_weights(merging, [1.0 / len(beliefs)] * len(beliefs))
    return equal.fuse(beliefs, views_of(views, sensors))


def views_of(views: Views, sensors: Sequence[int]) -> Views:
    """The views of some of the sensors, in that order."""
    return replace(
        views,
        sensors=tuple(views.sensors[s] for s in sensors),
        poses=views.poses[list(sensors)],
        scanned=tuple(views.scanned[s] for s in sensors),
    )


def with_weights(fusion: Fusion, weights: Sequence[float]) -> Fusion:
    """The fusion under these weights, one a belief.

    Raises:
        InputError: a fusion that is no dataclass with a field `weights`, nor one that matches labels for such a rule.
    """
    names: list[str] = [field.name for field in fields(fusion)] if is_dataclass(fusion) else []
    if "weights" in names:
        return replace(fusion, weights=tuple(weights))  # type: ignore[type-var]
    if isinstance(fusion, Matched):
        return replace(fusion, rule=with_weights(fusion.rule, weights))
    raise InputError(
        f"fusion: expected a dataclass with a field weights, as each sensor of a network fuses other beliefs; got "
        f"{type(fusion).__name__}"
    )
