"""Figures drawn anew: each is computed and drawn, and shows what its caption says."""

from functools import lru_cache

import numpy as np
import pytest
from click.testing import CliRunner

from varcalc.charts import drawing_picture
from varcalc.cli import main
from varcalc.study.drawing import Drawing, Levels, Line, Panel, Points, Text
from varcalc.study.figures import figure_catalogue, load_figure

ASKED = [
    *("2.7", "2.12", "3.2", "3.4", "3.6", "3.8", "3.9", "3.10", "3.11", "4.4", "4.5", "4.8", "5.5", "5.8", "6.6"),
    *("7.7", "7.10", "7.11", "7.12", "7.13", "8.1", "8.3", "8.5", "8.6", "8.7"),
]


@lru_cache
def panels(number):
    return [panel for row in load_figure(number).rows for panel in row]


def lines(panel):
    return [part.places for part in panel.parts if isinstance(part, Line)]


def test_the_catalogue_has_the_figures_in_the_order_of_their_numbers():
    assert list(figure_catalogue()) == ASKED


@pytest.mark.parametrize("number", list(figure_catalogue()))
def test_every_figure_is_computed(number):
    for panel in panels(number):
        assert panel.x
        assert panel.y
        for part in panel.parts:
            if isinstance(part, Line):
                assert np.all(np.isfinite(part.places))
                assert len(part.places) == (3 if panel.z else 2)
            elif isinstance(part, Levels):
                values = np.asarray(part.values)
                assert values.min() < min(part.levels) <= max(part.levels) < values.max()


@pytest.mark.parametrize(
    ("number", "rests", "back"), [("7.10", False, False), ("7.11", True, False), ("7.12", True, True)]
)
def test_cases_of_nutation(number, rests, back):
    flat, space = panels(number)
    (phi, theta), *limits = lines(flat)
    step = np.diff(phi)
    assert (step.min() < -1e-6) == back
    assert (np.abs(step).min() < 1e-4 * np.abs(step).max()) == (rests and not back)
    assert (theta.min(), theta.max()) == pytest.approx(sorted(limit[1, 0] for limit in limits), abs=1e-4)
    np.testing.assert_allclose(np.linalg.norm(lines(space)[0], axis=0), 1, rtol=1e-14)


def test_orbits_of_the_asymmetric_top_lie_on_their_ellipsoids():
    middle = 1.3
    for part in panels("7.7")[0].parts[:-1]:
        omega, ratio = part.places, float(part.label.split("=")[1])
        moments = np.array([ratio, middle, 1.0])
        for power in (1, 2):
            kept = moments**power @ omega**2
            np.testing.assert_allclose(kept, kept[0], rtol=1e-3)  # the label has four digits


def test_roots_of_the_cubic_on_the_cone():
    for epsilon, sigma in lines(panels("3.6")[0])[:3]:
        np.testing.assert_allclose(2 * sigma**3 - 3 * epsilon * sigma**2 + 1, 0, atol=1e-12)


def test_the_effective_potentials_have_their_wells():
    wells = []
    for _, value in lines(panels("3.8")[0]):
        turns = np.diff(np.sign(np.diff(value)))
        wells.append((np.count_nonzero(turns > 0), np.diff(value)[100:-60].min() > -1e-3))
    assert [count for count, _ in wells] == [1, 1, 2]
    for u, value in lines(panels("7.13")[0])[:-1]:
        assert np.count_nonzero(np.diff(np.sign(np.diff(value))) > 0) == 1
        assert np.all(value >= u - 1e-12)


def test_the_wells_of_the_charged_pendulum_are_parted_by_the_separatrix():
    lower, between, upper = lines(panels("3.10")[0])
    assert lower[1].max() < between[1].max() < upper[1].min()
    assert lower[1].max() < 0 < upper[1].min()
    turned = [np.diff(phi) for phi, _ in (lines(panel)[0] for panel in panels("3.11")[:3])]
    assert all(step.min() < 0 < step.max() for step in turned)


def test_orbits_of_bodies_and_in_wells():
    first, second = lines(panels("4.4")[0])[:2]
    np.testing.assert_allclose(first + 2 * second, 0, atol=1e-13)  # m1 r1 + m2 r2
    x, y = lines(panels("4.5")[0])[0]
    gamma = np.sqrt(1 - 1 / 8)
    theta = np.unwrap(np.arctan2(y, x))
    np.testing.assert_allclose(np.hypot(x, y), gamma**2 / (1 + 0.5 * np.cos(gamma * theta)), rtol=1e-12)
    chords = lines(panels("4.8")[0])[0]
    start, end = chords[:, 1:-1], chords[:, 2:]
    along = (end - start) / np.linalg.norm(end - start, axis=0)
    np.testing.assert_allclose(np.abs(start[0] * along[1] - start[1] * along[0]), 0.6, rtol=1e-12)
    np.testing.assert_allclose(np.hypot(*start), 1, rtol=1e-12)


