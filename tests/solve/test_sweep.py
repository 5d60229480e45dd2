"""Sweeps: every point right, failures kept, and nothing lost when one ends early."""

import json
import math
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc.problems._curves import Cycloid
from varcalc.solve import sharing


def spring(**parameters):
    return vc.Problem(
        lambda x, y, dy, p: dy**2 + p.k * y**2,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        parameters={"k": 1.0} | parameters,
        name="spring",
    )


def stretched(k):
    return spring(k=k)


def descent(across, depth):
    return vc.Problem(
        lambda x, y, dy: ca.sqrt((1 + dy**2) / (2 * 9.81 * y)), vc.Fixed(0, 0), vc.Fixed(across, depth), name="descent"
    )


def least(k):
    """The integral of y'^2 + k y^2 from (0, 0) to (1, 1): sqrt(k) coth(sqrt(k)), and its continuation to k < 0."""
    root = math.sqrt(abs(k))
    return root / math.tanh(root) if k > 0 else root / math.tan(root) if k < 0 else 1.0


def test_every_point_of_a_grid_of_parameters():
    ks = np.linspace(0.0, 20.0, 23)
    found = vc.sweep(spring(), {"k": ks})
    np.testing.assert_allclose(found.values, [least(k) for k in ks], rtol=1e-10)
    assert [p.values for p in found.points] == [(k,) for k in ks]
    assert found.failures == ()


def test_end_points_are_varied_by_a_function_that_makes_the_problem():
    across, depth = (0.5, 1.0, 3.0), (0.5, 1.0)
    found = vc.sweep(descent, {"across": across, "depth": depth})
    exact = [[Cycloid.through(a, d).descent_time(9.81) for d in depth] for a in across]
    assert found.values.shape == (3, 2)
    np.testing.assert_allclose(found.values, exact, rtol=1e-10)


def test_a_point_without_an_answer_keeps_its_status():
    # beyond k = -pi^2 the ends are conjugate and there is no minimum
    found = vc.sweep(spring(), {"k": [-4.0, -20.0, 4.0]})
    assert [p.ok for p in found.points] == [True, False, True]
    assert found.failures[0].reason
    assert math.isnan(found.values[1])
    np.testing.assert_allclose(found.values[[0, 2]], [least(-4.0), least(4.0)], rtol=1e-10)


def test_a_solve_begins_from_its_neighbour(monkeypatch):
    guesses = []
    original = vc.solve

    def watched(problem, method, **options):
        guesses.append(options.get("guess"))
        return original(problem, method, **options)

    monkeypatch.setattr(sys.modules["varcalc.solve.row"], "solve", watched)
    vc.sweep(spring(), {"k": [1.0, 2.0, 3.0]}, vc.Collocation(elements=2))
    assert [g is None for g in guesses] == [True, False, False]
    assert [g.problem.parameters["k"] for g in guesses[1:]] == [1.0, 2.0]
    for together in (None, vc.Collocation()):  # the others are solved together
        guesses.clear()
        vc.sweep(spring(), {"k": [1.0, 2.0, 3.0]}, together)
        assert guesses == [None]


def test_a_worker_that_takes_its_time_reports_and_goes_on(monkeypatch):
    monkeypatch.setattr(sharing, "REPORT", 0.0)
    job = sharing.Job.of(stretched, None, 1e-10, 2)
    sent = pickle.dumps([{"k": 1.0}, {"k": 2.0}])
    assert [p.values for p in pickle.loads(sharing.chunk(job, sent))] == [(1.0,)]
    with ThreadPoolExecutor(1) as executor:
        found = vc.sweep(stretched, {"k": [1.0, 2.0, 3.0, 4.0, 5.0]}, executor=executor)
    np.testing.assert_allclose(found.values, [least(k) for k in (1, 2, 3, 4, 5)], rtol=1e-10)


def test_a_function_without_arguments_makes_the_problem_once():
    made = []

    def make():
        made.append(spring())
        return made[-1]

    found = vc.sweep(make, {"k": [1.0, 2.0, 3.0]})
    np.testing.assert_allclose(found.values, [least(k) for k in (1, 2, 3)], rtol=1e-10)
    assert len(made) == 1


