"""Samples as people have them: CSV of any country, columns pasted from a spreadsheet, names or none."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app import cli
from app.asking import decoded
from app.fourbar.csv_request import request_from_csv
from linkage_atlas import FieldError

PLACES = {"position": [[1.5, 2.0], [3.0, 4.0]], "timing": "free"}
POSES = {**PLACES, "rotation": [5.0, -6.25]}


def test_csv_columns_separators_and_gaps() -> None:
    assert request_from_csv("t;x;y;angle\n0;1,5;2;\n10;;;5,25\n") == {
        "crank_angle": [0.0, 10.0],
        "rotation": [None, 5.25],
        "position": [[1.5, 2.0], None],
    }
    assert request_from_csv("# a comment\nX (mm)\tY (mm)\n1\t2\n3\t4\n") == {
        "position": [[1.0, 2.0], [3.0, 4.0]],
        "timing": "free",
    }


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("x,y\n1.5,2\n3,4", PLACES),
        ("x, y\r\n1.5, 2\r\n3, 4\r\n", PLACES),
        ('x,y\n"1,5","2"\n3,4\n', PLACES),
        ("1.5 2\n3 4\n", PLACES),
        ("  1,5   2\n  3 4\n", PLACES),
        ("1,5\t2\n3\t4", PLACES),
        ("x [mm] y [mm]\n1.5 2\n3 4", PLACES),
        ("pose,x,y\nP 1,1.5,2\nP 2,3,4", PLACES),
        ("x;y;\n1,5;2;\n3;4;\n", PLACES),
        ("1,5 2 5\n3 4 -6,25", POSES),
        ("X/mm\tY/mm\tPhi/°\n1,5\t2\t5°\n3\t4\t\N{MINUS SIGN}6,25", POSES),
        ("nr;\N{GREEK SMALL LETTER PHI} (deg);y;x\n1;5;2;1,5\n2;-6,25;4;3", POSES),
        ("x,y,theta\n1.5,2,5\n\n# between\n3,4,-6.25", POSES),
        ("0,1.5,2,5\n10,3,4,-6.25", {k: v for k, v in POSES.items() if k != "timing"} | {"crank_angle": [0.0, 10.0]}),
        ("phi\n1,5\n2", {"rotation": [1.5, 2.0], "timing": "free"}),
        ("x;y;phi (rad)\n1,5;2;5\n3;4;-6,25", {**POSES, "angle_unit": "rad"}),
    ],
)
def test_tables_of_any_country(text, wanted) -> None:
    assert request_from_csv(text) == wanted


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y\n", "no rows"),
        ("# nothing\n", "no rows"),
        ("x,z\n1,2\n", "line 1: there is no column 'z'"),
        ("x_mm;y\n1;2\n", "line 1: there is no column 'x_mm'"),
        ("x,y,x\n1,2,3\n", "line 1: two columns hold x"),
        ("1,2,3,4,5\n", "line 1: wanted 1 to 4 columns"),
        ("x,y\n1,2\n3\n", "line 3: wanted 2 cells"),
        ("# a comment\n\nx,y\n1,2\n\n3\n", "line 6: wanted 2 cells"),
        ("x,y\n1,two\n", "line 2: 'two' is not a number"),
        ("x,y\n1,nan\n", "line 2: 'nan' is not a number"),
        ("x,y\n1,1_0\n", "line 2: '1_0' is not a number"),
        ("x;y\n1.000,5;2\n", "line 2: '1.000,5': wanted one decimal mark"),
        ("x;y\n1,5;2\n2.250;3\n", "line 3: '2.250': wanted one decimal mark"),
        ("x,rotation\n1,2\n", "wanted both x and y"),
        ("x,y,rotation\n1,,2\n", "line 2: wanted both x and y"),
        ('x;y\n1;"2\n3;4\n5;x\n', "line 4: 'x' is not a number"),
        ("x;y\n1;" + "2" * 200_000, "line 2: field larger than"),
        ("t\n1\n2\n", "wanted x and y, or rotation"),
        ("t [rad];x;y;phi [deg]\n1;2;3;4\n", "wanted all angles in one unit"),
    ],
)
def test_csv_errors_name_the_line(text, words, tmp_path, capsys) -> None:
    path = tmp_path / "motion.csv"
    path.write_text(text)
    assert cli.main(["synthesize", str(path)]) == 2
    assert words in capsys.readouterr().err


NUMBERS = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: round(value, 4))


@given(
    rows=st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=8),
    separator=st.sampled_from([",", ";", "\t", " "]),
    comma=st.booleans(),
    names=st.booleans(),
)
def test_what_a_spreadsheet_writes_is_what_is_read(rows, separator, comma, names) -> None:
    """Law: however cells are separated and decimals marked, the numbers are those that were written."""
    comma = comma and any("." in f"{value:.4f}" for row in rows for value in row)
    file = io.StringIO()
    writer = csv.writer(file, delimiter=separator)
    if names:
        writer.writerow(("x", "y", "phi"))
    for row in rows:
        writer.writerow([f"{value:.4f}".replace(".", "," if comma else ".") for value in row])
    request = request_from_csv(file.getvalue())
    assert request == {
        "position": [[x, y] for x, y, _ in rows],
        "rotation": [angle for _, _, angle in rows],
        "timing": "free",
    }


@given(st.text(max_size=60))
def test_any_text_is_a_table_or_an_error_that_says_where(text) -> None:
    try:
        request = request_from_csv(text)
    except FieldError as error:
        assert error.field == "" and error.message
    else:
        assert request.keys() & {"rotation", "position"}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_files_in_the_encodings_of_spreadsheets(encoding) -> None:
    text = "x;y;phi [°]\n1,5;2;5\n"
    assert decoded(text.encode(encoding)) == text
