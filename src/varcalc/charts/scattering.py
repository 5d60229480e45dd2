"""Scattering by a central potential: deflection by impact parameter, and the differential cross-section."""

from __future__ import annotations

import numpy as np

from varcalc.mechanics import Scattering
from varcalc.study.drawing import Drawing, Line, Panel, Points

DECADES = 8.0
"""Impact parameters between 10 to minus this and 10 to this are looked at for what is deflected."""
LEAST_DEFLECTION = 0.05
"""Of the largest deflection up to a turn: what is deflected by less is left out."""
IMPACTS_DRAWN, ANGLES = 1201, 181
POLAR_MARGIN = 0.01
"""Of a half turn: as far as this from forwards and backwards the cross-section is drawn."""


def scattering_drawing(scattering: Scattering) -> Drawing:
    """The angle over the impact parameter, with rainbows and glories, and the cross-section over the angle."""
    impact = np.linspace(0.0, _reach(scattering), IMPACTS_DRAWN)
    angle = np.array(scattering.deflection(impact).angle)
    angle[np.abs(angle) > 2 * np.pi] = np.nan  # next to what orbits the angle diverges
    places = {
        label: [(one.impact, one.angle) for one in found if one.impact <= impact[-1] and abs(one.angle) <= 2 * np.pi]
        for label, found in {"rainbows": scattering.rainbows, "glories": scattering.glories}.items()
    }
    marked = [
        Points(*zip(*some, strict=True), label=label, colour=number)
        for number, (label, some) in enumerate(places.items(), start=1)
        if some
    ]
    critical = [
        Line([one.impact] * 2, [-np.pi, np.pi], label="orbiting", dashed=True, colour=3) for one in scattering.orbiting
    ]
    angles = np.pi * np.linspace(POLAR_MARGIN, 1 - POLAR_MARGIN, ANGLES)
    section = np.array(scattering.cross_section(angles))
    section[~(section > 0) | ~np.isfinite(section)] = np.nan
    by_impact = Panel([Line(impact, angle, colour=0), *critical, *marked], "impact parameter", "deflection (rad)")
    least, most = np.nanmin(section, initial=np.inf), np.nanmax(section, initial=0.0)
    limits = (0.0, np.pi, least / 2, 2 * most) if 0 < least < np.inf else None
    by_angle = Panel(
        [Line(angles, section)], "scattering angle (rad)", r"$d\sigma/d\Omega$", logarithmic=True, within=limits
    )
    return Drawing(f"Scattering at the energy {scattering.energy:.6g}", lambda: [[by_impact, by_angle]])


def _reach(scattering: Scattering) -> float:
    """The largest impact parameter that deflects to speak of."""
    impact = np.logspace(-DECADES, DECADES, IMPACTS_DRAWN)
    size = np.minimum(np.abs(np.array(scattering.deflection(impact).angle)), np.pi)
    some = np.flatnonzero(size > LEAST_DEFLECTION * np.nanmax(size))
    critical = [one.impact for one in scattering.orbiting]
    return float(max([impact[min(some[-1] + 1, IMPACTS_DRAWN - 1)] if len(some) else 1.0, *critical]))
