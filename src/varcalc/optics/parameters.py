"""Numbers a medium or surface depends on, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, Self

import casadi as ca

from varcalc.problem.conditions import named
from varcalc.spelling import check_names, spelled
from varcalc.symbolic.tracing import Names, TracedFunction, check_arity, name_of, trace


class Parametrised:
    """A frozen dataclass whose ``parameters`` other values may be given for.

    Attributes
    ----------
    parameters : Mapping[str, float]
        The names and the present values, for those that declare any.
    """

    parameters: Mapping[str, float] = MappingProxyType({})

    functions: ClassVar[Mapping[str, tuple[int, ...]]] = MappingProxyType({})
    """The fields that hold functions of the user's, and of how many coordinates each may be."""

    def __getstate__(self) -> dict[str, Any]:
        """The fields, each function as what it gives: a function itself cannot go to another process."""
        given = {name: _Traced.of(getattr(self, name), n, tuple(self.parameters)) for name, n in self.functions.items()}
        return {**self.__dict__, **given}

    @spelled
    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same for other values of the parameters.

        Raises ValueError for a name that is not among ``parameters``.
        """
        given = named("parameters", values)
        check_names(f"parameters of this {type(self).__name__}", given, self.parameters)
        return self._changed({**self.parameters, **given}) if given else self

    def _changed(self, parameters: Mapping[str, float]) -> Self:
        """The same with all its ``parameters`` given."""
        whole: Any = self
        return replace(whole, parameters=parameters)


@dataclass(frozen=True, eq=False)
class _Traced:
    """What a function of coordinates and parameters gave, for each number of coordinates it takes."""

    by_count: Mapping[int, TracedFunction]
    called: str

    @property
    def __name__(self) -> str:
        return self.called

    @classmethod
    def of(cls, function: Callable[..., Any], counts: tuple[int, ...], names: tuple[str, ...]) -> _Traced:
        """A ``function`` traced with each of the ``counts`` of coordinates; itself where it is traced already."""
        if isinstance(function, _Traced):
            return function
        found = {}
        p = ca.SX.sym("p", len(names))
        last = [Names({name: p[i] for i, name in enumerate(names)})] if names else []
        for count in counts:
            arguments = [ca.SX.sym(f"x{i}") for i in range(count)]
            with suppress(TypeError):  # as a function of so many coordinates there is none
                check_arity("n", function, count + len(last))
                expression = trace("n", function, [*arguments, *last], ca.SX)
                found[count] = TracedFunction(ca.Function("traced", [*arguments, p], [expression]), (names,))
        return cls(found, name_of(function))

    def __call__(self, *arguments: Any) -> Any:
        count = len(arguments) - any(traced.names != ((),) for traced in self.by_count.values())
        if count not in self.by_count:
            raise TypeError(f"a function of {', '.join(map(str, self.by_count))} coordinates is called with {count}")
        return self.by_count[count](*arguments)
