"""Random problems certified: how many, how narrowly, in what time, and whether any interval misses the truth.

    python benchmarks/certificates.py [CONVEX] [OTHER]
    python benchmarks/certificates.py references

The second command certifies the reference problems, twice each, and prints width and time. The first:

Convex: quadratics with a closed form, and functionals of which a polynomial Y is made the extremal,

    L = G(y, v) - G_y(Y, Y') y - G_v(Y, Y') v + P v + P' y,

G a random sum of convex terms and P a polynomial. Not convex: actions of oscillators up to a conjugate point (and
beyond, where nothing may be proved), and G with a potential that bends down, by less than Poincaré's inequality
allows, so that Y is a minimum. The truth is taken in 40 digits at the doubles of the problem, by Gauss's quadrature
of the instructions as they are written in mpmath, which shares with the proof but the reading of these. Lines are
added to ``records/certificates.csv``; a run goes on where the last one stopped. Then soap films are followed to their
fold and an oscillator to its conjugate point, and the chart is drawn.
"""

from __future__ import annotations

import csv
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import mpmath
import numpy as np

import varcalc as vc
from varcalc.certificates import ProvedInterval
from varcalc.study.reference import catalogue, load
from varcalc.symbolic.instructions import Program
from varcalc.symbolic.tracing import as_written

DIGITS = 40
NODES = 64
RECORD = Path(__file__).parent / "records" / "certificates.csv"
CHART = Path(__file__).parent.parent / "docs" / "certificates.png"
COLUMNS = ["family", "seed", "outcome", "width", "solve", "certify", "reason"]


