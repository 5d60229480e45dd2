"""What objects say of themselves: in a line, in a few lines, in a notebook and in a picture."""

import copy
import pickle
import re
from functools import cache
from html.parser import HTMLParser

import casadi as ca
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser

import varcalc as vc
from varcalc import mechanics, optics
from varcalc.axes import Axis
from varcalc.showing import LINE
from varcalc.study.experiments import experiment_catalogue, load_experiment
from varcalc.study.reference import catalogue, load
from varcalc.study.scenes import load_study, scene_catalogue

MOST_LINES = 13
EMPTY = {"br", "img"}
MATHTEXT = MathTextParser("path")


class WellFormed(HTMLParser):
    """Every tag is closed, in order; collects the text."""

    def __init__(self, source):
        super().__init__()
        self.open, self.text = [], ""
        self.feed(source)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def typeset(source):
    """Lay every line of a formula out; matplotlib knows no environments."""
    inner = re.sub(r"\\(begin|end)\{gathered\}", "", source.strip("$").removeprefix(r"\displaystyle "))
    for line in inner.split(r" \\ "):
        MATHTEXT.parse(f"${line}$")


def shows_itself(thing):
    short, printed, html = repr(thing), str(thing), thing._repr_html_()
    assert "\n" not in short
    assert len(short) <= LINE
    assert 1 <= len(printed.splitlines()) <= MOST_LINES
    assert all(len(line) <= 200 for line in printed.splitlines() if ": searched" not in line)
    for words in (short, printed):
        assert "SX(" not in words
        assert " at 0x" not in words
    page = WellFormed(html)
    assert page.text.strip()
    for formula in re.findall(r"\$(.+?)\$", page.text):
        typeset(formula)
    if hasattr(thing, "_repr_latex_"):
        typeset(thing._repr_latex_())


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_reference_problem(name):
    for reference in load(name):
        shows_itself(reference.problem)
        assert len(repr(reference)) <= LINE


@pytest.mark.parametrize("name", sorted(scene_catalogue()))
def test_every_scene(name):
    study = load_study(name)
    shows_itself(study.scene)
    shows_itself(study)


@pytest.mark.parametrize("name", sorted(experiment_catalogue()))
def test_every_system(name):
    experiment = load_experiment(name)
    shows_itself(experiment)
    if isinstance(experiment, mechanics.Experiment):
        shows_itself(experiment.system)


FALL = vc.Problem(
    lambda x, y, dy, p: ca.sqrt((1 + dy**2) / (2 * p.g * y)), vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"g": 9.81},
    names=("x", "depth"), units=("m", "m"), name="fall",
)  # fmt: skip
PENDULUM = mechanics.System(
    lambda t, q, v, p: v[0] ** 2 / 2 + p.g * ca.cos(q[0]), ("theta",), parameters={"g": 9.81}, units=("rad",),
    time_unit="s", name="pendulum",
)  # fmt: skip
SEA = optics.Scene(optics.Stratified(lambda y: ca.sqrt(1 - 2 * y)), names=("range", "height"), units=("km", "km"))
GLASS = optics.Scene([optics.Uniform(1.0), optics.Uniform(1.5)], [optics.Plane((0, 0), (0, 1))])


def on_sphere(x, y):
    return ca.sin(x) * ca.cos(y), ca.sin(x) * ca.sin(y), ca.cos(x)


MATHIEU = mechanics.System(
    lambda t, q, v, p: (v[0] ** 2 - (p.a - 2 * p.q * ca.cos(2 * t)) * q[0] ** 2) / 2, ("x",),
    parameters={"a": 0.0, "q": 0.5},
)  # fmt: skip


