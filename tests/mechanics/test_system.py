"""What a Lagrangian says: momenta, energy, Hamilton's equations, symmetries, reduction, other frames and gauges."""

import math

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc import mechanics

PENDULUM = mechanics.System(
    lambda t, q, v, p: p.l**2 * v[0] ** 2 / 2 + p.g * p.l * ca.cos(q[0]), ("theta",), parameters={"g": 9.81, "l": 0.7}
)
KEPLER = mechanics.System(lambda t, q, v: (v[0] ** 2 + q[0] ** 2 * v[1] ** 2) / 2 + 1 / q[0], ("r", "phi"))


def test_momenta_energy_and_accelerations():
    assert PENDULUM.momenta(0, [0.3], [2.0]) == pytest.approx([0.49 * 2])
    assert PENDULUM.energy(0, [0.3], [2.0]) == pytest.approx(0.49 * 2 - 9.81 * 0.7 * math.cos(0.3))
    assert PENDULUM.accelerations(0, [0.3], [2.0]) == pytest.approx([-9.81 / 0.7 * math.sin(0.3)])
    # r'' = r phi'^2 - 1/r^2 and phi'' = -2 r' phi'/r
    assert KEPLER.accelerations(0, [0.8, 1], [0.3, 1.1]) == pytest.approx([0.8 * 1.21 - 1 / 0.64, -2 * 0.3 * 1.1 / 0.8])


def test_hamiltonian_and_its_equations():
    h = KEPLER.hamiltonian()
    q, p = [0.8, 1.0], [0.3, 0.9]
    assert h(0, q, p) == pytest.approx(0.045 + 0.81 / (2 * 0.64) - 1 / 0.8, rel=1e-15)
    velocity, force = h.equations(0, q, p)
    assert velocity == pytest.approx([0.3, 0.9 / 0.64])
    assert force == pytest.approx([0.81 / 0.8**3 - 1 / 0.64, 0.0])


def test_momenta_that_are_not_linear_in_velocities():
    # L = -sqrt(1 - v²): H = sqrt(1 + p²) and v = p/H
    particle = mechanics.System(lambda t, q, v: -ca.sqrt(1 - v[0] ** 2), ("x",))
    h = particle.hamiltonian()
    for p in (0.0, 0.4, -3.0, 50.0):
        assert h(0, [0.0], [p]) == pytest.approx(math.hypot(1, p), rel=1e-12)
        assert h.velocity(0, [0.0], [p]) == pytest.approx([p / math.hypot(1, p)], rel=1e-12)


@pytest.mark.parametrize(
    ("lagrangian", "direction"),
    [
        (lambda t, q, v: v[0] * q[1] - q[0] ** 2, "(0, 1)"),
        (lambda t, q, v: (v[0] + v[1]) ** 2 / 2 - q[0] ** 2, "(-0.707107, 0.707107)"),
        (lambda t, q, v: ca.sqrt(v[0] ** 2 + v[1] ** 2), "along"),
    ],
)
def test_a_singular_lagrangian_is_refused_with_its_null_direction(lagrangian, direction):
    system = mechanics.System(lagrangian, ("x", "y"))
    for act in (system.hamiltonian, lambda: system.motion([0.1, 0.2], [1, 1], (0, 1))):
        with pytest.raises(ValueError, match="L is singular") as refused:
            act()
        assert direction.strip("(-")[:4] in str(refused.value) or direction == "along"


def test_ignorable_coordinates_are_found():
    assert KEPLER.ignorable == ("phi",)
    assert PENDULUM.ignorable == ()
    dragged = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y"), forces=lambda t, q, v: [-v[0], 0])
    assert dragged.ignorable == ("y",)


def test_noether_invariants_and_what_is_no_symmetry():
    free = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y", "z"))
    turn = mechanics.Symmetry(lambda t, q: [-q[1], q[0], 0], name="turn about z")
    boost = mechanics.Symmetry(lambda t, q: [t, 0, 0], gauge=lambda t, q: q[0], name="boost")
    time = mechanics.Symmetry(tau=lambda t, q: 1, name="shift of time")
    q, v = [0.3, -0.2, 0.9], [1.0, 0.5, -2.0]
    assert free.invariant(turn)(0.4, q, v) == pytest.approx(0.3 * 0.5 + 0.2 * 1.0)
    assert free.invariant(boost)(0.4, q, v) == pytest.approx(0.4 * 1.0 - 0.3)  # p t - m x
    assert free.invariant(time)(0.4, q, v) == pytest.approx(-(1 + 0.25 + 4) / 2)
    with pytest.raises(ValueError, match="boost is no symmetry"):
        free.invariant(mechanics.Symmetry(lambda t, q: [t, 0, 0], name="boost"))
    watched = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y", "z"), symmetries=[turn, boost])
    drift = watched.motion(q, v, (0, 30)).drift
    assert set(drift) == {"energy", "p_x", "p_y", "p_z", "turn about z", "boost"}
    assert max(drift.values()) < 1e-12


