"""Kernels of labelled densities: label sets, conversions, integrals, fusion and factorisation."""
