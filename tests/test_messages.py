"""What a person is told who writes it wrongly: one sentence, with what to write instead."""

import math
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction

import casadi as ca
import mpmath
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import varcalc as vc
from varcalc import mechanics, optics

START, END = vc.Fixed(0, 0), vc.Fixed(1, 1)


def of_ends(lagrangian, start=START, end=END, **options):
    return vc.Problem(lagrangian, start, end, **options)


def length(x, y, dy):
    return ca.sqrt(1 + dy**2)


def with_g(lagrangian):
    return of_ends(lagrangian, parameters={"g": 1.0})


def in_plane(lagrangian):
    return of_ends(lagrangian, vc.Fixed(0, [0, 0]), vc.Fixed(1, [1, 1]))


def if_of_a_symbol(x, y, dy):
    return dy**2 if y > 0 else 2 * dy**2


def system(lagrangian=lambda t, q, v: v[0] ** 2 / 2 - q[0] ** 2 / 2, **options):
    return mechanics.System(lagrangian, ("x",), **options)


def scene(n=lambda x, y: 1 + 0.1 * y):
    return optics.Scene(optics.Graded(n))


def solver(problem):
    return None


PLANET = mechanics.System(lambda t, q, v: (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + 1 / q[0], ("r", "phi"))
PROBLEM = of_ends(length)
SPRING = of_ends(lambda x, y, dy, p: dy**2 + p.k * y**2, parameters={"k": 1.0})

WRITTEN_WRONGLY = [
    # the parameters
    (lambda: with_g(lambda x, y, dy, p: p["g"] * dy**2), r"p\['g'\] is written p.g"),
    (lambda: with_g(lambda x, y, dy, p: p["h"] * dy**2), "p.h is used but not declared"),
    (lambda: with_g(lambda x, y, dy, p: p[0] * dy**2), "parameters are attributes of p, written p.g"),
    (lambda: with_g(lambda x, y, dy, p: p * dy**2), "p, is used as a number: it holds all .* written p.g"),
    (lambda: with_g(lambda x, y, dy, p: dy**2 * p), "written p.g"),
    (lambda: with_g(lambda x, y, dy, p: dy**2 - p), "written p.g"),
    (lambda: with_g(lambda x, y, dy, p: dy**p), "written p.g"),
    (lambda: with_g(lambda x, y, dy, p: -p + dy**2), "written p.g"),
    (lambda: with_g(lambda x, y, dy, p: np.float64(2) * p + dy**2), "written p.g"),
    (lambda: with_g(lambda x, y, dy, p: ca.sqrt(p) * dy**2), "write p.<name>"),
    (lambda: with_g(lambda x, y, dy, p: np.sqrt(p) * dy**2), "write p.<name>"),
    (lambda: with_g(lambda x, y, dy, p: p() * dy**2), "p is called like a function"),
    (lambda: with_g(lambda x, y, dy, p: sum(p) * dy**2), "p is unpacked or looped over"),
    (lambda: with_g(lambda x, y, dy, p: p.G * dy**2), "p.G is used but not declared; did you mean 'g'?"),
    (lambda: with_g(lambda x, y, dy, g: g * dy**2), "written p.g"),
    (lambda: of_ends(length, params={"g": 1}), "Problem has no argument 'params'; did you mean 'parameters'?"),
    (lambda: of_ends(length, parameters=9.81), "parameters must be a mapping .* write {'g': 9.81}"),
    (lambda: of_ends(length, g=9.81), "Problem has no argument 'g'; it takes lagrangian, start, end, .*, name"),
    (lambda: SPRING.with_parameters(k=2), "give a mapping from names to values: values={'k': 2}"),
    (lambda: SPRING.with_parameters({"K": 2}), "it has .'k'.; did you mean 'k'?"),
    # formulas
    (lambda: in_plane(lambda x, y, dy: dy @ dy), r"write|written ca.dot\(dy, dy\) or ca.sumsqr"),
    (lambda: in_plane(lambda x, y, dy: dy**2), "use ca.dot or ca.sumsqr"),
    (lambda: in_plane(lambda x, y, dy: sum(dy**2)), r"unpacks or loops over a column .* use ca.sumsqr and ca.dot"),
    (lambda: in_plane(lambda x, y, dy: dy.dot(dy)), r"written ca.dot\(a, b\)"),
    (lambda: in_plane(lambda x, y, dy: dy.x**2), r"y\[0\], y\[1\]"),
    (lambda: of_ends(if_of_a_symbol), "write comparisons with ca.if_else"),
    (lambda: of_ends(lambda x, y, dy: max(y, 0) + dy**2), "ca.fmax"),
    (lambda: of_ends(lambda x, y, dy: dy**2 and y), "ca.logic_and"),
    (lambda: of_ends(lambda x, y, dy: bool(y > 0) * dy**2), "ca.if_else"),
    (
        lambda: of_ends(lambda x, y, dy: math.sin(y) + dy**2),
        "Python's math functions and SciPy's interpolants do not take symbols",
    ),
    (
        lambda: of_ends(lambda x, y, dy: float(y) + dy**2),
        "Python's math functions and SciPy's interpolants do not take symbols",
    ),
    (lambda: of_ends(lambda x, y, dy: int(y) + dy**2), r"leave int\(\) out"),
    (lambda: of_ends(lambda x, y, dy: np.isnan(y) + dy**2), "no such function of NumPy's"),
    (lambda: of_ends(lambda x, y, dy: y[1] + dy**2), "give the ends as many components"),
    (lambda: of_ends(lambda x, y, dy: y(x) + dy**2), r"write y, not y\(x\)"),
    (lambda: of_ends(lambda x, y, dy: dy ^ 2), r"a power is written \*\*"),
    (lambda: of_ends(lambda x, y, dy: ca.sine(y) + dy**2), "did you mean 'sin'?"),
    (lambda: of_ends(lambda x, y, dy: not_there * dy**2), "failed with NameError: .*; mend the function"),  # noqa: F821
    (lambda: of_ends(lambda x, y, dy: dy**2 + 1 / 0), "failed with ZeroDivisionError"),
    (
        lambda: of_ends(lambda x, y, dy: None),
        "must return a CasADi expression or a number, not None; it may lack a return",
    ),
    (lambda: of_ends(lambda x, y, dy: (dy**2, y)), "it is one number, whose parts are added up"),
    (lambda: of_ends(lambda x, y, dy: [dy**2]), "it is one number, whose parts are added up"),
    (lambda: of_ends(lambda x, y, dy: lambda: dy**2), "call that function, and return what it gives"),
    (lambda: of_ends(lambda x, y, dy: 1j), "a functional is real"),
    (lambda: of_ends(lambda x, y, dy: 1j * dy**2), "write real and imaginary parts as functions of their own"),
    (lambda: of_ends(lambda x, y, dy: dy**2 * Fraction(1, 3)), r"write float\(...\) around it"),
    (lambda: of_ends(lambda x, y, dy: Decimal("0.1") * dy**2), r"write float\(...\) around it"),
    (lambda: of_ends(lambda x, y, dy: mpmath.mpf(2) * dy**2), r"write float\(...\) around it"),
    (lambda: of_ends(lambda x, y, dy: mpmath.sqrt(1 + dy**2)), "mpmath's functions take no symbols; use CasADi's"),
    (lambda: of_ends(lambda x, y, dy: len(y) * dy**2), r"y.numel\(\) is the number of its components"),
    (lambda: of_ends(lambda x, y, dy: sum(range(y)) * dy**2), r"take components by index, y\[0\]"),
    (lambda: in_plane(lambda x, y, dy: sum(d**2 for d in dy)), r"unpacks or loops over a column .* use ca.sumsqr"),
    (lambda: in_plane(lambda x, y, dy: (dy**2).sum()), r"the sum over a column is written ca.sum1\(a\)"),
    (lambda: of_ends(length, surface=lambda x, y: None), "what surface returns must be a sequence, not None"),
    (lambda: of_ends("dy**2"), "lagrangian must be a function"),
    # numbers
    (lambda: vc.Fixed("0", 0), "Fixed.x must be a number, not '0'"),
    (lambda: vc.Fixed(0, True), "Fixed.y must be a number, not True"),
    (lambda: vc.Fixed(0, 1j), "Fixed.y must be a number, not 1j"),
    (lambda: vc.Fixed(0, np.complex64(1)), "Fixed.y must be a number, not"),
    (lambda: vc.Fixed(None, 0), "Fixed.x must be a number, not None"),
    (lambda: vc.Fixed(math.nan, 0), "Fixed.x must be finite, not nan"),
    (lambda: vc.Fixed(0, [1, math.inf]), r"Fixed.y\[1\] must be finite, not inf"),
    (lambda: vc.Fixed(0, 10**400), "Fixed.y must be finite, not 1000"),
    (lambda: vc.At([[0, 1], [2]]), r"At.q\[0\] must be a number, not \[0, 1\]"),
    (lambda: of_ends(length, START, vc.Fixed(0, 1)), "give them different abscissae"),
    (lambda: of_ends(length, vc.Fixed(0, [0, 0]), vc.Fixed(1, [1, 1, 1])), "start has 2 components and end has 3"),
    (lambda: of_ends(length, constraints=np.array(1.0)), r"constraints must be a sequence, .* constraints=\[...\]"),
    (lambda: of_ends(length, breakpoints=ca.SX.sym("b")), "breakpoints must be a sequence"),
    (lambda: SPRING.with_parameters({"k": "2"}), r"parameters\['k'\] must be a number, not '2'"),
    (lambda: vc.sweep(SPRING, {"k": ["1"]}), r"grid\['k'\] must be a number, not '1'"),
    (lambda: vc.sweep(SPRING, {"k": [math.nan]}), r"grid\['k'\] must be finite"),
    (lambda: vc.solve(PROBLEM, tol=10**400), "tol must be a positive number"),
    # arguments of the functions
    (lambda: of_ends(lambda x, dy, y: dy**2), r"called with \(x, y, dy\), but its arguments are named \(x, dy, y\)"),
    (lambda: of_ends(lambda dy, y, x: dy**2), "put them in that order, or rename them"),
    (lambda: of_ends(lambda u, x, du: du**2), "put them in that order, or rename them"),
    (lambda: of_ends(length, end_cost=lambda x0, x1, y0, y1: y1), "put them in that order"),
    (lambda: of_ends(length, constraints=[vc.Isoperimetric(lambda y, x, dy: y, 1)]), "put them in that order"),
    (lambda: of_ends(lambda q, t, v: v**2 - q**2), "put them in that order"),
    (lambda: of_ends(lambda y, dy: dy**2), r"signature is \(y, dy\); it is called with \(x, y, dy\)"),
    (lambda: with_g(length), r"it is called with \(x, y, dy, p\)"),
    # ends
    (lambda: vc.At(0, 0), r"give them as one sequence: At\(\[0, 0\]\)"),
    (lambda: vc.Fixed(0), r"Fixed lacks y; it is written Fixed\(x, y, dy=None\)"),
    (lambda: vc.Fixed(0, 0, 0, 0), "Fixed takes 3 arguments by place, not 4"),
    (lambda: vc.Fixed(0, 0, slope=1), "Fixed has no argument 'slope'; it takes x, y and dy"),
    (lambda: vc.Fixed(0, 0, x=1), "Fixed is given x twice"),
    (lambda: vc.Fixed(0, {"y": 1}), "Fixed.y must be a number"),
    (lambda: of_ends(length, (0, 0), (1, 1)), r"write Fixed\(0, 0\)"),
    (lambda: of_ends(length, vc.Fixed, vc.Fixed), r"that is the class: write Fixed\(...\)"),
    (lambda: of_ends(length, vc.At([0, 0]), vc.At([1, 1])), "At is an end of a Curve"),
    (lambda: of_ends(length, END, START), "give the left end first"),
    (lambda: vc.Problem(START, END, length), "lagrangian must be a function"),
    (lambda: vc.Curve(lambda q, dq: ca.norm_2(dq), (0, 0), (1, 1)), r"write At\(\[0, 0\]\)"),
    (lambda: vc.Curve(lambda dq, q: ca.norm_2(dq), vc.At([0, 0]), vc.At([1, 1])), "put them in that order"),
    (lambda: vc.Curve(lambda q, dq: ca.norm_2(dq), START, END), "Fixed is an end of a Problem"),
    (lambda: of_ends(length, order=3), "order must be 1 or 2, not 3; .* take v = y' for the unknown function"),
    (lambda: of_ends(lambda x, y, dy, ddy: ddy**2), r"called with \(x, y, dy\), .* and ddy before it with order=2"),
    (
        lambda: vc.Isoperimetric(length, vc.Parameter("A")),
        r"must be a number, not Parameter\(name='A'\); .* in a formula it is p.<name>",
    ),
    (
        lambda: of_ends(
            lambda x, y, dy, p: dy**2, constraints=[vc.Holonomic(lambda x, y, dy: dy[0])], unknowns={"k": 1}
        ),
        r"p\[0\] has no meaning: .*; its last argument, here dy, is p",
    ),
    (
        lambda: of_ends(length, constraints=[vc.Bound(lambda x, y, dy: 1, upper=1)]),
        "h does not depend on the curve, so it bounds nothing; leave the Bound out",
    ),
    (lambda: vc.Bound(length, low=0), "Bound has no argument 'low'; did you mean 'lower'?"),
    (
        lambda: of_ends(
            lambda x, y, dy, ddy: ddy**2, constraints=[vc.Bound(lambda x, y, dy, ddy: ddy, upper=1)], order=2
        ),
        "a Bound is on the curve and its first slope, .* take v = y' for the unknown function",
    ),
    (
        lambda: of_ends(
            lambda x, y, dy: ca.sumsqr(dy),
            vc.Fixed(0, [0, 0]),
            vc.Fixed(1, [1, 0]),
            constraints=[vc.Bound(lambda x, y, dy: dy[0] - y[1], lower=0, upper=0)],
        ),
        "lower = upper is a differential equation for the curve",
    ),
    (lambda: of_ends(lambda x, y, dy: CubicSpline([0, 1, 2], [1, 2, 5])(x) * dy**2), "tables by ca.interpolant"),
    (
        lambda: mechanics.charged(1.0, 1.0, (0, 0, 1)),
        "vector_potential must be a function of .t, q., not .*lambda t, q",
    ),
    (lambda: scene().trace((0, 0), (1, 0), until=2.0), "how far rays go is said by optical_path="),
    (lambda: vc.Isoperimetric(length), "or value="),
    # solving
    (lambda: vc.solve(PROBLEM, tolerance=1e-8), "solve has no argument 'tolerance'; did you mean 'tol'?"),
    (lambda: vc.solve(PROBLEM, throw="no"), "throw must be True or False"),
    (lambda: vc.solve(tol=1e-8), r"solve lacks problem; it is written solve\(problem, "),
    (lambda: vc.Ritz(element=4), "did you mean 'elements'?"),
    (lambda: vc.Newton(iterations="many"), "Newton.iterations must be a whole number"),
    (lambda: vc.Ipopt(tol=-1), "Ipopt.tol must be a positive number"),
    (lambda: vc.Ritz(refine="no"), "Ritz.refine must be True or False, not 'no'"),
    (lambda: vc.Ritz(elements=10**20), "Ritz.elements must be at most 2147483647"),
    (lambda: vc.solve(PROBLEM, progress=lambda: None), r"progress is called with \(done, total, what\)"),
    (lambda: vc.compare(PROBLEM, inapplicable=[vc.Ritz]), "inapplicable must map method classes to reasons"),
    (lambda: vc.compare(PROBLEM, [vc.Ritz]), r"give an object: Ritz\(\)"),
    (lambda: vc.sweep(SPRING, {"k": [1]}, units="N"), "units must map the names in the grid to texts"),
    (lambda: vc.sweep(SPRING, {"k": [1]}, store=True), "store must be the path of a file"),
    (
        lambda: vc.sweep(SPRING, {"k": [1]}, store="no/folder/s"),
        "there is no folder no/folder for the store s; make it",
    ),
    (lambda: vc.sweep(lambda: 1, {"k": [1]}), "problem must be a Problem or a Curve, not 1"),
    (lambda: vc.Sweep.load("not/there"), r"there is no file not/there; give one that sweep\(..., store=\) wrote"),
    (lambda: vc.WorkPrecision.load(None), "path must be the path of a file, not None"),
    (lambda: vc.Measured("1"), "Measured.value must be a number, not '1'"),
    (lambda: vc.Lagrangian.of(length), "problem must be a Problem or a Curve"),
    (lambda: vc.certify(PROBLEM), "solution must be what varcalc.solve gives back"),
    (lambda: vc.verify_solver(solver, problems=[PROBLEM]), r"write Reference\(name, problem, Exact\(value\)\)"),
    (lambda: vc.verify_solver(solver, problems=3), r"problems must be a sequence, not 3"),
    (lambda: vc.verify_solver(solver, digits="40"), "digits must be a whole number"),
    (lambda: vc.work_precision([PROBLEM], [vc.Ritz()], seconds=None), "seconds must be a number, not None"),
    (lambda: vc.continue_branch(vc.solve(SPRING), ["k"], until=2), "name must be a text"),
    (lambda: vc.sweep(SPRING, k=[1]), r"give a mapping from names to values: grid={'k': \[1\]}"),
    (lambda: vc.continue_branch(SPRING, "k", until=2), "solution must be what varcalc.solve gives back"),
    (lambda: vc.continue_branch(SPRING, "k", 2), "give the others by name: until=..., tol=..."),
    (lambda: vc.work_precision(PROBLEM, [vc.Ritz()]), r"write problems=\[...\]"),
    (lambda: vc.euler_lagrange_text(length), "problem must be a Problem or a Curve"),
    (lambda: vc.Rits, "did you mean 'Ritz'?"),
    (lambda: optics.Scenes, "did you mean 'Scene'?"),
    (lambda: mechanics.Sytem, "did you mean 'System'?"),
    (lambda: vc.System(("x",), length), r"no attribute 'System'; it is varcalc\.mechanics\.System$"),
    (lambda: vc.Stratified(1.5), r"; it is varcalc\.optics\.Stratified$"),
    (lambda: optics.Problem, r"; it is varcalc\.Problem$"),
    (lambda: vc.Sytem, r"did you mean 'System' of varcalc\.mechanics\?"),
    # what is there under another name
    (lambda: vc.Waypoint, "did you mean 'Through'?"),
    (lambda: vc.minimize, "did you mean 'solve'?"),
    (lambda: vc.trace, "it is a method of .*Scene"),
    (lambda: optics.Circle, "did you mean 'Sphere'?"),
    (lambda: optics.rays((0, 0), (1, 0)), "a module, which cannot be called; it is a method of Scene"),
    (lambda: vc.solve(PROBLEM).cost, "Solution has no attribute 'cost'; did you mean 'value'?"),
    (lambda: vc.solve(PROBLEM).success, "did you mean 'status'?"),
    (lambda: PROBLEM.solve, r"it is a function: varcalc\.solve\(\.\.\.\)"),
    (lambda: scene().trace_all, "did you mean 'trace'?"),
    (lambda: scene().rays((0, 0), (1, 0)).optical_path, r"it is a sequence, \[0\] its first, and has along"),
    (lambda: system().action, "did you mean 'lagrange'?"),
    (lambda: system().simulate(), "did you mean 'motion'?"),
    (lambda: system().zzz, r"it has what dir\(\.\.\.\) of it lists"),
    # one thing asked of another
    (lambda: vc.solve(length), r"problem must be .*; write Problem\(lagrangian, start, end\)"),
    (lambda: vc.extremals(scene()), r"a Scene is asked by scene\.rays\(A, B\)"),
    (lambda: vc.diagnose(system()), r"a System is asked by system\.motion\(q0, v0, span\)"),
    (lambda: vc.verify(PROBLEM), r"write verify\(solve\(problem\)\)"),
    (lambda: vc.certify(scene().rays((0, 0), (1, 0))[0]), r"a Ray has a certify of its own: ray\.certify\(\)"),
    (lambda: vc.solve(PROBLEM).plot("red"), r"Solution\.plot takes 0 arguments by place, not 1"),
    (lambda: vc.solve(PROBLEM).plot(colour="red"), "Solution.plot has no argument 'colour'"),
    (lambda: of_ends(length, 0, 1), r"start must be .*, not 0; write Fixed\(x, y\)"),
    (lambda: of_ends(length, unknowns=["T"]), "unknowns must be a mapping .*; write {'T': 9.81}"),
    # optics
    (lambda: optics.Scene(1.5), r"write Uniform\(1.5\)"),
    (lambda: optics.Scene(optics.GLASSES["N-BK7"]), r"write Uniform\(optics.GLASSES"),
    (lambda: optics.Scene(lambda x, y: 1 + y), r"written Graded\(n\)"),
    (lambda: optics.Scene(optics.Plane((0, 0), (1, 0))), "media come first, and surfaces second"),
    (lambda: optics.Scene(optics.Uniform(1.5), wavelenght=0.5), "did you mean 'wavelength'?"),
    (lambda: optics.GLASSES["BK7"], "did you mean 'N-BK7'?"),
    (lambda: optics.GLASSES["fused-silica"], "did you mean 'fused silica'?"),
    (lambda: optics.GLASSES["water"], r"others are written Sellmeier\(B, C\)"),
    (lambda: optics.GLASSES["N-BK7"].index(589), "589 nm are 0.589"),
    (lambda: scene(lambda x, y: 1.5 if y > 0 else 1).rays((0, 0), (1, 1)), "ca.if_else.*Tabulated"),
    (lambda: scene().rays(None, (1, 1)), "A must be made of numbers, not None"),
    (lambda: scene().trace((0, 0), (1, 0), opticalpath=1), "did you mean 'optical_path'?"),
    (lambda: scene().trace((0, 0), (1, 0), optical_path="1"), "optical_path must be made of numbers"),
    (lambda: optics.Sphere((0, 0), "1"), "radius must be a number"),
    (lambda: optics.Sphere(1.0, (0, 0)), r"center must be one point, .* such as \(0, 1\), not 1\.0"),
    (lambda: optics.Stratified(1.5), "n must be a function, not 1.5; for a number take Uniform"),
    (lambda: optics.Radial(1.5), "n must be a function, not 1.5; for a number take Uniform"),
    (lambda: optics.Uniform(lambda x, y: 1 + y), r"with p alone, .*; an index that varies is written Graded\(n\)"),
    (lambda: scene().rays((0, 0), (1, 0), model=optics.Hamilton), r"write optics\.Hamilton\(\)"),
    (lambda: scene().rays((0, 0), [(1, 0), (2, 0)]), "many pairs go into one call of arrivals"),
    (lambda: scene().trace((0, 0), 0.3, optical_path=1), r"at an angle a is \(cos\(a\), sin\(a\)\)"),
    (lambda: optics.Scene(optics.Uniform(1), optics.Plane((0, 0), (1, 0))), "1 surface needs 2 media"),
    (lambda: optics.Sphere((0, 0), [1, 2]), "radius must be a number, not"),
    (lambda: optics.Plane((0, 0), (1, 0), mirror="yes"), "mirror must be True or False"),
    (lambda: optics.luneburg(raduis=1), "did you mean 'radius'?"),
    (lambda: optics.luneburg(-1), "radius must be a positive number"),
    (lambda: optics.wavefront(scene(), (0, 0), 8, 1.0), "source must be a PointSource or a PlaneWave"),
    (lambda: scene().rays([[0], [1, 2]], (1, 1)), "A must be made of numbers"),
    (lambda: scene().trace((0, 0), (1, 0), optical_path=1, with_spreading=1), "with_spreading must be True or False"),
    (lambda: optics.Scene(optics.Uniform(1.5), names=True), "names must be a sequence, not True"),
    (lambda: optics.Uniform("1.5"), "n must be a number, not '1.5'"),
    (lambda: optics.Cauchy([1.5], range="visible"), "range must be made of numbers"),
    (lambda: optics.Tabulated([0, 1], [1, 1], smooth="no"), "smooth must be True or False"),
    (lambda: optics.maupertuis(lambda x, y: y, None), "energy must be a number, not None"),
    (lambda: optics.maupertuis(1.0, 2.0, parameters=3), "parameters must be a mapping"),
    (lambda: optics.munk_profile(reference="1500"), "reference must be a number"),
    (lambda: optics.range_chart(1, (0, 0), (1, 0)), "scene must be a Scene, not 1"),
    (lambda: optics.CurvedMedium(1, lambda q: 1), "metric must be a function, not 1"),
    (lambda: scene().rays((0, 0), (1, 0))[0].certify(True), "end must be made of numbers, not True"),
    # mechanics
    (lambda: system(params={"m": 1}), "System has no argument 'params'; did you mean 'parameters'?"),
    (lambda: system(parameters=3), "parameters must be a mapping"),
    (lambda: system(lambda q, v, t: v[0] ** 2), "put them in that order"),
    (lambda: system(lambda q, v: v[0] ** 2), r"with \(t, q, v\), where p comes last, and only when [a-z ]*$"),
    (lambda: mechanics.System(("x",), length), r"lagrangian, which comes before .* a function, not \('x',\)$"),
    (lambda: system(lambda t, q, v: v[0] ** 2 if q[0] > 0 else 0), "ca.if_else"),
    (lambda: system(constraints=vc.Holonomic(lambda t, q: q[0])), r"write constraints=\[...\]"),
    (lambda: system(forces=lambda t, q, v: None), "forces must return a list of expressions or numbers, not None"),
    (
        lambda: system(forces=lambda t, q, v: [q[3]]),
        "component that is not there: .* or the system as many coordinates",
    ),
    (lambda: system().motion([1], [0], 10), r"write \(0, 10\)"),
    (lambda: system().motion([1], [0], (0, 1, 2)), "span must be two ascending times"),
    (lambda: system().motion(["a"], [0], (0, 1)), "q0 must be made of numbers"),
    (lambda: system().ensemble([[1]], [[0]], "soon"), "times must be made of numbers"),
    (lambda: system().motion([1], [0], (0, 1), event=[]), "did you mean 'events'?"),
    (lambda: system().orbit([1], [0], -1), "period must be positive"),
    (lambda: mechanics.Event(lambda t, q, v: q[0], direction="up"), r"1 \(rising\), -1 \(falling\)"),
    (lambda: mechanics.Symmetry(name="none"), "give xi=, tau= or both"),
    (lambda: mechanics.Inertia.sphere(mass=1, r=1), "it takes mass and radius"),
    (lambda: mechanics.poisson(1, 2), "f must be a function"),
    (lambda: system().motion([1], [0], (0, 1), progress=3), "progress must be a function of"),
    (lambda: system().galerkin([1], [0], (0, 1), steps=2.5), "steps must be a whole number, not 2.5"),
    (lambda: PLANET.reduced("phi"), r"momenta must map names of coordinates to numbers, .* write {'phi': 1.0}"),
    (lambda: PLANET.routhian({"phi": "1"}), r"momenta\['phi'\] must be a number"),
    (lambda: PLANET.reduced({"phi": 1.0}).orbits(None), "energy must be a number, not None"),
    (lambda: mechanics.averaged(1, 1.0), "system must be a mechanics.System, not 1"),
    (lambda: mechanics.averaged(system(), "1"), "period must be a number"),
    (lambda: mechanics.bifurcation_chart(system(), [-1], [1], "k", 3), "between must be two ascending values"),
    (lambda: mechanics.stability_chart(system(), [0], 1.0, ["k"]), r"write {'a': \[0.0, 1.0\]}"),
    (lambda: mechanics.Top("1", 1, 1), "I1 must be a number, not '1'"),
    (lambda: mechanics.Top.of([1, 1, 2], [0, 0, 0]), "inertia must be a mechanics.Inertia"),
    (lambda: mechanics.Top(1, 1, 1).sleeps(None), "omega3 must be a number, not None"),
    (lambda: mechanics.Inertia.box("1", 1, 1, 1), "mass must be a number, not '1'"),
    (lambda: mechanics.Inertia(1, [0, 0], np.eye(3)), "centre must be three finite numbers"),
    (lambda: mechanics.EulerAngles("0", 0, 0), "EulerAngles.phi must be made of numbers"),
    (lambda: mechanics.RigidBody([1, 1, 1.5], parameters=3), "parameters must be a mapping"),
    (lambda: mechanics.RigidBody([1, 1, 1.5], torque=lambda t, R, w: "no"), "torque must return a list of expressions"),
    (lambda: mechanics.Collision("1", 2), "projectile must be a number"),
    (lambda: mechanics.Collision(1, 2).after([1, 0], [0, 0], "up"), "direction must be made of numbers"),
    (lambda: mechanics.firsov(3, 1.0, [1.5]), "deflection must be a function, not 3"),
    (lambda: mechanics.firsov(lambda: 1, 1.0, [1.5]), "deflection must accept 1 argument"),
    (lambda: mechanics.well_width(lambda e: "long", [1.0]), "what period returns must be made of numbers"),
    (lambda: mechanics.well_width(lambda e: e[:2], [1.0]), "period is called with an array and must return one of its"),
    (lambda: mechanics.rotating(3, [0, 0, 1]), "lagrangian must be a function"),
    (lambda: mechanics.charged("1", 1, lambda t, q: [0]), "mass must be a number"),
    (lambda: mechanics.Experiment(system(), [1], [0], 3), "Experiment.span must be two ascending times"),
]


@pytest.mark.parametrize(("written", "remedy"), WRITTEN_WRONGLY)
def test_what_is_written_wrongly_is_told_in_one_sentence(written, remedy):
    with pytest.raises((TypeError, ValueError, KeyError, AttributeError, FileNotFoundError), match=remedy) as told:
        written()
    sentence = str(told.value)
    assert "\n" not in sentence
    assert "__init__" not in sentence
    assert len(sentence) < 400


def test_both_spellings_are_taken():
    assert of_ends(length, maximize=True).maximise
    assert not of_ends(length, maximise=False).maximise
    assert optics.Sphere(centre=(1, 2), radius=1) == optics.Sphere(center=(1, 2), radius=1)
    assert optics.Radial(lambda r: 2 - r, centre=(1, 2)).center == (1.0, 2.0)
    assert vc.Ritz(optimizer=vc.Ipopt()) == vc.Ritz(optimiser=vc.Ipopt())
    assert mechanics.Inertia(1.0, center=np.zeros(3), tensor=np.eye(3)).centre.tolist() == [0, 0, 0]
    with pytest.raises(TypeError, match="no argument 'minimise'; it takes lagrangian, start"):  # not the contrary
        of_ends(length, minimise=True)
    with pytest.raises(TypeError, match="given maximise twice"):
        of_ends(length, maximise=True, maximize=True)


@pytest.mark.parametrize(
    "lagrangian",
    [lambda t, x, dx: dx**2, lambda y, x, dx: dx**2, lambda s, r, v: v**2, lambda x, y, slope: slope**2,
     lambda x, y, yp: yp**2, lambda x, u, u_dot: u_dot**2, lambda *a: a[2] ** 2],
)  # fmt: skip
def test_other_names_of_the_arguments_are_welcome(lagrangian):
    assert vc.solve(of_ends(lagrangian)).value == pytest.approx(1.0, abs=1e-12)


def test_a_wrong_type_within_a_call_is_told_by_what_raised_it():
    def guess(x):
        return x + None

    with pytest.raises(TypeError, match="unsupported operand"):
        vc.solve(PROBLEM, guess=guess)


def test_no_more_of_what_was_given_is_repeated_than_can_be_read():
    with pytest.raises(ValueError, match="n must be finite") as told:
        optics.Tabulated(np.arange(500.0), np.full(500, np.nan))
    assert "\n" not in str(told.value)
    assert len(str(told.value)) < 300


NUMBERS = [
    Fraction(1, 2), Decimal("0.5"), mpmath.mpf("0.5"), np.float32(0.5), np.float16(0.5), np.longdouble(0.5),
    np.array(0.5),
]  # fmt: skip


@pytest.mark.parametrize("half", NUMBERS, ids=lambda v: type(v).__name__)
def test_numbers_of_every_kind_are_numbers(half):
    """One half of each kind, in the place of 0.5: the same float, and arithmetic in doubles from there on."""
    problem = of_ends(
        lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(half, half), vc.Fixed(1, 1), parameters={"k": half},
        constraints=[vc.Bound(lambda x, y, dy, p: y, lower=half)],
    )  # fmt: skip
    assert (type(problem.start.x), problem.start.x, type(problem.start.y)) == (float, 0.5, float)
    assert type(problem.constraints[0].lower) is float
    assert problem.parameters == {"k": 0.5}
    assert vc.Fixed(0, [half, 1]).y == (0.5, 1)
    swept = vc.sweep(SPRING, {"k": [half]})
    assert [type(v) for v in swept.grid["k"]] == [float]
    assert optics.Uniform(half + 1).n == 1.5
    assert optics.Plane((half, 0), (1, half)).point == (0.5, 0.0)
    assert len(optics.Scene(optics.Uniform(1.5)).rays((half, 0), (1, half))) == 1
    assert system().motion([half], [half], (0, half)).q(half) == system().motion([0.5], [0.5], (0, 0.5)).q(0.5)


def test_a_constant_functional_may_be_any_real_number():
    for value in (Fraction(1, 2), Decimal("0.5"), np.float32(0.5), 1):
        assert of_ends(lambda x, y, dy, value=value: value).integrand.is_constant()


class OfSymPy:
    """What SymPy's objects look like from outside: it is no dependency, so that it may not be there."""

    __module__ = "sympy.core.symbol"

    def __repr__(self):
        return "s**2"


def test_sympy_is_told_what_to_do():
    with pytest.raises(
        TypeError, match=r"write ca.sqrt for sympy.sqrt, or .* sympy.lambdify\(\(x, y, dy\), expression"
    ):
        of_ends(lambda x, y, dy: OfSymPy())


def test_what_a_function_does_to_its_arguments_stays_there():
    def changes_what_it_is_given(x, y, dy):
        y[0] = 0
        dy *= 2
        return ca.sumsqr(dy) + ca.sumsqr(y)

    ends = vc.Fixed(0, [0, 0]), vc.Fixed(1, [1, 1])
    changed = vc.solve(vc.Problem(changes_what_it_is_given, *ends))  # the integral of 4 u'^2 + 4 v'^2 + v^2
    assert changed.value == pytest.approx(4 + 2 / math.tanh(0.5), rel=1e-9)
    after = vc.solve(vc.Problem(lambda x, y, dy: ca.sumsqr(dy) + ca.sumsqr(y), *ends))
    assert after.value == pytest.approx(2 / math.tanh(1), rel=1e-9)


def test_a_script_whose_workers_cannot_begin_is_told_what_it_lacks(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text(
        "import varcalc as vc\n"
        "a, b = vc.Fixed(0, 0), vc.Fixed(1, 1)\n"
        "p = vc.Problem(lambda x, y, dy, p: dy**2 + p.k * y**2, a, b, parameters={'k': 1.0})\n"
        "vc.sweep(p, {'k': [1.0, 2.0, 3.0]}, cores=2)\n",
        encoding="utf-8",
    )
    # Python's own tracker of resources may warn, after all is said, of what workers left that were ended at once
    quietly = [sys.executable, "-W", "ignore::UserWarning", script]
    done = subprocess.run(quietly, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.rstrip().endswith("what starts them must stand under if __name__ == '__main__':")
