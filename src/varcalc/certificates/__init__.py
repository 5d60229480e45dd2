"""Proofs by ball arithmetic that an infimum lies between two numbers.

``proof`` chooses the way and leads it. ``statement`` and ``curve`` make an exact problem and polynomials of a
solution; ``jets`` is its Lagrangian in ``balls``, of ``smooth`` functions, and ``integrals`` gives the value and the
residuals.

By Hilbert's integral: ``field`` and ``tube``, put together in ``by_tube``, with ``choice`` of how wide the tube may be,
``closer``, a curve nearer to its extremal, and ``nearness``, how near others as good lie. ``ends`` with their ``cost``,
``levels`` that are prescribed, ``pathwise`` equations, ``bounds``, ``kinks`` and ``inequalities`` are held by duality;
``regular`` are coordinates at singular ends, ``separated`` what a length comes to up to where it is regular; curves
that are ``closed`` or may be shifted (``shifts``) have one start.

By duality: ``duality`` of ``summands`` that are convex, bounded by ``three_values``, put together in ``by_convexity``;
``convexity`` and ``degree`` are read from the operations.

Eigenvalues: ``rayleigh`` for the lowest, ``spectrum`` for those above it, from ``eigenfunctions`` by Ritz's method.
Functions of numbers: ``stationary``.
"""

from varcalc.certificates.certificate import Certificate, Distance, Hypothesis, Means, ProvedInterval, Scope
from varcalc.certificates.proof import certify
from varcalc.certificates.spectrum import Eigenvalue, certify_eigenvalues

__all__ = [
    "Certificate",
    "Distance",
    "Eigenvalue",
    "Hypothesis",
    "Means",
    "ProvedInterval",
    "Scope",
    "certify",
    "certify_eigenvalues",
]
