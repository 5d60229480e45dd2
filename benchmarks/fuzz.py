"""Random Lagrangians, scenes, systems, data files and command lines: each a result or a refusal in one sentence.

A raw exception, a hang, or a number that is none presented as an answer is a defect; its seed is kept. Data files are
read, never run; a Python file of one's own is code, is run by design, and is not among the inputs.

Run: python benchmarks/fuzz.py [--count KIND=N]... [--fresh]
"""

from __future__ import annotations

import json
import signal
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType

import click
import numpy as np

from campaigns.fuzzing import KINDS, REFUSALS, Defect

RECORDS = Path(__file__).parent / "records" / "fuzz.json"
SEED = 1788
"""The year of Lagrange's Mécanique analytique."""
COUNTS = {
    "profiles": 30_000, "measurements": 25_000, "sweep stores": 10_000, "grids": 40_000, "command lines": 8_000,
    "lagrangians": 400, "scenes": 400, "systems": 400,
}  # fmt: skip
"""Inputs of each kind, when nothing else is asked for."""
LIMIT = 30.0
"""Seconds of processor time that one input may take."""
SENTENCE = 600
"""Characters of a refusal, at most."""


class Hang(BaseException):
    """An input that took more than its time: not to be caught by the code that is tried."""


@dataclass
class Tally:
    """What became of the inputs of one kind."""

    inputs: int = 0
    results: int = 0
    refusals: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    defects: list[dict[str, str | int]] = field(default_factory=list)


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise Hang in what takes more processor time."""

    def late(_signal: int, _frame: FrameType | None) -> None:
        raise Hang

    before = signal.signal(signal.SIGPROF, late)
    # once more each second: what is raised while an object is thrown away is lost
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def tried(kind: str, number: int) -> str:
    """``"result"``, ``"refusal"``, or what is wrong with what became of an input."""
    rng = np.random.default_rng([SEED, list(KINDS).index(kind), number])
    try:
        with limited(LIMIT), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            KINDS[kind](rng)
    except REFUSALS as refusal:
        sentence = str(refusal)
        whole = 0 < len(sentence) <= SENTENCE and "\n" not in sentence
        return "refusal" if whole else f"no sentence: {sentence[:SENTENCE]!r}"
    except Defect as defect:
        return str(defect)
    except Hang:
        return f"took more than {LIMIT:g} s"
    except Exception as error:  # noqa: BLE001 - what nobody foresaw is what is looked for
        return f"{type(error).__name__}: {error}"
    return "result"


def campaign(kind: str, count: int, known: Tally) -> Tally:
    """The inputs of a kind from where it was left, up to ``count``."""
    for number in range(known.inputs, count):
        begun = time.process_time()
        outcome = tried(kind, number)
        spent = time.process_time() - begun
        known.inputs += 1
        known.results += outcome == "result"
        known.refusals += outcome == "refusal"
        known.seconds += spent
        known.slowest = max(known.slowest, spent)
        if outcome not in {"result", "refusal"}:
            known.defects.append({"number": number, "what": outcome})
    return known


@click.command()
@click.option("--count", "counts", multiple=True, metavar="KIND=N", help="Inputs of a kind; several may be given.")
@click.option("--fresh", is_flag=True, help="Try everything anew.")
def main(counts: tuple[str, ...], fresh: bool) -> None:
    """Try what the records lack, store and print the tally; exit 1 when there is a defect."""
    asked = COUNTS | {kind: int(number) for kind, _, number in (text.rpartition("=") for text in counts)}
    stored = json.loads(RECORDS.read_text(encoding="utf-8")) if RECORDS.exists() and not fresh else {}
    tallies = {kind: Tally(**stored.get(kind, {})) for kind in KINDS}
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for kind, tally in tallies.items():
            campaign(kind, asked.get(kind, 0), tally)
            if tally.inputs:
                written = {k: asdict(t) for k, t in tallies.items() if t.inputs}
                RECORDS.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
            print(
                f"{kind:14} {tally.inputs:7d} inputs {tally.results:7d} results {tally.refusals:7d} refusals "
                f"{len(tally.defects):3d} defects  {tally.seconds:8.1f} s, slowest {tally.slowest:.2f} s"
            )
            for what, number in Counter(str(d["what"])[:150] for d in tally.defects).most_common(10):
                print(f"  {number} x {what}")
    raise SystemExit(any(t.defects for t in tallies.values()))


if __name__ == "__main__":
    main()
