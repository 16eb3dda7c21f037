"""Words for people: notes as whole sentences, counted nouns, and the limits of a request by name and as a condition."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from synthesis.arrays import Floats
from synthesis.limits import FORMS, Limits, Reach, of_kind
from synthesis.violations import Measure

LIMIT_WORDS = {
    "family": ("the family", ""),
    "transmission_angle_min": ("the transmission angle in use", "a transmission angle of at least {}"),
    "transmission_angle_min_turn": (
        "the transmission angle over the whole turn",
        "a transmission angle of at least {} over the whole turn",
    ),
    "pivot_a": ("the given pivot A", "pivot A at {}"),
    "pivot_b": ("the given pivot B", "pivot B at {}"),
    "pivot_box": ("the pivot box", "both fixed pivots in the box {}"),
    "pivot_a_box": ("the box of pivot A", "pivot A in the box {}"),
    "pivot_b_box": ("the box of pivot B", "pivot B in the box {}"),
    "pivot_reach": ("the largest distance of the pivots", "fixed pivots within {} of the middle of the motion"),
    "keep_out": ("the keep-out boxes", "the fixed pivots outside the keep-out boxes"),
    "link_ratio_max": ("the ratio of longest to shortest link", "a longest link of at most {} times the shortest"),
    "link_min": ("the smallest link length", "links of at least {}"),
    "link_max": ("the largest link length", "links of at most {}"),
    "links": ("the given lengths", "the given lengths"),
    "coupler_radius_max": ("the reach of the body point", "the body point within {} of the crank pin"),
    "body_reach": ("the distance of the body point from its joints", ""),
    "envelope": ("the envelope", "all joints in the box {}"),
    "stroke_max": ("the longest stroke", "a stroke of at most {}"),
    "rail_box": ("the box of the rails", "the ends of every rail in the box {}"),
    "cylinder_dead_length": ("the shortest cylinder", "a cylinder of at least {}"),
    "cylinder_extended_max": ("the longest cylinder", "a cylinder of at most {}"),
    "arm_min": ("the smallest moment arm", "a moment arm of at least {}"),
}
"""Name of each limit in a sentence, and its condition, which follows "a linkage with"; the page uses the same names."""
FAULTS = {
    "transmission_angle_min": "transmission angle {:.3g} degrees over the used interval, below {:.3g}",
    "transmission_angle_min_turn": "transmission angle {:.3g} degrees over the whole turn, below {:.3g}",
    "link_ratio_max": "longest link {:.3g} times the shortest, above {:g}",
    "link_max": "longest link {:.3g} times the motion's extent, above {:.4g}",
    "body_reach": "the body point lies {2:.4g} from a joint of its link, above {3:.4g}, the longest link",
    "link_min": "shortest link {:.3g} times the motion's extent, below {:.3g}",
    "pivot_reach": "a fixed pivot {:.3g} extents from the motion's middle, above {:.4g}",
    "cylinder_dead_length": "the length of its cylinder passes 0 during the motion, so that no cylinder fits",
}
"""Sentence of a verdict on each practical limit, with the measure and its bound: in their unit and, from {2} on, as lengths."""
_FAMILIES = {
    "full_crank": "a crank that turns fully",
    "crank_rocker": "a crank-rocker",
    "double_crank": "a double-crank",
}


def sentences(notes: Iterable[str]) -> list[str]:
    """Return notes that begin with a capital letter and end with a full stop."""
    return [f"{note[:1].upper()}{note[1:]}{'' if note[-1:] in '.!?' else '.'}" for note in notes]


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    >>> counted(1, "row"), counted(1200, "match"), counted(2, "family")
    ('1 row', '1,200 matches', '2 families')
    """
    if number != 1 and noun.endswith("y"):
        noun = f"{noun[:-1]}ies"
    elif number != 1:
        noun += "es" if noun.endswith("ch") else "s"
    return f"{number:,} {noun}"


def listed(words: Sequence[str]) -> str:
    """Return words as a list in a sentence: "a", "a and b", "a, b and c"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def in_percent(changes: Floats) -> str:
    """Return the largest of relative changes: "2.5 %", "more than 100 %"."""
    largest = 100 * float(np.max(changes))
    return f"{largest:.2g} %" if largest <= 100 else "more than 100 %"


def limit_label(name: str) -> str:
    """Return the name of a limit in a sentence; ``links.crank`` is one of the given lengths."""
    limit, _, link = name.partition(".")
    return f"the given {link} length" if link else LIMIT_WORDS[limit][0]


def condition(limits: Limits, name: str, radian: float) -> str:
    """Return what a limit of `synthesis` asks of a linkage, in the user's unit of angle: "links of at least 40"."""
    value = getattr(limits, name)
    if name == "family":
        return _FAMILIES[value]
    return LIMIT_WORDS[name][1].format(_shown(value, FORMS[name].kind, radian))


def fault(measure: Measure) -> str:
    """Return what a verdict says of the measure of a practical limit that is violated."""
    value, bound, unit = measure.value, measure.bound, measure.unit
    if measure.limit in of_kind("angle"):
        unit = np.deg2rad(1.0)
    return FAULTS[measure.limit].format(value / unit, bound / unit, value, bound)


def _shown(value: object, kind: str, radian: float) -> str:
    """Write the value of a limit with its unit of angle; empty for values that no sentence shows."""
    match value:
        case Reach():
            return f"{max(distance for distance in value[1:] if distance is not None):.4g}"
        case complex():
            return f"({value.real:.4g}, {value.imag:.4g})"
        case float() if kind == "angle":
            return f"{value / radian:.3g} {'radians' if radian == 1 else 'degrees'}"
        case float():
            return f"{value:.4g}"
        case tuple() if kind == "box":
            return f"[{', '.join(f'{number:.4g}' for number in value)}]"
    return ""
