"""Geodesics of the spheroid: the Earth's in metres, and of a flat one.

With the latitude phi as independent variable, or the longitude, or neither,

    l = integral of sqrt(M^2 dphi^2 + N^2 cos(phi)^2 dlambda^2),
    N = a/sqrt(1 - e^2 sin(phi)^2),  M = (1 - e^2) N^3/a^2,  e^2 = f (2 - f).

In the reduced latitude beta, tan(beta) = (1 - f) tan(phi), Clairaut's constant
is cos(beta) sin(alpha) = sin(alpha0), and the geodesic follows a great circle
of an auxiliary sphere, sin(beta) = cos(alpha0) sin(sigma), with

    l = b integral of sqrt(1 + k^2 sin(sigma)^2) dsigma,  k^2 = e^2 cos(alpha0)^2/(1 - f)^2,
    lambda = omega - f sin(alpha0) integral of (2 - f)/(1 + (1 - f) sqrt(1 + k^2 sin(sigma)^2)) dsigma,

tan(omega) = sin(alpha0) tan(sigma): elliptic integrals, here by Gauss's rule.
alpha0 follows from the ends.

Source: Karney, "Algorithms for geodesics", J. Geodesy 87 (2013), sect. 2,
eq. 7-9.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import varcalc as vc
from varcalc.problems import _inapplicable
from varcalc.problems._geodesics import Distances, distances
from varcalc.problems._quadrature import integral
from varcalc.problems._roots import increasing_root

__all__ = ["EARTH", "FLAT", "Distances", "Geodesic", "distances", "references"]

SOURCE = 'Karney, "Algorithms for geodesics", J. Geodesy 87 (2013), sect. 2'
EARTH = {"a": 6378137.0, "f": 1 / 298.257223563}
FLAT = {"a": 1.0, "f": 0.4}
LATITUDE_FIRST = ("phi", "lambda")


def principal_radii(latitude, p):
    """Radii of curvature M along the meridian and N across it."""
    eccentricity2 = p.f * (2 - p.f)
    N = p.a / ca.sqrt(1 - eccentricity2 * ca.sin(latitude) ** 2)
    return (1 - eccentricity2) * N**3 / p.a**2, N


def on_spheroid(latitude, longitude, p):
    """The point at a geographic latitude and a longitude."""
    _, N = principal_radii(latitude, p)
    across, up = N * ca.cos(latitude), (1 - p.f) ** 2 * N * ca.sin(latitude)
    return across * ca.cos(longitude), across * ca.sin(longitude), up


def by_longitude(longitude, latitude, p):
    return on_spheroid(latitude, longitude, p)


def length_by_latitude(x, y, dy, p):
    M, N = principal_radii(x, p)
    return ca.sqrt(M**2 + (N * ca.cos(x) * dy) ** 2)


def length_by_longitude(x, y, dy, p):
    M, N = principal_radii(y, p)
    return ca.sqrt((M * dy) ** 2 + (N * ca.cos(y)) ** 2)


def speed(q, dq, p):
    M, N = principal_radii(q[0], p)
    return ca.sqrt((M * dq[0]) ** 2 + (N * ca.cos(q[0]) * dq[1]) ** 2)


@dataclass(frozen=True)
class Geodesic:
    """The geodesic of azimuth ``azimuth`` at the equator, from the angle ``first`` to ``last`` of its great circle."""

    a: float
    f: float
    azimuth: float
    first: float
    last: float

    @classmethod
    def between(
        cls, spheroid: dict[str, float], start: float, end: float, longitude: float, vertex: bool = False
    ) -> Geodesic:
        """From one latitude to another, ``longitude`` further east; northward all the way, or over the vertex."""
        from scipy.optimize import brentq

        a, f = spheroid["a"], spheroid["f"]
        low, high = (math.atan((1 - f) * math.tan(v)) for v in (start, end))
        # there is no vertex below either latitude
        steepest = math.pi / 2 - max(abs(low), abs(high))

        def at(azimuth: float) -> Geodesic:
            first, last = (math.asin(min(1.0, max(-1.0, math.sin(v) / math.cos(azimuth)))) for v in (low, high))
            return cls(a, f, azimuth, first, math.pi - last if vertex else last)

        def miss(azimuth: float) -> float:
            arc = at(azimuth)
            return float(arc.longitude(arc.last)) - longitude

        return at(brentq(miss, 1e-9, steepest, xtol=1e-17, rtol=4 * np.finfo(float).eps))

    @property
    def k2(self) -> float:
        """The square of the modulus."""
        return self.f * (2 - self.f) * math.cos(self.azimuth) ** 2 / (1 - self.f) ** 2

    def root(self, sigma: Any) -> np.ndarray:
        """sqrt(1 + k^2 sin(sigma)^2)."""
        return np.sqrt(1 + self.k2 * np.sin(sigma) ** 2)

    def longitude_rate(self, sigma: Any) -> np.ndarray:
        """The derivative of omega - longitude by sigma."""
        return self.f * math.sin(self.azimuth) * (2 - self.f) / (1 + (1 - self.f) * self.root(sigma))

    def spherical_longitude(self, sigma: Any) -> np.ndarray:
        """omega."""
        return np.arctan2(math.sin(self.azimuth) * np.sin(sigma), np.cos(sigma))

    def longitude(self, sigma: Any) -> np.ndarray:
        """The longitude, counted from the start."""
        spherical = self.spherical_longitude(sigma) - self.spherical_longitude(self.first)
        return spherical - integral(self.longitude_rate, self.first, sigma)

    def latitude(self, sigma: Any) -> np.ndarray:
        """The geographic latitude."""
        sine = math.cos(self.azimuth) * np.sin(sigma)
        cosine = np.hypot(np.cos(sigma), math.sin(self.azimuth) * np.sin(sigma))
        return np.arctan2(sine, (1 - self.f) * cosine)

    def distance(self, sigma: Any) -> np.ndarray:
        """The length from the start."""
        return self.a * (1 - self.f) * integral(self.root, self.first, sigma)

    @property
    def length(self) -> float:
        """The length of the whole arc."""
        return float(self.distance(self.last))

    def longitude_at_latitude(self, latitude: Any) -> np.ndarray:
        """The longitude where the geodesic, on its way north, crosses a latitude."""
        reduced = np.arctan((1 - self.f) * np.tan(latitude))
        return self.longitude(np.arcsin(np.sin(reduced) / math.cos(self.azimuth)))

    def latitude_at_longitude(self, longitude: Any) -> np.ndarray:
        """The latitude where the geodesic crosses a longitude."""

        def eastward(sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            cosine2 = np.cos(sigma) ** 2 + (math.sin(self.azimuth) * np.sin(sigma)) ** 2
            return self.longitude(sigma), math.sin(self.azimuth) / cosine2 - self.longitude_rate(sigma)

        return self.latitude(increasing_root(eastward, self.first, self.last, longitude))

    def q(self, t: Any) -> np.ndarray:
        """Latitude and longitude a fraction t of the length along."""

        def covered(sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return self.distance(sigma), self.a * (1 - self.f) * self.root(sigma)

        sigma = increasing_root(covered, self.first, self.last, np.asarray(t, dtype=float) * self.length)
        return np.array([self.latitude(sigma), self.longitude(sigma)])


def by_latitude(spheroid, start, end):
    """The shortest way on a spheroid between two ends, longitude as a function of latitude."""
    return vc.Problem(
        length_by_latitude, start, end, parameters=spheroid, names=LATITUDE_FIRST, units=("rad", "rad"),
        surface=on_spheroid,
    )  # fmt: skip


northward = Geodesic.between(EARTH, -0.5, 0.8, 0.7)
flight = Geodesic.between(EARTH, 0.7, 0.75, 1.8, vertex=True)
flat = Geodesic.between(FLAT, -0.4, 0.9, 1.0)

references = (
    vc.Reference(
        name="spheroid",
        problem=by_latitude(EARTH, vc.Fixed(-0.5, 0), vc.Fixed(0.8, 0.7)),
        exact=vc.Exact(northward.length, northward.longitude_at_latitude, "elliptic integrals"),
        source=SOURCE,
        statement="A geodesic of the Earth in metres, longitude as a function of latitude.",
    ),
    vc.Reference(
        name="spheroid/flight",
        problem=vc.Problem(
            length_by_longitude,
            vc.Fixed(0, 0.7),
            vc.Fixed(1.8, 0.75),
            parameters=EARTH,
            names=LATITUDE_FIRST[::-1],
            units=("rad", "rad"),
            surface=by_longitude,
        ),
        exact=vc.Exact(flight.length, flight.latitude_at_longitude, "elliptic integrals"),
        source=SOURCE,
        statement="A geodesic of the Earth over its northernmost point, latitude as a function of longitude.",
    ),
    vc.Reference(
        name="spheroid/curve",
        problem=vc.Curve(
            speed,
            vc.At((0.7, 0)),
            vc.At((0.75, 1.8)),
            parameters=EARTH,
            names=LATITUDE_FIRST,
            units=("rad", "rad"),
            surface=lambda q, p: on_spheroid(q[0], q[1], p),
        ),
        exact=vc.Exact(flight.length, flight.q, "elliptic integrals"),
        source=SOURCE,
        statement="The same geodesic of the Earth as a curve in latitude and longitude.",
        inapplicable=_inapplicable.SEVERAL_FUNCTIONS,
    ),
    vc.Reference(
        name="spheroid/flat",
        problem=by_latitude(FLAT, vc.Fixed(-0.4, 0), vc.Fixed(0.9, 1.0)),
        exact=vc.Exact(flat.length, flat.longitude_at_latitude, "elliptic integrals"),
        source=SOURCE,
        statement="A geodesic of a spheroid of flattening 0.4.",
    ),
)
