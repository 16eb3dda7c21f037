"""Tables of samples are read correctly, or refused with a sentence that names the line.

A column, unit or separator that is misread without a warning would show here.
"""

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
from linkage_atlas.cells import decoded
from linkage_atlas.heads import FUNCTIONS, KINDS, ROTATIONS
from linkage_atlas.tables import read_columns, read_table

TABLES = json.loads((Path(__file__).parent / "tables.json").read_text())
"""Tables from practice: readable tables with the expected fields, and wrong tables with words of the error."""


@pytest.mark.parametrize(("question", "text", "expected"), TABLES["read"])
def test_tables_of_any_country(question, text, expected) -> None:
    """Separators, decimal commas, grouped thousands, units, gaps, comments, names or none."""
    assert read_table(text, KINDS[question]).fields == expected


@pytest.mark.parametrize(("question", "text", "words"), TABLES["refused"])
def test_errors_name_line_and_column(question, text, words) -> None:
    with pytest.raises(FieldError) as error:
        read_table(text, KINDS[question])
    assert words in error.value.message


def test_a_table_that_cannot_be_read_ends_the_command(tmp_path, capsys) -> None:
    path = tmp_path / "motion.csv"
    wrong = {"x,z\n1,2\n": "line 1: give both x and y", "x;y\n1;" + "2" * 200_000: "line 2: field larger than"}
    for text, words in wrong.items():
        path.write_text(text)
        assert cli.main(["synthesize", str(path)]) == 2
        assert words in capsys.readouterr().err


def test_a_table_with_names_in_quotes_is_no_json(tmp_path, capsys) -> None:
    path = tmp_path / "motion.csv"
    path.write_text('\ufeff"x","y"\n"0","0"\n"10,5","2"\n"20","8"\n')
    assert cli.main(["synthesize", str(path), "--set", "top=1", "--set", "budget_ms=50"]) == 0
    assert "1 solution" in capsys.readouterr().out


def test_columns_are_chosen_by_head_or_number() -> None:
    text = "Frame;TX [cm];TY [cm];TZ;RX;RY;RZ [rad]\n1;1;2;0;0;0;0\n2;3;4;0;9;9;1\n"
    for columns in ({"x": "TX", "y": "ty", "angle": "RZ"}, {"x": "TX [cm]", "y": "3", "rotation": "7"}):
        table = read_table(text, columns=columns)
        assert table.fields["position"] == [[1, 2], [3, 4]] and table.length_unit == "cm"
        assert table.fields["rotation"] == pytest.approx([0, math.degrees(1)])
    assert "rotation" not in read_table(text, columns={"x": "TX", "y": "TY"}).fields, "only these columns are read"
    bare = read_table("9,1,2\n9,3,4\n", columns=read_columns("x=2, y=3")).fields
    assert bare["position"] == [[1, 2], [3, 4]]
    points = read_table("a,b,c,d\n0,0,10,0\n0,0,0,10\n", columns={"x1": "a", "y1": "b", "x2": "c", "y2": "d"}).fields
    assert points["rotation"] == [0, 90]
    function = read_table("a,b\n0,5\n1,6\n", FUNCTIONS, columns={"input": "a", "output": "b"})
    assert function.fields == {"input": [0, 1], "output": [5, 6]}


@pytest.mark.parametrize(
    ("columns", "field", "words"),
    [
        ({"x": "TX", "y": "TQ"}, "/columns/y", "'TQ' is not a column of the table; there are 'TX', 'TY'"),
        ({"x": "TX", "y": "TX"}, "/columns/y", "'TX' is named twice"),
        ({"z": "TX"}, "/columns/z", "there is no column 'z'"),
        ({"x": "TX"}, "", "give both x and y"),
    ],
)
def test_a_wrong_choice_of_columns_is_refused(columns, field, words) -> None:
    with pytest.raises(FieldError) as error:
        read_table("TX,TY\n1,2\n", columns=columns)
    assert error.value.field == field and words in error.value.message


