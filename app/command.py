"""Queries and exports on the command line: replies as tables, JSON and files."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from app.query import FILES, Query, Resources, in_unit, json_of, plain_of
from app.sources import Setting, Source, Target, file_value, read_source
from app.terminal import Exit, Units, exit_of, waiting
from linkage_atlas import FieldError
from linkage_atlas.arguments import pointing
from linkage_atlas.formats import kind_of
from linkage_atlas.notes import counted, sentences


def text_of(options: argparse.Namespace) -> bytes:
    """Return the content of the file, the example or standard input."""
    if options.example and options.file != "-":
        raise FieldError("", "give either a file or --example, but not both")
    if options.example:
        return json.dumps(options.examples[options.example]).encode()
    if options.file == "-":
        if sys.stdin.isatty():
            print("Reading the request from this terminal; end it with Ctrl-D.", file=sys.stderr)
        return sys.stdin.buffer.read()
    text = Path(options.file).read_bytes()
    if not text.strip():
        raise FieldError("", "the file is empty; it must contain a request (JSON) or a table of samples")
    return text


def _read(target: Target, options: argparse.Namespace, more: Sequence[Setting] = ()) -> Source:
    """Read the request that the options name, and print a description of the file."""
    name = options.example or ("standard input" if options.file == "-" else options.file)
    if options.linkage is not None:
        field = target.linkage or "start_from"
        rank = (options.rank or 1) if target.linkage else 1
        more = [*more, ([field], file_value(field, options.linkage, rank))]
    try:
        return read_source(
            target,
            text_of(options),
            [*more, *options.set],
            say=lambda note: None if options.example else print(f"read {name}: {note}", file=sys.stderr),
            unwrap=options.unwrap,
            columns=options.columns,
            rank=options.rank or 1,
            length_unit=options.length_unit,
        )
    except FieldError as error:
        if not error.field and type(error) is FieldError:
            error.args = (f"{name}: {error.message}",)
        raise


def _resources(options: argparse.Namespace) -> Resources:
    """Return the resources of an answer, with the atlas that the options name."""
    from app.resources import ServiceResources
    from app.settings import atlas_of, settings_of

    return ServiceResources(settings_of(options), atlas_of)


def run_question(options: argparse.Namespace, query: Query) -> int:
    """Answer a query, print the reply and write its files."""
    target, rank = Target.of(query), options.rank or 1
    formats = {path: format_of(query, path) for path in options.export}
    source = _read(target, options)
    request, table = source.request, source.table
    length_unit = source.length_unit
    request = in_unit(request, length_unit)
    if rank > getattr(request, "top", rank):
        request = request.model_copy(update={"top": rank})
    resources = _resources(options)
    with waiting("searching" if query.files else "computing", resources.max_budget_ms / 1000):
        with pointing(lambda field: field.removeprefix("/request") if target.motion else field):
            reply = query.answer(request, resources)
    code, count = exit_of(request, reply), len(getattr(reply, "solutions", [None] * rank))
    if table is not None:
        notes = getattr(getattr(reply, "report", None), "notes", None)
        if isinstance(notes, list):
            notes[:0] = sentences([table.note])
        else:
            print(*sentences([table.note]), file=sys.stderr)
    if count < rank and (formats or options.plot or rank > 1):
        verb = "is" if count == 1 else "are"
        print(f"There is no solution of rank {rank}; there {verb} {counted(count, 'solution')}.", file=sys.stderr)
        code = code or Exit.USAGE
    else:
        files = {
            path: _file(query, request, reply, rank, kind, length_unit, resources) for path, kind in formats.items()
        }
        code = write(files) or code
        if options.plot:
            _show(_file(query, request, reply, rank, "svg", length_unit, resources))
    if options.json:
        # a file with the reply and its request can be exported later
        saved = {"request": request.model_dump(mode="json", exclude_unset=True)} if query.files else {}
        saved |= {"length_unit": length_unit} if saved and length_unit else {}
        print(json_of(saved | plain_of(reply), 2).decode())
    else:
        # a query without angles has no angle unit
        units = Units(getattr(request, "angle_unit", None) or "deg", length_unit or "")
        print(query.table(reply, *((units,) if query.shows_units else ())))
    return code


def run_export(options: argparse.Namespace) -> int:
    """Write a linkage as a file: a saved solution, or the best solution of a request."""
    from app.fourbar.answers import LINKAGE_FILES
    from app.fourbar.models import ExportRequest

    kind = options.format or (None if options.out is None else _kind_of(options.out.name))
    settings: list[Setting] = [(["rank"], options.rank), (["format"], kind)]
    source = _read(Target("export", ExportRequest), options, [item for item in settings if item[1] is not None])
    request = source.request
    if source.table is not None:
        print(*sentences([source.table.note]), file=sys.stderr)
    resources = _resources(options)
    with waiting("computing", resources.max_budget_ms / 1000), pointing(lambda field: field.removeprefix("/request")):
        content = LINKAGE_FILES.render(request, resources)
    file = None if options.example or options.file == "-" else Path(options.file)
    stem = options.example or ("linkage" if file is None else file.name.partition(".")[0])
    path = options.out or Path(f"{stem}.{FILES[request.format].endings[-1]}")
    if options.out is None and file is not None and path.exists() and path.samefile(file):
        raise FieldError("/out", f"{path} is the file of the request; name a different file with --out")
    return write({path: content})


def run_report(options: argparse.Namespace) -> int:
    """Answer a request and write a report on a solution."""
    from app.registry import queries_named
    from app.report import report_html

    if options.out and Path(options.out).suffix not in (".html", ".htm"):
        raise FieldError("/out", f"must end in .html; it is '{options.out}'. A browser prints the page as PDF")
    (query,), rank = queries_named("synthesize"), options.rank or 1
    source = _read(Target.of(query), options)
    request = source.request.model_copy(update={"top": max(rank, source.request.top)})
    resources = _resources(options)
    with waiting("searching", resources.max_budget_ms / 1000):
        result = query.answer(in_unit(request, source.length_unit), resources)
    if len(result) < rank:
        print(f"There is no solution of rank {rank}: the status is {result.status}.", file=sys.stderr)
        return exit_of(request, result) or Exit.USAGE
    title = options.example or ("linkage" if options.file == "-" else Path(options.file).name.partition(".")[0])
    units = Units(request.angle_unit or "deg", source.length_unit or "")
    plain = request.model_dump(mode="json", exclude_unset=True)
    page = report_html(result, rank, title.replace("_", " "), plain, units)
    return write({options.out or Path(f"{title}.html"): page.encode()})


def _kind_of(name: str) -> str:
    try:
        return "json" if name.endswith(".json") else kind_of(name)
    except FieldError as error:
        raise FieldError("/out", error.message) from None


def format_of(query: Query, path: Path) -> str:
    """Return the format for the suffix of a file; the longest matching suffix applies: plates.dxf before dxf."""
    formats = {FILES[kind].endings[0]: kind for kind in query.formats}
    formats |= {ending: kind for kind in query.formats for ending in FILES[kind].endings}
    ending = max((suffix for suffix in formats if path.name.lower().endswith(f".{suffix}")), key=len, default="")
    if not ending:
        raise FieldError("/export", f"the name must end in one of {', '.join(formats)}, found '{path.name}'")
    return formats[ending]


def _file(
    query: Query, request: Any, reply: Any, rank: int, kind: str, length_unit: str | None, resources: Resources
) -> bytes:
    """Return the content of the file of a solution, or of the whole reply if the query has no solutions."""
    if query.files is not None:
        body = {"request": request, "linkage": reply.solutions[rank - 1].to_dict(), "format": kind}
        body |= {"length_unit": length_unit} if length_unit else {}
        return query.files.render(query.files.request(**body), resources)
    return json_of(reply, 2) if kind == "json" else query.exports[kind](request, resources)


def write(files: Mapping[Path, bytes]) -> Exit:
    """Write files and print their names; return `Exit.FAILED` if a file cannot be written."""
    for path, content in files.items():
        try:
            path.write_bytes(content)
        except OSError as error:
            print(f"cannot write {path}: {error.strerror}", file=sys.stderr)
            return Exit.FAILED
        print(f"wrote {path}", file=sys.stderr)
    return Exit.OK


def _show(picture: bytes) -> None:
    """Write a picture to a temporary file and open it; print its name."""
    import tempfile
    import webbrowser

    with tempfile.NamedTemporaryFile(prefix="linkage-", suffix=".svg", delete=False) as file:
        file.write(picture)
    # without a screen, a text browser might start in the terminal
    screen = sys.platform == "darwin" or bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())
    opened = screen and webbrowser.open(Path(file.name).as_uri())
    print(f"{'opened' if opened else 'there is no screen to show the drawing; wrote'} {file.name}", file=sys.stderr)
