"""Report on a solution: a page of HTML to read, print and pass on, without scripts or further files."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np

from app.terminal import Units, number
from linkage_atlas import Result, Solution, __version__
from linkage_atlas.drive_design.curves import curves_svg
from linkage_atlas.drive_design.records import AnySpring, Drive, Spring

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 52em; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.6em } h2 { font-size: 1.15em; margin-top: 1.8em; border-bottom: 1px solid #ccc }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { padding: .15em .9em; text-align: right; border-bottom: 1px solid #eee }
th:first-child, td:first-child { text-align: left }
img { width: 100% }
.drawing { max-height: 26em; object-fit: contain }
pre { white-space: pre-wrap; font-size: .85em } footer { color: #666; margin-top: 2em }
@media print { body { margin: 0; max-width: none; font-size: 11px } section { break-inside: avoid } @page { margin: 15mm } }
"""


def report_html(result: Result, rank: int, title: str, request: dict[str, Any], units: Units) -> str:
    """Write a report on a solution.

    Parameters
    ----------
    result : Result
        Reply with the solution.
    rank : int
        Rank of the solution, from 1.
    title : str
        Name of the request.
    request : dict
        The request as plain values, which the report repeats.
    units : Units
        Units of angles and lengths.

    Returns
    -------
    str
        HTML that contains its drawings and its style.
    """
    solution = result[rank - 1]
    count = f"{len(result)} solution{'s' if len(result) > 1 else ''}"
    drawing = solution.linkage.render("svg", length_unit=units.length or None)
    parts = [
        f"<h1>{escape(title)}</h1>\n<p>Solution {rank} of {count}. Status of the request: {result.status}.</p>",
        _section("Drawing", _picture(drawing, "The linkage at the first sample", "drawing")),
        _section("Dimensions", _rows(_dimensions(solution, units))),
        _section("Errors", _rows(_errors(solution, units)) + _samples(solution, units)),
        _section("Verdict", _verdict(solution, units)),
    ]
    if solution.drives or solution.springs:
        parts.append(_section("Drives and springs", _drives(solution)))
    if result.report.notes:
        parts.append(_section("Notes", _list(result.report.notes)))
    content = escape(json.dumps(request))
    parts.append(_section("Request", f"<pre>{content}</pre>"))
    head = f'<!doctype html>\n<html lang="en">\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n<style>{STYLE}</style>'
    return "\n".join([head, *parts, f"<footer>Computed by linkage-atlas {__version__}.</footer>\n</html>\n"])


def _section(title: str, content: str) -> str:
    return f"<section>\n<h2>{title}</h2>\n{content}\n</section>"


def _picture(svg: str, description: str, kind: str = "") -> str:
    """Return an image with its content, so that the styles of several drawings do not mix."""
    content = base64.b64encode(svg.encode()).decode()
    return f'<img class="{kind}" alt="{description}" src="data:image/svg+xml;base64,{content}">'


def _list(sentences: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)}</ul>"


def _rows(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    """Return a table; the first cell of a row is its name."""
    heads = f"<tr>{''.join(f'<th>{escape(cell)}</th>' for cell in head)}</tr>" if head else ""
    return f"<table>{heads}{''.join('<tr>' + ''.join(f'<td>{escape(c)}</td>' for c in row) + '</tr>' for row in rows)}</table>"


def _point(point: Sequence[float]) -> str:
    return f"({', '.join(number(float(value)) for value in point)})"


def _value(value: object) -> str:
    """Return a word, a number or a point."""
    return _point(value) if isinstance(value, tuple) else number(value) if isinstance(value, float) else str(value)


def _dimensions(solution: Solution, units: Units) -> list[tuple[str, str]]:
    length, angle = units.behind(units.length), units.behind(units.angle)
    rows = [("kind", solution.kind.replace("_", " ")), ("driven by", solution.driver)]
    if solution.links is None:
        for guide_name, guide in zip(("driven guide", "other guide"), solution.guides or ()):
            values = guide._asdict()
            words = ", ".join(
                f"{name.replace('_', ' ')} {_value(value)}" for name, value in values.items() if value is not None
            )
            rows.append((guide_name, words))
        return [*rows, ("start of the drive", number(solution.start)), ("branch", f"{solution.branch:+d}")]
    rows += [(name, f"{number(value)}{length}") for name, value in solution.links._asdict().items()]
    if solution.mount is not None:
        mount = solution.mount
        rows += [("fixed pivot A", _point(mount.pivot_a)), ("fixed pivot B", _point(mount.pivot_b))]
        polar = mount.coupler_point_polar
        if polar is not None:
            rows.append(("body point from D", f"{number(polar.radius)}{length} at {number(polar.angle)}{angle}"))
    rows.append(("crank angle at the first sample", f"{number(solution.start_angle)}{angle} from the line A to B"))
    return [*rows, ("branch", f"{solution.branch:+d}"), ("family", str(solution.family).replace("_", " "))]


def _errors(solution: Solution, units: Units) -> list[tuple[str, str]]:
    errors = solution.errors
    rows = []
    for name, rms, largest, unit in (
        ("rotation", errors.rotation_rms, errors.rotation_max, units.angle),
        ("position", errors.position_rms, errors.position_max, units.length),
    ):
        if largest is not None:
            rows.append((name, f"{units.value(rms, unit)} rms, {units.value(largest, unit)} at most"))
    return rows


def _samples(solution: Solution, units: Units) -> str:
    """Return a table of the requested and made poses; empty for a linkage without a position in the plane."""
    motion, linkage = solution.origin.motion, solution.linkage
    travel = linkage.sample_travel(motion)
    if motion.position is None or travel is None:
        return ""
    joints = linkage.joints(travel)
    gaps = np.hypot(*(joints.body_point - motion.position).T)
    rotation = np.full(len(motion), np.nan) if motion.rotation is None else motion.rotation
    drive = "crank angle" if linkage.plain.driver.turns else "travel"
    head = ("sample", drive, "x", "y", units.head("rotation", units.angle), "error of position")
    columns = [travel, *motion.position.T, rotation, gaps]
    rows = [
        (str(index + 1), *("-" if np.isnan(value) else number(round(value, 4)) for value in row))
        for index, row in enumerate(np.column_stack(columns).tolist())
    ]
    return f"<p>Requested poses:</p>{_rows(rows, head)}"


def _verdict(solution: Solution, units: Units) -> str:
    verdict = solution.verdict
    usable = "The drive moves the linkage through all samples." if verdict.works else "This linkage cannot be used."
    smallest = f"Smallest transmission angle: {units.value(solution.transmission_angle_min, units.angle, 4)}."
    return f"<p>{usable} {smallest}</p>{_list(verdict.reasons)}"


def _drives(solution: Solution) -> str:
    found: list[Drive] = solution.drives or []
    springs = solution.springs or []
    items = [*found, *springs]
    lines = _list(f"{item.summary}; at the first sample: {_ends(item)}" for item in items)
    return lines + _picture(curves_svg(items), "Forces and torques")


def _ends(item: Drive | AnySpring) -> str:
    """Return the points that a drive or spring joins, in words."""
    if isinstance(item, Spring):
        ends = zip((f"end on the {link}" for link in item.between), item.points)
    else:
        names = [name for name in ("motor", "ground_point", "pin", "point") if hasattr(item, name)]
        ends = zip((name.replace("_", " ") for name in names), (getattr(item, name) for name in names))
    return ", ".join(f"{name} {_point(point)}" for name, point in ends)
