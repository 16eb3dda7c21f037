"""Every example of every scene is answered alike over HTTP and on the command line.

A malformed request with a 5xx, or work that continues for a client that has left, would show here.
"""

import json

import pytest

from app import cli
from app.query import reply_model
from app.scenes import scene_queries
from app.study import without_times
from synthesis.work import Cancelled, Work

SLOW = {"lift optimize-even", "lift optimize-buildable"}
"""Examples of queries with another example or their own test in test_knotter.py and test_lift.py."""
EXAMPLES = [
    pytest.param(query, name, id=mark, marks=[pytest.mark.wide] * (mark in SLOW))
    for query in scene_queries()
    for name in query.examples
    for mark in [f"{query.command}-{name}"]
]


@pytest.mark.parametrize(("query", "name"), EXAMPLES)
def test_example_is_answered_alike_over_http_and_on_the_command_line(query, name, client, capsys) -> None:
    over_http = client.post(query.path, json=query.examples[name])
    assert over_http.status_code == 200, over_http.text
    assert cli.main([*query.command.split(), "--example", name, "--json"]) == 0
    reply, messages = capsys.readouterr()
    assert without_times(over_http.json()) == without_times(json.loads(reply))
    table = query.table(reply_model(query.reply).model_validate_json(reply))
    assert messages == "" and len(table.splitlines()) >= 2 and "{" not in table and "nan" not in table.lower()


class Leaving:
    """Resources of a client that leaves at the n-th check of its work."""

    max_budget_ms = 30_000.0

    def __init__(self, after: int) -> None:
        self.left = after

    def gone(self) -> bool:
        self.left -= 1
        return self.left < 0

    def work(self, budget=None):
        return Work(budget, self.gone)


STEPPED = [query for query in scene_queries() if query.path.split("/")[2] in ("chain", "knotter")]
AT_ONCE = {"/v2/knotter/needle"}
"""Closed forms: there is nothing to cut short."""


@pytest.mark.parametrize("after", [0, 2])
@pytest.mark.parametrize("query", STEPPED, ids=lambda query: query.command)
def test_a_client_that_leaves_ends_the_work(query, after) -> None:
    request = query.request.model_validate(next(iter(query.examples.values())))
    answers = [query.answer, *query.exports.values()]
    for answer in answers if query.path not in AT_ONCE else ():
        with pytest.raises(Cancelled):
            answer(request, Leaving(after))
