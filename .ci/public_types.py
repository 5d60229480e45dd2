"""Whether the types of all public names are known to those who use them: `pyright --verifytypes`, read by name.

Public is what varcalc, varcalc.optics and varcalc.mechanics list in ``__all__``, with the members that have no
underscore. Exits with 1 and the names where a type is not known in full.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import varcalc as vc

SOURCES = Path(__file__).parents[1] / "src"


def public() -> set[str]:
    """The full names of what is listed, by the modules that define it."""
    return {
        f"{thing.__module__}.{thing.__qualname__}"
        for package in (vc, vc.optics, vc.mechanics)
        for thing in (getattr(package, name) for name in package.__all__)
        if hasattr(thing, "__qualname__")
    }


def main() -> int:
    """Ask pyright, and say what it does not know."""
    with tempfile.TemporaryDirectory() as elsewhere:  # the project's own settings do not reach those who use it
        done = subprocess.run(
            ["pyright", "--verifytypes", "varcalc", "--ignoreexternal", "--outputjson"], cwd=elsewhere, text=True,
            env={**os.environ, "PYTHONPATH": str(SOURCES)}, capture_output=True, check=False,
        )  # fmt: skip
    found = json.loads(done.stdout)["typeCompleteness"]
    listed = public()
    wanted = [
        symbol
        for symbol in found["symbols"]
        if any(symbol["name"] == name or symbol["name"].startswith(f"{name}.") for name in listed)
        and not symbol["name"].rpartition(".")[2].startswith("_")
    ]
    unknown = sorted({symbol["name"] for symbol in wanted if not symbol["isTypeKnown"] or symbol["isTypeAmbiguous"]})
    sys.stdout.write(f"{len(wanted) - len(unknown)} of {len(wanted)} public types are known\n")
    sys.stdout.writelines(f"  not known: {name}\n" for name in unknown)
    return 1 if unknown or len(wanted) < len(listed) else 0


if __name__ == "__main__":
    sys.exit(main())
