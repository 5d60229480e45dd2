"""Scenes of ray optics, one file each: what it is, its source, and the study that is made of it.

``varcalc trace NAME`` carries it out; ``varcalc list --scenes`` names them.
"""
