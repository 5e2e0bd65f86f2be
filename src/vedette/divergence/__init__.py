"""How far apart two beliefs are: the Cauchy-Schwarz divergence in closed form."""

from vedette.divergence.closed_form import Density, Support, cauchy_schwarz, log_inner_product
from vedette.divergence.unit_volume import reference_unit_volume

__all__ = ["Density", "Support", "cauchy_schwarz", "log_inner_product", "reference_unit_volume"]
