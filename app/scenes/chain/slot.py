"""The question about the slot of a constant-pitch chain on a crescent."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from app.query import Angles, Query, Resources
from app.scenes.chain.models import (
    MAX_PINS,
    ChainSlotReply,
    ChainSlotRequest,
    ChecksReply,
    CrossingReply,
    FitReply,
    GeometryReply,
    PieceReply,
    PinsReply,
    SlotReply,
    WithoutSlotReply,
)
from app.terminal import DEGREES, Units
from linkage_atlas import FieldError
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE
from synthesis.scenes.chain.crescent import RIGHT_WHEEL, Crescent, crescent_angles, crescent_slot
from synthesis.scenes.chain.fit import exact_slot, fit_error, fit_slot
from synthesis.scenes.chain.groove import contours, groove, to_csv, to_dxf, to_svg
from synthesis.scenes.chain.slot import Pins, Slot, SlotReport, analyse_slot, pins_at, wheel_conflict

CHECK_PHASES = 9001
"""Number of phases at which the errors of a fit are evaluated."""
SEGMENT_NAMES = ("left_wheel", "lower_arc", "right_wheel", "upper_arc")
"""Names of the segments of a crescent, in the order of travel."""
ROUNDING = 1e-11
"""Largest missing length that rounding errors explain, as a fraction of the track length."""
LISTED_PINS = 200_000
"""Largest number of pins in a reply."""
LONG_SAMPLES = 1000
"""Number of samples above which an answer takes more than a fraction of a second."""


class SlotView(NamedTuple):
    """A slot with its request and the phases of the reply."""

    request: ChainSlotRequest
    crescent: Crescent
    slot: Slot
    phases: Any
    """Evenly spaced phases of the window, both ends included."""

    @property
    def angles(self) -> Angles:
        """Unit of the angles of request and reply."""
        return Angles(self.request.angle_unit)

    @property
    def unit(self) -> float:
        """Distance that P1 travels on the left wheel per unit of theta1."""
        return self.crescent.wheel_radius * self.angles.radian

    def pins(self) -> tuple[Pins, Any, Any] | None:
        """Return all pins at the samples, their angles on the crescent, and the angles of the links; None if not requested."""
        if "pins" not in self.request.include:
            return None
        pins, radian = pins_at(self.slot, self.phases), self.angles.radian
        return pins, crescent_angles(self.crescent, self.slot, pins) / radian, pins.link_angle / radian


def slot_view(request: ChainSlotRequest, resources: Resources) -> SlotView:
    """Compute crescent and slot of a request."""
    if request.samples * request.links > MAX_PINS:
        raise FieldError(
            "/samples", f"must be at most {MAX_PINS // request.links} for a chain of {request.links} links"
        )
    start = request.phase_start
    crescent, slot = crescent_slot(
        request.pitch,
        request.links,
        request.upper_radius,
        request.wheel_radius,
        request.lower_radius,
        request.eccentricity,
        None if start is None else Angles(request.angle_unit).inward(start),
        resources.work(),
    )
    return SlotView(request, crescent, slot, np.linspace(slot.start, slot.end, request.samples))


def answer_slot(request: ChainSlotRequest, resources: Resources) -> ChainSlotReply:
    """Compute the slot of a chain on a crescent."""
    work = resources.work()
    view = slot_view(request, resources)
    slot, crescent, angle = view.slot, view.crescent, view.angles.outward
    facts = analyse_slot(slot, view.phases, work)
    work.go_on()
    wheel, upper, lower = crescent.link_angles(request.pitch)
    theta1 = [crossing.phase / view.unit for crossing in slot.crossings]
    slack = facts.slack_min > STRETCH_TOLERANCE * request.pitch
    outline = contours(groove(slot, request.roller_radius)) if "outline" in request.include else None
    return ChainSlotReply(
        status="slack" if slack else "closed",
        pitch=request.pitch,
        links=request.links,
        angle_unit=request.angle_unit,
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
            phase_start=slot.start / view.unit,
            tangency_residual=crescent.tangency_residual,
            track_length=slot.chain.track.total,
        ),
        events=theta1,
        crossings=[
            CrossingReply(theta1=phase, pin=crossing.pin, to=SEGMENT_NAMES[crossing.segment])
            for phase, crossing in zip(theta1, slot.crossings)
        ],
        slot=SlotReply(
            theta1=(view.phases / view.unit).tolist(),
            xy=[[point.real, point.imag] for point in slot.path(view.phases).tolist()],
            slack=slot.slack(view.phases).tolist(),
            free_pin=slot.free,
            depth_max=facts.depth_max.value,
            radius_min=facts.radius_min,
            end_step=facts.end_step,
            defect_max=angle(facts.slack_max.value / crescent.upper_radius),
            defect_min=angle(facts.slack_min / crescent.upper_radius),
            defect_max_theta1=facts.slack_max.phase / view.unit,
        ),
        fit=_fit(view),
        pins=_pins(view),
        outline=None if outline is None else {"left": None, "right": None, **outline},
        without_slot=WithoutSlotReply(
            chord_error_max=facts.held_chord_error, slack_max=max(facts.slack_max.value, 0.0)
        ),
        checks=_checks(view, facts, slack),
        wheel_phase_conflict=angle(wheel_conflict(slot, RIGHT_WHEEL).value * wheel),
    )


def _checks(view: SlotView, facts: SlotReport, slack: bool) -> ChecksReply:
    roller = view.request.roller_radius
    return ChecksReply(
        stretched=facts.slack_min < -ROUNDING * view.slot.chain.track.total,
        missing_length=max(-facts.slack_min, 0.0),
        slack=slack,
        chord_error_max=facts.chord_error,
        single_valued=facts.single_valued,
        roller_radius_max=facts.radius_min,
        roller_fits=None if roller is None else roller < facts.radius_min,
        clearance=facts.clearance,
    )


def _fit(view: SlotView) -> FitReply | None:
    slot, request = view.slot, view.request
    if request.fit is None:
        return None
    fit = fit_slot(slot, request.fit.order)
    error = fit_error(slot, fit, exact_slot(slot, np.linspace(slot.start, slot.end, CHECK_PHASES)))
    ends = (fit.breaks / view.unit).tolist()
    return FitReply(
        order=request.fit.order,
        unknowns=2 * fit.series.size,
        max_normal=error.normal,
        max_chord=error.chord,
        origin=[fit.origin.real, fit.origin.imag],
        pieces=[
            PieceReply(theta1=[first, last], x=series.real.tolist(), y=series.imag.tolist())
            for series, first, last in zip(fit.series, ends, ends[1:])
        ],
    )


def _pins(view: SlotView) -> PinsReply | None:
    links = view.request.links
    if "pins" in view.request.include and view.request.samples * links > LISTED_PINS:
        message = f"must be at most {LISTED_PINS // links} for a list of all pins of {links} links"
        raise FieldError("/samples", message)
    rows = view.pins()
    if rows is None:
        return None
    pins, theta, link_angle = rows
    return PinsReply(
        segments=SEGMENT_NAMES,
        xy=[[[point.real, point.imag] for point in row] for row in pins.points.tolist()],
        segment=pins.segment.tolist(),
        theta=theta.tolist(),
        link_angle=link_angle.tolist(),
    )


def table_slot(reply: ChainSlotReply, units: Units = DEGREES) -> str:
    """Return the dimensions and checks of the slot."""
    geometry, checks, unit, length = reply.geometry, reply.checks, reply.angle_unit, units.behind(units.length)
    rows = [
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
        ("largest depth", f"{reply.slot.depth_max:.6f}{length}"),
        ("step at the ends", f"{reply.slot.end_step:.3g}{length}"),
    ]
    radius = "straight" if reply.slot.radius_min is None else f"{reply.slot.radius_min:.6g}{length}"
    rows.append(("smallest curvature radius", radius))
    if checks.roller_fits is not None:
        rows.append(("roller", "fits" if checks.roller_fits else "too large for the slot"))
    rows += [
        ("slot is a function y(x)", "yes" if checks.single_valued else "no"),
        ("largest chord error", f"{checks.chord_error_max:.2g}{length}"),
        ("without the slot", f"chords {reply.without_slot.chord_error_max:.6g}{length} too short"),
        ("", f"{reply.without_slot.slack_max:.6g}{length} slack"),
    ]
    if reply.fit is not None:
        fit = reply.fit
        rows.append((f"Chebyshev fit, order {fit.order}", f"{fit.unknowns} numbers"))
        rows.append(("", f"normal error {fit.max_normal:.3g}{length}, chord error {fit.max_chord:.3g}{length}"))
    rows.append(("wheel phase conflict", f"{reply.wheel_phase_conflict:.6g} {unit}"))
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def render_csv(request: ChainSlotRequest, resources: Resources) -> bytes:
    """Return a table of the slot, the walls for a roller and, if requested, all pins."""
    view = slot_view(request, resources)
    unit, columns, rows = request.angle_unit, {}, view.pins()
    if rows is not None:
        pins, theta, link_angle = rows
        for pin in range(request.links):
            columns |= {
                f"P{pin + 1}_x": pins.points[:, pin].real,
                f"P{pin + 1}_y": pins.points[:, pin].imag,
                f"theta{pin + 1}_{unit}": theta[:, pin],
                f"link{pin + 1}_{unit}": link_angle[:, pin],
            }
    return to_csv(view.slot, view.phases, f"theta1_{unit}", view.unit, request.roller_radius, columns).encode()


SLOT = Query(
    command="chain slot",
    summary="Compute the slot that lets a constant-pitch chain run round a crescent of two arcs and two wheels.",
    answer=answer_slot,
    table=table_slot,
    exports={
        "csv": render_csv,
        "svg": lambda request, resources: to_svg(slot_view(request, resources).slot, request.roller_radius).encode(),
        "dxf": lambda request, resources: to_dxf(slot_view(request, resources).slot, request.roller_radius).encode(),
    },
    is_long=lambda request: request.samples > LONG_SAMPLES,
)
