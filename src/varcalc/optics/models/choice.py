"""The ray models that carry rays through a medium, and the choice among them."""

from __future__ import annotations

from collections.abc import Sequence

from varcalc.optics.media.medium import Medium
from varcalc.optics.models.hamilton import Hamilton
from varcalc.optics.models.linear import Linear
from varcalc.optics.models.model import Carrier, DoesNotApply, Model
from varcalc.optics.models.parabolas import Parabolas
from varcalc.optics.models.straight import Straight
from varcalc.optics.surfaces import Geometry

CHEAPEST_FIRST: tuple[Model, ...] = (Straight(), Linear(), Parabolas(), Hamilton())
"""The models tried where none is asked for, by what they cost for a bundle; the last applies everywhere."""


def carrier(model: Model | None, medium: Medium, dimension: int, surfaces: Sequence[Geometry]) -> Carrier:
    """``model``, or the cheapest that applies, at work in ``medium``; :class:`DoesNotApply` where it cannot be."""
    if model is not None:
        return model.carrier(medium, dimension, surfaces)
    for candidate in CHEAPEST_FIRST[:-1]:
        try:
            return candidate.carrier(medium, dimension, surfaces)
        except DoesNotApply:
            continue
    return CHEAPEST_FIRST[-1].carrier(medium, dimension, surfaces)


def checked_model(given: Model | None) -> Model | None:
    """``given`` if it is a model or None; TypeError otherwise."""
    if given is not None and not isinstance(given, Model):
        raise TypeError(f"model must be a ray model such as optics.Hamilton() or None, not {given!r}")
    return given
