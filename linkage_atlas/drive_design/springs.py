"""Springs that carry a load or hold a linkage: ideal ones in closed form, and real ones from a catalogue."""

from __future__ import annotations

import math

import numpy as np

from linkage_atlas.drive_design.question import SpringRequest
from linkage_atlas.drive_design.records import BeforeAfter, Holds, Spring, SpringCurve, TorqueSize
from linkage_atlas.drive_design.task import DriveTask, both_ends
from linkage_atlas.records import plane, xy
from synthesis.arrays import Complexes, Floats
from synthesis.drives.links import GROUND
from synthesis.drives.springs import (
    Behaviour,
    Fitted,
    Room,
    best_pair,
    best_spring,
    fitted,
    one_spring,
    pairs_of,
    potential_of,
    springs_on_pendulums,
    two_springs,
)
from synthesis.drives.springs import Spring as Placed
from synthesis.fourbar.linkage import Linkage
from synthesis.guided.analysis import Pull

HELP_SHARE = 0.5
"""Largest fraction of the rms torque that springs of a catalogue may leave."""
ENOUGH_SHARE = 0.1
"""Fraction of the rms torque up to which a single spring is preferred to two."""
HOLD_MARGIN = 0.02
"""Torque that presses the linkage onto its stop, as a fraction of the peak torque without springs."""
CLEAR_SHARE = 0.05
"""Default distance of the ends from pivots, as a fraction of the linkage's size."""


def find_springs(task: DriveTask, request: SpringRequest, set_number: int) -> None:
    """Find springs for one entry of a request."""
    links = "any two links" if request.between is None else "-".join(request.between)
    if not task.loaded:
        task.findings.refuse(request.kind, links, "there is no load to balance")
        return
    found = _from_catalogue(task, request) if request.rows else _ideal(task, request)
    if isinstance(found, str):
        task.findings.refuse(request.kind, links, found)
    else:
        _add(task, request, set_number, found)


# -- springs of a catalogue -------------------------------------------------------------------------------------------


def _from_catalogue(task: DriveTask, request: SpringRequest) -> Fitted | str:
    """Find springs of a catalogue, or return a sentence with the reason for a refusal."""
    machine, extent = task.machine, task.machine.extent
    room = Room(
        request.ground_box or task.box,
        float(request.reach_max or extent),
        float(request.clear or CLEAR_SHARE * extent),
    )
    behaviour, between = _behaviour(task, request), request.between
    rows = [
        row._replace(stiffness=request.count * row.stiffness, preload=request.count * row.preload)
        for row in request.rows
    ]
    pairs = pairs_of(machine) if between is None else [between]
    found = best_spring(machine, task.torque, pairs, rows, room, task.work, behaviour)
    pivoted = [(GROUND, name) for name, link in machine.links.items() if link.pivot is not None]
    if between is None and len(pivoted) > 1 and not task.work.expired():
        if isinstance(found, str) or not _suffices(task, found, behaviour, ENOUGH_SHARE):
            two = best_pair(machine, task.torque, pivoted[:2], rows, room, task.work, behaviour)
            if not isinstance(two, str) and (isinstance(found, str) or _is_better(task, two, found, behaviour)):
                found = two
    if isinstance(found, str) or _suffices(task, found, behaviour, HELP_SHARE):
        return found
    return _no_help(task, found, behaviour)


def _behaviour(task: DriveTask, request: SpringRequest) -> Behaviour | None:
    """Return the limits on the remaining torque that a request sets."""
    force = request.hand_force_max
    if not any(request.holds.values()) and force is None:
        return None
    return Behaviour(
        task.machine.sense,
        HOLD_MARGIN * float(np.abs(task.torque).max()),
        bool(request.holds.get("closed")),
        bool(request.holds.get("open")),
        None if force is None else force * np.abs(_hand_speed(task)),
    )


