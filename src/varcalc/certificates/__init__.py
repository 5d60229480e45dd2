"""Proofs by ball arithmetic that an infimum lies between two numbers."""

from varcalc.certificates.certificate import Certificate, Distance, Hypothesis, Means, ProvedInterval, Scope
from varcalc.certificates.proof import certify

__all__ = ["Certificate", "Distance", "Hypothesis", "Means", "ProvedInterval", "Scope", "certify"]
