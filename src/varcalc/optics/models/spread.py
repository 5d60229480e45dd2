"""The passages of rays as functions of one unknown, and series that stand for them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from varcalc.numerics.proxies import Proxies, ProxyPanels, proxies, reduced
from varcalc.optics.models.height_pairs import EPSILON, LAYERS
from varcalc.optics.models.passage_tables import TabledPassages
from varcalc.optics.models.passages import RayPassages

NEAREST = 1e-10
"""How close to an angle at which rays come to rest is looked, in units of what is known of it to round-off."""
LEAST_SHARE, MOST_SHARE = 1e-14, 1e-2
"""The same in units of half the way to the next one, at least and at most."""
RATE_STEP = 1e-6
"""Of the unknown, to take derivatives by it."""
BREAK_OFFSET = 1e-9
"""Of the unknown, that much beside a break the passages are those of its side."""
LEVEL_OFFSET = 1e-18
"""The same beside level rays, where they are told better."""
OF_USE = 1e-3
"""How well passages need be known to tell that nobody asks for them."""


@dataclass(frozen=True)
class Spread:
    """The passages as functions of one unknown: of every interval between ``breaks`` two halves, one unit long each.

    At 0, 2, 4, .. are the breaks, at 1, 3, .. the middles between them. The passages are those that may be part of a
    ray of the optical path ``within`` (p,) that comes from ``nearest`` to ``farthest`` (p,), ``distance`` (p,) being
    the size of that. ``plain`` (p,) says where they are smooth in the angle up to upright rays, with series on the two
    ``panels`` before these.
    """

    tabled: TabledPassages
    nearest: np.ndarray
    farthest: np.ndarray
    distance: np.ndarray
    within: np.ndarray
    plain: np.ndarray
    panels: ProxyPanels | None = None

    @classmethod
    def of(
        cls, tabled: TabledPassages, nearest: np.ndarray, farthest: np.ndarray, distance: np.ndarray, within: np.ndarray
    ) -> Spread:
        """Upright rays are one end of the rays of layers, and the middle of those about a smooth centre."""
        pairs, end = np.arange(len(distance)), 2.0 * (tabled.passages.count - 1)
        spread = _TabledSpread(
            replace(tabled, at_once=True), nearest, farthest, distance, within, np.ones(len(pairs), dtype=bool)
        )
        halved = np.flatnonzero(~spread.short)
        family, low = np.append(pairs, halved), np.append(end - 1, end[halved] - 0.5)
        high = np.append(end - 0.5 * ~spread.short, end[halved])
        panels = ProxyPanels.of(spread, family, low, high)
        plain = panels.fine[: len(pairs)]
        plain[halved] &= panels.fine[len(pairs) :]
        return cls(tabled, nearest, farthest, distance, within, plain, panels.take(np.flatnonzero(plain[family])))

    @property
    def passages(self) -> RayPassages:
        """The passages."""
        return self.tabled.passages

    def angles(self, pair: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The angles of pairs (m,) at the unknown (m,), crowded towards breaks but for level and upright rays."""
        breaks, count = self.passages.breaks, self.passages.count[pair]
        interval = np.clip(np.floor(at / 2).astype(int), 0, count - 2)
        low = breaks[pair, interval]
        half = (breaks[pair, interval + 1] - low) / 2
        upper = at > 2 * interval + 1  # of the two breaks the nearer one, and how far from it: 1 in the middle
        number, away = interval + upper, np.where(upper, 2 * (interval + 1) - at, at - 2 * interval)
        # rays through a centre are known, and those beside it in the measure of how far past it they go
        upright = 0.0 if self.passages.profile.about_centre else EPSILON
        known = np.where(number == count - 1, upright, self.passages.rounded[pair, number])
        offset = half * np.where(self.mild(pair, number), 2 * np.sin(np.pi / 4 * away) ** 2, _share(known, half, away))
        first = np.flatnonzero(self.level(pair, number))
        times = np.arcsinh(half[first] / self.passages.level[pair[first]])
        offset[first] = half[first] * np.sinh(times * away[first]) / np.sinh(times)
        return np.where(away >= 1, low + half, np.where(upper, breaks[pair, number] - offset, low + offset))

    def mild(self, pair: np.ndarray, number: np.ndarray) -> np.ndarray:
        """Whether passages of pairs (m,) are smooth in the root of the angle from breaks (m,): none rests."""
        return self.passages.mild[pair, number] | (self.plain[pair] & (number == self.passages.count[pair] - 1))

    def level(self, pair: np.ndarray, number: np.ndarray) -> np.ndarray:
        """Whether breaks (m,) of pairs (m,) are level rays about which passages are smooth."""
        return (number == 0) & (self.passages.level[pair] > 0)

    def angle_rates(self, pair: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The derivatives of the angles by the unknown (m,), about."""
        beside = np.abs(at - np.round(at)) / 2  # the unknown has breaks at whole numbers
        step = np.where(beside > 0, np.minimum(RATE_STEP, beside), RATE_STEP)
        return (self.angles(pair, at + step) - self.angles(pair, at - step)) / (2 * step)

    def noise(self, family: np.ndarray, at: np.ndarray) -> np.ndarray:
        """See :meth:`RayPassages.noise`."""
        return self.passages.noise(family, self.angles(family, at), self.plain[family])

    def __call__(self, family: np.ndarray, at: np.ndarray, enough: float = 0.0) -> np.ndarray:
        """The passages (m, 6), to what is ``enough``; what is not known but longer than is asked for is so at least."""
        angles = self.angles(family, at)
        values, told, _ = self.tabled.tabled(family, angles, self.scale(family), enough)
        self._complete(values, told, family, angles, enough)
        return values

    def sampled(self, family: np.ndarray, at: np.ndarray, enough: float) -> np.ndarray:
        """See :meth:`Functions.sampled`: steep rays turn back where tables have few digits, and few are of any use."""
        rows, shape = np.repeat(family, at.shape[1]), (*at.shape, -1)
        angles = self.angles(rows, at.ravel())
        values, told, off = self.tabled.tabled(rows, angles, self.scale(rows), enough)
        roughly, well = (reduced(np.logical_and, known.reshape(shape), 1) for known in (off <= OF_USE, told))
        idle = self._idle(family, values.reshape(shape), roughly, well)[:, :LAYERS]
        self._complete(values, told | np.repeat(idle, at.shape[1], axis=0), rows, angles, enough)
        return values.reshape(shape)

    def _complete(
        self, values: np.ndarray, told: np.ndarray, family: np.ndarray, angles: np.ndarray, enough: float
    ) -> None:
        """Write down what the tables did not tell."""
        self.tabled.complete(values, told, family, angles, self.scale(family), enough)
        rows = np.flatnonzero(reduced(np.logical_or, np.isneginf(values), 1))
        if len(rows):
            least = self.passages.at_least(family[rows], angles[rows])
            asked = self.scale(family[rows])
            asked[:, [0, LAYERS]] = -np.inf
            values[rows] = np.where(np.isneginf(values[rows]) & (least > asked), least, values[rows])

    def scale(self, family: np.ndarray) -> np.ndarray:
        """The distances and the optical paths that are asked for."""
        return np.repeat(np.stack([self.distance, self.within], axis=1)[family], LAYERS, axis=1)

    def inside(self, at: np.ndarray, way: int) -> np.ndarray:
        """Next to a break, where ``at`` (P,) are breaks."""
        return np.where(at % 2 == 0, at + way * np.where(at == 0, LEVEL_OFFSET, BREAK_OFFSET), at)

    def beyond(self, family: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Which passages (P, 6) are longer than is asked for, in either way, or too short with all others.

        S is part of every ray.
        """
        every = np.ones((len(family), LAYERS), dtype=bool)
        return self._idle(family, values, every, every)

    def _idle(self, family: np.ndarray, values: np.ndarray, known: np.ndarray, well: np.ndarray) -> np.ndarray:
        """See :meth:`beyond`, told from those passages that are ``known`` (P, 3) in a panel, and those known ``well``.

        S is gone once, so that it must be known well to be too long.
        """
        least = reduced(np.minimum, np.where(np.isfinite(values), values, np.inf), 1)
        least[least == np.inf] = -np.inf  # none exists
        often = np.array([1.0, 2.0, 2.0])  # a ray of U or D goes there and back
        longer = often * least[:, :LAYERS] > self.distance[family, None]
        longer |= often * least[:, LAYERS:] > self.within[family, None]
        longer &= np.column_stack([well[:, :1], known[:, 1:]])
        used = np.logical_not(longer | (known & reduced(np.logical_and, np.isnan(values[..., :LAYERS]), 1)))
        once, turning = values[..., 0], [values[..., 0] + 2 * values[..., k] for k in (1, 2)]
        told = np.column_stack([self._asked(family, came) for came in (once, *turning)])
        asked = np.where(known[:, :1] & known, told, True)
        # a ray of both U and D may go to and fro; of one of them it comes as far as once or by one turn
        alone = ~np.all(used[:, 1:], axis=1)
        unasked = alone[:, None] & ~asked[:, 1:]
        nobody = alone & ~asked[:, 0] & ~np.any(used[:, 1:] & asked[:, 1:], axis=1)
        return np.tile(longer | longer[:, :1] | np.pad(unasked, ((0, 0), (1, 0))) | nobody[:, None], 2)

    def _asked(self, family: np.ndarray, came: np.ndarray) -> np.ndarray:
        """Whether (P,) distances that are asked for are among those of panels that came so far at their points (P, m).

        Between these they may come as much farther, or less far, as they differ. Where one is not known all may be.
        """
        least, most = (reduced(bound, came, 1) for bound in (np.minimum, np.maximum))
        beside = most - least
        return ~((most + beside < self.nearest[family]) | (least - beside > self.farthest[family]))

    def series(self) -> Proxies:
        """Series that stand for them, to begin with four in each interval, two in one that is short."""
        count = self.passages.count
        panels = 4 * (count - 1) - 2 * self.plain - self.short  # the last ones are there
        family = np.repeat(np.arange(len(panels)), panels)
        number = np.arange(len(family)) - np.repeat(np.cumsum(panels) - panels, panels)
        beyond = np.where(self.short[family], number - 4 * (count[family] - 2), -1)
        low = (number + (beyond > 0)) / 2
        return proxies(self, family, low, low + np.where(beyond == 0, 1.0, 0.5), self.panels)

    @property
    def short(self) -> np.ndarray:
        """Whether (p,) the last interval is that of rays steeper than any that come back, along which g is smooth."""
        count = self.passages.count
        limited = self.passages.mild[np.arange(len(count)), count - 2] & (len(self.passages.profile.stops) == 0)
        return limited & (count > 2)


class _TabledSpread(Spread):
    """What the tables tell of it."""

    def _complete(
        self,
        values: np.ndarray,
        told: np.ndarray,
        family: np.ndarray,  # noqa: ARG002  nothing but the tables is asked
        angles: np.ndarray,  # noqa: ARG002
        enough: float,  # noqa: ARG002
    ) -> None:
        """What the tables do not tell is not known."""
        values[~reduced(np.logical_and, told, 1)] = -np.inf


def _share(known: np.ndarray, half: np.ndarray, away: np.ndarray) -> np.ndarray:
    """How far from a break, in halves of an interval, what is ``away`` from it is: doubly exponential.

    The angle of the break is ``known`` so well.
    """
    least = np.clip(NEAREST / EPSILON * known / half, LEAST_SHARE, MOST_SHARE)
    return np.exp(1 - np.exp(np.log(1 - np.log(least)) * (1 - away)))
