"""Questions to the service: their requests and replies as models, and the value that route and command are both made from.

Replies that are dataclasses of the front door are described as pydantic describes its models.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from importlib.resources import files
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Protocol,
    Self,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np
from pydantic import (
    AllowInfNan,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    SkipValidation,
    Strict,
    ValidationError,
    create_model,
)
from pydantic_core import to_json

from app.sentences import sentence
from linkage_atlas import FieldError
from linkage_atlas.formats import FORMATS, Format
from linkage_atlas.records import field_sentences, names_of, plain

if TYPE_CHECKING:
    from linkage_atlas import Atlas, Work

MAX_ERRORS = 20
"""Errors that are told of one request; a request of a thousand wrong numbers needs no thousand lines."""
Number = Annotated[float, Strict(), AllowInfNan(False)]
"""A finite JSON number; no strings, no booleans, no NaN or infinity."""
PositiveNumber = Annotated[Number, Field(gt=0)]
Count = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Computed = SkipValidation
"""Long lists that the service has computed itself: checking each number again would hold up everyone."""


class Numbers(Sequence[Any]):
    """A long list in a reply, of numbers or of points, kept as the array that it comes from: a list takes four times as much.

    Law: a slice of it is a list of Python's numbers, and all of it equals ``array.tolist()``.
    """

    def __init__(self, array: Any) -> None:
        self._array = array

    def __len__(self) -> int:
        return len(self._array)

    def __getitem__(self, at: Any) -> Any:
        return self._array[at].tolist()


def _listed(values: Sequence[Any]) -> Any:
    return values[:]


def _paired(values: Sequence[Any]) -> Any:
    return [tuple(point) for point in values[:]]


Column = Annotated[SkipValidation[list[float]], PlainSerializer(_listed, return_type=list[float])]
Places = Annotated[
    SkipValidation[list[tuple[float, float]]], PlainSerializer(_paired, return_type=list[tuple[float, float]])
]
FiniteOrNull = Annotated[float | None, BeforeValidator(lambda x: x if x is None or math.isfinite(x) else None)]
"""A number of a result that is NaN or infinite where there is none."""
AngleUnit = Literal["deg", "rad"]
LengthUnit = Literal["um", "mm", "cm", "m", "in", "ft"]


@dataclass(frozen=True)
class Angles:
    """A request's unit of angle: to radians, which all numerics use, and back."""

    unit: AngleUnit
    decimals: int | None = None
    """Decimals of a degree that do where they are the same angle, so that 240 comes back as 240; default: all digits."""

    @property
    def radian(self) -> float:
        return math.pi / 180 if self.unit == "deg" else 1.0

    def inward(self, angle: float) -> float:
        """Radians of a request's angle."""
        return math.radians(angle) if self.unit == "deg" else angle

    def outward(self, angle: float) -> float:
        """A reply's angle from radians."""
        if self.unit == "rad":
            return float(angle)
        degrees = math.degrees(angle)
        short = degrees if self.decimals is None else round(degrees, self.decimals)
        return short if math.radians(short) == angle else degrees


