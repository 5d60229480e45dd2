"""Variational optics: rays by Fermat's principle, through graded media, surfaces and mirrors."""

from varcalc.optics.beam import RayStatus
from varcalc.optics.bundle import Bundle
from varcalc.optics.dispersion import GLASSES, Cauchy, Dispersion, Sellmeier
from varcalc.optics.known import (
    eaton,
    exponential_atmosphere,
    fish_eye,
    luneburg,
    munk_profile,
    selfoc,
    standard_atmosphere,
)
from varcalc.optics.media import Graded, Medium, Radial, Stratified, Uniform
from varcalc.optics.ray import Ray, Rays
from varcalc.optics.scene import Scene
from varcalc.optics.surfaces import Asphere, Conic, Implicit, Plane, Sphere, Surface
from varcalc.optics.tabulated import Tabulated

__all__ = [
    "GLASSES",
    "Asphere",
    "Bundle",
    "Cauchy",
    "Conic",
    "Dispersion",
    "Graded",
    "Implicit",
    "Medium",
    "Plane",
    "Radial",
    "Ray",
    "RayStatus",
    "Rays",
    "Scene",
    "Sellmeier",
    "Sphere",
    "Stratified",
    "Surface",
    "Tabulated",
    "Uniform",
    "eaton",
    "exponential_atmosphere",
    "fish_eye",
    "luneburg",
    "munk_profile",
    "selfoc",
    "standard_atmosphere",
]
