"""A linkage as a file, on the command line: of a request that is solved, or of a solution that was saved with its request."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from app.arguments import FILE, add_atlas, whole_number
from app.command import add_request, add_set, parsed, read_request, text_of, waiting, with_fields, write
from app.fourbar.answers import LINKAGE_FILES
from app.fourbar.models import ExportRequest, Material, SolidsRequest
from app.query import FILES, LengthUnit, invalid
from app.registry import queries_named
from linkage_atlas import FieldError
from linkage_atlas.formats import kind_of


def add_export(parser: argparse.ArgumentParser) -> None:
    (query,) = queries_named("synthesize")
    examples = add_request(
        parser,
        query,
        LINKAGE_FILES.summary,
        "as JSON a request, or one with its solution as `synthesize --export FILE.json` writes it; or samples as a table "
        "(CSV, or pasted from a spreadsheet)",
        "solve a bundled example instead",
    )
    parser.add_argument("--format", choices=LINKAGE_FILES.formats, help="default: as the ending of --out says")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="the file to write (default: its example's or request's name)"
    ).complete = FILE  # type: ignore[attr-defined]
    parser.add_argument(
        "--rank", type=whole_number(1, 100), default=1, help="which solution of the request (%(default)s)"
    )
    parser.add_argument(
        "--length-unit", choices=get_args(LengthUnit), default="mm", help="the unit of the lengths (%(default)s)"
    )
    add_atlas(parser, "the atlas, if one is needed")
    parts = parser.add_argument_group("parts, for step, 3mf, stl, urdf, sdf, parts and the masses in mjcf")
    fits = get_args(SolidsRequest.model_fields["fit"].annotation)
    parts.add_argument(
        "--fit", choices=fits, help="how pins fit: tolerances for a workshop (H7), or play for a printer"
    )
    parts.add_argument("--material", choices=get_args(Material), help="of plates and boards")
    parts.add_argument("--scale", type=float, help="of a model (1)")
    parts.add_argument("--boards", choices=("below", "above", "both", "bar"), help="where fixed pins stand (below)")
    parts.add_argument("--heads", action="store_true", default=None, help="pins with heads")
    parts.add_argument("--thickness", type=float, help="of the plates")
    parts.add_argument("--nevertheless", action="store_true", default=None, help="also where parts would collide")
    add_set(
        parts,
        "another field of the body of /v1/export, as in assembly.width=20 or solids.pins=brass; may be given several times",
    )
    parser.set_defaults(run=_run, examples=examples)


_FIELDS = {
    "solids": ("fit", "material", "scale", "nevertheless"),
    "assembly": ("boards", "heads", "thickness"),
}


def _run(options: argparse.Namespace) -> int:
    from app.resources import ServiceResources
    from app.settings import atlas_of, settings_of

    kind, path = _wanted(options)
    given = {part: {name: getattr(options, name) for name in names} for part, names in _FIELDS.items()}
    also = [([part, name], value) for part, values in given.items() for name, value in values.items()]
    also = [(field, value) for field, value in also if value is not None]
    body = with_fields(
        _body(options), [*also, *options.set, (["format"], kind), (["length_unit"], options.length_unit)]
    )
    body.setdefault("rank", options.rank)
    try:
        request = ExportRequest.model_validate(body)
    except ValidationError as error:
        raise invalid(error, ExportRequest) from None
    resources = ServiceResources(settings_of(options), atlas_of)
    with waiting("computing", resources.max_budget_ms / 1000):
        content = LINKAGE_FILES.render(request, resources)
    return write({path: content})


def _wanted(options: argparse.Namespace) -> tuple[str, Path]:
    """The kind of the file, and its name: that of the example or request, with the ending of its kind."""
    stem = options.example or ("linkage" if options.file == "-" else Path(options.file).name.partition(".")[0])
    if options.out is None:
        kind = options.format or "json"
        return kind, Path(f"{stem}.{FILES[kind].endings[-1]}")
    if options.format is not None:
        return options.format, options.out
    name = options.out.name
    return "json" if name.endswith(".json") and not name.endswith(".pylinkage.json") else kind_of(name), options.out


def _body(options: argparse.Namespace) -> dict[str, Any]:
    """What is exported: a body of /v1/export, or the request of one."""
    text = text_of(options)
    if text.lstrip()[:1] == b"{":
        content = parsed(text)
        if isinstance(content.get("solutions"), list):
            raise FieldError(
                "", "this is a reply: wanted its request, or what `synthesize --export FILE.json` writes"
            )
        if "request" in content:
            return dict(content)
    (query,) = queries_named("synthesize")
    return {"request": read_request(query, text)}
