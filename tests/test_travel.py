"""Problems, solutions and rays that are pickled, copied and sent to other processes."""

import copy
import multiprocessing
import pickle
import subprocess
import sys
from functools import cache

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc import optics
from varcalc.numerics.resampled import polynomials, resampled
from varcalc.symbolic.derived import Cache


def sent(given):
    return pickle.loads(pickle.dumps(given))


@pytest.fixture(params=[sent, copy.deepcopy], ids=["pickle", "deepcopy"])
def travelled(request):
    return request.param


def table():
    """Data that CasADi evaluates with MX symbols only."""
    x = ca.MX.sym("x")
    return ca.Function("table", [x], [ca.interpolant("data", "linear", [[0, 0.5, 1]], [1, 2, 4])(x)])


data = table()
PROBLEMS = {
    "a fall with parameters": vc.Problem(
        lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), vc.Fixed(0, 0), vc.Fixed(1, vc.Parameter("h")),
        parameters={"g": 9.81, "h": 1.0},
    ),
    "a chain": vc.Problem(
        lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(0, 1), vc.Fixed(1, 1),
        [vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 1.5)],
    ),
    "an obstacle": vc.Problem(
        lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(-1, 0), vc.Fixed(1, 0),
        [vc.Bound(lambda x, y, dy: y + x**2, lower=0.5)],
    ),
    "a sphere": vc.Curve(
        lambda q, dq: ca.sqrt(ca.sumsqr(dq)), vc.At([1, 0, 0]), vc.At([0, 1, 0]),
        [vc.Holonomic(lambda q: ca.sumsqr(q) - 1)],
    ),
    "a curve to slide on": vc.Problem(
        lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.OnCurve(lambda x, y: y - 2 + x, 1.0)
    ),
    "a surface to slide on": vc.Curve(
        lambda q, dq: ca.sqrt(ca.sumsqr(dq)), vc.At([0, 0]), vc.OnSurface(lambda q: q[0] + q[1] - 2, [1, 0.5])
    ),
    "a beam": vc.Problem(lambda x, y, dy, ddy: ddy**2 / 2 + y, vc.Fixed(0, 0, 0), vc.Fixed(1, 0, 0), order=2),
    "a maximum": vc.Problem(lambda x, y, dy: y - dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), maximise=True, name="hill"),
    "a jump and a waypoint": vc.Problem(
        lambda x, y, dy: ca.if_else(x < 0.5, 1, 3) * dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), [vc.Through(0.7, 0.2)],
        breakpoints=[0.5],
    ),
    "costs and unknowns": vc.Problem(
        lambda x, y, dy, p: dy**2 + (p.a - p.k) ** 2 + p.a * y, vc.Free(0), vc.Fixed(1, 1), parameters={"k": 2.0},
        unknowns={"a": 1.0}, end_cost=lambda x0, y0, x1, y1, p: p.k * y0**2,
    ),
    "measured data": vc.Problem(lambda x, y, dy: dy**2 + data(x) * y, vc.Fixed(0, 0), vc.Fixed(1, 1)),
    "several functions": vc.Problem(
        lambda x, y, dy: ca.sumsqr(dy) + y[0] * y[1], vc.Fixed(0, [0, 1]), vc.Fixed(1, [1, None])
    ),
    "corners": vc.Problem(lambda x, y, dy: (dy**2 - 1) ** 2, vc.Fixed(0, 0), vc.Fixed(1, 0.5)),
}  # fmt: skip
INSIDE = np.linspace(0.03, 0.9, 7)


@cache
def solved(name):
    """The solution of one of the problems, found once."""
    return vc.solve(PROBLEMS[name])


