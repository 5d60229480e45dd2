"""What becomes of small motions as parameters change, on :class:`varcalc.mechanics.System`.

``response``: what a weak force does; ``chart``: growth over two parameters of systems that are driven periodically, by
``surface``, the monodromy matrix as a function of parameters; ``branches``: equilibria followed through folds and
pitchforks; ``fast_drive``: the effective potential of a fast force.
"""