def test_poisson_brackets_obey_jacobi():
    f = lambda q, p: q[0] ** 2 * p[1] + ca.sin(q[1])  # noqa: E731
    g = lambda q, p: p[0] * p[1] * q[1]  # noqa: E731
    h = lambda q, p: ca.exp(q[0]) * p[0] + q[1] ** 3  # noqa: E731
    bracket = mechanics.poisson
    q, p = ca.DM([0.3, -0.7]), ca.DM([1.1, 0.4])
    terms = [float(bracket(a, bracket(b, c))(q, p)) for a, b, c in ((f, g, h), (g, h, f), (h, f, g))]
    assert abs(sum(terms)) <= 1e-14 * max(map(abs, terms))


def test_routhian_reduces_keplers_problem_to_its_effective_potential():
    momentum = 0.8
    reduced = KEPLER.routhian({"phi": momentum})
    assert reduced.coordinates == ("r",)
    # r'' = l²/r³ - 1/r²
    assert reduced.accelerations(0, [0.6], [0.1]) == pytest.approx([momentum**2 / 0.6**3 - 1 / 0.36])
    with pytest.raises(ValueError, match="ignorable"):
        KEPLER.routhian({"r": 1.0})


def test_a_gauge_changes_no_motion():
    other = PENDULUM.gauged(lambda t, q, p: ca.sin(3 * q[0]) * t + p.g * t**2)
    first, second = (system.motion([0.4], [1.0], (0, 5)) for system in (PENDULUM, other))
    np.testing.assert_allclose(first.q(np.linspace(0, 5, 50)), second.q(np.linspace(0, 5, 50)), rtol=0, atol=1e-13)


def test_magnetic_field_from_any_gauge_of_its_potential():
    ways = [lambda t, q: [-2 * q[1], 0], lambda t, q: [0, 2 * q[0]], lambda t, q: [-q[1], q[0]]]
    ends = [
        mechanics.System(mechanics.charged(1.0, 1.0, a), ("x", "y")).motion([0, 0], [1, 0], (0, 7)).q(7.0) for a in ways
    ]
    exact = [math.sin(14) / 2, -(1 - math.cos(14)) / 2]
    for end in ends:
        assert end == pytest.approx(exact, abs=1e-13)


def test_action_between_two_points_is_a_problem():
    # over less than half a period the motion makes the action least; the oscillator's action is known
    oscillator = mechanics.System(lambda t, q, v: (v[0] ** 2 - q[0] ** 2) / 2, ("x",))
    problem = oscillator.between([0.2], [0.7], 1.3)
    solution = vc.solve(problem)
    action = ((0.2**2 + 0.7**2) * math.cos(1.3) - 2 * 0.2 * 0.7) / (2 * math.sin(1.3))
    assert abs(solution.value - action) <= max(solution.error.value, 1e-15) <= 1e-10
    assert oscillator.periodic(2.0).start.periodic
    assert oscillator.periodic(2.0, symmetry=None).start.periodic
    with pytest.raises(ValueError, match="have no action"):
        mechanics.System(lambda t, q, v: v[0] ** 2, ("x",), forces=lambda t, q, v: [-v[0]]).between([0], [1], 1)