@cache
def made():
    """One of each kind of result."""
    film = vc.Problem(lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(-0.5, 1), vc.Fixed(0.5, 1))
    bratu = vc.Problem(
        lambda x, y, dy, p: dy**2 / 2 - p.k * ca.exp(y), vc.Fixed(0, 0), vc.Fixed(1, 0), parameters={"k": 1.0}
    )
    solution, extremals = vc.solve(FALL), vc.extremals(film)
    sphere = vc.Curve(
        lambda q, dq: ca.norm_2(dq), vc.At([1, 0, 0]), vc.At([0, 1, 0]), [vc.Holonomic(lambda q: ca.sumsqr(q) - 1)]
    )
    angles = vc.Problem(
        lambda x, y, dy: ca.sqrt(1 + (ca.sin(x) * dy) ** 2), vc.Fixed(0.6, 0), vc.Fixed(1.3, 0.8), surface=on_sphere
    )
    several = vc.Problem(lambda x, y, dy: ca.sumsqr(dy) + y[0] * y[1], vc.Fixed(0, [0, 1]), vc.Fixed(1, [1, 0]))
    rays, motion = SEA.rays((0, 0), (0.9, 0)), PENDULUM.motion([1.0], [0.0], (0, 3))
    return {
        "solution": solution, "extremals": extremals, "found": extremals[1], "in space": vc.solve(sphere),
        "on a surface": vc.solve(angles), "several functions": vc.solve(several),
        "comparison": vc.compare(FALL, [vc.Ritz(), None]), "branch": vc.continue_branch(vc.solve(bratu), "k", until=2),
        "sweep": vc.sweep(FALL, {"g": [1, 5, 9.81]}),
        "map": vc.sweep(
            lambda k, c: vc.Problem(lambda x, y, dy: dy**2 + k * y**2 + c * y, vc.Fixed(0, 0), vc.Fixed(1, 1)),
            {"k": [0, 1], "c": [0, 1, 2]},
        ),
        "rays": rays, "ray": rays[0], "through glass": GLASS.rays((-1, 1), (1, -1)),
        "bundle": SEA.trace((0, 0), [(1, 0.2), (1, 1), (0.2, 1)], optical_path=0.5),
        "motion": motion, "ensemble": PENDULUM.ensemble([[1.0], [2.0]], [[0.0], [0.0]], [0, 1, 2]),
        "verification": vc.verify(solution), "modes": PENDULUM.normal_modes([0.0]),
        "equilibria": PENDULUM.equilibria([-1], [4]), "hamiltonian": PENDULUM.hamiltonian(),
        "diagnosis": vc.diagnose(vc.Problem(lambda x, y, dy: y * dy, vc.Fixed(0, 0), vc.Free(1))),
        "scattering": mechanics.Scattering(lambda r: 1 / r, 2.0),
        "turning": mechanics.RigidBody([1.0, 2.0, 2.5]).motion((1, 0, 0, 0), (1, 0, 1), (0, 3)),
        "stability": mechanics.stability_chart(
            MATHIEU, [0.0], np.pi, {"a": np.linspace(-1, 2, 20), "q": np.linspace(0, 1, 10)}
        ),
        "growth": mechanics.stability_chart(MATHIEU, [0.0], np.pi, {"a": np.linspace(-1, 2, 20)}),
        "body": mechanics.RigidBody([1.0, 2.0, 2.5], name="plate"), "event": PENDULUM, "scene": GLASS,
        "orbits": PENDULUM.closed_orbits(3.0), "symmetry": mechanics.Returns(np.array([[-1.0]])),
        "tube": rays[0].tube, "study": optics.Study(SEA, optics.PointSource((0, 0)), [(1, 1)], 0.4).run(),
    }  # fmt: skip


PLOTTED = (
    "solution", "extremals", "found", "in space", "on a surface", "several functions", "comparison", "branch", "sweep",
    "map", "rays", "ray", "through glass", "bundle", "motion", "ensemble", "study",
    "scattering", "turning", "stability", "growth",
)  # fmt: skip


@pytest.mark.parametrize("name", PLOTTED)
def test_what_can_be_drawn_is_a_figure_and_is_in_the_notebook(name):
    thing = made()[name]
    figure = thing.plot()
    assert isinstance(figure, Figure)
    assert any(panel.lines or panel.collections for panel in figure.axes)
    assert "data:image/png;base64," in thing._repr_html_()


