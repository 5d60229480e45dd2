"""How far a long call has come, and what is known when it is stopped."""

import io
import sys

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
    assert shown[-1] == {"text/plain": ""}


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
