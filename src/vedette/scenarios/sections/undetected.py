"""The targets that no sensor has found yet: the cells of the filter, and of planners that search for them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import NonNegative, Positive, check
from vedette.scenarios.sections.derived import Derived, derived
from vedette.scenarios.sections.field_of_view import field_of_view, reach_of
from vedette.scenarios.sections.fusion import ONE_BELIEF
from vedette.scenarios.sections.tracking import Filter
from vedette.scenarios.sections.world import RegionSection

if TYPE_CHECKING:  # with the models comes the compiler, which a check does without
    from vedette.models import BirthModel, UndetectedModel
    from vedette.scenarios.sections.scenario import ScenarioModel

# Of every sensor, P_D is asked at nine places in each at every scan: some 40 ms for so many.
MAX_CELLS = 250_000
# Without a section: cells along each side of the region, and from a sensor to where it sees no more.
_LEAST_CELLS, _MOST_CELLS, _CELLS_A_REACH = 16, 64, 2.0
_PRIOR_A_SCAN = 0.1  # births, where their rate is learnt and no prior is given


@derived("vedette.models.undetected:UndetectedModel", first=("cell",))
class UndetectedSection(Derived):
    """How many targets there are that no sensor has found yet, on a grid: some at first, others that appear later."""

    cell: Positive = Field(description="Side of a cell, at most [m].")
    expected: float = Field(ge=0.0, description="Mean number of them at the first scan, spread evenly [-].")
    speed: float = Field(
        ge=0.0,
        description="Standard deviation of both components of their velocity, drawn anew at every scan [m/s].",
    )
    birth_rate: NonNegative | Literal["learnt"] | None = Field(
        default=None,
        description="Mean number of targets that appear in the region in a second; learnt: estimated from the first "
        "detections, where undetected targets are an intensity; none: learnt where they are and tracks start from "
        "measurements, else 0 [1/s].",
    )
    prior_rate: Positive | None = Field(
        default=None,
        description="Where the birth rate is learnt, the mean of its prior density, a gamma of shape 1/2; none: what "
        "birth.from_measurements expects, or one target in ten scans [1/s].",
    )
    region: RegionSection | None = Field(
        default=None, description="Where they are; none: in the region of the scenario [-]."
    )

    @check
    def _prior_of_learnt(self) -> Iterator[Finding]:
        if self.prior_rate is not None and self.birth_rate != "learnt":
            yield ("prior_rate",), "none, as birth_rate is not learnt", describe(self.prior_rate)

    def build(self, region: RegionSection) -> UndetectedModel:
        """The model; region: of the scenario, for want of one of its own."""
        from vedette.models import CellGrid, UndetectedModel

        grid = CellGrid.covering((self.region or region).build(), self.cell)
        return UndetectedModel(grid, **{name: value for name, value in self.given().items() if value is not None})


def undetected_anywhere(model: ScenarioModel, birth: BirthModel) -> UndetectedModel | None:
    """The targets that appear anywhere, for filters whose undetected targets are an intensity.

    Their birth rate is learnt where the section does not give it and tracks start from measurements, and where planners
    search: with a fixed rate that is too high they never stop searching. Of births at sites alone there are none, and
    the cells serve planners, to which undetected targets are an intensity on these. None where `birth` says all there
    is to say. birth: of the filters, without them.
    """
    section, measured, scan = model.undetected, birth.from_measurements, model.time.step_period
    if section is not None:
        found = section.build(model.region)
        if section.birth_rate is None and measured is not None:
            found = replace(found, birth_rate="learnt")
    elif measured is None:
        return _cells_alone(model) if searches(model) else None
    elif not (measured.is_learnt or searches(model)):
        return None
    elif (uniform := replace(measured, expected="learnt").uniform(_cells_a_side(model))) is not None:
        found = uniform
    else:
        return None
    if section is not None and section.prior_rate is not None:
        return found
    expected = _PRIOR_A_SCAN if measured is None or isinstance(measured.expected, str) else measured.expected
    return replace(found, prior_rate=expected / (birth.period or scan))


def _cells_alone(model: ScenarioModel) -> UndetectedModel:
    """Cells of the region in which no target appears."""
    from vedette.models import CellGrid, UndetectedModel

    num = _cells_a_side(model)
    return UndetectedModel(CellGrid(model.region.build(), num, num), 0.0)


def searches(model: ScenarioModel) -> bool:
    """Whether planners look for undetected targets without a section that says how many there are."""
    if model.undetected is not None or not _may_be_found(model):
        return False
    return bool(model.decision_steps) and model.control.undetected_worth != 0.0


def _may_be_found(model: ScenarioModel) -> bool:
    """Whether there is an intensity to search by: of targets born anywhere, or at sites where a view has an edge."""
    if not _has_intensity(model):
        return False
    at_sites = bool(model.birth.sites) and any(field_of_view(sensor) is not None for sensor in model.sensors)
    return at_sites or model.birth.from_measurements is not None


def _cells_a_side(model: ScenarioModel) -> int:
    """Cells along each side of the region: a few within the view of the sensor that sees least far."""
    region, reach = model.region, min(map(reach_of, model.sensors))
    side: float = max(region.x_max - region.x_min, region.y_max - region.y_min)
    return min(max(math.ceil(_CELLS_A_REACH * side / reach), _LEAST_CELLS), _MOST_CELLS)


def learnt_births(model: ScenarioModel) -> Iterator[Finding]:
    """A birth rate is learnt by beliefs that have an intensity of undetected targets."""
    measured, section = model.birth.from_measurements, model.undetected
    if _has_intensity(model):
        return
    wanted = "a number, as only one belief of all scans by filter.kind factored_glmb with births: poisson learns it"
    if measured is not None and measured.expected == "learnt":
        yield ("birth", "from_measurements", "expected"), wanted, describe(measured.expected)
    if section is not None and section.birth_rate == "learnt":
        yield ("undetected", "birth_rate"), wanted, describe(section.birth_rate)


def _has_intensity(model: ScenarioModel) -> bool:
    """Whether undetected targets are an intensity of the one belief of all scans."""
    filters, fusion = model.filter, model.fusion
    if fusion.kind not in ONE_BELIEF or model.network is not None or getattr(fusion, "filter", None) is not None:
        return False
    return isinstance(filters, Filter) and filters.kind == "factored_glmb" and filters.births == "poisson"


def cells_of_undetected(model: ScenarioModel) -> Iterator[Finding]:
    """The region is cut into a number of cells that can be held and worked on; what is worth finding may be there."""
    section = model.undetected
    if section is None:
        worth = model.control.undetected_worth
        if worth and not _may_be_found(model):
            wanted = "0, or a section `undetected`, which says where such targets may be"
            yield ("control", "undetected_worth"), wanted, describe(worth)
        return
    region = section.region or model.region
    width, height = region.x_max - region.x_min, region.y_max - region.y_min
    if min(width, height) <= 0.0:
        return
    if max(math.ceil(width / section.cell), 1) * max(math.ceil(height / section.cell), 1) > MAX_CELLS:
        wanted = f"at least {_enough(width, height):.3g}, as at most {MAX_CELLS:,} cells may fill the region"
        yield ("undetected", "cell"), wanted, describe(section.cell)


def _enough(width: float, height: float) -> float:
    """A size that is large enough and stays so when it is rounded to three digits."""
    half = 0.5 * (width + height) / (MAX_CELLS - 1)  # (width / size + 1) (height / size + 1) = MAX_CELLS
    return 1.005 * (half + math.sqrt(half * half + width * height / (MAX_CELLS - 1)))
