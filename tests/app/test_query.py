"""Models of requests and replies: built when they are first used, or all at once."""

import pytest
from pydantic import ValidationError

from app.fourbar.models import SynthesizeRequest
from app.query import ReplyModel, RequestModel, build_models, invalid
from app.registry import all_queries


def test_a_model_is_built_when_it_is_first_used_or_with_all_others() -> None:
    class Inner(ReplyModel):  # in here: another test may have built all others
        value: int

    class Outer(Inner):
        inner: Inner

    assert not Inner.__pydantic_complete__ and not Outer.__pydantic_complete__
    assert Inner(value=1).value == 1
    assert Inner.__pydantic_complete__ and not Outer.__pydantic_complete__
    queries = all_queries()  # which loads the scenes
    build_models()
    assert Outer.__pydantic_complete__
    assert all(model.__pydantic_complete__ for query in queries for model in (query.request,))
    assert all(model.__pydantic_complete__ for base in (RequestModel, ReplyModel) for model in base.__subclasses__())


def test_an_error_within_a_choice_points_to_its_field_alone() -> None:
    asked = {"rotation": [0, 1, 2], "crank_span": 3, "tolerances": {"rotation": [1, -2, 3]}}
    with pytest.raises(ValidationError) as caught:
        SynthesizeRequest(**asked)
    assert [row["loc"] for row in invalid(caught.value, SynthesizeRequest).errors] == [("tolerances", "rotation", 1)]
    asked["tolerances"] = {"rotation": "small"}
    with pytest.raises(ValidationError) as caught:
        SynthesizeRequest(**asked)
    assert {row["loc"] for row in invalid(caught.value, SynthesizeRequest).errors} == {("tolerances", "rotation")}


@pytest.mark.parametrize("name", ["cr[nk_span", "[", "constrained-", ""])
def test_an_unknown_field_may_have_any_name(name: str) -> None:
    with pytest.raises(ValidationError) as caught:
        SynthesizeRequest(**{"rotation": [0, 1], "timing": "free", name: 1})
    assert [row["loc"] for row in invalid(caught.value, SynthesizeRequest).errors] == [(name,)]
