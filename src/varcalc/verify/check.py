"""What a check is.

Those of this package are listed in ``verify/verdict.py``; a package of one's own
adds to them by an entry point of the group :data:`CHECKS_GROUP` that names a
:class:`Check`; docs/extending.md walks through one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import ClassVar, Generic, TypeVar

from varcalc.solution import Finding
from varcalc.verify.candidate import Candidate

T = TypeVar("T")
CHECKS_GROUP = "varcalc.checks"
"""The group of entry points under which other packages offer a :class:`Check`."""


class Check(ABC, Generic[T]):
    """One condition, asked along one curve: a frozen dataclass in a file of its own.

    ``name`` is what its measurement is called in ``Verification.evidence``.
    """

    name: ClassVar[str]

    @abstractmethod
    def measure(self, candidate: Candidate) -> T:
        """What the check finds along the curve; ``candidate.measured`` has what another check has found."""

    @abstractmethod
    def findings(self, candidate: Candidate) -> Iterable[Finding]:
        """What follows from that: sentences with their numbers, each with a verdict where it decides one."""
