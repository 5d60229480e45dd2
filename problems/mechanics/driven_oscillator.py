"""A damped oscillator that is driven: how it comes to its steady swing, its resonance, and what causality says of it.

x'' + 2 d x' + w0² x = f sin(wt) from rest. The steady swing is f |χ(w)| sin(wt - arg χ) with
χ(w) = 1/(w0² - w² - 2 i d w): it is greatest at w² = w0² - 2 d², and the poles of χ, -i d ± √(w0² - d²), lie below
the real axis.

Source: L. D. Landau, E. M. Lifshitz, "Mechanics" (3rd ed., 1976), sect. 22, 26; "Statistical Physics, Part 1",
sect. 123.
"""

import numpy as np

from varcalc import mechanics

OWN, DAMPING, DRIVE, FORCE = 1.3, 0.15, 0.9, 0.7
system = mechanics.System(
    lambda t, q, v: (v[0] ** 2 - OWN**2 * q[0] ** 2) / 2 + FORCE * np.sin(DRIVE * t) * q[0], ("x",),
    forces=lambda t, q, v: [-2 * DAMPING * v[0]], name="driven oscillator",
)  # fmt: skip
alone = mechanics.System(
    lambda t, q, v: (v[0] ** 2 - OWN**2 * q[0] ** 2) / 2, ("x",), forces=lambda t, q, v: [-2 * DAMPING * v[0]]
)
response = mechanics.Response(alone.linearised([0.0]))
SLOWER = np.sqrt(OWN**2 - DAMPING**2)


def known(w):
    """The response function."""
    return 1 / (OWN**2 - w**2 - 2j * DAMPING * w)


def exact(t):
    """x from rest: the steady swing, and what dies away."""
    steady = FORCE * np.conj(known(DRIVE))  # times e^(iwt), of which the imaginary part
    x0, v0 = -np.imag(steady), -DRIVE * np.real(steady)
    dying = np.exp(-DAMPING * t) * (x0 * np.cos(SLOWER * t) + (v0 + DAMPING * x0) / SLOWER * np.sin(SLOWER * t))
    return (np.imag(steady * np.exp(1j * DRIVE * t)) + dying)[None]


def function(_):
    """How far the response function is off, in size and phase."""
    w = np.linspace(-3, 3, 25)
    return np.abs(response(w)[:, 0, 0] / known(w) - 1).max()


def resonance(_):
    """How far the amplitude at resonance is off, and whether it is greater beside it."""
    top, step = np.sqrt(OWN**2 - 2 * DAMPING**2), 1e-6
    before, at, after = response.amplitude(top + step * np.array([-1.0, 0.0, 1.0]))[:, 0, 0]
    return abs(at * 2 * DAMPING * SLOWER - 1) + max(0.0, before - at, after - at)


def causality(_):
    """How far the real part is from what the imaginary part demands, and the blow's echo from the known one."""
    kramers_kronig = max(abs(response.from_absorption(w)[0, 0] - known(w).real) for w in (0.0, 0.8, 2.0))
    t = np.array([-1.0, 0.5, 4.0])
    echo = np.where(t > 0, np.exp(-DAMPING * t) * np.sin(SLOWER * t) / SLOWER, 0.0)
    below = np.abs(np.imag(response.poles) + DAMPING).max()
    return max(kramers_kronig, np.abs(response.impulse(t)[:, 0, 0] - echo).max(), below)


experiment = mechanics.Experiment(
    system, [0.0], [0.0], (0.0, 40.0), exact,
    {"response function": function, "resonance": resonance, "causality": causality}, title="A driven oscillator",
)  # fmt: skip
