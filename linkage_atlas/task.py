"""A request for linkages as a task: validated, in radians, with everything that the stages of `synthesize` need."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache
from inspect import signature
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from linkage_atlas.analysis import check_rows
from linkage_atlas.arguments import Fields, build, check_above_zero, check_top, mapping, number, one_of
from linkage_atlas.atlases import Atlas, as_atlas, default_atlas
from linkage_atlas.drive_design.design import check_request
from linkage_atlas.geometry import DriverName, KindName
from linkage_atlas.limits import read_limits
from linkage_atlas.mechanism_types import Kinds, check_no_slider_limits, read_kinds
from linkage_atlas.motions import Motion
from linkage_atlas.solutions import FINISHING
from linkage_atlas.studies import STUDIES, Studies, check_lengths, read_studies
from linkage_atlas.warm_start import Start, StartingLinkage, check_refine_only, read_starts, starts_for
from synthesis.assembly.sizes import default_widths
from synthesis.atlas.scan import Scan
from synthesis.errors import FieldError
from synthesis.free.few_poses import Obstacles
from synthesis.free.screen import path_screen
from synthesis.limits import Limits, Reach, within_practical
from synthesis.ranking import FAIR_PROPORTION, PROPORTION
from synthesis.search.seeds import SeedTables
from synthesis.work import Work

Prefer = Literal["error", "balanced", "size", "transmission", "crank_span", "layers"]
PREFER = get_args(Prefer)
Effort = Literal["refine", "atlas"]


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Options of `synthesize`; each is described there."""

    top: int
    effort: Effort
    prefer: Prefer | None
    diverse: bool
    tolerance: float
    budget: float | None
    start_from: Sequence[StartingLinkage] | None
    refine_only: bool
    atlas: Atlas | str | Path | None
    mechanisms: Sequence[KindName] | Literal["all"] | None
    driver: DriverName | None


@cache
def seed_tables() -> SeedTables:
    """Return the coarse tables of the search, which the first call makes."""
    return SeedTables()


def prepare() -> None:
    """Make the coarse tables of the searches (about 0.3 s), which otherwise the first request makes.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> la.prepare()
    """
    seed_tables()
    path_screen("full_crank")


@dataclass(frozen=True, kw_only=True)
class Task:
    """A checked request in model units."""

    motion: Motion
    limits: Limits
    named_limits: frozenset[str]
    """Names of the limits that the request sets."""
    kinds: Kinds
    source: SeedTables | Scan
    """Origin of four-bars: the tables of a search, or an atlas."""
    starts: Sequence[Start]
    """The linkages of `start_from`."""
    refine_only: bool
    """Only the linkages of `start_from` are refined, without a search."""
    prefer: Prefer
    tolerance: float
    top: int
    diverse: bool
    studies: Studies
    soon: bool
    """Alternatives to an exact linkage are sought for a short time: one kind with rails or slots was requested, and no budget."""
    narrower: Sequence[Limits]
    """Limits that are searched too if the linkage with the smallest error cannot be used or is out of proportion, widest last."""
    fair: float | None
    """Largest length of a part of a linkage of fair size, in extents of the motion or in shortest links; None if the request
    limits the proportions, or with free crank angles."""
    atlas: Atlas | None
    work: Work

    @property
    def by_error(self) -> bool:
        """True if the smallest error is preferred."""
        return self.prefer == "error"

    @property
    def obstacles(self) -> Obstacles | None:
        """The boxes that no link may enter, if assemblies were requested."""
        assembly = self.studies.assembly
        if assembly is None:
            return None
        boxes, width = assembly.keep_out or self.limits.keep_out, assembly.settings.width
        if not boxes:
            return None
        return Obstacles(boxes, default_widths if width is None else lambda lengths: np.full(len(lengths), width))

    @property
    def rounds(self) -> bool:
        """True if solutions are ranked by their error with rounded lengths."""
        return self.studies.rounds and self.by_error and not self.diverse

    def search_work(self, reserved: float = 0.0) -> Work:
        """Return the work of the search; ``reserved``: fraction of the budget for the stages after it."""
        return self.work.extended(-FINISHING - reserved)


