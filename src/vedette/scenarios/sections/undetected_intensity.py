"""The intensity of undetected targets, for filters and for planners that search, and its checks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.field_of_view import field_of_view, max_range
from vedette.scenarios.sections.fusion import SINGLE_BELIEF_FUSIONS
from vedette.scenarios.sections.tracking import Filter

if TYPE_CHECKING:  # importing the models imports the compiler, which a check does not need
    from vedette.models import BirthModel, UndetectedModel
    from vedette.scenarios.sections.fields import ScenarioFields

# P_D of every sensor is evaluated at nine places in each cell at every scan: about 40 ms for this number.
MAX_CELLS = 250_000
# Without a section: fewest and most cells along each side of the region, and cells along the range of a sensor.
_LEAST_CELLS, _MOST_CELLS, _CELLS_A_REACH = 16, 64, 2.0
_PRIOR_PER_SCAN = 0.1  # births per scan if their rate is learnt and no prior is given


def undetected_anywhere(model: ScenarioFields, birth: BirthModel) -> UndetectedModel | None:
    """Return the targets that appear anywhere, for filters with an intensity of undetected targets; None if not needed.

    Their birth rate is learnt if the section does not give it and tracks start from measurements, or if planners
    search: with a fixed rate that is too high they never stop searching. With births only at sites there are none, and
    the cells serve planners, which use an intensity of undetected targets on them. birth: of the filters, without them.
    """
    section, measured, scan = model.undetected, birth.from_measurements, model.time.step_period
    if section is not None:
        undetected = section.build(model.region)
        if section.birth_rate is None and measured is not None:
            undetected = replace(undetected, birth_rate="learnt")
    elif measured is None:
        return _cells_alone(model) if searches_by_default(model) else None
    elif not (measured.is_learnt or searches_by_default(model)):
        return None
    elif (uniform := replace(measured, expected="learnt").uniform(_cells_a_side(model))) is not None:
        undetected = uniform
    else:
        return None
    if section is not None and section.prior_rate is not None:
        return undetected
    expected = _PRIOR_PER_SCAN if measured is None or isinstance(measured.expected, str) else measured.expected
    return replace(undetected, prior_rate=expected / (birth.period or scan))


def _cells_alone(model: ScenarioFields) -> UndetectedModel:
    """Return cells of the region in which no target appears."""
    from vedette.models import CellGrid, UndetectedModel

    num = _cells_a_side(model)
    return UndetectedModel(CellGrid(model.region.build(), num, num), 0.0)


def searches_by_default(model: ScenarioFields) -> bool:
    """Return True if planners search for undetected targets without a section that gives their number."""
    if model.undetected is not None or not _may_be_found(model):
        return False
    return bool(model.decision_steps) and model.control.undetected_target_value != 0.0


def _may_be_found(model: ScenarioFields) -> bool:
    """Return True if there is an intensity to search: of births anywhere, or at sites if a view has an edge."""
    if not has_intensity(model):
        return False
    at_sites = bool(model.birth.sites) and any(field_of_view(sensor) is not None for sensor in model.sensors)
    return at_sites or model.birth.from_measurements is not None


def _cells_a_side(model: ScenarioFields) -> int:
    """Return the number of cells along each side of the region: a few within the shortest range of a sensor."""
    region, reach = model.region, min(map(max_range, model.sensors))
    side: float = max(region.x_max - region.x_min, region.y_max - region.y_min)
    return min(max(math.ceil(_CELLS_A_REACH * side / reach), _LEAST_CELLS), _MOST_CELLS)


def learnt_births(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of learnt birth rates if beliefs have no intensity of undetected targets."""
    measured, section = model.birth.from_measurements, model.undetected
    if has_intensity(model):
        return
    wanted = (
        "a number, as only one belief of all scans by filter.kind factored_glmb or lmb with births: poisson learns it"
    )
    if measured is not None and measured.expected == "learnt":
        yield ("birth", "from_measurements", "expected"), wanted, describe(measured.expected)
    if section is not None and section.birth_rate == "learnt":
        yield ("undetected", "birth_rate"), wanted, describe(section.birth_rate)


def has_intensity(model: ScenarioFields) -> bool:
    """Return True if undetected targets are an intensity of the single belief of all scans."""
    filters, fusion = model.filter, model.fusion
    if (
        fusion.kind not in SINGLE_BELIEF_FUSIONS
        or model.network is not None
        or getattr(fusion, "filter", None) is not None
    ):
        return False
    return isinstance(filters, Filter) and filters.built_kind == "factored_glmb" and filters.births != "labelled"


def cells_of_undetected(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of too many cells, and of a worth of undetected targets without an intensity of them."""
    section = model.undetected
    if section is None:
        worth = model.control.undetected_target_value
        if worth and not _may_be_found(model):
            wanted = "0, or a section `undetected`, which says where such targets may be"
            yield ("control", "undetected_target_value"), wanted, describe(worth)
        return
    region = section.region or model.region
    width, height = region.x_max - region.x_min, region.y_max - region.y_min
    if min(width, height) <= 0.0:
        return
    if max(math.ceil(width / section.cell_size), 1) * max(math.ceil(height / section.cell_size), 1) > MAX_CELLS:
        wanted = (
            f"at least {_sufficient_cell_size(width, height):.3g}, as at most {MAX_CELLS:,} cells may fill the region"
        )
        yield ("undetected", "cell_size"), wanted, describe(section.cell_size)


def _sufficient_cell_size(width: float, height: float) -> float:
    """Return a size that is large enough, also after rounding to three digits."""
    half = 0.5 * (width + height) / (MAX_CELLS - 1)  # (width / size + 1) (height / size + 1) = MAX_CELLS
    return 1.005 * (half + math.sqrt(half * half + width * height / (MAX_CELLS - 1)))
