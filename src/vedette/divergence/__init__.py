"""Divergences between two beliefs: Cauchy-Schwarz and Renyi, and the power integrals that they are made of."""

from vedette.divergence.closed_form import Density, Support, cauchy_schwarz, log_inner_product
from vedette.divergence.power import power_integral, power_integrals, reference_unit_volume, renyi

__all__ = [
    "Density",
    "Support",
    "cauchy_schwarz",
    "log_inner_product",
    "power_integral",
    "power_integrals",
    "reference_unit_volume",
    "renyi",
]