@pytest.mark.parametrize("name", [name for name in PROBLEMS if name != "corners"])  # which are the solution's
def test_a_problem_read_back_solves_to_the_same_digits(name, travelled):
    problem = PROBLEMS[name]
    back = travelled(problem)
    assert type(back) is type(problem)
    assert back.symbols.kind is problem.symbols.kind
    assert repr(back) == repr(problem) or "0x" in repr(problem)
    there, here = vc.solve(back), solved(name)
    assert there.value == here.value
    assert there.error == here.error
    assert np.array_equal(there.curve(INSIDE, 0), here.curve(INSIDE, 0))


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_solution_read_back(name, travelled):
    solution = solved(name)
    back = travelled(solution)
    assert (back.value, back.error, back.status, back.method) == (
        solution.value, solution.error, solution.status, solution.method,
    )  # fmt: skip
    for k in (0, 1):
        assert back.curve(INSIDE, k) == pytest.approx(solution.curve(INSIDE, k), rel=1e-12, abs=1e-12)
    assert dict(back.sensitivities) == pytest.approx(dict(solution.sensitivities))
    assert back.unknowns == solution.unknowns
    for there, here in zip(back.multipliers, solution.multipliers, strict=True):
        if callable(here):
            assert there(INSIDE) == pytest.approx(here(INSIDE), abs=1e-9)
        else:
            assert there == here


@pytest.mark.parametrize("name", ["a fall with parameters", "a chain", "a sphere", "a curve to slide on", "corners"])
def test_what_verify_says_of_a_solution_read_back(name, travelled):
    solution = solved(name)
    here, there = vc.verify(solution), travelled(vc.verify(travelled(solution)))
    assert (there.verdict, there.index) == (here.verdict, here.index)
    assert there.bound == pytest.approx(here.bound, rel=1e-13)
    assert travelled(here).weierstrass.at == here.weierstrass.at


@pytest.mark.parametrize("method", [vc.Collocation(), vc.Shooting(), vc.FirstIntegral()])
@pytest.mark.parametrize("name", ["a fall with parameters", "a chain"])
def test_curves_of_every_method(name, method):
    solution = vc.solve(PROBLEMS[name], method)
    back = sent(solution)
    for k in (0, 1):
        assert back.curve(INSIDE, k) == pytest.approx(solution.curve(INSIDE, k), rel=1e-12)
    ends = solution.x[[0, -1]]
    assert np.array_equal(back.curve(ends, 1), solution.curve(ends, 1))
    assert vc.verify(back).verdict is vc.verify(solution).verdict


def test_parameters_of_a_problem_read_back():
    problem = PROBLEMS["a fall with parameters"]
    moved = problem.with_parameters({"h": 2.0})
    back, there = sent((problem, moved))
    assert there.templates is back.templates  # copies of one problem stay copies of one
    assert there.cache is back.cache
    again = back.with_parameters({"h": 2.0})
    values = [vc.solve(p).value for p in (moved, there, again)]
    assert values[0] == values[1] == values[2]
    assert vc.solve(there, guess=vc.solve(back)).value == pytest.approx(values[0], rel=1e-10)


def test_caches_stay():
    problem = PROBLEMS["a chain"]
    vc.solve(problem)
    assert problem.cache.products
    assert not sent(problem.cache).products
    assert isinstance(copy.deepcopy(problem.cache), Cache)


@pytest.fixture(scope="module")
def compared():
    return vc.compare(PROBLEMS["a chain"], [vc.Ritz(), vc.Collocation(), None])


@pytest.fixture(scope="module")
def extremals():
    film = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
    return vc.extremals(film)


def test_comparisons_and_extremals(travelled, compared, extremals):
    assert travelled(compared).table() == compared.table()
    back = travelled(extremals)
    assert (repr(back), back.windings, back.complete) == (repr(extremals), extremals.windings, extremals.complete)
    assert [film.index for film in back] == [0, 1]


