"""Rays that come to where the index vanishes, which none of them passes."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from varcalc import optics
from varcalc.optics import RayStatus

TILTED = np.array([0.6, 0.8])
LINE, POINT = (
    optics.Graded(lambda x, y: ca.fabs(0.6 * x + 0.8 * y - 0.3)),
    optics.Graded(lambda x, y: x**2 + (y - 0.3) ** 2),
)


@pytest.mark.parametrize(
    ("medium", "model", "power"),
    [
        (LINE, None, 1),
        (LINE, optics.Hamilton(), 1),
        (optics.Radial(lambda r: r, center=(0.18, 0.24)), optics.Invariants(), 1),
        (optics.Graded(lambda x, y: (0.6 * x + 0.8 * y - 0.3) ** 2), None, 2),
        (optics.Graded(lambda x, y: ca.fmax(ca.fabs(0.6 * x + 0.8 * y) - 0.3, 0)), None, 1),
    ],
    ids=["line", "line, integrated", "point", "line of second order", "beside a dark strip"],
)
def test_a_ray_ends_where_the_index_vanishes_with_its_slope(
    medium: optics.Medium, model: optics.Model | None, power: int
) -> None:
    """Straight to where n = sᵏ vanishes the optical path to s from 0.7 is (0.7ᵏ⁺¹ - sᵏ⁺¹)/(k + 1)."""
    whole = 0.7 ** (power + 1) / (power + 1)
    paths = whole * np.array([0.9, 1.001, 3.0])
    bundle = optics.Scene(medium).trace(np.tile(TILTED, (3, 1)), -TILTED, optical_path=paths, model=model)
    assert bundle.status.tolist() == [RayStatus.ARRIVED, RayStatus.SINGULAR, RayStatus.SINGULAR]
    np.testing.assert_allclose(bundle.points[0], (0.3 + 0.7 * 0.1 ** (1 / (power + 1))) * TILTED, atol=1e-12)


def test_a_ray_does_not_come_to_a_surface_behind_a_dark_point() -> None:
    behind = optics.Plane((0, -2), (0, 1))
    bundle = optics.Scene(POINT).trace((0, 1), [(0, -1), (0.5, -1), (0, 1)], until=behind)
    assert bundle.status[[0, 2]].tolist() == [RayStatus.SINGULAR, RayStatus.MISSED]


@pytest.mark.parametrize("beyond", [0.0, 1.0], ids=["dark", "bright"])
def test_a_ray_turns_back_at_a_kink_where_the_square_of_the_index_vanishes(beyond: float) -> None:
    """n² = s on one side, as of a stone: straight down from 1 it is at rest after 2/3, and at s after 2/3 (1 + s^1.5).

    So turn back all that come there at a slant.
    """
    up = np.array([np.cos(2.9), np.sin(2.9)])

    def index(x: ca.SX, y: ca.SX) -> ca.SX:
        s = up[0] * x + up[1] * y - 0.3
        return ca.sqrt(ca.fmax(s, -beyond * s))

    bundle = optics.Scene(optics.Graded(index)).trace(1.3 * up, -up, optical_path=(1 + 1.44**1.5) * 2 / 3)
    np.testing.assert_allclose(bundle.points, [1.74 * up], atol=1e-9)
    assert bundle.arrived.all()


def test_a_ray_beside_a_dark_line_goes_on() -> None:
    """n = |y|: height is cosh, as of a chain, and with the momentum p along the line y² = p² cosh²(σ - σ₀)."""
    across = np.sqrt(1 - 1e-6)
    turn = np.arctanh(across)
    path = turn / 2 * 1e-6 + across / 2  # ∫ p² cosh² dσ to the lowest point
    for model in (optics.Hamilton(), optics.Linear()):
        medium = optics.Stratified(ca.fabs)
        bundle = optics.Scene(medium).trace((0, 1), (1e-3, -across), optical_path=2 * path, model=model)
        np.testing.assert_allclose(bundle.points, [[2e-3 * turn, 1.0]], atol=1e-8)


def test_a_ray_ends_beside_dark_layers_from_wherever_it_comes() -> None:
    """In n = max(|y| - 0.3, 0) the optical path to 0.3 from 0.625 is 0.325²/2; from some heights it had no end."""
    layers = optics.Stratified(lambda y: ca.fmax(ca.fabs(y) - 0.3, 0))
    bundle = optics.Scene(layers).trace(
        [(0, 0.625)] * 2, (0, -1), optical_path=[0.99 * 0.325**2 / 2, 5.0], model=optics.Invariants()
    )
    assert bundle.status.tolist() == [RayStatus.ARRIVED, RayStatus.SINGULAR]
    np.testing.assert_allclose(bundle.points[0], (0, 0.3 + 0.325 * 0.1), atol=1e-12)


def test_an_upright_ray_turns_back_where_layers_grow_dark() -> None:
    """n² = max(y - 0.3, 0): from s = 0.7 to rest and back to s the optical path is 2/3 (0.7^1.5 + s^1.5)."""
    layers = optics.Stratified(lambda y: ca.sqrt(ca.fmax(y - 0.3, 0)))
    path = (0.7**1.5 + 0.9**1.5) * 2 / 3
    bundle = optics.Scene(layers).trace((0, 1), (0, -1), optical_path=path, model=optics.Invariants())
    np.testing.assert_allclose(bundle.points, [(0, 1.2)], atol=1e-12)
