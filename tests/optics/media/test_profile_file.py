"""Profiles from files: what headers say, and what is refused."""

import numpy as np
import pytest

from varcalc import optics

HEIGHTS, INDEX = (0.0, 500.0, 1200.0), (1.0003, 1.00028, 1.00025)
AS_TABLE = optics.Tabulated(HEIGHTS, INDEX)


def profile(tmp_path, text, **options):
    file = tmp_path / "sonde.csv"
    file.write_text(text, encoding="utf-8")
    return optics.read_profile(file, **options)


@pytest.mark.parametrize(
    "text",
    [
        "0,1.0003\n500,1.00028\n1200,1.00025\n",
        "height,n\n0,1.0003\n500,1.00028\n1200,1.00025\n",
        "# station 7\n\naltitude (km); refractive index (1)\n0;1.0003\n0.5;1.00028\n1.2;1.00025\n",
        "n\tpressure\theight_asl\n-\thPa\tkm\n1.0003\t1013\t0\n1.00028\t950\t0.5\n1.00025\t870\t1.2\n",
        "\ufeffz [m]   n\n1200 1.00025\n500 1.00028  # descending\n0 1.0003\n",
    ],
)
def test_heights_and_index_however_they_are_written(tmp_path, text):
    read = profile(tmp_path, text)
    np.testing.assert_allclose(read.heights, HEIGHTS, rtol=1e-15)
    assert read.n == AS_TABLE.n


def test_speeds_by_depth(tmp_path):
    text = "Depth (m),Temperature (C),Sound speed (km/s)\n0,18,1.520\n700,9,1.490\n1300,4,1.480\n"
    read = profile(tmp_path, text, reference_speed=1500.0, smooth=False)
    assert read.heights == (-1300.0, -700.0, 0.0)
    np.testing.assert_allclose(read.n, 1500.0 / np.array([1480.0, 1490.0, 1520.0]), rtol=1e-15)
    assert not read.smooth


def test_speeds_without_a_header(tmp_path):
    read = profile(tmp_path, "0 2\n1 4\n", reference_speed=2.0)
    assert read.n == (1.0, 0.5)


def test_columns_by_name_and_number(tmp_path):
    text = "x,depth,c sea,c ice\n9,0,2,3\n9,1,4,5\n"
    with pytest.raises(ValueError, match="give columns="):
        profile(tmp_path, text, reference_speed=2.0)
    assert profile(tmp_path, text, reference_speed=2.0, columns=("depth", "sea")).n == (0.5, 1.0)
    assert profile(tmp_path, text, reference_speed=5.0, columns=(1, 3)).n == (1.0, 5 / 3)
    with pytest.raises(ValueError, match="has no column 'c', or more than one"):
        profile(tmp_path, text, columns=("depth", "c"))


def test_rays_go_through_what_was_read(tmp_path):
    heights = np.linspace(-1, 0.45, 9)
    text = "height,n\n" + "\n".join(f"{h},{n}" for h, n in np.column_stack([heights, np.sqrt(1 - 2 * heights)]))
    [ray] = optics.Scene(profile(tmp_path, text)).rays((0, 0), (0.5, 0))
    assert ray.optical_path == pytest.approx(0.494521305498037, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("height,n\n0,1.3\n2,1.2\n1,1.1\n3,1\n", {}, r"row 4 of sonde\.csv: 1 after 2 is out of order; sort the table"),
        ("depth,n\n0,1.3\n5,1.2\n5,1.1\n", {}, r"row 4 of sonde\.csv: 5 after 5 is out of order"),
        ("height,n\n0,1.3\n2,none\n", {}, r"row 3 of sonde\.csv: 'none' is no number"),
        ("height,n\n0,1.3\n2\n", {}, r"row 3 of sonde\.csv: '' is no number"),
        ("height,n\n0,1.3\n2,-1.2\n", {}, r"row 3 of sonde\.csv: '-1\.2' makes the index -1\.2, which"),
        ("z,c\n0,340\n9,0\n", {"reference_speed": 340.0}, r"row 3 of sonde\.csv: '0' makes the index inf"),
        ("z,c\n0,1\n\n9,-2\n", {"reference_speed": 1.0}, r"row 4 of sonde\.csv: '-2' makes the index -0\.5"),
        ("height,n\n0,1.3\n2,nan\n", {}, r"row 3 of sonde\.csv: 'nan' is no number"),
        ("height,n\n0,1.3\n", {}, "has 1 rows of numbers"),
        ("height (furlong),n\n0,1.3\n1,1.2\n", {}, "the unit 'furlong' of the column"),
        ("height,n (ppm)\n0,1.3\n1,1.2\n", {}, "the unit 'ppm' of the column"),
        ("height (s),n\n0,1.3\n1,1.2\n", {}, "the unit 's' of the column 'height"),
        ("height,speed\n0,1.3\n1,1.2\n", {}, "holds a speed; give reference_speed="),
        ("height,n\n0,1.3\n1,1.2\n", {"reference_speed": 2.0}, "holds an index, 'n'; leave out reference_speed="),
        ("height,speed\n0,1.3\n1,1.2\n", {"reference_speed": -2.0}, "reference_speed must be a positive speed"),
        ("a,b,c\n0,1.3,1\n1,1.2,1\n", {}, "which do not say what is the height"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, text, options, message):
    with pytest.raises(ValueError, match=message):
        profile(tmp_path, text, **options)
