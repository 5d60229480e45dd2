"""Every ray model against every other that applies, over a set of scenes."""

from itertools import combinations

import casadi as ca
import numpy as np
import pytest

from varcalc import optics

CARRIERS = (optics.Straight(), optics.Linear(), optics.Parabolas(), optics.Invariants(), optics.Hamilton())
FAN = np.array([[np.cos(t), np.sin(t)] for t in np.linspace(0.03, 6.2, 23)])
CONE = np.array([[np.cos(3 * t), np.sin(5 * t), np.cos(2 * t + 1)] for t in np.linspace(0.1, 3.1, 17)])
HEIGHTS = np.linspace(-2.0, 2.0, 12)
KINKED = optics.Tabulated(HEIGHTS, 1.5 - 0.1 * HEIGHTS**2, smooth=False)
FALLING = optics.Stratified(lambda y: ca.sqrt(1 - 2 * y))
DUCT = optics.Stratified(lambda y: 1.5 * ca.sqrt(1 - 0.3 * y**2))
LINEAR, ROUND = optics.Stratified(lambda y: 1.3 * (1 - 0.2 * y)), optics.Stratified(lambda y: 1.3 / (2 + y))

SCENES = {
    "uniform": (optics.Scene(optics.Uniform(1.5)), (0.1, 0.2), FAN),
    "parabolas": (optics.Scene(FALLING), (0.1, 0.2), FAN),
    "parabolas in space": (optics.Scene(FALLING), (0.1, 0.2, 0.1), CONE),
    "linear index": (optics.Scene(LINEAR), (0.0, 1.0), FAN),
    "H/y": (optics.Scene(ROUND), (0.0, 1.0), FAN),
    "exponential": (optics.Scene(optics.Stratified(lambda y: 1.3 * ca.exp(-0.2 * y))), (0.0, 1.0), FAN),
    "duct in space": (optics.Scene(DUCT), (0.0, 0.1, 0.2), CONE),
    "fish-eye": (optics.Scene(optics.fish_eye()), (0.5, 0.2), FAN),
    "fish-eye in space": (optics.Scene(optics.fish_eye()), (0.5, 0.2, 0.1), CONE),
    "Luneburg": (optics.Scene(optics.luneburg()), (-0.6, 0.2), FAN),
    "Eaton": (optics.Scene(optics.eaton()), (-0.6, 0.2), FAN),
    "off the origin": (optics.Scene(optics.Radial(lambda r: 1.2 + ca.exp(-r * r), (0.3, -0.4))), (-0.6, 0.2), FAN),
    "kinked table": (optics.Scene(KINKED), (0.1, 0.03), FAN),
    "kinked table in space": (optics.Scene(KINKED), (0.1, 0.2, 0.03), CONE),
    "glass": (
        optics.Scene([optics.Uniform(1.0), optics.Uniform(1.5)], [optics.Plane((0, -0.3), (0, 1))]),
        (0.1, 0.2), FAN,
    ),
    "layers apart": (
        optics.Scene([FALLING, DUCT], [optics.Plane((0, -0.3), (0, 1))]), (0.1, 0.2), FAN,
    ),
    "shells": (
        optics.Scene([optics.fish_eye(), optics.luneburg(2.0)], [optics.Sphere((0, 0), 0.8)]), (0.5, 0.2), FAN,
    ),
}  # fmt: skip


def applying(scene, start, directions, **question):
    """The bundles of all models that apply."""
    bundles = []
    for model in CARRIERS:
        try:
            bundles.append(scene.trace(start, directions, model=model, with_spreading=True, **question))
        except optics.DoesNotApply as refusal:
            assert "needs" in str(refusal)  # noqa: PT017  there need not be a refusal
            assert "take Hamilton()" in str(refusal)  # noqa: PT017
    return bundles


@pytest.mark.parametrize("name", SCENES)
def test_every_pair_of_models_gives_one_bundle(name):
    scene, start, directions = SCENES[name]
    bundles = applying(scene, start, directions, optical_path=1.3)
    assert len(bundles) >= 2
    for one, other in combinations(bundles, 2):
        np.testing.assert_array_equal(one.status, other.status)
        rows = one.arrived
        assert np.any(rows)
        np.testing.assert_allclose(one.points[rows], other.points[rows], rtol=0, atol=3e-13)
        np.testing.assert_allclose(one.directions[rows], other.directions[rows], rtol=0, atol=3e-13)
        np.testing.assert_allclose(one.spreading[rows], other.spreading[rows], rtol=0, atol=2e-12)


