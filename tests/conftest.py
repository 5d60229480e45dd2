"""Options of the test suite."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--every-tolerance",
        action="store_true",
        help="hold the methods' claims against the closed forms at all five tolerances, not only at three of them",
    )
