"""Valleys of L, and wells of what ends cost, that are narrower than the meshes of any lattice."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

import varcalc as vc

DEPTH, LENGTH = 30.0, 10.0


def valley(r2, width):
    """A valley along r = 0."""
    return -DEPTH * ca.exp(-r2 / width**2)


def through_the_valley(place, width):
    """The least value: to the valley, along its bottom and back, by v^2/2 = V + 30, up to exp(-7 LENGTH / width)."""
    there = quad(lambda u: np.sqrt(-np.expm1(-((u / width) ** 2))), 0, place, points=[width, 5 * width], limit=200)[0]
    return -DEPTH * LENGTH + 2 * np.sqrt(2 * DEPTH) * there


@pytest.mark.parametrize(("place", "width"), [(0.47, 0.1), (1.3, 0.03), (0.47, 0.01), (1.3, 0.01)])
def test_a_valley_far_from_the_chord_is_followed(place, width):
    found = vc.solve(
        vc.Problem(lambda x, y, v: v**2 / 2 + valley((y - place) ** 2, width), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0))
    )
    assert found.value == pytest.approx(through_the_valley(place, width), rel=1e-9)
    assert not found.local


@pytest.mark.parametrize("width", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("place", [[1.3], [0.47, -0.3]])
def test_a_chord_is_not_called_least_beside_a_narrow_one(place, width):
    zero = np.zeros(len(place))
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: ca.sumsqr(v) / 2 + valley(ca.sumsqr(y - ca.DM(place)), width),
            vc.Fixed(0, zero), vc.Fixed(LENGTH, zero),
        )
    )  # fmt: skip
    least = through_the_valley(float(np.linalg.norm(place)), width)
    told = found.local and width < 1e-4  # of the narrowest a polygon is known, if no extremal
    assert told or found.value == pytest.approx(least, rel=1e-9)


SWITCHED = {
    # the form of a slot, and the integral of the root of 1 - form from its middle, or the edge it is kept to, to u = 1
    "box": (lambda u: ca.if_else(ca.fabs(u) < 1, 1, 0), 0.0),
    "two steps": (lambda u: ca.if_else(u > -1, 1, 0) - ca.if_else(u > 1, 1, 0), 0.0),
    "tent": (lambda u: ca.fmax(0, 1 - ca.fabs(u)), 2 / 3),
    "parabola": (lambda u: ca.fmax(0, 1 - u**2), 1 / 2),
    "square": (lambda u: ca.fmax(0, 1 - u**2) ** 2, (2 * np.sqrt(2) - 1) / 3),
}


@pytest.mark.parametrize(("form", "width"), [*((form, 1e-3) for form in SWITCHED), ("box", 1e-1), ("square", 1e-1)])
def test_a_slot_that_ends_at_kinks_or_jumps_is_entered(form, width):
    """v^2/2 = 30 (1 - form) on the way there, and back: a chord that never meets a switch is no minimum."""
    slot, inside = SWITCHED[form]
    place = 1.3
    found = vc.solve(
        vc.Problem(lambda x, y, v: v**2 / 2 - DEPTH * slot((y - place) / width), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0))
    )
    least = -DEPTH * LENGTH + 2 * np.sqrt(2 * DEPTH) * (place - width + width * inside)
    assert found.value == pytest.approx(least, rel=1e-10)
    assert not found.local
    assert abs(found.value - least) <= 10 * found.error.value + 1e-12 * abs(least)


@pytest.mark.parametrize(("form", "width"), [*((form, 1e-6) for form in SWITCHED), ("box", 1e-4), ("parabola", 1e-4)])
def test_no_slot_is_too_narrow_to_be_told_of(form, width):
    slot, inside = SWITCHED[form]
    found = vc.solve(
        vc.Problem(lambda x, y, v: v**2 / 2 - DEPTH * slot((y - 1.3) / width), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0)),
        throw=False,
    )
    least = -DEPTH * LENGTH + 2 * np.sqrt(2 * DEPTH) * (1.3 - width + width * inside)
    assert found.local or not found.status.ok or found.value == pytest.approx(least, rel=1e-9)


def test_a_slot_that_runs_down_from_the_chord_is_followed_at_its_level():
    """Between two steps of y, v^2/2 = 1 on a way at rest at the nearer edge: the chord falls from -1/2 to -1."""
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 - ca.if_else(y > -0.15, 1, 0) + 3 * ca.if_else(y > -0.1, 1, 0),
            vc.Fixed(0, -0.5), vc.Fixed(2, -1),
        )
    )  # fmt: skip
    assert found.value == pytest.approx(-2 + np.sqrt(2) * (0.35 + 0.85), rel=1e-9)
    assert not found.local


@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-5])
@pytest.mark.parametrize("form", ["tent", "parabola", "square"])
def test_an_end_goes_into_a_well_of_its_cost_that_ends_at_kinks(form, width):
    """The curve to y1 adds y1^2/(2 T) to a cost -5 f((y1 - c)/w)."""
    slot, _ = SWITCHED[form]
    place, T = 1.3, 2.0
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Free(T),
            end_cost=lambda a, ya, b, yb: -5 * slot((yb - place) / width),
        )
    )  # fmt: skip
    well = {"tent": lambda u: 1 - abs(u), "parabola": lambda u: 1 - u**2, "square": lambda u: (1 - u**2) ** 2}[form]
    least = minimize_scalar(
        lambda u: (place + width * u) ** 2 / (2 * T) - 5 * well(u), bounds=(-1, 1), method="bounded",
        options={"xatol": 1e-12},
    ).fun  # fmt: skip
    assert found.value == pytest.approx(least, rel=1e-10)
    assert not found.local


@pytest.mark.parametrize("share", [0.1, 0.2])
@pytest.mark.parametrize("elements", [16, 64])
def test_a_mesh_that_holds_a_turn_where_it_is_makes_no_answer(elements, share):
    """Moved into an element whose points all lie in the valley, the turn costs more on that mesh, whatever it costs."""
    place, width = 1.3, 1e-5
    found = vc.solve(
        vc.Problem(lambda x, y, v: v**2 / 2 + valley((y - place) ** 2, width), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0)),
        vc.Ritz(elements=elements, starts=1), throw=False,
        guess=lambda x: place * np.minimum(1, np.minimum(x, LENGTH - x) / share),
    )  # fmt: skip
    assert not found.status.ok or found.value == pytest.approx(through_the_valley(place, width), rel=1e-9)


def test_a_valley_that_bends_is_seen():
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + valley((y - 1.3 - ca.sin(x)) ** 2, 1e-3), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0)
        )
    )
    assert found.local or found.value < -200


@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-5])
def test_a_narrow_channel_for_light_is_seen_from_a_curve_and_from_a_graph(width):
    """Along the axis of the channel the optical path is a tenth of the length, and 1.3 there and 1.3 back."""

    def index(y):
        return 1 - 0.9 * ca.exp(-(((y - 1.3) / width) ** 2))

    graph = vc.Problem(lambda x, y, v: index(y) * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(10, 0))
    curve = vc.Curve(lambda q, dq: index(q[1]) * ca.norm_2(dq), vc.At([0, 0]), vc.At([10, 0]))
    for found in map(vc.solve, (graph, curve)):
        assert found.local or found.value == pytest.approx(3.6, abs=2 * width)


def test_smooth_hills_show_none():
    found = vc.solve(vc.Problem(lambda x, y, v: v**2 / 2 + ca.exp(-(y**2)), vc.Fixed(0, 0), vc.Fixed(1, 1)))
    assert not found.local
    assert "narrow" not in found.searched


WELLS = {
    "exponential": lambda r2: np.exp(-r2),
    "rational": lambda r2: 1 / (1 + r2),
}


@pytest.mark.parametrize("form", WELLS)
@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-5])
def test_an_end_goes_into_a_narrow_well_of_its_cost(form, width):
    """Along straight lines the functional of the end y is y^2/2 + cost(y)."""
    place, of = 1.3, {"exponential": lambda r2: ca.exp(-r2), "rational": WELLS["rational"]}[form]
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Free(1),
            end_cost=lambda x0, y0, x1, y1: -3 * of(((y1 - place) / width) ** 2),
        )
    )  # fmt: skip
    value = lambda z: (place + width * z) ** 2 / 2 - 3 * WELLS[form](z**2)  # noqa: E731
    assert found.value == pytest.approx(minimize_scalar(value, bracket=(-0.5, 0.0, 0.5), tol=1e-14).fun, rel=1e-9)
    assert not found.local
    assert "all other ends" in found.searched


def test_an_end_of_two_functions_goes_into_the_deeper_of_two_wells():
    """Along the way to the end y the functional is |y|^2 coth(1)/2 + cost(y), of L = |v|^2/2 + |y|^2/2."""
    wells, width = [([1.3, -0.4], 4.0), ([-0.7, 1.1], 3.5)], 1e-3

    def cost(x0, y0, x1, y1):
        return -sum(depth * ca.exp(-ca.sumsqr((y1 - ca.DM(place)) / width)) for place, depth in wells)

    found = vc.solve(
        vc.Problem(lambda x, y, v: ca.sumsqr(v) / 2 + ca.sumsqr(y) / 2, vc.Fixed(0, [0, 0]), vc.Free(1), end_cost=cost)
    )
    expected = []
    for place, depth in wells:
        r = np.linalg.norm(place)
        along = lambda z, r=r, depth=depth: (r + width * z) ** 2 / (2 * np.tanh(1)) - depth * np.exp(-(z**2))  # noqa: E731
        expected.append(minimize_scalar(along, bracket=(-0.5, 0.0, 0.5), tol=1e-14).fun)
    assert found.value == pytest.approx(min(expected), rel=1e-9)


@pytest.mark.parametrize("width", [1e-1, 1e-3])
def test_a_beam_bends_into_a_narrow_well_of_its_tip(width):
    """Bent by its tip to y, clamped at the other end, a beam of length 1 holds 3 y^2/2."""
    place = 1.3
    found = vc.solve(
        vc.Problem(
            lambda x, y, v, w: w**2 / 2, vc.Fixed(0, 0, 0), vc.Free(1), order=2,
            end_cost=lambda x0, y0, x1, y1: -3 * ca.exp(-(((y1 - place) / width) ** 2)),
        )
    )  # fmt: skip
    value = lambda z: 1.5 * (place + width * z) ** 2 - 3 * np.exp(-(z**2))  # noqa: E731
    assert found.value == pytest.approx(minimize_scalar(value, bracket=(-0.5, 0.0, 0.5), tol=1e-14).fun, rel=1e-9)


def test_both_ends_are_moved_into_wells_of_their_own():
    """Along straight lines the functional of the ends is (y1 - y0)^2/2 + cost(y0) + cost(y1)."""
    width = 1e-3
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2, vc.Free(0), vc.Free(1),
            end_cost=lambda x0, y0, x1, y1: (y0**2 + y1**2) / 100
            - ca.exp(-(((y0 - 0.8) / width) ** 2)) - ca.exp(-(((y1 + 0.3) / width) ** 2)),
        )
    )  # fmt: skip
    assert found.value == pytest.approx(1.1**2 / 2 + (0.8**2 + 0.3**2) / 100 - 2, abs=1e-2)


def test_a_waypoint_is_kept_between_two_visits_to_a_valley():
    place, width, height = 0.8, 1e-3, 0.2
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + valley((y - place) ** 2, width), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0),
            [vc.Through(LENGTH / 2, height)],
        )
    )  # fmt: skip
    visits = through_the_valley(place, width) + through_the_valley(place - height, width) + DEPTH * LENGTH
    assert found.local or found.value == pytest.approx(visits, rel=1e-9)
    assert found.y(LENGTH / 2) == pytest.approx(height)


def test_free_ends_rest_in_the_valley():
    found = vc.solve(
        vc.Problem(lambda x, y, v: v**2 / 2 + valley((y - 1.3) ** 2, 1e-3), vc.Fixed(0, 0), vc.Free(LENGTH))
    )
    there = (through_the_valley(1.3, 1e-3) + DEPTH * LENGTH) / 2
    assert found.value == pytest.approx(there - DEPTH * LENGTH, rel=1e-9)
    assert not found.local


@pytest.mark.parametrize("width", [1e-3, 1e-5])
def test_beside_a_level_that_binds_nothing_a_polygon_counts(width):
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + valley((y - 1.3) ** 2, width), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0),
            [vc.Isoperimetric(lambda x, y, v: y**2, upper=50)],
        )
    )  # fmt: skip
    assert found.local or found.value == pytest.approx(through_the_valley(1.3, width), rel=1e-9)


def test_a_polygon_that_keeps_no_level_marks_nothing():
    """In the valley the integral of y^2 is 16.9: a level of 1 does not allow it, and the chord is the minimum."""
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + valley((y - 1.3) ** 2, 1e-5), vc.Fixed(0, 0), vc.Fixed(LENGTH, 0),
            [vc.Isoperimetric(lambda x, y, v: y**2, upper=1)],
        )
    )  # fmt: skip
    assert found.value == pytest.approx(0, abs=1e-12)
    assert not found.local


@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-5])
def test_a_valley_is_entered_where_both_ends_are_free(width):
    """No way leads there and back: the whole curve lies at the bottom."""
    place, depth, length = 0.4, 9.0, 5.0
    found = vc.solve(
        vc.Problem(
            lambda x, y, v: v**2 / 2 + (y**2 - 1) ** 2 - depth * ca.exp(-(((y - place) / width) ** 2)),
            vc.Free(0), vc.Free(length),
        )
    )  # fmt: skip
    bottom = brentq(
        lambda y: 4 * y * (y**2 - 1) + 2 * depth * (y - place) / width**2 * np.exp(-(((y - place) / width) ** 2)),
        place, place + width / 2, xtol=1e-16,
    )  # fmt: skip
    exact = length * ((bottom**2 - 1) ** 2 - depth * np.exp(-(((bottom - place) / width) ** 2)))
    assert abs(found.value - exact) <= found.error.value + 1e-12
    assert not found.local
