"""Tables over HTTP are read as everywhere else, with the choice of columns and files in any encoding.

This catches a reader of its own for the page, and a table whose heads are lost when columns have to be chosen.
"""

import base64
import json
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

TABLES = json.loads((Path(__file__).parent / "tables.json").read_text())
TABLE = "Frame;TX [cm];TY [cm];RZ [rad]\n1;0;0;0\n2;1,5;2;1\n"


@pytest.mark.parametrize("question", ["synthesize", "match", "function"])
def test_tables_are_read_as_by_the_command(client: TestClient, question) -> None:
    for name, text, wanted in TABLES["read"]:
        if name == question:
            reply = client.post("/v1/motion", json={"table": text, "question": question}).json()
            assert (reply["status"], reply["request"]) == ("read", wanted), text
    for name, text, words in TABLES["refused"]:
        if name == question:
            reply = client.post("/v1/motion", json={"table": text, "question": question}).json()
            assert reply["status"] == "refused" and words in reply["message"], text


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_a_file_is_read_in_any_encoding(client: TestClient, encoding) -> None:
    content = base64.b64encode("x;y;phi [°]\n1,5;2;5\n3;4;6\n".encode(encoding)).decode()
    reply = client.post("/v1/motion", json={"file": content}).json()
    assert reply["request"] == {"timing": "free", "rotation": [5, 6], "position": [[1.5, 2], [3, 4]]}


def test_the_reply_says_how_columns_were_read(client: TestClient) -> None:
    reply = client.post("/v1/motion", json={"table": TABLE}).json()
    assert reply["length_unit"] == "cm" and reply["heads"] == ["Frame", "TX [cm]", "TY [cm]", "RZ [rad]"]
    assert reply["columns"][2] == {"head": "RZ [rad]", "role": "angle", "unit": "rad"}
    assert reply["notes"] == [
        "columns read: x from 'TX [cm]', y from 'TY [cm]', angle from 'RZ [rad]' (converted to degrees); not read: 'Frame'"
    ]
    other = client.post("/v1/motion", json={"table": TABLE, "angle_unit": "rad", "length_unit": "mm"}).json()
    assert other["request"]["rotation"] == [0, 1] and other["request"]["position"][1] == [15, 20]
    assert other["request"]["angle_unit"] == "rad" and other["length_unit"] == "mm"


def test_a_choice_of_columns_is_asked_for_and_taken(client: TestClient) -> None:
    table = "left,right,turn\n1,2,3\n4,5,6\n"
    refused = client.post("/v1/motion", json={"table": table}).json()
    assert refused["status"] == "refused" and refused["heads"] == ["left", "right", "turn"]
    chosen = {"x": "left", "y": "2", "angle": "turn"}
    reply = client.post("/v1/motion", json={"table": table, "columns": chosen}).json()
    assert reply["request"]["position"] == [[1, 2], [4, 5]] and reply["request"]["rotation"] == [3, 6]
    wrong = client.post("/v1/motion", json={"table": table, "columns": {"x": "up", "y": "2"}}).json()
    assert wrong["status"] == "refused" and "'up' is no column of the table" in wrong["message"]


@pytest.mark.parametrize(
    ("body", "pointer"),
    [({}, "#/table"), ({"table": "1,2", "file": "MSwy"}, "#/table"), ({"file": "not base64!"}, "#/file")],
)
def test_a_wrong_body_is_refused(client: TestClient, body, pointer) -> None:
    reply = client.post("/v1/motion", json=body)
    assert reply.status_code == 422 and reply.json()["errors"][0]["pointer"] == pointer
