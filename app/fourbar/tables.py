"""Replies to the queries about linkages as text for a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import linkage_atlas as la
from app.terminal import DEGREES, Units, columns, left_table, number
from linkage_atlas import Matches, Result, Solution
from linkage_atlas.drive_design.records import (
    ActuatorDrive,
    AnySpring,
    Drive,
    MotorDrive,
    RotaryDrive,
    ToggleDrive,
    TorsionSpring,
)
from linkage_atlas.notes import counted
from linkage_atlas.solutions import Errors

_ROUNDING = 1e-10
"""Fraction of the size of a result below which a number is shown as zero."""


_LENGTHS = ("crank", "coupler", "rocker", "ground")


_LINKAGE = (
    ("rank", "d", "rank"),
    *((name, ".6g", f"links.{name}") for name in _LENGTHS),
    ("branch", "+d", "branch"),
    ("start", ".6g", "start_angle"),
)


def matches_table(reply: Matches, units: Units = DEGREES) -> str:
    """Return a row for each match; errors are in the angle unit of the request."""
    kinds = [] if all(match.kind == "four_bar" for match in reply.matches) else [("kind", "", "kind")]
    text = columns(
        reply.matches,
        ("rank", "d", "rank"),
        *kinds,
        ("type", "d", "type.number"),
        ("lengths", "", lambda match: " ".join(map(str, match.type.lengths))),
        ("start", ".6g", "start_angle"),
        ("branch", "+d", "branch"),
        ("offset", ".6g", "offset"),
        (units.head("rms error", units.angle), ".3g", "rotation_rms"),
    )
    return f"{text}\n\nbest of {counted(reply.report.windows, 'window')}; {_elapsed(reply.report)}"


def _elapsed(report: Any) -> str:
    times = ", ".join(f"{name} {value:.1f} ms" for name, value in report.elapsed_ms.items())
    return times + "".join(f"\nnote: {note}" for note in report.notes)


def _found(reply: Any, what: str) -> str:
    return f"{reply.status}: {counted(len(reply.solutions), what)}"


def _search_lines(report: Any) -> list[str]:
    """Return the objective over time and the reason for which the search ended."""
    trace = ", ".join(f"{ms:.1f} ms: {objective:.1e}" for ms, objective in report.trace)
    stopped = f"stopped by {report.stopped_by}; {_elapsed(report)}"
    return ["", f"best objective after {trace}", stopped] if trace else [stopped]


def _lengths(links: Any) -> str:
    return " ".join(number(getattr(links, name)) for name in _LENGTHS)


def _proof(rounded: Any) -> str:
    """Return the number of combinations of stock lengths of which a choice is the best."""
    if rounded.combinations is None:
        return ""
    total = f"of {rounded.combinations:,} combinations"
    return f", the best {total}" if rounded.exhaustive else f", the best of {rounded.combinations_examined:,} {total}"


def _analysis_lines(best: Solution) -> list[str]:
    """Return the largest values of an analysis over the used interval."""
    if best.analysis is None:
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


def _errors(errors: Errors, units: Units) -> str:
    """Return the errors at the samples in words: rotation, position, or both."""
    phrases = []
    for name, unit in (("rotation", units.angle), ("position", units.length)):
        rms, largest = (getattr(errors, f"{name}_{statistic}") for statistic in ("rms", "max"))
        if rms is not None:
            phrases.append(f"{name} {units.value(rms, unit)} rms, {units.value(largest, unit)} at most")
    return "; ".join(phrases)


def _rounded_lines(best: Solution, units: Units) -> list[str]:
    """Return the rounded lengths and their errors."""
    rounded = best.rounded
    if rounded is None:
        return []
    if not rounded.closes:
        return [
            f"rounded: none of {counted(rounded.combinations_examined, 'combination')} of lengths closes within the limits"
        ]
    if rounded.links is not None:
        words = _lengths(rounded.links)
    else:
        words = ", ".join(f"{name} {number(length)}" for name, length in rounded.lengths.items()) or "no lengths"
    return [f"rounded: {words}; {_errors(rounded.errors, units)}{_proof(rounded)}"]


def _guide(guide: Any) -> str:
    """Return a guide of a reply in words; numbers that are zero up to rounding are shown as zero."""
    ends = getattr(guide, "used", None) or ()
    fixed = getattr(guide, {"circle": "pivot", "rail": "point", "slot": "pin"}[guide.guide])
    size = max(map(abs, (*fixed, *guide.body_point, *ends, getattr(guide, "radius", 0.0))))

    def rounded(value: float) -> str:
        return number(0.0 if abs(value) < _ROUNDING * size else value)

    def point_text(xy: Any) -> str:
        return f"({rounded(xy[0])}, {rounded(xy[1])})"

    used = f", used from {rounded(ends[0])} to {rounded(ends[1])}" if ends else ""
    if guide.guide == "circle":
        return f"circle about {point_text(guide.pivot)}, radius {number(guide.radius)}, body point {point_text(guide.body_point)}"
    if guide.guide == "rail":
        text = f"rail through {point_text(guide.point)}, direction {number(guide.direction)}"
        return f"{text}, body point {point_text(guide.body_point)}{used}"
    text = f"slot on the pin {point_text(guide.pin)}, through body point {point_text(guide.body_point)}"
    return f"{text}, body direction {number(guide.body_direction)}{used}"


def synthesize_table(reply: Result, units: Units = DEGREES) -> str:
    """Return a row for each solution, and the mounting, errors, layers and studies of the best solution."""
    lines = [_found(reply, "solution")]
    if reply.solutions:
        best, several = reply.solutions[0], any(solution.links is None for solution in reply.solutions)
        own: tuple[Any, ...] = (*_LINKAGE, ("family", "", "family"))
        if several:
            own = (("rank", "d", "rank"), ("kind", "", "kind"), ("driver", "", "driver"), ("size", ".3g", "size"))
        text = columns(
            reply.solutions,
            *own,
            ("transm.", ".4g", "transmission_angle_min"),
            (units.head("rot. max", units.angle), ".3g", "errors.rotation_max"),
            (units.head("pos. max", units.length), ".3g", "errors.position_max"),
            ("objective", ".2e", "errors.objective"),
        )
        lines += ["", text, "", f"errors of rank 1: {_errors(best.errors, units)}"]
        if several:
            lines += [f"guide of rank 1: {_guide(solution)}" for solution in best.guides or ()]
        elif best.mount is not None:
            m = best.mount
            lines += [
                f"mounting of rank 1: pivot A ({number(m.pivot_a[0])}, {number(m.pivot_a[1])}), "
                f"pivot B ({number(m.pivot_b[0])}, {number(m.pivot_b[1])}), ground angle {number(m.ground_angle)}",
                f"coupler point: radius {number(m.coupler_point_polar.radius)}, angle {number(m.coupler_point_polar.angle)}",
            ]
        for name, words in (("crank_angle", "crank angles"), ("travel", "travel")):
            values = getattr(best, name, None)
            if values is not None:
                shown = [number(value, 4) for value in values]
                if len(shown) > 2 * _SHOWN_SAMPLES:
                    left_out = f".. ({len(shown) - 2 * _SHOWN_SAMPLES} more) .."
                    shown = [*shown[:_SHOWN_SAMPLES], left_out, *shown[-_SHOWN_SAMPLES:]]
                lines.append(f"{words} of rank 1: {', '.join(shown)}")
        if best.verdict.assembly is not None and best.verdict.assembly.free:
            assembly = best.verdict.assembly
            lines.append(f"rank 1 has {counted(assembly.count, 'free layer')}: {assembly.reasons[0]}")
        if best.verdict.reasons:
            lines.append(f"rank 1: {'; '.join(best.verdict.reasons)}")
        lines += _rounded_lines(best, units) + _analysis_lines(best) + _tolerance_lines(best, units)
        lines += _drive_lines(best, units)
    return "\n".join(lines + _search_lines(reply.report))


def _travel_lines(reply: Any, units: Units) -> list[str]:
    """Return a row for each linkage with sliders, and the reasons for the verdict of the first linkage."""
    unit = units.length if reply.dial.output == "length" else units.angle
    text = columns(
        reply.solutions,
        ("rank", "d", "rank"),
        ("kind", "", "kind"),
        ("driver", "", "driver"),
        (
            "lengths",
            "",
            lambda solution: ", ".join(f"{name} {number(value)}" for name, value in solution.lengths.items()),
        ),
        ("branch", "+d", "branch"),
        ("input zero", ".6g", "input_zero"),
        ("offset", ".6g", "output_offset"),
        ("transm.", ".4g", "transmission_angle_min"),
        (units.head("rms error", unit), ".3g", "errors.rms"),
        (units.head("max error", unit), ".3g", "errors.max"),
        ("max y", ".3g", "errors.max_y"),
        ("alt.", "d", "errors.alternations"),
    )
    reasons = reply.solutions[0].verdict.reasons
    return ["", text, *([f"rank 1: {'; '.join(reasons)}"] if reasons else [])]


def function_table(reply: Any, units: Units = DEGREES) -> str:
    """Return a row for each linkage; errors are in the angle unit of the request."""
    lines = [_found(reply, "linkage")]
    if reply.solutions and hasattr(reply.solutions[0], "kind"):
        lines += _travel_lines(reply, units)
    elif reply.solutions:
        text = columns(
            reply.solutions,
            *_LINKAGE,
            ("offset", ".6g", "output_offset"),
            ("family", "", "family"),
            ("transm.", ".4g", "transmission_angle_min"),
            (units.head("rms error", units.angle), ".3g", "errors.rms"),
            (units.head("max error", units.angle), ".3g", "errors.max"),
            ("max y", ".3g", "errors.max_y"),
            ("alt.", "d", "errors.alternations"),
        )
        lines += ["", text]
        best = reply.solutions[0]
        if best.verdict.reasons:
            lines.append(f"rank 1: {'; '.join(best.verdict.reasons)}")
        if best.rounded is not None and best.rounded.links is not None and best.rounded.errors is not None:
            error = units.value(best.rounded.errors.max, units.angle)
            lines.append(f"rounded: {_lengths(best.rounded.links)}, largest error {error}")
    return "\n".join(lines + _search_lines(reply.report))


_SHOWN_SAMPLES = 8
"""Number of crank angles shown at each end of a long motion."""
_DRIVES = {"rotary": "rotary drive", "dyad": "motor with a rod", "toggle": "over-centre latch"}


def _drive_words(drive: Drive, units: Units) -> str:
    """Describe a drive: kind, ends, stroke, force or torque, stops and holding without power."""
    length, swing = units.length, f"swing {units.value(abs(drive.swing), units.angle, 4)}"
    match drive:
        case RotaryDrive():
            words = [f"from {_point(drive.motor)}", swing, *_load_words(None, drive.peak_torque)]
        case ActuatorDrive():
            carrier = "" if drive.base_link == "ground" else f" on the {drive.base_link}"
            words = [
                f"from {_point(drive.ground_point)}{carrier} to its pin at {_point(drive.pin)}",
                f"stroke {units.value(drive.stroke, length, 4)}, length {_length(drive)}",
                *_load_words(drive.peak_force, None, drive.peak_force_ratio),
                f"smallest moment arm {units.value(drive.arm_min, length, 4)}",
            ]
            if drive.buckling is not None and drive.buckling.safety is not None:
                words.append(f"safety against buckling {drive.buckling.safety:.3g}")
        case MotorDrive(six_bar=bar):
            words = [
                f"from {_point(drive.motor)} to its pin at {_point(drive.pin)}",
                f"crank {number(bar.crank)}, rod {number(bar.coupler)}, time ratio {number(bar.time_ratio, 3)}",
                f"transmission angle at least {units.value(bar.transmission_angle_min, units.angle)}",
                swing,
                *_load_words(drive.peak_force, bar.motor_torque_max),
            ]
        case _:
            words = [
                f"from {_point(drive.ground_point)} to its pin at {_point(drive.pin)}",
                f"handle {number(drive.lock.handle)}, strut {number(drive.lock.strut)}",
                swing,
            ]
            if drive.peak_force is not None:
                words += _load_words(drive.peak_force, drive.peak_torque)
            words.append(f"smallest moment arm {units.value(drive.arm_min, length, 4)}")
    kind = _DRIVES.get(drive.kind, drive.kind) + _row_name(drive)
    count = f"{drive.count} equal drives: " if isinstance(drive, ActuatorDrive) and drive.count > 1 else ""
    sentence = "; ".join([f"{count}{kind} on the {drive.link}", *words])
    return f"{sentence}\n  stops: {drive.stops}\n  holds without power: {drive.holds}"


def _row_name(drive: Drive) -> str:
    return f" ({drive.name})" if isinstance(drive, ActuatorDrive) and drive.name is not None else ""


def _load_words(force: float | None, torque: float | None, peak_force_ratio: float | None = None) -> list[str]:
    """Describe the largest force and torque of a drive."""
    words = []
    if force is not None:
        bound = "" if peak_force_ratio is None else f", {peak_force_ratio:.4g} times the smallest possible"
        words.append(f"force at most {number(force, 5)}{bound}")
    if torque is not None:
        words.append(f"torque at most {number(torque, 5)}")
    return words or ["force unknown without a load"]


def _spring_words(spring: AnySpring, units: Units) -> str:
    """Describe a spring: kind, ends, length, remaining torque, and the behaviour of the linkage without a drive."""
    before, after = spring.torque.before.rms, spring.torque.after.rms
    after = 0.0 if after < _ROUNDING * before else after
    count = f"{spring.count} equal springs: " if spring.count > 1 else ""
    return (
        f"{count}{spring.name or f'{spring.kind} spring'} between {' and '.join(spring.between)}; from "
        f"{_spring_ends(spring, ' to ')}; {_spring_sizes(spring, units)}; rms torque {number(before, 5)} without and "
        f"{number(after, 5)} with it\n  without a drive: {spring.motion_at_ends}"
    )


def _spring_ends(spring: AnySpring, separator: str) -> str:
    points = [spring.point] if isinstance(spring, TorsionSpring) else spring.points
    return separator.join(map(_point, points))


def _spring_sizes(spring: AnySpring, units: Units) -> str:
    if isinstance(spring, TorsionSpring):
        low, high = spring.twist
        return f"rate {spring.rate:.4g}; twist {low:.4g} to {units.value(high, units.angle, 4)}"
    low, high = spring.length
    return f"stiffness {spring.stiffness:.4g}; length {low:.4g} to {units.value(high, units.length, 4)}"


def _drive_lines(best: Solution, units: Units) -> list[str]:
    """Describe the drives and springs of a solution, and the reasons for which a kind is missing."""
    lines = [f"drive of rank 1: {_drive_words(drive, units)}" for drive in best.drives or ()]
    lines += [f"spring of rank 1: {_spring_words(spring, units)}" for spring in best.springs or ()]
    if best.has_drive is False:
        lines.append("Rank 1 has no drive within the limits of `drive`.")
    return lines + [refusal.sentence for refusal in best.refused or ()]


def drives_table(reply: la.Drives, units: Units = DEGREES) -> str:
    """Return a row for each drive and each spring, and the reasons for which a kind is missing."""
    lines = []
    if reply.drives:
        lines.append(
            columns(
                reply.drives,
                ("kind", "", "kind"),
                ("link", "", "link"),
                ("name", "", _field("name")),
                ("ground or motor", "", lambda item: _point(_field("ground_point")(item) or _field("motor")(item))),
                ("pin", "", lambda item: _point(_field("pin")(item))),
                (
                    units.head("length", units.length),
                    "",
                    lambda item: _length(item) if hasattr(item, "length") else "-",
                ),
                ("min. arm", ".6g", _field("arm_min")),
                ("peak force", ".6g", _field("peak_force")),
                ("over bound", ".4g", _field("peak_force_ratio")),
                ("peak torque", ".6g", _field("peak_torque")),
                (units.head("transm.", units.angle), ".4g", _transmission_angle),
            )
        )
    for item in reply.drives:
        if isinstance(item, MotorDrive):
            bar = item.six_bar
            lines.append(
                f"motor on the {item.link}: crank {number(bar.crank)}, rod {number(bar.coupler)}, time ratio "
                f"{number(bar.time_ratio)} ({bar.kind})"
            )
        if isinstance(item, ToggleDrive):
            lines.append(
                f"over-centre latch on the {item.link}: handle {number(item.lock.handle)}, strut {number(item.lock.strut)}; "
                f"holds {item.holds}"
            )
    if reply.springs:
        lines.append(
            columns(
                reply.springs,
                ("spring", "", "kind"),
                ("set", "d", "set"),
                ("name", "", "name"),
                ("between", "", lambda item: "-".join(item.between)),
                ("ends", "", lambda item: _spring_ends(item, " ")),
                ("stiffness", ".6g", lambda item: item.rate if isinstance(item, TorsionSpring) else item.stiffness),
                ("length", "", lambda item: _range(item.twist if isinstance(item, TorsionSpring) else item.length)),
                ("rms torque", "", lambda item: f"{item.torque.before.rms:.4g} -> {item.torque.after.rms:.3g}"),
                ("without drive", "", "motion_at_ends"),
            )
        )
    lines += [refusal.sentence for refusal in reply.refused]
    if not lines:
        lines.append("The request has no drives and no springs.")
    return "\n".join([*lines, *(f"note: {note}" for note in reply.notes)])


def _point(point: Any) -> str:
    return "-" if point is None else f"({point[0]:.5g}, {point[1]:.5g})"


def _range(ends: tuple[float, float]) -> str:
    return f"{number(ends[0])} to {number(ends[1])}"


def _length(drive: Any) -> str:
    return f"{drive.length[0]:.5g} to {drive.length[1]:.5g}"


def _field(name: str) -> Callable[[Drive], Any]:
    """Return a function that reads a field of a drive; None if this kind of drive does not have it."""
    return lambda drive: getattr(drive, name, None)


def _transmission_angle(drive: Drive) -> float | None:
    if isinstance(drive, MotorDrive):
        return drive.six_bar.transmission_angle_min
    return drive.transmission_angle_min if isinstance(drive, RotaryDrive) else None


def assembly_table(reply: la.Assembly, units: Units = DEGREES) -> str:
    """Return a row for each layer from the top down with its parts and pins, the smallest gap and the sizes."""
    ends = (0, reply.count + 1)
    rows = []
    for layer in range(ends[1], ends[0] - 1, -1):
        parts = [
            part.name for part in reply.parts if part.kind in ("plate", "board") and part.layers == (layer, layer)
        ]
        heads = [part.name for part in reply.parts if part.kind == "head" and part.layers == (layer, layer)]
        pins = [pin.name for pin in reply.pins if pin.layers[0] <= layer <= pin.layers[1]]
        if parts or heads or layer not in ends:
            rows.append((str(layer), ", ".join([*parts, *heads]) or "-", " ".join(pins)))
    lines = [f"{reply.status}: {counted(reply.count, 'layer')}", "", left_table(("layer", "parts", "pins"), rows), ""]
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
