"""Every query of every scene: its examples are answered, alike over HTTP and on the command line."""

from __future__ import annotations

import json

import pytest

from app import cli
from app.scenes import scene_queries

EXAMPLES = [(query, name) for query in scene_queries() for name in query.examples]


@pytest.mark.parametrize(("query", "name"), EXAMPLES, ids=[f"{q.command}-{n}" for q, n in EXAMPLES])
def test_example_is_answered_alike_over_http_and_on_the_command_line(query, name, client, capsys) -> None:
    over_http = client.post(query.path, json=query.examples[name])
    assert over_http.status_code == 200, over_http.text
    assert cli.main([*query.command.split(), "--example", name, "--json"]) == 0
    reply = json.loads(capsys.readouterr().out)
    drop = {"report", "elapsed_ms"}
    assert {k: v for k, v in reply.items() if k not in drop} == {
        k: v for k, v in over_http.json().items() if k not in drop
    }
    assert cli.main([*query.command.split(), "--example", name]) == 0
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize("query", scene_queries(), ids=lambda query: query.command)
@pytest.mark.parametrize(
    "body", ["", "[", "null", "[]", '{"no_such_field": 1}', '{"a": NaN}', "[" * 5000, '{"\\ud800": 1}']
)
def test_malformed_requests_are_the_clients_fault(query, body, client) -> None:
    reply = client.post(query.path, content=body, headers={"content-type": "application/json"})
    assert 400 <= reply.status_code < 500, reply.text
    assert reply.headers["content-type"] == "application/problem+json"
    assert reply.json()["errors"][0]["pointer"].startswith("#")
