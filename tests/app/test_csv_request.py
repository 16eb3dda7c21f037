"""Samples as people have them: CSV of any country, columns pasted from a spreadsheet, names or none."""

from __future__ import annotations

import csv
import io
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app import cli
from linkage_atlas import FieldError
from linkage_atlas.tables import decoded, function_from_csv, match_from_csv, request_from_csv

PLACES = {"position": [[1.5, 2.0], [3.0, 4.0]], "timing": "free"}
POSES = {**PLACES, "rotation": [5.0, -6.25]}


def test_csv_columns_separators_and_gaps() -> None:
    assert request_from_csv("crank;x;y;angle\n0;1,5;2;\n10;;;5,25\n") == {
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
        ("x,y\n1,two\n", "line 2, column 2 (y): 'two' is not a number"),
        ("x,y\n1,nan\n", "line 2, column 2 (y): 'nan' is not a number"),
        ("1 2\n3 4\n5 a\n", "line 3, column 2: 'a' is not a number"),
        ("x,y\n1,1_0\n", "line 2, column 2 (y): '1_0' is not a number"),
        ("x;y\n1.00,5;2\n", "line 2, column 1 (x): '1.00,5': wanted one decimal mark"),
        ("x;y\n1.000,5;2\n0.125;3\n", "line 3, column 1 (x): '0.125': wanted one decimal mark"),
        ("x;y\n1,5;2\n2.25;3\n", "line 3, column 1 (x): '2.25': wanted one decimal mark"),
        ("x,rotation\n1,2\n", "wanted both x and y"),
        ("x,y,rotation\n1,,2\n", "line 2: wanted both x and y"),
        ('x;y\n1;"2\n3;4\n5;x\n', "line 4, column 2 (y): 'x' is not a number"),
        ("x;y\n1;" + "2" * 200_000, "line 2: field larger than"),
        ("crank\n1\n2\n", "wanted x and y, or rotation"),
        ("crank [rad];x;y;phi [deg]\n1;2;3;4\n", "wanted all angles in one unit"),
    ],
)
def test_csv_errors_name_the_line(text, words, tmp_path, capsys) -> None:
    path = tmp_path / "motion.csv"
    path.write_text(text)
    assert cli.main(["synthesize", str(path)]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("name", ["t", "T", "time", "Time [s]"])
@pytest.mark.parametrize(
    ("read", "other", "left_out"),
    [
        (request_from_csv, "x;y", "free, or even over a crank_span"),
        (match_from_csv, "phi", "even over a crank_span"),
        (function_from_csv, "output", "even over a crank_span"),
    ],
)
def test_a_time_is_no_crank_angle(name, read, other, left_out) -> None:
    with pytest.raises(FieldError) as error:
        read(f"{name};{other}\n0;1;2\n1;2;3\n")
    assert error.value.message == (
        f"line 1: the column '{name.split()[0]}' is a time, and no crank angle: name it 'crank' if it holds crank angles in "
        f"degrees, or leave it out (then crank angles are {left_out})"
    )


def test_tables_of_turns_and_of_rockers() -> None:
    assert match_from_csv("crank [deg];phi\n0;350°\n10,5;10\n", {"top": 2}) == {
        "crank_angle": [0.0, 10.5],
        "rotation": [350.0, 10.0],
        "top": 2,
    }
    assert match_from_csv("5\n6,5\n") == {"rotation": [5.0, 6.5]}
    assert function_from_csv("0\t0\n10\t5,5\n") == {"input": [0.0, 10.0], "output": [0.0, 5.5]}
    assert function_from_csv("no;output (rad);crank (rad)\n1;2;3\n") == {
        "output": [2.0],
        "input": [3.0],
        "angle_unit": "rad",
    }
    dials = {"function": {"output_span": 90}, "crank_span": 60}
    assert function_from_csv("x,y\n1,2\n3,4\n", dials) == {
        "function": {"table": [[1.0, 2.0], [3.0, 4.0]], "output_span": 90},
        "crank_span": 60,
    }


@pytest.mark.parametrize(
    ("read", "text", "words"),
    [
        (match_from_csv, "x,y\n1,2\n", "line 1: there is no column 'x'; there are rotation"),
        (match_from_csv, "crank\n1\n", "line 1: wanted a column of rotation"),
        (match_from_csv, "crank,phi\n1,2\n3,\n", "line 3, column 2 (phi): wanted a number, found an empty cell"),
        (match_from_csv, "1,2,3\n", "line 1: wanted 1 to 2 columns"),
        (function_from_csv, "x\n1\n", "line 1: wanted a column of output, or both x and y"),
        (function_from_csv, "output,x\n1,2\n", "line 1: wanted a column of output, or both x and y"),
        (function_from_csv, "input;output\n1,5;2\n2;a\n", "line 3, column 2 (output): 'a' is not a number"),
    ],
)
def test_errors_of_such_tables_name_line_and_column(read, text, words) -> None:
    with pytest.raises(FieldError) as error:
        read(text)
    assert words in error.value.message


def test_angles_are_unwrapped_where_that_is_asked_for() -> None:
    assert request_from_csv("x,y,phi\n0,0,350\n1,1,\n2,2,10\n3,3,-320\n", {}, True)["rotation"] == [
        350,
        None,
        370,
        400,
    ]
    assert match_from_csv("crank,phi\n350,170\n10,-170\n", {}, True) == {
        "crank_angle": [350, 370],
        "rotation": [170, 190],
    }
    turned = match_from_csv("phi [rad]\n3\n-3\n", {}, True)["rotation"]
    assert turned == pytest.approx([3, 2 * math.pi - 3])


def test_the_command_unwraps_and_answers_tables_of_every_question(tmp_path, capsys) -> None:
    table = tmp_path / "turns.csv"
    table.write_text("crank;rocker\n350;0\n5;12\n25;31\n50;62\n70;90\n")
    assert cli.main(["function", str(table)]) == 2
    assert "input" in capsys.readouterr().err
    assert cli.main(["function", str(table), "--unwrap", "--set", "top=1", "--no-preset"]) == 0
    assert capsys.readouterr().out.startswith("reached: 1 linkage")
    table.write_text("{}")
    assert cli.main(["synthesize", str(table), "--unwrap"]) == 2
    assert "--unwrap is for a table" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("1.000,5;2,5;3,0\n-1.234.567,5;12.000;0,125\n", [[1000.5, 2.5, 3.0], [-1234567.5, 12000.0, 0.125]]),
        (
            "1,000.5;2.5;3.0\n\N{MINUS SIGN}1,234,567.5;12,000;0.125\n",
            [[1000.5, 2.5, 3.0], [-1234567.5, 12000.0, 0.125]],
        ),
        ('"1,000.5",2.5,3.0\n', [[1000.5, 2.5, 3.0]]),
        ("1,500;2.5;3\n", [[1500.0, 2.5, 3.0]]),
        ("1.234.567;2;3\n0;1.250;0\n", [[1234567.0, 2.0, 3.0], [0.0, 1250.0, 0.0]]),
        ("1.250;2;3\n", [[1.25, 2.0, 3.0]]),
        ("1,250;2;3\n", [[1.25, 2.0, 3.0]]),
        ("1,000.5;2,5;3.0\n", None),
    ],
)
def test_the_mark_that_is_not_that_of_decimals_groups_thousands(text, wanted) -> None:
    if wanted is None:
        with pytest.raises(FieldError, match="wanted one decimal mark"):
            request_from_csv(text)
    else:
        request = request_from_csv(text)
        assert request["position"] == [row[:2] for row in wanted]
        assert request["rotation"] == [row[2] for row in wanted]


def test_thousands_are_grouped_as_spreadsheets_do() -> None:
    grouped = "x;y\n1\u00a0234,5;-12'345,25\n1\u202f000;2\n"
    assert request_from_csv(grouped)["position"] == [[1234.5, -12345.25], [1000.0, 2.0]]


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
