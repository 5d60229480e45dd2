"""Variational optics: rays by Fermat's principle, through graded media, surfaces and mirrors."""

from varcalc.optics.beam import RayStatus
from varcalc.optics.bundle import Bundle
from varcalc.optics.curved import CurvedMedium
from varcalc.optics.dispersion import GLASSES, Cauchy, Dispersion, Sellmeier
from varcalc.optics.fermat import Fermat
from varcalc.optics.hamilton import Hamilton
from varcalc.optics.invariants import Invariants
from varcalc.optics.known import (
    eaton,
    exponential_atmosphere,
    fish_eye,
    luneburg,
    munk_profile,
    selfoc,
    standard_atmosphere,
)
from varcalc.optics.linear import Linear
from varcalc.optics.maupertuis import maupertuis
from varcalc.optics.media import Graded, Medium, Radial, Stratified, Uniform
from varcalc.optics.model import DoesNotApply, Model
from varcalc.optics.packets import DispersionRelation, WavePackets
from varcalc.optics.parabolas import Parabolas
from varcalc.optics.profiles import read_profile
from varcalc.optics.range_chart import RangeChart, range_chart
from varcalc.optics.ray import Ray, Rays
from varcalc.optics.scene import Scene
from varcalc.optics.sources import PlaneWave, PointSource, Source
from varcalc.optics.straight import Straight
from varcalc.optics.study import Seen, Study
from varcalc.optics.surfaces import Asphere, Conic, Implicit, Plane, Sphere, Surface
from varcalc.optics.tabulated import Tabulated
from varcalc.optics.tubes import Intensity, RayTube
from varcalc.optics.wavefronts import Caustic, Wavefront, caustic, ray_tube, wavefront

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
