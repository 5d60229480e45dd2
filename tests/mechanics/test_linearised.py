"""Equilibria and small motions about them: gyroscopic and dissipative forces, zero modes, constraints."""

import math

import casadi as ca
import numpy as np
import pytest

from varcalc import mechanics


def oscillator(damping, stiffness=1.0):
    return mechanics.System(
        lambda t, q, v: (v[0] ** 2 - stiffness * q[0] ** 2) / 2, ("x",), forces=lambda t, q, v: [-2 * damping * v[0]]
    )


@pytest.mark.parametrize("damping", [0.3, 1.7, -0.2])
def test_a_damped_oscillator_turns_slower_and_an_overdamped_one_not_at_all(damping):
    modes = oscillator(damping).normal_modes([0.0])
    root = np.sqrt(complex(damping**2 - 1))
    exponents = np.array([-damping + root, -damping - root])
    np.testing.assert_allclose(modes.exponents, exponents[np.lexsort([-exponents.imag, -exponents.real])], rtol=1e-14)
    assert modes.frequencies[0] == pytest.approx(abs(root.imag), abs=1e-15)
    assert modes.rates[0] == pytest.approx(exponents.real.max(), rel=1e-14)
    assert modes.stable is (damping > 0)


def test_a_force_that_depends_on_the_place_is_part_of_the_stiffness():
    spring = mechanics.System(lambda t, q, v: v[0] ** 2 / 2, ("x",), forces=lambda t, q, v: [-4 * (q[0] - 0.5)])
    assert spring.equilibria([-1], [2]).places[:, 0] == pytest.approx([0.5], abs=1e-14)
    assert spring.normal_modes([0.5]).frequencies[0] == pytest.approx(2.0, rel=1e-14)


@pytest.mark.parametrize("turn", [0.5, 0.9999, 1.0001, 1.3, 1.9999, 2.0001])
def test_a_top_of_a_hill_is_held_by_a_turning_that_is_fast_enough(turn):
    # x'' - 2 w y' + ... of V = -(x² + y²)/2 with a gyroscopic force g = 2 w: stable where g > 2
    hill = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 + turn * (q[0] * v[1] - q[1] * v[0]) / 2 * 2 + ca.sumsqr(q) / 2, ("x", "y")
    )
    modes = hill.normal_modes([0, 0])
    root = np.sqrt(complex(turn**2 - 1))
    known = np.array([turn - root, turn + root])
    assert modes.stable is (turn > 1)
    np.testing.assert_allclose(modes.frequencies, np.sort(known.real), rtol=1e-11)
    np.testing.assert_allclose(np.sort(modes.rates), np.sort(known.imag), atol=1e-11)


def test_what_drifts_is_not_stable_and_what_is_turned_round_by_a_field_is():
    free = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y"))
    turned = mechanics.System(mechanics.charged(1.0, 1.0, lambda t, q: [-1.5 * q[1], 1.5 * q[0]]), ("x", "y"))
    braked = mechanics.System(lambda t, q, v: v[0] ** 2 / 2, ("x",), forces=lambda t, q, v: [-v[0]])
    found = [one.normal_modes([0.2] * one.n) for one in (free, turned, braked)]
    assert [one.stable for one in found] == [False, True, True]
    assert [one.zero_modes for one in found] == [2, 2, 1]
    assert found[1].frequencies == pytest.approx([0, 3.0], rel=1e-14, abs=1e-14)
    assert found[2].exponents == pytest.approx([0, -1], abs=1e-15)


def test_lagranges_points_of_two_bodies_are_stable_for_unequal_masses_alone():
    # in the turning frame, units of the distance and of the turning; Routh: stable where 27 m (1 - m) < 1
    def threesome(share):
        def effective(q):
            near, far = ca.sqrt((q[0] + share) ** 2 + q[1] ** 2), ca.sqrt((q[0] - 1 + share) ** 2 + q[1] ** 2)
            return ca.sumsqr(q) / 2 + (1 - share) / near + share / far

        return mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 + q[0] * v[1] - q[1] * v[0] + effective(q), ("x", "y"))

    border = (1 - math.sqrt(23 / 27)) / 2
    for share in (0.99 * border, 1.01 * border):
        found = threesome(share).equilibria([0.3, 0.7], [0.6, 1.0])
        assert found.unresolved == 0
        np.testing.assert_allclose(found.places, [[0.5 - share, math.sqrt(3) / 2]], rtol=0, atol=1e-14)
        modes = threesome(share).normal_modes(found.places[0])
        assert modes.stable is (share < border)
        squares = (1 + np.sqrt(complex(1 - 27 * share * (1 - share))) * np.array([-1, 1])) / 2
        known = np.sqrt(squares)  # of one sign each
        np.testing.assert_allclose(modes.frequencies, np.sort(np.abs(known.real)), rtol=1e-12)


