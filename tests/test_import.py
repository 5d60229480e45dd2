"""What `import varcalc` loads, and what it leaves for those who need it."""

import json
import subprocess
import sys
from importlib.resources import files

import pytest

import varcalc as vc


def loaded_after(statement):
    """The modules loaded by ``statement`` in a fresh interpreter."""
    code = f"import json, sys\n{statement}\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("statement", ["import varcalc", "import varcalc.cli", "import varcalc.study.reference"])
def test_nothing_heavy_is_imported_until_needed(statement):
    heavy = (
        "matplotlib",
        "heyoka",
        "scipy.integrate",
        "scipy.optimize",
        "scipy.linalg",
        "rich",
        "hypothesis",
        "jinja2",
        "latex2mathml",
    )
    loaded = loaded_after(statement)
    assert [name for name in loaded if name in heavy] == []


def test_every_exported_name_exists():
    assert sorted(set(vc.__all__)) == sorted(vc.__all__)
    assert [name for name in vc.__all__ if not hasattr(vc, name)] == []


def test_the_package_is_marked_as_typed():
    assert files("varcalc").joinpath("py.typed").is_file()
