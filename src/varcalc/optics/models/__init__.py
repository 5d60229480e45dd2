"""Ray models: each carries rays through a medium to the next surface.

``model`` is the protocol, ``choice`` the list from which the cheapest is taken: ``straight``, ``linear`` (n² of
second degree), ``parabolas`` (tables with kinks), ``hamilton`` (everything, by ``ray_equations``). Asked for by name:
``invariants`` (layers and centres by quadrature: ``profile``, ``reduction``; between two points by the range function,
``range_function``, ``range_zeros``, ``range_search``) and ``fermat`` (the principle itself, by Ritz's method).
"""
