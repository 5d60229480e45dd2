"""The reference problems, one file each: what it is, its source, the functional, the closed form.

In the repository this is the folder ``problems/``; installed, it is the package ``varcalc.problems``.
:func:`varcalc.study.reference.load` runs a file by its name.
"""

from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def __getattr__(name: str) -> ModuleType:
    """A file of this folder, imported when it is first asked for: ``varcalc.problems.brachistochrone``."""
    if name in _files():
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"varcalc.problems has no file {name!r}; it has {', '.join(_files())}")


def __dir__() -> list[str]:
    return _files()


def _files() -> list[str]:
    return sorted(found.name for found in iter_modules(__path__) if not found.name.startswith("_"))
