"""Ctrl-C is heard whatever CasADi is about: what is raised while it runs is lost."""

import signal
import subprocess
import sys
import threading
import time

import casadi as ca
import pytest

from varcalc.progress import heard, telling

A_WHILE = 20.0


class Pressed:
    """A number for CasADi; the interrupt key is pressed while it is looked at."""

    def __init__(self, presses):
        self.presses = presses

    def __DM__(self):  # CasADi's own name
        for _ in range(self.presses):
            signal.raise_signal(signal.SIGINT)
        return ca.DM(2.0)


@pytest.fixture(autouse=True)
def usual_handler():
    """That of a Python that was started by hand, whatever these tests were started by."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def squared():
    x = ca.SX.sym("x")
    return ca.Function("squared", [x], [x**2])


def returned_at_once(function, number):
    return function(number)


def pressed_after(seconds, call):
    """What ``call`` gives back, the key being pressed meanwhile."""
    threading.Timer(seconds, signal.raise_signal, [signal.SIGINT]).start()
    until = time.monotonic() + A_WHILE
    while time.monotonic() < until:
        call()


def test_what_casadi_would_lose_is_raised_after_it():
    with pytest.raises(KeyboardInterrupt), telling(False, "a long call"):
        squared()(Pressed(1))


def test_it_is_raised_where_the_caller_returns_at_once():
    with pytest.raises(KeyboardInterrupt), heard():
        returned_at_once(squared(), Pressed(1))


def test_it_is_raised_where_casadi_refuses():
    with pytest.raises(KeyboardInterrupt), heard():
        squared()(Pressed(1), "no number", {})


# from Python 3.13 on what CasADi loses is said
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_those_who_press_twice_are_heard():
    with pytest.raises(KeyboardInterrupt), heard():
        squared()(Pressed(2))


def test_calls_one_after_the_other_hear_it():
    function, number = squared(), ca.DM([[0.3]])
    for k in range(20):
        with pytest.raises(KeyboardInterrupt), heard():
            pressed_after(0.01 + 0.0007 * k, lambda: function(number) + number.full() * ca.SX.sym("u"))


def test_a_solve_of_ipopt_is_not_reported_as_failed():
    x = ca.MX.sym("x", 400)
    steep = ca.sum1(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)  # Rosenbrock's function
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.max_iter": 2000}
    solver = ca.nlpsol("solver", "ipopt", {"x": x, "f": steep}, options)
    with pytest.raises(KeyboardInterrupt), heard():
        pressed_after(0.1, lambda: solver(x0=ca.DM.ones(400) * -1.2))


def test_handlers_of_ones_own_stay():
    def own(_number, _frame):
        pass

    signal.signal(signal.SIGINT, own)
    with heard():
        assert signal.getsignal(signal.SIGINT) is own


def test_the_usual_handler_comes_back():
    with pytest.raises(ZeroDivisionError), heard(), heard():
        raise ZeroDivisionError
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_have_none():
    found = []

    def apart():
        with heard():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=apart)
    thread.start()
    thread.join()
    assert found == [signal.default_int_handler]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT to send to another process")
@pytest.mark.parametrize(
    "words", [["-c", "from varcalc_command import main; main()"], ["-m", "varcalc"], ["-mvarcalc"]]
)
def test_the_command_hears_it_while_the_package_is_imported(tmp_path, words):
    (tmp_path / "casadi.py").write_text(f"import time\nprint('begun', flush=True)\ntime.sleep({A_WHILE})\n")
    command, pipe = [sys.executable, *words, "list"], subprocess.PIPE
    with subprocess.Popen(command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout.readline() == "begun\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=A_WHILE)
    assert (process.returncode, said) == (130, "stopped before anything had begun\n")


def test_a_program_that_imports_the_package_hears_it_as_before(tmp_path):
    package = tmp_path / "own"
    package.mkdir()
    (package / "__init__.py").write_text("import signal\nimport varcalc\n")
    (package / "__main__.py").write_text("from own import signal\nprint(signal.getsignal(signal.SIGINT).__name__)\n")
    command = [sys.executable, "-m", "own", "-m", "varcalc"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "default_int_handler\n"
