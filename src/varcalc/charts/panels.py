"""What all panels share: no frame, a light grid, ink that is not black."""

from __future__ import annotations

from matplotlib.axes import Axes

from varcalc.charts.colours import GRID, INK


def plain(panel: Axes) -> None:
    """Take frame and ticks away and lay a light grid beneath."""
    panel.grid(visible=True, color=GRID, linewidth=0.8)
    panel.set_axisbelow(True)
    panel.tick_params(which="both", colors=INK, length=0)
    for side in panel.spines.values():
        side.set_visible(False)
