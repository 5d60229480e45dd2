"""Sweeps shared among workers: the same answers however the points are cut, and none lost with a worker."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest

import varcalc as vc
from varcalc.solve import sharing
from varcalc.solve.store import Store

ACROSS = np.linspace(-0.4, 0.4, 41)


class AtOnce(Executor):
    """Does what it is given when it is given it; ``deaths`` tells for which points a worker dies."""

    def __init__(self, deaths=lambda points: False, error=None):
        self.deaths, self.error, self.sizes = deaths, error, []

    def submit(self, function, /, job, points):
        future, given = Future(), pickle.loads(points)
        self.sizes.append(len(given))
        if self.deaths(given):
            future.set_exception(self.error)
        else:
            future.set_result(function(job, points))
        return future


def tilted_wells():
    """Two valleys, the lower one on the other side once the tilt changes its sign."""
    return vc.Problem(
        lambda x, y, dy, p: 0.025 * dy**2 + (y**2 - 1) ** 2 + p.tilt * y,
        vc.Free(0),
        vc.Free(1),
        parameters={"tilt": 0.3},
    )


def lowest(tilt):
    """The lower of the two constants at which 4 y (y^2 - 1) + tilt vanishes."""
    roots = np.roots([4, 0, -4, tilt])
    real = roots[abs(roots.imag) < 1e-9].real
    return ((real**2 - 1) ** 2 + tilt * real).min()


def within_claims(found, exact):
    return np.all(abs(found.values - exact) <= found.claimed_errors + 4e-16 * np.maximum(1, abs(np.asarray(exact))))


def test_a_valley_that_is_no_longer_the_lowest_is_left():
    found = vc.sweep(tilted_wells(), {"tilt": ACROSS})
    assert within_claims(found, [lowest(t) for t in ACROSS])
    assert not any(p.local for p in found.points)


@pytest.mark.parametrize("cores", [1, 3, 20])
def test_the_answers_do_not_depend_on_how_the_points_are_cut(cores):
    executor = AtOnce()
    found = vc.sweep(tilted_wells(), {"tilt": ACROSS}, executor=executor, cores=cores)
    assert within_claims(found, [lowest(t) for t in ACROSS])
    assert max(executor.sizes) == -(-len(ACROSS) // (2 * cores))


def test_threads_are_an_executor_like_any_other():
    with ThreadPoolExecutor(3) as executor:
        found = vc.sweep(tilted_wells(), {"tilt": ACROSS}, executor=executor)
        assert executor.submit(int).result() == 0  # it is left open
    assert within_claims(found, [lowest(t) for t in ACROSS])


def test_a_point_that_workers_die_of_is_told_and_costs_no_other():
    from distributed import KilledWorker

    def dies(points):
        return any(p["tilt"] == ACROSS[7] for p in points)

    executor = AtOnce(dies, KilledWorker("chunk", "worker", 3))
    found = vc.sweep(tilted_wells(), {"tilt": ACROSS}, executor=executor, cores=2)
    assert [p.values for p in found.failures] == [(ACROSS[7],)]
    assert found.failures[0].status == "failed"
    assert "died each time" in found.failures[0].message
    rest = np.arange(len(ACROSS)) != 7
    np.testing.assert_allclose(found.values[rest], [lowest(t) for t in ACROSS[rest]], rtol=1e-10, atol=1e-15)


def test_a_process_that_dies_is_replaced(tmp_path):
    # a function that the processes of a pool can import, and one value that takes its process with it
    (tmp_path / "deadly.py").write_text(
        "import os, signal\n"
        "import varcalc as vc\n"
        "def problem(k):\n"
        "    if k == 3.0:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return vc.Problem(lambda x, y, dy: dy**2 + k * y, vc.Fixed(0, 0), vc.Fixed(1, 1))\n",
        encoding="utf-8",
    )
    script = (
        "import varcalc as vc, deadly\n"
        "if __name__ == '__main__':\n"
        "    found = vc.sweep(deadly.problem, {'k': [float(k) for k in range(6)]}, cores=2)\n"
        "    print([p.values[0] for p in found.failures], found.values.round(9).tolist())\n"
    )
    (tmp_path / "script.py").write_text(script, encoding="utf-8")
    command = [sys.executable, "script.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    # y = x + k x (x - 1)/4: 1 + k/2 - k^2/48
    exact = ", ".join("nan" if k == 3 else str(round(1 + k / 2 - k**2 / 48, 9)) for k in range(6))
    assert done.stdout.strip() == f"[3.0] [{exact}]", done.stderr


def test_an_executor_that_breaks_is_not_replaced_and_what_was_stored_stays(tmp_path):
    from concurrent.futures import BrokenExecutor

    store = tmp_path / "sweep.jsonl"
    last = ACROSS[-1]
    executor = AtOnce(lambda points: any(p["tilt"] == last for p in points), BrokenExecutor("gone"))
    with pytest.raises(BrokenExecutor, match="gone"):
        vc.sweep(tilted_wells(), {"tilt": ACROSS}, executor=executor, cores=4, store=store)
    assert 0 < sum(p.ok for p in vc.Sweep.load(store).points) < len(ACROSS)


def test_a_mistake_in_a_function_is_raised_and_no_row():
    with pytest.raises(TypeError, match="unexpected keyword"):
        vc.sweep(lambda k: tilted_wells(), {"tilt": [1.0]}, executor=AtOnce())


@pytest.fixture
def cluster():
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0") as cluster,
        Client(cluster, timeout="20s") as client,
    ):
        yield client


def test_a_worker_of_dask_that_is_killed_midway_loses_nothing(cluster, tmp_path, monkeypatch):
    processes = cluster.run(os.getpid)
    store = tmp_path / "sweep.jsonl"

    problem, wait = tilted_wells(), time.sleep  # what a worker cannot import is sent along

    def slow(tilt):
        wait(0.02)
        return problem.with_parameters({"tilt": tilt})

    begun = threading.Event()
    add = Store.add

    def added(self, points):
        add(self, points)
        begun.set()

    def kill():
        if begun.wait(60):
            os.kill(min(processes.values()), signal.SIGKILL)

    monkeypatch.setattr(Store, "add", added)
    killer = threading.Thread(target=kill)
    killer.start()
    found = vc.sweep(slow, {"tilt": ACROSS}, executor=cluster.get_executor(), cores=4, store=store)
    assert begun.is_set()
    killer.join()
    assert within_claims(found, [lowest(t) for t in ACROSS])
    assert vc.Sweep.load(store) == found
    assert min(processes.values()) not in cluster.run(os.getpid).values()


def test_a_sweep_that_is_killed_and_resumed_equals_an_unbroken_one(tmp_path):
    (tmp_path / "swings.py").write_text(
        "import sys, time\n"
        "import varcalc as vc\n"
        "def problem(k):\n"
        "    time.sleep(0.01)\n"
        "    return vc.Problem(lambda x, y, dy: dy**2 + k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1))\n"
        "KS = [k / 4 for k in range(60)]\n"
        "if __name__ == '__main__':\n"
        "    vc.sweep(problem, {'k': KS}, store=sys.argv[1])\n",
        encoding="utf-8",
    )
    store = tmp_path / "sweep.jsonl"
    process = subprocess.Popen([sys.executable, "swings.py", str(store)], cwd=tmp_path)
    while process.poll() is None and (not store.exists() or store.read_bytes().count(b"\n") < 10):
        time.sleep(0.01)
    process.kill()
    process.wait()
    kept = sum(p.ok for p in vc.Sweep.load(store).points)
    assert 9 <= kept < 60

    def problem(k):
        return vc.Problem(lambda x, y, dy: dy**2 + k * y**2, vc.Fixed(0, 0), vc.Fixed(1, 1))

    ks = [k / 4 for k in range(60)]
    unbroken = vc.sweep(problem, {"k": ks})
    resumed = vc.sweep(problem, {"k": ks}, store=store)
    assert [p.status for p in resumed.points] == [p.status for p in unbroken.points]
    assert np.all(abs(resumed.values - unbroken.values) <= resumed.claimed_errors + unbroken.claimed_errors)
    # what a worker keeps between chunks belongs to one sweep
    assert sharing.Job.of(problem, None, 1e-10, 1) != sharing.Job.of(problem, None, 1e-10, 1)