@pytest.mark.parametrize(
    ("unit", "spellings"),
    {
        "mm": ["mm", "Millimeter", "millimetres"],
        "cm": ["cm"],
        "m": ["m", "metres"],
        "in": ["in", "inch", "inches", "″"],
        "ft": ["ft", "feet", "foot"],
        "um": ["µm", "μm", "um", "micron"],
    }.items(),
)
def test_usual_spellings_of_units(unit, spellings) -> None:
    for spelling in spellings:
        for head in (
            f"x [{spelling}];y",
            f"x ({spelling});y",
            f"x/{spelling};y",
            f"x in {spelling};y",
            f"x;y\n{spelling};",
        ):
            assert read_table(f"{head}\n1;2\n3;4\n").length_unit == unit, head


FILES = {
    b"\x89PNG\r\n\x1a\n": "a PNG picture",
    b"%PDF-1.7": "a PDF document",
    b"  0\r\nSECTION\r\n  2\r\nHEADER": "a DXF drawing",
    b"999\nmade by\n0\nSECTION\n": "a DXF drawing",
    b"ISO-10303-21;\nHEADER;": "a STEP model",
    b"PK\x03\x04": "an Excel workbook",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
    b"solid part\n facet normal 0 0 1": "an STL model",
    b"\xff\xd8\xff\xe0": "a JPEG picture",
    b'<?xml version="1.0"?><svg/>': "an XML file",
    b"x\0y\0": "a binary file",
}


@pytest.mark.parametrize(("content", "name"), FILES.items())
def test_other_files_are_named(content, name) -> None:
    """Such files used to be read as tables without known columns."""
    with pytest.raises(FieldError, match=name) as error:
        decoded(content)
    assert "CSV" in error.value.message


def test_what_is_asked_beside_a_table_joins_it() -> None:
    assert read_table("5\n6,5\n", ROTATIONS, {"top": 2}).fields == {"rotation": [5.0, 6.5], "top": 2}
    dials = {"function": {"output_span": 90}, "crank_span": 60}
    function = {"table": [[1.0, 2.0], [3.0, 4.0]], "output_span": 90}
    assert read_table("x,y\n1,2\n3,4\n", FUNCTIONS, dials).fields == {"function": function, "crank_span": 60}


def test_the_command_unwraps_and_answers_tables_of_every_question(tmp_path, capsys) -> None:
    table = tmp_path / "turns.csv"
    table.write_text("crank;rocker\n250;0\n5;12\n25;31\n50;62\n70;90\n")
    assert cli.main(["function", str(table)]) == 2
    assert "input" in capsys.readouterr().err
    assert cli.main(["function", str(table), "--unwrap", "--set", "top=1", "--no-preset"]) == 0
    assert capsys.readouterr().out.startswith("reached: 1 linkage")
    table.write_text("{}")
    assert cli.main(["synthesize", str(table), "--unwrap"]) == 2
    assert "--unwrap applies to a table" in capsys.readouterr().err


NUMBERS = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: round(value, 4))


@given(
    rows=st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=8),
    separator=st.sampled_from([",", ";", "\t", " "]),
    comma=st.booleans(),
    names=st.booleans(),
)
def test_what_a_spreadsheet_writes_is_what_is_read(rows, separator, comma, names) -> None:
    """Law: however cells are separated and decimals marked, the numbers are those that were written."""
    if not names and len({angle for _, _, angle in rows}) == 1:
        rows = rows[:1]  # the same number in every row may be a z
    comma = comma and any("." in f"{value:.4f}" for row in rows for value in row)
    file = io.StringIO()
    writer = csv.writer(file, delimiter=separator)
    if names:
        writer.writerow(("x", "y", "phi"))
    for row in rows:
        writer.writerow([f"{value:.4f}".replace(".", "," if comma else ".") for value in row])
    positions, angles = [[x, y] for x, y, _ in rows], [angle for _, _, angle in rows]
    assert read_table(file.getvalue()).fields == {"position": positions, "rotation": angles, "timing": "free"}


@given(st.text(max_size=60))
def test_any_text_is_a_table_or_an_error_that_says_where(text) -> None:
    try:
        request = read_table(text).fields
    except FieldError as error:
        assert error.field == "" and error.message
    else:
        assert request.keys() & {"rotation", "position"}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_files_in_the_encodings_of_spreadsheets(encoding) -> None:
    text = "x;y;phi [°]\n1,5;2;5\n"
    assert decoded(text.encode(encoding)) == decoded(f"\ufeff{text}".encode("utf-16-be")) == text
