"""What a ray model is: the one protocol that every model answers, each in a file of its own.

A model looks at one medium of a scene and the surfaces that rays in it may
meet, and either gives a :class:`Carrier`, which takes rays through the
medium, or says in a sentence why it does not apply and which model would.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from varcalc.optics.media.medium import Medium
from varcalc.optics.rays.beam import NOTHING, Arrival, Beam
from varcalc.optics.rays.leg import Leg
from varcalc.optics.rays.ray import Ray, Rays
from varcalc.optics.surfaces import Geometry, Surface
from varcalc.problem.conditions import told

Builder = Callable[[np.ndarray, np.ndarray, np.ndarray], list[tuple[Ray | None, float]]]
"""From headings (k, d), optical paths (k,) and whether a caustic is touched (k,) to rays with their misses."""


class DoesNotApply(ValueError):
    """A model was asked for that cannot treat the scene; the message says what it needs and which model would do."""


class Carrier(Protocol):
    """A model at work in one medium."""

    @property
    def name(self) -> str:
        """What the answers call it."""
        ...

    def advance(self, beam: Beam, limit: np.ndarray, leaving: int = NOTHING) -> Arrival:
        """Carry the rays, with their neighbours, to the first surface or to the optical path ``limit`` (m,).

        The limit is infinite where there is none; ``leaving`` is the number of the surface all rays start from.
        """
        ...

    def onward(self, beam: Beam, sigma: np.ndarray, path: np.ndarray) -> tuple[Beam, np.ndarray]:
        """The rays after ``sigma`` (m,) more, as if there were no surfaces, and by how much σ has grown (m,).

        A model that carries rays to an optical path takes them to ``path`` (m,) instead, which is that at ``sigma``,
        about. What is carried is not a number where the ray does not come so far.
        """
        ...

    def leg(self, beam: Beam, path: float) -> Leg:
        """The one ray of ``beam`` up to the optical path ``path``, whatever surfaces stand there."""
        ...


class Model(ABC):
    """A way to find rays. A new one defines :meth:`carrier`, and nothing else knows of it but the list it stands in.

    Models are immutable and hold no more than their own options; pass one as ``model=`` to
    :meth:`Scene.trace <varcalc.optics.Scene.trace>` or :meth:`Scene.rays <varcalc.optics.Scene.rays>`.
    """

    @abstractmethod
    def carrier(self, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
        """The model at work in ``medium``, in 2 or 3 dimensions; :class:`DoesNotApply` where it cannot be."""

    @property
    def companion(self) -> Model | None:
        """The model that carries rays to what :meth:`between` finds: this one, or None for the cheapest."""
        return self

    def between(self, question: Question) -> Rays | None:  # noqa: ARG002  most models have none
        """The rays that answer ``question`` by the model's own search; None where the scene's is to be used.

        The scene's goes over all directions, and the model carries what it finds.
        """
        return None


def checked_model(given: Model | None) -> Model | None:
    """``given`` if it is a model or None; TypeError otherwise."""
    if given is not None and not isinstance(given, Model):
        hint = f"; write optics.{given.__name__}()" if isinstance(given, type) else ""
        raise TypeError(f"model must be a ray model such as optics.Hamilton() or None, not {told(given)}{hint}")
    return given


@dataclass(frozen=True)
class Question:
    """Which rays go from ``a`` to ``b`` (d,) through ``media`` and ``surfaces``, up to the optical path ``within``.

    ``built`` carries rays from unit headings (k, d) at ``a`` to optical paths (k,), with all that belongs to them; its
    last argument (k,) says which are known to touch a caustic at ``b``. With each comes how far from ``b`` it ends,
    relative to the distance of the two points. ``search`` is the scene's own search.
    """

    media: Sequence[Medium]
    surfaces: Sequence[Surface]
    a: np.ndarray
    b: np.ndarray
    within: float
    built: Builder
    search: Callable[[], Rays]
