"""Motion in one coordinate: by the ignorable coordinates that L has, and its energy, and quadrature.

| module | holds |
|---|---|
| ``routh`` | ignorable coordinates removed; what is left as kinetic and potential energy of one coordinate |
| ``charts`` | the parts of the line on which these are numbers, each with a coordinate in which its ends are far away |
| ``effective`` | the potential of one part, ready for :mod:`varcalc.numerics.one_coordinate` |
| ``rests`` | where it can rest: circular orbits, separatrices and the logarithms by which times next to them diverge |
| ``orbits`` | the motions of an energy: ends, periods, angles, times, places, averages |
| ``reduced`` | the whole |
| ``inverse`` | force from an orbit, width of a well from its periods |
"""
