"""Kepler's orbit for a long time: error and work of the variational integrator beside the Taylor engine.

    python benchmarks/long_motions.py [--orbits N] [-o picture.png]

Processor time, and after N orbits of eccentricity 0.3 the largest error of the energy on the last orbit and the
distance from the perihelion, where the orbit began.
"""

from __future__ import annotations

import argparse
import time

import casadi as ca
import numpy as np
from matplotlib.figure import Figure

from varcalc import mechanics

ECCENTRICITY = 0.3
STEPS = {1: (200, 800), 2: (40, 80, 160), 3: (20, 40, 80), 5: (12, 24)}
"""A turn, by the degree of the polynomials."""
system = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 + 1 / ca.norm_2(q), ("x", "y"))
START = [1 - ECCENTRICITY, 0.0], [0.0, np.sqrt((1 + ECCENTRICITY) / (1 - ECCENTRICITY))]


def measured(orbits: int) -> list[tuple[str, float, float, float]]:
    """Name, seconds, error of the energy and distance from the start, for every integrator."""
    rows = []
    span = (0.0, 2 * np.pi * orbits)
    for degree, counts in STEPS.items():
        for count in counts:
            began = time.process_time()
            found = system.galerkin(*START, span, steps=count * orbits, degree=degree)
            spent = time.process_time() - began
            energy = float(np.abs(found.energy[-count:] - found.energy[0]).max())
            rows.append(
                (f"degree {degree}, {count} steps", spent, energy, float(np.linalg.norm(found.q[:, -1] - START[0])))
            )
    system.motion(*START, (0.0, 1.0))  # compiled once, as the steps above are
    began = time.process_time()
    motion = system.motion(*START, span)
    spent = time.process_time() - began
    away = float(np.linalg.norm(motion.q(span[1]) - START[0]))
    return [*rows, ("Taylor, dense, with its claim", spent, motion.drift["energy"], away)]


def picture(rows: list[tuple[str, float, float, float]], orbits: int) -> Figure:
    """Error against work, for the energy and for the place."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    for place, (column, label) in enumerate(((2, "error of the energy"), (3, "distance from the start")), start=1):
        axes = figure.add_subplot(1, 2, place)
        for kind in dict.fromkeys(row[0].split(",")[0] for row in rows):
            own = [row for row in rows if row[0].split(",")[0] == kind]
            axes.loglog([row[1] for row in own], [row[column] for row in own], "o-", label=kind)
        axes.set_xlabel("processor time in seconds")
        axes.set_ylabel(f"{label} after {orbits} orbits")
        axes.legend(frameon=False)
    return figure


def main() -> None:
    """Print the table, and draw it where a picture is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--orbits", type=int, default=1000)
    parser.add_argument("-o", "--output")
    options = parser.parse_args()
    rows = measured(options.orbits)
    print(f"{'':30} {'seconds':>9} {'energy':>9} {'place':>9}")
    for name, spent, energy, away in rows:
        print(f"{name:30} {spent:9.3f} {energy:9.1e} {away:9.1e}")
    if options.output:
        picture(rows, options.orbits).savefig(options.output, dpi=150)


if __name__ == "__main__":
    main()