def test_normal_modes_of_a_chain_of_springs():
    n = 5
    chain = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 - (q[0] ** 2 + q[n - 1] ** 2 + ca.sumsqr(q[1:] - q[:-1])) / 2,
        [f"x{k}" for k in range(n)],
    )
    modes = chain.normal_modes([0.0] * n)
    exact = 2 * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1)))
    np.testing.assert_allclose(modes.frequencies, exact, rtol=1e-13)
    assert modes.stable
    upright = PENDULUM.normal_modes([math.pi])
    assert not upright.stable
    assert upright.rates[0] == pytest.approx(math.sqrt(9.81 / 0.7))
    with pytest.raises(ValueError, match="no equilibrium"):
        PENDULUM.normal_modes([0.5])


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: mechanics.System(lambda t, q, v: v[0] ** 2, ("x", "x")), "coordinates"),
        (lambda: mechanics.System(lambda t, q: q[0], ("x",)), "lagrangian must accept 3 arguments"),
        (lambda: mechanics.System(lambda t, q, v: v[1] ** 2, ("x",)), "component"),
        (lambda: mechanics.System(lambda t, q, v, p: p.k * v[0] ** 2, ("x",), parameters={"m": 1}), "p.k is used"),
        (lambda: mechanics.System(lambda t, q, v: v[0] ** 2, ("x",), parameters={"m": math.nan}), "parameters"),
        (lambda: mechanics.System(lambda t, q, v: v[0] ** 2, ("x",), forces=lambda t, q, v: [0, 0]), "forces"),
        (lambda: PENDULUM.motion([0.1, 0.2], [0], (0, 1)), "q0 must be 1 finite"),
        (lambda: PENDULUM.motion([0.1], [math.inf], (0, 1)), "v0 must be 1 finite"),
        (lambda: PENDULUM.motion([0.1], [0], (1, 0)), "span"),
        (lambda: PENDULUM.motion([0.1], [0], (0, 1)).q(2.0), "t must lie between"),
        (lambda: PENDULUM.ensemble([[0.1]], [[0.0]], [0.0]), "times"),
    ],
)
def test_errors_name_the_argument(build, said):
    with pytest.raises((TypeError, ValueError), match=said):
        build()


def test_all_equilibria_of_a_bead_on_a_hoop_on_either_side_of_the_critical_turn():
    def bead(turn):
        return mechanics.System(
            lambda t, q, v: (v[0] ** 2 + (turn * ca.sin(q[0])) ** 2) / 2 + 9.81 * ca.cos(q[0]), ("theta",)
        )

    slow, fast = (bead(turn).equilibria([-1.0], [4.0]) for turn in (3.0, 5.0))
    assert slow.unresolved == fast.unresolved == 0
    assert slow.places[:, 0] == pytest.approx([0, math.pi], abs=1e-12)
    assert fast.places[:, 0] == pytest.approx([0, math.acos(9.81 / 25), math.pi], abs=1e-12)


def test_equilibria_of_two_coordinates_are_saddles_and_bottoms():
    # V = (x² - 1)²/4 + y²/2 + x y/4: x³ - x + y/4 = 0 and y = -x/4
    system = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2 - (q[0] ** 2 - 1) ** 2 / 4 - q[1] ** 2 / 2 - q[0] * q[1] / 4, ("x", "y")
    )
    found = system.equilibria([-2, -2], [2, 2.1])
    x = math.sqrt(1 + 1 / 16)
    np.testing.assert_allclose(found.places, [[-x, x / 4], [0, 0], [x, -x / 4]], rtol=0, atol=1e-12)
    assert found.unresolved == 0
    assert [system.normal_modes(place).stable for place in found.places] == [True, False, True]


def test_other_parameters_make_another_system_that_shares_what_is_compiled():
    one = mechanics.System(lambda t, q, v, p: v[0] ** 2 / 2 + p.k * ca.cos(q[0]), ("theta",), parameters={"k": 1.0})
    first = one.motion([1.0], [0.0], (0, 2))
    other = one.with_parameters({"k": 4.0})
    assert (one.parameters, other.parameters) == ({"k": 1.0}, {"k": 4.0})
    # twice as fast
    np.testing.assert_allclose(other.motion([1.0], [0.0], (0, 1)).q(1.0), first.q(2.0), rtol=1e-13)
    assert one.motion([1.0], [0.0], (0, 2)).q(2.0) == first.q(2.0)
    assert other.normal_modes([0.0]).frequencies == pytest.approx([2.0])
    assert other.between([0.0], [0.1], 1.0).parameters == {"k": 4.0}
    with pytest.raises(ValueError, match="finite"):
        one.with_parameters({"k": math.inf})


def test_energy_of_what_switches_with_the_rates():
    """L_vv is 1 on both sides, and yet L is of no degree: v L_v - L is v²/2 + 1 beyond v = 1, not v²/2."""
    hurried = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.fmax(v[0] - 1, 0), ("x",))
    assert hurried.energy(0.0, [0.0], [2.0]) == 3.0
    assert hurried.energy(0.0, [0.0], [0.5]) == 0.125
