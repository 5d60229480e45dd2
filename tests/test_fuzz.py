"""Anything at all given to what reads files and command lines: a result, or a refusal in one sentence."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import varcalc as vc
from varcalc import optics
from varcalc.cli import main
from varcalc.solve.grid import spaced

QUICK = settings(
    max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
WORDS = st.sampled_from(
    ["list", "run", "verify", "extremals", "diagnose", "certify", "sweep", "trace", "move", "figure", "nowhere",
     "nowhere.py", "--json", "-o", "p.png", "no/p.png", "--tol", "0", "nan", "--store", "k=1:2:3", "--help"]
)  # fmt: skip
NUMBERS = st.floats() | st.integers(-(10**400), 10**400)
JSON = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)
RECORD = {"problem": "line", "method": "Ritz", "setting": 1e-6, "status": "solved", "build_ms": 1.0, "unknowns": 12}


def assert_one_sentence(error):
    sentence = str(error)
    assert sentence
    assert "\n" not in sentence
    assert len(sentence) <= 600


@QUICK
@given(st.lists(WORDS | st.text(max_size=6), max_size=5))
def test_command_lines_end_with_a_status_of_their_own(tmp_path, words):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        done = CliRunner().invoke(main, words)
    assert done.exception is None or isinstance(done.exception, SystemExit)
    assert done.exit_code in {0, 1, 2}
    if done.exit_code == 2 and words:
        assert "Error: " in done.stderr


@QUICK
@given(st.binary(max_size=60) | st.text(alphabet="0123456789.,;\t\n #ezn()-", max_size=60).map(str.encode))
def test_profiles_are_read_or_refused(tmp_path, content):
    path = tmp_path / "profile.csv"
    path.write_bytes(content)
    try:
        profile = optics.read_profile(path)
    except (ValueError, TypeError) as error:
        assert_one_sentence(error)
    else:
        assert np.isfinite(profile.heights).all()
        assert np.isfinite(profile.n).all()


@QUICK
@given(st.sampled_from([*RECORD, "value_error", "knob", "size", "else"]), JSON)
def test_measurements_are_read_or_refused(tmp_path, name, value):
    path = tmp_path / "measured.json"
    path.write_text(json.dumps({"format": 1, "about": {}, "records": [RECORD | {name: value}]}), encoding="utf-8")
    try:
        measured = vc.WorkPrecision.load(path)
    except ValueError as error:
        assert_one_sentence(error)
    else:
        assert measured.table()
        json.dumps(measured.document(), allow_nan=False)


def test_lists_without_end_are_refused(tmp_path):
    path = tmp_path / "measured.json"
    path.write_text("[" * 100_000, encoding="utf-8")
    with pytest.raises(ValueError, match="lists within lists"):
        vc.WorkPrecision.load(path)


@QUICK
@given(st.text(alphabet="k=:,.-0123456789einfa ", max_size=16))
def test_grids_are_finite_numbers_or_refused(text):
    try:
        name, values = spaced(text)
    except (ValueError, TypeError) as error:
        assert_one_sentence(error)
    else:
        assert name
        assert np.isfinite(values).all()


def test_a_grid_larger_than_anybody_means_is_refused_at_once():
    with pytest.raises(ValueError, match="at most 1000000 finite values"):
        spaced("k=0:1:1000000000000")
