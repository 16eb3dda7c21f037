"""The question about the slot of a constant-pitch chain on a crescent."""

from __future__ import annotations

from typing import Any, NamedTuple, get_args

import numpy as np

from app.query import Angles, Query, Resources
from app.scenes.chain.models import (
    MAX_PINS,
    ChainSlotReply,
    ChainSlotRequest,
    ChecksReply,
    CrossingReply,
    GeometryReply,
    OutlineReply,
    PinsReply,
    Segment,
    SlotReply,
)
from app.terminal import DEGREES, Units
from linkage_atlas import FieldError
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE
from synthesis.scenes.chain.crescent import Crescent, Dimensions
from synthesis.scenes.chain.groove import contours, roller_walls, to_dxf, to_svg
from synthesis.scenes.chain.slot import Slot, analyse_slot, crescent_slot, pins_at, wheel_conflict
from synthesis.sheet import csv_text

SEGMENT_NAMES = get_args(Segment)
"""Names of the segments of a crescent, in the order of travel."""
NOT_DIMENSIONS = ("phase_start", "samples", "roller_radius", "include", "angle_unit")
"""Fields of a request that are not among `Dimensions`."""
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


def slot_view(request: ChainSlotRequest, resources: Resources) -> SlotView:
    """Compute crescent and slot of a request."""
    if request.samples * request.links > MAX_PINS:
        message = f"must be at most {MAX_PINS // request.links} for a chain of {request.links} links"
        raise FieldError("/samples", message)
    start, dimensions = request.phase_start, Dimensions(**request.arguments(exclude=NOT_DIMENSIONS))
    angle = None if start is None else Angles(request.angle_unit).inward(start)
    crescent, slot = crescent_slot(dimensions, angle, resources.work())
    return SlotView(request, crescent, slot, slot.phases(request.samples))


def answer_slot(request: ChainSlotRequest, resources: Resources) -> ChainSlotReply:
    """Compute the slot of a chain on a crescent."""
    work, view = resources.work(), slot_view(request, resources)
    slot, crescent, angle, unit = view.slot, view.crescent, view.angles.outward, view.unit
    facts = analyse_slot(slot, view.phases, work)
    work.go_on()
    wheel, upper, lower = crescent.link_angles(request.pitch)
    roller, include = request.roller_radius, request.include
    return ChainSlotReply(
        status="slack" if facts.slack_min > STRETCH_TOLERANCE * request.pitch else "closed",
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
            phase_start=slot.start / unit,
            tangency_residual=crescent.tangency_residual,
            track_length=slot.chain.track.total,
        ),
        crossings=[
            CrossingReply(theta1=crossing.phase / unit, pin=crossing.pin, to=SEGMENT_NAMES[crossing.segment])
            for crossing in slot.crossings
        ],
        slot=SlotReply(
            theta1=(view.phases / unit).tolist(),
            xy=[[point.real, point.imag] for point in slot.path(view.phases).tolist()],
            slack=slot.slack(view.phases).tolist(),
            free_pin=slot.free,
            depth_max=facts.depth_max,
            radius_min=facts.radius_min,
            end_step=facts.end_step,
            slack_max=max(facts.slack_max.value, 0.0),
            defect_max=angle(facts.slack_max.value / crescent.upper_radius),
            defect_min=angle(facts.slack_min / crescent.upper_radius),
            defect_max_theta1=facts.slack_max.phase / unit,
        ),
        pins=_pins(view) if "pins" in include else None,
        outline=OutlineReply(**contours(slot, roller)) if "outline" in include else None,
        checks=ChecksReply(
            missing_length=max(-facts.slack_min, 0.0),
            chord_error_max=facts.chord_error,
            roller_fits=None if roller is None else roller < facts.radius_min,
            clearance=facts.clearance,
        ),
        wheel_phase_conflict=angle(wheel_conflict(slot) * wheel),
    )


def _pins(view: SlotView) -> PinsReply:
    pins = pins_at(view.crescent, view.slot, view.phases)
    return PinsReply(
        segments=SEGMENT_NAMES,
        xy=np.stack([pins.points.real, pins.points.imag], axis=-1).tolist(),
        segment=pins.segment.tolist(),
        theta=(pins.theta / view.angles.radian).tolist(),
    )


def table_slot(reply: ChainSlotReply, units: Units = DEGREES) -> str:
    """Return the dimensions and checks of the slot."""
    geometry, slot, unit, length = reply.geometry, reply.slot, reply.angle_unit, units.behind(units.length)
    rows = {
        "status": reply.status,
        "links, pitch": f"{reply.links}, {reply.pitch:g}{length}",
        "wheel radius R0": f"{geometry.wheel_radius:.6f}{length}",
        "upper radius R1": f"{geometry.upper_radius:.6f}{length}",
        "lower radius R2": f"{geometry.lower_radius:.6f}{length}",
        "eccentricity b": f"{geometry.eccentricity:.6f}{length}",
        "xi, alpha": f"{geometry.xi:.6f}, {geometry.alpha:.6f} {unit}",
        "window of theta1": f"{geometry.phase_start:.6f} + {geometry.delta_wheel:.6f} {unit}",
        "joint crossings": ", ".join(f"{crossing.theta1:.4f}" for crossing in reply.crossings) + f" {unit}",
        "free pin": f"P{slot.free_pin}",
        "closure defect": f"{slot.defect_min:.3g} .. {slot.defect_max:.6f} {unit}",
        "largest depth": f"{slot.depth_max:.6f}{length}",
        "step at the ends": f"{slot.end_step:.3g}{length}",
        "smallest curvature radius": f"{slot.radius_min:.6g}{length}",
        "roller": {None: "none", True: "fits", False: "too large for the slot"}[reply.checks.roller_fits],
        "largest chord error": f"{reply.checks.chord_error_max:.2g}{length}",
        "slack without the slot": f"{slot.slack_max:.6g}{length}",
        "wheel phase conflict": f"{reply.wheel_phase_conflict:.6g} {unit}",
    }
    width = max(map(len, rows))
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows.items())


def render_csv(request: ChainSlotRequest, resources: Resources) -> bytes:
    """Return a table of the slot, the walls for a roller and, if requested, all pins."""
    view = slot_view(request, resources)
    slot, phases, unit = view.slot, view.phases, request.angle_unit
    path = slot.path(phases)
    columns = {f"theta1_{unit}": phases / view.unit, "x": path.real, "y": path.imag}
    columns |= {"depth": slot.depth(phases), "slack": slot.slack(phases)}
    if request.roller_radius is not None:
        for name, wall in roller_walls(slot, phases, request.roller_radius).items():
            columns |= {f"{name}_x": wall.real, f"{name}_y": wall.imag}
    if "pins" in request.include:
        pins = pins_at(view.crescent, slot, phases)
        for pin, (points, theta) in enumerate(zip(pins.points.T, pins.theta.T), 1):
            columns |= {f"P{pin}_x": points.real, f"P{pin}_y": points.imag}
            columns[f"theta{pin}_{unit}"] = theta / view.angles.radian
    return csv_text(columns).encode()


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