def test_a_curve_over_another_interval_is_no_guess():
    found = vc.sweep(
        lambda to: vc.Problem(lambda x, y, dy: ca.sqrt(1 + dy**2), vc.Fixed(0, 0), vc.Fixed(to, 1)), {"to": [1, 2]}
    )
    np.testing.assert_allclose(found.values, [math.sqrt(2), math.sqrt(5)], rtol=1e-12)


def test_several_cores_find_the_same():
    ks = np.linspace(0.0, 10.0, 20)
    # what a process imports is found by its module's name, which a test file loaded by its path has not
    from varcalc.cli.measuring import _Loaded

    alone = vc.sweep(_Loaded("brachistochrone"), {"g": 1 + ks})
    shared = vc.sweep(_Loaded("brachistochrone"), {"g": 1 + ks}, cores=2)
    np.testing.assert_allclose(shared.values, alone.values, rtol=1e-12)
    np.testing.assert_allclose(shared.values * np.sqrt(1 + ks), shared.values[0], rtol=1e-10)


class Interrupted(Exception):
    pass


def test_an_interrupted_sweep_goes_on_where_it_was(tmp_path, monkeypatch):
    store, count = tmp_path / "sweep.jsonl", 0
    original = vc.solve

    def watched(problem, method, **options):
        nonlocal count
        if count == 3:
            raise Interrupted
        count += 1
        return original(problem, method, **options)

    ks = [1.0, 2.0, 3.0, 4.0, 5.0]
    monkeypatch.setattr(sys.modules["varcalc.solve.row"], "solve", watched)
    with pytest.raises(Interrupted):
        vc.sweep(stretched, {"k": ks}, store=store)
    # and the machine went down while it wrote
    with store.open("a", encoding="utf-8") as file:
        file.write('{"at": [3], "val')
    count = -10
    found = vc.sweep(stretched, {"k": ks}, store=store)
    assert count == -10 + 2
    np.testing.assert_allclose(found.values, [least(k) for k in ks], rtol=1e-10)
    assert vc.sweep(stretched, {"k": ks}, store=store) == found
    assert count == -10 + 2


def test_the_store_of_another_sweep_is_refused(tmp_path):
    store = tmp_path / "sweep.jsonl"
    vc.sweep(spring(), {"k": [1.0]}, store=store)
    with pytest.raises(ValueError, match="with other values of the parameters"):
        vc.sweep(spring(), {"k": [2.0]}, store=store)
    store.write_text("something else\n", encoding="utf-8")
    with pytest.raises(ValueError, match="is no store of this sweep"):
        vc.sweep(spring(), {"k": [1.0]}, store=store)
    assert store.read_text(encoding="utf-8") == "something else\n"


def test_a_store_tells_another_problem_from_the_same_one_made_anew(tmp_path):
    store = tmp_path / "sweep.jsonl"
    first = vc.sweep(spring(), {"k": [1.0, 2.0]}, store=store)
    assert vc.sweep(spring, {"k": [1.0, 2.0]}, store=store) == first
    softer = vc.Problem(
        lambda x, y, dy, p: dy**2 + 0.999 * p.k * y**2,
        vc.Fixed(0, 0),
        vc.Fixed(1, 1),
        parameters={"k": 1.0},
        name="spring",
    )
    moved = vc.Problem(
        lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 2), parameters={"k": 1.0}, name="spring"
    )
    for other in (softer, moved):
        with pytest.raises(ValueError, match="is the store of a sweep of another problem; give another name"):
            vc.sweep(other, {"k": [1.0, 2.0]}, store=store)
    with pytest.raises(ValueError, match="to another tolerance"):
        vc.sweep(spring(), {"k": [1.0, 2.0]}, tol=1e-6, store=store)
    with pytest.raises(ValueError, match="by another method"):
        vc.sweep(spring(), {"k": [1.0, 2.0]}, vc.Collocation(), store=store)


