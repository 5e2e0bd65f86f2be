"""How a belief meets time and a scan."""

from typing import TypeAlias

from vedette.filters.glmb import DeltaGlmbFilter
from vedette.filters.info import FilterInfo
from vedette.filters.limits import Limits
from vedette.filters.lmb import LmbFilter

LocalFilter: TypeAlias = DeltaGlmbFilter | LmbFilter

__all__ = ["DeltaGlmbFilter", "FilterInfo", "Limits", "LmbFilter", "LocalFilter"]
