"""No request takes longer than 1.2 times the longest budget: the costliest of each field of each route, by its description."""

import json
import time
from collections.abc import Iterator
from typing import Any

import pytest

from app.computer import SHARE_OF_BUDGET
from app.query import Query
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import Settings
from linkage_atlas import AtlasError, FieldError, OutOfTime
from tests.oracles.largest import requests


def pace() -> float:
    """How many times as slow as usual this machine is, at least once: all that is allowed is allowed so many times."""
    times = []
    for _ in range(5):
        begin = time.process_time()
        sum(k * k for k in range(300_000))
        times.append(time.process_time() - begin)
    return max(1.0, min(times) / USUAL)


USUAL = 0.015
"""Seconds of the sum in `pace`."""
BUDGET = pace()
SEARCH = 0.8 * BUDGET
"""What is left to a search of the longest budget, see `app.computer`."""
SMALL_BUDGET = 0.3 * BUDGET
QUERIES = {query.path: query for query in all_queries()}
FAST = {"lift: optimum", "knotter: curves, laws of 1,000 rows", "assembly: a star on two rails"}
FAST |= {"drives: four times two of 200 springs"}
"""Largest requests that did not end in time before, or that look at the clock least often."""


@pytest.fixture(scope="module")
def resources() -> ServiceResources:
    """What a computing process of a service without an atlas has, with a clock of its own processor time alone."""
    found = ServiceResources(Settings(with_atlas=False, max_budget_ms=1000 * SEARCH))
    found.prepare_rest()
    found.alone = True
    return found


class Limited:
    """Resources whose work ends with the longest budget, as `app.turns.Attended` has it."""

    def __init__(self, resources: ServiceResources) -> None:
        self._resources = resources

    def __getattr__(self, name: str) -> Any:
        return getattr(self._resources, name)

    def work(self, budget: float | None = None) -> Any:
        return self._resources.work(SEARCH if budget is None else min(budget, SEARCH))


def check(query: Query, body: dict[str, Any], resources: ServiceResources, budget: float = BUDGET) -> None:
    request = query.request.model_validate(body)
    begin = time.process_time()
    try:
        query.answer(request, Limited(resources))
    except (FieldError, AtlasError, OutOfTime, ValueError):
        pass  # it is refused, or would not be whole: but soon
    assert time.process_time() - begin <= SHARE_OF_BUDGET * budget


def largest() -> list[Any]:
    named = {name: one for name, one in requests().items() if one.path in QUERIES and not one.atlas}
    return [pytest.param(one, id=name, marks=[pytest.mark.wide] * (name not in FAST)) for name, one in named.items()]


@pytest.mark.parametrize("one", largest())
def test_the_largest_request_of_a_kind_ends_in_time(one, resources) -> None:
    check(QUERIES[one.path], json.loads(one.content), resources)


@pytest.mark.timed
@pytest.mark.parametrize(
    "name", ["path, any family within all limits", "free: poses", "sliders: travel within all limits"]
)
def test_a_budget_of_a_request_is_kept_too(name, resources) -> None:
    """At 1,024 samples: once nothing looked at the clock while dyads were paired (0.3 s), or a candidate got its drive."""
    one = requests()[name]
    check(QUERIES[one.path], {**json.loads(one.content), "budget_ms": 1000 * SMALL_BUDGET}, resources, SMALL_BUDGET)


def plain(prop: dict[str, Any], defs: dict[str, Any]) -> Any:
    """Some value that a schema allows."""
    if "$ref" in prop:
        prop = defs[prop["$ref"].rpartition("/")[2]]
    for part in prop.get("anyOf", prop.get("oneOf", ())):
        return plain(part, defs)
    if "const" in prop or "enum" in prop:
        return prop.get("const", prop.get("enum", [None])[0])
    kind = prop.get("type")
    if kind == "object":
        return {name: plain(prop["properties"][name], defs) for name in prop.get("required", ())}
    if kind == "array":
        fixed = [plain(one, defs) for one in prop.get("prefixItems", ())]
        return fixed or [plain(prop["items"], defs)] * max(1, prop.get("minItems", 1))
    return min(max(1, prop.get("minimum", 1)), prop.get("maximum", 1)) if kind in ("integer", "number") else "a"


def costliest(prop: dict[str, Any], value: Any, defs: dict[str, Any]) -> Iterator[Any]:
    """The largest values of a field that its schema allows; of an object one for each of its fields."""
    if "$ref" in prop:
        prop = defs[prop["$ref"].rpartition("/")[2]]
    for part in prop.get("anyOf", prop.get("oneOf", ())):
        yield from costliest(part, value, defs)
    if prop.get("type") == "boolean":
        yield True
    elif prop.get("type") in ("integer", "number") and "maximum" in prop:
        yield prop["maximum"]
    elif prop.get("type") == "array" and "maxItems" in prop:
        some = value if isinstance(value, list) and value else plain(prop, defs)
        yield (some * prop["maxItems"])[: prop["maxItems"]]
    elif "enum" in prop:
        yield from prop["enum"]
    elif "properties" in prop:
        own = value if isinstance(value, dict) else plain(prop, defs)
        for name, inner in prop["properties"].items():
            yield from ({**own, name: most} for most in costliest(inner, own.get(name), defs))


def asked() -> Iterator[tuple[Query, str, dict[str, Any]]]:
    """A request for each costliest value of each field, with the field's name."""
    for query in QUERIES.values():
        schema, example = query.request.model_json_schema(), next(iter(query.examples.values()))
        for name, prop in schema["properties"].items():
            for value in costliest(prop, example.get(name), schema.get("$defs", {})):
                yield query, name, {**example, name: value}


def taken(query: Query, body: dict[str, Any]) -> bool:
    try:
        query.request.model_validate(body)
    except ValueError:
        return False
    return True


def fields() -> list[Any]:
    found = [one for one in asked() if taken(one[0], one[2])]
    return [
        pytest.param(query, body, id=f"{query.path} {name} {k}", marks=[pytest.mark.wide] * (k % 96 > 0))
        for k, (query, name, body) in enumerate(found)
    ]


@pytest.mark.parametrize(("query", "body"), fields())
def test_the_costliest_value_of_a_field_ends_in_time(query, body, resources) -> None:
    check(query, body, resources)


REFUSED = {("/v1/knotter/fit", "pattern"), ("/v1/lift/optimize", "objective")}
"""Of these one field alone decides nothing: they go with others of theirs."""


def test_every_field_has_a_costliest_value_that_is_taken() -> None:
    every = {(query.path, name) for query, name, _ in asked()}
    reached = {(query.path, name) for query, name, body in asked() if taken(query, body)}
    assert every - reached == REFUSED
