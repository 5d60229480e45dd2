"""Whether there is a minimum at all, and whether there is a lower one.

The modules are imported where they are used, for most problems never need them.

Beside an answer: ``global_look`` looks for other valleys over the lattices of ``polygons``, or of ``closed_paths``, in
a ``landscape`` no farther than is ``worth_crossing``, ``along_directions`` of the departures (``directions``) that no
one lattice holds, and for several functions ``together``; ``moved_polygons`` go to where the functional is less,
``bent_curves`` and ``shapes`` are for the second order, ``quick_ways`` for long intervals, ``narrow_valleys`` and
``cheaper_ends`` for what is narrower than any lattice, ``other_places`` for ends that slide, by curves that are
``drawn_to_places`` or, under bounds and levels, ``kept_polygons``. ``broken_curve`` jumps at the ends, ``upright``
within a steep answer; ``displaced`` moves kinks that may lie anywhere; ``closer_meshes`` sees that nothing lies between
the points of what is solved in pieces. What is least ``of_given_length`` is not looked around.

Where L has kinks or jumps: ``refraction``, begun from what ``rounded`` or polygons show and solved ``in_pieces``, of
curves in space ``by_energy``;
``rests``, ``held_throughout``, ``held_ends``, ``constant_speed`` and ``above_kinks``; ``under_bounds``, begun from
``polygons_under_bounds``, where bounds are touched beside convex kinks, and from ``jumps_under_bounds`` where L jumps;
``total_variation`` of what is ``linear_between`` kinks, by ``placed_lines`` of ``least_paths`` and ``on_level``.

Before anything is solved ``no_room`` tells of bounds that no curve keeps. Where no method had an answer,
``second_look`` asks in turn: ``feasibility`` (levels out of reach), ``falling`` (no
lower bound), ``fading`` (a limit that nothing attains), ``relaxation`` (the convexified problem, begun on
``relaxed_polygons`` as well), ``corners`` (placed by the solver, or refining for ever), ``approach`` (concentration,
Lavrentiev gaps), ``standing`` (saddles that IPOPT ends at under holonomic conditions), ``least_polygons`` (to begin
from where the chord leads nowhere).
"""
