"""The index of a glass at a wavelength."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from varcalc.optics.validation import numbers
from varcalc.problem.conditions import is_vector, real, reals, text, told
from varcalc.showing import Brief
from varcalc.spelling import listed, near, spelled


class Dispersion(ABC):
    """A formula for the index of a material at a wavelength. A new one defines :meth:`index`."""

    @abstractmethod
    def index(self, wavelength: Any) -> Any:
        """n at ``wavelength``, in micrometres in vacuum: a number, which is checked, an array of them, or a symbol."""

    def _each(self, wavelengths: Any) -> np.ndarray:
        """n at each of an array of wavelengths."""
        found = numbers("wavelength", wavelengths)
        return np.array([self.index(one) for one in found.flat]).reshape(found.shape)


@spelled
@dataclass(frozen=True, repr=False)
class Sellmeier(Brief, Dispersion):
    """n² = 1 + Σ B λ²/(λ² - C), with λ the vacuum wavelength in micrometres and C in square micrometres.

    Parameters
    ----------
    B, C : sequence of float
        Strengths and squared resonance wavelengths, as glass catalogues print them.
    range : tuple of float
        The wavelengths the formula was fitted for.
    source : str

    Examples
    --------
    >>> from varcalc import optics
    >>> round(optics.GLASSES["N-BK7"].index(0.5875618), 5)
    1.5168
    """

    B: Sequence[float]
    C: Sequence[float]
    range: tuple[float, float] = (0.0, np.inf)
    source: str = ""

    def __post_init__(self) -> None:
        strengths, resonances = numbers("B", self.B), numbers("C", self.C)
        if strengths.ndim != 1 or strengths.shape != resonances.shape:
            raise ValueError(f"B and C must be as many numbers each, not {told(self.B)} and {told(self.C)}")
        object.__setattr__(self, "B", tuple(strengths.tolist()))
        object.__setattr__(self, "C", tuple(resonances.tolist()))
        object.__setattr__(self, "range", _range(self.range))
        text("source", self.source)

    def index(self, wavelength: Any) -> Any:
        """n at ``wavelength`` in micrometres; ValueError outside the range of the formula, and at a resonance.

        Where ``wavelength`` is a symbol or an array, so is n.
        """
        if is_vector(wavelength):
            return self._each(wavelength)
        wavelength = check_wavelength(wavelength, self.range)
        squared = 1 + sum(b * wavelength**2 / (wavelength**2 - c) for b, c in zip(self.B, self.C, strict=True))
        if isinstance(wavelength, ca.SX):
            return ca.sqrt(squared)
        if not squared > 0:
            raise ValueError(
                f"the formula gives n² = {squared:g} at {wavelength} micrometres: that is an absorption band"
            )
        return float(np.sqrt(squared))


@spelled
@dataclass(frozen=True, repr=False)
class Cauchy(Brief, Dispersion):
    """n = A₀ + A₁/λ² + A₂/λ⁴ + ..., with λ the vacuum wavelength in micrometres.

    Parameters
    ----------
    A : sequence of float
        A₀, A₁, ...
    range : tuple of float
        The wavelengths the formula was fitted for.
    source : str
    """

    A: Sequence[float]
    range: tuple[float, float] = (0.0, np.inf)
    source: str = ""

    def __post_init__(self) -> None:
        terms = numbers("A", self.A)
        if terms.ndim != 1:
            raise ValueError(f"A must be a sequence of numbers, not {told(self.A)}")
        object.__setattr__(self, "A", tuple(terms.tolist()))
        object.__setattr__(self, "range", _range(self.range))
        text("source", self.source)

    def index(self, wavelength: Any) -> Any:
        """n at ``wavelength`` in micrometres; ValueError outside the range of the formula.

        Where ``wavelength`` is a symbol or an array, so is n.
        """
        if is_vector(wavelength):
            return self._each(wavelength)
        wavelength = check_wavelength(wavelength, self.range)
        index = sum(a * wavelength ** (-2 * k) for k, a in enumerate(self.A))
        return index if isinstance(wavelength, ca.SX) else float(index)


def _range(given: Any) -> tuple[float, float]:
    """Two ascending wavelengths, the second of which may be infinite; TypeError or ValueError for anything else."""
    found = reals("range", given)
    if found.shape != (2,) or not found[0] < found[1]:
        raise ValueError(f"range must be two ascending wavelengths, not {told(given)}")
    return float(found[0]), float(found[1])


def check_wavelength(wavelength: Any, between: tuple[float, float]) -> Any:
    """The wavelength as a float; ValueError where it does not lie in the range, in micrometres; symbols pass."""
    if isinstance(wavelength, ca.SX):
        return wavelength
    wavelength = real("wavelength", wavelength)
    if not between[0] <= wavelength <= between[1] or not wavelength > 0:
        hint = f"; {wavelength:g} nm are {wavelength / 1e3:g}" if between[0] <= wavelength / 1e3 <= between[1] else ""
        raise ValueError(
            f"wavelength must lie between {between[0]} and {between[1]} micrometres, not {wavelength}{hint}"
        )
    return wavelength


class NoSuchMaterialError(KeyError):
    """A name that is not in a catalogue; the message suggests others."""

    def __str__(self) -> str:
        return str(self.args[0])


class Catalogue(Mapping[str, Dispersion]):
    """Materials by name.

    >>> from varcalc import optics
    >>> optics.GLASSES["BK7"]
    Traceback (most recent call last):
    varcalc.optics.media.dispersion.NoSuchMaterialError: 'BK7' is not among the materials; did you mean 'N-BK7'?
    """

    def __init__(self, materials: Mapping[str, Dispersion]) -> None:
        self._materials = MappingProxyType(dict(materials))

    def __getitem__(self, name: str) -> Dispersion:
        if name not in self._materials:
            remedy = (
                near(str(name), self) or f"; there are {listed(list(self))}, and others are written Sellmeier(B, C)"
            )
            raise NoSuchMaterialError(f"{name!r} is not among the materials{remedy}")
        return self._materials[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._materials)

    def __len__(self) -> int:
        return len(self._materials)

    def __repr__(self) -> str:
        return f"Catalogue({', '.join(self)})"


SCHOTT = "Schott, optical glass data sheets (2017)"
GLASSES = Catalogue(
    {
        "N-BK7": Sellmeier(
            (1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653), (0.3, 2.5), SCHOTT
        ),
        "N-SF11": Sellmeier(
            (1.73759695, 0.313747346, 1.89878101), (0.013188707, 0.0623068142, 155.23629), (0.37, 2.5), SCHOTT
        ),
        "N-F2": Sellmeier(
            (1.39757037, 0.159201403, 1.2686543), (0.00995906143, 0.0546931752, 119.248346), (0.365, 2.5), SCHOTT
        ),
        "fused silica": Sellmeier(
            (0.6961663, 0.4079426, 0.8974794),
            (0.0684043**2, 0.1162414**2, 9.896161**2),
            (0.21, 3.71),
            "Malitson, J. Opt. Soc. Am. 55 (1965) 1205",
        ),
        "sapphire, ordinary": Sellmeier(
            (1.4313493, 0.65054713, 5.3414021),
            (0.0726631**2, 0.1193242**2, 18.028251**2),
            (0.2, 5.0),
            "Malitson and Dodge, J. Opt. Soc. Am. 62 (1972) 1405",
        ),
    }
)
"""A few standard materials by name."""
