"""Types of the fields of requests about linkages: numbers, points, boxes, lists of samples, and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, WithJsonSchema, create_model

from app.query import Count, Number, PositiveNumber, RequestModel
from linkage_atlas.arguments import LARGEST
from linkage_atlas.functions.dials import MIN_PAIRS
from linkage_atlas.geometry import KindName
from linkage_atlas.mechanism_types import MECHANISMS
from linkage_atlas.motions import MAX_LENGTH, MAX_SAMPLES, MIN_LENGTH, MIN_POSES, MIN_SAMPLES

MAX_TOP = 1000


Curve = Annotated[list[Number], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES)]


Coordinate = Annotated[Number, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]


Length = Annotated[Number, Field(ge=MIN_LENGTH, le=MAX_LENGTH)]


Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]


Box = Annotated[list[Coordinate], Field(min_length=4, max_length=4)]


MAX_KEEP_OUT = 20


Pairs = Annotated[list[Number], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)]


SampledCurve = Annotated[list[Number | None], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


SampledPath = Annotated[list[Point | None], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Weights = Annotated[list[Annotated[Number, Field(ge=0)]], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Tolerances = Annotated[list[PositiveNumber], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Travel = Annotated[list[Coordinate], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Mechanisms = Annotated[
    list[KindName],
    Field(min_length=1, max_length=8),
    BeforeValidator(
        lambda prescribed: (
            list(MECHANISMS) if prescribed == "all" else [prescribed] if isinstance(prescribed, str) else prescribed
        )
    ),
    WithJsonSchema(
        {
            "anyOf": [
                {"const": "all", "type": "string"},
                {
                    "items": {"enum": list(get_args(KindName)), "type": "string"},
                    "maxItems": 8,
                    "minItems": 1,
                    "type": "array",
                },
            ]
        }
    ),
]


Top = Annotated[Count, Field(ge=1, le=MAX_TOP)]


Tolerance = Annotated[Number, Field(ge=0, le=1)]


FarLength = Annotated[Number, Field(ge=1e-100, le=1e100)]


FarCoordinate = Annotated[Number, Field(ge=-1e100, le=1e100)]


FarPoint = Annotated[list[FarCoordinate], Field(min_length=2, max_length=2)]


Angle = Annotated[Number, Field(ge=-1e9, le=1e9)]


Size = Annotated[Number, Field(ge=0, le=MAX_LENGTH)]


Bounded = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]


Pair = Annotated[list[Bounded], Field(min_length=2, max_length=2)]


Above = Annotated[Number, Field(gt=0, le=MAX_LENGTH)]


Words = Annotated[str, Field(max_length=100_000)]


LinkName = Annotated[str, Field(max_length=40)]


LinkNames = Annotated[list[LinkName], Field(min_length=1, max_length=4)]


class LinksRequest(RequestModel):
    """Prescribed lengths of links."""

    crank: Length | None = None
    coupler: Length | None = None
    rocker: Length | None = None
    ground: Length | None = None
    """Length of the ground; required for a function generator if another length is prescribed."""


_FORMS: dict[str, Any] = {
    "family": Literal["full_crank", "crank_rocker", "double_crank", "any"] | None,
    "angle": Number | None,
    "length": Length | None,
    "ratio": PositiveNumber | None,
    "links": LinksRequest | None,
    "point": Point | None,
    "box": Box | None,
    "boxes": Annotated[list[Box], Field(max_length=MAX_KEEP_OUT)] | None,
}
"""Type of the field for each kind of limit, see `synthesis.limits.Form`."""


def limits_request(name: str, doc: str, forms: Mapping[str, Any], preset: str, **more: Any) -> Any:
    """Return the model of a set of limits, with a field for each limit, the field ``preset`` and more fields."""
    fields: dict[str, Any] = {
        limit: (_FORMS[form.kind], Field(None, description=form.says)) for limit, form in forms.items()
    }
    fields["preset"] = (Literal["practical", "none"] | None, Field(None, description=preset))
    return create_model(name, __base__=RequestModel, __module__=__name__, __doc__=doc, **fields, **more)
