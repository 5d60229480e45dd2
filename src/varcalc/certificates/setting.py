"""A statement with its exact curve and its scales: what a proof begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from varcalc.certificates.balls import Ball, flint
from varcalc.certificates.curve import Piece, Samples
from varcalc.certificates.integrals import Along
from varcalc.certificates.statement import Statement


@dataclass(frozen=True)
class Setting:
    """The statement with its curve and its scales."""

    statement: Statement
    samples: Sequence[Samples]
    joints: np.ndarray
    pieces: Sequence[Piece]
    sizes: tuple[np.ndarray, np.ndarray]
    along: Along

    @property
    def length(self) -> Ball:
        """Length of the interval."""
        return flint().arb(float(self.samples[-1].x[-1])) - flint().arb(float(self.samples[0].x[0]))

    @property
    def scaled(self) -> list[np.ndarray]:
        """The second derivatives of H at the nodes of each piece, in units of states and controls."""
        scale = np.concatenate(self.sizes)
        return [s.hessian * scale[:, None] * scale for s in self.samples]