@pytest.mark.parametrize(
    ("name", "until"),
    [
        ("parabolas", optics.Plane((0, -0.3), (0, 1))),
        ("parabolas", optics.Plane((0.5, 0), (1, 0))),
        ("linear index", optics.Plane((0.5, 0), (1, 0))),
        ("H/y", optics.Plane((0, 2.0), (0, 1))),
        ("Luneburg", optics.Sphere((0, 0), 1.0)),
        ("uniform", optics.Plane((0.5, 0), (1, 0))),
        ("kinked table", optics.Plane((0, 0.7), (0.1, 1))),
    ],
)
def test_every_pair_of_models_stops_at_one_place(name, until):
    scene, start, directions = SCENES[name]
    if name == "kinked table":  # caught rays of others would go on for ever
        directions = directions[np.abs(directions[:, 1]) > 0.9]
    bundles = applying(scene, start, directions, until=until)
    assert len(bundles) >= 2
    for one, other in combinations(bundles, 2):
        np.testing.assert_array_equal(one.status, other.status)
        rows = one.arrived
        assert np.any(rows)
        np.testing.assert_allclose(one.points[rows], other.points[rows], rtol=0, atol=3e-13)
        np.testing.assert_allclose(one.optical_path[rows], other.optical_path[rows], rtol=1e-12)
        np.testing.assert_allclose(one.spreading[rows], other.spreading[rows], rtol=0, atol=2e-12)


@pytest.mark.parametrize(
    ("name", "end", "within"),
    [
        ("uniform", (1.0, 0.5), 3.0),
        ("parabolas", (0.5, -0.1), 3.0),
        ("H/y", (1.4, 0.4), 4.0),
        ("fish-eye", (-0.3, 0.9), 6.0),
        ("Luneburg", (0.3, 0.4), 4.0),
        ("kinked table", (1.7, 0.4), 3.0),
        ("glass", (0.9, -1.0), 4.0),
        ("layers apart", (0.4, -0.8), 4.0),
    ],
)
def test_every_pair_of_models_finds_the_same_rays(name, end, within):
    scene, start, _ = SCENES[name]
    answers = []
    for model in CARRIERS:
        try:
            answers.append(scene.rays(start, end, within=within, model=model))
        except optics.DoesNotApply:
            continue
    assert len(answers) >= 2
    assert len({len(answer) for answer in answers}) == 1
    answers.append(
        scene.rays(start, end, within=within, model=optics.Fermat())
    )  # it may leave saddles out, and says so
    assert len(answers[-1]) >= 1
    for one, other in combinations(answers, 2):
        for b in other:
            a = min(one, key=lambda ray: abs(ray.optical_path - b.optical_path))
            assert abs(a.optical_path - b.optical_path) <= 4 * (a.error + b.error)
            assert abs(a.optical_path - b.optical_path) <= 1e-11
            assert a.index == b.index


def test_the_answer_names_its_model():
    scene = optics.Scene(FALLING)
    names = [scene.rays((0, 0), (0.5, 0), model=m)[0].model for m in (None, optics.Invariants(), optics.Fermat())]
    assert names == ["linear ray equation", "invariants and quadrature", "Fermat's principle"]
    assert optics.Scene(KINKED).trace((0, 0.03), FAN, optical_path=0.2).model == "parabolic arcs"
    assert scene.trace((0, 0), FAN, optical_path=0.2, model=optics.Invariants()).model == names[1]


def test_a_model_that_does_not_apply_is_refused_with_what_it_needs():
    graded = optics.Scene(optics.Graded(lambda x, y: 1 + x * x + y))
    for model, need in (
        (optics.Straight(), "uniform media"),
        (optics.Linear(), "second degree"),
        (optics.Invariants(), "height alone"),
        (optics.Parabolas(), "linear between heights"),
        (optics.Fermat(), "two points"),
    ):
        with pytest.raises(optics.DoesNotApply, match=need):
            graded.trace((0, 0), (1, 0), optical_path=1.0, model=model)
    tilted = optics.Scene([FALLING, DUCT], [optics.Plane((0, -0.3), (1, 1))])
    with pytest.raises(optics.DoesNotApply, match="horizontal and vertical planes"):
        tilted.trace((0, 0), (1, 0), optical_path=1.0, model=optics.Invariants())
    ball = optics.Scene([optics.fish_eye(), optics.Uniform(1.0)], [optics.Sphere((0.1, 0), 1.0)])
    with pytest.raises(optics.DoesNotApply, match="spheres about the centre"):
        ball.trace((0, 0.2), (1, 0), optical_path=1.0, model=optics.Invariants())
    with pytest.raises(TypeError, match="model must be a ray model"):
        graded.trace((0, 0), (1, 0), optical_path=1.0, model="hamilton")
