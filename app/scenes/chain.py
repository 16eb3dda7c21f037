"""The chain over HTTP and on the command line: answers made from `synthesis.chain.crescent`."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import TYPE_CHECKING, Any

from app.query import Angles, Export, Query, Resources
from app.scenes.chain_models import (
    MAX_LINKS,
    MAX_PINS,
    ChainSlotReply,
    ChainSlotRequest,
    ChainTrackReply,
    ChainTrackRequest,
    CrossingReply,
    GeometryReply,
    LineSegment,
    SlotOptions,
    SlotReply,
    TrackCrossingReply,
    TrackSlotReply,
)
from app.scenes.chain_replies import (
    POSITION,
    SEGMENT_NAMES,
    PhaseAxis,
    common_parts,
    pin_columns,
    pins_reply,
    sample_phases,
    theta1_axis,
)
from app.scenes.chain_text import table_slot, table_track
from app.scenes.chain_tolerance import TOLERANCE
from linkage_atlas import FieldError, Work

if TYPE_CHECKING:
    from synthesis.chain.angles import Pins
    from synthesis.chain.crescent import Crescent
    from synthesis.chain.slot import Slot
    from synthesis.chain.track import Track

LONG_SAMPLES = 1000


def _check_size(request: SlotOptions, links: int) -> None:
    if request.samples * links > MAX_PINS:
        most = MAX_PINS // links
        raise FieldError("/samples", f"with {links} links at most {most} samples are computed in one request")


def is_long(request: SlotOptions) -> bool:
    """Whether an answer may take more than a fraction of a second."""
    return request.samples > LONG_SAMPLES or (request.fit is not None and request.fit.order > LONG_SAMPLES)


def _crescent(request: ChainSlotRequest, work: Work) -> tuple[Crescent, Slot]:
    from synthesis.chain.crescent import crescent_slot

    _check_size(request, request.links)
    start = request.phase_start
    return crescent_slot(
        request.pitch,
        request.links,
        request.upper_radius,
        request.wheel_radius,
        request.lower_radius,
        request.eccentricity,
        None if start is None else Angles(request.angle_unit).inward(start),
        work,
    )


def _theta(crescent: Crescent, slot: Slot) -> Callable[[Pins], Any]:
    """The pins' angles as the source counts them, rad."""
    from synthesis.chain.angles import crescent_angles

    return lambda pins: crescent_angles(crescent, slot, pins)


