"""The packages: everything under src/, and the top-level problems/ as varcalc.problems."""

from setuptools import find_packages, setup

setup(packages=[*find_packages("src"), "varcalc.problems", "varcalc.problems.mechanics", "varcalc.problems.optics"])
