"""Replies that are dataclasses of the front door: described as pydantic describes its models, and written."""

from __future__ import annotations

import ast
import inspect
import sys
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from itertools import pairwise
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints, is_typeddict

import numpy as np
from pydantic import BaseModel, Field, create_model
from pydantic_core import to_json

from app.query import ReplyModel
from linkage_atlas.records import names_of, plain

_NAMES = {
    "AtlasType": "TypeReply",
    "ConstraintRow": "ConstraintRow",
    "FunctionReport": "FunctionReport",
    "FunctionResult": "FunctionReply",
    "MatchReport": "MatchesReport",
    "OptimumMotion": "OptimumMotion",
    "Report": "SynthesizeReport",
    "Result": "SynthesizeReply",
}
"""What the description calls a dataclass of a reply where that is not its name with Reply behind it."""


@cache
def reply_model(kind: Any) -> type[BaseModel]:
    """The model of a reply that is a dataclass or a named tuple, see `linkage_atlas.records`: it describes and checks it."""
    if issubclass(kind, BaseModel):
        return kind
    hints, sentences = get_type_hints(kind, include_extras=True), _sentences(kind)
    defaults = {field.name: field.default for field in fields(kind)} if is_dataclass(kind) else {}
    described: dict[str, Any] = {
        name: (
            _in_json(hints[name]),
            Field(... if defaults.get(name, MISSING) is MISSING else defaults[name], description=sentences.get(name)),
        )
        for name in names_of(kind) or hints
    }
    name = _NAMES.get(kind.__name__, f"{kind.__name__}Reply")
    return create_model(name, __base__=ReplyModel, __doc__=(kind.__doc__ or "").partition("\n")[0], **described)


def _in_json(annotation: Any) -> Any:
    """The type that a field has in a reply."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _in_json(inner[1])
    if origin is np.ndarray:
        return list[float]
    if origin in (Union, UnionType):
        return Union[tuple(map(_in_json, inner))]  # noqa: UP007
    if origin is not None and origin is not Literal:
        return origin[tuple(map(_in_json, inner))]
    return reply_model(annotation) if names_of(annotation) or is_typeddict(annotation) else annotation


def _sentences(kind: type) -> dict[str, str]:
    """What the strings below the fields of a class, and of those that it comes from, say of them."""
    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        body = _classes(one.__module__).get(one.__name__, [])
        for stated, below in pairwise(body):
            if isinstance(stated, ast.AnnAssign) and isinstance(below, ast.Expr):
                found[ast.unparse(stated.target)] = " ".join(ast.literal_eval(below.value).split())
    return found


@cache
def _classes(module: str) -> dict[str, list[ast.stmt]]:
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError):
        return {}
    return {one.name: one.body for one in tree.body if isinstance(one, ast.ClassDef)}


def plain_of(reply: Any) -> Any:
    return reply.model_dump() if isinstance(reply, BaseModel) else plain(reply)


def json_of(reply: Any, indent: int | None = None) -> bytes:
    return to_json(plain_of(reply), indent=indent, inf_nan_mode="strings")
