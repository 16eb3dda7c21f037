"""Tables over HTTP are read as everywhere else, with the choice of columns and files in any encoding.

This catches a reader of its own for the page, and a table whose heads are lost when columns have to be chosen.
"""

import json
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

TABLES = json.loads((Path(__file__).parent / "tables.json").read_text())
TABLE = "Frame;TX [cm];TY [cm];RZ [rad]\n1;0;0;0\n2;1,5;2;1\n"


@pytest.mark.parametrize("question", ["synthesize", "match", "function"])
def test_tables_are_read_as_by_the_command(client: TestClient, question) -> None:
    for name, text, expected in TABLES["read"]:
        if name == question:
            reply = client.post("/v2/motion", json={"table": text, "query": question}).json()
            assert (reply["status"], reply["request"]) == ("read", expected), text
    for name, text, words in TABLES["refused"]:
        if name == question:
            reply = client.post("/v2/motion", json={"table": text, "query": question}).json()
            assert reply["status"] == "refused" and words in reply["message"], text


def test_the_reply_says_how_columns_were_read(client: TestClient) -> None:
    reply = client.post("/v2/motion", json={"table": TABLE}).json()
    assert reply["length_unit"] == "cm" and reply["headings"] == ["Frame", "TX [cm]", "TY [cm]", "RZ [rad]"]
    assert reply["columns"][2] == {"head": "RZ [rad]", "role": "angle", "unit": "rad"}
    assert reply["notes"] == [
        "columns read: x from 'TX [cm]', y from 'TY [cm]', angle from 'RZ [rad]' (converted to degrees); not read: 'Frame'"
    ]
    second = client.post("/v2/motion", json={"table": TABLE, "angle_unit": "rad", "length_unit": "mm"}).json()
    assert second["request"]["rotation"] == [0, 1] and second["request"]["position"][1] == [15, 20]
    assert second["request"]["angle_unit"] == "rad" and second["length_unit"] == "mm"


def test_a_choice_of_columns_is_asked_for_and_taken(client: TestClient) -> None:
    table = "left,right,turn\n1,2,3\n4,5,6\n"
    refused = client.post("/v2/motion", json={"table": table}).json()
    assert refused["status"] == "refused" and refused["headings"] == ["left", "right", "turn"]
    chosen = {"x": "left", "y": "2", "angle": "turn"}
    reply = client.post("/v2/motion", json={"table": table, "columns": chosen}).json()
    assert reply["request"]["position"] == [[1, 2], [4, 5]] and reply["request"]["rotation"] == [3, 6]
    wrong = client.post("/v2/motion", json={"table": table, "columns": {"x": "up", "y": "2"}}).json()
    assert wrong["status"] == "refused" and "'up' is not a column of the table" in wrong["message"]


@pytest.mark.parametrize(
    ("body", "pointer"),
    [({}, "#/table"), ({"table": "1,2", "file": "MSwy"}, "#/table"), ({"file": "not base64!"}, "#/file")],
)
def test_a_wrong_body_is_refused(client: TestClient, body, pointer) -> None:
    reply = client.post("/v2/motion", json=body)
    assert reply.status_code == 422 and reply.json()["errors"][0]["pointer"] == pointer
