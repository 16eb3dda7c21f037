"""Replies to the queries about linkages as text for a terminal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import linkage_atlas as la
from app.terminal import DEGREES, Units, columns, number, table
from linkage_atlas import Matches, Result, Solution
from linkage_atlas.drive_design.records import ActuatorDrive, Drive, MotorDrive, TorsionSpring
from linkage_atlas.geometry import guide_in_words
from linkage_atlas.notes import counted
from linkage_atlas.solutions import errors_in_words

_LENGTHS = ("crank", "coupler", "rocker", "ground")
_RANK, _BRANCH = ("rank", "d", "rank"), ("branch", "+d", "branch")
_SHOWN_SAMPLES = 8
"""Number of crank angles shown at each end of a long motion."""


def matches_table(reply: Matches, units: Units = DEGREES) -> str:
    """Return a row for each match; errors are in the angle unit of the request."""
    text = columns(
        reply.matches,
        _RANK,
        ("type", "d", "type.number"),
        ("lengths", "", lambda match: " ".join(map(str, match.type.lengths))),
        ("start", ".6g", "start_angle"),
        _BRANCH,
        ("offset", ".6g", "offset"),
        (units.head("rms error", units.angle), ".3g", "rotation_rms"),
    )
    return f"{text}\n\nbest of {counted(reply.report.windows, 'window')}; {_elapsed(reply.report)}"


def _elapsed(report: Any) -> str:
    times = ", ".join(f"{name} {value:.1f} ms" for name, value in report.elapsed_ms.items())
    return times + "".join(f"\nnote: {note}" for note in report.notes)


def _found(reply: Any, noun: str) -> str:
    return f"{reply.status}: {counted(len(reply.solutions), noun)}"


def _search_lines(report: Any) -> list[str]:
    """Return the objective over time and the reason for which the search ended."""
    trace = ", ".join(f"{ms:.1f} ms: {objective:.1e}" for ms, objective in report.trace)
    stopped = f"stopped by {report.stopped_by}; {_elapsed(report)}"
    return ["", f"best objective after {trace}", stopped] if trace else [stopped]


def synthesize_table(reply: Result, units: Units = DEGREES) -> str:
    """Return a row for each solution, and the mounting, errors, layers and studies of the best solution."""
    lines = [_found(reply, "solution")]
    if reply.solutions:
        best, several = reply.solutions[0], any(solution.links is None for solution in reply.solutions)
        own: tuple[Any, ...] = (
            *((name, ".6g", f"links.{name}") for name in _LENGTHS),
            _BRANCH,
            ("start", ".6g", "start_angle"),
            ("family", "", "family"),
        )
        if several:
            own = (("kind", "", "kind"), ("driver", "", "driver"), ("size", ".3g", "size"))
        text = columns(
            reply.solutions,
            _RANK,
            *own,
            ("transm.", ".4g", "transmission_angle_min"),
            (units.head("rot. max", units.angle), ".3g", "errors.rotation_max"),
            (units.head("pos. max", units.length), ".3g", "errors.position_max"),
            ("objective", ".2e", "errors.objective"),
        )
        lines += ["", text, "", *_best_lines(best, units, several)]
    return "\n".join(lines + _search_lines(reply.report))


def _best_lines(best: Solution, units: Units, several: bool) -> list[str]:
    """Describe the best solution; ``several``: there are linkages of other kinds than four-bars."""
    lines = []
    if several:
        lines += [f"guide of rank 1: {guide_in_words(guide)}" for guide in best.guides or ()]
    elif best.mount is not None:
        mount, polar = best.mount, best.mount.coupler_point_polar
        pivots = f"pivot A {_point(mount.pivot_a, 6)}, pivot B {_point(mount.pivot_b, 6)}"
        lines.append(f"mounting of rank 1: {pivots}, ground angle {number(mount.ground_angle)}")
        lines += (
            [] if polar is None else [f"coupler point: radius {number(polar.radius)}, angle {number(polar.angle)}"]
        )
    for values, words in ((best.crank_angle, "crank angles"), (best.travel, "travel")):
        if values is not None:
            shown = [number(value, 4) for value in values]
            if (hidden := len(shown) - 2 * _SHOWN_SAMPLES) > 0:
                shown[_SHOWN_SAMPLES:-_SHOWN_SAMPLES] = [f".. ({hidden} more) .."]
            lines.append(f"{words} of rank 1: {', '.join(shown)}")
    if best.verdict.assembly is not None and best.verdict.assembly.free:
        assembly = best.verdict.assembly
        lines.append(f"rank 1 has {counted(assembly.count, 'free layer')}: {assembly.reasons[0]}")
    if best.verdict.reasons:
        lines.append(f"rank 1: {'; '.join(best.verdict.reasons)}")
    lines += _rounded_lines(best) + _analysis_lines(best) + _tolerance_lines(best, units)
    if best.drives or best.springs or best.refused:
        lines.append(f"drives and springs of rank 1:\n{drives_table(best, units)}")
    if best.has_drive is False:
        lines.append("Rank 1 has no drive within the limits of `drive`.")
    return lines


def _rounded_lines(best: Solution) -> list[str]:
    """Return the rounded lengths and their errors, and of how many combinations of stock lengths they are the best."""
    rounded = best.rounded
    if rounded is None:
        return []
    if rounded.errors is None:
        tried = counted(rounded.combinations_examined, "combination")
        return [f"rounded: none of {tried} of lengths closes within the limits"]
    errors = errors_in_words(rounded.errors, best.linkage.degrees)
    words = f"rounded: {_in_words(rounded.lengths or {}) or 'no lengths'}; {errors}"
    if rounded.combinations is not None:
        tried = "" if rounded.exhaustive else f"{rounded.combinations_examined:,} of "
        words += f", the best of {tried}{rounded.combinations:,} combinations"
    return [words]


def _analysis_lines(best: Solution) -> list[str]:
    """Return the largest values of an analysis over the used interval."""
    if best.analysis is None or best.analysis.curve is None:
        return []
    curve, maxima = best.analysis.curve, []
    rows = {"velocity": curve.velocity, "acceleration": curve.acceleration}
    rows["torque of the drive" if curve.travel is None else "force of the drive"] = curve.drive_load
    rows["pin force"] = None if curve.pin_forces is None else np.concatenate(curve.pin_forces)
    for name, values in rows.items():
        if values is None:
            continue
        sizes = np.abs(values) if values.ndim == 1 else np.linalg.norm(values, axis=1)
        if np.isfinite(sizes).any():
            maxima.append(f"{name} {number(np.nanmax(sizes), 4)}")
    return [f"largest over the interval: {', '.join(maxima)}"] if maxima else []


def _tolerance_lines(best: Solution, units: Units) -> list[str]:
    """Return the errors due to manufacturing tolerances and their largest contributions."""
    if best.tolerance_study is None:
        return []
    study, lines = best.tolerance_study, []
    for name, unit in (("position", units.length), ("rotation", units.angle)):
        distribution = getattr(study, name)
        if distribution is not None and math.isfinite(distribution.worst.p95):
            source = study.largest[name]
            lines.append(
                f"with tolerances, the {name} error is at most {units.value(distribution.worst.p95, unit, 4)} in 95 % of "
                f"{study.samples:,} linkages" + (f"; largest contribution: {source}" if source else "")
            )
    return lines


def function_table(reply: Any, units: Units = DEGREES) -> str:
    """Return a row for each linkage; errors are in the angle unit of the request."""
    lines = [_found(reply, "linkage")]
    if reply.solutions:
        best, dial = reply.solutions[0], reply.question.dial
        travels, unit = dial.travels, units.length if dial.output == "length" else units.angle
        kinds = (("kind", "", "kind"), ("driver", "", "driver")) if travels else ()
        text = columns(
            reply.solutions,
            _RANK,
            *kinds,
            ("lengths", "", lambda solution: _in_words(solution.lengths if travels else solution.links._asdict())),
            _BRANCH,
            ("input zero", ".6g", "input_zero" if travels else "start_angle"),
            ("offset", ".6g", "output_offset"),
            *(() if travels else (("family", "", "family"),)),
            ("transm.", ".4g", "transmission_angle_min"),
            (units.head("rms error", unit), ".3g", "errors.rms"),
            (units.head("max error", unit), ".3g", "errors.max"),
            ("max y", ".3g", "errors.max_y"),
            ("alt.", "d", "errors.alternations"),
        )
        lines += ["", text]
        if best.verdict.reasons:
            lines.append(f"rank 1: {'; '.join(best.verdict.reasons)}")
        rounded = getattr(best, "rounded", None)
        if rounded is not None and rounded.closes:
            error = units.value(rounded.errors.max, units.angle)
            lines.append(f"rounded: {_in_words(rounded.links._asdict())}; largest error {error}")
    return "\n".join(lines + _search_lines(reply.report))


def drives_table(reply: la.Drives | Solution, units: Units = DEGREES) -> str:
    """Return a row for each drive and each spring, their stops and holding, and the reasons for which a kind is missing."""
    drives, springs, lines = reply.drives or [], reply.springs or [], []
    if drives:
        table = columns(
            drives,
            ("kind", "", "kind"),
            ("link", "", "link"),
            ("name", "", "name"),
            ("ground or motor", "", lambda drive: _point(getattr(drive, "ground_point", None) or drive.motor)),
            ("pin", "", lambda drive: _point(getattr(drive, "pin", None))),
            (units.head("length", units.length), "", lambda drive: _range(getattr(drive, "length", None))),
            ("stroke", ".6g", "stroke"),
            ("min. arm", ".6g", "arm_min"),
            ("peak force", ".6g", "peak_force"),
            ("over bound", ".4g", "peak_force_ratio"),
            ("peak torque", ".6g", "peak_torque"),
            (units.head("transm.", units.angle), ".4g", _transmission_angle),
        )
        lines += [table, *map(_drive_line, drives)]
    if springs:
        table = columns(
            springs,
            ("spring", "", "kind"),
            ("set", "d", "set"),
            ("name", "", "name"),
            ("between", "", lambda spring: "-".join(spring.between)),
            ("ends", "", lambda spring: " ".join(map(_point, getattr(spring, "points", None) or [spring.point]))),
            ("stiffness", ".6g", lambda spring: spring.rate if _twists(spring) else spring.stiffness),
            ("length", "", lambda spring: _range(spring.twist if _twists(spring) else spring.length)),
            ("rms torque", "", lambda spring: f"{spring.torque.before.rms:.4g} -> {spring.torque.after.rms:.3g}"),
            ("without drive", "", "motion_at_ends"),
        )
        lines.append(table)
    lines += [refusal.sentence for refusal in reply.refused or ()]
    if not lines:
        lines.append("The request has no drives and no springs.")
    return "\n".join([*lines, *(f"note: {note}" for note in getattr(reply, "notes", ()))])


def _twists(spring: object) -> bool:
    return isinstance(spring, TorsionSpring)


def _drive_line(drive: Drive) -> str:
    """Describe the sizes of a drive that the table does not have, its stops, and the load that it holds."""
    sizes = ""
    match drive:
        case MotorDrive(six_bar=bar):
            lengths = f"crank {number(bar.crank)}, rod {number(bar.coupler)}"
            sizes = f"{lengths}, time ratio {number(bar.time_ratio)} ({bar.kind}); "
        case ActuatorDrive(buckling=buckling) if buckling is not None and buckling.safety is not None:
            sizes = f"safety against buckling {buckling.safety:.3g}; "
    return f"{drive.kind} on the {drive.link}: {sizes}stops: {drive.stops}; holds without power: {drive.holds}"


def _transmission_angle(drive: Any) -> float | None:
    return getattr(drive.six_bar if isinstance(drive, MotorDrive) else drive, "transmission_angle_min", None)


def _in_words(lengths: dict[str, float]) -> str:
    return ", ".join(f"{name} {number(value)}" for name, value in lengths.items())


def _point(point: Any, digits: int = 5) -> str:
    return "-" if point is None else f"({number(point[0], digits)}, {number(point[1], digits)})"


def _range(ends: tuple[float, float] | None) -> str:
    return "-" if ends is None else f"{number(ends[0])} to {number(ends[1])}"


def assembly_table(reply: la.Assembly, units: Units = DEGREES) -> str:
    """Return a row for each layer from the top down with its parts and pins, the smallest gap and the sizes."""
    ends = (0, reply.count + 1)
    rows = []
    for layer in range(ends[1], ends[0] - 1, -1):
        names = [
            part.name
            for kinds in (("plate", "board"), ("head",))
            for part in reply.parts
            if part.kind in kinds and part.layers == (layer, layer)
        ]
        pins = [pin.name for pin in reply.pins if pin.layers[0] <= layer <= pin.layers[1]]
        if names or layer not in ends:
            rows.append((str(layer), ", ".join(names) or "-", " ".join(pins)))
    lines = [
        f"{reply.status}: {counted(reply.count, 'layer')}",
        "",
        table(("layer", "parts", "pins"), rows, left=True),
        "",
    ]
    if reply.smallest_gap is not None:
        gap = reply.smallest_gap
        position = f"at {number(gap.crank_angle)}{units.behind(units.angle)}"
        lines.append(
            f"smallest gap beyond the clearance: {units.value(gap.value, units.length, 6)}, {' and '.join(gap.pair)}, {position}"
        )
    sizes = ", ".join(
        f"{name} {units.value(value, units.length, 4)}" for name, value in reply.sizes._asdict().items()
    )
    return "\n".join([*lines, *reply.reasons[reply.status != "blocked" :], f"sizes: {sizes}"])
