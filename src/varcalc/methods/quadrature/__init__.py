"""Quadrature of first integrals: the algebra, the rules and the two reductions FirstIntegral composes."""