def read_task(
    arguments: Sequence[object],
    requested_limits: Fields | None,
    options: SearchOptions,
    more: Fields,
    work: Callable[[float | None], Work],
) -> Task:
    """Check the arguments of `synthesize`.

    Raises
    ------
    FieldError
        If an argument is wrong; the error names it.
    TypeError
        If there is no argument of this name.
    """
    _check_options(options)
    tolerance = number("tolerance", options.tolerance, 0.0)
    refine_only = check_refine_only(options.refine_only, options.start_from)
    motion, requested_limits, study_arguments = _read_motion(arguments, requested_limits, more)
    if options.effort == "atlas" and motion.free:
        raise FieldError(
            "/effort", "must be 'refine' with free crank angles, because the atlas holds curves over crank angles"
        )
    starts = read_starts(options.start_from, motion.degrees)
    own_kinds = list(dict.fromkeys(start.linkage.kind.value for start in starts))
    mechanisms = own_kinds or None if options.mechanisms is None else options.mechanisms
    kinds = read_kinds(mechanisms, options.driver, motion)
    if not motion.free and motion.target.start is not None:
        _check_start_angle(options, kinds, study_arguments)
    if options.effort == "atlas" and not kinds.only_four_bars:
        raise FieldError("/effort", "must be 'refine' with `mechanisms`, because the atlas holds only four-bars")
    source, atlas = _source(options)
    watch = work(options.budget)  # the tables are made before the time of a request begins
    limits, studies = read_limits(requested_limits, motion), read_studies(study_arguments, motion)
    starts = starts_for(starts, motion, kinds)
    if studies.drives is not None:
        check_request(studies.drives, motion.radian)
    if studies.analysis is not None:
        check_rows(options.top, None if motion.free else motion.target.interval)
    searches, only_error = isinstance(source, SeedTables) and not refine_only, studies.rounds or not limits.practical
    prefer = _preference(options.prefer, motion, searches, only_error)
    named_limits = frozenset(requested_limits or ())
    narrower, fair = _narrower(named_limits, motion, limits, source)
    if kinds.only_four_bars:
        check_no_slider_limits(limits)
        check_lengths(studies, limits)
    return Task(
        motion=motion,
        limits=limits,
        named_limits=named_limits,
        kinds=kinds,
        source=source,
        atlas=atlas,
        starts=starts,
        refine_only=refine_only,
        prefer=prefer,
        tolerance=tolerance,
        top=options.top,
        diverse=options.diverse and kinds.only_four_bars,
        studies=studies,
        soon=options.budget is None and len(kinds.kinds) == 1 and not kinds.only_four_bars,
        narrower=narrower,
        fair=fair,
        work=watch,
    )


def _check_start_angle(options: SearchOptions, kinds: Kinds, studies: Fields) -> None:
    """Refuse options that do not keep the crank angle of the first sample."""
    is_set = {"start_from": options.start_from is not None}
    is_set |= {name: studies.get(name) is not None for name in ("round_to", "lengths_from")}
    is_set |= {"effort": options.effort == "atlas", "mechanisms": not kinds.only_four_bars}
    if foreign := [name for name, used in is_set.items() if used]:
        raise FieldError(f"/{foreign[0]}", "cannot be combined with `start_angle`, which applies only to four-bars")


def _check_options(options: SearchOptions) -> None:
    if options.effort not in get_args(Effort):
        raise FieldError("/effort", f"must be 'refine' or 'atlas'; it is {options.effort!r}")
    if options.effort == "atlas" and options.start_from is not None:
        raise FieldError("/start_from", "has no effect with effort 'atlas', which does not search")
    check_top(options.top)
    check_above_zero(budget=options.budget)


