"""The middle axis of a free top: rotation about it is unstable, and is left along the separatrix.

L² = 2 E I2: ω2 = Ω tanh(n t), ω1 and ω3 go by 1/cosh(n t), n² = Ω² (I3 - I2)(I2 - I1)/(I1 I3). Small departures from
the rotation grow with the same n; about the other two axes they swing.

Source: A. J. Brizard, "An Introduction to Lagrangian Mechanics" (2nd ed., 2015), sect. 7.2.3 and problem 2.
"""

import numpy as np

from varcalc import mechanics

A, B, C = MOMENTS = np.array([1.0, 2.0, 3.0])
OMEGA = 1.7
N = OMEGA * np.sqrt((C - B) * (B - A) / (A * C))
START = OMEGA * np.sqrt([B * (C - B) / (A * (C - A)), 0.0, B * (B - A) / (C * (C - A))])
body = mechanics.RigidBody(MOMENTS)


def separatrix():
    """ω from half-way between the ends of the middle axis, while round-off has not grown by more than e⁵."""
    times = np.linspace(0, 5 / N, 201)
    known = np.outer(START, 1 / np.cosh(N * times)) + np.outer([0, OMEGA, 0], np.tanh(N * times))
    return np.abs(body.motion((1, 0, 0, 0), START, (0.0, times[-1])).angular_velocity(times) - known).max()


def told():
    """One off for each thing that is not told of it."""
    found, steady = body.polhode(START), [one.stable for one in body.steady_rotations]
    return (found.kind.name != "SEPARATRIX") + (found.period != np.inf) + (steady != [True, False, True])


def rates():
    """Growth about the middle axis, and the frequencies about the others: Ω² (I_k - I_i)(I_k - I_j)/(I_i I_j)."""
    squared = np.array([(A - B) * (A - C) / (B * C), (B - A) * (C - B) / (A * C), (C - A) * (C - B) / (A * B)])
    return np.abs([one.rate for one in body.steady_rotations] - np.sqrt(squared)).max()


experiment = mechanics.Examination("The middle axis", {"separatrix": separatrix, "told": told, "rates": rates})
