"""Requests from files (a request, a saved solution, a reply or a table of samples) and from options that set fields."""

from __future__ import annotations

import json
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pydantic_core
from pydantic import ValidationError

from app.query import Invalid, Query, RequestModel, invalid
from app.sentences import SAMPLED
from linkage_atlas import FieldError
from linkage_atlas.cells import decoded
from linkage_atlas.heads import FUNCTIONS, KINDS, POSES, Kind
from linkage_atlas.notes import counted
from linkage_atlas.tables import Table, read_table

Setting = tuple[list[str], Any]
"""Path of a field and its value."""
LINKAGE = "linkage"
"""Field that holds a solution of a reply; `start_from` is a list of such solutions."""
SAVED = frozenset(("request", LINKAGE, "length_unit"))
"""Fields of a file with a linkage and the request that it answers."""
REPLY, BARE, SAVED_REQUEST = "a reply", "a linkage", "a saved request"
"""Contents of files, in words."""


class Target(NamedTuple):
    """A query for which a file is read."""

    command: str
    model: type[RequestModel]

    @classmethod
    def of(cls, query: Query) -> Target:
        """Return the target of a query."""
        return cls(query.command, query.request)

    @property
    def motion(self) -> type[RequestModel] | None:
        """Model of the motion that the request contains; None if the request has no such field."""
        if "request" not in self.model.model_fields:
            return None
        from app.fourbar.models import SynthesizeRequest

        return SynthesizeRequest

    @property
    def linkage(self) -> str | None:
        """Name of the field with the linkage."""
        return LINKAGE if LINKAGE in self.model.model_fields else None

    @property
    def table(self) -> Kind | None:
        """Kind of table that the query reads."""
        return POSES if "request" in self.model.model_fields or self.command == "motion" else KINDS.get(self.command)

    def full_path(self, path: Sequence[str]) -> list[str]:
        """Return the path of a field in the request; ``request`` in front of a field of the motion is optional."""
        if path[0] == "request" and len(path) > 1 and "request" not in self.model.model_fields:
            return list(path[1:])
        is_motions = self.motion and path[0] not in self.model.model_fields and path[0] in self.motion.model_fields
        return ["request", *path] if is_motions else list(path)


@dataclass(frozen=True)
class Source:
    """A request from a file."""

    request: Any
    table: Table | None = None
    length_unit: str | None = None
    """Unit of the lengths: of the option, the table or the saved file."""