def test_a_line_that_was_cut_short_is_dropped_with_a_note_and_a_damaged_one_refused(tmp_path):
    store = tmp_path / "sweep.jsonl"
    whole = vc.sweep(spring(), {"k": [1.0, 2.0]}, store=store)
    text = store.read_text(encoding="utf-8")
    store.write_text(text[:-20], encoding="utf-8")
    partial = vc.Sweep.load(store)
    assert [p.status for p in partial.points] == ["solved", "missing"]
    rows, _, said = partial.table().partition("\n\n")
    assert len(rows.splitlines()) == 3, "headings, a rule and the point that is there"
    assert said.splitlines()[0] == "1 of 2 points not solved yet"
    again = vc.sweep(spring(), {"k": [1.0, 2.0]}, store=store)
    assert again.notes == ("the last line of sweep.jsonl was cut short and dropped; its point is solved again",)
    assert again.notes[0] in again.table()
    np.testing.assert_allclose(again.values, whole.values, rtol=1e-12)
    assert vc.Sweep.load(store) == again
    store.write_text(text.replace('"status"', '"state"', 1), encoding="utf-8")
    with pytest.raises(ValueError, match="is no store of this sweep \\(line 2: a point has no state\\)"):
        vc.sweep(spring(), {"k": [1.0, 2.0]}, store=store)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("[1, 2]", "at must be a list of 1 whole numbers, not None"),
        ("[" * 100_000, "nested too deeply"),
        ({"at": [7]}, r"at = \[7\] lies outside the grid, which has 2 points"),
        ({"at": [True]}, r"at must be a list of 1 whole numbers, not \[True\]"),
        ({"values": [5.0]}, r"values = \[5.0\] are not those of the grid there, \[1.0\]"),
        ({"values": [float("nan")]}, "NaN is no number"),
        ({"status": "fine"}, "status must be one of solved, .*, not 'fine'"),
        ({"value": None}, "a point that is solved has a value"),
        ({"status": "refused"}, "a point that is refused has no value"),
        ({"value": "3"}, "value must be a number or null, not '3'"),
        ({"claimed_error": -1.0}, "claimed_error must be a number that is not negative, or null"),
        ({"message": 5}, "message must be words, not 5"),
        ({"lower": "low"}, "lower must be a number, null or"),
    ],
)
def test_a_line_that_no_sweep_writes_is_refused_with_its_number_and_the_reason(tmp_path, line, told):
    store = tmp_path / "sweep.jsonl"
    vc.sweep(spring(), {"k": [1.0, 2.0]}, store=store)
    head, first, *_ = store.read_text(encoding="utf-8").splitlines()
    written = line if isinstance(line, str) else json.dumps(json.loads(first) | line)
    store.write_text(f"{head}\n{written}\n", encoding="utf-8")
    for reader in (vc.Sweep.load, lambda path: vc.sweep(spring(), {"k": [1.0, 2.0]}, store=path)):
        with pytest.raises(ValueError, match=rf"is no store of this sweep \(line 2: .*{told}"):
            reader(store)


@pytest.mark.parametrize(
    ("part", "told"),
    [
        ({"grid": {}}, "grid must map names to values"), ({"grid": {"k": "12"}}, r"grid\['k'\] must be a sequence"),
        ({"paired": 1}, "paired must be true or false, not 1"), ({"units": {"k": 2}}, "units must be units by"),
        ({"tol": "fine"}, "tol must be a number, not 'fine'"), ({"problem": None}, "problem must be what tells it"),
    ],
)  # fmt: skip
def test_a_first_line_that_no_sweep_writes_is_refused_with_the_reason(tmp_path, part, told):
    store = tmp_path / "sweep.jsonl"
    vc.sweep(spring(), {"k": [1.0, 2.0]}, store=store)
    head, *rest = store.read_text(encoding="utf-8").splitlines()
    store.write_text("\n".join([json.dumps(json.loads(head) | part), *rest, ""]), encoding="utf-8")
    with pytest.raises(ValueError, match=rf"\(line 1: {told}"):
        vc.Sweep.load(store)


