"""Every route answers as the contract says, and hostile requests get a problem that names the fault.

A reply with a wrong status, a number that is not finite, or an input that is echoed would show here.
"""

import gzip
import json
import math
from collections.abc import Callable, Iterator
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

import linkage_atlas as la
from app import worker
from app.bodies import MAX_CONTAINERS, MAX_KEYS, MAX_VALUES
from app.fourbar.answers import answer_synthesize
from app.fourbar.models import SynthesizeRequest
from app.main import create_app
from app.query import plain_of
from app.registry import all_queries, worked_example
from app.resources import ServiceResources
from app.scenes import scene_queries
from app.settings import Settings
from tests.conftest import changed, finite

EXAMPLE = worked_example()
ROTATION, POSITION = EXAMPLE["rotation"], EXAMPLE["position"]
JSON = {"content-type": "application/json"}
BODY_LIMIT = 300_000


@pytest.fixture(scope="module")
def client(small_bytes: bytes, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The service with an atlas of few types, for all tests that do not need the published atlas."""
    path = tmp_path_factory.mktemp("http") / "small.h5"
    path.write_bytes(small_bytes)
    with TestClient(
        create_app(Settings(atlas=path, workers=1, max_body_bytes=BODY_LIMIT)), follow_redirects=False
    ) as client:
        yield client


@pytest.fixture(scope="module")
def paper(atlas_path: Path) -> Iterator[TestClient]:
    """The service with the published atlas of 101,408 types."""
    with TestClient(create_app(Settings(atlas=atlas_path, workers=1))) as client:
        yield client


def ask(client: TestClient, path: str, **fields: Any) -> dict[str, Any]:
    """The reply to a good request; every number in it is finite."""
    reply = client.post(path, json=fields)
    assert reply.status_code == 200, reply.text
    assert reply.headers["content-type"] == "application/json"
    values = json.loads(reply.text, parse_constant=lambda name: pytest.fail(f"{name} in a reply"))
    assert finite(values)
    return values


def refusal(client: TestClient, path: str, body: str | bytes | dict[str, Any], **options: Any) -> dict[str, Any]:
    """The problem that a bad request gets: a 4xx of the right form."""
    content = json.dumps(body) if isinstance(body, dict) else body
    return problem(client.post(path, content=content, headers=options.pop("headers", JSON), **options))


def problem(reply: Any, statuses: range = range(400, 500)) -> dict[str, Any]:
    assert reply.status_code in statuses, reply.text
    assert reply.headers["content-type"] == "application/problem+json"
    values = reply.json()
    assert values["status"] == reply.status_code and values["title"] and values["detail"]
    assert len(reply.content) < 10_000
    for row in values.get("errors", []):
        assert row["pointer"].startswith("#") and row["detail"]
    return values


def pointers(values: dict[str, Any]) -> list[str]:
    return [row["pointer"] for row in values["errors"]]


# -- the worked example -----------------------------------------------------------------------------------------------


def test_match_ranks_the_published_type_first(paper) -> None:
    reply = ask(paper, "/v2/match", rotation=ROTATION, crank_span=70)
    assert len(reply["matches"]) == 10
    first = reply["matches"][0]
    assert first["type"] == {"number": 45185, "lengths": [19, 72, 144, 165]}
    assert (first["rank"], first["start_angle"], first["branch"]) == (1, 30.0, 1)
    assert first["rotation_rms"] < 1e-4
    assert first["offset"] == pytest.approx(np.rad2deg(-0.8012), abs=1e-3)
    order = [(m["rotation_rms"], m["type"]["number"], m["start_angle"], -m["branch"]) for m in reply["matches"]]
    assert order == sorted(order)
    assert [m["rank"] for m in reply["matches"]] == list(range(1, 11))
    assert reply["report"]["windows"] == 101_408 * 2 * 360


@pytest.mark.parametrize("effort", ["atlas", "refine"])
def test_synthesize_recovers_the_published_linkage(effort, paper) -> None:
    reply = ask(paper, "/v2/synthesize", **EXAMPLE, effort=effort, top=2)
    best = reply["solutions"][0]
    assert reply["status"] == "reached" and reply["report"]["stopped_by"] == "tolerance"
    mount, close = best["mount"], {"abs": 1e-6}
    assert list(best["links"].values()) == pytest.approx([19, 72, 144, 165], **close)
    assert mount["coupler_point_polar"] == pytest.approx({"radius": 20, "angle": 60}, **close)
    assert mount["ground_angle"] == pytest.approx(30, **close)
    assert mount["pivot_a"] == pytest.approx([10 * math.cos(math.pi / 4)] * 2, **close)
    ends = [mount["pivot_a"][k] + 165 * f(math.radians(30)) for k, f in enumerate((math.cos, math.sin))]
    assert mount["pivot_b"] == pytest.approx(ends, **close)
    assert best["start_angle"] == pytest.approx(30, **close) and best["branch"] == 1
    assert best["errors"]["objective"] < 1e-10 and best["errors"]["position_max"] < 1e-8
    if effort == "atlas":
        assert (best["source"], best["type"]["number"]) == ("atlas", 45185)
        assert reply["report"]["exhaustive"] and reply["report"]["windows"] == 101_408 * 720
    else:
        assert (best["source"], best["type"]) == ("refined", None)


# -- match ------------------------------------------------------------------------------------------------------------


# -- synthesize -------------------------------------------------------------------------------------------------------


def test_tolerance_decides_the_status(client) -> None:
    loose = ask(client, "/v2/synthesize", **EXAMPLE, effort="atlas", tolerance=0.5, top=1)
    assert (loose["status"], loose["report"]["stopped_by"]) == ("reached", "tolerance")
    strict = ask(client, "/v2/synthesize", **EXAMPLE, effort="atlas", tolerance=0, top=1)
    assert (strict["status"], strict["report"]["stopped_by"]) == ("closest", "converged")
    impossible = {"crank_span": 10, "effort": "atlas", "limits": {"link_max": 1e-3}}
    none = ask(client, "/v2/synthesize", rotation=ROTATION[:3], **impossible)
    assert (none["status"], none["solutions"]) == ("unknown", [])  # not all windows were looked at
    refined = ask(client, "/v2/synthesize", **EXAMPLE, tolerance=1e-3, top=1)
    assert refined["status"] == "reached" and refined["solutions"][0]["errors"]["objective"] < 1e-3


class TickingResources(ServiceResources):
    """A clock that advances by ten milliseconds at each look: the same budget on every machine."""

    def work(self, budget: float | None = None) -> la.Work:
        return la.Work(budget, None, count(step=0.01).__next__)


def ticking(**settings: Any) -> Callable[..., dict[str, Any]]:
    """Return ``ask(**fields)``, the answer of the service to a request with such a clock."""
    resources = TickingResources(Settings(with_atlas=False, **settings))
    return lambda **fields: plain_of(answer_synthesize(SynthesizeRequest(**fields), resources))


ZIGZAG = {"rotation": [10.0 * (k % 2) for k in range(16)], "crank_span": 300, "top": 2}
"""No four-bar comes near this motion; the linkage of smallest error may be second."""


def test_a_budget_ends_the_search_and_the_trace_falls() -> None:
    ask = ticking()
    reply, longer = ask(**ZIGZAG, prefer="error", budget_ms=250), ask(**ZIGZAG, prefer="error", budget_ms=500)
    report = reply["report"]
    assert reply["status"] == "closest" and report["stopped_by"] == longer["report"]["stopped_by"] == "budget"
    assert 250 <= report["elapsed_ms"]["total"] < 400 < longer["report"]["elapsed_ms"]["total"]
    assert set(report["elapsed_ms"]) >= {"screen", "refine", "total"}
    times, objectives = zip(*report["trace"], strict=True)
    assert list(times) == sorted(times)
    # the last entry is recomputed from the reply's numbers: it may differ by rounding
    assert all(later <= earlier * (1 + 1e-9) for earlier, later in pairwise(objectives))
    smallest, later = (
        min(solution["errors"]["objective"] for solution in each["solutions"]) for each in (reply, longer)
    )
    assert objectives[-1] <= smallest * (1 + 1e-6)
    assert later <= smallest * (1 + 1e-9)


def test_no_request_computes_longer_than_the_service_allows() -> None:
    reply = ticking(max_budget_ms=500)(**ZIGZAG, budget_ms=60_000)
    assert reply["report"]["stopped_by"] == "budget" and reply["report"]["elapsed_ms"]["total"] < 700


# -- malformed requests -----------------------------------------------------------------------------------------------

MATCH = json.dumps({"rotation": ROTATION, "crank_span": 70, "top": 3})
"""A good request as text, to be spoilt."""
MARK = "never_echo_this"


def spoilt(old: str, new: str) -> str:
    assert MATCH.count(old) == 1
    return MATCH.replace(old, new)


@pytest.mark.parametrize("literal", ["NaN", "Infinity", "-Infinity", "1e999", "-1e999", '"70"', "true", "[70]", "{}"])
def test_what_is_no_finite_number_is_pointed_at(literal, client) -> None:
    assert pointers(refusal(client, "/v2/match", spoilt("70", literal))) == ["#/crank_span"]
    in_list = '{"crank_span": 70, "rotation": [1, 2, ' + literal + ", 3]}"
    assert pointers(refusal(client, "/v2/match", in_list)) == ["#/rotation/2"]
    in_path = '{"crank_span": 70, "position": [[1, 2], [3, ' + literal + "], [5, 6]]}"
    assert pointers(refusal(client, "/v2/synthesize", in_path)) == ["#/position/1/1"]


def test_who_says_nothing_of_the_crank_is_told_what_the_question_takes(client) -> None:
    timing = refusal(client, "/v2/synthesize", '{"rotation": [0, 8, 19]}')["errors"]
    assert [row["pointer"] for row in timing] == ["#/crank_span"] and "`position`" in timing[0]["detail"]
    timing = refusal(client, "/v2/match", '{"rotation": [0, 8, 19]}')["errors"]
    assert "`crank_angle`" in timing[0]["detail"] and "position" not in timing[0]["detail"]


NO_OBJECTS = ["", " ", "[", "{", '{"rotation"', "nonsense", MATCH + "x", "\0", b"\xff\xfe{}"]
NO_OBJECTS += ['{"rotation": "\xff"}'.encode("latin-1"), "null", "[]", "3", '"text"', "true", '{"\\ud800": 1}']


@pytest.mark.parametrize("body", NO_OBJECTS, ids=lambda body: repr(body)[:24])
def test_what_is_no_json_object_is_refused(body, client) -> None:
    for path in ("/v2/match", "/v2/synthesize"):
        values = refusal(client, path, body)
        assert pointers(values) == ["#"] and "Request" not in values["detail"], "no name of the code"


MALFORMED = {
    "keys": "{" + ",".join(f'"k{k}":1' for k in range(MAX_KEYS + 1)) + "}",
    "arrays": '{"position":[' + ",".join(["[]"] * (MAX_CONTAINERS + 1)) + "]}",
    "values": '{"times":[' + ",".join("1" * (MAX_VALUES + 1)) + "]}",
    "depth": '{"rotation":' + "[" * 5000 + "]" * 5000 + "}",
    "depth of objects without an end": '{"rotation":' * 10_000,
    "digits": '{"rotation":[1,2,' + "9" * 5000 + "]}",
    "key twice within": '{"limits":{"family":"any","family":"full_crank"}}',
}


@pytest.mark.parametrize("why", MALFORMED)
def test_a_body_that_would_keep_the_parser_busy_is_refused(why, client) -> None:
    values = refusal(client, "/v2/match", MALFORMED[why])
    assert values["status"] == 400 and pointers(values) == ["#"]


def test_a_body_that_is_packed_is_refused_by_what_is_wrong(client) -> None:
    headers = {"content-type": "application/json", "content-encoding": "gzip"}
    reply = client.post("/v2/knotter/needle", content=gzip.compress(b"{}"), headers=headers)
    assert reply.status_code == 415 and "Content-Encoding" in reply.json()["detail"]


@pytest.mark.parametrize("path", ["/livez", "/readyz", "/openapi.json", "/docs", "/"])
def test_what_can_be_got_can_be_asked_for_its_head_alone(path, client) -> None:
    complete, head = client.get(path), client.head(path)
    assert head.status_code == complete.status_code == 200 and not head.content
    assert head.headers.get("etag") == complete.headers.get("etag")
    assert client.head(path.rstrip("/") + "/nowhere").status_code == 404


REFUSALS = json.loads((Path(__file__).parent / "refusals.json").read_text())
"""A valid body for each question, and changes that make it wrong: the pointer of the error, and its words."""
REFUSED = [(name.split()[0], table["body"], *row) for name, table in REFUSALS.items() for row in table["refused"]]
IN_VAIN = [row for row in REFUSED if row[0] == "lift/optimize" and row[3] == "/constraints"]
FURTHER = [row for row in IN_VAIN if "b<=max" not in str(row)]
"""Whole searches are wide, except the change with the most informative error."""


@pytest.mark.parametrize(
    "row",
    [pytest.param(row, marks=[pytest.mark.wide] * (row in FURTHER)) for row in REFUSED],
    ids=lambda row: f"{row[0]} {json.dumps(row[2])[:60]}",
)
def test_what_is_wrong_is_pointed_at_and_not_repeated(row, client) -> None:
    path, body, change, position, *said = row
    values = refusal(client, f"/v2/{path}", changed(body, change))
    error = values["errors"][0]
    assert values["status"] == 422 and error["pointer"] == "#" + position
    assert MARK in position or MARK not in json.dumps(values)
    for name, expected in said[0].items() if said else ():
        if name == "detail":
            assert expected in error["detail"]
        else:
            close = name == "amount" or isinstance(expected, float)
            assert error[name] == (pytest.approx(expected, rel=1e-6, abs=1e-4) if close else expected)


def test_a_refusal_lists_few_errors_and_cuts_long_names(client) -> None:
    values = refusal(client, "/v2/match", {"rotation": [MARK] * 1024, "crank_span": 70})
    assert len(values["errors"]) == 20 and MARK not in json.dumps(values)
    assert pointers(refusal(client, "/v2/match", {"rotation": [1.0] * 2000, "crank_span": 70})) == ["#/rotation"]
    refusal(client, "/v2/match", {"x" * 100_000: 1})
    refusal(client, "/v2/match", {"\u00e9" * 30_000: 1})


@pytest.mark.parametrize("kind", [None, "text/plain", "application/x-www-form-urlencoded", "application/xml", "x"])
def test_a_body_that_is_not_declared_as_json_gets_415(kind, client) -> None:
    values = refusal(client, "/v2/match", MATCH, headers={"content-type": kind} if kind else {})
    assert values["status"] == 415 and "application/json" in values["detail"]


@pytest.mark.parametrize("declared", [True, False], ids=["content-length", "chunked"])
def test_a_body_above_the_limit_gets_413(declared, client) -> None:
    assert client.post("/v2/match", content=MATCH.ljust(BODY_LIMIT), headers=JSON).status_code == 200
    text = MATCH.ljust(BODY_LIMIT + 1).encode()
    body = text if declared else (text[k : k + 1000] for k in range(0, len(text), 1000))
    assert refusal(client, "/v2/match", body)["status"] == 413
    huge = refusal(client, "/v2/match", MATCH, headers={**JSON, "content-length": "9" * 5000})
    assert huge["status"] == 413


@pytest.mark.parametrize("path", "/static /v2/match/ /v1/match /v2/types /.env /v2/%00".split())
def test_an_unknown_route_gets_404(path, client) -> None:
    for method in ("GET", "POST"):
        values = problem(client.request(method, path), range(404, 405))
        assert path.strip("/") == "" or path not in json.dumps(values)


@pytest.mark.parametrize("method", ["GET", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "NONSENSE"])
def test_a_wrong_method_gets_405(method, client) -> None:
    reply = client.request(method, "/v2/match")
    problem(reply, range(405, 406))
    assert reply.headers["allow"] == "POST"
    if method != "GET":
        problem(client.request(method, "/livez"), range(405, 406))


def test_a_fault_of_the_service_is_a_problem_too(monkeypatch, caplog) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError(MARK)

    monkeypatch.setattr("linkage_atlas.synthesize", fail)
    monkeypatch.setattr(worker, "_resources", ServiceResources(Settings(with_atlas=False)), raising=False)
    reply = worker.answer("/v2/synthesize", json.dumps(EXAMPLE).encode())
    assert reply.status_code == 500 and reply.media_type == "application/problem+json"
    assert MARK not in reply.body.decode() and MARK in caplog.text, "the log says more"


# -- a missing atlas --------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", ["missing", "damaged", "folder"])
def test_without_an_atlas_the_rest_answers(fault, small_bytes, tmp_path) -> None:
    path = tmp_path / "atlas.h5"
    if fault == "folder":
        path.mkdir()
    elif fault == "damaged":
        path.write_bytes(small_bytes[:-1])
    with TestClient(create_app(Settings(atlas=path, workers=1))) as client:
        assert client.get("/livez").status_code == 200
        for reply in (
            client.get("/readyz"),
            client.post("/v2/match", content=MATCH, headers=JSON),
            client.post("/v2/synthesize", json={**EXAMPLE, "effort": "atlas"}),
        ):
            problem(reply, range(503, 504))
            assert int(reply.headers["retry-after"]) > 0
        assert ask(client, "/v2/synthesize", **EXAMPLE, top=1)["status"] == "reached", "the search needs no atlas"
        assert refusal(client, "/v2/match", "{}")["status"] == 422
        assert ask(client, "/v2/knotter/needle")["status"] == "free", "nor do the scenes"


# -- OpenAPI ----------------------------------------------------------------------------------------------------------

EXAMPLES = [
    pytest.param(query, name, id=mark)
    for query in all_queries()
    for name in query.examples
    for mark in [f"{query.command}-{name}"]
]


@pytest.fixture(scope="module")
def document(client) -> dict[str, Any]:
    """The description as the service gives it."""
    return client.get("/openapi.json").json()


@pytest.mark.parametrize(("query", "name"), EXAMPLES)
def test_every_example_of_the_description_is_answered(query, name, document, client) -> None:
    described = document["paths"][query.path]["post"]
    body = described["requestBody"]["content"]["application/json"]["examples"][name]["value"]
    assert body == {key: value for key, value in query.examples[name].items() if value is not None}
    if query not in scene_queries():  # tests/app/scenes asks theirs
        assert ask(client, query.path, **body)


def test_the_description_is_valid_openapi(document) -> None:
    from schemathesis.specs.openapi.definitions import OPENAPI_31_VALIDATOR

    assert document["openapi"].startswith("3.1")
    assert [error.message for error in OPENAPI_31_VALIDATOR.iter_errors(document)] == []
    for path, methods in document["paths"].items():
        for method, described in methods.items():
            assert described["summary"] and described["tags"], (method, path)
            for status, answer in described["responses"].items():
                if int(status) >= 400:
                    assert list(answer["content"]) == ["application/problem+json"], (path, status)
