"""Requests generated from the API's description never get a 5xx, and errors are problem+json.

A value that the description allows and the service cannot handle would show here.
"""

import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from itertools import count
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response

import linkage_atlas as la
from app import main, worker
from app.bodies import check_counts
from app.compute import Workers
from app.openapi import FILE
from app.questions import Question
from app.resources import ServiceResources
from app.settings import Settings

EXAMPLES = {"positive": 12, "negative": 25}
"""Requests of each operation in the wide run: those that follow the description are searched for, which takes time."""
SHARE = {"positive": 12, "negative": 9}
"""The default run takes the first case of each group of this size."""
SHAPED = 40
"""Requests of the right shape with numbers of any size."""
CHECKS = [f"{part}_conformance" for part in ("status_code", "content_type", "response_schema")]
CHECKS += ["not_a_server_error", "negative_data_rejection"]
SETTINGS = settings(deadline=None, database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
CASES = [
    (f"{method.upper()} {path}", mode)
    for path, methods in json.loads(FILE.read_text())["paths"].items()
    for method, operation in methods.items()
    for mode in EXAMPLES
    if mode == "positive" or "requestBody" in operation or "{" in path
]
"""Operations of the committed description, which test_openapi.py compares with the application.

Every process of a run builds them, so the tests import schemathesis, which takes seconds, themselves.
"""


class CountedWork(la.Work):
    """Work that ends a search after some readings of its clock, and leaves all other work its time."""

    def go_on(self) -> None:
        self.check()


class CountedResources(ServiceResources):
    """Search equally briefly on every machine."""

    def work(self, budget: float | None = None) -> la.Work:
        return CountedWork(0.02 if budget is None else min(budget, 0.02), None, count(step=5e-3).__next__)


class InProcess(Workers):
    """Answers are computed in this process, without a limit of time: a 503 would be a fault."""

    failure = None

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(worker, "_resources", CountedResources(self.settings), raising=False)
            yield

    async def answer(self, request: Request, question: Question, content: bytes) -> Response:
        check_counts(content)
        return worker.answer(question.path, content)


@pytest.fixture(scope="module")
def api(small_bytes: bytes, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Starlette]:
    """The application over an atlas of few types, with short searches."""
    path = tmp_path_factory.mktemp("fuzz") / "small.h5"
    path.write_bytes(small_bytes)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "Workers", InProcess)
        yield main.create_app(Settings(atlas=path))


@pytest.fixture(scope="module")
def session(api: Starlette) -> Iterator[Any]:
    """A client inside the process; the application starts once."""
    from schemathesis.python.asgi import get_client

    with get_client(api) as client:
        yield client


@pytest.fixture(scope="module")
def operations(api: Starlette) -> dict[str, Any]:
    import schemathesis

    schema = schemathesis.openapi.from_dict(json.loads(FILE.read_text()))
    schema.app = api
    return {operation.ok().label: operation.ok() for operation in schema.get_all_operations()}


def some_and_all() -> list[Any]:
    """Each operation with some of its requests, and in the wide run with all.

    A route for a file reads requests like the route for JSON: bad requests and further formats are left to the
    wide run.
    """
    first = {label.partition(".")[:2]: label for label, _ in reversed(CASES)}.values()
    selected = [(label, mode) for label, mode in CASES if label in first and (mode == "positive" or "." not in label)]
    return [pytest.param(*case, SHARE[case[1]], id=f"{case[0]}-{case[1]}") for case in selected] + [
        pytest.param(*case, 1, id=f"{case[0]}-{case[1]}-all", marks=pytest.mark.wide) for case in CASES
    ]


@pytest.mark.parametrize(("label", "mode", "share"), some_and_all())
def test_no_request_of_the_description_breaks_the_service(label, mode, share, operations, session) -> None:
    import schemathesis

    schemathesis.checks.load_all_checks()
    checks = schemathesis.checks.CHECKS.get_by_names(CHECKS)

    def run(case: Any) -> None:
        reply = case.call(session=session)
        case.validate_response(reply, checks=checks)
        assert reply.status_code < 500
        if reply.status_code >= 400:
            assert reply.headers["content-type"] == ["application/problem+json"]
            assert reply.json()["status"] == reply.status_code

    cases = operations[label].as_strategy(generation_mode=schemathesis.GenerationMode(mode))
    seed(20)(settings(SETTINGS, max_examples=-(-EXAMPLES[mode] // share))(given(case=cases)(run)))()


extreme = st.sampled_from([0.0, 1e-320, 1e-300, 1e-50, 1e-9, 1e-3, 90.0, 360.0, 1e6, 1e49, 1e300, 1.7e308])
number = st.one_of(st.floats(0.5, 50), st.floats(0.5, 50), extreme)
signed = st.builds(lambda value, sign: value * sign, number, st.sampled_from([1, -1]))
limits = st.fixed_dictionaries(
    {},
    optional={
        "family": st.sampled_from(["full_crank", "crank_rocker", "double_crank", "any"]),
        "transmission_angle_min": st.sampled_from([0, 1e-300, 20, 89.999]),
        "pivot_box": st.lists(signed, min_size=4, max_size=4).map(lambda box: sorted(box[:2]) + sorted(box[2:])),
        "link_min": number,
        "link_max": number,
    },
)


def motion(samples: int) -> st.SearchStrategy[dict[str, Any]]:
    """Requests whose shapes are right and whose numbers are not always."""
    any_curve, any_path = (
        st.lists(values, min_size=samples, max_size=samples) for values in (signed, st.tuples(signed, signed))
    )
    line = st.builds(lambda a, b: [a + b * k for k in range(samples)], signed, signed)
    arc = st.builds(lambda a, b, c: [(a + b * k, c * k * k) for k in range(samples)], signed, signed, signed)
    curve, span = st.one_of(any_curve, line), st.one_of(st.sampled_from([70, -350, 0.1, 3600]), signed)
    fields = {"angle_unit": st.sampled_from(["deg", "rad"]), "effort": st.sampled_from(["atlas", "refine"])}
    fields |= {"top": st.integers(1, 5), "sensitivity": st.booleans(), "limits": limits}
    fields |= dict.fromkeys(("tolerance", "budget_ms", "length_scale", "round_to"), number)
    fields |= {"rotation": curve, "position": st.one_of(any_path, arc), "crank_span": span, "crank_angle": curve}
    use = st.sampled_from([{"crank_span"}, {"crank_span"}, {"crank_span"}, {"crank_angle"}])
    give = st.sampled_from([{"rotation"}, {"position"}, {"rotation", "position"}])
    extra = st.sets(st.sampled_from(sorted(set(fields) - {"rotation", "position", "crank_span", "crank_angle"})))
    return st.builds(lambda *sets: set().union(*sets), use, give, extra).flatmap(
        lambda names: st.fixed_dictionaries({name: fields[name] for name in sorted(names)})
    )


def test_no_numbers_of_the_right_shape_break_the_service(session) -> None:
    answered = []

    @seed(20)
    @settings(SETTINGS, max_examples=SHAPED)
    @given(body=st.sampled_from([3, 4, 9]).flatmap(motion))
    def run(body: dict[str, Any]) -> None:
        headers = {"content-type": "application/json"}
        reply = session.post("/v2/synthesize", data=json.dumps(body), headers=headers)
        assert reply.status_code in (200, 422), reply.text
        assert "NaN" not in reply.text and "Infinity" not in reply.text
        answered.append(reply.status_code == 200)

    run()
    assert sum(answered) > SHAPED / 5, "some requests must get through for this to say something"
