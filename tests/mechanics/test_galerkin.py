"""The variational integrator: its order, what it keeps to round-off, constraints at its points, forces."""

import casadi as ca
import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from varcalc import mechanics

kepler = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 + 1 / ca.norm_2(q), ("x", "y"))
rod = mechanics.System(
    lambda t, q, v: ca.sumsqr(v) / 2 - q[1],
    ("x", "y"),
    constraints=[mechanics.Holonomic(lambda t, q: (ca.sumsqr(q) - 1) / 2)],
)


@pytest.mark.parametrize(("degree", "steps"), [(1, 400), (2, 200), (3, 100), (4, 40)])
def test_order_and_angular_momentum(degree, steps):
    start, speed = 0.6, np.sqrt(1.4 / 0.6)
    errors = []
    for count in (steps, 2 * steps):
        found = kepler.galerkin([start, 0.0], [0.0, speed], (0.0, 2 * np.pi), steps=count, degree=degree)
        errors.append(np.abs(found.q[:, -1] - [start, 0.0]).max())
        momentum = found.q[0] * found.p[1] - found.q[1] * found.p[0]
        np.testing.assert_allclose(momentum, start * speed, rtol=1e-13)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * degree, abs=0.4)


def test_energy_does_not_drift_over_a_thousand_periods():
    found = kepler.galerkin([0.7, 0.0], [0.0, np.sqrt(1.3 / 0.7)], (0.0, 2000 * np.pi), steps=40_000, degree=2)
    error = np.abs(found.energy - found.energy[0])
    assert error[-4000:].max() < 1.05 * error[:4000].max()


@pytest.mark.parametrize(("degree", "steps"), [(1, 160), (2, 40), (3, 20)])
def test_constraints_at_its_points_and_the_order_with_them(degree, steps):
    k = np.sin(0.5)
    period = 4 * ellipk(k**2)
    angle = 2 * np.arcsin(k * ellipj(0.3 * period + ellipk(k**2), k**2)[0])
    errors = []
    for count in (steps, 2 * steps):
        found = rod.galerkin([np.sin(1.0), -np.cos(1.0)], [0.0, 0.0], (0, 0.3 * period), steps=count, degree=degree)
        errors.append(np.abs(found.q[:, -1] - [np.sin(angle), -np.cos(angle)]).max())
        assert np.abs((found.q**2).sum(0) - 1).max() < 1e-14
        assert np.abs((found.q * found.v).sum(0)).max() < 1e-14
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * degree, abs=0.3)


def test_forces_and_parameters():
    damped = mechanics.System(
        lambda t, q, v, p: (v[0] ** 2 - p.k * q[0] ** 2) / 2, ("x",), parameters={"k": 4.0},
        forces=lambda t, q, v, p: [-0.3 * v[0]],
    )  # fmt: skip
    found = damped.galerkin([1.0], [0.0], (0.0, 10.0), steps=200, degree=4)
    rate = np.sqrt(4 - 0.15**2)
    t = found.times
    exact = np.exp(-0.15 * t) * (np.cos(rate * t) + 0.15 / rate * np.sin(rate * t))
    np.testing.assert_allclose(found.q[0], exact, atol=1e-11)


def test_refusals():
    with pytest.raises(ValueError, match="steps must be"):
        kepler.galerkin([1, 0], [0, 1], (0, 1), steps=0)
    with pytest.raises(ValueError, match="degree must be"):
        kepler.galerkin([1, 0], [0, 1], (0, 1), steps=3, degree=0)
    with pytest.raises(ValueError, match="span must be"):
        kepler.galerkin([1, 0], [0, 1], (1, 0), steps=3)
    with pytest.raises(ValueError, match="take more steps"):
        rod.galerkin([np.sin(1.0), -np.cos(1.0)], [0.0, 0.0], (0, 60.0), steps=2)
    rolling = mechanics.System(
        lambda t, q, v: ca.sumsqr(v) / 2, ("x", "y"), constraints=[mechanics.Pfaffian(lambda t, q: [1, -1])]
    )
    with pytest.raises(ValueError, match="Pfaffian"):
        rolling.galerkin([0, 0], [1, 1], (0, 1), steps=3)