def _hand_speed(task: DriveTask) -> Complexes:
    """Return the velocity of the hand, by default of the body point, per unit of the drive's coordinate."""
    body, hand = task.machine.body, task.question.hand
    assert body is not None
    return body.speed(0j if hand is None else body.point_at(hand))


def _violation(task: DriveTask, found: Fitted, behaviour: Behaviour | None) -> float:
    """Return the torque by which springs violate a behaviour; 0 up to rounding."""
    torque = 0.0 if behaviour is None else float(behaviour.violation(found.torque))
    return torque if torque > 1e-5 * float(np.abs(task.torque).max()) else 0.0


def _suffices(task: DriveTask, found: Fitted, behaviour: Behaviour | None, share: float) -> bool:
    """Check that springs show the requested behaviour, or without one leave at most a fraction of the torque."""
    if behaviour is not None:
        return _violation(task, found, behaviour) == 0
    return found.rms <= share * _size(task.torque).rms


def _is_better(task: DriveTask, found: Fitted, other: Fitted, behaviour: Behaviour | None) -> bool:
    ranks = [(_violation(task, one, behaviour), one.rms) for one in (found, other)]
    return ranks[0] < ranks[1]


def _no_help(task: DriveTask, found: Fitted, behaviour: Behaviour | None) -> str:
    """Explain what the best springs leave."""
    where = " and ".join(
        f"{row.name if row else 'spring'} from {spring.between[0]} to {spring.between[1]}"
        for row, spring in zip(found.kinds, found.springs)
    )
    if behaviour is None:
        share = 100 * found.rms / _size(task.torque).rms
        return f"the best ({where}) leaves {share:.3g} % of the rms torque: a spring is returned if it leaves at most half"
    wrong = []
    first, last = found.torque[[0, -1]] * task.machine.sense
    if behaviour.holds_first and first < behaviour.margin:
        wrong.append("does not hold the first position (closed)")
    if behaviour.holds_last and -last < behaviour.margin:
        wrong.append("does not hold the last position (open)")
    if behaviour.torque_max is not None and np.any(np.abs(found.torque) > behaviour.torque_max):
        wrong.append(f"needs a hand force of {np.abs(found.torque / _hand_speed(task)).max():.4g}")
    return f"no spring of the catalogue behaves so: the nearest ({where}) {' and '.join(wrong)}"


# -- ideal springs ----------------------------------------------------------------------------------------------------


def _ideal(task: DriveTask, request: SpringRequest) -> Fitted | str:
    """Find springs of zero free length that balance every position, or return the reason why there are none."""
    between, stiffness = request.between, None if request.stiffness is None else request.count * request.stiffness
    linkage, load = task.operation.linkage, task.question.load
    if load.torque or load.speed:
        return "a torque, or inertia, has no potential that springs of zero free length carry: give a catalogue"
    if linkage is None:
        return _ideal_on_pendulums(task, between, stiffness)
    potential = potential_of(linkage, load)
    if between is None:
        return fitted(task.machine, task.torque, two_springs(potential, stiffness))
    found = one_spring(potential, between)
    if isinstance(found, Placed):
        if stiffness is not None and abs(stiffness - found.stiffness) > 1e-9 * stiffness and between[0] != GROUND:
            needed = found.stiffness / request.count
            return f"the only spring between {between[0]} and {between[1]} has the stiffness {needed:.6g}"
        if stiffness is not None and between in ((GROUND, "crank"), (GROUND, "rocker")):
            found = next(one for one in two_springs(potential, stiffness) if one.between == between)
        return fitted(task.machine, task.torque, [found])
    if math.isinf(found):
        return f"one spring between {between[0]} and {between[1]} does not balance this load; two springs do: leave `between`"
    return f"one spring would need the stiffness {found:.6g}, below 0; two springs balance it: leave `between`"


