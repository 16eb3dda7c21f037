"""Questions about the slot of a constant-pitch chain on a crescent or on any closed track."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple

import numpy as np

from app.query import (
    Angles,
    Query,
    Resources,
)
from app.scenes.chain.models import (
    MAX_LINKS,
    MAX_PINS,
    ChainSlotReply,
    ChainSlotRequest,
    ChainTrackReply,
    ChainTrackRequest,
    ChecksReply,
    CrossingReply,
    FitReply,
    GeometryReply,
    LineSegment,
    PieceReply,
    PinsReply,
    PowerReply,
    SlotOptions,
    SlotReply,
    TrackCrossingReply,
    TrackSlotReply,
    WithoutSlotReply,
)
from app.terminal import DEGREES, Units
from linkage_atlas import FieldError, Work
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE, Chain, closing_links
from synthesis.scenes.chain.crescent import (
    LEFT_WHEEL,
    RADIUS_RATIO,
    RIGHT_WHEEL,
    UPPER_ARC,
    Crescent,
    crescent_angles,
    crescent_slot,
    critical_stadium,
    driving_segment,
    free_pin_segment,
    stadium,
)
from synthesis.scenes.chain.fit import exact_slot, fit_error, fit_slot, power_basis, power_error
from synthesis.scenes.chain.groove import contours, groove, to_csv, to_dxf, to_svg
from synthesis.scenes.chain.slot import Pins, Slot, SlotReport, analyse_slot, find_slot, pins_at, wheel_conflict
from synthesis.scenes.chain.track import ChordError, Track, arc, line

CHECK_PHASES = 9001
"""Number of phases at which the errors of a fit are evaluated."""
SEGMENT_NAMES = ("left_wheel", "lower_arc", "right_wheel", "upper_arc")
"""Names of the segments of a crescent, in the order of travel."""
POWER_LOSS = 1e-6
"""Largest error, as a fraction of the pitch, that the conversion of a fit to its power form may add."""
ROUNDING = 1e-11
"""Largest missing length that rounding errors explain, as a fraction of the track length."""
LISTED_PINS = 200_000
"""Largest number of pins in a reply."""


class PhaseAxis(NamedTuple):
    """Phase in a reply: the angle of P1 on the left wheel, or the position of P1 along the driving segment."""

    name: str
    """Name of the field of the phase."""
    unit: float
    """Distance that P1 travels per unit of the phase."""


class SlotView(NamedTuple):
    """A slot together with the terms in which its request describes it."""

    slot: Slot
    axis: PhaseAxis
    """Phase of the reply."""
    segments: Sequence[str]
    """Names of the segments in the order of the request."""
    driver: int
    """Index of the driving segment in this order; it is the first segment of the computed track."""
    free: int
    """Index of the segment with the slot in this order."""
    crescent: Crescent | None = None
    """Crescent of the request, or None for a general track."""

    def pins(self, request: SlotOptions) -> tuple[Pins, Any, Any] | None:
        """Return all pins at the samples, their angles on a crescent, and the angles of the links; None if not requested."""
        if "pins" not in request.include:
            return None
        pins, radian = (
            pins_at(self.slot, sample_phases(self.slot, request.samples)),
            Angles(request.angle_unit).radian,
        )
        theta = None if self.crescent is None else crescent_angles(self.crescent, self.slot, pins) / radian
        return pins, theta, pins.link_angle / radian


def sample_phases(slot: Slot, samples: int) -> Any:
    """Return evenly spaced phases of the window, both ends included."""
    return np.linspace(slot.start, slot.end, samples)


def _fit(slot: Slot, request: SlotOptions, axis: PhaseAxis) -> FitReply | None:
    if request.fit is None:
        if request.power_decimals is not None:
            raise FieldError("/power_decimals", "has no effect without a fit; remove it or give a fit")
        return None
    fit = fit_slot(slot, request.fit.order)
    exact = exact_slot(slot, sample_phases(slot, CHECK_PHASES))
    error, ranges = fit_error(slot, fit, exact), (fit.breaks / axis.unit).tolist()

    def pieces(coefficients: Any) -> list[PieceReply]:
        return [
            PieceReply(x=row.real.tolist(), y=row.imag.tolist(), **{axis.name: [first, last]})
            for row, first, last in zip(coefficients, ranges, ranges[1:])
        ]

    powers, decimals = power_basis(fit), request.power_decimals
    power_normal = power_error(fit, powers, exact)
    lost = power_normal > 2 * error.normal + POWER_LOSS * request.pitch
    if decimals is not None:
        powers = power_basis(fit, decimals)
        power_normal = power_error(fit, powers, exact)
    return FitReply(
        order=request.fit.order,
        unknowns=2 * fit.series.size,
        max_normal=error.normal,
        max_chord=error.chord,
        origin=[fit.origin.real, fit.origin.imag],
        pieces=pieces(fit.series),
        power=PowerReply(pieces=None if lost else pieces(powers), max_normal=power_normal, decimals=decimals),
    )


def common_parts(
    view: SlotView, request: SlotOptions, work: Work
) -> tuple[SlotReport, dict[str, Any], dict[str, Any]]:
    """Return the report on a slot, and the fields of reply and locus that all kinds of track have."""
    slot, axis = view.slot, view.axis
    phases = sample_phases(slot, request.samples)
    facts, points = analyse_slot(slot, phases, work), slot.path(phases)
    work.go_on()
    slack = facts.slack_min > STRETCH_TOLERANCE * request.pitch
    roller = request.roller_radius
    common = {
        "status": "slack" if slack else "closed",
        "pitch": request.pitch,
        "links": slot.chain.links,
        "angle_unit": request.angle_unit,
        "fit": _fit(slot, request, axis),
        "pins": _pins(view, request),
        "outline": {"left": None, "right": None, **contours(groove(slot, request.roller_radius))}
        if "outline" in request.include
        else None,
        "without_slot": WithoutSlotReply(
            chord_error_max=facts.held_chord_error, slack_max=max(facts.slack_max.value, 0.0)
        ),
        "checks": ChecksReply(
            stretched=facts.slack_min < -ROUNDING * slot.chain.track.total,
            missing_length=max(-facts.slack_min, 0.0),
            slack=slack,
            chord_error_max=facts.chord_error,
            single_valued=facts.single_valued,
            roller_radius_max=facts.radius_min,
            roller_fits=None if roller is None else roller < facts.radius_min,
            clearance=facts.clearance,
            condition=facts.condition,
            free_pin_speed=list(facts.free_speed),
        ),
    }
    locus = {
        axis.name: (phases / axis.unit).tolist(),
        "slack": slot.slack(phases).tolist(),
        "xy": [[point.real, point.imag] for point in points.tolist()],
        "free_pin": slot.free,
        "depth_max": facts.depth_max.value,
        "radius_min": facts.radius_min,
        "end_step": facts.end_step,
    }
    return facts, common, locus


def _pins(view: SlotView, request: SlotOptions) -> PinsReply | None:
    links = view.slot.chain.links
    if "pins" in request.include and request.samples * links > LISTED_PINS:
        message = f"must be at most {LISTED_PINS // links} for a list of all pins of {links} links"
        raise FieldError("/samples", message)
    rows = view.pins(request)
    if rows is None:
        return None
    pins, theta, link_angle = rows
    return PinsReply(
        segments=view.segments,
        xy=[[[point.real, point.imag] for point in row] for row in pins.points.tolist()],
        segment=((pins.segment + view.driver) % len(view.segments)).tolist(),
        theta=None if theta is None else theta.tolist(),
        link_angle=link_angle.tolist(),
    )


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
        rows.append((f"Chebyshev fit, order {fit.order}", f"{fit.unknowns} numbers"))
        rows.append(("", f"normal error {fit.max_normal:.3g}{length}, chord error {fit.max_chord:.3g}{length}"))
    return rows


def table_slot(reply: ChainSlotReply, units: Units = DEGREES) -> str:
    """Return the dimensions and checks of the slot of a crescent."""
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
    """Return the dimensions and checks of the slot of a general track."""
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


LONG_SAMPLES = 1000
"""Number of samples above which an answer takes more than a fraction of a second."""


def _check_size(request: SlotOptions, links: int) -> None:
    if request.samples * links > MAX_PINS:
        raise FieldError("/samples", f"must be at most {MAX_PINS // links} for a chain of {links} links")


def is_long(request: SlotOptions) -> bool:
    """Check if an answer may take more than a fraction of a second."""
    return request.samples > LONG_SAMPLES


def _crescent(request: ChainSlotRequest, work: Work) -> SlotView:
    _check_size(request, request.links)
    angles, start = Angles(request.angle_unit), request.phase_start
    crescent, slot = crescent_slot(
        request.pitch,
        request.links,
        request.upper_radius,
        request.wheel_radius,
        request.lower_radius,
        request.eccentricity,
        None if start is None else angles.inward(start),
        work,
    )
    axis = PhaseAxis("theta1", crescent.wheel_radius * angles.radian)
    return SlotView(slot, axis, SEGMENT_NAMES, LEFT_WHEEL, UPPER_ARC, crescent)


def answer_slot(request: ChainSlotRequest, resources: Resources) -> ChainSlotReply:
    """Compute the slot of a chain on a crescent."""
    work = resources.work()
    view = _crescent(request, work)
    slot, axis, crescent, angle = view.slot, view.axis, view.crescent, Angles(request.angle_unit).outward
    facts, common, locus = common_parts(view, request, work)
    wheel, upper, lower = crescent.link_angles(request.pitch)
    theta1 = [crossing.phase / axis.unit for crossing in slot.crossings]
    return ChainSlotReply(
        **common,
        geometry=GeometryReply(
            wheel_radius=crescent.wheel_radius,
            upper_radius=crescent.upper_radius,
            lower_radius=crescent.lower_radius,
            eccentricity=crescent.eccentricity,
            xi=angle(crescent.xi),
            alpha=angle(crescent.alpha),
            epsilon=angle(crescent.eps),
            delta_wheel=angle(wheel),
            delta_upper=angle(upper),
            delta_lower=angle(lower),
            phase_start=slot.start / axis.unit,
            tangency_residual=crescent.tangency_residual,
            track_length=slot.chain.track.total,
        ),
        events=theta1,
        crossings=[
            CrossingReply(theta1=phase, pin=crossing.pin, to=SEGMENT_NAMES[crossing.segment])
            for phase, crossing in zip(theta1, slot.crossings)
        ],
        slot=SlotReply(
            **locus,
            defect_max=angle(facts.slack_max.value / crescent.upper_radius),
            defect_min=angle(facts.slack_min / crescent.upper_radius),
            defect_max_theta1=facts.slack_max.phase / axis.unit,
        ),
        wheel_phase_conflict=angle(wheel_conflict(slot, RIGHT_WHEEL).value * wheel),
    )


def _track(request: ChainTrackRequest, work: Work) -> Track:
    if (request.stadium is None) == (request.segments is None):
        raise FieldError("/segments", "give either segments or stadium, but not both")
    if request.stadium is not None:
        if request.stadium.straight is not None:
            return stadium(request.stadium.radius, request.stadium.straight)
        if request.links is None:
            raise FieldError("/links", "required to compute the critical length of a stadium; give links or straight")
        return critical_stadium(request.pitch, request.links, request.stadium.radius, work)
    rows, unit = [], Angles(request.angle_unit).radian
    for index, part in enumerate(request.segments or ()):
        if isinstance(part, LineSegment):
            rows.append(line(*part.start, *part.end))
        elif not 0 < abs(part.sweep * unit) <= 2 * pi * (1 + 1e-12):
            raise FieldError(f"/segments/{index}/sweep", "must be nonzero and at most a full turn in size")
        else:
            rows.append(arc(*part.centre, part.radius, part.start_angle * unit, part.sweep * unit))
    return Track(rows)


def _on_track(request: ChainTrackRequest, work: Work) -> SlotView:
    if request.links is not None:
        _check_size(request, request.links)
    track = _track(request, work)
    if track.total > RADIUS_RATIO * request.pitch:
        raise FieldError(
            "/pitch",
            f"the track must be at most {RADIUS_RATIO:.0e} pitches long; it is {track.total / request.pitch:.6g} long",
        )
    for name in ("driver_segment", "free_segment"):
        chosen = getattr(request, name)
        if chosen is not None and chosen >= track.count:
            raise FieldError(f"/{name}", f"must be an index from 0 to {track.count - 1} of a segment; it is {chosen}")
    driver = request.driver_segment
    driver = driving_segment(track, request.pitch) if driver is None else driver
    if not track.link_lengths(request.pitch)[driver] <= track.length[driver]:
        raise FieldError(
            "/driver_segment", "the driving segment must be long enough for a link; choose a longer segment"
        )
    free = request.free_segment
    free = free_pin_segment(track, request.pitch, driver) if free is None else free
    rotated = track.starting_at(driver)
    links = request.links
    if links is None:
        try:
            links = closing_links(rotated, request.pitch, work)
        except ChordError as error:
            raise FieldError("/pitch", error.message, constraint=error.fault.name.lower()) from None
        if not 3 <= links <= MAX_LINKS:
            message = f"this track requires a chain of {links} links; the number must be from 3 to {MAX_LINKS}"
            raise FieldError("/links", message)
        _check_size(request, links)
    index = (free - driver) % track.count
    middle = float(rotated.joints[index] + 0.5 * rotated.length[index])
    side = 1 if request.side == "left" else -1
    slot = find_slot(Chain(rotated, request.pitch, links), middle, side, work=work)
    return SlotView(slot, PhaseAxis("position", 1.0), [f"segment {k}" for k in range(track.count)], driver, free)


def answer_track(request: ChainTrackRequest, resources: Resources) -> ChainTrackReply:
    """Compute the slot of a chain on a general track."""
    work = resources.work()
    view = _on_track(request, work)
    facts, common, locus = common_parts(view, request, work)
    slot, driver = view.slot, view.driver
    track = slot.chain.track
    straight = None
    if request.stadium is not None:
        straight = max(segment.length for segment in track.segments if segment.curvature == 0)
    return ChainTrackReply(
        **common,
        track_length=track.total,
        straight=straight,
        driver_segment=driver,
        free_segment=view.free,
        replaced_segments=[(segment + driver) % track.count for segment, _ in slot.base],
        position_start=slot.start,
        crossings=[
            TrackCrossingReply(
                position=crossing.phase, pin=crossing.pin, to_segment=(crossing.segment + driver) % track.count
            )
            for crossing in slot.crossings
        ],
        slot=TrackSlotReply(**locus, slack_max=facts.slack_max.value, slack_min=facts.slack_min),
    )


def _view(request: Any, resources: Resources) -> SlotView:
    compute = _crescent if isinstance(request, ChainSlotRequest) else _on_track
    return compute(request, resources.work())


def render_csv(request: Any, resources: Resources) -> bytes:
    """Return a table of the slot, the walls for a roller and, if requested, all pins."""
    view = _view(request, resources)
    phases, unit = sample_phases(view.slot, request.samples), request.angle_unit
    columns, rows = {}, view.pins(request)
    if rows is not None:
        pins, theta, link_angle = rows
        for pin in range(view.slot.chain.links):
            columns |= {f"P{pin + 1}_x": pins.points[:, pin].real, f"P{pin + 1}_y": pins.points[:, pin].imag}
            if theta is not None:
                columns[f"theta{pin + 1}_{unit}"] = theta[:, pin]
            columns[f"link{pin + 1}_{unit}"] = link_angle[:, pin]
    name = view.axis.name if view.crescent is None else f"theta1_{unit}"
    return to_csv(view.slot, phases, name, view.axis.unit, request.roller_radius, columns).encode()


EXPORTS = {
    "csv": render_csv,
    "svg": lambda request, resources: to_svg(_view(request, resources).slot, request.roller_radius).encode(),
    "dxf": lambda request, resources: to_dxf(_view(request, resources).slot, request.roller_radius).encode(),
}
SLOT = Query(
    command="chain slot",
    summary="Compute the slot that lets a constant-pitch chain run round a crescent of two arcs and two wheels.",
    answer=answer_slot,
    table=table_slot,
    exports=EXPORTS,
    is_long=is_long,
)
TRACK = Query(
    command="chain track",
    summary="Compute the slot of a constant-pitch chain on any closed track of tangent arcs and lines.",
    answer=answer_track,
    table=table_track,
    exports=EXPORTS,
    is_long=is_long,
)