def test_what_lies_infinitely_low_is_stored(tmp_path):
    store = tmp_path / "sweep.jsonl"
    # y^4 outweighs y^2 once the curve is large, and then falls for ever
    falling = vc.Problem(
        lambda x, y, dy, p: dy**2 + p.k * y**2 - y**4 / 10, vc.Fixed(0, 0), vc.Fixed(1, 0.1), parameters={"k": 1.0}
    )
    found = vc.sweep(falling, {"k": [1.0, 2.0]}, store=store)
    assert [(p.local, p.lower) for p in found.points] == [(True, -math.inf)] * 2
    assert vc.Sweep.load(store) == found
    assert "local" in found.table()


def test_a_value_that_allows_no_problem_is_a_row():
    found = vc.sweep(lambda to: vc.Problem(lambda x, y, dy: dy**2, vc.Fixed(0, 0), vc.Fixed(to, 1)), {"to": [0, 1, 2]})
    assert [p.status for p in found.points] == ["failed", "solved", "solved"]
    assert found.points[0].message.startswith("ValueError: ")
    np.testing.assert_allclose(found.values[1:], [1, 0.5], rtol=1e-12)


def test_what_a_function_measures_or_has_solved_is_taken():
    found = vc.sweep(lambda k: vc.Measured(k**2, 1e-9) if k else vc.Measured(math.nan, message="none"), {"k": [0, 3]})
    assert [(p.value, p.claimed_error, p.message) for p in found.points] == [(None, None, "none"), (9.0, 1e-9, "")]
    solved = vc.sweep(lambda k: vc.solve(spring(k=k)), {"k": [1.0, 4.0]})
    np.testing.assert_allclose(solved.values, [least(1), least(4)], rtol=1e-10)
    with pytest.raises(TypeError, match=r"Measured\.value must be a number"):
        vc.Measured("far")


def test_the_result_has_axes_with_names_and_units():
    grid, units = {"across": [1.0, 2.0, 5.0], "depth": [0.5, 1.0]}, {"across": "m", "depth": "m", "value": "s"}
    found = vc.sweep(descent, grid, units=units)
    data = found.to_xarray()
    assert data["value"].dims == ("across", "depth")
    assert data["value"].sel(across=2.0, depth=0.5) == found.values[1, 0]
    assert [data[name].attrs["units"] for name in ("across", "depth", "value", "claimed_error")] == ["m", "m", "s", "s"]
    frame = found.to_pandas()
    assert list(frame.columns[:4]) == ["across", "depth", "status", "value"]
    assert frame.set_index(["across", "depth"])["value"][5.0, 1.0] == found.values[2, 1]
    assert frame.attrs["units"] == units
    assert "across (m)" in found.table()
    pairs = vc.sweep(descent, vc.Paired({"across": [1.0, 2.0], "depth": [1.0, 0.5]})).to_xarray()
    assert pairs["value"].dims == ("point",)
    assert pairs["depth"].values.tolist() == [1.0, 0.5]


@pytest.mark.parametrize(
    ("problem", "grid", "options", "error", "message"),
    [
        (3.0, {"k": [1]}, {}, TypeError, "problem must be a Problem, a Curve or a function"),
        (spring(), {}, {}, ValueError, "grid must map names to values"),
        (spring(), {"k": []}, {}, ValueError, r"grid\['k'\] is empty"),
        (spring(), {"k": "12"}, {}, TypeError, r"grid\['k'\] must be a sequence"),
        (spring(), {"k": [math.nan]}, {}, ValueError, r"grid\['k'\] must be finite"),
        (spring(), {"g": [1.0]}, {}, ValueError, "are no parameters of this problem"),
        (spring(), {"k": [1.0]}, {"cores": 0}, ValueError, "cores must be at least 1"),
        (spring(), {"k": [1.0]}, {"executor": 2}, TypeError, r"must be a concurrent\.futures\.Executor, not 2"),
        (spring(), {"k": [1.0]}, {"units": {"g": "m"}}, ValueError, "units names 'g', which is not swept"),
        (spring(), {"k": [1.0]}, {"method": vc.Ritz}, TypeError, "is the class Ritz"),
        (spring(), {"k": [1.0]}, {"tol": 0}, ValueError, "tol must be a positive number"),
    ],
)
def test_what_cannot_be_swept_is_refused(problem, grid, options, error, message):
    with pytest.raises(error, match=message):
        vc.sweep(problem, grid, **options)
