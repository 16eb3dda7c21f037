"""Errors of a request are sentences in the user's terms, the same over HTTP and on the command line.

It would catch a validator's own words, such as "List should have at least 3 items after validation".
"""

import json

import pytest

from app.openapi import FILE
from linkage_atlas import FieldError
from tests.app.test_http import REFUSED
from tests.conftest import changed

SAID = [row for row in REFUSED if row[0] == "synthesize" and "detail" in row[-1] and row[2].get("effort") != "atlas"]


@pytest.mark.parametrize("row", SAID, ids=lambda row: json.dumps(row[2])[:60])
def test_an_error_is_the_same_sentence_over_http_and_on_the_command_line(row, client, run) -> None:
    body = changed(*row[1:3])
    problem = client.post("/v2/synthesize", json=body).json()
    field, _, words = problem["detail"].partition(": ")
    assert problem["errors"][0]["detail"] == words
    code, _, err = run("synthesize", stdin=json.dumps(body))
    first = err.splitlines()[0]
    assert code == 2 and first.startswith(f"{field}: ")
    assert first == problem["detail"] or "'" in first  # a text that was found is repeated on the command line only


def test_no_error_of_any_field_has_the_validators_words(client) -> None:
    """Wrong values of each kind for each field of each question."""
    document = json.loads(FILE.read_text())
    seen = set()
    for path, methods in document["paths"].items():
        schema = (
            methods.get("post", {})
            .get("requestBody", {})
            .get("content", {})
            .get("application/json", {})
            .get("schema")
        )
        if schema is None:
            continue
        fields = [*document["components"]["schemas"][schema["$ref"].rpartition("/")[2]]["properties"]]
        for first in range(0, len(fields), 12):  # the unknown field keeps a valid request from being answered
            for value in ("text", -1e99, [1] * 2000, {}, [None]):
                body = {"unknown": 1, **dict.fromkeys(fields[first : first + 12], value)}
                reply = client.post(path, json=body)
                assert reply.status_code in (400, 422)
                seen |= {row["detail"] for row in reply.json().get("errors", [])}
    assert len(seen) > 50
    assert not [words for words in seen if "should" in words or "valid " in words or "validation" in words], seen


def test_items_count_from_one_in_errors_of_python_too() -> None:
    assert str(FieldError("/position/2/0", "is far")) == "position, sample 3, x: is far"
    assert str(FieldError("/limits/keep_out/0", "is empty")) == "limits.keep_out, item 1: is empty"
    assert str(FieldError("", "is empty")) == "request: is empty"