def _source(options: SearchOptions) -> tuple[SeedTables | Scan, Atlas | None]:
    """Return the origin of four-bars, and the atlas of the request."""
    atlas = None if options.atlas is None else as_atlas(options.atlas)
    if options.effort == "refine":
        return seed_tables(), atlas
    atlas = atlas or default_atlas()
    return atlas.scan, atlas


def _read_motion(
    arguments: Sequence[object], requested_limits: Fields | None, more: Fields
) -> tuple[Motion, Fields | None, dict[str, object]]:
    """Return the motion, the limits, and the arguments of studies."""
    named: dict[str, object] = dict(more)
    known = [*SearchOptions.__dataclass_fields__, "limits", "work", *signature(Motion).parameters, *STUDIES]
    for name in named:
        if name not in known:
            similar = get_close_matches(name, known)
            names = f"near: {', '.join(similar)}" if similar else f"there are {', '.join(sorted(known))}"
            raise TypeError(f"synthesize() has no argument {name!r}; {names}")
    studies = {name: named.pop(name) for name in STUDIES if name in named}
    if not (arguments and isinstance(arguments[0], Motion)):
        return build(Motion, named, *arguments), requested_limits, studies
    if named or len(arguments) > 2:
        raise TypeError(
            f"synthesize() accepts only limits and studies beside a Motion, not {', '.join(named) or 'a third argument'}"
        )
    if len(arguments) > 1 and arguments[1] is not None:
        requested_limits = mapping("limits", arguments[1])
    return arguments[0], requested_limits, studies


def _preference(prefer: str | None, motion: Motion, searches: bool, only_error: bool) -> Prefer:
    """Return the preference.

    ``searches``: whether linkages are searched, and not taken from an atlas or a given linkage; ``only_error``: whether the error
    decides by default, since lengths are rounded or the request declines the practical limits.
    """
    positions = motion.samples.position is not None
    if prefer is None and searches and not only_error and motion.free and motion.travel is None:
        return "balanced"
    if prefer is None:
        return "size" if motion.tolerances is not None and searches and positions else "error"
    name: Prefer = one_of("prefer", prefer, PREFER)
    if name != "error" and not searches:
        raise FieldError("/prefer", "must be 'error', because no linkages are searched for")
    if name == "size" and not positions:
        raise FieldError("/prefer", "'size' needs `position`: only positions fix the size of a linkage")
    if name == "crank_span" and (not motion.free or motion.travel is not None):
        raise FieldError("/prefer", "has no effect, because all linkages have the given crank angles or travel")
    return name


def _narrower(
    named_limits: frozenset[str], motion: Motion, limits: Limits, source: SeedTables | Scan
) -> tuple[list[Limits], float | None]:
    """Return narrower limits that may be searched too, and the fair size of linkages; see `Task`.

    With given crank angles there are none if the request names the preset, because only the error counts then.
    If a length or ratio of the request allows more than a fair size, all linkages in proportion are fair.
    """
    if isinstance(source, Scan) or ("preset" in named_limits and not motion.free):
        return [], None
    practical = within_practical(motion.samples, limits, motion.samples.closed)
    narrower = [] if practical is None else [practical]
    if motion.free:
        return narrower, None
    samples, units = motion.samples, {"link_ratio_max": 1.0}
    if samples.position is not None:
        units |= dict.fromkeys(("link_max", "coupler_radius_max"), samples.extent)
    allowed: dict[str, float | None] = {name: getattr(limits, name) for name in units}
    wider = any((allowed[name] or 0.0) > FAIR_PROPORTION * unit for name, unit in units.items())
    longest = PROPORTION if wider else FAIR_PROPORTION
    lengths: dict[str, float | Reach] = {
        name: min(longest * unit, allowed[name] or np.inf) for name, unit in units.items()
    }
    if samples.position is not None:
        distance = longest * samples.extent
        lengths["pivot_reach"] = Reach(complex(samples.position_mean(samples.position)), distance, distance)
    try:
        return [*narrower, build(replace, lengths, limits)], longest
    except FieldError:  # a limit of the request excludes them
        return [], None