def read_source(
    target: Target,
    text: bytes,
    settings: Sequence[Setting] = (),
    *,
    say: Callable[[str], None] = lambda note: None,
    unwrap: bool = False,
    columns: Mapping[str, str] | None = None,
    rank: int = 1,
    length_unit: str | None = None,
) -> Source:
    """Read the request in a file, and set fields in it given as pairs of path and value.

    ``say`` is called with a description of the file, unless the file is a request for this query. ``unwrap`` shifts each angle of
    a table to within half a turn of the previous angle, and ``columns`` are headings of its columns. ``rank`` selects a solution
    of a reply. ``length_unit`` is the unit of lengths of the request; by default it is that of the table. Raise `FieldError` if
    the file is not a valid request.
    """
    settings = [(target.full_path(path), value) for path, value in settings]
    # Windows PowerShell writes UTF-16
    text = text.decode("utf-16", "replace").encode() if text[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else text
    text = text.removeprefix(BOM_UTF8)
    table = None
    if not text.strip():
        if not settings:
            raise FieldError("", "is empty; name a file or an --example, or write the request to standard input")
        body: dict[str, Any] = {}
    elif _is_json(target, text):
        if unwrap or columns:
            raise FieldError(
                "", f"{'--unwrap' if unwrap else '--columns'} applies to a table of samples, but this file is JSON"
            )
        content = parsed(text)
        body, note = _body_of(target, content, rank)
        if length_unit is None and "request" in content:
            length_unit = content.get("length_unit")
        if note:
            say(note)
    elif target.command == "motion":
        body = {"table": decoded(text), "unwrap": unwrap, "columns": None if columns is None else dict(columns)}
    elif target.table is None:
        raise FieldError("", f"this is not JSON, and `linkage-atlas {target.command}` does not read tables")
    else:
        beside = with_settings({}, settings)
        beside = beside.get("request", {}) if target.motion else beside
        table = read_table(decoded(text), target.table, beside, unwrap, columns)
        if None not in (table.length_unit, length_unit) and table.length_unit != length_unit:
            raise FieldError(
                "/length_unit",
                f"the headings of the table have the unit {table.length_unit}, but --length-unit is {length_unit}",
            )
        length_unit = length_unit or table.length_unit
        body = {"request": table.fields} if target.motion else table.fields
    if length_unit is not None and "length_unit" in target.model.model_fields:
        settings = [(["length_unit"], length_unit), *settings]
    return Source(_validated(target, with_settings(body, settings), table is not None), table, length_unit)


def parsed(text: bytes) -> Any:
    """Parse JSON."""
    try:
        return pydantic_core.from_json(text)
    except ValueError as error:
        raise FieldError("", f"this is not valid JSON: {error}") from None


def _is_json(target: Target, text: bytes) -> bool:
    """Check if a text is JSON and not a table, which may begin with a name in quotes."""
    return text.lstrip()[:1] in (b"{", b"[", b'"' if target.table is None else b"{")


def _validated(target: Target, body: Any, of_table: bool) -> Any:
    try:
        return target.model.model_validate(body)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        if of_table and first["type"] == "too_short" and first["loc"][-1] in (*SAMPLED, "table"):
            rows, minimum = (first["ctx"][name] for name in ("actual_length", "min_length"))
            raise FieldError(
                "", f"the table has {counted(rows, 'row')}, but at least {minimum} are required"
            ) from None
        rows = invalid(error, target.model, quoting=True).errors
    if any(row["type"] == "extra_forbidden" and len(row["loc"]) == 1 for row in rows):
        _check_question(target, body)
    if target.motion:  # the spelling of `--set`
        rows = [
            row | {"loc": row["loc"][row["loc"][0:1] == ("request",) :], "msg": row["msg"].replace("request.", "")}
            for row in rows
        ]
    raise Invalid(rows)


def _check_question(target: Target, body: Mapping[str, Any]) -> None:
    """Raise an error that names the command if a body is a request for another command."""
    from app.registry import all_queries

    for query in all_queries():
        if len(body) > 1 and body.keys() <= query.request.model_fields.keys():
            raise FieldError("", f"this is a request for `linkage-atlas {query.command}`, not for `{target.command}`")


# -- contents of files --------------------------------------------------------------------------------------------------


def _body_of(target: Target, content: Any, rank: int) -> tuple[dict[str, Any], str]:
    """Return the request in the content of a file, and a description of the file."""
    if not isinstance(content, dict):
        raise FieldError("", "this is JSON, but not an object with the fields of a request")
    content = _with_reply(content)
    what, inner = _kind_of(content), content.get("request")
    if target.motion is None:
        if not isinstance(inner, dict):
            if what in (REPLY, BARE):
                raise FieldError("", f"this is {what} without its request; name the file of the request")
            return _without_foreign(target, content)
        while isinstance(inner.get("request"), dict):
            inner = inner["request"]
        body, dropped = _without_foreign(target, inner)
        return body, f"{what}, whose request is used" + dropped.replace("a request ", ", ")
    if what == BARE:
        return {LINKAGE: content}, what
    if what != REPLY:
        if inner is None and content.keys() & {"rotation", "position"}:
            return {"request": content}, "a request, which is solved"
        body = {
            key: value for key, value in content.items() if key != "length_unit" or key in target.model.model_fields
        }
        return body, "" if what == SAVED_REQUEST else what
    body = {}
    if isinstance(inner, dict):
        nested = inner.keys() & {"request", LINKAGE}
        body = _body_of(target, inner, rank)[0] if nested else inner | {"request": inner}
        kept = ("request", LINKAGE, "load") if target.command == "drive" else ("request", LINKAGE)
        body = {name: value for name, value in body.items() if name in kept and value is not None}
    if content.get("solutions"):
        body[LINKAGE] = _ranked(content["solutions"], rank)
        what += f", of which solution {rank} is used"
    if "request" not in body and target.command == "export":
        raise FieldError(
            "", "this reply does not contain its request; give the request as file and the reply with --linkage"
        )
    return body, what


def _with_reply(content: dict[str, Any]) -> dict[str, Any]:
    """Return the reply, with its request, from a line of a study or from a file of the page of a scene."""
    reply = content.get("reply")
    return {**reply, **{name: content[name] for name in ("request",) if name in content}} if reply else content


def _kind_of(content: Mapping[str, Any]) -> str:
    """Return what a file contains."""
    if "report" in content or any(
        isinstance(content.get(name), list) for name in ("solutions", "matches", "refused")
    ):
        return REPLY
    if "branch" in content and content.keys() & {"links", "guides"}:
        return BARE
    return "a linkage and its request" if LINKAGE in content and content.keys() <= SAVED else SAVED_REQUEST


def _without_foreign(target: Target, body: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """Remove fields that belong only to the alternative query about motions, and list them."""
    from app.fourbar.models import MatchRequest, SynthesizeRequest

    alternatives = {"match": SynthesizeRequest, "synthesize": MatchRequest}
    if target.command not in alternatives:
        return body, ""
    known = alternatives[target.command].model_fields.keys() - target.model.model_fields.keys()
    foreign = [name for name in body if name in known]
    used = {name: value for name, value in body.items() if name not in foreign}
    if not foreign or not used.keys() & {"rotation", "position"}:
        return body, ""
    return used, f"a request without {', '.join(foreign)}, which `{target.command}` does not use"


def _ranked(solutions: Sequence[Any], rank: int) -> Any:
    if len(solutions) < rank:
        raise FieldError("", f"the reply has {counted(len(solutions), 'solution')}, but no solution of rank {rank}")
    return solutions[rank - 1]


def solution_of(content: Any, rank: int = 1) -> Any:
    """Return the linkage in the content of a file: a bare linkage, a saved solution, or a solution of a reply."""
    if not isinstance(content, dict):
        return content
    content = _with_reply(content)
    if isinstance(content.get("solutions"), list):
        return _ranked(content["solutions"], rank)
    nested = content.get(LINKAGE)
    return content if nested is None else nested


# -- fields -----------------------------------------------------------------------------------------------------------


def setting(text: str) -> Setting:
    """Read ``FIELD=VALUE``: the value is JSON, a word, words in brackets, or the content of a file: ``@FILE``."""
    path, equals, value = text.partition("=")
    if not equals or not all(path.split(".")):
        raise FieldError("", f"must be FIELD=VALUE, as in top=3, found {text!r}")
    return path.split("."), file_value(path, Path(value[1:])) if value.startswith("@") else _value(value)


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        words = re.fullmatch(r"\[([\w\s,.-]+)\]", text)
        return [_value(word.strip()) for word in words[1].split(",")] if words else text


def file_value(path: str, file: Path, rank: int = 1) -> Any:
    """Return the value of a field from a file: JSON, a linkage, the field's column of a table, or the text itself."""
    field = path.rpartition(".")[2]
    try:
        text = file.read_bytes().removeprefix(BOM_UTF8)
        if text.lstrip()[:1] in (b"{", b"["):
            content = parsed(text)
            if field == "start_from":
                return content if isinstance(content, list) else [solution_of(content, rank)]
            return solution_of(content, rank) if field == LINKAGE else content
        if field in SAMPLED:
            kind = FUNCTIONS if field in ("input", "output") else POSES
            return read_table(decoded(text), kind).fields[field]
        return decoded(text)
    except OSError as error:
        raise FieldError(f"/{field}", f"{file}: {error.strerror}") from None
    except KeyError:
        raise FieldError(f"/{field}", f"{file}: the table has no column for {field}") from None
    except FieldError as error:
        raise FieldError(f"/{field}", f"{file}: {error.message}") from None


def with_settings(body: Any, settings: Sequence[Setting]) -> dict[str, Any]:
    """Return a body with fields set; objects are merged, and items of lists count from 1."""
    if not isinstance(body, dict):
        raise FieldError("", "must be an object with the fields of a request")
    for path, value in settings:
        merged: Any = value
        for name in reversed(path):
            merged = {name: merged}
        body = _merged(body, merged, "")
    return body


def _merged(old: Any, new: Any, path: str) -> Any:
    if not isinstance(new, dict):
        return new
    if isinstance(old, list) or (old is None and all(name.isdecimal() for name in new)):
        items = list(old or [])
        for name, value in new.items():
            index = int(name) - 1 if name.isdecimal() else -1
            if not 0 <= index <= len(items):
                raise FieldError(path, f"is a list; its items are numbered 1 to {len(items) + 1}, found '{name}'")
            items[index : index + 1] = [
                _merged(items[index] if index < len(items) else None, value, f"{path}/{index}")
            ]
        return items
    old = old if isinstance(old, dict) else {}
    return {**old, **{name: _merged(old.get(name), value, f"{path}/{name}") for name, value in new.items()}}
