"""Numerical analysis that knows nothing of functionals: meshes and quadrature, damped Newton."""
