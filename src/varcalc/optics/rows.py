"""Tables of arrays: a dataclass each of whose fields has one row an item."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np


class Rows:
    """A dataclass of arrays (m, ...), or of other such tables, that have as many rows each."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self.__dataclass_fields__))))

    def take(self, rows: np.ndarray | Sequence[int] | slice) -> Self:
        """The rows ``rows``: numbers, or a slice, which gives views."""
        values = [getattr(self, name) for name in self.__dataclass_fields__]
        return type(self)(*[v.take(rows) if isinstance(v, Rows) else v[rows] for v in values])

    def put(self, rows: np.ndarray, other: Self) -> None:
        """Write ``other`` over the ``rows``, in place."""
        for name in self.__dataclass_fields__:
            mine, its = getattr(self, name), getattr(other, name)
            if isinstance(mine, Rows):
                mine.put(rows, its)
            else:
                mine[rows] = its

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The rows of all ``parts``, one of them at least, one part after the other."""
        columns = ([getattr(part, name) for part in parts] for name in cls.__dataclass_fields__)
        return cls(*(type(c[0]).joined(c) if isinstance(c[0], Rows) else np.concatenate(c) for c in columns))
