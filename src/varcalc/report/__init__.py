"""Reports: one self-contained HTML page a problem, scene or system, and an index of them.

``subjects`` finds what a page is about; ``problem_page``, ``scene_page`` and ``system_page`` say what is known of it,
as the plain parts of ``page``, with ``question`` (what is asked, in formulas), ``evidence`` (checks and proofs) and
``pictures``; ``rendering`` writes parts as HTML; ``gallery`` makes many pages, in several processes, and their index.
"""
