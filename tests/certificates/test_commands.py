"""What the command line says of certificates."""

import json

from click.testing import CliRunner

from varcalc.cli import main


def call(*arguments):
    return CliRunner().invoke(main, list(arguments))


def test_a_problem_is_certified():
    done = call("certify", "soap_film")
    assert done.exit_code == 0
    assert done.output.startswith("theorem:  0.953624106702002751")


def test_as_json():
    done = call("certify", "oscillator", "--json")
    told = json.loads(done.output)
    assert told["scope"] == "all curves"
    assert told["tube"] is None
    assert told["lower"] < told["upper"]


UNPROVED = """
import casadi as ca
import varcalc as vc

problem = vc.Problem(lambda x, y, v: ca.sqrt(1 + v**2) / y ** (1 / 3) / (1 + y), vc.Fixed(0, 0), vc.Fixed(1, 1))
"""


def test_what_is_not_proved_says_which_inequality(tmp_path):
    file = tmp_path / "unproved.py"
    file.write_text(UNPROVED)
    done = call("certify", str(file), "--json")
    assert done.exit_code == 1
    assert "no whole power" in json.loads(done.output)["error"]
    done = call("certify", "oscillator", "--digits", "99")
    assert done.exit_code == 1
    assert "too much for 99 digits" in done.output


def test_the_list_has_a_column_of_digits():
    done = call("list", "bratu", "--certified")
    lines = dict(line.split(maxsplit=1) for line in done.output.splitlines())
    assert set(lines) == {"bratu", "bratu/mild"}
    assert all("digits proved, over all curves in the tube" in line for line in lines.values())


def test_a_comparison_says_it_in_one_line():
    done = call("run", "oscillator/released", "--certify")
    assert "certificate: " in done.output
    assert "digits proved, over all curves" in done.output