class RequestModel(BaseModel):
    """Base of all requests: an unknown field is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    def given(self, *names: str, but: Sequence[str] = ()) -> dict[str, Any]:
        """Some fields, or all ``but`` some, as plain values: arguments of the front door."""
        names = names or tuple(name for name in type(self).model_fields if name not in but)
        return {name: _given(getattr(self, name)) for name in names}


def _given(value: Any) -> Any:
    if isinstance(value, list) and value and isinstance(value[0], BaseModel):
        return [_given(one) for one in value]
    return value.model_dump(exclude_none=True) if isinstance(value, BaseModel) else value


def in_unit(request: Any, length_unit: str | None) -> Any:
    """A request whose analysis, if any, has its lengths in a unit that is named; FieldError where it names another."""
    if length_unit is None or getattr(request, "analysis", None) is None:
        return request
    if "length_unit" in request.analysis.model_fields_set and request.analysis.length_unit != length_unit:
        raise FieldError("/analysis/length_unit", f"says {request.analysis.length_unit}, not {length_unit}")
    return request.model_copy(update={"analysis": request.analysis.model_copy(update={"length_unit": length_unit})})


class Invalid(FieldError):
    """A request that does not fit its model, with a row for each error: ``loc``, the path of the field, and ``msg``."""

    def __init__(self, errors: Sequence[Any]) -> None:
        super().__init__("".join(f"/{part}" for part in errors[0]["loc"]), errors[0]["msg"])
        self.errors = errors

    def __str__(self) -> str:
        return "\n".join(str(FieldError("/".join(map(str, row["loc"])), row["msg"])) for row in self.errors)


def invalid(error: ValidationError, model: type[BaseModel], quoting: bool = False) -> Invalid:
    """Return the first errors of a request as sentences; for an unknown field they name the fields close to it.

    ``quoting``: see `app.sentences.sentence`.
    """
    rows = []
    for row in _of_fields(error.errors(include_url=False))[:MAX_ERRORS]:
        if row["type"] == "extra_forbidden":
            *path, name = row["loc"]
            known, others = _fields_at(model, path), _ways(model)
            message = FieldError.no_such("", str(name), known, others=others).message
        else:
            message = sentence(row, quoting)
        rows.append({"loc": row["loc"], "type": row["type"], "msg": message})
    return Invalid(rows)


def _of_fields(rows: list[Any]) -> list[Any]:
    """Errors whose places are fields alone: pydantic names the branches of a union too, and has an error of each."""

    def is_branch(part: str | int) -> bool:
        return isinstance(part, str) and ("[" in part or part.startswith("constrained-"))

    def parted(row: Any) -> tuple[Any, Any]:
        """The way to a field, and the name of one that there is not: that is the request's own, whatever it looks like."""
        end = len(row["loc"]) - (row["type"] == "extra_forbidden")
        return row["loc"][:end], row["loc"][end:]

    found, unions = [], set()
    for row in rows:
        way, unknown = parted(row)
        unions |= {way[:k] for k, part in enumerate(way) if is_branch(part)}
        found.append(row | {"loc": (*(part for part in way if not is_branch(part)), *unknown)})
    # what is amiss within the branch that was meant says more than that it is none of the others
    within = {
        place
        for place in unions
        for row in found
        if len(row["loc"]) > len(place) and row["loc"][: len(place)] == place
    }
    return [row for row in found if row["loc"] not in within]


def _fields_at(model: type[BaseModel], path: Iterable[str | int]) -> list[str]:
    """Names of the fields of the object at some place of a request."""
    models = [model]
    for part in path:  # a number is a place in a list: of models, or of none
        if isinstance(part, str):
            models = [
                m for one in models if part in one.model_fields for m in models_in(one.model_fields[part].annotation)
            ]
    return [name for one in models for name in one.model_fields]


def _ways(model: type[BaseModel], way: str = "") -> dict[str, str]:
    """Names of all fields of an object and those within it, and the way to each; of several the shortest."""
    ways = {name: way + name for name in model.model_fields}
    for name, info in model.model_fields.items():
        for one in models_in(info.annotation):
            ways = _ways(one, f"{way}{name}.") | ways
    return ways


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the models in the type of a field."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in models_in(part)]


_NO_FIELDS: set[str] = set()
"""Shared by all: otherwise each keeps a set of its fields' names, as large as itself."""


class ReplyModel(BaseModel):
    """Base of replies that are pydantic's; no number is NaN or infinite. A result with the fields' names may stand for one."""

    model_config = ConfigDict(ser_json_inf_nan="strings", frozen=True, defer_build=True, from_attributes=True)

    @classmethod
    def computed(cls, **values: Any) -> Self:
        """A part of a reply from values of the fields' types, unchecked: ten thousands of them take half the memory."""
        return cls.model_construct(_fields_set=_NO_FIELDS, **values)


def build_models(base: type[BaseModel] | None = None) -> None:
    """Build what checks requests and replies now, of all that are loaded or of those with a base: otherwise each when first used.

    A command uses few of them, and a service is ready before all are built.
    """
    for model in base.__subclasses__() if base else (RequestModel, ReplyModel):
        model.model_rebuild()
        build_models(model)


