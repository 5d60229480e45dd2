"""What a method is called in tables, and the check of what is given as one."""

from __future__ import annotations

import dataclasses
from typing import Any

from varcalc.problem.conditions import told


def label(method: Any) -> str:
    """A method's class and those of its options that are not the default.

    >>> from varcalc import Ritz
    >>> label(Ritz()), label(Ritz(elements=8))
    ('Ritz', 'Ritz(elements=8)')
    """
    return _written(method).removesuffix("()")


def _written(value: Any) -> str:
    """How ``value`` would be written in code, leaving out what is the default."""
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return repr(value)
    options = [
        f"{field.name}={_written(getattr(value, field.name))}"
        for field in dataclasses.fields(value)
        if getattr(value, field.name) != _default(field)
    ]
    return f"{type(value).__name__}({', '.join(options)})"


def _default(field: dataclasses.Field[Any]) -> Any:
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def checked_method(index: int, method: Any) -> Any:
    """``methods[index]``, refused with TypeError when it is neither a method object nor None."""
    if isinstance(method, type):
        raise TypeError(f"methods[{index}] is the class {method.__name__}; give an object: {method.__name__}()")
    if method is not None and not dataclasses.is_dataclass(method):
        raise TypeError(f"methods[{index}] must be a method such as Ritz(), or None for the ladder, not {told(method)}")
    return method
