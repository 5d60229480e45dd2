"""Rays by equations of their own, each a solution from initial values of its own.

``curved`` (geodesics in a space with a metric), ``wave_packets`` (any dispersion relation).
"""
