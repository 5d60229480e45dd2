"""A stability chart: where small motions grow, how fast, and the boundaries between."""

from __future__ import annotations

import numpy as np

from varcalc.axes import Axis
from varcalc.mechanics import StabilityChart
from varcalc.study.drawing import Drawing, Line, Panel, Points, Shades

MULTIPLIERS = {"multiplier 1": 1.0, "multiplier -1": -1.0}
REAL = 1e-6
"""Of the unit circle: a multiplier so near to 1 or -1 is that."""


def stability_drawing(chart: StabilityChart) -> Drawing:
    """Growth over one parameter, or over two, and where multipliers pass 1, -1 and the rest of the unit circle."""
    places, multipliers = chart.boundaries.places, chart.boundaries.multipliers
    met = {label: np.abs(multipliers - value) < REAL for label, value in MULTIPLIERS.items()}
    met["others on the unit circle"] = ~np.any(list(met.values()), axis=0)
    across = Axis(chart.names[0]).label
    growth = np.where(chart.stable, 0.0, chart.growth)
    boundaries = [
        Points(*places[rows].T, label=label, colour=number)
        for number, (label, rows) in enumerate(met.items(), start=1)
        if np.any(rows)
    ]
    if len(chart.names) == 1:  # where the second of the places are zeros, as the growth is there
        panel = Panel([Line(chart.first, growth[:, 0], label="growth"), *boundaries], across, "growth rate")
    else:
        shades = Shades(chart.first, chart.second, growth.T, "growth rate")
        panel = Panel([shades, *boundaries], across, Axis(chart.names[1]).label)
    return Drawing("Growth of small motions", lambda: [[panel]])
