"""The chain's replies as text for a terminal."""

from __future__ import annotations

from app.scenes.chain_models import ChainSlotReply, ChainTrackReply


def _rows(rows: list[tuple[str, str]]) -> str:
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def _shared_rows(reply: ChainSlotReply | ChainTrackReply) -> list[tuple[str, str]]:
    checks = reply.checks
    rows = [("largest depth", f"{reply.slot.depth_max:.6f}"), ("step at the ends", f"{reply.slot.end_step:.3g}")]
    radius = "straight" if reply.slot.radius_min is None else f"{reply.slot.radius_min:.6g}"
    rows.append(("smallest curvature radius", radius))
    if checks.roller_fits is not None:
        rows.append(("roller", "fits" if checks.roller_fits else "too large for the slot"))
    rows.append(("slot is a function y(x)", "yes" if checks.single_valued else "no"))
    rows.append(("largest chord error", f"{checks.chord_error_max:.2g}"))
    rows.append(("without the slot", f"chords {reply.without_slot.chord_error_max:.6g} too short"))
    rows.append(("", f"{reply.without_slot.slack_max:.6g} slack"))
    if reply.fit is not None:
        fit = reply.fit
        rows.append((f"{fit.kind} fit, order {fit.order}", f"{fit.unknowns} numbers"))
        rows.append(("", f"normal error {fit.max_normal:.3g}, chord error {fit.max_chord:.3g}"))
    return rows


def table_slot(reply: ChainSlotReply) -> str:
    """The crescent as text."""
    geometry, unit = reply.geometry, reply.angle_unit
    return _rows(
        [
            ("status", reply.status),
            ("links, pitch", f"{reply.links}, {reply.pitch:g}"),
            ("wheel radius R0", f"{geometry.wheel_radius:.6f}"),
            ("upper radius R1", f"{geometry.upper_radius:.6f}"),
            ("lower radius R2", f"{geometry.lower_radius:.6f}"),
            ("eccentricity b", f"{geometry.eccentricity:.6f}"),
            ("xi, alpha", f"{geometry.xi:.6f}, {geometry.alpha:.6f} {unit}"),
            ("window of theta1", f"{geometry.phase_start:.6f} + {geometry.delta_wheel:.6f} {unit}"),
            ("joint crossings", ", ".join(f"{event:.4f}" for event in reply.events)),
            ("free pin", f"P{reply.slot.free_pin}"),
            ("closure defect", f"{reply.slot.defect_min:.3g} .. {reply.slot.defect_max:.6f} {unit}"),
            *_shared_rows(reply),
            ("wheel phase conflict", f"{reply.wheel_phase_conflict:.6g} {unit}"),
        ]
    )


def table_track(reply: ChainTrackReply) -> str:
    """The slot of any track as text."""
    rows = [
        ("status", reply.status),
        ("links, pitch", f"{reply.links}, {reply.pitch:g}"),
        ("track length", f"{reply.track_length:.6f}"),
        ("free pin", f"P{reply.slot.free_pin} on segment {reply.free_segment}"),
        ("slack", f"{reply.slot.slack_min:.3g} .. {reply.slot.slack_max:.6g}"),
        *_shared_rows(reply),
    ]
    if reply.straight is not None:
        rows.insert(3, ("straight", f"{reply.straight:.6f}"))
    return _rows(rows)
