"""Queries to the service: base models of requests and replies, and the class from which routes and commands are made.

A reply may be a dataclass of `linkage_atlas`; it is then described like a pydantic model.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache, cached_property
from importlib.resources import files
from pkgutil import resolve_name
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    Protocol,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np
from pydantic import AllowInfNan, BaseModel, ConfigDict, Field, SkipValidation, Strict, ValidationError, create_model
from pydantic_core import to_json

from app.sentences import sentence
from linkage_atlas import FieldError
from linkage_atlas.formats import FORMATS, Format
from linkage_atlas.records import field_sentences, names_of, parameter_sentences, plain

if TYPE_CHECKING:
    from linkage_atlas import Atlas, Work

Base = TypeVar("Base", bound=BaseModel)
MAX_ERRORS = 20
"""Largest number of errors that are reported for a request."""
Number = Annotated[float, Strict(), AllowInfNan(False)]
"""Finite JSON number; strings, booleans, NaN and infinity are refused."""
PositiveNumber = Annotated[Number, Field(gt=0)]
Count = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Computed = SkipValidation
"""Long list that the service has computed; its items are not validated, which would take too long."""


Column = Computed[list[float]]
PointColumn = Computed[list[tuple[float, float]]]
AngleUnit = Literal["deg", "rad"]
LengthUnit = Literal["um", "mm", "cm", "m", "in", "ft"]


@dataclass(frozen=True)
class Angles:
    """Angle unit of a request, with conversions to and from radians."""

    unit: AngleUnit
    decimals: int | None = None
    """Decimals to which degrees are rounded if the rounded value is the same angle in radians; default: no rounding."""

    @property
    def radian(self) -> float:
        """Size of the unit in radians."""
        return math.pi / 180 if self.unit == "deg" else 1.0

    def inward(self, angle: float) -> float:
        """Convert an angle of a request to radians."""
        return math.radians(angle) if self.unit == "deg" else angle

    def outward(self, angle: float) -> float:
        """Convert an angle in radians to the unit of the request."""
        if self.unit == "rad":
            return float(angle)
        degrees = math.degrees(angle)
        short = degrees if self.decimals is None else round(degrees, self.decimals)
        return short if math.radians(short) == angle else degrees


_JSON_WORD = {"``": "`", "None": "null", "True": "true", "False": "false"}
_JSON_WORDS = re.compile(r"``|\b(?:None|True|False)\b")


class RequestModel(BaseModel):
    """Base of all requests; an unknown field is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
    described_by: ClassVar[Sequence[str]] = ()
    """Names in `linkage_atlas` whose parameters describe the fields that have no sentence of their own."""

    @classmethod
    def descriptions(cls) -> dict[str, str]:
        """Return the descriptions of the fields by name."""
        found = field_sentences(cls)
        for name in cls.described_by:
            source = resolve_name(f"linkage_atlas.{name}")
            found = (field_sentences if is_dataclass(source) else parameter_sentences)(source) | found
        found = {name: _JSON_WORDS.sub(lambda word: _JSON_WORD[word[0]], text) for name, text in found.items()}
        texts = {name: info.description or found.get(name) for name, info in cls.model_fields.items()}
        return {name: text for name, text in texts.items() if text}

    def arguments(self, *names: str, exclude: Sequence[str] = ()) -> dict[str, Any]:
        """Return the named fields, or all fields except ``exclude``, as arguments for a function of `linkage_atlas`."""
        names = names or tuple(name for name in type(self).model_fields if name not in exclude)
        return {name: _plain_value(getattr(self, name)) for name in names}


def _plain_value(value: Any) -> Any:
    if isinstance(value, list) and value and isinstance(value[0], BaseModel):
        return [_plain_value(item) for item in value]
    return value.model_dump(exclude_none=True) if isinstance(value, BaseModel) else value


def in_unit(request: Any, length_unit: str | None) -> Any:
    """Set the length unit of the analysis of a request; raise `FieldError` if the analysis has a different unit."""
    if length_unit is None or getattr(request, "analysis", None) is None:
        return request
    if "length_unit" in request.analysis.model_fields_set and request.analysis.length_unit != length_unit:
        message = (
            f"is {request.analysis.length_unit}, but the command has the length unit {length_unit}; use the same unit"
        )
        raise FieldError("/analysis/length_unit", message)
    return request.model_copy(update={"analysis": request.analysis.model_copy(update={"length_unit": length_unit})})


