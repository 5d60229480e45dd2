"""Rays and what belongs to them.

``beam`` (the state that every model carries on: positions, momenta, optical paths and neighbours; the count of
conjugate points), ``leg`` (one ray between two surfaces), ``tube`` (a ray with its neighbours: spreading,
intensity), ``ray`` (rays between two points), ``derivatives`` (of the optical path, by Fermat's principle),
``sources`` (points and plane waves).
"""
