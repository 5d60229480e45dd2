"""All rays between two points.

``search`` chooses for each pair, and builds every ray: by ``varcalc.optics.models.range_function``; in a plane by
wavefront construction after Vinje, ``fan`` -> ``cells`` -> ``misses`` -> ``newton``, led by ``wavefront_construction``;
in ``space`` by Newton's iteration from a net of directions.
"""
