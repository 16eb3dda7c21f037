"""Models of requests and replies: built when they are first used, or all at once."""

from __future__ import annotations

from app.query import ReplyModel, RequestModel, build_models
from app.registry import all_queries


class _Inner(ReplyModel):
    value: int


class _Outer(_Inner):
    inner: _Inner


def test_a_model_is_built_when_it_is_first_used_or_with_all_others() -> None:
    assert not _Inner.__pydantic_complete__ and not _Outer.__pydantic_complete__
    assert _Inner(value=1).value == 1
    assert _Inner.__pydantic_complete__ and not _Outer.__pydantic_complete__
    build_models()
    assert _Outer.__pydantic_complete__
    assert all(model.__pydantic_complete__ for query in all_queries() for model in (query.request, query.reply))
    assert all(model.__pydantic_complete__ for base in (RequestModel, ReplyModel) for model in base.__subclasses__())
