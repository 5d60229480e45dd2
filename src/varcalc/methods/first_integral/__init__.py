"""Reduction to a quadrature where x or y is ignorable."""
