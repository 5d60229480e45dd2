import casadi as ca
import numpy as np
import pytest

from varcalc.symbolic.nearest import gathered
from varcalc.symbolic.places import places
from varcalc.symbolic.shapes import shape
from varcalc.symbolic.sides import Sides
from varcalc.symbolic.switches import switches
from varcalc.symbolic.tracing import trace

WRITTEN = {
    "size": lambda x, y: ca.fabs(x - y) * y,
    "nested": lambda x, y: ca.fabs(ca.fabs(x) - 0.5) + y,
    "larger": lambda x, y: ca.fmax(x, y**2) - ca.fmin(x * y, 0.3),
    "branches": lambda x, y: ca.if_else(y > 0.1, ca.sqrt(y), ca.exp(x)),
    "both": lambda x, y: ca.if_else(ca.logic_and(x > 0, y <= 0.3), 2.0, ca.if_else(x < -0.5, y, x)),
    "steps": lambda x, y: ca.floor(3 * x) + ca.ceil(2 * y - x),
    "rests": lambda x, y: ca.fmod(3 * x, 0.7) + ca.remainder(y, 0.3),
    "signs": lambda x, y: ca.sign(x) * y + ca.copysign(y, x - y),
    "checkerboard": lambda x, y: ca.if_else(ca.fmod(ca.floor(4 * x + 9) + ca.floor(4 * y + 9), 2) == 0, x, y),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_a_piece_is_the_expression_on_its_sides_and_its_ends_are_where_it_stops_being_so(name):
    r = ca.SX.sym("r", 2)
    expression = ca.SX(WRITTEN[name](r[0], r[1]))
    pieces, own = Sides.of(expression, r), ca.Function("own", [r], [expression])
    points = np.random.default_rng(5).uniform(-1, 1, (300, 2))
    sides = pieces.at(points)
    assert len(np.unique(sides, axis=0)) > 1
    for key in np.unique(sides, axis=0):
        piece = pieces.piece(key)
        here = ca.Function("piece", [r], [ca.vertcat(piece.expression, *piece.ends)])
        inside = points[np.all(sides == key, axis=1)]
        values = np.array([np.array(here(point)).ravel() for point in inside])
        np.testing.assert_allclose(values[:, 0], [float(own(point)) for point in inside], rtol=1e-14, atol=1e-15)
        alone = ca.Function("alone", [r], [pieces.formula(key)])
        np.testing.assert_array_equal([float(alone(point)) for point in inside], values[:, 0])
        held = pieces.values(inside, np.tile(key, (len(inside), 1)))
        np.testing.assert_allclose(held, values[:, 0], rtol=1e-14, atol=1e-15)
        # no end changes its sign inside the piece: each is a line on one side of which the piece lies
        assert all(np.all(column > 0) or np.all(column < 0) for column in values[:, 1:].T if len(column))


@pytest.mark.parametrize("name", WRITTEN)
def test_pieces_of_one_shape_are_one_function_of_their_numbers(name):
    r = ca.SX.sym("r", 2)
    pieces = Sides.of(ca.SX(WRITTEN[name](r[0], r[1])), r)
    points = np.random.default_rng(5).uniform(-1, 1, (300, 2))
    written = {}
    for point, key in zip(points, pieces.at(points), strict=True):
        own, counted = pieces.piece(key), pieces.piece(key, counted=True)
        if counted.beyond != own.beyond:
            continue
        counts = pieces.counts if counted.counts else ca.SX(0, 1)
        of = shape([counted.expression, *counted.ends], ca.vertcat(r, counts))
        if of.key not in written:
            numbers = ca.vertcat(counts, of.numbers)
            written[of.key] = ca.Function("shape", [r, numbers], [ca.vertcat(*of.expressions)])
        here = ca.Function("piece", [r], [ca.vertcat(own.expression, *own.ends)])
        numbers = [*counted.counts, *of.values]
        np.testing.assert_allclose(
            np.array(written[of.key](point, numbers)), np.array(here(point)), rtol=1e-14, atol=1e-15
        )


def test_beyond_an_end_is_the_next_side_of_the_place_that_is_crossed():
    r = ca.SX.sym("r", 1)
    pieces = Sides.of(ca.floor(r) + ca.fabs(r - 0.25) + ca.if_else(0.25 - r > 0, 1, 2), r)
    assert len(pieces) == 2  # two operations switch in one place
    sides = pieces.at(np.array([[0.1], [0.4], [1.1]]))
    piece = pieces.piece(sides[0])
    ends = ca.Function("ends", [r], list(piece.ends))
    for place, number, beyond in ((0.25, 1, sides[1][1]), (1.0, 0, sides[2][0])):
        (end,) = (k for k, value in enumerate(np.ravel(ends(place))) if value == 0)
        assert piece.beyond[end] == (number, beyond)


def test_between_two_knots_of_a_nested_table_no_other_knot_is_an_end():
    r = ca.SX.sym("r", 2)
    outer, inner = [-0.1, 0.3, 0.7, 1.1], [0.1, 0.27, 0.61, 0.9]

    def table(height):
        return np.interp(np.interp(height, [-2.0, -0.4, 0.5, 2.0], inner), outer, [1.4, 1.5, 1.45, 1.6])

    pieces = Sides.of(trace("table", table, [r[1] + 0.2 * r[0] ** 2], ca.SX, ""), r)
    keys = np.unique(pieces.at(np.random.default_rng(5).uniform(-1, 1, (300, 2))), axis=0)
    assert len(keys) > 3
    assert all(len(pieces.piece(key).ends) == 2 for key in keys)
    assert len({shape([piece.expression, *piece.ends], r).key for piece in map(pieces.piece, keys)}) == 1


def test_ends_closer_than_round_off_are_kept_together():
    r = ca.SX.sym("r", 1)
    pieces = Sides.of(ca.fabs(r - 0.3) + ca.fabs(3 * r - 0.9) + ca.fabs(1.2 - 2 * r), r)
    ends = ca.Function("ends", [r], [ca.vertcat(*pieces.piece(pieces.at(np.array([[0.4]]))[0]).ends)])
    assert np.array(ends(0.3)).ravel() == pytest.approx([0.0, 0.0, -0.3], abs=1e-15)


def test_what_is_not_meant_on_a_side_is_left_alone():
    # of a table written as one branch inside the other every piece would hold all of it
    u, knots = ca.SX.sym("u"), np.arange(60.0)
    pieces = Sides.of(trace("n", lambda u: np.interp(u, knots, np.sin(knots)), [u], ca.SX), u)
    key = pieces.at(np.array([[40.25]]))[0]
    written = pieces.formula(key)
    expected = np.sin(40) + 0.25 * (np.sin(41) - np.sin(40))
    assert float(ca.Function("piece", [u], [written])(40.25)) == pytest.approx(expected, rel=1e-15)
    assert ca.Function("piece", [u], [written]).n_instructions() < 12


def test_switches_of_one_expression_less_numbers_are_looked_for_together():
    u, knots = ca.SX.sym("u"), np.array([-2.0, -0.3, 0.5, 1.75])
    inner = u + 0.2 * ca.sin(u)
    looked_up = trace("n", lambda u: np.interp(inner, knots, knots**2), [u], ca.SX)
    (switch,) = gathered(switches([looked_up], [u]))
    assert switch.levels == tuple(knots)
    found = places(switch, u, (-10.0, 10.0))
    np.testing.assert_allclose([x + 0.2 * np.sin(x) for x in found], knots, rtol=1e-14)
