"""Scattering by central potentials.

| module | holds |
|---|---|
| ``pieces`` | the potential as it is written, cut into pieces on which it is smooth |
| ``legs`` | angles about the centre as integrals of what is nowhere singular, with derivatives |
| ``deflection`` | orbits followed inwards to where they turn back; those that go round for ever |
| ``branches`` | the angle as a function of the impact parameter: extrema, and where it has a value |
| ``scattering`` | the whole: deflections, cross-sections, rainbows, glories |
| ``collision`` | two bodies: the centre of mass and the laboratory |
| ``inversion`` | from angles back to the potential |
"""