def quadratic(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int (a v^2 + b y^2)/2 from 0 to Y in T: sqrt(a b) coth(sqrt(b/a) T) Y^2/2."""
    a, b, T, Y = 10 ** random.uniform(-2, 2, 4)
    problem = vc.Problem(
        lambda x, y, v, p: (p.a * v**2 + p.b * y**2) / 2, vc.Fixed(0, 0), vc.Fixed(T, Y), parameters={"a": a, "b": b}
    )
    A, B, t, h = map(mpmath.mpf, (a, b, T, Y))
    return problem, mpmath.sqrt(A * B) * mpmath.coth(mpmath.sqrt(B / A) * t) * h**2 / 2


def oscillator(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int (v^2 - y^2)/2 from 0 to Y in T: Y^2 cot(T)/2 for T < pi, and no minimum beyond."""
    T, Y = random.uniform(0.1, 4.0), random.uniform(-2, 2)
    problem = vc.Problem(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(T, Y))
    return problem, mpmath.mpf(Y) ** 2 * mpmath.cot(mpmath.mpf(T)) / 2 if mpmath.pi > T else None


MEASURED: dict[int, Callable[..., Any]] = {
    ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b, ca.OP_NEG: lambda a: -a, ca.OP_SQ: lambda a: a * a, ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_INV: lambda a: 1 / a, ca.OP_SQRT: mpmath.sqrt, ca.OP_EXP: mpmath.exp, ca.OP_LOG: mpmath.log,
    ca.OP_SIN: mpmath.sin, ca.OP_COS: mpmath.cos, ca.OP_COSH: mpmath.cosh, ca.OP_SINH: mpmath.sinh,
    ca.OP_CONSTPOW: lambda a, b: a**b, ca.OP_POW: lambda a, b: a**b, ca.OP_ASSIGN: lambda a: a,
    ca.OP_TANH: mpmath.tanh,
}  # fmt: skip
"""The operations of the families in mpmath."""


def legendre(t: Any) -> tuple[Any, Any]:
    """Legendre's polynomial of degree NODES and its derivative."""
    before, now = mpmath.mpf(1), t
    for k in range(2, NODES + 1):
        before, now = now, ((2 * k - 1) * t * now - (k - 1) * before) / k
    return now, NODES * (before - t * now) / (1 - t * t)


@lru_cache(maxsize=1)
def gauss() -> list[tuple[Any, Any]]:
    """Gauss's nodes and weights on [0, 1]."""
    found = []
    for k in range(NODES):
        t = mpmath.cos(mpmath.pi * (k + mpmath.mpf(3) / 4) / (NODES + mpmath.mpf(1) / 2))
        for _ in range(6):
            value, slope = legendre(t)
            t -= value / slope
        found.append(((1 + t) / 2, 1 / ((1 - t * t) * legendre(t)[1] ** 2)))
    return found


def polynomial(c: np.ndarray, x: Any, k: int = 0) -> Any:
    """The k-th derivative of the polynomial of coefficients c."""
    for _ in range(k):
        c = c[1:] * np.arange(1, len(c))
    total = 0.0
    for v in c[::-1]:
        total = total * x + float(v)
    return total


CONVEX = [
    lambda y, v: v**4,
    lambda y, v: ca.sqrt(1 + v**2),
    lambda y, v: y**4,
    lambda y, v: ca.exp(y),
    lambda y, v: ca.cosh(y),
    lambda y, v: (y - v) ** 2,
    lambda y, v: ca.sqrt(1 + y**2 + v**2),
    lambda y, v: ca.cosh(v / 2),
    lambda y, v: y**2,
    lambda y, v: ca.log(ca.exp(y) + ca.exp(-y)),
    lambda y, v: (1 + y**2) ** 1.5,
]
"""Terms that are convex in y and v together."""
BENDING = [
    lambda y, v: ca.cos(y),
    lambda y, v: -(y**2) / 2,
    lambda y, v: ca.sin(y),
    lambda y, v: -ca.log(1 + y**2) / 2,
    lambda y, v: 1 / (1 + y**2) / 2,
]
"""Potentials whose second derivatives lie above -1."""


def integrated(rate: Callable[[Any], Any]) -> Any:
    """An integral over [0, 1] by Gauss's quadrature, on panels cut until two results agree."""
    before, panels = None, 1
    while True:
        now = sum(w * rate((k + x) / panels) for k in range(panels) for x, w in gauss()) / panels
        if before is not None and abs(now - before) <= mpmath.mpf(10) ** -35 * (1 + abs(now)):
            return now
        before, panels = now, 2 * panels


def made(random: np.random.Generator, *, convex: bool) -> tuple[vc.Problem, Any]:
    """A problem with a polynomial for its minimiser; its value by Gauss's quadrature."""
    # so short that sums of them are doubles: the curve meets its ends exactly
    Y, P = random.integers(-64, 65, random.integers(2, 6)) / 64, random.integers(-64, 65, 3) / 64
    count = random.integers(1, 4)
    terms = [CONVEX[k] for k in random.integers(0, len(CONVEX), count)]
    weights = 10 ** random.uniform(-1, 1, count)
    stiff = float(10 ** random.uniform(-1, 1))
    down, drop = BENDING[random.integers(0, len(BENDING))], float(random.uniform(0.1, 8.0)) * stiff

    def G(y: Any, v: Any) -> Any:
        total = stiff * v**2 / 2 + sum(float(w) * term(y, v) for w, term in zip(weights, terms, strict=True))
        return total if convex else total + drop * down(y, v)

    y, v = ca.SX.sym("y"), ca.SX.sym("v")
    slopes = ca.Function("slopes", [y, v], [ca.gradient(G(y, v), y), ca.gradient(G(y, v), v)])

    def lagrangian(x: Any, y: Any, v: Any) -> Any:
        by_y, by_v = slopes(polynomial(Y, x), polynomial(Y, x, 1))
        return G(y, v) - by_y * y - by_v * v + polynomial(P, x) * v + polynomial(P, x, 1) * y

    with as_written():
        traced = Program(ca.Function("L", symbols := [ca.SX.sym(n) for n in "xyv"], [lagrangian(*symbols)]))

    def rate(x: Any) -> Any:
        return traced.run([[x], [polynomial(Y, x)], [polynomial(Y, x, 1)]], mpmath.mpf, measured)[0][0]

    value = integrated(rate)
    ends = vc.Fixed(0, polynomial(Y, 0.0)), vc.Fixed(1, polynomial(Y, 1.0))
    return vc.Problem(lagrangian, *ends), value


def measured(operation: int, operands: Any) -> Any:
    """An operation in mpmath."""
    return MEASURED[operation](*operands)


def sliding(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """Distance of the origin from y = a - b x - c x^2, c > 0: a root of the footpoint's equation."""
    a, b, c = float(random.uniform(1, 2)), float(random.uniform(0.5, 2)), float(random.uniform(0, 0.5))
    A, B, C = map(mpmath.mpf, (a, b, c))
    height = lambda x: A - B * x - C * x * x  # noqa: E731  short
    x = mpmath.findroot(lambda x: x + height(x) * (-B - 2 * C * x), A * B / (1 + B * B))
    end = vc.OnCurve(lambda x, y: y - (a - b * x - c * x**2), x=float(x) * 1.1)
    return vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2), vc.Fixed(0, 0), end), mpmath.hypot(x, height(x))