class Invalid(FieldError):
    """Error of a request that violates its model, with a row for each fault: ``loc``, the path of the field, and ``msg``."""

    def __init__(self, errors: Sequence[Any]) -> None:
        super().__init__("".join(f"/{part}" for part in errors[0]["loc"]), errors[0]["msg"])
        self.errors = errors

    def __str__(self) -> str:
        return "\n".join(str(FieldError("/".join(map(str, row["loc"])), row["msg"])) for row in self.errors)


def invalid(error: ValidationError, model: type[BaseModel], quoting: bool = False) -> Invalid:
    """Return the first errors of a request as sentences; the sentence on an unknown field names similar fields.

    Parameters
    ----------
    error : ValidationError
        Errors of pydantic.
    model : type
        Model of the request.
    quoting : bool
        Quote the value of the field, see `app.sentences.sentence`.
    """
    rows = []
    for row in _of_fields(error.errors(include_url=False))[:MAX_ERRORS]:
        if row["type"] == "extra_forbidden":
            *path, name = row["loc"]
            message = FieldError.no_such(
                "", str(name), _fields_at(model, path), elsewhere=_field_paths(model)
            ).message
        else:
            message = sentence(row, quoting)
        rows.append({"loc": row["loc"], "type": row["type"], "msg": message})
    return Invalid(rows)


def _of_fields(rows: list[Any]) -> list[Any]:
    """Return the errors with paths that contain only fields.

    Pydantic reports an error for each branch of a union, and the branch is a component of its path.
    """

    def is_branch(part: str | int) -> bool:
        return isinstance(part, str) and ("[" in part or part.startswith("constrained-"))

    def split(row: Any) -> tuple[Any, Any]:
        """Split a path into the path of a known field and the name of an unknown field, which may look like a branch."""
        end = len(row["loc"]) - (row["type"] == "extra_forbidden")
        return row["loc"][:end], row["loc"][end:]

    cleaned, unions = [], set()
    for row in rows:
        path, unknown = split(row)
        unions |= {path[:k] for k, part in enumerate(path) if is_branch(part)}
        cleaned.append(row | {"loc": (*(part for part in path if not is_branch(part)), *unknown)})
    # an error inside the intended branch is more specific than the error that no branch matches
    explained = {
        union
        for union in unions
        for row in cleaned
        if len(row["loc"]) > len(union) and row["loc"][: len(union)] == union
    }
    return [row for row in cleaned if row["loc"] not in explained]


def _fields_at(model: type[BaseModel], path: Iterable[str | int]) -> list[str]:
    """Return the names of the fields of the object at a path of a request."""
    models = [model]
    for part in path:  # an integer is an index of a list and does not change the model
        if isinstance(part, str):
            fields_here = [parent.model_fields[part] for parent in models if part in parent.model_fields]
            models = [child for info in fields_here for child in models_in(info.annotation)]
    return [name for parent in models for name in parent.model_fields]


def _field_paths(model: type[BaseModel], prefix: str = "") -> dict[str, str]:
    """Return the shortest path to each field of a request and of the objects within it, by the name of the field."""
    paths = {name: prefix + name for name in model.model_fields}
    for name, info in model.model_fields.items():
        for child in models_in(info.annotation):
            paths = _field_paths(child, f"{prefix}{name}.") | paths
    return paths


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the models in the type of a field."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in models_in(part)]


class ReplyModel(BaseModel):
    """Base of replies that are pydantic models, or are described by them. No number is NaN or infinite."""

    model_config = ConfigDict(ser_json_inf_nan="strings", frozen=True, defer_build=True, from_attributes=True)


def derived_from(base: type[Base]) -> Iterator[type[Base]]:
    """Yield a model and all models that derive from it."""
    yield base
    for model in base.__subclasses__():
        yield from derived_from(model)


def build_models() -> None:
    """Build the validators of all requests and replies; otherwise each is built at its first use, as for a command."""
    for model in (*derived_from(RequestModel), *derived_from(ReplyModel)):
        model.model_rebuild()


class Resources(Protocol):
    """Resources of the service that an answer may use."""

    max_budget_ms: float

    @property
    def atlas(self) -> Atlas:
        """The atlas, which is loaded at the first access."""

    def work(self, budget: float | None = None) -> Work:
        """Start the clock of an answer, with a budget in seconds; the work also ends if the client disconnects."""


