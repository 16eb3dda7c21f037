"""Samples as people have them: CSV of any country, columns pasted from a spreadsheet, names or none."""

import csv
import io
import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app import cli
from linkage_atlas import FieldError
from linkage_atlas.tables import decoded, function_from_csv, match_from_csv, request_from_csv

TABLES = json.loads((Path(__file__).parent / "tables.json").read_text())
"""Tables as people have them: those that are read, with what is asked for then, and others with words of the error."""
READ = {"synthesize": request_from_csv, "match": match_from_csv, "function": function_from_csv}


@pytest.mark.parametrize(("question", "text", "wanted"), TABLES["read"])
def test_tables_of_any_country(question, text, wanted) -> None:
    """Separators, decimal commas, grouped thousands, units, gaps, comments, names or none."""
    assert READ[question](text) == wanted


@pytest.mark.parametrize(("question", "text", "words"), TABLES["refused"])
def test_errors_name_line_and_column(question, text, words) -> None:
    with pytest.raises(FieldError) as error:
        READ[question](text)
    assert words in error.value.message


def test_a_table_that_cannot_be_read_ends_the_command(tmp_path, capsys) -> None:
    path = tmp_path / "motion.csv"
    wrong = {"x,z\n1,2\n": "line 1: there is no column 'z'", "x;y\n1;" + "2" * 200_000: "line 2: field larger than"}
    for text, words in wrong.items():
        path.write_text(text)
        assert cli.main(["synthesize", str(path)]) == 2
        assert words in capsys.readouterr().err


def test_a_table_with_names_in_quotes_is_no_json(tmp_path, capsys) -> None:
    path = tmp_path / "motion.csv"
    path.write_text('\ufeff"x","y"\n"0","0"\n"10,5","2"\n"20","8"\n')
    assert cli.main(["synthesize", str(path), "--set", "top=1", "--set", "budget_ms=50"]) == 0
    assert "1 solution" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["t", "T", "time", "Time [s]"])
@pytest.mark.parametrize(("question", "other"), [("synthesize", "x;y"), ("match", "phi"), ("function", "output")])
def test_a_time_is_no_crank_angle(name, question, other) -> None:
    read, left_out = READ[question], "free, or " * (question == "synthesize") + "even over a crank_span"
    with pytest.raises(FieldError) as error:
        read(f"{name};{other}\n0;1;2\n1;2;3\n")
    assert error.value.message == (
        f"line 1: the column '{name.split()[0]}' is a time, and no crank angle: name it 'crank' if it holds crank angles in "
        f"degrees, or leave it out (then crank angles are {left_out})"
    )


def test_what_is_asked_beside_a_table_joins_it() -> None:
    assert match_from_csv("5\n6,5\n", {"top": 2}) == {"rotation": [5.0, 6.5], "top": 2}
    dials = {"function": {"output_span": 90}, "crank_span": 60}
    function = {"table": [[1.0, 2.0], [3.0, 4.0]], "output_span": 90}
    assert function_from_csv("x,y\n1,2\n3,4\n", dials) == {"function": function, "crank_span": 60}


def test_angles_are_unwrapped_where_that_is_asked_for() -> None:
    gap = request_from_csv("x,y,phi\n0,0,350\n1,1,\n2,2,10\n3,3,-320\n", {}, True)
    assert gap["rotation"] == [350, None, 370, 400]
    both = match_from_csv("crank,phi\n350,170\n10,-170\n", {}, True)
    assert both == {"crank_angle": [350, 370], "rotation": [170, 190]}
    turned = match_from_csv("phi [rad]\n3\n-3\n", {}, True)["rotation"]
    assert turned == pytest.approx([3, 2 * math.pi - 3])


def test_the_command_unwraps_and_answers_tables_of_every_question(tmp_path, capsys) -> None:
    table = tmp_path / "turns.csv"
    table.write_text("crank;rocker\n250;0\n5;12\n25;31\n50;62\n70;90\n")
    assert cli.main(["function", str(table)]) == 2
    assert "input" in capsys.readouterr().err
    assert cli.main(["function", str(table), "--unwrap", "--set", "top=1", "--no-preset"]) == 0
    assert capsys.readouterr().out.startswith("reached: 1 linkage")
    table.write_text("{}")
    assert cli.main(["synthesize", str(table), "--unwrap"]) == 2
    assert "--unwrap is for a table" in capsys.readouterr().err


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
    places, angles = [[x, y] for x, y, _ in rows], [angle for _, _, angle in rows]
    assert request_from_csv(file.getvalue()) == {"position": places, "rotation": angles, "timing": "free"}


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
