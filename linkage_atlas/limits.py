"""Limits as a user gives them, checked by name; and where they exclude every linkage, which of them do, and by how much."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from linkage_atlas.arguments import check_names, column, number, radians_in
from linkage_atlas.motions import Motion
from synthesis.errors import FieldError
from synthesis.fourbar import limits as fourbar
from synthesis.fourbar.kinematics import Family, family
from synthesis.fourbar.limits import FORMS, LINKS, REACH, ROOM, Form, in_family, practical_limits
from synthesis.free.poses import Poses
from synthesis.target import Samples
from synthesis.work import Work

PRESETS = ("practical", "none")
"""Sets of limits by name: the first holds by default where the crank angles are free, the second where they are given."""
LIMITS = {name: form for name, form in FORMS.items() if form.kind != "reach"}
"""The limits of a request, beside its ``preset``."""
FUNCTION_LIMITS = {name: form for name, form in LIMITS.items() if form.concerns not in ("place", "sliders")}
"""Those of a request for function generators."""
_STEPS = 6
"""Halvings of the way that a limit gives."""
_SECONDS = 1.5
"""Longest time that is spent on the reason."""
QUICK, QUICK_ROUNDS = 0.1, 2
"""J at which a search for some linkage ends, and its rounds."""

Search = Callable[[fourbar.Limits, Work], tuple[Sequence[Any], Any]]


class Limits(dict[str, Any]):
    """Within what: limits by name, in the units of the motion, each checked when it is used.

    A mapping of the same names does as well. Lengths and places are in the unit of the positions, angles in that of the motion;
    points are [x, y], boxes [xmin, ymin, xmax, ymax], links {"crank": length, ..}; the family is full_crank (default),
    crank_rocker, double_crank or any; preset: "practical", see the limits' page of the documents.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> la.Limits(transmission_angle_min=40, pivot_box=[-50, -50, 250, 250])
    {'transmission_angle_min': 40, 'pivot_box': [-50, -50, 250, 250]}
    """

    def __init__(self, **limits: Any) -> None:
        check_names("/limits", limits, (*LIMITS, "preset"), "limit")
        super().__init__(limits)


Limits.__doc__ = f"{Limits.__doc__}\n    Notes\n    -----\n" + "\n".join(
    f"    {name} : {form.kind}\n        {form.says}" for name, form in LIMITS.items()
)


def read_limits(limits: Mapping[str, Any] | None, motion: Motion) -> fourbar.Limits:
    """The limits of a request, checked against its motion."""
    preset = PRESETS[0] if motion.free and motion.travel is None else PRESETS[1]
    checked = _read(limits, motion.samples, motion.radian, LIMITS, preset, {})
    checked.check_against(motion.samples)
    angle = checked.transmission_angle_min
    if isinstance(motion.samples, Poses) and motion.samples.closed and angle:  # which uses the whole turn
        return replace(checked, transmission_angle_min_turn=max(angle, checked.transmission_angle_min_turn or 0.0))
    return checked


def read_function_limits(limits: Mapping[str, Any] | None, samples: Samples, degrees: bool) -> fourbar.Limits:
    """The limits of a request for function generators, which are of any family where it names none."""
    checked = _read(limits, samples, radians_in(degrees), FUNCTION_LIMITS, PRESETS[1], {"family": "any"})
    if any(checked.links) and checked.links[3] is None:
        raise FieldError("/limits/links/ground", "needed where other lengths are given")
    return checked


def _read(
    limits: Mapping[str, Any] | None,
    samples: Samples,
    radian: float,
    forms: Mapping[str, Form],
    preset: str,
    default: dict[str, Any],
) -> fourbar.Limits:
    given = default | {name: value for name, value in (limits or {}).items() if value is not None}
    check_names("/limits", given, (*forms, "preset"), "limit")
    preset = given.pop("preset", preset)
    if preset not in PRESETS:
        raise FieldError("/limits/preset", f"wanted 'practical' or 'none', found {preset!r}")
    given = {name: _value(f"limits/{name}", FORMS[name].kind, value, radian) for name, value in given.items()}
    return fourbar.Limits(**(practical_limits(samples, given) if preset == "practical" else given))


def _value(field: str, kind: str, value: Any, radian: float) -> Any:
    match kind:
        case "angle":
            return number(field, value) * radian
        case "length" | "ratio":
            return number(field, value)
        case "point":
            return complex(*_numbers(field, value, 2, "[x, y]"))
        case "box":
            return tuple(_numbers(field, value, 4, "[xmin, ymin, xmax, ymax]"))
        case "boxes":
            return tuple(_value(f"{field}/{k}", "box", box, radian) for k, box in enumerate(value))
        case "links":
            return _lengths(field, value)
    return value


def _numbers(field: str, values: Any, size: int, form: str) -> list[float]:
    found = column(field, values)
    if found.shape != (size,):
        rows = f" in {len(found)} rows" if found.ndim > 1 else ""
        raise FieldError(f"/{field}", f"wanted {form}, found {found.size} numbers{rows}")
    if not np.all(np.isfinite(found)):
        raise FieldError(f"/{field}/{int(np.argmin(np.isfinite(found)))}", "wanted a finite number")
    return found.tolist()


def _lengths(field: str, given: Any) -> tuple[float | None, ...]:
    if not isinstance(given, Mapping):
        raise FieldError(f"/{field}", f"wanted some of {', '.join(LINKS)} with their lengths")
    check_names(f"/{field}", given, LINKS, "link")
    values = [given.get(name) for name in LINKS]
    return tuple(None if value is None else number(f"{field}/{name}", value) for name, value in zip(LINKS, values))


# -- what excludes every linkage --------------------------------------------------------------------------------------


def what_excludes(
    limits: fourbar.Limits, motion: Motion, search: Search, work: Work, own: Mapping[str, Any] | None = None
) -> list[str]:
    """Sentences on the limits, one or two, without which there are linkages; none where that was not found out in time.

    ``limits``: within which a search found nothing. ``search``: a quick one for other limits and work of its own. ``work``:
    what is left of its time may be used. ``own``: the limits that the request names, which are tried first.
    """
    watch = work.part(_SECONDS)
    extent = 1.0 if motion.samples.position is None else motion.samples.extent
    names = [name for name in limits.given if name != "family"]
    if limits.family != "any":  # also where it is the default, and nobody thought of it
        names.insert(0, "family")
    if given := all(limits.links):  # which keep the limits of lengths; that others would do is no news
        idle = ["link_min", "link_max", "link_ratio_max", *["transmission_angle_min_turn"] * limits.swings]
        names = [name for name in names if name not in idle]
    names.sort(key=lambda name: (given and name == "links", name not in (own or {})))
    notes: list[str] = []
    if given and not in_family(limits.family, np.array([limits.links], dtype=float))[0]:
        made = Family(family(np.array(limits.links, dtype=float)).item()).value
        return [f"the given lengths are those of a {made}, which family '{limits.family}' excludes; 'any' takes them"]
    for name in names:
        if watch.expired():
            return notes
        found, _ = search(_without(limits, name, extent), watch)
        if found:
            notes.append(_sentence(limits, name, motion, search, watch, extent))
    for one, other in combinations(names, 2):
        if notes or watch.expired():
            break
        found, _ = search(_without(_without(limits, one, extent), other, extent), watch)
        if found:
            notes.append(f"no linkage was found within {one} and {other} together; without these two there are")
    return notes


def _without(limits: fourbar.Limits, name: str, extent: float) -> fourbar.Limits:
    """The limits without one of them; a family gives way to any."""
    return _changed(limits, name, "any" if name == "family" else getattr(fourbar.Limits(), name), extent)


def _changed(limits: fourbar.Limits, name: str, value: Any, extent: float) -> fourbar.Limits:
    """The limits with another value of one, as a request with that value would have them."""
    changes: dict[str, Any] = {name: value}
    if name == "link_min" and limits.practical and limits.link_max == ROOM * (limits.link_min or 0.0):
        # it has lifted the preset's longest
        changes["link_max"] = max(extent * REACH, ROOM * (value or 0.0))
    return replace(limits, **changes)


def _sentence(limits: fourbar.Limits, name: str, motion: Motion, search: Search, watch: Work, extent: float) -> str:
    low, high, best = 0.0, 1.0, None
    for _ in range(_STEPS):
        middle = (low + high) / 2
        eased = _eased(limits, name, middle, extent)
        if eased is None or watch.expired():
            break
        if search(eased, watch)[0]:
            high, best = middle, eased
        elif not watch.expired():
            low = middle
    shown = name if name != "pivot_reach" else "the distance of the pivots"
    if name == "family":
        return f"family '{limits.family}' excludes every linkage that was looked for; among 'any' there are some"
    if best is None:
        return f"{shown} excludes every linkage that was looked for; without it there are some"
    return f"{shown} excludes every linkage that was looked for; at {_shown(best, name, motion)} there is one"


def _eased(limits: fourbar.Limits, name: str, part: float, extent: float) -> fourbar.Limits | None:
    """The limits with one that has given way by a part of all that it can; None where it cannot in degrees."""
    value, form = getattr(limits, name), FORMS[name]
    match form.kind:
        case "angle":
            return _changed(limits, name, value * (1 - part), extent)
        case "length" | "ratio":
            return _changed(limits, name, value * (1 - part) if form.least else value / (1 - part), extent)
        case "box":
            by = part / (1 - part) * extent
            return _changed(limits, name, (value[0] - by, value[1] - by, value[2] + by, value[3] + by), extent)
    return None


def _shown(limits: fourbar.Limits, name: str, motion: Motion) -> str:
    value = getattr(limits, name)
    if FORMS[name].kind == "angle":
        return f"{value / motion.radian:.3g} {'degrees' if motion.degrees else 'radians'}"
    if isinstance(value, tuple):
        return f"[{', '.join(f'{number:.4g}' for number in value)}]"
    return f"{value:.4g}"
