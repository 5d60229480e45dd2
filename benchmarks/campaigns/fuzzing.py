"""Random inputs of every kind that varcalc reads, and what is asked of what becomes of each."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from click.testing import CliRunner

import varcalc as vc
from varcalc import mechanics, optics
from varcalc.cli import main
from varcalc.solve.grid import spaced

Random = np.random.Generator
REFUSALS = (TypeError, ValueError, vc.VariationalError)
"""What a refusal is raised as."""
STATUSES = {0, 1, 2}
"""Exit statuses of commands."""


class Defect(Exception):
    """A result that is none."""


# text and bytes


CELLS = ("0", "1", "2.5", "-3e2", "1e999", "nan", "inf", "x", "", " ", '"', "'", "1_000", "0x1", "\u0663", "1,5", "--")
HEADERS = ("height (m)", "depth (km)", "n", "index", "speed (m/s)", "c [furlong]", "(", "z()", "\ufeffn", "#")
SEPARATORS = (",", ";", "\t", " ", ", ", "\x00")


def _table(rng: Random) -> bytes:
    """A file of columns, more or less: heights and values, then some of it spoilt."""
    separator, rows = str(rng.choice(SEPARATORS)), int(rng.integers(0, 8))
    lines = [separator.join(rng.choice(HEADERS, 2))] if rng.random() < 0.5 else []
    lines += [f"{k}{separator}{1 + rng.random():.3f}" for k in range(rows)]
    for _ in range(int(rng.integers(0, 3))):
        cells = rng.choice(CELLS, int(rng.integers(1, 4))).tolist()
        lines.insert(int(rng.integers(0, len(lines) + 1)), separator.join(cells))
    return _spoilt(rng, "\n".join(lines).encode())


def _spoilt(rng: Random, content: bytes) -> bytes:
    """Now and then some bytes changed, cut off or put in."""
    found = bytearray(content)
    for _ in range(int(rng.integers(0, 4)) if rng.random() < 0.5 else 0):
        place = int(rng.integers(0, len(found) + 1))
        way = rng.integers(0, 3)
        if way == 0:
            found[place : place + 1] = rng.bytes(1)
        elif way == 1:
            del found[place:]
        else:
            found[place:place] = rng.bytes(int(rng.integers(1, 4)))
    return bytes(found)


def _json(rng: Random, depth: int = 0) -> Any:
    """Any JSON value."""
    way = int(rng.integers(0, 8 if depth < 4 else 6))
    if way < 6:
        return [None, True, int(rng.integers(-9, 9)), float(rng.normal()), float("nan"), str(rng.choice(CELLS))][way]
    several = range(int(rng.integers(0, 4)))
    if way == 6:
        return [_json(rng, depth + 1) for _ in several]
    return {str(rng.choice(CELLS)): _json(rng, depth + 1) for _ in several}


def _twisted(rng: Random, value: Any) -> Any:
    """A JSON document with one of its parts put in the place of another, taken away, or made anything."""
    if isinstance(value, dict) and value and rng.random() < 0.8:
        key = str(rng.choice(list(value)))
        if rng.random() < 0.2:
            return {k: v for k, v in value.items() if k != key}
        return value | {key if rng.random() < 0.9 else key + "s": _twisted(rng, value[key])}
    if isinstance(value, list) and value and rng.random() < 0.8:
        place = int(rng.integers(len(value)))
        return [*value[:place], _twisted(rng, value[place]), *value[place + 1 :]]
    return _json(rng)


# data files


def profile(rng: Random) -> None:
    """A file of columns; what is read must be an index that is a number everywhere."""
    path = Path("profile.csv")
    path.write_bytes(_table(rng))
    speed = float(rng.choice([1.0, 1500.0, -1.0, np.nan])) if rng.random() < 0.4 else None
    columns: Any = [None, None, (0, 1), ("n", "z"), (5, 6), "zn", (0,)][int(rng.integers(7))]
    read = optics.read_profile(path, reference_speed=speed, columns=columns)
    if not (np.isfinite(read.heights).all() and np.isfinite(read.n).all() and np.min(read.n) > 0):
        raise Defect(f"a profile holds {read.n} at {read.heights}")


RECORD = {"problem": "line", "method": "Ritz", "setting": 1e-6, "status": "solved", "build_ms": 1.0, "unknowns": 12}
STORED = {"format": 1, "about": {"python": "3"}, "records": [RECORD, RECORD | {"status": "refused", "reason": "none"}]}


def measurements(rng: Random) -> None:
    """A file of measurements; what is read must make a table and be stored again."""
    path = Path("measured.json")
    text = json.dumps(_twisted(rng, STORED) if rng.random() < 0.9 else _json(rng))
    path.write_bytes(_spoilt(rng, b"[" * 100_000 if rng.random() < 0.002 else text.encode()))
    read = vc.WorkPrecision.load(path)
    read.table()
    json.dumps(read.document(), allow_nan=False)


SPRING = vc.Problem(
    lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 1.0}, name="spring"
)
GRID = {"k": [1.0]}


def sweep_store(rng: Random) -> None:
    """The store of a sweep; whatever is in it, points are read whole or solved."""
    path = Path("sweep.jsonl")
    path.unlink(missing_ok=True)
    vc.sweep(SPRING, GRID, store=path, progress=False)
    lines = path.read_text(encoding="utf-8").splitlines()
    place = int(rng.integers(len(lines)))
    lines[place] = json.dumps(_twisted(rng, json.loads(lines[place])))
    path.write_bytes(_spoilt(rng, ("\n".join(lines) + "\n" * int(rng.integers(0, 2))).encode()))
    swept = vc.sweep(SPRING, GRID, store=path, progress=False)
    swept.table()
    json.dumps(swept.document(), allow_nan=False)


def grid(rng: Random) -> None:
    """The grid of a command line."""
    parts = [*CELLS, "k", "=", ":", ",", "k=", "1:2:3", "1000000000", "-1", "0"]
    name, values = spaced("".join(rng.choice(parts, int(rng.integers(1, 8)))))
    if not name or not np.isfinite(values).all():
        raise Defect(f"the grid {name}={values}")


# command lines

WORDS = (
    "list", "run", "verify", "extremals", "diagnose", "certify", "chart", "sweep", "trace", "move", "figure", "report",
    "rnu",
    "nowhere", "nowhere.py", "broken.py", "brachistochrone/nowhere", "measured.json", "broken.json", "folder",
    "--json", "-o", "--output", "p.png", "p.gif", "no/p.png", "--tol", "1e-8", "0", "-1", "nan", "x", "--store",
    "--cores", "--repeats", "--digits", "k=1:2:3", "g=1:2", "=", "--range", "--scenes", "--figures", "--help", "-h",
    "--version", "", " ", "\u00e9", "\x00", "*", "../..", "--certify", "--claims",
)  # fmt: skip


def command_line(rng: Random) -> None:
    """A command line; it ends with a status of its own, and whoever refuses says so on standard error."""
    Path("broken.py").write_text("problem = (", encoding="utf-8")
    Path("broken.json").write_bytes(_spoilt(rng, json.dumps(_json(rng)).encode()))
    Path("folder").mkdir(exist_ok=True)
    arguments = [str(word) for word in rng.choice(WORDS, int(rng.integers(0, 6)))]
    if arguments[:1] == ["chart"] and not {"nowhere", "nowhere.py", "broken.py", "folder"} & set(arguments):
        arguments.append("nowhere")  # without a name it would measure
    done = CliRunner().invoke(main, arguments)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise Defect(f"{arguments}: {type(done.exception).__name__}: {done.exception}")
    if done.exit_code not in STATUSES or (done.exit_code == 2 and not done.stderr.strip()):
        raise Defect(f"{arguments}: exit status {done.exit_code}, {done.output!r}")
    if done.exit_code:
        raise ValueError(done.stderr.strip().splitlines()[-1])


# formulas

UNARY: tuple[Callable[[Any], Any], ...] = (
    ca.sin, ca.cos, ca.exp, ca.tanh, ca.fabs, ca.floor, ca.sign, ca.sqrt, ca.log, lambda a: 1 / a, lambda a: -a,
    lambda a: a**2, lambda a: a**0.5, lambda a: ca.if_else(a > 0.3, a, 1),
)  # fmt: skip
BINARY: tuple[Callable[[Any, Any], Any], ...] = (
    lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b, ca.fmin, ca.fmax, lambda a, b: a**b,
)  # fmt: skip


def formula(rng: Random, depth: int = 3) -> Callable[[list[Any]], Any]:
    """A random expression of some symbols."""
    way = rng.random()
    if depth == 0 or way < 0.2:
        place, constant = int(rng.integers(1 << 16)), round(float(rng.normal()), 2)
        return lambda v: v[place % len(v)] if way < 0.15 or constant > 0 else constant
    if way < 0.5:
        one, inner = UNARY[int(rng.integers(len(UNARY)))], formula(rng, depth - 1)
        return lambda v: one(inner(v))
    two = BINARY[int(rng.integers(len(BINARY)))]
    first, second = formula(rng, depth - 1), formula(rng, depth - 1)
    return lambda v: two(first(v), second(v))


def _number(rng: Random) -> float:
    return float(rng.choice([0.0, 1.0, -1.0, 1e-9, 1e6, rng.normal(), rng.normal()]))


def lagrangian(rng: Random) -> None:
    """A problem with a random Lagrangian: an answer that stands is a number with an error, along a curve of numbers."""
    inner, weight = formula(rng), float(rng.choice([0.0, 1.0]))
    start, end = (float(v) for v in sorted(rng.normal(size=2)))
    problem = vc.Problem(
        lambda x, y, dy: inner([x, y, dy]) + weight * dy**2,
        vc.Fixed(start, _number(rng)),
        vc.Fixed(end, _number(rng)) if rng.random() < 0.8 else vc.Free(end),
        maximise=bool(rng.random() < 0.2),
    )
    solution = vc.solve(problem, tol=1e-6, throw=False)
    if not solution.status.ok:
        raise ValueError(solution.message or solution.status.value)
    if not (np.isfinite([solution.value, solution.error.value]).all() and solution.error.value >= 0):
        raise Defect(f"an answer of {solution.value} with an error of {solution.error.value}")
    if not np.isfinite(solution.y(np.linspace(*solution.interval, 33))).all():
        raise Defect("an answer whose curve is not a number everywhere")


def scene(rng: Random) -> None:
    """Rays through a random index and a random surface: those that arrived are numbers."""
    inner, dimension = formula(rng), int(rng.integers(2, 4))
    medium = optics.Graded(lambda *q: 1.5 + 0.2 * inner(list(q))) if rng.random() < 0.8 else optics.Uniform(1.3)
    surfaces: list[Any] = []
    if rng.random() < 0.5:
        place, axis = rng.normal(size=dimension), rng.normal(size=dimension)
        made = optics.Sphere(place, abs(_number(rng))) if rng.random() < 0.5 else optics.Plane(place, axis)
        surfaces.append(made)
    made_of = optics.Scene([medium, optics.Uniform(1.2)][: 1 + len(surfaces)], surfaces)
    points, directions = rng.normal(size=(2, 4, dimension))
    bundle = made_of.trace(points, directions, optical_path=abs(_number(rng)), progress=False)
    if not np.isfinite(bundle.points[bundle.arrived]).all():
        raise Defect("a ray arrived nowhere")
    if dimension == 2 and rng.random() < 0.3:
        rays = made_of.rays(points[0], points[1], within=4.0)
        if not all(np.isfinite([ray.optical_path, ray.error]).all() for ray in rays):
            raise Defect("a ray whose optical path is no number")


def system(rng: Random) -> None:
    """Motions of a random system: one that is completed is a number everywhere, and so is its error."""
    inner, n = formula(rng), int(rng.integers(1, 3))
    weight = float(rng.choice([0.0, 1.0]))
    made = mechanics.System(
        lambda t, q, v: weight * ca.sumsqr(v) / 2 + inner([t, *ca.vertsplit(q), *ca.vertsplit(v)]),
        ["first", "second"][:n],
    )
    motion = made.motion([_number(rng) for _ in range(n)], [_number(rng) for _ in range(n)], (0.0, 2.0))
    if motion.completed and not (np.isfinite(motion.q(np.linspace(0, 2, 17))).all() and np.isfinite(motion.error)):
        raise Defect(f"a completed motion that is no number, or whose error is {motion.error}")


KINDS: dict[str, Callable[[Random], None]] = {
    "profiles": profile,
    "measurements": measurements,
    "sweep stores": sweep_store,
    "grids": grid,
    "command lines": command_line,
    "lagrangians": lagrangian,
    "scenes": scene,
    "systems": system,
}
"""The kinds of inputs; each call is one, drawn anew: it raises for a refusal, and :class:`Defect` for a defect."""
