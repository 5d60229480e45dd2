"""Rays to a surface that is looked for up to an optical path: those that come later, or never, have missed it."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics

FALLING = optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))
"""n² = 1 - 2y: a ray at an angle a flies as a stone does, and is back after ∫ n² dσ = 2 (sin a - (2/3) sin³ a)."""
CEILING, FLOOR = optics.Plane((0.0, 0.5), (0.0, 1.0)), optics.Plane((0.0, 0.0), (0.0, 1.0))


@pytest.mark.parametrize("share", [0.99, 1.01])
@pytest.mark.parametrize(
    ("medium", "until", "angle", "path"),
    [
        (optics.Uniform(1.5), CEILING, np.pi / 6, 1.5),
        (FALLING, FLOOR, np.pi / 4, 2 * (np.sin(np.pi / 4) - np.sin(np.pi / 4) ** 3 * 2 / 3)),
        (optics.fish_eye(), FLOOR, np.pi / 3, np.pi),  # from (1, 0) to its image, whichever way
    ],
)
def test_a_surface_is_met_within_the_optical_path_to_it_and_missed_within_less(medium, until, angle, path, share):
    start = (1.0, 0.0)
    ends = optics.Scene(medium).trace(start, (np.cos(angle), np.sin(angle)), optical_path=share * path, until=until)
    assert ends.status[0] == (optics.RayStatus.ARRIVED if share > 1 else optics.RayStatus.MISSED)
    assert ends.optical_path[0] == pytest.approx(min(share, 1.0) * path, rel=1e-12)
    if share > 1:
        assert abs(ends.points[0, 1] - until.point[1]) < 1e-12


def test_what_goes_round_for_ever_is_followed_no_farther():
    angles = np.radians([-130.0, 130.0])  # the circle about (0, cot a) comes up to cot a + 1/|sin a|
    ends = optics.Scene(optics.fish_eye()).trace(
        (1.0, 0.0), np.column_stack([np.cos(angles), np.sin(angles)]), optical_path=3 * np.pi, until=CEILING
    )
    assert ends.status.tolist() == [optics.RayStatus.ARRIVED, optics.RayStatus.MISSED]


def test_each_ray_has_a_limit_of_its_own():
    ends = optics.Scene(optics.Uniform(1.0)).trace((0.0, 0.0), [(0, 1), (0, 1)], optical_path=[0.4, 0.6], until=CEILING)
    assert ends.status.tolist() == [optics.RayStatus.MISSED, optics.RayStatus.ARRIVED]