def test_dots_of_cross_sections_lie_on_their_lines():
    _, dots = lines(panels("5.5")[0])
    np.testing.assert_allclose(dots[1], np.sin(dots[0] / 2) ** -4.0, rtol=5e-3)  # from 3000 r0 away
    assert len(dots[0]) > 8
    for panel in panels("5.8"):
        for part, dots in zip(panel.parts[::2], panel.parts[1::2], strict=True):
            n, half = float(part.label.split("=")[1]), np.cos(dots.places[0] / 2)
            exact = n**2 * (n * half - 1) * (n - half) / (half * (1 + n**2 - 2 * n * half) ** 2)
            np.testing.assert_allclose(dots.places[1], exact, rtol=2e-6)


def test_foucaults_pendulum_and_coupled_blocks():
    n, w = 0.025, np.hypot(1, 0.025)
    x, y = lines(panels("6.6")[1])[0]
    t = np.linspace(0, np.pi / n, len(x))
    exact = 1j * np.exp(-1j * n * t) * (np.cos(w * t) + 1j * n / w * np.sin(w * t))
    np.testing.assert_allclose(x + 1j * y, exact, atol=1e-12)
    for panel, frequency in zip(panels("8.7"), (1, np.sqrt(5)), strict=True):
        ((time, eta),) = lines(panel)
        np.testing.assert_allclose(eta, np.cos(frequency * time), atol=1e-12)
    for panel in panels("8.5")[1::2]:
        assert np.abs(lines(panel)[0].sum(axis=0)).max() <= 1 + 1e-12


def test_equilibria_and_wires():
    stable, unstable = (part for part in panels("8.1")[0].parts if isinstance(part, Points))
    ratio, theta = stable.places
    np.testing.assert_allclose(np.cos(theta[ratio < 1]), ratio[ratio < 1], atol=1e-12)
    np.testing.assert_allclose(theta[ratio > 1], 0, atol=1e-12)
    assert np.all(unstable.places[0] < 1)
    stable_orbit, circle, spiral = (np.hypot(*lines(panel)[0]) for panel in panels("8.3"))
    assert stable_orbit.max() <= 1 + 1e-12
    np.testing.assert_allclose(circle, 1, atol=1e-12)
    assert np.all(np.diff(spiral) >= 0)


def test_every_kind_of_part_is_drawn(tmp_path):
    x = np.linspace(-1, 1, 21)
    grid = np.add.outer(x**2, x**2)
    flat = Panel(
        [Line(x, x**2, label="a"), Points([0.0], [0.5]), Levels(x, x, grid, [0.5]), Text(0.0, 0.0, "here")], "x", "y",
        title="flat", equal=True, within=(-1, 1, -1, 1),
    )  # fmt: skip
    space = Panel([Line(x, x, x, dashed=True), Points([0.0], [0.0], [1.0])], "x", "y", "z", sphere=True)
    steep = Panel([Line(x, np.exp(9 * x))], "x", "y", logarithmic=True)
    drawn = drawing_picture(Drawing("All", lambda: [[flat, space], [steep]]))
    assert [axes.get_title() for axes in drawn.axes] == ["flat", "", ""]
    assert drawn.axes[2].get_yscale() == "log"
    drawn.savefig(tmp_path / "all.png", dpi=40)
    with pytest.raises(ValueError, match="no panel"):
        _ = Drawing("None", list).rows


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_the_command_draws_lists_and_refuses(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("figure", "3.6").exit_code == 0
    assert (tmp_path / "figure_3_6.png").stat().st_size > 10_000
    listed = run("list", "--figures").output.splitlines()
    assert [line.split()[0] for line in listed] == ASKED
    unknown = run("figure", "9.9")
    assert (unknown.exit_code, "is no figure of the catalogue" in unknown.output) == (2, True)
    own = tmp_path / "own.py"
    own.write_text(
        "from varcalc.study.drawing import Drawing, Line, Panel\n"
        'figure = Drawing("Mine", lambda: [[Panel([Line([0, 1], [0, 1])], "x", "y")]])\n',
        encoding="utf-8",
    )
    assert run("figure", own, "-o", tmp_path / "mine.svg").exit_code == 0
    own.write_text("figure = 3\n", encoding="utf-8")
    assert "must be a varcalc.study.drawing.Drawing" in run("figure", own).output
    own.write_text(
        'from varcalc.study.drawing import Drawing\nfigure = Drawing("Empty", lambda: [])\n', encoding="utf-8"
    )
    assert run("figure", own).exit_code == 1