def test_every_result_is_a_line_and_a_page():
    for name, thing in made().items():
        assert "\n" not in repr(thing), name
        assert len(repr(thing)) <= LINE, name
        if hasattr(thing, "_repr_html_") and name not in PLOTTED:
            WellFormed(thing._repr_html_())


def test_results_are_told_from_others_like_them():
    # arrays that are compared give no truth value: a result that holds some is itself alone
    for name, thing in made().items():
        other = copy.deepcopy(thing)
        assert thing == thing, name  # noqa: PLR0124
        assert thing in [other, thing], name
        assert isinstance(thing == other, bool), name


THROUGH = mechanics.Event(lambda t, q, v: q[0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: mechanics.Returns(-np.eye(2)),
        lambda: mechanics.Returns([[-1.0]]),
        lambda: mechanics.Repeats(np.eye(3)[[1, 2, 0]], 3),
        lambda: mechanics.EulerAngles(np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([0.5, 0.6])),
        lambda: mechanics.Happening("turn", 1.0, np.array([0.0, 1.0]), np.array([1.0, 0.0])),
        lambda: mechanics.Flights(THROUGH, np.zeros(3), np.ones(3), (0, 1)),
        lambda: mechanics.Section(THROUGH, np.zeros((2, 2)), np.ones((2, 2)), (0, 1), 5),
    ],
)
def test_what_holds_arrays_is_itself_alone(make):
    thing, other = make(), make()
    assert (thing == other) is False
    assert thing in {thing, other}


def test_results_are_members_of_sets():
    names = ("solution", "ray", "bundle", "motion", "ensemble", "branch", "stability")
    held = {made()[name] for name in names}
    assert all(made()[name] in held for name in names)
    assert not any(copy.deepcopy(made()[name]) in held for name in names)


def test_names_and_units_stand_everywhere():
    printed, formula = str(FALL), FALL._repr_latex_()
    assert "2 depth depth'' + depth'^2 + 1 = 0" in printed
    assert "x (m), depth (m)" in printed
    assert r"2 \mathrm{depth} \mathrm{depth}'' + \mathrm{depth}'^{2} + 1 = 0" in formula
    for name in ("solution", "comparison"):
        labels = {label for panel in made()[name].plot().axes for label in (panel.get_xlabel(), panel.get_ylabel())}
        assert {"x (m)", "depth (m)"} <= labels
    for name in ("rays", "bundle", "ray"):
        panel = made()[name].plot().axes[0]
        assert (panel.get_xlabel(), panel.get_ylabel()) == ("range (km)", "height (km)")
    left, right = made()["motion"].plot().axes
    assert (left.get_xlabel(), left.get_ylabel()) == ("t (s)", r"$\theta$ (rad)")
    assert right.get_ylabel() == r"$d\theta/dt$ (rad/s)"
    assert "t = 0 to" in str(made()["motion"])
    assert str(made()["motion"]).splitlines()[0].endswith(" s")
    waiting = vc.Problem(
        lambda t, y, dy: (dy**2 - y**2) / 2, vc.Fixed(0, 0), vc.Fixed(4, 1), names=("t", "h"), units=("s", "m")
    )
    check = vc.verify(vc.solve(waiting, vc.Collocation()))
    assert "conjugate or focal at t = 3.14159265359 s" in str(check)
    for name in ("rays", "ray", "bundle"):
        [path] = [row for row in str(made()[name]).splitlines() if "optical path:" in row]
        assert re.search(r"\d km\b", path), path
    [receiver] = optics.range_chart(SEA, (0.0, 0.0), (0.4, 0.1)).plot().axes
    assert receiver.get_ylabel() == "range (km) at height = 0.1 km"
    seen = optics.Study(SEA, optics.PointSource((0.0, 0.0)), rays=3, optical_path=0.5, receiver=(0.4, 0.1)).run()
    assert "up to an optical path of 0.5 km" in seen.table()
    assert "optical path (km)" in seen.table()
    assert [str(axis) for axis in PENDULUM.between([0.0], [1.0], 1.0).axes] == ["t (s)", "theta (rad)"]


