"""Ray models: each carries rays through a medium to the next surface.

``model`` is the protocol. Chosen by themselves, the cheapest first: ``straight``, ``linear`` (n² of second degree),
``parabolas`` (tables with kinks), ``hamilton`` (everything). Asked for by name: ``invariants`` (layers and centres by
quadrature: ``reduction``; between two points by ``range_function``) and ``fermat`` (the principle itself, by Ritz's
method).
"""
