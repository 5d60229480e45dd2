"""The packages: everything under src/, and the top-level problems/ as varcalc.problems."""

from setuptools import find_packages, setup

FOLDERS = ["varcalc.problems", *(f"varcalc.problems.{folder}" for folder in ("figures", "mechanics", "optics"))]

setup(packages=[*find_packages("src"), *FOLDERS])
