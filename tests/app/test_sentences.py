"""Errors of a request are sentences in the user's terms, the same over HTTP and on the command line.

It would catch a validator's own words, such as "List should have at least 3 items after validation".
"""

import json

import pytest

from app.openapi import FILE
from app.registry import worked_example
from linkage_atlas import FieldError

BODY = worked_example()
CASES = [
    ({"crank_span": "70"}, "crank_span: must be a number, found text"),
    ({"crank_span": True}, "crank_span: must be a number, found true"),
    ({"rotation": [1]}, "rotation: must have at least 2 samples, found 1"),
    ({"crank_angle": [1]}, "crank_angle: must have at least 3 samples, found 1"),
    ({"position": [[0, 0], [1, "x"], [2, 2]]}, "position, sample 2, y: must be a number, found text"),
    ({"position": [[0, 0], [1], [2, 2]]}, "position, sample 2: must be two numbers, [x, y], found 1"),
    ({"rotation": 5}, "rotation: must be a list, as [1, 2], found 5"),
    ({"top": 2.5}, "top: must be a whole number, found 2.5"),
    ({"top": 0}, "top: must be at least 1, found 0"),
    ({"top": 101}, "top: must be at most 100, found 101"),
    ({"budget_ms": -1}, "budget_ms: must be above 0, found -1"),
    ({"closed": 1}, "closed: must be true or false, found 1"),
    ({"limits": [1]}, 'limits: must be an object, as {"name": value}, found a list of 1'),
    (
        {"limits": {"pivot_box": [0, 0, 1]}},
        "limits.pivot_box: must be four numbers, [xmin, ymin, xmax, ymax], found 3",
    ),
    ({"limits": {"link_min": 1e99}}, "limits.link_min: must be at most 1e50, found 1e99"),
    ({"effort": "refin"}, "effort: must be one of atlas, refine; did you mean refine?"),
    ({"angle_unit": "grad"}, "angle_unit: must be one of deg, rad; did you mean deg?"),
    ({"angle_unit": "°"}, "angle_unit: must be one of deg, rad; did you mean deg?"),
    (
        {"analysis": {"crank_speed": 1, "length_unit": "Meter"}},
        "analysis.length_unit: must be one of um, mm, cm, m, in, ft; did you mean m?",
    ),
    ({"drives": [{}]}, "drives, item 1, kind: is required"),
    ({"toop": 3}, "toop: there is no field 'toop'; near: top"),
]


@pytest.mark.parametrize(("change", "said"), CASES, ids=[str(change)[:50] for change, _ in CASES])
def test_an_error_is_a_sentence_about_the_field(change, said, client, run) -> None:
    problem = client.post("/v2/synthesize", json=BODY | change).json()
    assert problem["detail"] == said
    field, _, words = said.partition(": ")
    assert problem["errors"][0]["detail"] == words
    code, _, err = run("synthesize", stdin=json.dumps(BODY | change))
    first = err.splitlines()[0]
    assert code == 2 and first.startswith(f"{field}: ")
    assert first == said or "'" in first  # a text that was found is repeated on the command line only


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
            for value in ("text", -1e99, 2.5, [], [1] * 2000, {}, [None]):
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
