"""The chain's replies as text for a terminal."""

from __future__ import annotations

from app.scenes.chain_models import ChainSlotReply, ChainTrackReply
from app.tables import DEGREES, Units


def _rows(rows: list[tuple[str, str]]) -> str:
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def _shared_rows(reply: ChainSlotReply | ChainTrackReply, length: str) -> list[tuple[str, str]]:
    checks = reply.checks
    rows = [
        ("largest depth", f"{reply.slot.depth_max:.6f}{length}"),
        ("step at the ends", f"{reply.slot.end_step:.3g}{length}"),
    ]
    radius = "straight" if reply.slot.radius_min is None else f"{reply.slot.radius_min:.6g}{length}"
    rows.append(("smallest curvature radius", radius))
    if checks.roller_fits is not None:
        rows.append(("roller", "fits" if checks.roller_fits else "too large for the slot"))
    rows.append(("slot is a function y(x)", "yes" if checks.single_valued else "no"))
    rows.append(("largest chord error", f"{checks.chord_error_max:.2g}{length}"))
    rows.append(("without the slot", f"chords {reply.without_slot.chord_error_max:.6g}{length} too short"))
    rows.append(("", f"{reply.without_slot.slack_max:.6g}{length} slack"))
    if reply.fit is not None:
        fit = reply.fit
        rows.append((f"{fit.kind} fit, order {fit.order}", f"{fit.unknowns} numbers"))
        rows.append(("", f"normal error {fit.max_normal:.3g}{length}, chord error {fit.max_chord:.3g}{length}"))
    return rows


def table_slot(reply: ChainSlotReply, units: Units = DEGREES) -> str:
    """The crescent as text."""
    geometry, unit, length = reply.geometry, reply.angle_unit, units.behind(units.length)
    return _rows(
        [
            ("status", reply.status),
            ("links, pitch", f"{reply.links}, {reply.pitch:g}{length}"),
            ("wheel radius R0", f"{geometry.wheel_radius:.6f}{length}"),
            ("upper radius R1", f"{geometry.upper_radius:.6f}{length}"),
            ("lower radius R2", f"{geometry.lower_radius:.6f}{length}"),
            ("eccentricity b", f"{geometry.eccentricity:.6f}{length}"),
            ("xi, alpha", f"{geometry.xi:.6f}, {geometry.alpha:.6f} {unit}"),
            ("window of theta1", f"{geometry.phase_start:.6f} + {geometry.delta_wheel:.6f} {unit}"),
            ("joint crossings", ", ".join(f"{event:.4f}" for event in reply.events) + f" {unit}"),
            ("free pin", f"P{reply.slot.free_pin}"),
            ("closure defect", f"{reply.slot.defect_min:.3g} .. {reply.slot.defect_max:.6f} {unit}"),
            *_shared_rows(reply, length),
            ("wheel phase conflict", f"{reply.wheel_phase_conflict:.6g} {unit}"),
        ]
    )


def table_track(reply: ChainTrackReply, units: Units = DEGREES) -> str:
    """The slot of any track as text."""
    length = units.behind(units.length)
    rows = [
        ("status", reply.status),
        ("links, pitch", f"{reply.links}, {reply.pitch:g}{length}"),
        ("track length", f"{reply.track_length:.6f}{length}"),
        ("free pin", f"P{reply.slot.free_pin} on segment {reply.free_segment}"),
        ("slack", f"{reply.slot.slack_min:.3g} .. {reply.slot.slack_max:.6g}{length}"),
        *_shared_rows(reply, length),
    ]
    if reply.straight is not None:
        rows.insert(3, ("straight", f"{reply.straight:.6f}{length}"))
    return _rows(rows)