def tied(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int s v^2 over [0, 1] with a convex quadratic cost of both ends: a line, its ends from two equations."""
    s, p, q, r, g, h = (float(v) for v in random.uniform(0.1, 2.0, 6))
    r *= 0.9 * min(p, q) * float(random.choice([-1, 1])) / 2.0

    def cost(x0: Any, y0: Any, x1: Any, y1: Any) -> Any:
        return p * y0**2 + q * y1**2 + r * y0 * y1 + g * y0 - h * y1

    S, P, Q, R, G, H = map(mpmath.mpf, (s, p, q, r, g, h))
    y0, y1 = mpmath.lu_solve(
        mpmath.matrix([[2 * S + 2 * P, R - 2 * S], [R - 2 * S, 2 * S + 2 * Q]]), mpmath.matrix([-G, H])
    )
    problem = vc.Problem(lambda x, y, v: s * v**2, vc.Free(0), vc.Free(1), end_cost=cost)
    return problem, S * (y1 - y0) ** 2 + P * y0**2 + Q * y1**2 + R * y0 * y1 + G * y0 - H * y1


def waypoint(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int v^2 +- y^2 from 0 to Y in T through (t, h): each part has a closed form; no part is longer than 3."""
    sign = float(random.choice([-1, 1]))
    t, rest, h, Y = (float(v) for v in random.uniform([0.2, 0.2, -2, -2], [3, 3, 2, 2]))
    T = t + rest
    part, other = mpmath.mpf(t), mpmath.mpf(T) - mpmath.mpf(t)
    tan, sin = (mpmath.tanh, mpmath.sinh) if sign > 0 else (mpmath.tan, mpmath.sin)
    H, E = mpmath.mpf(h), mpmath.mpf(Y)
    value = H * H / tan(part) + (H * H + E * E) / tan(other) - 2 * H * E / sin(other)
    way = [vc.Through(t, h)]
    return vc.Problem(lambda x, y, v: v**2 + sign * y**2, vc.Fixed(0, 0), vc.Fixed(T, Y), way), value


def ceiling(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int v^2/2 - f y over [0, T] with y <= h: parabolas that reach it after sqrt(2 h/f), or one that does not."""
    f, T, h = (float(v) for v in random.uniform([0.5, 0.5, 0.02], [8, 3, 1]))
    F, L, H = map(mpmath.mpf, (f, T, h))
    c = mpmath.sqrt(2 * H / F)
    side = F * F * c**3 / 3 - F * H * c
    value = 2 * side - F * H * (L - 2 * c) if 2 * c < L else -F * F * L**3 / 24
    bound = [vc.Bound(lambda x, y, v: y, upper=h)]
    return vc.Problem(lambda x, y, v: v**2 / 2 - f * y, vc.Fixed(0, 0), vc.Fixed(T, 0), bound), value


def eigenvalue(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """Of int p v^2 + q y^2 under int w y^2 = 1: pi^2 + c, with y = m sin(pi x) for m = exp(a sin(b x)).

    With y = m s and p = w = 1/m^2, q = ((log m)'' - (log m)'^2 + c)/m^2, it is int s'^2 + c s^2 over int s^2.
    """
    a, b, c = random.uniform(-1, 1), random.uniform(0.5, 6), random.choice([0.0, random.uniform(-40, 40)])

    def weight(x: Any, p: Any) -> Any:
        return ca.exp(-2 * p.a * ca.sin(p.b * x))

    def energy(x: Any, y: Any, v: Any, p: Any) -> Any:
        slope, bend = p.a * p.b * ca.cos(p.b * x), -p.a * p.b**2 * ca.sin(p.b * x)
        return weight(x, p) * (v**2 + (bend - slope**2 + p.c) * y**2)

    norm = vc.Isoperimetric(lambda x, y, v, p: weight(x, p) * y**2, 1.0)
    parameters = {"a": float(a), "b": float(b), "c": float(c)}
    return vc.Problem(energy, vc.Fixed(0, 0), vc.Fixed(1, 0), [norm], parameters=parameters), mpmath.pi**2 + c


def spectrum(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """The four lowest eigenvalues of :func:`eigenvalue`: (k pi)^2 + c."""
    problem, lowest = eigenvalue(random)
    return problem, [lowest + (k * k - 1) * mpmath.pi**2 for k in range(1, 5)]


def kinked(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """A flat top under k |v|, or a dead core under k |y| between heights h: parabolas, and a line where L has a kink.

    int v^2/2 + k |v| - f y between zeros is -f^2 c^3/3, c = (T - 2 k/f)/2; int v^2/2 + k |y| is 2 k^2 c^3/3,
    c = sqrt(2 h/k).
    """
    k, f, h = (float(v) for v in random.uniform([0.1, 1.0, 0.1], [2.0, 20.0, 2.0]))
    K, F, H = map(mpmath.mpf, (k, f, h))
    if random.random() < 0.5:
        T = 2 * k / f * float(random.uniform(1.2, 6.0))
        value = -(F**2) * ((mpmath.mpf(T) - 2 * K / F) / 2) ** 3 / 3
        return vc.Problem(lambda x, y, v: v**2 / 2 + k * ca.fabs(v) - f * y, vc.Fixed(0, 0), vc.Fixed(T, 0)), value
    T = 2 * float(np.sqrt(2 * h / k)) * float(random.uniform(1.1, 3.0))
    value = 2 * K**2 * mpmath.sqrt(2 * H / K) ** 3 / 3
    return vc.Problem(lambda x, y, v: v**2 / 2 + k * ca.fabs(y), vc.Fixed(0, h), vc.Fixed(T, h)), value


def unequal(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int v^2/2 over [0, T] between zeros with an area of c at least, at most, or beside what is asked: 6 c^2/T^3."""
    T, c, way = float(random.uniform(0.3, 3.0)), float(random.uniform(0.05, 2.0)), int(random.integers(0, 3))
    limits = [{"lower": c}, {"upper": -c}, {"lower": -c, "upper": 2 * c}][way]
    level = vc.Isoperimetric(lambda x, y, v: y, **limits)
    value = 6 * mpmath.mpf(c) ** 2 / mpmath.mpf(T) ** 3 if way < 2 else mpmath.mpf(0)
    return vc.Problem(lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Fixed(T, 0), [level]), value


def bounded(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """A load with slopes within a, or an area c under a ceiling h: straight lines, and parabolas between them.

    int v^2/2 - f y between zeros is int v^2/2 - f (T/2 - x) v, v = f (T/2 - x) cut at a; int v^2/2 over an area c is
    (2 h/s^2)^2 s^3/3 where the ceiling is reached at s = 3/2 (T - c/h).
    """
    T, h = (float(v) for v in random.uniform([0.5, 0.1], [3, 1]))
    L, H = map(mpmath.mpf, (T, h))
    if random.random() < 0.5:
        f = float(random.uniform(1.05, 8.0)) * 2 * h / T
        F = mpmath.mpf(f)
        s = L / 2 - H / F
        value = H**2 * s - F * H * s * (L - s) - F**2 * (L / 2 - s) ** 3 / 3
        slopes = [vc.Bound(lambda x, y, v: v, lower=-h, upper=h)]
        return vc.Problem(lambda x, y, v: v**2 / 2 - f * y, vc.Fixed(0, 0), vc.Fixed(T, 0), slopes), value
    c = float(random.uniform(0.7, 0.98)) * h * T
    s = (L - mpmath.mpf(c) / H) * 3 / 2
    held = [vc.Bound(lambda x, y, v: y, upper=h), vc.Isoperimetric(lambda x, y, v: y, c)]
    return vc.Problem(lambda x, y, v: v**2 / 2, vc.Fixed(0, 0), vc.Fixed(T, 0), held), (2 * H / s**2) ** 2 * s**3 / 3


def sphere(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """The least energy between two points of a sphere, which whole numbers lie on exactly: (angle times radius)^2/2."""
    m, n, p, q = (int(v) for v in random.integers(1, 5, 4))
    radius, point = (
        m * m + n * n + p * p + q * q,
        (m * m + n * n - p * p - q * q, 2 * (m * q + n * p), 2 * (n * q - m * p)),
    )
    other, inner = point, radius**2
    while abs(inner) == radius**2:
        other = tuple(int(s) * point[k] for s, k in zip(random.choice([-1, 1], 3), random.permutation(3), strict=True))
        inner = sum(a * b for a, b in zip(point, other, strict=True))
    held = [vc.Holonomic(lambda x, y: ca.sumsqr(y) - radius**2)]
    problem = vc.Problem(lambda x, y, v: ca.sumsqr(v) / 2, vc.Fixed(0, point), vc.Fixed(1, other), held)
    return problem, (radius * mpmath.acos(mpmath.mpf(inner) / radius**2)) ** 2 / 2


def ring(random: np.random.Generator) -> tuple[vc.Curve, Any]:
    """The area that a length encloses in a metric that is the same everywhere, or the length round an area."""
    a, b, c, level = (float(v) for v in random.uniform([0.7, 0.7, -0.2, 0.3], [1.5, 1.5, 0.2, 3.0]))
    free, size = vc.Periodic(), 4 * mpmath.pi * mpmath.sqrt(mpmath.mpf(a) * b - mpmath.mpf(c) ** 2)

    def length(q: Any, v: Any) -> Any:
        return ca.sqrt(a * v[0] ** 2 + b * v[1] ** 2 + 2 * c * v[0] * v[1])

    def area(q: Any, v: Any) -> Any:
        return (q[0] * v[1] - q[1] * v[0]) / 2

    if random.random() < 0.5:
        problem = vc.Curve(area, free, free, [vc.Isoperimetric(length, level)], maximise=True)
        return problem, mpmath.mpf(level) ** 2 / size
    return vc.Curve(length, free, free, [vc.Isoperimetric(area, level)]), mpmath.sqrt(size * level)


def powered(random: np.random.Generator) -> tuple[vc.Problem, Any]:
    """int k u^-s ds from the line u = 0: u = a sin(phi)^(1/s), and incomplete beta functions for all else."""
    s, across, depth, k = (float(v) for v in random.uniform([0.1, 0.3, 0.3, 0.2], [0.8, 4.0, 3.0, 5.0]))
    problem = vc.Problem(lambda x, y, v: k * y**-s * ca.sqrt(1 + v**2), vc.Fixed(0, 0), vc.Fixed(across, depth))
    X, m = mpmath.mpf(across), 1 / mpmath.mpf(s)

    def sines(power: Any, angle: Any) -> Any:
        """The integral of sin^power from 0 to an angle."""
        p, q = (power + 1) / 2, mpmath.mpf(1) / 2
        part = mpmath.betainc(p, q, 0, mpmath.sin(angle) ** 2) / 2
        return part if angle <= mpmath.pi / 2 else mpmath.beta(p, q) - part

    def missed(angle: Any) -> Any:
        return m * sines(m, angle) / mpmath.sin(angle) ** m - X / depth

    angle = mpmath.findroot(missed, (0.001, 3.141), "anderson", tol=1e-70, maxsteps=1000)
    return problem, k * m * (X / (m * sines(m, angle))) ** (1 - mpmath.mpf(s)) * sines(m - 2, angle)


FAMILIES: dict[str, Callable[[np.random.Generator], tuple[Any, Any]]] = {
    "quadratic": quadratic,
    "convex": lambda random: made(random, convex=True),
    "oscillator": oscillator,
    "bending": lambda random: made(random, convex=False),
    "sliding": sliding,
    "tied": tied,
    "waypoint": waypoint,
    "ceiling": ceiling,
    "eigenvalue": eigenvalue,
    "kinked": kinked,
    "unequal": unequal,
    "spectrum": spectrum,
    "sphere": sphere,
    "bounded": bounded,
    "ring": ring,
    "powered": powered,
}
"""The families by name; of the first two all are convex."""
MORE, FEW = 100, 40
"""Problems of each of the other families, and of the last two, which take longest."""


def outcome(family: str, seed: int) -> dict[str, Any]:
    """What becomes of one problem."""
    problem, exact = FAMILIES[family](np.random.default_rng([list(FAMILIES).index(family), seed]))
    row: dict[str, Any] = {"family": family, "seed": seed}
    began = time.process_time()
    try:
        if isinstance(exact, list):
            proofs = vc.certify_eigenvalues(problem, len(exact))
        else:
            solution = vc.solve(problem)
            row["solve"], began = f"{time.process_time() - began:.4f}", time.process_time()
            proofs, exact = [vc.certify(solution)], [exact]
    except (vc.VariationalError, ArithmeticError) as refusal:
        told = "refused" if "solve" in row or isinstance(exact, list) else "not solved"
        return row | {"outcome": "refused, rightly" if exact is None else told, "reason": str(refusal)}
    row |= {"certify": f"{time.process_time() - began:.4f}"}
    row |= {"width": f"{max(p.width / max(abs(p.lower), 1e-300) for p in proofs):.2e}"}
    if exact == [None]:
        return row | {"outcome": "PROVED WHAT IS FALSE"}
    scope = proofs[0].scope.name.lower() if isinstance(proofs[0], vc.Certificate) else "all"
    held = all(holds(*pair) for pair in zip(proofs, exact, strict=True))
    return row | {"outcome": f"certified, {scope}" if held else "MISSED THE TRUTH"}


def holds(proved: ProvedInterval, exact: Any) -> bool:
    """Whether a number of many digits lies in an interval."""
    low, high = (mpmath.mpf(f.numerator) / f.denominator for f in map(Fraction, proved.enclosure))
    # the quadrature's own error, far below the width of any interval
    room = mpmath.mpf(10) ** -33 * (1 + abs(exact))
    return bool(low - room <= exact <= high + room)


def records() -> list[dict[str, str]]:
    """The lines of the record."""
    if not RECORD.exists():
        return []
    with RECORD.open(newline="") as file:
        return list(csv.DictReader(file))


def campaign(family: str, count: int) -> None:
    """Add what the record lacks of a family."""
    known = {int(row["seed"]) for row in records() if row["family"] == family}
    fresh = not RECORD.exists()
    with RECORD.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if fresh:
            writer.writeheader()
        for seed in range(count):
            if seed not in known:
                writer.writerow(outcome(family, seed))
                file.flush()


def summary() -> Iterator[str]:
    """The counts of each family, widths and times."""
    for family in FAMILIES:
        rows = [row for row in records() if row["family"] == family]
        sure = [row for row in rows if row["outcome"].startswith("certified")]
        if not sure:
            continue
        counts = dict(Counter(row["outcome"] for row in rows))
        widths, times = ([float(row[key]) for row in sure] for key in ("width", "certify"))
        spread = f"median width {np.median(widths):.1e}, {1e3 * np.median(times):.0f} ms, worst {max(times):.2f} s"
        yield f"{family}: {counts}; {spread}"


def references() -> None:
    """Certify the reference problems and print a line for each, then medians; times are the better of two."""
    widths, times = [], []
    for reference in (r for name in catalogue() for r in load(name)):
        solution, spent = vc.solve(reference.problem), []
        try:
            for _ in range(2):
                began = time.process_time()
                certificate = vc.certify(solution)
                spent.append(time.process_time() - began)
        except vc.VariationalError as refusal:
            print(f"{reference.name:32s} {refusal}")
            continue
        widths.append(certificate.width / (abs(certificate.upper) or 1.0))
        times.append(min(spent))
        print(f"{reference.name:32s} {widths[-1]:8.1e} {1e3 * times[-1]:7.1f} ms  {certificate.scope.value}")
    spread = f"median width {np.median(widths):.1e}, widest {max(widths):.1e}"
    print(f"{len(times)} certified: {spread}; median {1e3 * np.median(times):.1f} ms, worst {max(times):.2f} s")


def near(problems: Iterator[tuple[float, vc.Problem]]) -> list[tuple[float, float, float]]:
    """Distances, widths (not a number where refused) and times as something ceases to exist."""
    found = []
    for distance, problem in problems:
        began = time.process_time()
        width = np.nan
        try:
            solution = vc.solve(problem, vc.Collocation())
            began = time.process_time()
            certificate = vc.certify(solution)
            width = certificate.width / abs(certificate.lower)
        except vc.VariationalError as refusal:
            print(f"{distance:.1e}: {refusal}")
        found.append((distance, width, time.process_time() - began))
    return found


def films() -> Iterator[tuple[float, vc.Problem]]:
    """Soap films towards the fold at 0.6627434193491815..., which 13 digits are given of."""
    for k in np.arange(2, 8.5, 0.5):
        a = 0.66274341934918 - 10.0**-k
        yield 10.0**-k, vc.Problem(lambda x, y, v: y * ca.sqrt(1 + v**2), vc.Fixed(-a, 1), vc.Fixed(a, 1))


def swings() -> Iterator[tuple[float, vc.Problem]]:
    """Oscillators for a time pi - 10^-k."""
    for k in np.arange(1, 6.5, 0.5):
        yield 10.0**-k, vc.Problem(lambda x, y, v: (v**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(np.pi - 10.0**-k, 1))


def chart() -> None:
    """Width and time near a fold and near a conjugate point."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 6.5), layout="constrained")
    names = {"soap film before its fold": films, "oscillator before its conjugate point": swings}
    for marker, (name, family) in zip("os", names.items(), strict=True):
        distances, widths, times = np.array(near(family())).T
        (line,) = above.loglog(distances, widths, marker, ls="-", label=name)
        below.loglog(distances, 1e3 * times, marker, ls="-", color=line.get_color())
        refused = np.isnan(widths)
        below.loglog(distances[refused], 1e3 * times[refused], marker, ms=11, mfc="none", color=line.get_color())
        for d, w, t in zip(distances, widths, times, strict=True):
            print(f"{name}: {d:.1e}, width {w:.1e}, {1e3 * t:.0f} ms")
    above.set_ylabel("relative width of the interval")
    below.set_ylabel("time to certify (ms); ringed: refused")
    below.set_xlabel("distance from the fold, or from the conjugate point")
    below.invert_xaxis()
    above.legend(frameon=False)
    figure.savefig(CHART, dpi=110)


def main(convex: int, other: int) -> None:
    """Add to the record, print the counts of each family, and draw the chart."""
    with mpmath.workdps(DIGITS):
        counts = [convex // 2, convex - convex // 2, other // 2, other - other // 2]
        counts += [MORE] * (len(FAMILIES) - 6) + [FEW, FEW]
        for family, count in zip(FAMILIES, counts, strict=True):
            campaign(family, count)
    for line in summary():
        print(line)
    chart()


if __name__ == "__main__":
    if sys.argv[1:] == ["references"]:
        references()
    else:
        main(*map(int, sys.argv[1:3] or (10_000, 2_000)))
