"""How far a long call has come, and what is known when it is stopped."""

import io
import sys
import time

import casadi as ca
import numpy as np
import pytest

import varcalc as vc
from varcalc import optics
from varcalc.progress import telling

SPRING = vc.Problem(
    lambda x, y, dy, p: dy**2 + p.k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1), parameters={"k": 1.0}, name="spring"
)

SOLVED = vc.solve(SPRING)
STRING = vc.Problem(
    lambda x, y, v: v**2, vc.Fixed(0, 0), vc.Fixed(1, 0), [vc.Isoperimetric(lambda x, y, v: y**2, 1.0)], name="string"
)


class Told(list):
    """Who remembers what is told, and may stop the call as Ctrl-C does."""

    def __init__(self, stop_at=None):
        self.stop_at = stop_at

    def __call__(self, done, total, what):
        self.append((done, total, what))
        if done == self.stop_at:
            raise KeyboardInterrupt


class Terminal(io.StringIO):
    def isatty(self):
        return True


CALLS = {
    "solve": lambda progress: vc.solve(SPRING, progress=progress),
    "extremals": lambda progress: vc.extremals(SPRING, progress=progress),
    "compare": lambda progress: vc.compare(SPRING, [vc.Ritz(), None], progress=progress),
    "sweep": lambda progress: vc.sweep(SPRING, {"k": [1, 2, 3]}, progress=progress),
    "diagnose": lambda progress: vc.diagnose(SPRING, progress=progress),
    "work_precision": lambda progress: vc.work_precision(
        [SPRING], [vc.Ritz()], [1e-4], exact=[1 / np.tanh(1.0)], repeats=1, progress=progress
    ),
    "trace": lambda progress: optics.Scene(optics.Uniform(1.0)).trace(
        (0, 0), (1, 0), optical_path=1.0, progress=progress
    ),
    "certify": lambda progress: vc.certify(SOLVED, progress=progress),
    "certify_eigenvalues": lambda progress: vc.certify_eigenvalues(STRING, 2, progress=progress),
    "arrivals": lambda progress: optics.Scene(optics.Uniform(1.0)).arrivals((0, 0), [(1, 0)], progress=progress),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_long_call_tells_a_function(name, capsys):
    told = Told()
    CALLS[name](told)
    assert told
    assert all(total is None or 0 <= done <= total for done, total, _ in told)
    assert all(isinstance(what, str) for _, _, what in told)
    counted = [done for done, total, _ in told if total]
    assert counted == sorted(counted)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("name", CALLS)
def test_what_is_no_progress_is_refused(name):
    with pytest.raises(TypeError, match="progress must be a function of \\(done, total, what\\), True, False or None"):
        CALLS[name]("bar")


def test_a_bar_is_shown_where_it_is_asked_for_and_nothing_to_a_script(capsys):
    assert len(vc.sweep(SPRING, {"k": [1, 2]}, progress=True).points) == 2
    assert "sweep" in capsys.readouterr().err
    vc.sweep(SPRING, {"k": [1, 2]})
    assert capsys.readouterr() == ("", "")


def test_a_terminal_sees_a_bar_after_a_second_and_none_before(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    clock = iter([0.0, 0.5, 1.5])
    monkeypatch.setattr("varcalc.progress.time.perf_counter", lambda: next(clock))
    with telling(None, "the call") as told:
        told(1, 3, "early")
        assert sys.stderr.getvalue() == ""
        told(2, 3, "late")
    assert "the call" in sys.stderr.getvalue()
    assert "late" in sys.stderr.getvalue()
    assert "early" not in sys.stderr.getvalue()


def test_a_terminal_sees_a_bar_of_a_call_that_tells_once_and_then_is_long(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr("varcalc.progress.SECONDS_WITHOUT_BAR", 0.01)
    with telling(None, "the call") as told:
        told(0, None, "the long part")
        given_up = time.monotonic() + 60
        while "the long part" not in sys.stderr.getvalue() and time.monotonic() < given_up:
            time.sleep(0.01)
    assert "the long part" in sys.stderr.getvalue()


def test_no_bar_comes_after_the_call(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr("varcalc.progress.SECONDS_WITHOUT_BAR", 0.2)
    with telling(None, "the call") as told:
        told(0, None, "a short part")
    time.sleep(0.4)
    assert sys.stderr.getvalue() == ""


def test_a_notebook_shows_a_bar_of_its_own(monkeypatch):
    display = pytest.importorskip("IPython.display", reason="notebooks come with IPython")
    shown = []

    class Place:
        def update(self, data, *, raw):
            assert raw
            shown.append(data)

    monkeypatch.setattr(display, "display", lambda data, **_: shown.append(data) or Place())
    monkeypatch.setitem(sys.modules, "ipykernel", object())
    with telling(True, "a <call>") as told:
        told(1, 3, "early & late")
    assert shown[1]["text/html"] == 'a &lt;call&gt; <progress value="1" max="3"></progress> 1 of 3, early &amp; late'
    assert shown[-1] == {"text/plain": "", "text/html": ""}


def test_ctrl_c_leaves_what_is_known():
    with pytest.raises(vc.Interrupted) as stopped:
        CALLS["compare"](Told(stop_at=1))
    assert [row.label for row in stopped.value.known.rows] == ["Ritz"]
    with pytest.raises(KeyboardInterrupt) as stopped:
        CALLS["sweep"](Told(stop_at=1))
    first, *missing = stopped.value.known.points
    assert first.value == pytest.approx(1 / np.tanh(1.0), abs=1e-12)
    assert [p.status for p in missing] == ["missing", "missing"]
    with pytest.raises(vc.Interrupted) as stopped:
        CALLS["extremals"](Told(stop_at=0))
    assert len(stopped.value.known) == 0
    assert "stopped before its end" in stopped.value.known.searched
    with pytest.raises(vc.Interrupted) as stopped:
        CALLS["certify"](Told(stop_at=0))
    assert stopped.value.known is SOLVED
    with pytest.raises(vc.Interrupted) as stopped:
        CALLS["certify_eigenvalues"](Told(stop_at=1))
    (lowest,) = stopped.value.known
    assert lowest.lower == pytest.approx(np.pi**2)
    with pytest.raises(vc.Interrupted) as stopped:
        CALLS["diagnose"](Told(stop_at=1))
    assert len(stopped.value.known.findings) == 1


def test_a_solve_that_is_stopped_leaves_the_curve_being_examined():
    def stop(_done, _total, what):
        if what == "other valleys":
            raise KeyboardInterrupt

    with pytest.raises(vc.Interrupted) as stopped:
        vc.solve(SPRING, progress=stop)
    assert stopped.value.known.value == pytest.approx(1 / np.tanh(1.0), abs=1e-12)


def test_a_solve_that_is_stopped_before_there_is_a_curve_says_so():
    def stop(_done, _total, what):
        if what == "curves with corners":
            raise KeyboardInterrupt

    wells = vc.Problem(lambda x, y, v: (v**2 - 1) ** 2 + ca.fabs(y), vc.Fixed(0, 0), vc.Fixed(1, 0.3))
    with pytest.raises(vc.Interrupted) as stopped:
        vc.solve(wells, progress=stop)
    assert stopped.value.known.status is vc.Status.NOT_CONVERGED
    assert stopped.value.known.message == "stopped before a curve was found"


class AtPiece(list):
    """Who stops the call when rays come to a piece of the index."""

    def __init__(self, piece):
        self.words = f"in piece {piece} of the index"

    def __call__(self, done, total, what):
        self.append(what)
        if self.words in what:
            raise KeyboardInterrupt


GRATING = optics.Scene(optics.Graded(lambda x, y: ca.if_else(ca.sin(np.pi * x) > 0, 1.5, 1.0)))


def test_rays_that_come_to_many_jumps_tell_of_them_and_are_known_when_they_are_stopped():
    with pytest.raises(vc.Interrupted) as stopped:
        GRATING.trace([(0.5, 0.0), (0.5, 1.0)], [(1.0, 0.0), (1.0, 0.0)], optical_path=[3.0, 1e4], progress=AtPiece(12))
    bundle = stopped.value.known
    assert bundle.status.tolist() == [optics.RayStatus.ARRIVED, optics.RayStatus.INTERRUPTED]
    # 0.75 to x = 1, then 1 and 1.5 by turns; after eleven pieces the second ray is at x = 11
    np.testing.assert_allclose(bundle.points, [(2 + 1.25 / 1.5, 0.0), (11.0, 1.0)], atol=1e-12)
    np.testing.assert_allclose(bundle.optical_path, [3.0, 0.75 + 5 * 1.0 + 5 * 1.5], atol=1e-12)


HEIGHTS = np.linspace(0.0, 100.0, 101)
TABLES = {
    "heights": optics.Tabulated(HEIGHTS, np.full(101, 1.5)),
    "cells": optics.Graded(lambda x, y: 1.5 + 0 * x + _flat(ca.vertcat(x, y))),
}


def _flat(place):
    edges = HEIGHTS.tolist()
    return ca.interpolant("flat", "linear", [edges, edges], np.zeros(101**2).tolist())(place)


@pytest.mark.parametrize("name", TABLES)
def test_rays_in_tables_are_known_when_they_are_stopped(name):
    with pytest.raises(vc.Interrupted) as stopped:
        optics.Scene(TABLES[name]).trace(
            (0.5, 0.25), (0.0, 1.0), optical_path=100.0, model=optics.Hamilton(), progress=AtPiece(12)
        )
    bundle = stopped.value.known
    assert bundle.status.tolist() == [optics.RayStatus.INTERRUPTED]
    np.testing.assert_allclose(bundle.points, [(0.5, 11.0)], atol=1e-12)
    np.testing.assert_allclose(bundle.optical_path, [1.5 * 10.75], atol=1e-12)


def test_rays_that_nobody_has_carried_are_where_they_start(monkeypatch):
    monkeypatch.setattr("varcalc.optics.validation.CHUNK", 2)
    with pytest.raises(vc.Interrupted) as stopped:
        GRATING.trace([(0.5, y) for y in range(5)], (1.0, 0.0), optical_path=1e4, progress=AtPiece(3))
    bundle = stopped.value.known
    assert np.all(bundle.status == optics.RayStatus.INTERRUPTED)
    np.testing.assert_allclose(bundle.points[:, 0], [2.0, 2.0, 0.5, 0.5, 0.5], atol=1e-12)
    np.testing.assert_allclose(bundle.optical_path, [1.75, 1.75, 0, 0, 0], atol=1e-12)


def test_threads_stop_with_the_call(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    starts = np.column_stack([np.full(600, 0.5), np.arange(600)])
    with pytest.raises(vc.Interrupted) as stopped:
        GRATING.trace(starts, (1.0, 0.0), optical_path=1e4, progress=AtPiece(5))
    bundle = stopped.value.known
    assert np.all(bundle.status == optics.RayStatus.INTERRUPTED)
    assert np.all(bundle.points[:, 0] <= 6)


def test_few_rays_that_come_to_many_jumps_show_a_bar(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr("varcalc.progress.SECONDS_WITHOUT_BAR", 0.0)
    GRATING.trace((0.5, 0.0), (1.0, 0.0), optical_path=1000.0)
    assert "of the index" in sys.stderr.getvalue()


def test_a_search_in_which_rays_come_to_many_jumps_tells_of_them():
    told = AtPiece(3)
    with pytest.raises(vc.Interrupted) as stopped:
        GRATING.rays((0.5, 0.0), (8.5, 1.0), within=40.0, model=optics.Hamilton(), progress=told)
    assert any("laying out rays" in what for what in told)
    assert stopped.value.known.unresolved > 0


STUDY = optics.Study(
    optics.Scene(optics.Graded(lambda x, y: ca.if_else(ca.sin(x + y) > 0, 1.5, 1.0))),
    optics.PointSource((0.5, 0.0)),
    rays=3,
    optical_path=8.0,
    wavefronts=2,
    receiver=(2.0, 0.5),
)


def test_a_study_tells_of_its_rays_and_fronts():
    told = AtPiece(None)
    STUDY.run(progress=told)
    for words in ("rays, 2 followed", "rays, 0 followed, 1 ray in piece", "arrivals, laying out rays", "wavefronts, "):
        assert any(words in what for what in told), words


class AtWords(AtPiece):
    def __init__(self, words):
        self.words = words


def test_a_study_that_is_stopped_keeps_rays_and_arrivals_apart():
    with pytest.raises(vc.Interrupted) as stopped:
        STUDY.run(progress=AtWords("arrivals, laying out rays"))
    assert len(stopped.value.known.tracks) == 3
    assert len(stopped.value.known.arrivals) == 0
    with pytest.raises(vc.Interrupted) as stopped:
        STUDY.run(progress=AtWords("wavefronts, "))
    assert len(stopped.value.known.arrivals) > 0
    assert len(stopped.value.known.wavefronts) == 0


def test_numpy_warns_of_nothing_in_a_call_that_is_told_of():
    with telling(False, "numbers"):
        assert np.isinf(np.float64(1e200) * np.float64(1e200))
