"""The oscillator between two times: its action, which past half a period is not the least, and Feynman's kernel.

L = (v² - x²)/2. From a to b in the time T the action is S = ((a² + b²) cos T - 2 a b)/(2 sin T); conjugate times are
multiples of π, and the index counts those before T. The kernel exp(i S) makes a packet of the width s as wide as
√(s² cos²T + sin²T/(4 s²)), with the mass, the frequency and ħ as units.

Source: R. P. Feynman, A. R. Hibbs, "Quantum Mechanics and Path Integrals" (1965), sect. 2.2, 3.1, 8.1; L. S. Schulman,
"Techniques and Applications of Path Integration" (1981), ch. 6, 17.
"""

import numpy as np

import varcalc as vc
from varcalc import mechanics

START, END, SHORT, LONG, WIDTH = 0.3, 0.8, 1.2, 4.0, 0.4
system = mechanics.System(lambda t, q, v: (v[0] ** 2 - q[0] ** 2) / 2, ("x",), name="oscillator between two times")


def exact(t):
    """x, from START at the time 0 to END at the time LONG."""
    return ((START * np.sin(LONG - t) + END * np.sin(t)) / np.sin(LONG))[None]


def extremal(a, b, time):
    return vc.solve(system.between([a], [b], time), vc.Collocation())


def saddle(_):
    """How far the action and its conjugate time are off past half a period; what is not told a saddle is off by one."""
    found = extremal(START, END, LONG)
    told = vc.verify(found)
    action = ((START**2 + END**2) * np.cos(LONG) - 2 * START * END) / (2 * np.sin(LONG))
    wrong = float(told.verdict is not vc.Verdict.SADDLE or told.index != 1)
    return max(abs(found.value - action), abs(told.conjugate_points[0] - np.pi), wrong)


def spreading(_):
    """How far the width is off to which the kernel spreads a packet: its exponent is quadratic in both ends."""
    first, last, both = (extremal(a, b, SHORT).value for a, b in ((1, 0), (0, 1), (1, 1)))
    own, mixed = 2 * first, first + last - both
    width = np.sqrt((1 / (4 * WIDTH**2) + (own * WIDTH) ** 2) / mixed**2)
    return abs(width / np.hypot(WIDTH * np.cos(SHORT), np.sin(SHORT) / (2 * WIDTH)) - 1)


experiment = mechanics.Experiment(
    system, [START], [(END - START * np.cos(LONG)) / np.sin(LONG)], (0.0, LONG), exact,
    {"saddle": saddle, "spreading": spreading}, title="An oscillator between two times",
)  # fmt: skip
