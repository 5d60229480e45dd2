"""An index and when a number counts as zero: what both routes to the index share, and no more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NULL = 1e-7
"""Relative size of an eigenvalue that is zero: that of a conjugate point this near to the end."""


@dataclass(frozen=True)
class Index:
    """An index, or None with the ``reason``; ``nullity`` counts directions in which the second variation vanishes."""

    index: int | None
    nullity: int
    reason: str


def signs(form: np.ndarray) -> tuple[int, int]:
    """Numbers of negative and of zero eigenvalues of a symmetric matrix in balanced units."""
    if not form.size:
        return 0, 0
    values = np.linalg.eigvalsh(form)
    null = np.abs(values) <= NULL * max(1.0, float(np.abs(values).max()))
    return int((values[~null] < 0).sum()), int(null.sum())
