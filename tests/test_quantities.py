"""The table of measured quantities, and what is derived from it."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from vedette import models
from vedette.errors import InputError
from vedette.internal.quantities import COMPONENTS, PLACED, QUANTITIES, in_file, si_column
from vedette.models.bias import with_offsets
from vedette.recorded.conventions import UNITS
from vedette.scenarios.sections.true_sensors import BiasSection
from vedette.simulation import TrueSensor, simulate_scan


def test_every_quantity_has_a_bias_in_models_and_files():
    names = {each.name for each in fields(models.Bias)}
    assert names == {*QUANTITIES, "clock"}
    assert set(BiasSection.model_fields) == {*map(in_file, QUANTITIES), "clock"}
    told = BiasSection(**{in_file(name): 1.0 for name in QUANTITIES}).build()
    assert all(getattr(told, name) == each.in_si for name, each in QUANTITIES.items())


def test_units_are_of_one_table():
    assert {name: UNITS[name] for name in QUANTITIES} == {name: each.units for name, each in QUANTITIES.items()}
    columns = ["bearing_rad", "range_m", "range_rate_mps", "x_m", "y_m", "elevation_rad", "altitude_m"]
    assert [si_column(name) for name in QUANTITIES] == columns
    for each in QUANTITIES.values():
        assert each.in_si * each.per_si == pytest.approx(1.0, rel=1e-15)
        assert next(iter(each.units.values())) == 1.0


@pytest.mark.parametrize("kind", COMPONENTS)
def test_a_model_takes_angles_and_least_values_from_its_components(kind):
    model = getattr(models, kind)()
    assert model.components == COMPONENTS[kind]
    assert model.angular.tolist() == [QUANTITIES[name].is_angle for name in COMPONENTS[kind]]
    assert model.least.tolist() == [QUANTITIES[name].least for name in COMPONENTS[kind]]
    assert (model.places is not None) == (kind in PLACED)


def test_an_unknown_component_is_refused():
    with pytest.raises(InputError, match=r"MeasurementModel.components: expected 2 names among bearing, range, "):
        models.MeasurementModel(2, models.position().function, components=("x", "depth"))


def test_offsets_keep_bearings_on_the_circle_and_ranges_above_the_least():
    measured = np.array([[3.0, 5.0, -2.0], [-1.0, 0.5, 2.0]])
    found = with_offsets(measured, np.array([1.0, -1.0, 0.5]), ("bearing", "range", "range_rate"))
    np.testing.assert_allclose(found, [[4.0 - 2.0 * math.pi, 4.0, -1.5], [0.0, 1.0, 2.5]], atol=1e-15)


@models.model_function("measurement")
def _with_rate(state, pose, params, out):
    dx, dy = state[0] - pose[0], state[1] - pose[1]
    out[0] = math.atan2(dy, dx)
    out[1] = math.sqrt(dx * dx + dy * dy)
    out[2] = (dx * state[2] + dy * state[3]) / out[1]


def test_a_custom_measurement_with_a_range_rate_is_drawn_with_its_bias():
    names = ("bearing", "range", "range_rate")
    measured = models.MeasurementModel(3, _with_rate, components=names)
    noise, clutter = models.constant_noise([1e-9, 1e-9, 1e-9]), models.measurement_space_clutter(0.0, [0] * 3, [1] * 3)
    sensor = models.SensorModel(measured, noise, models.constant_detection(1.0), clutter)
    true = TrueSensor(sensor, bias=models.Bias(range_rate=2.5))
    scan = simulate_scan([[300.0, 400.0, 3.0, -4.0]], [0.0, 0.0, 0.0], true, rng=np.random.default_rng(1))
    np.testing.assert_allclose(scan.measurements, [[math.atan2(4.0, 3.0), 500.0, -1.4 + 2.5]], atol=1e-7)
    with pytest.raises(InputError, match=r"TrueSensor.bias.range_rate: expected 0"):
        TrueSensor(
            models.SensorModel(
                models.position(),
                models.constant_noise([1.0, 1.0]),
                models.constant_detection(1.0),
                models.measurement_space_clutter(0.0, [0] * 2, [1] * 2),
            ),
            bias=models.Bias(range_rate=1.0),
        )
