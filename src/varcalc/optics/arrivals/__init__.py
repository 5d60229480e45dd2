"""All rays between two points.

``search`` chooses for each pair: the range function (``varcalc.optics.models.range_search``), or ``two_point``, which
builds every ray. Its searches: in a plane wavefront construction after Vinje, ``fan`` -> ``cells`` ->
``misses`` -> ``newton``, led by ``wavefront_construction``; in ``space`` Newton's iteration from a net of directions.
"""
