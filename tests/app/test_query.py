"""Models of requests and replies are built at their first use, or all together.

A start that builds every model, or a model without its fields, would show here.
"""

from app.query import ReplyModel, RequestModel, build_models
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