FILES = {**FORMATS, "json": Format("application/json", ("json",))}
"""File formats by name."""


@cache
def bundled_requests() -> dict[str, Any]:
    """Return the bundled example requests: by command, then by name."""
    return json.loads(files(__package__).joinpath("examples/requests.json").read_text())


@dataclass(frozen=True)
class Files:
    """Export of a solution of a reply: a route, and the option ``--export`` of the command."""

    path: str
    """Path of the route."""
    name: str
    """Name of the operation."""
    stem: str
    """Name of the files without suffix."""
    summary: str
    request: type[RequestModel]
    """Model with the fields ``request``, ``linkage``, ``format`` (a key of `FILES`) and ``length_unit``."""
    render: Callable[[Any, Resources], bytes]
    """``render(request, resources)``: the content of the file."""
    example: Mapping[str, Any]
    """Request body without the field ``format``."""
    is_long: Callable[[Any], bool] = lambda _: False
    """See `Query.is_long`."""

    @property
    def formats(self) -> tuple[str, ...]:
        """Names of the formats that the route accepts."""
        return get_args(self.request.model_fields["format"].annotation)


@dataclass(frozen=True)
class Query:
    """Query to the service; its route, which accepts POST, and its command are made from it."""

    command: str
    """Command without the leading ``linkage-atlas``, for example ``lift motion``; its route is then ``/v2/lift/motion``."""
    summary: str
    """Line of help."""
    answer: Callable[[Any, Resources], Any]
    """``answer(request, resources) -> reply``. Its annotations are the types of request and reply. It raises
    `linkage_atlas.FieldError` if the request has no answer."""
    table: Callable[..., str]
    """``table(reply)``, or ``table(reply, units)`` if ``shows_units``: the reply as text for a terminal."""
    exports: Mapping[str, Callable[[Any, Resources], bytes]] = field(default_factory=dict)
    """``render(request, resources)`` by suffix (a key of `FILES`): the reply as a file. Over HTTP, the same body is posted
    to ``path.suffix``."""
    is_long: Callable[[Any], bool] = lambda _: False
    """``is_long(request)``: True if the answer may take long. Over HTTP, short requests do not wait for long requests."""
    files: Files | None = None
    """Files of a solution of the reply, in place of ``exports``."""
    shows_units: bool = True
    """Pass the units of angle and length to ``table``."""
    reads_atlas: bool = False
    """True if the answer may require an atlas."""
    route: str | None = None
    """Route, if it does not follow from the command."""

    @property
    def path(self) -> str:
        """Path of the route."""
        return self.route or "/v2/" + self.command.replace(" ", "/")

    @property
    def examples(self) -> dict[str, Any]:
        """Request bodies by name, which the service must be able to answer."""
        return bundled_requests()[self.command]

    @cached_property
    def request(self) -> type[RequestModel]:
        """Model of the request."""
        return next(iter(get_type_hints(self.answer).values()))

    @cached_property
    def reply(self) -> Any:
        """Model or dataclass of the reply."""
        return get_type_hints(self.answer)["return"]

    @property
    def formats(self) -> tuple[str, ...]:
        """Formats of the files that the command writes, json last."""
        kinds = self.exports if self.files is None else self.files.formats
        return (*(kind for kind in kinds if kind != "json"), "json")


_NAMES = {
    "AtlasType": "TypeReply",
    "ConstraintRow": "ConstraintRow",
    "FunctionResult": "FunctionReply",
    "MatchReport": "MatchesReport",
    "OptimumMotion": "OptimumMotion",
    "Report": "SynthesizeReport",
    "Result": "SynthesizeReply",
}
"""Schema names of dataclasses; all others have the name of the class followed by Reply."""


@cache
def reply_model(kind: Any) -> type[BaseModel]:
    """Return the model that describes and validates a reply; the reply may be a dataclass or a named tuple."""
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
    """Return the type of a field in a JSON reply."""
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
    """Return a reply as plain Python values."""
    return reply.model_dump() if isinstance(reply, BaseModel) else plain(reply)


def json_of(reply: Any, indent: int | None = None) -> bytes:
    """Return a reply as JSON."""
    return to_json(plain_of(reply), indent=indent, inf_nan_mode="strings")