class Resources(Protocol):
    """What an answer may ask for beyond its request."""

    max_budget_ms: float

    @property
    def atlas(self) -> Atlas:
        """The atlas; loaded when it is first asked for."""

    def describe_atlas(self) -> dict[str, Any]:
        """Describe the atlas in plain JSON values."""

    def work(self, budget: float | None = None) -> Work:
        """Begin to watch the time of an answer, with a budget in seconds, and whether its client is still there."""


FILES = {**FORMATS, "json": Format("application/json", ("json",))}
"""Formats of files by their names."""
MEDIA_TYPES = {known.endings[0]: known.media_type for known in FILES.values()}
"""Content types over HTTP by the ending of a route."""


@cache
def bundled_requests() -> dict[str, Any]:
    return json.loads(files("app").joinpath("examples/requests.json").read_text())


@dataclass(frozen=True)
class Files:
    """Any solution of a reply as a file: a route, and what the command writes with ``--export``.

    ``path``, ``name``, ``summary``: of the route, and ``stem``, the name of its files. ``request``: with fields
    ``request``, ``solution``, ``format`` (of `FILES`) and ``length_unit``. ``render``: ``render(request, resources) ->
    bytes``. ``example``: a body without its format.
    """

    path: str
    name: str
    stem: str
    summary: str
    request: type[RequestModel]
    render: Callable[[Any, Resources], bytes]
    example: Mapping[str, Any]
    is_long: Callable[[Any], bool] = lambda _: False

    @property
    def formats(self) -> tuple[str, ...]:
        return get_args(self.request.model_fields["format"].annotation)


@dataclass(frozen=True)
class Query:
    """One question to the service.

    ``path``: route, answered to POST. ``request``, ``reply``: the model of the request, and that of the reply or its
    dataclass.

    Parameters
    ----------
    command : str
        The words of the command after ``linkage-atlas``, for example ``lift motion``; its route is then ``/v1/lift/motion``.
    summary : str
        One line of help.
    answer : callable
        ``answer(request, resources) -> reply``, of the types that its annotations name; raises `linkage_atlas.FieldError` on
        input that has no answer.
    table : callable
        ``table(reply) -> str``, the reply as text for a terminal; where `shows_units`, ``table(reply, units)``.
    examples : mapping, optional
        Name to request body (plain JSON values), shown in the API's description; each must be answerable. Default: the
        bundled requests.
    exports : mapping
        Ending (``svg``, ``plates.dxf``, ..., of `MEDIA_TYPES`) to ``render(request, resources) -> bytes``, the reply as a file;
        over HTTP a POST of the same body to ``path.ending``.
    files : Files, optional
        Of a reply's solutions. Without it the exports are what the command writes.
    is_long : callable
        ``is_long(request) -> bool``: whether the answer may take more than a fraction of a second. Over HTTP long requests
        wait for one another and not the short ones for them.
    shows_units : bool
        Whether its table names the units of angle and length.
    reads_atlas : bool
        Whether it may need an atlas.
    route : str, optional
        Its route, where that is not made of the command's words.
    """

    command: str
    summary: str
    answer: Callable[[Any, Resources], Any]
    table: Callable[..., str]
    examples: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    exports: Mapping[str, Callable[[Any, Resources], bytes]] = field(default_factory=dict)
    is_long: Callable[[Any], bool] = lambda _: False
    files: Files | None = None
    shows_units: bool = True
    reads_atlas: bool = False
    route: str | None = None
    path: str = field(init=False)
    request: type[RequestModel] = field(init=False)
    reply: type = field(init=False)

    def __post_init__(self) -> None:
        request, *_, reply = get_type_hints(self.answer).values()
        path = self.route or "/v1/" + self.command.replace(" ", "/")
        derived = {"path": path, "request": request, "reply": reply}
        for name, value in (derived | {"examples": self.examples or bundled_requests()[self.command]}).items():
            object.__setattr__(self, name, value)


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
    hints, sentences = get_type_hints(kind, include_extras=True), field_sentences(kind)
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


def plain_of(reply: Any) -> Any:
    return reply.model_dump() if isinstance(reply, BaseModel) else plain(reply)


def json_of(reply: Any, indent: int | None = None) -> bytes:
    return to_json(plain_of(reply), indent=indent, inf_nan_mode="strings")
