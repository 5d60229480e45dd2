"""Rays as geodesics: a refractive index in a space with a metric of its own.

Two equations say the same. In the metric g of the space without a medium rays
bend by the gradient of the index,

    d²q^i/ds² + Γ^i_jk q'^j q'^k = (g^ij - q'^i q'^j) ∂_j ln n,

and in the conformal metric n² g, whose length is the optical path, they are
geodesics (Brizard, "An Introduction to Lagrangian Mechanics", eq. 1.47 and
1.49). Fermat's principle for the same rays is the functional
:meth:`CurvedMedium.optical_length`, for :class:`varcalc.Curve`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from varcalc.optics.models.hamilton import flown
from varcalc.optics.propagation.bundle import Bundle
from varcalc.optics.rays.beam import RayStatus
from varcalc.optics.validation import how_far, matched, rows
from varcalc.problem.conditions import function, sequence
from varcalc.showing import Brief
from varcalc.spelling import spelled
from varcalc.symbolic import tracing
from varcalc.symbolic.evaluation import PointEvaluator

Expression = Any
"""A CasADi SX expression."""


@spelled
@dataclass(frozen=True, repr=False)
class CurvedMedium(Brief):
    """A refractive index in a space of 2 or 3 coordinates q with the metric ds² = Σ g_ij dq^i dq^j.

    Parameters
    ----------
    metric : callable
        ``metric(q)``: the matrix g, as nested sequences or a CasADi matrix, at a column of coordinates.
    n : callable
        ``n(q)``: the refractive index there.

    Examples
    --------
    On a sphere of uniform index rays are great circles; a quarter of one leads from the equator to the pole.

    >>> import casadi as ca
    >>> import numpy as np
    >>> from varcalc import optics
    >>> sphere = optics.CurvedMedium(lambda q: [[1, 0], [0, ca.cos(q[0]) ** 2]], lambda q: 1.5)
    >>> bundle = sphere.by_conformal_metric((0.0, 0.3), (1.0, 0.0), 1.5 * np.pi / 2)
    >>> (bundle.points - (np.pi / 2, 0.3)).round(12) + 0.0
    array([[0., 0.]])
    """

    metric: Callable[[Expression], Any]
    n: Callable[[Expression], Any]

    def __post_init__(self) -> None:
        function("metric", self.metric)
        function("n", self.n)

    def optical_length(self, q: Expression, dq: Expression) -> Expression:
        """Fermat's functional n(q) sqrt(g(dq, dq)), homogeneous of degree one in ``dq`` as a Curve's must be."""
        return self._index(q) * ca.sqrt(ca.dot(dq, self._metric(q) @ dq))

    def by_index_gradient(self, points: Any, directions: Any, optical_path: float | np.ndarray) -> Bundle:
        """Carry rays by the ray equation in the metric of the space (Brizard, eq. 1.47).

        Raises ValueError where the index, or the squared length of a direction in the metric, is not positive at the
        start.

        Parameters
        ----------
        points, directions : array_like, shape (m, d) or (d,)
            Coordinates, and components dq of any length; one serves for all of the other.
        optical_path : float or array_like, shape (m,)
            Where to stop, in units of length of the metric.

        Returns
        -------
        Bundle
            Its directions are unit vectors of the metric g.
        """
        start, ahead, _, until = self._launched(points, directions, optical_path)
        d = start.shape[1]
        state = ca.SX.sym("Y", 2 * d)
        q, k = state[:d], state[d:]
        metric, index = self._metric(q), self._index(q)
        pull = ca.gradient(index, q) / index
        bend = geodesic_acceleration(metric, q, k) + ca.inv_minor(metric) @ pull - ca.dot(k, pull) * k
        # with the optical path for parameter, dS = n ds
        ends, status = flown(ca.vertcat(k, bend) / index, state, np.hstack([start, ahead]), until)
        return self._landed(ends, until, status, "geodesics with an index gradient")

    def by_conformal_metric(self, points: Any, directions: Any, optical_path: float | np.ndarray) -> Bundle:
        """Carry rays as geodesics of n² g (Brizard, eq. 1.49); arguments and results as above."""
        start, ahead, index, until = self._launched(points, directions, optical_path)
        d = start.shape[1]
        state = ca.SX.sym("Y", 2 * d)
        q, velocity = state[:d], state[d:]
        conformal = self._index(q) ** 2 * self._metric(q)
        rates = ca.vertcat(velocity, geodesic_acceleration(conformal, q, velocity))
        ends, status = flown(rates, state, np.hstack([start, ahead / index[:, None]]), until)
        return self._landed(ends, until, status, "geodesics of the conformal metric")

    def _launched(
        self, points: Any, directions: Any, optical_path: float | np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Starts (m, d), directions (m, d) of unit length in g, the index (m,) and the optical paths (m,), checked."""
        start = rows("points", points)
        heading = rows("directions", directions, start.shape[1])
        start, heading = matched("points", start, "directions", heading)
        index, squared = self._measured(start, heading)
        for name, values in (("index", index), ("squared length of the direction in the metric", squared)):
            bad = ~((values > 0) & np.isfinite(values))
            if np.any(bad):
                row = int(np.argmax(bad))
                raise ValueError(f"the {name} is {values[row]:g} at the source {tuple(start[row].tolist())}")
        return start, heading / np.sqrt(squared)[:, None], index, how_far("optical_path", optical_path, len(start))

    def _landed(self, ends: np.ndarray, until: np.ndarray, status: np.ndarray, model: str) -> Bundle:
        """The bundle of ``ends`` (m, 2 d), coordinates and tangents of any length."""
        d = ends.shape[1] // 2
        _, squared = self._measured(ends[:, :d], ends[:, d:])
        paths = np.where(status == RayStatus.ARRIVED, until, 0.0)
        with np.errstate(all="ignore"):
            ahead = ends[:, d:] / np.sqrt(squared)[:, None]
        return Bundle(ends[:, :d], ahead, paths, status, None, model)

    def _measured(self, points: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """n and g(v, v), (m,) each, of ``vectors`` (m, d) at ``points`` (m, d)."""
        d = points.shape[1]
        q, v = ca.SX.sym("q", d), ca.SX.sym("v", d)
        results = [ca.SX(self._index(q)), ca.SX(ca.dot(v, self._metric(q) @ v))]
        function = PointEvaluator(ca.Function("measured", [q, v], [ca.densify(result) for result in results]))
        index, squared = function(len(points), points, vectors).T
        return index, squared

    def _index(self, q: Expression) -> Expression:
        return tracing.trace("n", self.n, [q], type(q), "it is called with a column of coordinates")

    def _metric(self, q: Expression) -> Expression:
        d = q.numel()
        tracing.check_arity("metric", self.metric, 1, "it is called with a column of coordinates")
        given = tracing.called("metric", self.metric, [q], type(q))
        if not isinstance(given, ca.SX | ca.MX | ca.DM):
            given = ca.vertcat(*(ca.horzcat(*row) for row in sequence("what metric returns", given)))
        if given.shape != (d, d):
            raise ValueError(f"metric must return {d} rows of {d} entries, not {given.shape[0]} of {given.shape[1]}")
        return given


def geodesic_acceleration(metric: Expression, q: Expression, velocity: Expression) -> Expression:
    """-Γ^i_jk v^j v^k of a metric (d, d): what makes a free particle go along a geodesic."""
    momentum = metric @ velocity
    turning = ca.jtimes(momentum, q, velocity) - ca.gradient(ca.dot(velocity, momentum), q) / 2
    return -ca.inv_minor(metric) @ turning
