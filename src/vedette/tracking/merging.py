"""Merging of beliefs with different histories, and fusions with replaced weights."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.fusion import FieldsOfView, Fusion, FusionInfo, LabelMatchedFusion


def merge_equally(
    merging: Fusion, beliefs: Sequence[Any], sensors: Sequence[int], views: FieldsOfView
) -> tuple[Any, FusionInfo | None]:
    """Return the fusion of the sensors' beliefs with equal weights, and its report.

    If all beliefs are the same object, returns that object and None. views: fields of view of all sensors.
    """
    if all(belief is beliefs[0] for belief in beliefs):
        return beliefs[0], None
    fusion = with_weights(merging, [1.0 / len(beliefs)] * len(beliefs))
    return fusion.fuse(beliefs, select_views([views] * len(beliefs), sensors))


def select_views(views: Sequence[FieldsOfView], sensors: Sequence[int]) -> FieldsOfView:
    """Return the fields of view of some sensors, in that order, each taken from its own element of `views`."""
    pairs = list(zip(views, sensors, strict=True))
    return FieldsOfView(
        tuple(view.sensors[s] for view, s in pairs),
        np.array([view.poses[s] for view, s in pairs]),
        tuple(view.scanned[s] for view, s in pairs),
    )


def with_weights(fusion: Fusion, weights: Sequence[float]) -> Fusion:
    """Return the fusion with these weights, one per belief.

    Raises:
        InputError: a fusion that is neither a dataclass with a field `weights` nor a `LabelMatchedFusion` of one.
    """
    names: list[str] = [field.name for field in fields(fusion)] if is_dataclass(fusion) else []
    if "weights" in names:
        return replace(fusion, weights=tuple(weights))  # type: ignore[type-var]
    if isinstance(fusion, LabelMatchedFusion):
        return replace(fusion, rule=with_weights(fusion.rule, weights))
    raise InputError(
        f"fusion: expected a dataclass with a field weights, as each sensor of a network fuses other beliefs; got "
        f"{type(fusion).__name__}"
    )
