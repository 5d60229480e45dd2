"""Numerical analysis that knows nothing of functionals.

Meshes and quadrature, damped Newton, roots on arrays; ``proxies``: all zeros of combinations by Chebyshev series;
``branch_and_bound``: least values over boxes; ``one_coordinate``: motions (du/dτ)² = g(u) - C with their turning points
substituted away, and tables of their integrals; ``hermite``: polynomials between two points; ``resampled``: curves held
as polynomials, so that they can be pickled; ``runs``: of neighbours at which something holds.
"""
