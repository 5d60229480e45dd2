"""Rays by equations of their own, each a solution in an ``ensemble`` of initial values.

``curved`` (geodesics in a space with a metric), ``wave_packets`` (any dispersion relation).
"""
