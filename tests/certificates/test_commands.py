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


def test_what_is_not_proved_says_which_inequality():
    done = call("certify", "power_index/gentle", "--json")
    assert done.exit_code == 1
    assert "neither vanishes nor ends in a root" in json.loads(done.output)["error"]
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