def answer_slot(request: ChainSlotRequest, resources: Resources) -> ChainSlotReply:
    """The crescent's closure and slot."""
    from synthesis.chain.crescent import RIGHT_WHEEL
    from synthesis.chain.report import wheel_conflict

    work = resources.work()
    crescent, slot = _crescent(request, work)
    angle, axis = Angles(request.angle_unit).outward, theta1_axis(request, crescent)
    facts, common, locus = common_parts(slot, request, axis, work)
    wheel, upper, lower = crescent.link_angles(request.pitch)
    theta1 = [crossing.phase / axis.unit for crossing in slot.crossings]
    return ChainSlotReply(
        **common,
        pins=pins_reply(slot, request, list(SEGMENT_NAMES), _theta(crescent, slot)),
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
            CrossingReply(theta1=at, pin=crossing.pin, to=SEGMENT_NAMES[crossing.segment])
            for at, crossing in zip(theta1, slot.crossings)
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
    from synthesis.chain.crescent import critical_stadium, stadium
    from synthesis.chain.track import Track, arc, line

    if (request.stadium is None) == (request.segments is None):
        raise FieldError("/segments", "either 'segments' or 'stadium' is wanted, and not both")
    if request.stadium is not None:
        if request.stadium.straight is not None:
            return stadium(request.stadium.radius, request.stadium.straight)
        if request.links is None:
            raise FieldError("/links", "the critical straight of a stadium needs the number of links")
        return critical_stadium(request.pitch, request.links, request.stadium.radius, work)
    rows, unit = [], Angles(request.angle_unit).radian
    for index, part in enumerate(request.segments or ()):
        if isinstance(part, LineSegment):
            rows.append(line(*part.start, *part.end))
        elif not 0 < abs(part.sweep * unit) <= 2 * pi * (1 + 1e-12):
            raise FieldError(f"/segments/{index}/sweep", "an arc turns by more than 0 and at most once round")
        else:
            rows.append(arc(*part.centre, part.radius, part.start_angle * unit, part.sweep * unit))
    return Track(rows)


def _track_slot(request: ChainTrackRequest, work: Work) -> tuple[Slot, int, int]:
    """The slot, and the driving and the free segment in the request's own numbering."""
    from synthesis.chain.closure import Chain, closing_links
    from synthesis.chain.crescent import RADIUS_RATIO, driving_segment, tightest_room
    from synthesis.chain.errors import ChordError
    from synthesis.chain.slot import find_slot

    if request.links is not None:
        _check_size(request, request.links)
    track = _track(request, work)
    if track.total > RADIUS_RATIO * request.pitch:
        raise FieldError(
            "/pitch",
            f"the track may be at most {RADIUS_RATIO:.0e} pitches long, found {track.total / request.pitch:.6g}",
        )
    for name in ("driver_segment", "free_segment"):
        chosen = getattr(request, name)
        if chosen is not None and chosen >= track.count:
            raise FieldError(f"/{name}", f"the track has {track.count} segments, numbered from 0; found {chosen}")
    driver = request.driver_segment
    driver = driving_segment(track, request.pitch) if driver is None else driver
    if not track.link_lengths(request.pitch)[driver] <= track.length[driver]:
        raise FieldError("/driver_segment", "the driving segment must be long enough for one link")
    free = request.free_segment
    free = tightest_room(track, request.pitch, driver) if free is None else free
    turned = track.starting_at(driver)
    links = request.links
    if links is None:
        try:
            links = closing_links(turned, request.pitch, work)
        except ChordError as error:
            raise FieldError("/pitch", error.message, constraint=error.fault.name.lower()) from None
        if not 3 <= links <= MAX_LINKS:
            raise FieldError("/links", f"{links} links close; between 3 and {MAX_LINKS} are computed")
        _check_size(request, links)
    index = (free - driver) % track.count
    middle = float(turned.joints[index] + 0.5 * turned.length[index])
    side = 1 if request.side == "left" else -1
    return find_slot(Chain(turned, request.pitch, links), middle, side, work=work), driver, free


def answer_track(request: ChainTrackRequest, resources: Resources) -> ChainTrackReply:
    """Closure and slot on any track."""
    work = resources.work()
    slot, driver, free = _track_slot(request, work)
    facts, common, locus = common_parts(slot, request, POSITION, work)
    track = slot.chain.track
    names = [f"segment {index}" for index in range(track.count)]
    straight = None
    if request.stadium is not None:
        straight = max(segment.length for segment in track.segments if segment.curvature == 0)
    return ChainTrackReply(
        **common,
        pins=pins_reply(slot, request, names, None, driver),
        track_length=track.total,
        straight=straight,
        driver_segment=driver,
        free_segment=free,
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


def _slot_of(request: Any, resources: Resources) -> tuple[Slot, PhaseAxis, Callable[[Pins], Any] | None]:
    """The slot of either request, how its phase is counted, and the angles of its pins."""
    if isinstance(request, ChainSlotRequest):
        crescent, slot = _crescent(request, resources.work())
        axis = theta1_axis(request, crescent)._replace(name=f"theta1_{request.angle_unit}")
        return slot, axis, _theta(crescent, slot)
    return _track_slot(request, resources.work())[0], POSITION, None


def render_csv(request: Any, resources: Resources) -> bytes:
    """The slot, a roller's walls and, if asked for, all pins as a table."""
    from synthesis.chain.export import to_csv

    slot, axis, theta = _slot_of(request, resources)
    more = pin_columns(slot, request, theta)
    return to_csv(slot, sample_phases(slot, request.samples), *axis, request.roller_radius, more).encode()


def render_svg(request: Any, resources: Resources) -> bytes:
    """Track, pins, slot and the groove of a roller as a drawing."""
    from synthesis.chain.export import to_svg

    return to_svg(_slot_of(request, resources)[0], request.roller_radius).encode()


def render_dxf(request: Any, resources: Resources) -> bytes:
    """The whole groove as closed contours, for CAD."""
    from synthesis.chain.export import to_dxf

    return to_dxf(_slot_of(request, resources)[0], request.roller_radius).encode()


EXPORTS = {
    "csv": Export("text/csv; charset=utf-8", render_csv),
    "svg": Export("image/svg+xml", render_svg),
    "dxf": Export("image/vnd.dxf", render_dxf),
}

QUERIES = (
    Query(
        path="/v1/chain/slot",
        command="chain slot",
        summary="The slot that lets a constant-pitch chain run round a crescent of two arcs and two wheels.",
        request=ChainSlotRequest,
        reply=ChainSlotReply,
        answer=answer_slot,
        table=table_slot,
        shows_units=True,
        examples={
            "published": {"pitch": 131, "links": 16, "upper_radius": 181.78, "samples": 91},
            "as-printed": {
                "pitch": 131,
                "links": 16,
                "upper_radius": 181.78,
                "wheel_radius": 92.63,
                "lower_radius": 381.5,
                "eccentricity": 90.22,
                "fit": {"kind": "polynomial", "order": 8},
            },
            "roller": {
                "pitch": 131,
                "links": 16,
                "upper_radius": 181.78,
                "roller_radius": 20,
                "include": ["outline"],
            },
            "pins": {"pitch": 131, "links": 16, "upper_radius": 181.78, "samples": 19, "include": ["pins"]},
        },
        exports=EXPORTS,
        is_long=is_long,
    ),
    Query(
        path="/v1/chain/track",
        command="chain track",
        summary="The slot of a constant-pitch chain on any closed track of tangent arcs and lines.",
        request=ChainTrackRequest,
        reply=ChainTrackReply,
        answer=answer_track,
        table=table_track,
        shows_units=True,
        examples={
            "stadium": {"pitch": 50, "links": 16, "stadium": {"radius": 60}},
            "four-arcs": {
                "pitch": 20,
                "segments": [
                    {"kind": "line", "start": [0, 0], "end": [300, 0]},
                    {"kind": "arc", "centre": [300, 80], "radius": 80, "start_angle": -90, "sweep": 180},
                    {"kind": "line", "start": [300, 160], "end": [0, 160]},
                    {"kind": "arc", "centre": [0, 80], "radius": 80, "start_angle": 90, "sweep": 180},
                ],
                "fit": {"kind": "spline", "order": 90},
            },
        },
        exports=EXPORTS,
        is_long=is_long,
    ),
    TOLERANCE,
)
