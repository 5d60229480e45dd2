"""What is derived from expressions: made when it is first asked for, and kept with the object that owns them."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Protocol, TypeVar, TypeVarTuple

T = TypeVar("T")
Key = TypeVarTuple("Key")


class Cache:
    """The products of one owner, shared by copies of it with other parameter values.

    Each product is kept under the function that makes it, see :func:`derived`, so that a name never stands for two
    things and a product has the type its maker returns. A cache stays in its process: a copy of it is empty.
    """

    def __init__(self) -> None:
        self.products: dict[tuple[Any, ...], Any] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return Cache, ()

    def only(self, *makers: Callable[..., Any]) -> Cache:
        """A cache that holds what ``makers`` have made here, and nothing else."""
        kept = Cache()
        wanted = {getattr(maker, "__wrapped__", maker) for maker in makers}
        kept.products = {key: product for key, product in self.products.items() if key[0] in wanted}
        return kept


class Owner(Protocol):
    """What has a cache: a problem, a form."""

    @property
    def cache(self) -> Cache:
        """What has been derived from its expressions."""
        ...


class Answering(Protocol):
    """What keeps answers: a problem."""

    @property
    def answers(self) -> Cache:
        """What has been found at its own parameter values."""
        ...


O = TypeVar("O", bound=Owner)  # noqa: E741  the owner
A = TypeVar("A", bound=Answering)


def derived(make: Callable[[O, *Key], T]) -> Callable[[O, *Key], T]:
    """``make(owner, *key)``, called once for each cache and key; later calls return what it made.

    What it makes may depend on what the copies of an owner share alone: expressions, not parameter values. The key is
    hashable.

    >>> class Cubes:
    ...     cache = Cache()
    >>> @derived
    ... def cubes(owner, largest):
    ...     print("made")
    ...     return [k**3 for k in range(largest)]
    >>> cubes(Cubes(), 3), cubes(Cubes(), 3)
    made
    ([0, 1, 8], [0, 1, 8])
    """

    @wraps(make)
    def kept(owner: O, *key: *Key) -> T:
        return _once(owner.cache, make, owner, *key)

    return kept


def answered(make: Callable[[A, *Key], T]) -> Callable[[A, *Key], T]:
    """The same for what depends on the parameter values as well, and on nothing else but the key: copies have none."""

    @wraps(make)
    def kept(problem: A, *key: *Key) -> T:
        return _once(problem.answers, make, problem, *key)

    return kept


def _once(cache: Cache, make: Callable[..., Any], owner: Any, *key: Any) -> Any:
    products, place = cache.products, (make, *key)
    try:
        return products[place]
    except KeyError:
        product = products[place] = make(owner, *key)
        return product