@pytest.mark.parametrize("thing", [FALL, SEA, FALL.with_parameters({"g": 1.6}), PENDULUM.between([0.0], [1.0], 1.0)])
def test_names_units_and_surfaces_travel(thing):
    back = pickle.loads(pickle.dumps(thing))
    assert str(back) == str(thing)
    assert repr(back) == repr(thing)


def test_a_surface_travels():
    problem = made()["on a surface"].problem
    back = pickle.loads(pickle.dumps(problem))
    place = np.array([[0.6, 1.0], [0.1, 0.2]])
    theta, phi = place
    known = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    assert np.allclose(problem.on_surface(place), known, rtol=0, atol=1e-15)
    assert np.array_equal(back.on_surface(place), problem.on_surface(place))


@pytest.mark.parametrize("name", ["great_circle", "torus", "cone", "spheroid", "cylinder"])
def test_the_surface_of_a_geodesic_has_its_metric(name):
    """Length of a small step in space is L times the step: by a sixth-order difference of the declared surface."""
    checked = 0
    for reference in load(name):
        problem = reference.problem
        if not problem.surface_expressions:
            continue
        graph = isinstance(problem, vc.Problem)
        ends = np.array([
            [problem.start.x, problem.start.y] if graph else problem.start.q,
            [problem.end.x, problem.end.y] if graph else problem.end.q,
        ], dtype=float)  # fmt: skip
        middle, along = ends.mean(axis=0), np.array([1.0, 0.7])
        steps = 1e-2 * np.array([-3, -2, -1, 1, 2, 3])
        points = problem.on_surface(middle[:, None] + along[:, None] * steps)
        speed = np.linalg.norm(points @ np.array([-1, 9, -45, 45, -9, 1]) / 60 / 1e-2)
        if graph:
            known = problem.integrand_values(middle[:1], middle[1:, None], along[1:, None])[0]
        else:
            known = problem.integrand_values(middle[:, None], along[:, None])[0]
        assert speed == pytest.approx(known, rel=1e-9)
        checked += 1
    assert checked


def test_a_curve_is_drawn_on_its_surface():
    [panel] = made()["on a surface"].plot().axes
    points = [np.array(line.get_data_3d()) for line in panel.lines]
    assert len(points) > 20  # the net
    assert all(np.allclose(np.linalg.norm(part, axis=0), 1, atol=1e-9) for part in points)


def test_a_surface_given_by_an_equation_is_cut():
    [panel] = made()["in space"].plot().axes
    net = [np.array(line.get_data_3d()) for line in panel.lines][:-2]
    assert len(net) > 20
    assert all(np.abs(np.linalg.norm(part, axis=0) - 1).max() < 2e-3 for part in net)  # of linear pieces


@pytest.mark.parametrize(
    ("given", "wrong"),
    [
        ({"names": ("x",)}, "names must be 2"),
        ({"names": ("x", "x")}, "names must differ"),
        ({"units": ("m", "m", "m")}, "units must be 2"),
        ({"surface": lambda x, y: (x, y)}, "surface must return the 3"),
    ],
)
def test_what_is_wrong_with_names_and_surfaces(given, wrong):
    with pytest.raises(ValueError, match=wrong):
        vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(1, 1), **given)


def test_wrong_kinds_of_names_and_surfaces():
    ends = vc.Fixed(0, 0), vc.Fixed(1, 1)
    with pytest.raises(TypeError, match="names must be texts"):
        vc.Problem(lambda x, y, dy: dy**2, *ends, names="xy")
    with pytest.raises(TypeError, match="surface must accept 2 arguments"):
        vc.Problem(lambda x, y, dy: dy**2, *ends, surface=lambda q: (q, q, q))
    with pytest.raises(ValueError, match="names and units must be of the"):
        optics.Scene(optics.Uniform(1.0), names=("x",))
    with pytest.raises(ValueError, match="lies on no surface"):
        FALL.on_surface(np.zeros((2, 1)))


