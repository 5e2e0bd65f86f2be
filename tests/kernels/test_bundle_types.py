"""The quick way to the type of a bundle of models gives the same as the slow one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba import typeof, types

from vedette import models
from vedette.kernels.base.compile import JIT_ENABLED
from vedette.models import kernel_motion

pytestmark = pytest.mark.skipif(not JIT_ENABLED, reason="nothing is compiled")


def slowly(bundle: Any) -> Any:
    return types.NamedTuple([typeof(field) for field in bundle], type(bundle))


def test_bundles_of_models_have_the_type_of_their_fields() -> None:
    survival = models.constant_survival(0.9)
    bundles: list[Any] = [
        kernel_motion(models.constant_velocity(1.0), survival),
        kernel_motion(models.coordinated_turn(1.0, 0.1), survival),
    ]
    noise, detection = models.constant_noise([1.0, 1.0]), models.constant_detection(0.9)
    clutter = models.region_clutter(5.0, models.Region(-5.0, 5.0, -5.0, 5.0), "position")
    bundles.append(models.SensorModel(models.position(), noise, detection, clutter).to_kernel())
    for bundle in bundles:
        assert typeof(bundle) == slowly(bundle)
        assert typeof(bundle) is typeof(bundle._replace(noise_params=bundle.noise_params.copy()))


def test_what_changes_a_type_is_not_taken_for_the_same() -> None:
    bundle = kernel_motion(models.constant_velocity(1.0), models.constant_survival(0.9))
    fixed: Any = bundle.noise_params.copy()
    fixed.flags.writeable = False
    others: list[Any] = [fixed, np.zeros((4, 1))[::2], np.zeros((2, 1), np.float32), np.zeros(2)]
    for params in others:
        changed = bundle._replace(noise_params=params)
        assert typeof(changed) == slowly(changed) != typeof(bundle)
