"""The instructions of a CasADi SX function, carried out in any algebra.

An SX function is a list of scalar operations. Carried out on arrays it is the
function itself, vectorised and free of CasADi's call overhead; carried out on
other objects it becomes what those objects make of it: text, or arithmetic
that keeps track of small differences.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, Self, TypeAlias, TypeVar

import casadi as ca
import numpy as np

T = TypeVar("T")
Expression: TypeAlias = Any
"""An SX scalar."""

APART = frozenset({ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT})
"""What instructions do besides operations."""
KEPT_FUNCTIONS = 256
"""Functions whose instructions are kept."""

NAMES = {code: name.removeprefix("OP_").lower() for name, code in vars(ca).items() if name.startswith("OP_")}
"""CasADi's name of each operation code."""
SUMS, POWERS = frozenset({ca.OP_ADD, ca.OP_SUB}), frozenset({ca.OP_POW, ca.OP_CONSTPOW})
"""Codes of sums and differences, and of powers."""


class Call(int):
    """CasADi's code of a call, which alone does not tell what is called: the function, and which of its results."""

    function: ca.Function
    result: int

    @classmethod
    def of(cls, function: ca.Function, result: int) -> Self:
        """The call of a function for one of the nonzeros of its results."""
        code = cls(ca.OP_CALL)
        code.function, code.result = function, result
        return code

    def __call__(self, operands: Sequence[Any], kind: type) -> Any:
        """The result for the nonzeros of the arguments, as a scalar of the ``kind`` SX or DM."""
        f, columns, first = self.function, list[Any](), 0
        for k in range(f.n_in()):
            last = first + f.nnz_in(k)
            columns.append(kind(f.sparsity_in(k), ca.vertcat(kind(0, 1), *operands[first:last])))
            first = last
        return ca.vertcat(*(ca.vertcat(*r.nonzeros()) for r in f.call(columns, False, True) if r.nnz()))[self.result]

    def at(self, *operands: np.ndarray | float) -> np.ndarray:
        """The result for arrays of numbers, or for numbers, that broadcast."""
        f, given = self.function, np.broadcast_arrays(*operands)
        shape, rows = given[0].shape, np.array([np.ravel(g) for g in given], dtype=float)
        columns, first, count = list[Any](), 0, rows.shape[1]
        if count == 0:
            return np.zeros(shape)
        for k in range(f.n_in()):
            last = first + f.nnz_in(k)
            if f.nnz_in(k) not in (0, f.size1_in(k)):  # no dense column
                each = [float(self(list(map(float, row)), ca.DM)) for row in rows.T]
                return np.reshape(each, shape)
            columns.append(rows[first:last] if last > first else ca.DM(f.size1_in(k), count * f.size2_in(k)))
            first = last
        # the results of all points, side by side
        results = [np.reshape(_nonzeros(r), (count, -1)) for r in _mapped(f, count)(columns) if r.nnz()]
        return np.hstack(results)[:, self.result].reshape(shape)


def _nonzeros(matrix: ca.DM) -> np.ndarray:
    """The nonzeros, column by column."""
    return matrix.full().ravel(order="F") if matrix.is_dense() else np.array(matrix.nonzeros())


@lru_cache(maxsize=KEPT_FUNCTIONS)
def _mapped(function: ca.Function, count: int) -> Callable[[Sequence[np.ndarray]], Sequence[Any]]:
    """A function at many points: columns side by side to results side by side."""
    return function.map(count).call


class Instruction(NamedTuple):
    """``work[target] = operation(*(work[s] for s in sources))``.

    For OP_CONST ``constant`` is the number; for OP_INPUT ``sources`` is
    (argument, entry), for OP_OUTPUT ``place`` is (result, entry). A call of a function that is no formula, such as
    interpolated data, has an instruction for each of its results, whose operation is a :class:`Call`.
    """

    operation: int
    sources: tuple[int, ...]
    target: int
    constant: float = 0.0
    place: tuple[int, int] = (0, 0)


def instructions(function: ca.Function) -> Iterator[Instruction]:
    """The instructions of an SX function in order; TypeError for a function that is not an SXFunction."""
    if not function.is_a("SXFunction"):
        raise TypeError(f"{function.name()} is no SX function, so it has no scalar instructions")
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        if operation == ca.OP_CONST:
            yield Instruction(operation, (), function.instruction_output(k)[0], function.instruction_constant(k))
        elif operation == ca.OP_OUTPUT:
            first, second = function.instruction_output(k)
            yield Instruction(operation, (function.instruction_input(k)[0],), -1, place=(first, second))
        else:
            sources, targets = tuple(function.instruction_input(k)), function.instruction_output(k)
            if operation != ca.OP_CALL:
                yield Instruction(operation, sources, targets[0])
                continue
            of = function.instructions_sx()[k].which_function()
            yield from (Instruction(Call.of(of, r), sources, t) for r, t in enumerate(targets) if t >= 0)