def test_multipliers_of_the_equation_are_those_of_the_solution():
    """On the chain of given length the written equation holds with solution.multipliers."""
    chain = vc.Problem(
        lambda x, y, dy: y * ca.sqrt(1 + dy**2), vc.Fixed(0, 1), vc.Fixed(1, 1),
        [vc.Isoperimetric(lambda x, y, dy: ca.sqrt(1 + dy**2), 1.5)],
    )  # fmt: skip
    assert vc.euler_lagrange_text(chain) == "lambda y'' - y y'' + y'^2 + 1 = 0"
    solution = vc.solve(chain)
    x, h = np.linspace(0.2, 0.8, 5), 1e-4
    y, dy, ddy = solution.y(x), solution.dy(x), (solution.dy(x + h) - solution.dy(x - h)) / (2 * h)
    assert np.abs(solution.multipliers[0] * ddy - y * ddy + dy**2 + 1).max() < 1e-5 * np.abs(ddy).max()


def test_packages_come_by_attribute():
    assert vc.problems.brachistochrone.references[0].name == "brachistochrone"
    assert vc.optics is optics
    assert vc.mechanics is mechanics
    assert "brachistochrone" in dir(vc.problems)
    with pytest.raises(AttributeError, match="no file 'nothing'"):
        vc.problems.nothing  # noqa: B018
    assert re.fullmatch(r"\d+\.\d+.*", vc.__version__)


def test_labels():
    assert [Axis(n).label for n in ("x", "depth", "theta", "y_1", "q2")] == [
        "x", "depth", r"$\theta$", "$y_{1}$", "$q_{2}$",
    ]  # fmt: skip
    for awkward in ("50%", "a b", "cost$", "x^2", "{y}", "h_max", "#1"):
        MATHTEXT.parse(Axis(awkward, "$/m").label)


@pytest.mark.parametrize("receiver", [(1.0, 0.1), (10.0, 0.4)], ids=["lit", "shadow"])
def test_what_was_searched_for_rays_has_the_unit_of_the_scene(receiver):
    rays = SEA.rays((0.0, 0.0), receiver)
    assert re.search(r"optical paths up to [\d.]+ km", rays.searched)
    assert bool(rays) == (not rays.reason)
    assert rays or rays.searched in rays.reason


def test_places_of_rest_and_small_motions_print_what_is_asked_of_them():
    pendulum = mechanics.System(lambda t, q, v: v[0] ** 2 / 2 + ca.cos(q[0]), ("theta",))
    printed = str(pendulum.equilibria([-1.0], [4.0]))
    assert printed.startswith("2 places of rest")
    assert "3.14159265359" in printed
    assert "unresolved" not in printed
    assert "0.540302+0.841471j" in str(pendulum.floquet([0.0], 1.0))  # exp(i)
    assert repr(vc.Fixed(0, np.array(1))) == "Fixed(x=0, y=1, dy=None)"


def test_coordinates_that_are_not_named_are_counted():
    chain = mechanics.System(lambda t, q, v: ca.sumsqr(v) / 2 - ca.sumsqr(q) / 2, tuple("abcdef"))
    printed = str(chain.motion([1.0] * 6, [0.0] * 6, (0, 1)))
    assert printed.startswith("A motion of a, b, c, d and 2 more from t = 0 to 1")


def test_units_of_a_sweep_stand_at_the_axes_of_its_picture():
    units = {"k": "N/m", "c": "N", "value": "J"}

    def loaded(k, c):
        return vc.Problem(lambda x, y, dy: dy**2 + k * y**2 + c * y, vc.Fixed(0, 0), vc.Fixed(1, 1))

    line = vc.sweep(loaded, {"c": [0.0], "k": [0, 1]}, units=units).plot().axes[0]
    assert (line.get_xlabel(), line.get_ylabel()) == ("k (N/m)", "functional (J)")
    labels = vc.sweep(loaded, {"c": [0.0, 1.0], "k": [0, 1]}, units=units).plot().axes
    assert {"k (N/m)", "c (N)", "functional (J)"} <= {text for a in labels for text in (a.get_xlabel(), a.get_ylabel())}
