"""Sequential propagation: the one loop through media and surfaces, and bundles of any size.

``sequential`` (:class:`Propagator` and what is read off its passages), ``bundle`` (the ends of many rays).
"""
