"""Proofs by ball arithmetic that an infimum lies between two numbers."""

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
