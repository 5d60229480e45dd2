"""Media that people ask for by name, each with its source; their numbers are parameters of the medium."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from varcalc.optics.media.dispersion import check_wavelength
from varcalc.optics.media.medium import Graded, Radial, Stratified
from varcalc.optics.validation import positive
from varcalc.spelling import spelled

EARTH = 6371e3
"""The Earth's mean radius in metres (IUGG: R1 = 6371.0087714 km, rounded as refraction tables do)."""


@spelled
def luneburg(radius: float = 1.0) -> Radial:
    """n² = 2 - (r/R)²: a plane wave is focused on the rim (Luneburg, "Mathematical Theory of Optics", sect. 29).

    Raises TypeError or ValueError for a radius that is not positive.
    """
    return Radial(lambda r, p: ca.sqrt(2 - (r / p.radius) ** 2), parameters={"radius": positive("radius", radius)})


@spelled
def fish_eye(index: float = 2.0, radius: float = 1.0) -> Radial:
    """n = n0/(1 + (r/a)²): rays are circles, every point is imaged (Maxwell 1854; Born and Wolf, sect. 4.2.2).

    Raises TypeError or ValueError for an index that is no number, and a radius that is not positive.
    """
    return Radial(
        lambda r, p: p.index / (1 + (r / p.radius) ** 2),
        parameters={"index": index, "radius": positive("radius", radius)},
    )


@spelled
def eaton(radius: float = 1.0) -> Radial:
    """n² = 2 R/r - 1: rays are sent back the way they came; singular at the centre (Eaton 1952).

    Raises TypeError or ValueError for a radius that is not positive.
    """
    return Radial(lambda r, p: ca.sqrt(2 * p.radius / r - 1), parameters={"radius": positive("radius", radius)})


@spelled
def selfoc(index: float = 1.5, gradient: float = 1.0) -> Graded:
    """n² = n0² (1 - a² ρ²) about the last coordinate's axis: a fibre or rod (Marchand, "Gradient Index Optics", ch. 5).

    ``gradient`` is a, one over a length. Raises TypeError or ValueError for what are no numbers.
    """

    def index_at(*arguments: Any) -> ca.SX:
        """The index at a position, whose numbers are in p, the last argument."""
        *position, p = arguments
        across = ca.vertcat(*position[:-1])
        return p.index * ca.sqrt(1 - p.gradient**2 * ca.sumsqr(across))

    return Graded(index_at, parameters={"index": index, "gradient": gradient})


@spelled
def exponential_atmosphere(
    refractivity: float = 2.8e-4, scale_height: float = 8e3, earth_radius: float | None = None
) -> Stratified | Radial:
    """n = 1 + N exp(-h/H) over a plane, or about a sphere where ``earth_radius`` is given; lengths in metres.

    h is the last coordinate, or the distance from the sphere's surface. Raises TypeError or ValueError for what are no
    numbers.
    """

    def index(height: ca.SX, p: Any) -> ca.SX:
        return 1 + p.refractivity * ca.exp(-height / p.scale_height)

    return _over_ground(index, earth_radius, {"refractivity": refractivity, "scale_height": scale_height})


@spelled
def munk_profile(
    axis: float = 1300.0, speed: float = 1500.0, epsilon: float = 0.00737, reference: float = 1500.0
) -> Stratified:
    """Sound in deep water: n = c0/c(z), c = c1 (1 + ε (η - 1 + exp(-η))), η = 2 (depth - axis)/axis, in metres.

    The last coordinate is the height, the surface at 0 and the depth below it.
    Munk, "Sound channel in an exponentially stratified ocean", J. Acoust. Soc. Am. 55 (1974) 220; the constants
    are those of Jensen, Kuperman, Porter, Schmidt, "Computational Ocean Acoustics", sect. 5.6. Raises TypeError or
    ValueError for what are no numbers, and a ``reference`` that is not positive.
    """
    c0 = positive("reference", reference)

    def index(height: ca.SX, p: Any) -> ca.SX:
        eta = 2 * (-height - p.axis) / p.axis
        return c0 / (p.speed * (1 + p.epsilon * (eta - 1 + ca.exp(-eta))))

    return Stratified(index, {"axis": axis, "speed": speed, "epsilon": epsilon})


@spelled
def standard_atmosphere(wavelength: float = 0.55, earth_radius: float | None = None) -> Stratified | Radial:
    """Dry air of the ICAO standard atmosphere up to 11 km, for visible light; lengths in metres.

    Temperature 288.15 K - 6.5 K/km and pressure 101325 Pa (T/T0)^5.25588 (ICAO Doc 7488), refractivity by Edlen's
    formula as Birch and Downs have it (Metrologia 30 (1993) 155), in proportion to the density of an ideal gas.
    ``wavelength`` is in micrometres, in vacuum, from 0.35 to 0.65. Raises TypeError or ValueError for what are no
    numbers.
    """

    def index(height: ca.SX, p: Any) -> ca.SX:
        """The index at a height above the ground."""
        check_wavelength(p.wavelength, (0.3, 1.7))
        sigma = 1 / p.wavelength**2
        at_15 = 1e-8 * (8342.54 + 2406147 / (130 - sigma) + 15998 / (38.9 - sigma))
        ratio = 1 - 0.0065 * height / 288.15
        return 1 + at_15 * ratio**4.25588

    return _over_ground(index, earth_radius, {"wavelength": wavelength})


def _over_ground(
    index: Callable[[Any, Any], Any], earth_radius: float | None, parameters: Mapping[str, float]
) -> Stratified | Radial:
    """``index`` of the height and the parameters, over a plane, or over a sphere about the origin."""
    if earth_radius is None:
        return Stratified(index, parameters)
    ground = positive("earth_radius", earth_radius)
    return Radial(lambda r, p: index(r - ground, p), parameters=parameters)
