"""The description that a package index shows: README.md, its links made to lead to the repository."""

import re
import tomllib
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).parent
source = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]["Source"]


def absolute(link: re.Match[str]) -> str:
    """A link with its address in the repository: of a page, or of the picture itself."""
    picture, words, target = link.groups()
    return f"{picture}[{words}]({source}/{'raw' if picture else 'blob'}/main/{target})"


readme = (ROOT / "README.md").read_text(encoding="utf-8")
setup(
    long_description=re.sub(r"(!?)\[([^\]]*)\]\((?!https?:)([^)]+)\)", absolute, readme),
    long_description_content_type="text/markdown",
)
