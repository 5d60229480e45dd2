"""Motion in one coordinate, (du/dτ)² = g(u) - C, with its turning points substituted away.

A :class:`~varcalc.numerics.one_coordinate.potential.Potential` says what g is; many constants C go at once, along the
first axis of every array.

| module | holds |
|---|---|
| ``potential`` | g with differences to round-off, its critical values, turning points bracketed and found |
| ``motions`` | how far each motion goes, and parameters in which it is smooth, with derivatives by C |
| ``quadrature`` | τ and integrals over it, to given parameters, or until one of them has a given value; periods |
| ``slopes`` | motions that turn back on the same slopes of g: smooth in C together |
| ``integral_leaves`` | Chebyshev series of integrals along such motions, on a panel of C, with what they are off |
| ``integral_tables`` | those series, made where they are asked for |
| ``panels`` | fixed rules whose first panel squares a turning point away, cumulative integrals and their inverse |
"""
