"""The parts of a chain's replies that do not depend on the kind of its track: fit, checks, locus, pins."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

from app.query import Angles
from app.scenes.chain_models import (
    ChainSlotRequest,
    ChecksReply,
    FitReply,
    OutlineReply,
    PinsReply,
    PowerPieceReply,
    PowerReply,
    SlotOptions,
    WithoutSlotReply,
)
from linkage_atlas import FieldError, Work

if TYPE_CHECKING:
    from synthesis.chain.angles import Pins
    from synthesis.chain.crescent import Crescent
    from synthesis.chain.fit import Exact, Fit
    from synthesis.chain.report import Report
    from synthesis.chain.slot import Slot

CHECK_PHASES = 9001
"""Phases at which a fit's errors are measured."""
SEGMENT_NAMES = ("left_wheel", "lower_arc", "right_wheel", "upper_arc")
"""Of the crescent, in the order of travel."""
POWER_LOSS = 1e-6
"""Error, in pitches, that the change from a fit to powers may add; beyond it no coefficients are given."""
ROUNDING = 1e-11
"""Missing length, as a share of the track, that rounding alone can make."""
LISTED_PINS = 200_000
"""Pins that one reply lists."""


class PhaseAxis(NamedTuple):
    """How a reply counts the phase: as P1's angle on the left wheel, or as its way along the driving segment."""

    name: str
    unit: float
    """P1's way in one unit of the reply."""


def theta1_axis(request: ChainSlotRequest, crescent: Crescent) -> PhaseAxis:
    """The phase as P1's angle on the left wheel."""
    return PhaseAxis("theta1", crescent.wheel_radius * Angles(request.angle_unit).radian)


POSITION = PhaseAxis("position", 1.0)


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def sample_phases(slot: Slot, samples: int) -> Any:
    """Evenly spaced phases of the window, both ends included."""
    import numpy as np

    return np.linspace(slot.start, slot.end, samples)


def _fit(slot: Slot, request: SlotOptions, axis: PhaseAxis) -> FitReply | None:
    from synthesis.chain.fit import exact_slot, fit_error, fit_slot

    if request.fit is None:
        return None
    fit = fit_slot(slot, request.fit.kind, request.fit.order, sample_phases(slot, request.samples))
    exact = exact_slot(slot, sample_phases(slot, CHECK_PHASES))
    error = fit_error(slot, fit, exact)
    power = _power(slot, request, fit, exact, error.normal, axis)
    data = dict(fit.data)
    if fit.kind == "chebyshev":
        for piece in data["pieces"]:
            piece[axis.name] = [bound / axis.unit for bound in piece.pop("phase")]
    else:
        if fit.kind == "polynomial":
            data["angle"] = Angles(request.angle_unit).outward(data["angle"])
        else:
            data["slope"] *= axis.unit
            data[f"{axis.name}_start"], data["period"] = slot.start / axis.unit, slot.chain.period / axis.unit
        if "phase" in data:
            data[axis.name] = [phase / axis.unit for phase in data.pop("phase")]
        data = {"coefficients": data}
    return FitReply(
        kind=fit.kind,
        order=fit.order,
        unknowns=fit.unknowns,
        condition=fit.condition,
        max_normal=error.normal,
        max_chord=error.chord,
        power=power,
        **data,
    )


def _power(
    slot: Slot, request: SlotOptions, fit: Fit, exact: Exact, normal: float, axis: PhaseAxis
) -> PowerReply | None:
    """The fit by powers; no coefficients where the powers have lost the fit's digits."""
    from synthesis.chain.power import power_basis, power_error

    pieces = power_basis(slot, fit)
    if not pieces or request.fit is None:
        return None
    decimals, error = request.power_decimals, power_error(slot, pieces, exact)
    lost = error > 2 * normal + POWER_LOSS * request.pitch
    if decimals is not None:
        pieces = power_basis(slot, fit, decimals)
        error = power_error(slot, pieces, exact)
    rows = [
        PowerPieceReply(
            x=piece.x.tolist(),
            y=piece.y.tolist(),
            **{axis.name: None if piece.phase is None else [bound / axis.unit for bound in piece.phase]},
        )
        for piece in pieces
    ]
    return PowerReply(pieces=None if lost else rows, max_normal=error, decimals=decimals)


