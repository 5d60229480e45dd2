"""geographiclib: series in the third flattening; only geodesics, and those in microseconds."""

from __future__ import annotations

import math
from typing import Any

from peers.adapter import Adapter
from tasks import FLATTENING, Graph, Task


def build(task: Task, setting: None) -> Any:
    """The spheroid and the ends in degrees."""
    from geographiclib.geodesic import Geodesic

    assert isinstance(task, Graph)
    ends = (task.start[1], task.start[0], task.end[1], task.end[0])
    return Geodesic(1.0, FLATTENING), [math.degrees(v) for v in ends]


def solve(built: Any) -> float:
    """The length of the shortest way."""
    spheroid, ends = built
    return float(spheroid.Inverse(*ends, outmask=spheroid.DISTANCE)["s12"])


ADAPTER = Adapter("geographiclib", "geographiclib", (None,), build, solve, tasks=("spheroid geodesic",))
