"""Limits of a request, checked by name, and an explanation of the limits that exclude every linkage."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from itertools import combinations
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import Fields, build, check_names, column, number, one_of, radians_in, sequence
from linkage_atlas.motions import Motion
from linkage_atlas.notes import condition, counted
from synthesis import limits as model
from synthesis.errors import FieldError
from synthesis.four_bar import Family, family
from synthesis.limits import FORMS, LINKS, REACH, ROOM, Form, in_family, practical_limits
from synthesis.poses import Poses
from synthesis.target import Samples
from synthesis.work import OutOfTime, Work

T = TypeVar("T")
PRESETS = ("practical", "none")
"""Sets of limits by name; the default with free crank angles, and the default with given ones."""
LIMITS = {name: form for name, form in FORMS.items() if form.kind != "reach"}
"""The limits of a request, beside its ``preset``."""
FUNCTION_LIMITS = {name: form for name, form in LIMITS.items() if form.concerns not in ("position", "sliders")}
"""The limits of a request for function generators."""
_STEPS = 6
"""Number of bisection steps for the value at which a limit no longer excludes every linkage."""
_SEARCHES = 24
"""Largest number of quick searches, of 40 to 120 ms each, for the limits that exclude every linkage."""
_FEW_SAMPLES = 48
"""Largest number of samples of the motions of these searches."""
ANY_ERROR = "Linkages in these sentences satisfy all other limits, but their errors may be large."
QUICK, QUICK_ROUNDS = 0.1, 2
"""J at which a search for some linkage ends, and its rounds."""

Search = Callable[[model.Limits, Work], tuple[Sequence[object], object]]


def _with_checked_names(kind: type[T]) -> type[T]:
    """Make a dataclass raise FieldError with similar names if a field is unknown."""
    initialize = kind.__init__

    @wraps(initialize)
    def checked(self: T, **limits: object) -> None:
        check_names("/limits", limits, (*LIMITS, "preset"), "limit")
        initialize(self, **limits)

    kind.__init__ = checked  # type: ignore[method-assign, assignment]
    return kind


@_with_checked_names
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Limits(Mapping[str, object]):
    """Limits on the linkages of a search, in the units of the motion; a field that is None limits nothing.

    `synthesize` checks the values against the motion. Everything that takes limits also takes a mapping with the same names,
    and `Limits` is such a mapping of the fields that are set.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    FieldError
        If there is no limit of a name; the error lists similar names.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> la.Limits(transmission_angle_min=40, pivot_box=[-50, -50, 250, 250])
    Limits(transmission_angle_min=40, pivot_box=[-50, -50, 250, 250])
    """

    family: Literal["full_crank", "crank_rocker", "double_crank", "any"] | None = None
    transmission_angle_min: float | None = None
    transmission_angle_min_turn: float | None = None
    pivot_a: ArrayLike | None = None
    pivot_b: ArrayLike | None = None
    pivot_box: ArrayLike | None = None
    pivot_a_box: ArrayLike | None = None
    pivot_b_box: ArrayLike | None = None
    keep_out: Sequence[ArrayLike] | None = None
    link_ratio_max: float | None = None
    link_min: float | None = None
    link_max: float | None = None
    links: Mapping[str, float | None] | None = None
    coupler_radius_max: float | None = None
    envelope: ArrayLike | None = None
    stroke_max: float | None = None
    rail_box: ArrayLike | None = None
    cylinder_dead_length: float | None = None
    cylinder_extended_max: float | None = None
    arm_min: float | None = None
    preset: Literal["practical", "none"] | None = None

    def __getitem__(self, name: str) -> object:
        value = getattr(self, name) if name in self.__dataclass_fields__ else None
        if value is None:
            raise KeyError(name)
        return value

    def __iter__(self) -> Iterator[str]:
        return (name for name in self.__dataclass_fields__ if getattr(self, name) is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __repr__(self) -> str:
        return f"Limits({', '.join(f'{name}={value!r}' for name, value in self.items())})"


_PARAMETERS = {
    "family": "{'full_crank', 'crank_rocker', 'double_crank', 'any'}, optional",
    "angle": "float, optional, in the unit of angle of the motion",
    "length": "float, optional, in the unit of the positions",
    "ratio": "float, optional",
    "links": "mapping of crank, coupler, rocker, ground to float, optional, in the unit of the positions",
    "point": "array_like, shape (2,), optional, in the unit of the positions",
    "box": "array_like, shape (4,), optional, in the unit of the positions",
    "boxes": "sequence of array_like, shape (4,), optional, in the unit of the positions",
}
"""Type and unit of a limit of each kind, as the docstring of `Limits` describes them."""
_PRESET = """preset : {'practical', 'none'}, optional
        Set of limits that holds beside the given ones. Default: 'practical' with free crank angles, otherwise 'none'."""
_ROWS = [
    f"{name} : {_PARAMETERS[form.kind]}\n        {form.says[:1].upper()}{form.says[1:]}"
    for name, form in LIMITS.items()
]
Limits.__doc__ = (Limits.__doc__ or "").replace("{parameters}", "\n    ".join([*_ROWS, _PRESET]))


def read_limits(limits: Fields | None, motion: Motion) -> model.Limits:
    """Check the limits of a request against its motion.

    With free crank angles the practical limits hold by default, and four-bars are of any family unless the path is closed or a
    transmission angle over the whole turn is given: hinges, lids and flaps swing.
    """
    free = motion.free and motion.travel is None
    closed = motion.samples.closed
    turns = closed or not motion.free or bool((limits or {}).get("transmission_angle_min_turn"))
    default = {} if turns else {"family": "any"}
    checked = _read(limits, motion.samples, motion.radian, LIMITS, PRESETS[0] if free else PRESETS[1], default)
    checked.check_against(motion.samples)
    return checked.over_whole_turn if closed else checked


def read_function_limits(limits: Fields | None, samples: Samples, degrees: bool) -> model.Limits:
    """Check the limits of a request for function generators; the default family is any."""
    checked = _read(limits, samples, radians_in(degrees), FUNCTION_LIMITS, PRESETS[1], {"family": "any"})
    if any(checked.links) and checked.links[3] is None:
        raise FieldError("/limits/links/ground", "is required if other lengths are given")
    return checked


def _read(
    limits: Fields | None, samples: Samples, radian: float, forms: Mapping[str, Form], preset: str, default: Fields
) -> model.Limits:
    named = {**default, **{name: value for name, value in (limits or {}).items() if value is not None}}
    check_names("/limits", named, (*forms, "preset"), "limit")
    preset = one_of("limits/preset", named.pop("preset", preset), PRESETS)
    named = {name: _value(f"limits/{name}", FORMS[name].kind, value, radian) for name, value in named.items()}
    return build(model.Limits, practical_limits(samples, named) if preset == "practical" else named)


def _value(field: str, kind: str, value: object, radian: float) -> object:
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
            return tuple(_value(f"{field}/{k}", "box", box, radian) for k, box in enumerate(sequence(value)))
        case "links":
            return _lengths(field, value)
    return value


def _numbers(field: str, values: object, size: int, form: str) -> list[float]:
    found = column(field, values)
    if found.shape != (size,):
        rows = f" in {counted(len(found), 'row')}" if found.ndim > 1 else ""
        raise FieldError(f"/{field}", f"must have {form}; it has {counted(found.size, 'number')}{rows}")
    if not np.all(np.isfinite(found)):
        raise FieldError(f"/{field}/{int(np.argmin(np.isfinite(found)))}", "must be a finite number")
    return found.tolist()


def _lengths(field: str, value: object) -> tuple[float | None, ...]:
    if not isinstance(value, Mapping):
        raise FieldError(f"/{field}", f"must give lengths of some of {', '.join(LINKS)}")
    check_names(f"/{field}", value, LINKS, "link")
    values = [value.get(name) for name in LINKS]
    return tuple(None if value is None else number(f"{field}/{name}", value) for name, value in zip(LINKS, values))


# -- limits that exclude every linkage --------------------------------------------------------------------------------


def what_excludes(
    limits: model.Limits,
    motion: Motion,
    search: Search,
    work: Work,
    named: Collection[str] = (),
    subject: str = "linkage",
) -> list[str]:
    """Return sentences on the limits, single ones or else pairs, without which there are linkages.

    The number of searches is bounded, so that the same request gets the same sentences. If the time is up before, the last
    sentence is about that.

    Parameters
    ----------
    limits : Limits
        A search within them found nothing.
    motion : Motion
    search : callable
        A quick search within other limits.
    work : Work
    named : collection of str
        Names of the limits that the request sets, which are tried first.
    subject : str
        Noun for the linkages that the search finds.
    """
    names = [name for name in limits.active_names if name != "family"]
    if limits.family != "any":  # it may be the default, which the user has not thought of
        names.insert(0, "family")
    if all_lengths := all(limits.links):  # the given lengths satisfy the limits of lengths: these exclude nothing
        idle = ["link_min", "link_max", "link_ratio_max", *["transmission_angle_min_turn"] * limits.swings]
        names = [name for name in names if name not in idle]
    names.sort(key=lambda name: (all_lengths and name == "links", name not in named))
    if all_lengths and not in_family(limits.family, np.array([limits.links], dtype=float))[0]:
        family_name = Family(family(np.array(limits.links, dtype=float)).item()).value.replace("_", "-")
        return [
            f"The given lengths make a {family_name}, which the family excludes: allow any family (`limits.family`)."
        ]
    trials = _Trials(limits, motion, search, work, subject)
    single: list[str] = []
    notes: list[str] = []
    try:
        for name in names:
            if trials.find(trials.without(name)):
                single.append(name)
        for name in single:
            notes.append(trials.sentence(name, trials.eased_until(name)))
        if not single:
            notes.append(trials.pairs(names))
    except OutOfTime:
        notes += [trials.sentence(name, None) for name in single[len(notes) :]]
        notes.append("The time was up before all limits were examined.")
    if subject == "linkage" and any("`limits." in note for note in notes):
        notes.append(ANY_ERROR)
    return notes


def thinned(motion: Motion) -> Motion:
    """Return a motion with few samples, both ends among them: enough to find linkages within limits, whatever their errors."""
    samples = motion.samples
    if motion.travel is not None or samples.samples <= _FEW_SAMPLES:
        return motion
    if isinstance(samples, Poses):
        return Motion.of(replace(samples.at(samples.spread(_FEW_SAMPLES)), requested=None), motion.degrees)
    return Motion.of(samples.thinned(_FEW_SAMPLES), motion.degrees)


class _Trials:
    """A bounded number of searches within relaxed limits. Raises `OutOfTime` if the time ends one of them."""

    def __init__(self, limits: model.Limits, motion: Motion, search: Search, work: Work, subject: str) -> None:
        self.limits, self.radian, self.subject = limits, motion.radian, subject
        self.extent = 1.0 if motion.samples.position is None else motion.samples.extent
        self._search, self._work, self.left = search, work, _SEARCHES

    def find(self, limits: model.Limits) -> bool:
        """Return whether there is a linkage; false too if no search is left."""
        if not self.left:
            return False
        self.left -= 1
        self._work.go_on()
        found = bool(self._search(limits, self._work)[0])
        if not found:
            self._work.go_on()
        return found

    def changed(self, name: str, value: object, limits: model.Limits | None = None) -> model.Limits:
        """Return the limits with another value of a limit."""
        limits, changes = limits or self.limits, {name: value}
        if name == "link_min" and limits.practical and limits.link_max == ROOM * (limits.link_min or 0.0):
            # the shortest length has lifted the longest length of the preset
            changes["link_max"] = max(self.extent * REACH, ROOM * (value if isinstance(value, float) else 0.0))
        return build(replace, changes, limits)

    def without(self, *names: str) -> model.Limits:
        """Return the limits without some of them; without a family any is allowed."""
        limits = self.limits
        for name in names:
            limits = self.changed(name, "any" if name == "family" else getattr(model.Limits(), name), limits)
        return limits

    def pairs(self, names: Sequence[str]) -> str:
        """Return a sentence on the first two limits without which there are linkages."""
        for pair in combinations(names, 2):
            if self.find(self.without(*pair)):
                first, second = (condition(self.limits, name, self.radian) for name in pair)
                fields = ", ".join(f"`limits.{name}`" for name in pair)
                found = f"No {self.subject} was found with {first} and {second}"
                return f"{found}; without these two limits there are some ({fields})."
        pairs = ", or two," if self.left else ", or one of the pairs that were tried,"
        dropped = f"one of the limits{pairs}" if len(names) > 1 else "the limit"
        return f"Dropping {dropped} did not lead to any {self.subject}."

    def sentence(self, name: str, eased: model.Limits | None) -> str:
        """Return that a limit excludes every linkage, with its value in eased limits that do not."""
        instead = "without this limit there are some"
        if name == "family":
            instead = "in any family there are some"
        elif eased is not None:
            instead = f"with {condition(eased, name, self.radian)} there is one"
        field, words = "preset" if name == "pivot_reach" else name, condition(self.limits, name, self.radian)
        return f"No {self.subject} was found with {words}; {instead} (`limits.{field}`)."

    def eased_until(self, name: str) -> model.Limits | None:
        """Return the limits with a limit relaxed by bisection until there is a linkage; None if no value is known."""
        low, high, best = 0.0, 1.0, None
        for _ in range(_STEPS):
            middle = (low + high) / 2
            eased = self._eased(name, middle)
            if eased is None or not self.left:
                break
            if self.find(eased):
                high, best = middle, eased
            else:
                low = middle
        return best

    def _eased(self, name: str, share: float) -> model.Limits | None:
        """Return the limits with a limit relaxed by a share of the whole way, to four digits; None if it has no degrees."""
        value, form = getattr(self.limits, name), FORMS[name]
        match form.kind:
            case "angle":
                return self.changed(name, _rounded(value * (1 - share) / self.radian, -1, 3) * self.radian)
            case "length" | "ratio":
                eased = _rounded(value * (1 - share), -1) if form.minimum else _rounded(value / (1 - share), 1)
                return self.changed(name, eased)
            case "box":
                by, distance = share / (1 - share) * self.extent, max(map(abs, value))
                sides = enumerate((-1, -1, 1, 1))
                return self.changed(
                    name, tuple(_rounded(value[k] + side * by, side, 4, distance + by) for k, side in sides)
                )
        return None


def _rounded(value: float, side: int, digits: int = 4, size: float | None = None) -> float:
    """Return a value rounded up (side 1) or down (-1) to significant digits of a size, by default its own."""
    size = abs(value) if size is None else size
    if not size:
        return value
    decimals = digits - 1 - int(np.floor(np.log10(size)))
    scaled = value * 10.0**decimals
    return float(f"{(np.ceil(scaled) if side > 0 else np.floor(scaled)) / 10.0**decimals:.{digits}g}")