def common_parts(
    slot: Slot, request: SlotOptions, axis: PhaseAxis, work: Work
) -> tuple[Report, dict[str, Any], dict[str, Any]]:
    """The report on a slot, and the fields of reply and locus that do not depend on the kind of track."""
    from synthesis.chain.closure import STRETCH_TOLERANCE
    from synthesis.chain.report import report

    phases = sample_phases(slot, request.samples)
    facts, points = report(slot, phases, work), slot.path(phases)
    work.go_on()
    slack = facts.slack_min > STRETCH_TOLERANCE * request.pitch
    roller = request.roller_radius
    common = {
        "status": "slack" if slack else "closed",
        "pitch": request.pitch,
        "links": slot.chain.links,
        "angle_unit": request.angle_unit,
        "fit": _fit(slot, request, axis),
        "outline": _outline(slot, request),
        "without_slot": WithoutSlotReply(
            chord_error_max=facts.held_chord_error, slack_max=max(facts.slack_max.value, 0.0)
        ),
        "checks": ChecksReply(
            stretched=facts.slack_min < -ROUNDING * slot.chain.track.total,
            missing_length=max(-facts.slack_min, 0.0),
            slack=slack,
            chord_error_max=facts.chord_error,
            single_valued=facts.single_valued,
            roller_radius_max=_finite(facts.radius_min),
            roller_fits=None if roller is None else roller < facts.radius_min,
            clearance=_finite(facts.clearance),
            condition=_finite(facts.condition),
            free_pin_speed=list(facts.free_speed),
        ),
    }
    locus = {
        axis.name: (phases / axis.unit).tolist(),
        "slack": slot.slack(phases).tolist(),
        "xy": [[point.real, point.imag] for point in points.tolist()],
        "free_pin": slot.free,
        "depth_max": facts.depth_max.value,
        "radius_min": _finite(facts.radius_min),
        "end_step": facts.end_step,
    }
    return facts, common, locus


def _outline(slot: Slot, request: SlotOptions) -> OutlineReply | None:
    """The closed contours that are cut, if they are asked for."""
    if "outline" not in request.include:
        return None
    from synthesis.chain.export import contours
    from synthesis.chain.groove import groove

    rows = contours(groove(slot, request.roller_radius))
    return OutlineReply(**{name: rows.get(name) for name in ("path", "left", "right")})


def pins_reply(
    slot: Slot, request: SlotOptions, names: list[str], theta: Callable[[Pins], Any] | None, driver: int = 0
) -> PinsReply | None:
    """All pins at the samples, if they are asked for.

    ``theta(pins)`` gives their angles (rad) where the parts of the track define any; ``names`` are those of the request's
    segments, of which ``driver`` is the track's first.
    """
    if "pins" not in request.include:
        return None
    from synthesis.chain.angles import pins_at

    if request.samples * slot.chain.links > LISTED_PINS:
        most = LISTED_PINS // slot.chain.links
        raise FieldError("/samples", f"with {slot.chain.links} links at most {most} samples list all pins")
    pins = pins_at(slot, sample_phases(slot, request.samples))
    radian = Angles(request.angle_unit).radian
    return PinsReply(
        segments=names,
        xy=[[[point.real, point.imag] for point in row] for row in pins.points.tolist()],
        segment=((pins.segment + driver) % len(names)).tolist(),
        theta=None if theta is None else (theta(pins) / radian).tolist(),
        link_angle=(pins.link_angle / radian).tolist(),
    )


def pin_columns(slot: Slot, request: SlotOptions, theta: Callable[[Pins], Any] | None) -> dict[str, Any]:
    """The same as columns of a table: x and y, the angle if there is one, and the link's direction, pin by pin."""
    if "pins" not in request.include:
        return {}
    from synthesis.chain.angles import pins_at

    pins, unit = pins_at(slot, sample_phases(slot, request.samples)), request.angle_unit
    radian, columns = Angles(unit).radian, {}
    angles = None if theta is None else theta(pins) / radian
    links = pins.link_angle / radian
    for pin in range(slot.chain.links):
        columns |= {f"P{pin + 1}_x": pins.points[:, pin].real, f"P{pin + 1}_y": pins.points[:, pin].imag}
        if angles is not None:
            columns[f"theta{pin + 1}_{unit}"] = angles[:, pin]
        columns[f"link{pin + 1}_{unit}"] = links[:, pin]
    return columns
