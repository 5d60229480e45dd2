"""The reference problems, one file each: what it is, its source, the functional, the closed form.

In the repository this is the folder ``problems/``; installed, it is the package ``varcalc.problems``.
:func:`varcalc.reference.load` runs a file by its name.
"""
