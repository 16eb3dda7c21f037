"""The four-bar's replies as text for a terminal."""

from __future__ import annotations

import math

import numpy as np

from app.tables import DEGREES, Units, number, table
from linkage_atlas import Matches, Result, Solution
from linkage_atlas.answers import Errors, MatchReport, Report, Rounded


def _elapsed(report: MatchReport | Report) -> str:
    return ", ".join(f"{name} {value:.1f} ms" for name, value in report.elapsed_ms.items())


def matches_table(reply: Matches, units: Units = DEGREES) -> str:
    """Ranked rows of the matches; errors in the request's unit of angle."""
    rows = [
        (
            *(m.rank, m.type.number, " ".join(map(str, m.type.lengths)), number(m.start_angle)),
            *(f"{m.branch:+d}", number(m.offset), f"{m.similarity:.3g}"),
        )
        for m in reply.matches
    ]
    text = table(("rank", "type", "lengths", "start", "branch", "offset", units.head("rms error", units.angle)), rows)
    report = reply.report
    return f"{text}\n\nbest of {report.windows:,} windows; {_elapsed(report)}" + _notes(report)


def _notes(report: MatchReport | Report) -> str:
    return "".join(f"\nnote: {note}" for note in report.notes)


def _proof(rounded: Rounded) -> str:
    """Whether a choice of stock lengths is the best of all."""
    if rounded.combinations is None:
        return ""
    of = f"of {rounded.combinations:,} combinations"
    return f", the best {of}" if rounded.exhaustive else f", the best of {rounded.tried:,} {of}"


def _analysis_lines(best: Solution) -> list[str]:
    """The largest values of an analysis over the used interval."""
    if best.analysis is None:
        return []
    curve = best.analysis.curve
    forces = None if curve.pin_forces is None else np.concatenate(curve.pin_forces)
    rows = {
        "velocity": curve.velocity,
        "acceleration": curve.acceleration,
        "crank torque": curve.crank_torque,
        "pin force": forces,
    }
    found = []
    for name, values in rows.items():
        if values is None:
            continue
        sizes = np.abs(values) if values.ndim == 1 else np.linalg.norm(values, axis=1)
        if np.isfinite(sizes).any():
            found.append(f"{name} {number(np.nanmax(sizes), 4)}")
    return [f"largest over the interval: {', '.join(found)}"] if found else []


def _tolerance_lines(best: Solution, units: Units) -> list[str]:
    """What tolerances of manufacture do at worst, and what contributes most."""
    if best.tolerance_study is None:
        return []
    study, lines = best.tolerance_study, []
    for name, unit in (("position", units.length), ("rotation", units.angle)):
        made = getattr(study, name)
        if made is not None and math.isfinite(made.worst.p95):
            source = study.largest[name]
            lines.append(
                f"as made, {name} off by at most {units.value(made.worst.p95, unit, 4)} in 95 % of {study.samples:,} linkages"
                + (f"; most from {source}" if source else "")
            )
    return lines


def _errors(errors: Errors, units: Units) -> str:
    """Errors at the samples in words: of rotation, of position, as far as they were asked for."""
    found = []
    for name, unit in (("rotation", units.angle), ("position", units.length)):
        rms, largest = (getattr(errors, f"{name}_{which}") for which in ("rms", "max"))
        if rms is not None:
            found.append(f"{name} {units.value(rms, unit)} rms, {units.value(largest, unit)} at most")
    return "; ".join(found)


def synthesize_table(reply: Result, units: Units = DEGREES) -> str:
    """Ranked solutions of the reply with their largest errors, and the mounting pose and errors of the best."""
    lines = [f"{reply.status}: {len(reply.solutions)} solution{'s' if len(reply.solutions) != 1 else ''}"]
    rows = []
    for s in reply.solutions:
        links = [number(v) for v in (s.links.crank, s.links.coupler, s.links.rocker, s.links.ground)]
        rows.append(
            (
                *(s.rank, *links, f"{s.branch:+d}", number(s.start_angle), s.family),
                number(s.transmission_angle_min, 4),
                *(units.value(error, "") for error in (s.errors.rotation_max, s.errors.position_max)),
                f"{s.errors.objective:.2e}",
            )
        )
    if rows:
        head = ("rank", "crank", "coupler", "rocker", "ground", "branch", "start", "family", "transm.")
        errors = (units.head("rot. max", units.angle), units.head("pos. max", units.length), "objective")
        lines += ["", table((*head, *errors), rows)]
        best = reply.solutions[0]
        lines += ["", f"errors of rank 1: {_errors(best.errors, units)}"]
        if best.mount is not None:
            m = best.mount
            lines += [
                f"mounting of rank 1: pivot A ({number(m.pivot_a[0])}, {number(m.pivot_a[1])}), "
                f"pivot B ({number(m.pivot_b[0])}, {number(m.pivot_b[1])}), ground angle {number(m.ground_angle)}",
                f"coupler point: radius {number(m.coupler_point.radius)}, angle {number(m.coupler_point.angle)}; "
                f"L_B {number(m.L_B)}, beta {number(m.beta)}",
            ]
        if best.crank_angle is not None:
            lines.append(f"crank angles of rank 1: {', '.join(number(angle, 4) for angle in best.crank_angle)}")
        if best.verdict.reasons:
            lines.append(f"rank 1: {'; '.join(best.verdict.reasons)}")
        if best.rounded is not None and best.rounded.closes:
            r = best.rounded
            rounded = " ".join(number(v) for v in (r.links.crank, r.links.coupler, r.links.rocker, r.links.ground))
            lines.append(f"rounded: {rounded}; {_errors(r.errors, units)}{_proof(r)}")
        lines += _analysis_lines(best) + _tolerance_lines(best, units)
    trace = ", ".join(f"{ms:.1f} ms: {objective:.1e}" for ms, objective in reply.report.trace)
    if trace:
        lines += ["", f"best objective after {trace}"]
    lines.append(f"stopped by {reply.report.stopped_by}; {_elapsed(reply.report)}")
    return "\n".join(lines) + _notes(reply.report)