def _ideal_on_pendulums(task: DriveTask, between: tuple[str, str] | None, stiffness: float | None) -> Fitted | str:
    """Find springs of zero free length on a body on guides, or on a link on a hinge."""
    guided = None if task.operation.view is None else task.operation.view.plain
    assert not isinstance(guided, Linkage)
    springs = springs_on_pendulums(guided, task.machine, task.torque, stiffness)
    if springs is None:
        kind = "link on a hinge" if guided is None else guided.kind.value
        return f"no springs of zero free length on a {kind} balance this load in every position: give a catalogue"
    if not springs:
        return "the drive carries nothing that springs could balance"
    if between is not None and (len(springs) > 1 or springs[0].between != between):
        where = " and ".join("-".join(one.between) for one in springs)
        return f"one spring between {between[0]} and {between[1]} does not balance this load; {where} do: leave `between`"
    return fitted(task.machine, task.torque, springs)


# -- records ----------------------------------------------------------------------------------------------------------


def _add(task: DriveTask, request: SpringRequest, set_number: int, found: Fitted) -> None:
    machine, sense = task.machine, task.machine.sense
    sizes = BeforeAfter(_size(task.torque), _size(found.torque))
    if found.rms > HELP_SHARE * sizes.before.rms:
        share = 100 * found.rms / sizes.before.rms
        task.findings.notes.append(
            f"springs of set {set_number} show the requested behaviour, but leave {share:.3g} % of the rms torque of the drive"
        )
    hand = None
    if machine.body is not None and (task.question.hand is not None or request.hand_force_max is not None):
        hand = found.torque / np.abs(_hand_speed(task)) * sense
    holds, stays = _at_ends(found.torque[[0, -1]] * sense, sizes.before.peak)
    ends = [[machine.end(*one) for one in zip(spring.between, spring.points)] for spring in found.springs]
    pulls: list[Pull] = []
    for spring, length, (first, second) in zip(found.springs, found.lengths, ends):
        # over a length of 0 a spring of zero free length has no force either
        pull = spring.force(length) / np.maximum(length, 1e-300) * (second - first)
        pulls += [Pull(spring.between[0], first, pull), Pull(spring.between[1], second, -pull)]
    pins = task.pin_peaks(machine, pulls)
    for spring, row, length, points in zip(found.springs, found.kinds, found.lengths, ends):
        curve_ends = plane(np.stack(points, axis=1))
        task.findings.springs.append(
            Spring(
                kind=request.kind,
                set=set_number,
                count=request.count,
                name=None if row is None else row.name,
                between=spring.between,
                points=(both_ends(curve_ends[0, 0]), both_ends(curve_ends[0, 1])),
                points_on_links=(xy(spring.points[0]), xy(spring.points[1])),
                stiffness=spring.stiffness / request.count,
                free_length=spring.free_length,
                preload=spring.preload / request.count,
                length=(float(length.min()), float(length.max())),
                torque=sizes,
                exact=not request.rows,
                pin_forces=pins,
                stays=stays,
                holds=holds,
                hand_force_max=None if hand is None else float(np.abs(hand).max()),
                curve=SpringCurve(
                    task.operation.curve_at,
                    length,
                    spring.force(length) / request.count,
                    found.torque,
                    hand,
                    curve_ends,
                ),
            )
        )


def _at_ends(torques: Floats, peak: float) -> tuple[Holds, str]:
    """Return which ends hold, and what the linkage does there by itself; positive torques press onto the first stop."""
    quiet = 1e-9 * max(peak, 1e-300)
    first, last = torques
    words = [
        "stays" if abs(first) <= quiet else "is pressed onto its stop" if first > 0 else "opens by itself",
        "stays" if abs(last) <= quiet else "closes by itself" if last > 0 else "is held open",
    ]
    return Holds(bool(first >= -quiet), bool(last <= quiet)), f"first position: {words[0]}; last: {words[1]}"


def _size(torque: Floats) -> TorqueSize:
    return TorqueSize(float(np.sqrt(np.mean(torque**2))), float(np.abs(torque).max()))
