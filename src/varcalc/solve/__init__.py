"""The ladder over the methods, warm starts, sweeps, and the diagnosis of what has no answer.

``warm_start`` answers for one problem at nearby parameters. A ``sweep`` goes over a ``grid``: each ``point`` is solved
in a ``row`` by one process, rows are shared among the workers of an executor (``sharing``) and kept in a ``store`` that
knows its problem by its ``identity``.
"""
