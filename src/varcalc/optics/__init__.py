"""Variational optics: rays by Fermat's principle, through graded media, surfaces and mirrors.

Each folder imports only from those before it: ``media``, with ``parameters`` and ``validation``; ``surfaces``;
``rays``; ``models``; ``propagation``; ``arrivals`` and, beside them, ``ensembles``; ``scene``, which asks them; and
``results``.
"""

from typing import NoReturn

from varcalc.optics.ensembles.curved import CurvedMedium
from varcalc.optics.ensembles.wave_packets import DispersionRelation, WavePackets
from varcalc.optics.media.catalogue import (
    eaton,
    exponential_atmosphere,
    fish_eye,
    luneburg,
    munk_profile,
    selfoc,
    standard_atmosphere,
)
from varcalc.optics.media.dispersion import GLASSES, Cauchy, Dispersion, Sellmeier
from varcalc.optics.media.maupertuis import maupertuis
from varcalc.optics.media.medium import Graded, Medium, Radial, Stratified, Uniform
from varcalc.optics.media.profile_file import read_profile
from varcalc.optics.media.tabulated import Tabulated
from varcalc.optics.models.fermat import Fermat
from varcalc.optics.models.hamilton import Hamilton
from varcalc.optics.models.invariants import Invariants
from varcalc.optics.models.linear import Linear
from varcalc.optics.models.model import DoesNotApply, Model
from varcalc.optics.models.parabolas import Parabolas
from varcalc.optics.models.straight import Straight
from varcalc.optics.propagation.bundle import Bundle
from varcalc.optics.rays.beam import RayStatus
from varcalc.optics.rays.ray import Ray, Rays
from varcalc.optics.rays.sources import PlaneWave, PointSource, Source
from varcalc.optics.rays.tube import Intensity, RayTube
from varcalc.optics.results.range_chart import RangeChart, range_chart
from varcalc.optics.results.study import Seen, Study
from varcalc.optics.results.wavefronts import Caustic, Wavefront, caustic, ray_tube, wavefront
from varcalc.optics.scene import Scene
from varcalc.optics.surfaces import Asphere, Conic, Implicit, Plane, Sphere, Surface
from varcalc.spelling import NoAttribute, uncalled

__all__ = [
    "GLASSES",
    "Asphere",
    "Bundle",
    "Cauchy",
    "Caustic",
    "Conic",
    "CurvedMedium",
    "Dispersion",
    "DispersionRelation",
    "DoesNotApply",
    "Fermat",
    "Graded",
    "Hamilton",
    "Implicit",
    "Intensity",
    "Invariants",
    "Linear",
    "Medium",
    "Model",
    "Parabolas",
    "Plane",
    "PlaneWave",
    "PointSource",
    "Radial",
    "RangeChart",
    "Ray",
    "RayStatus",
    "RayTube",
    "Rays",
    "Scene",
    "Seen",
    "Sellmeier",
    "Source",
    "Sphere",
    "Straight",
    "Stratified",
    "Study",
    "Surface",
    "Tabulated",
    "Uniform",
    "WavePackets",
    "Wavefront",
    "caustic",
    "eaton",
    "exponential_atmosphere",
    "fish_eye",
    "luneburg",
    "maupertuis",
    "munk_profile",
    "range_chart",
    "ray_tube",
    "read_profile",
    "selfoc",
    "standard_atmosphere",
    "wavefront",
]


def __getattr__(name: str) -> NoReturn:
    """No such name: the error suggests one that is near."""
    raise NoAttribute(__name__, name, __all__)


uncalled(__name__)