def interpret(
    function: ca.Function,
    arguments: Sequence[Sequence[T]],
    constant: Callable[[float], T],
    apply: Callable[[int, Sequence[T]], T],
) -> list[list[T]]:
    """The nonzeros of each result of an SX ``function`` of the nonzeros ``arguments``, in the algebra of T.

    ``constant`` brings a number into the algebra and ``apply`` carries out one
    operation, given by CasADi's code, on one or two elements.
    """
    return program(function).run(arguments, constant, apply)


@lru_cache(maxsize=KEPT_FUNCTIONS)
def program(function: ca.Function) -> Program:
    """The instructions of a function, kept: CasADi hands them out one call at a time, in the time they take to run."""
    return Program(function)


class Program:
    """The instructions of an SX ``function``, read once, to be carried out in any algebra and as often as one likes."""

    def __init__(self, function: ca.Function) -> None:
        self.steps = [
            # CasADi names the same source twice for an operation of one argument
            i if i.operation in (ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CALL)
            else i._replace(sources=i.sources[: arity(i.operation)])
            for i in instructions(function)
        ]  # fmt: skip
        self.results = [function.nnz_out(i) for i in range(function.n_out())]

    def run(
        self,
        arguments: Sequence[Sequence[T]],
        constant: Callable[[float], T],
        apply: Callable[[int, Sequence[T]], T],
    ) -> list[list[T]]:
        """The nonzeros of each result of the nonzeros ``arguments``, see :func:`interpret`."""
        work: dict[int, T] = {}
        results: list[list[T]] = [[constant(0.0)] * count for count in self.results]
        for operation, sources, target, number, place in self.steps:
            if operation not in APART:
                work[target] = apply(operation, [work[s] for s in sources])
            elif operation == ca.OP_CONST:
                work[target] = constant(number)
            elif operation == ca.OP_INPUT:
                work[target] = arguments[sources[0]][sources[1]]
            else:
                results[place[0]][place[1]] = work[sources[0]]
        return results


def operate(operation: int, operands: Sequence[Expression]) -> Expression:
    """One operation on SX elements."""
    if isinstance(operation, Call):
        return operation(operands, ca.SX)
    return ca.SX.unary(operation, *operands) if len(operands) == 1 else ca.SX.binary(operation, *operands)


def arity(operation: int) -> int:
    """Number of arguments of an operation: 1 or 2."""
    return 1 if operation in UNARY else 2


def _sign_of(x: Any) -> Any:
    return np.sign(x)


def _erf(x: Any) -> Any:
    from scipy.special import erf

    return erf(x)


UNARY: dict[int, Callable[[Any], Any]] = {
    ca.OP_ASSIGN: np.positive,
    ca.OP_NEG: np.negative,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_SQRT: np.sqrt,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_NOT: lambda x: np.where(x == 0, 1.0, 0.0),
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: _sign_of,
    ca.OP_ERF: _erf,
    ca.OP_INV: lambda x: np.divide(1.0, x),
    ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh,
    ca.OP_TANH: np.tanh,
    ca.OP_ASINH: np.arcsinh,
    ca.OP_ACOSH: np.arccosh,
    ca.OP_ATANH: np.arctanh,
    ca.OP_LOG1P: np.log1p,
    ca.OP_EXPM1: np.expm1,
}
"""NumPy's form of CasADi's operations of one argument."""

BINARY: dict[int, Callable[[Any, Any], Any]] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_LT: lambda x, y: np.where(x < y, 1.0, 0.0),
    ca.OP_LE: lambda x, y: np.where(x <= y, 1.0, 0.0),
    ca.OP_EQ: lambda x, y: np.where(x == y, 1.0, 0.0),
    ca.OP_NE: lambda x, y: np.where(x != y, 1.0, 0.0),
    ca.OP_AND: lambda x, y: np.where((x != 0) & (y != 0), 1.0, 0.0),
    ca.OP_OR: lambda x, y: np.where((x != 0) | (y != 0), 1.0, 0.0),
    ca.OP_FMOD: np.fmod,
    ca.OP_REMAINDER: lambda x, y: x - y * np.round(x / y),
    ca.OP_COPYSIGN: np.copysign,
    ca.OP_IF_ELSE_ZERO: lambda x, y: np.where(x != 0, y, 0.0),
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_HYPOT: np.hypot,
}
"""NumPy's form of CasADi's operations of two arguments."""


def in_numbers(operation: int) -> Callable[..., Any]:
    """An operation on numbers, or on arrays of them; KeyError where NumPy has no form of it."""
    return (
        operation.at if isinstance(operation, Call) else UNARY[operation] if operation in UNARY else BINARY[operation]
    )