def test_a_friction_that_follows_the_motion_round_is_not_shown_stable_by_its_energy():
    # K = ((2, c), (-c, 2)): λ² = -2 ± ic grows whatever c
    whirl = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 - ca.sumsqr(q), ("x", "y"), forces=lambda t, q, v: [-0.1 * q[1], 0.1 * q[0]]
    )
    modes = whirl.normal_modes([0, 0])
    assert modes.stable is False
    assert modes.rates.max() == pytest.approx(np.sqrt(-2 + 0.1j).real, rel=1e-13)


def test_constraints_leave_the_modes_along_them():
    rod = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 - 9.81 * q[1], ("x", "y"),
        constraints=[mechanics.Holonomic(lambda t, q: (ca.sumsqr(q) - 0.64) / 2)],
    )  # fmt: skip
    found = rod.equilibria([-1, -1.03], [1.1, 1])
    assert found.unresolved == 0
    np.testing.assert_allclose(found.places, [[0, -0.8], [0, 0.8]], atol=1e-14)
    below, above = (rod.normal_modes(place) for place in found.places)
    assert below.frequencies == pytest.approx([math.sqrt(9.81 / 0.8)], rel=1e-14)
    assert above.rates == pytest.approx([math.sqrt(9.81 / 0.8)], rel=1e-14)
    assert (below.stable, above.stable) == (True, False)
    with pytest.raises(ValueError, match=r"off constraints\[0\]"):
        rod.normal_modes([0, -0.7])
    with pytest.raises(ValueError, match="no equilibrium"):
        rod.normal_modes([0.8, 0])
    disc = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y"), constraints=[mechanics.Pfaffian(lambda t, q: [q[1], 1])]
    )
    with pytest.raises(ValueError, match="Pfaffian"):
        disc.equilibria([-1, -1], [1, 1])


def test_what_is_driven_rests_only_where_the_drive_leaves_it_alone():
    shaken = mechanics.System(
        lambda t, q, v, p: v[0] ** 2 / 2 + (1 + p.a * ca.cos(p.w * t)) * ca.cos(q[0]) + p.f * q[0] * ca.sin(p.w * t),
        ("theta",), parameters={"a": 0.3, "w": 2.0, "f": 0.0},
    )  # fmt: skip
    assert shaken.equilibria([-1], [4]).places[:, 0] == pytest.approx([0, math.pi], abs=1e-13)
    with pytest.raises(ValueError, match="floquet"):
        shaken.normal_modes([0.0])
    pushed = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 - q[0] ** 2 / 2 + q[0] * ca.sin(1e-6 * t), ("x",))
    assert len(pushed.equilibria([-1], [1.1]).places) == 0
    # what is added by a gauge stands still
    gauged = mechanics.System(lambda t, q, v: (v[0] ** 2 - q[0] ** 2) / 2, ("x",)).gauged(
        lambda t, q: q[0] ** 2 * ca.sin(3 * t)
    )
    assert gauged.equilibria([-1], [1.1]).places[:, 0] == pytest.approx([0], abs=1e-14)
    assert gauged.normal_modes([0.0]).frequencies == pytest.approx([1], rel=1e-13)


def test_units_do_not_decide_what_rests():
    # a trap of nanometres: half a width off its middle is no equilibrium
    width = 1e-9
    trap = mechanics.System(lambda t, q, v: 1e-20 * v[0] ** 2 / 2 + ca.cos(q[0] / width) * 1e-21, ("x",))
    assert trap.normal_modes([0.0]).frequencies == pytest.approx([math.sqrt(1e-21 / 1e-20) / width], rel=1e-13)
    with pytest.raises(ValueError, match="no equilibrium"):
        trap.normal_modes([width / 2])


def test_a_slow_mode_beside_a_fast_one_is_no_zero_mode():
    # ω = 1 and 1e6, in coordinates of unlike units
    stiff = mechanics.System(
        lambda t, q, v: (v[0] ** 2 + 1e-10 * v[1] ** 2 - q[0] ** 2 - 1e2 * q[1] ** 2) / 2,
        ("x", "y"),
    )  # fmt: skip
    modes = stiff.normal_modes([0, 0])
    assert modes.frequencies == pytest.approx([1.0, 1e6], rel=1e-9)
    assert (modes.stable, modes.zero_modes) == (True, 0)
