"""A request for linkages as a task: validated, in radians, with everything that the stages of `synthesize` need."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from linkage_atlas.answers import FINISHING
from linkage_atlas.arguments import check_above_zero, check_top, number
from linkage_atlas.atlases import Atlas, as_atlas, default_atlas
from linkage_atlas.drive_design.design import check_request
from linkage_atlas.limits import read_limits
from linkage_atlas.mechanism_types import Kinds, check_no_slider_limits, check_only_four_bars, read_kinds
from linkage_atlas.motions import Motion
from linkage_atlas.studies import STUDIES, Studies, check_lengths, check_rows, read_studies
from linkage_atlas.warm_start import Start, StartingLinkage, check_local, read_starts, starts_for
from synthesis.atlas.scan import Scan
from synthesis.errors import FieldError
from synthesis.fourbar.limits import Limits, Reach
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.free.screen import PathScreen
from synthesis.free.search import path_screens
from synthesis.ranking import FAIR, PROPORTION
from synthesis.search.seeds import SeedTables
from synthesis.work import Work

Prefer = Literal["error", "size", "transmission", "crank_span", "layers"]
PREFER = get_args(Prefer)


@cache
def seed_tables() -> SeedTables:
    """Return the coarse tables of the search, which the first call makes."""
    return SeedTables(FOURBAR)


@cache
def screens(family: str) -> tuple[PathScreen, ...]:
    """Return the screens for paths with free crank angles, which the first call makes."""
    return path_screens(family)


def prepare() -> None:
    """Make the coarse tables of the searches (about 0.3 s), which otherwise the first request makes."""
    seed_tables()
    screens("full_crank")


class Fair(NamedTuple):
    """Limits within which linkages have a fair size."""

    limits: Limits
    longest: float
    """Largest length of a part, in extents of the motion or in shortest links."""


@dataclass(frozen=True)
class Task:
    """A checked request in model units."""

    motion: Motion
    limits: Limits
    named_limits: Mapping[str, Any]
    """The limits as the request names them."""
    kinds: Kinds
    source: SeedTables | Scan
    """Origin of four-bars: the tables of a search, or an atlas."""
    starts: Sequence[Start] | None
    """The linkages of `start_from`."""
    local: bool
    """Only the linkages of `start_from` are refined, without a search."""
    prefer: Prefer
    tolerance: float
    top: int
    diverse: bool
    studies: Studies
    fair: Fair | None
    """Used if the request does not limit the proportions of linkages."""
    atlas: Atlas | None
    work: Work

    @property
    def by_error(self) -> bool:
        """True if the smallest error is preferred."""
        return self.prefer == "error"

    @property
    def rounds(self) -> bool:
        """True if solutions are ranked by their error with rounded lengths."""
        return self.studies.rounds and self.by_error and not self.diverse

    def search_work(self, reserved: float = 0.0) -> Work:
        """Return the work of the search; ``reserved``: fraction of the budget for the stages after it."""
        return self.work.extended(-FINISHING - reserved)


def read_task(
    motion: Sequence[Any],
    more: Mapping[str, Any],
    *,
    limits: Mapping[str, Any] | None,
    top: int,
    effort: str,
    prefer: str | None,
    diverse: bool,
    tolerance: float,
    budget: float | None,
    start_from: Sequence[StartingLinkage] | None,
    local: bool,
    atlas: Atlas | str | Path | None,
    work: Callable[[float | None], Work],
    mechanisms: Any,
    driver: Any,
) -> Task:
    """Check the arguments of `synthesize`.

    Raises
    ------
    FieldError
        If an argument is wrong; the error names it.
    """
    _check_effort(effort, start_from)
    local = check_local(local, start_from)
    check_top(top)
    check_above_zero(budget=budget)
    tolerance = number("tolerance", tolerance, 0.0)
    asked_motion, limits, studies = _read_motion(motion, limits, more)
    if effort == "atlas" and asked_motion.free:
        raise FieldError("/effort", "the atlas holds curves over crank angles: with free ones only 'refine' answers")
    kinds = read_kinds(mechanisms, driver, asked_motion)
    if not kinds.only_four_bars:
        check_only_four_bars(effort, start_from)
    # made once by the first request that needs them, before its time begins
    atlas = None if atlas is None else as_atlas(atlas)
    source: SeedTables | Scan
    if effort == "refine":
        source = seed_tables()
    else:
        atlas = atlas or default_atlas()
        source = atlas.scan
    watch = work(budget)
    checked_limits, checked_studies = read_limits(limits, asked_motion), read_studies(studies, asked_motion)
    starts = starts_for(read_starts(start_from, asked_motion.degrees), asked_motion)
    if checked_studies.drives is not None:
        check_request(checked_studies.drives, asked_motion.radian)
    if checked_studies.analysis is not None:
        check_rows(top, None if asked_motion.free else asked_motion.target.interval)
    task = Task(
        asked_motion,
        checked_limits,
        limits or {},
        kinds,
        source,
        starts,
        local,
        _preference(prefer, asked_motion, isinstance(source, SeedTables) and not local),
        tolerance,
        top,
        diverse and kinds.only_four_bars,
        checked_studies,
        _fair_within(limits or {}, asked_motion, checked_limits, source),
        atlas,
        watch,
    )
    if kinds.only_four_bars:
        check_no_slider_limits(checked_limits)
        check_lengths(checked_studies, checked_limits)
    return task


def _check_effort(effort: str, start_from: object) -> None:
    if effort not in ("refine", "atlas"):
        raise FieldError("/effort", f"wanted 'refine' or 'atlas', found {effort!r}")
    if effort == "atlas" and start_from is not None:
        raise FieldError("/start_from", "a search begins with these linkages, and with effort 'atlas' there is none")


def _read_motion(
    motion: Sequence[Any], limits: Mapping[str, Any] | None, more: Mapping[str, Any]
) -> tuple[Motion, Mapping[str, Any] | None, dict[str, Any]]:
    """Return the motion, the limits, and the arguments of studies."""
    named = dict(more)
    studies = {name: named.pop(name) for name in STUDIES if name in named}
    if not (motion and isinstance(motion[0], Motion)):
        return Motion(*motion, **named), limits, studies
    if named or len(motion) > 2:
        raise TypeError(f"beside a Motion and its limits there is no {', '.join(named) or 'third argument'}")
    return motion[0], motion[1] if len(motion) > 1 else limits, studies


def _preference(prefer: str | None, motion: Motion, searches: bool) -> Prefer:
    """Return the preference; ``searches``: whether linkages are searched, and not taken from an atlas or a given linkage."""
    positions = motion.samples.position is not None
    if prefer is None:
        return "size" if motion.tolerances is not None and searches and positions else "error"
    for name in PREFER:
        if name != prefer:
            continue
        if name != "error" and not searches:
            raise FieldError("/prefer", "linkages are not searched for here, so that only 'error' has a meaning")
        if name == "size" and not positions:
            raise FieldError("/prefer", "'size' needs `position`: only positions fix the size of a linkage")
        if name == "crank_span" and (not motion.free or motion.travel is not None):
            raise FieldError("/prefer", "the crank angles or the travel are given: all linkages turn alike far")
        return name
    raise FieldError("/prefer", f"wanted one of {', '.join(PREFER)}, found {prefer!r}")


def _fair_within(
    named_limits: Mapping[str, Any], motion: Motion, limits: Limits, source: SeedTables | Scan
) -> Fair | None:
    """Return limits within which linkages have a fair size, for requests that do not mention the preset.

    If a length or ratio of the request allows more, all linkages in proportion are fair.
    """
    if motion.free or "preset" in named_limits or isinstance(source, Scan):
        return None
    samples, units = motion.samples, {"link_ratio_max": 1.0}
    if samples.position is not None:
        units |= dict.fromkeys(("link_max", "coupler_radius_max"), samples.extent)
    allowed: dict[str, float | None] = {name: getattr(limits, name) for name in units}
    wider = any((allowed[name] or 0.0) > FAIR * unit for name, unit in units.items())
    longest = PROPORTION if wider else FAIR
    lengths: dict[str, Any] = {name: min(longest * unit, allowed[name] or np.inf) for name, unit in units.items()}
    if samples.position is not None:
        distance = longest * samples.extent
        lengths["pivot_reach"] = Reach(complex(samples.position_mean(samples.position)), distance, distance)
    try:
        return Fair(replace(limits, **lengths), longest)
    except FieldError:  # a limit of the request excludes them
        return None
