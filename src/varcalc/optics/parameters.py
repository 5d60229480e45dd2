"""Numbers a medium or surface depends on, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Self

from varcalc.problem.functional import named


class Parametrised:
    """A frozen dataclass whose ``parameters`` other values may be given for.

    Attributes
    ----------
    parameters : Mapping[str, float]
        The names and the present values, for those that declare any.
    """

    parameters: Mapping[str, float] = MappingProxyType({})

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same for other values of the parameters.

        Raises ValueError for a name that is not among ``parameters``.
        """
        given = named("parameters", values)
        strange = given.keys() - self.parameters.keys()
        if strange:
            what = type(self).__name__
            raise ValueError(f"{sorted(strange)} are no parameters of this {what}; it has {sorted(self.parameters)}")
        return self._changed({**self.parameters, **given}) if given else self

    def _changed(self, parameters: Mapping[str, float]) -> Self:
        """The same with all its ``parameters`` given."""
        whole: Any = self
        return replace(whole, parameters=parameters)