SCENES = {
    "a Luneburg lens": (optics.Scene(optics.luneburg()), (-0.8, 0.6), (1.0, 0.0)),
    "a graded index": (optics.Scene(optics.Graded(lambda x, y: 1 + 0.3 * ca.exp(-(x**2) - y**2))), (-2, 0.1), (2, 0)),
    "layers": (
        optics.Scene(optics.Stratified(lambda h, p: 1.5 + p.a * ca.tanh(h), parameters={"a": 0.1})),
        (0.0, 0.0), (3.0, 0.2),
    ),
    "a surface": (
        optics.Scene(
            [optics.Uniform(1.0), optics.Uniform(1.5)],
            [optics.Implicit(lambda x, y, p: x - p.k * y**2, parameters={"k": 0.1})],
        ),
        (-1.0, 0.0), (1.0, 0.5),
    ),
}  # fmt: skip


@cache
def rays_of(name):
    scene, a, b = SCENES[name]
    return scene.rays(a, b)


@pytest.mark.parametrize("name", SCENES)
def test_scenes_rays_and_bundles(name, travelled):
    scene, a, b = SCENES[name]
    back, rays = travelled(scene), rays_of(name)
    assert [ray.optical_path for ray in back.rays(a, b)] == [ray.optical_path for ray in rays]
    some = type(rays)(rays.found[:2], rays.reason, rays.searched)
    for there, here in zip(travelled(some), some, strict=True):
        paths = np.linspace(0.0, here.optical_path, 9)
        assert there.point(paths) == pytest.approx(here.point(paths), abs=1e-12)
        assert there.conjugate_points == pytest.approx(here.conjugate_points)
        assert there.derivatives == pytest.approx(here.derivatives)
        assert there.index == here.index
    traced = scene.trace(a, (1.0, 0.1), optical_path=0.5)
    assert np.array_equal(travelled(traced).points, traced.points)


def test_another_process_solves_and_evaluates(tmp_path):
    problem = PROBLEMS["a fall with parameters"]
    solution, (scene, a, b) = vc.solve(problem), SCENES["a graded index"]
    (tmp_path / "given").write_bytes(pickle.dumps((problem, solution, scene)))
    code = f"""
import pathlib, pickle, varcalc as vc
problem, solution, scene = pickle.loads(pathlib.Path({str(tmp_path / "given")!r}).read_bytes())
found = vc.solve(problem), solution
print(found[0].value == found[1].value, vc.verify(solution).verdict.name, repr(solution.y(0.5)))
print(repr(scene.rays({a}, {b})[0].optical_path))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    first, second = done.stdout.splitlines()
    assert first.split() == ["True", vc.verify(solution).verdict.name, *repr(solution.y(0.5)).split()]
    assert second == repr(scene.rays(a, b)[0].optical_path)


def test_processes_share_the_work():
    problem = PROBLEMS["a fall with parameters"]
    given = [problem.with_parameters({"h": h}) for h in (1.0, 1.5)]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        found = pool.map(vc.solve, given)
    assert [s.value for s in found] == [vc.solve(p).value for p in given]


def test_polynomials_of_functions_that_are_infinite_or_have_kinks():
    def curve(x, k):
        with np.errstate(divide="ignore"):
            return np.array([np.sqrt(x) if k == 0 else 0.5 / np.sqrt(x), np.abs(x - 0.3) if k == 0 else np.sign(x)])

    held = resampled(curve, [0.0, 0.5, 1.0], 2)
    x = np.linspace(0, 1, 301) ** 2
    assert held(x, 0) == pytest.approx(curve(x, 0), abs=1e-9)
    assert held(x[1:], 1)[0] == pytest.approx(curve(x[1:], 1)[0], rel=1e-12)
    assert held(np.zeros(1), 1)[0] == np.inf


def test_noise_is_not_resolved():
    rng = np.random.default_rng(0)
    held = polynomials(lambda x: np.sin(x)[None] + 1e-9 * rng.standard_normal(len(x)), np.array([0.0, 1.0]))
    assert len(held.edges) < 2000
    assert held(np.array([0.4]))[0] == pytest.approx(np.sin(0.4), abs=1e-6)
