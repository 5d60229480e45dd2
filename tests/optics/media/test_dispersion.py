"""Media with dispersion at the wavelength of a scene: a prism, against its closed form and the glass catalogue."""

import casadi as ca
import numpy as np
import pytest

from varcalc import optics

BK7 = optics.GLASSES["N-BK7"]
LINES = {"d": (0.5875618, 1.51680), "F": (0.4861327, 1.52238), "C": (0.6562725, 1.51432)}
"""Fraunhofer's lines, in micrometres, and Schott's index of N-BK7 there."""
APEX = np.pi / 3
AIR = optics.Uniform(1.0)


def prism(glass):
    """A prism whose edge is at (0, 0), symmetric about the y axis, below it."""
    half = APEX / 2
    faces = [optics.Plane((0, 0), (-np.cos(half), np.sin(half))), optics.Plane((0, 0), (np.cos(half), np.sin(half)))]
    return optics.Scene([AIR, glass, AIR], faces)


def deviations(scene, incidences, **call):
    """The angles by which rays at these angles of incidence are turned."""
    heading = APEX / 2 + 0 * incidences - incidences  # of the first face's inward normal (cos, -sin) half the apex
    directions = np.column_stack([np.cos(heading), -np.sin(heading)])
    face = np.array([-np.sin(APEX / 2), -np.cos(APEX / 2)])
    bundle = scene.trace(face - 0.1 * directions, directions, until=optics.Plane((3.0, 0), (1, 0)), **call)
    assert bundle.arrived.all()
    return np.abs(np.arctan2(bundle.directions[:, 1], bundle.directions[:, 0]) + heading)


@pytest.mark.parametrize("line", LINES)
def test_minimum_deviation_of_a_prism(line):
    wavelength, catalogue = LINES[line]
    index = BK7.index(wavelength)
    assert index == pytest.approx(catalogue, abs=6e-6)
    least = 2 * np.arcsin(index * np.sin(APEX / 2)) - APEX
    incidence = np.arcsin(index * np.sin(APEX / 2))
    around = incidence + np.array([-1e-3, 0.0, 1e-3])
    scene = prism(optics.Uniform(BK7))
    by_call = deviations(scene, around, wavelength=wavelength)
    assert by_call[1] == pytest.approx(least, rel=1e-14)
    assert np.all(by_call[[0, 2]] > by_call[1])
    np.testing.assert_array_equal(deviations(scene.at_wavelength(wavelength), around), by_call)
    np.testing.assert_array_equal(deviations(prism(optics.Uniform(index)), around), by_call)


def test_rays_at_a_wavelength_and_what_they_owe_to_it():
    scene = optics.Scene([AIR, optics.Uniform(BK7)], [optics.Plane((0, 0), (0, 1))], wavelength=0.5875618)
    [ray] = scene.rays((0, 1), (0, -2))
    assert ray.optical_path == pytest.approx(1 + 2 * BK7.index(0.5875618), rel=1e-14)
    [blue] = scene.rays((0, 1), (0, -2), wavelength=0.4861327)
    assert blue.optical_path == pytest.approx(1 + 2 * BK7.index(0.4861327), rel=1e-14)
    h = 1e-4
    difference = (BK7.index(0.5875618 + h) - BK7.index(0.5875618 - h)) / h
    assert ray.derivatives["wavelength"] == pytest.approx(difference, rel=1e-6)


def test_a_graded_glass_with_dispersion():
    """A rod whose axial index is that of a glass: its period follows the wavelength."""

    def index(x, z, p):
        return BK7.index(p.wavelength) * ca.sqrt(1 - 0.04 * x**2)

    rod = optics.Scene(optics.Graded(index, {"wavelength": 0.5875618}))
    for wavelength in (0.4861327, 0.6562725):
        end = rod.trace((0, 0), (0.3, 1.0), optical_path=2.0, wavelength=wavelength)
        same = optics.Scene(optics.selfoc(BK7.index(wavelength), 0.2)).trace((0, 0), (0.3, 1.0), optical_path=2.0)
        np.testing.assert_allclose(end.points, same.points, rtol=1e-14)


def test_air_by_wavelength():
    scene = optics.Scene(optics.standard_atmosphere())
    blue = optics.Scene(optics.standard_atmosphere(0.45))
    call = {"optical_path": 5e4, "wavelength": 0.45}
    ends = [scene.trace((0, 0), (1.0, 0.1), **call), blue.trace((0, 0), (1.0, 0.1), optical_path=5e4)]
    np.testing.assert_array_equal(ends[0].points, ends[1].points)


def test_what_is_refused():
    scene = prism(optics.Uniform(BK7))
    with pytest.raises(ValueError, match="give wavelength=, in micrometres in vacuum"):
        scene.trace((-2, -1), (1, 0), optical_path=1.0)
    with pytest.raises(ValueError, match=r"wavelength must lie between 0\.3 and 2\.5 micrometres, not 589"):
        scene.at_wavelength(589)
    with pytest.raises(ValueError, match="wavelength must be a positive number"):
        optics.Scene(AIR, wavelength=-0.5)
    with pytest.raises(ValueError, match="wavelength must lie between"):
        optics.standard_atmosphere(5.0)


def test_the_index_at_many_wavelengths_is_an_array():
    glass, wavelengths = optics.GLASSES["N-BK7"], np.array([[0.4, 0.5], [0.6, 0.7]])
    assert np.array_equal(glass.index(wavelengths), [[glass.index(w) for w in row] for row in wavelengths])
    assert np.array_equal(optics.Cauchy([1.5, 0.004]).index([0.5]), [1.5 + 0.004 / 0.25])
    with pytest.raises(ValueError, match="wavelength must lie between"):
        glass.index([0.5, 587.6])
