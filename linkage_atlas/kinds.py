"""Which kinds of mechanism a request asks for, and the best of several kinds side by side: none is ranked by its error alone.

A rail or slot is the limit of a circle, so that without limits a four-bar always comes nearest; what sliders buy is a better
transmission angle, a smaller machine, a straight drive. So of linkages driven alike all stay that no other one beats in error,
size and transmission angle at once (the Pareto front), ordered by what is preferred.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar, get_args

import numpy as np

from linkage_atlas.answers import AnySolution, finished, finished_guided, merit, proportion_of
from linkage_atlas.arguments import kinds_among, one_of
from linkage_atlas.assemblies import AskedAssembly, Assembly, assembled
from linkage_atlas.linkages import KindName
from linkage_atlas.motions import Motion
from linkage_atlas.studies import Studies
from synthesis.arrays import Flags, Floats
from synthesis.errors import FieldError
from synthesis.fourbar import solution as fourbar
from synthesis.fourbar.limits import FORMS, Limits
from synthesis.fourbar.passage import size_of
from synthesis.free.poses import Poses
from synthesis.free.search import go_astray
from synthesis.guided import solution as guided
from synthesis.guided.by_crank import BY_CRANK, linkages_by_crank
from synthesis.guided.linkage import Driver, GuidedLinkage, Kind
from synthesis.guided.search import NOTHING_ROUND, search_guided
from synthesis.guided.solution import broken_limits
from synthesis.ranking import APART, FAIR, behind, by_proportion, distinct
from synthesis.search.search import StoppedBy
from synthesis.target import Samples, Target
from synthesis.work import OutOfTime, Work

MECHANISMS = get_args(KindName)
DRIVERS = tuple(one.value for one in Driver)
NO_ROTATION = "Only four-bars were searched: linkages with sliders need positions without rotations, or with two of them or more."
NO_LEAD = "Linkages with sliders were not searched: they begin with rotations of a four-bar, and none was found for this path."
ROUND_AGAIN = (
    "Only drives that turn fully were searched: sliders and cylinders would have to turn back on a closed path."
)
OUTSIDE_BOX = "Left out, because no such linkage has its pivots, rails and pins of slots inside the pivot box: {}."
_PIVOT_BOXES = ("pivot_box", "pivot_a_box", "pivot_b_box")
NO_TIME = "The time was up before linkages with sliders were searched."
_FOUR_BARS = 0.4
"""Part of a budget that the search among four-bars takes at most, where other kinds are asked for too."""
_LEADS, _FIRST_ROUNDS, _OTHERWISE = 3, 4, 1e-2
"""Four-bars whose rotations linkages with sliders begin with where none are asked for: the best of so many rounds, whatever the
time, and the best of an ended search, with rotations so many radians apart. So more time only adds to what is looked at."""
_NEAR_ENOUGH = 1.1
"""Without tolerances: times the least error up to which something else may be preferred."""
UNRANKED = (True, 0, 0)
"""Where there are no layers, or the time did not reach them: behind free ones."""
_NO_ANSWER, _TIMES_LESS = 0.1, 10.0
"""J from which on a linkage is no answer where another one's is so many times less."""
_ROUNDING = 1e-6
"""Part by which errors of two linkages differ at most that make the same motion."""
_SAME = 1e-3
"""Part by which all measures of two linkages differ at most that are shown once."""
_STEP = np.deg2rad(5.0)
"""Exact linkages are ordered by their transmission angle in steps."""


class Kinds(NamedTuple):
    """Kinds of mechanism, and what drives them."""

    kinds: tuple[Kind, ...] = (Kind.FOUR_BAR,)
    driver: Driver | None = None

    @property
    def four_bars_alone(self) -> bool:
        """Whether four-bars are all that is asked for."""
        return self.kinds == (Kind.FOUR_BAR,)

    @property
    def sliders(self) -> list[Kind]:
        """The kinds that have a rail or a slot."""
        return [kind for kind in self.kinds if kind is not Kind.FOUR_BAR]

    @property
    def four_bars(self) -> bool:
        """Whether four-bars are looked for: they are driven by their crank."""
        return Kind.FOUR_BAR in self.kinds and self.driver in (None, Driver.CRANK)


def read_kinds(mechanisms: Any, driver: Any, motion: Motion) -> Kinds:
    """The kinds that are asked for, checked against the motion. Raises `FieldError` naming the argument."""
    given = ("four_bar",) if mechanisms is None else mechanisms
    given = (given,) if isinstance(given, str) and given != "all" else given
    kinds = tuple(map(Kind, kinds_among(given, MECHANISMS)))
    asked = Kinds(kinds, None if driver is None else Driver(one_of("driver", driver, DRIVERS)))
    _check(asked, motion)
    return asked


def _check(asked: Kinds, motion: Motion) -> None:
    by = asked.driver
    if asked.four_bars_alone and by not in (None, Driver.CRANK):
        raise FieldError("/driver", f"a four-bar is driven by its crank: choose `mechanisms` that a {by} can drive")
    if by in (Driver.SLIDER, Driver.CYLINDER, Driver.HINGE) and not _driven(asked, (by,)):
        raise FieldError("/driver", f"none of the kinds asked for has a {by}")
    if _comes_round(motion.samples) and by in (Driver.SLIDER, Driver.CYLINDER):
        raise FieldError(
            "/driver", f"a {by} would have to turn back: a closed way is passed by drives that turn fully"
        )
    if (
        _comes_round(motion.samples)
        and not asked.four_bars
        and not any(kind in asked.kinds for kind in goes_round(by))
    ):
        raise FieldError("/mechanisms", "none of them has a drive that turns fully, as a closed way asks for")
    if motion.travel is not None:
        if asked.four_bars_alone:
            raise FieldError(
                "/mechanisms", "travel drives sliders and cylinders: ask for kinds that have one, or 'all'"
            )
        if by not in (None, Driver.SLIDER, Driver.CYLINDER):
            raise FieldError("/driver", f"travel drives sliders and cylinders, not a {by}")
        if not _driven(asked, (Driver.SLIDER, Driver.CYLINDER)):
            raise FieldError("/mechanisms", "none of them is driven by a slider or cylinder, as travel does")
    elif not motion.free:
        if by not in (None, Driver.CRANK):
            raise FieldError("/driver", f"crank angles drive cranks, not a {by}: give `travel`, or `timing` 'free'")
        if not _driven(asked, (Driver.CRANK,)):
            raise FieldError(
                "/mechanisms",
                "none of them has a crank, and crank angles are given: give `travel`, or `timing` 'free'",
            )
    along = isinstance(motion.samples, Target) and motion.samples.position is not None
    if along and any(kind in BY_CRANK for kind in asked.kinds):
        return
    four_bars = asked.four_bars and motion.travel is None  # which drives none of them
    if not four_bars and not has_poses(motion.samples) and not is_way(motion):
        field = "rotation" if motion.samples.rotation is None else "position"
        raise FieldError(f"/{field}", "linkages with sliders need rotation and position at two samples or more")


def check_kinds_alone(effort: str, refine_from: Any, start_from: Any) -> None:
    """FieldError for what only a request for four-bars alone can have."""
    for name, asked, why in (
        ("effort", effort == "atlas", "the atlas holds four-bars alone"),
        ("refine_from", refine_from is not None, "four-bars alone are refined"),
        ("start_from", start_from is not None, "only the search among four-bars begins with given linkages"),
    ):
        if asked:
            raise FieldError(f"/{name}", f"{why}: leave `mechanisms` out")


def check_sliders_alone(limits: Limits) -> None:
    """FieldError for limits of sliders where four-bars alone are asked for."""
    for name, form in FORMS.items():
        if form.concerns == "sliders" and getattr(limits, name) is not None:
            raise FieldError(
                f"/limits/{name}", "applies to sliders, which four-bars do not have: choose other `mechanisms`"
            )


_DRIVEN: dict[Driver, tuple[Kind, ...]] = {
    Driver.CRANK: (Kind.FOUR_BAR, Kind.SLIDER_CRANK, Kind.SWINGING_BLOCK),
    Driver.SLIDER: (Kind.SLIDER_CRANK, Kind.RAIL_SLOT, Kind.TWO_RAILS),
    Driver.CYLINDER: (Kind.SWINGING_BLOCK, Kind.RAIL_SLOT, Kind.TWO_SLOTS),
    Driver.HINGE: (Kind.SWINGING_BLOCK, Kind.RAIL_SLOT, Kind.TWO_SLOTS),
}


def goes_round(driver: Driver | None) -> set[Kind]:
    """The kinds whose drive, or this one, may turn fully: the hinge of a rail and a slot never passes the rail's direction."""
    drivers = (Driver.CRANK, Driver.HINGE) if driver is None else (driver,)
    return {kind for one in drivers for kind in _DRIVEN[one] if one.turns} - {Kind.RAIL_SLOT}


def _driven(asked: Kinds, drivers: Sequence[Driver]) -> bool:
    return any(kind in _DRIVEN[driver] for driver in drivers for kind in asked.kinds)


def _comes_round(samples: Samples) -> bool:
    """Whether the way leads from the last sample on to the first."""
    return isinstance(samples, Poses) and samples.closed


def has_poses(samples: Samples) -> bool:
    """Whether rotation and position are given together at two samples or more."""
    if samples.rotation is None or samples.position is None:
        return False
    poses = as_poses(samples)
    return poses.full.size >= 2


def is_way(motion: Motion) -> bool:
    """Whether positions are asked for whose rotations and times are free."""
    free = isinstance(motion.samples, Poses) and motion.travel is None
    return free and motion.samples.position is not None and not has_poses(motion.samples)


def as_poses(samples: Samples) -> Poses:
    """Samples without their crank angles."""
    if isinstance(samples, Poses):
        return samples
    names = ("rotation", "position", "length_scale", "rotation_weights", "position_weights")
    columns: dict[str, Any] = {name: getattr(samples, name) for name in names}
    return Poses(**columns)


# -- the search ------------------------------------------------------------------------------------------------------

FourBars = Callable[[Limits, Work, int | None], tuple[list[fourbar.Solution], "Course"]]
"""The search among four-bars, by so many rounds at most: linkages and how it went."""
Found = fourbar.Solution | guided.GuidedSolution
One = TypeVar("One", fourbar.Solution, Found)


class Course(NamedTuple):
    """How a search went, among whichever kinds."""

    stages: dict[str, float]
    """Seconds."""
    trace: list[tuple[float, float]]
    stopped_by: str
    counts: dict[str, Any]
    unseen: float | None = None
    notes: Sequence[str] = ()
    continued: Sequence[fourbar.Solution | None] = ()
    """The result of each linkage of `start_from`."""

    def ended_by(self, time_up: bool) -> Course:
        """The same, ended by its budget if the time was up."""
        return self._replace(stopped_by=StoppedBy.BUDGET.value) if time_up else self


def search_kinds(
    asked: Kinds,
    motion: Motion,
    limits: Limits,
    tolerance: float,
    four_bars: FourBars,
    work: Work,
    rounds: int | None = None,
) -> tuple[list[Found], Course]:
    """Linkages of all kinds asked for, within the limits, in no order; by so many rounds at most for those with sliders."""
    found: list[Found] = []
    trace: list[tuple[float, float]] = []
    seeds, notes = 0, list[str]()
    stopped: set[str] = set()
    led = bool(asked.sliders) and is_way(motion)
    sliders = led or (bool(asked.sliders) and has_poses(motion.samples))
    leads: list[fourbar.Solution] = []
    sure: list[tuple[float, float | None]] = []  # the least J of each search, and the chance that it missed less
    if (asked.four_bars or led) and motion.travel is None:
        part = work.part(_FOUR_BARS * work.budget) if sliders and np.isfinite(work.budget) else work
        # beside four-bars no time is kept for sliders before the rounds have ended that they begin with, whatever the time
        begun = [four_bars(limits, work if asked.four_bars else part, _FIRST_ROUNDS)] if led else []
        first = [lead for leads, _ in begun for lead in leads[:1]]
        cut_off = any(course.stopped_by == StoppedBy.BUDGET.value for _, course in begun)
        searches = begun if cut_off else [four_bars(limits, part, rounds), *begun]
        leads, course = searches[0]
        if asked.four_bars:
            for ones, how in reversed(searches):
                found, trace = found + ones, _fallen(trace, how.trace)
            sure.append((_least(trace), course.unseen))
        seeds += course.counts["seeds"] or 0
        stopped.add(course.stopped_by)
        notes += course.notes
        if led and _by_hinge_alone(asked, motion.samples):  # which turns the body round, as a double crank does
            first, (leads, _) = [], four_bars(replace(limits, family="double_crank"), part, rounds)
        if first:
            leads = first + (leads if course.stopped_by != StoppedBy.BUDGET.value else [])
    beginnings: list[GuidedLinkage] = []
    by_crank = [kind for kind in asked.sliders if kind in BY_CRANK and asked.driver in (None, Driver.CRANK)]
    if isinstance(motion.samples, Target) and motion.samples.position is not None:
        for kind in by_crank:
            ones_by_crank, by_report = linkages_by_crank(kind, motion.samples, tolerance=tolerance, work=work)
            kept = [one for one in ones_by_crank if not broken_limits(one, motion.samples, limits)]
            found, seeds = [*found, *kept], seeds + by_report.seeds
            beginnings += [one.linkage for one in ones_by_crank]
            least = min((one.errors.objective for one in kept), default=np.inf)
            trace, sure = _fallen(trace, [(work.elapsed, least)] * bool(kept)), [*sure, (least, None)]
            stopped.add(by_report.stopped_by.value)
    between = work.elapsed
    if sliders and found and work.expired():
        notes.append(NO_TIME)
    elif sliders:
        given, driver = _given(motion, asked.driver)
        poses = as_poses(motion.samples)
        if led and not leads:
            notes.append(NO_TIME if work.expired() else NO_LEAD)
        for turned in _rotations(leads, poses) if led else [None]:
            others, report = search_guided(
                poses, limits, asked.sliders, driver, tolerance, work, given, turned, rounds, beginnings
            )
            found, trace = [*found, *others], _fallen(trace, report.trace)
            sure.append((_least(report.trace), None if led else report.unseen))
            seeds += report.seeds
            notes += [note for note in report.notes if note not in notes]
            stopped.add(report.stopped_by.value)
            if work.expired():
                break
        if _comes_round(motion.samples) and not set(notes) & set(NOTHING_ROUND.values()):
            notes.append(ROUND_AGAIN)
    if asked.sliders and not sliders and not by_crank:
        notes.append(NO_ROTATION)
    elif found and any(getattr(limits, name) is not None for name in _PIVOT_BOXES):
        made = {one.linkage.kind for one in found if isinstance(one, guided.GuidedSolution)}
        if left := [kind.value.replace("_", " ") for kind in asked.sliders if kind not in made]:
            notes.append(OUTSIDE_BOX.format(", ".join(left)))
    worst = (StoppedBy.BUDGET, StoppedBy.CONVERGED, StoppedBy.TOLERANCE)
    stopped_by = next(one.value for one in worst if one.value in stopped)
    stages = {"screen": between, "refine": work.elapsed - between}
    counts = {"seeds": seeds, "windows": None, "exhaustive": None}
    least, unseen = min(sure, key=lambda one: one[0], default=(np.inf, None))
    unseen = None if least <= tolerance else unseen
    return found, Course(stages, trace, stopped_by, counts, unseen=unseen, notes=notes)


def _by_hinge_alone(asked: Kinds, samples: Samples) -> bool:
    """Whether a way is closed and of the linkages with sliders a hinge alone goes round."""
    by_crank = asked.driver in (None, Driver.CRANK) and set(asked.kinds) & set(_DRIVEN[Driver.CRANK])
    return _comes_round(samples) and not asked.four_bars and not by_crank


def _least(trace: Sequence[tuple[float, float]]) -> float:
    return min((error for _, error in trace), default=np.inf)


def _fallen(trace: list[tuple[float, float]], more: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """A trace, and of another search where it fell below that."""
    least = _least(trace)
    return trace + [pair for pair in more if pair[1] < least]


def _turned(lead: fourbar.Solution, poses: Poses) -> Floats:
    """The rotations of a four-bar along the way of the poses, in radians (N,)."""
    assert lead.crank is not None
    return lead.linkage.joints(lead.crank[: poses.samples]).rotation


def _rotations(leads: Sequence[fourbar.Solution], poses: Poses) -> list[Floats]:
    """The rotations of the first four-bars that turn otherwise than one another."""
    kept: list[Floats] = []
    for one in leads:
        turned = _turned(one, poses)
        if all(np.ptp(turned - other) > _OTHERWISE for other in kept):
            kept.append(turned)
        if len(kept) == _LEADS:
            break
    return kept


def _given(motion: Motion, driver: Driver | None) -> tuple[Floats | None, Driver | None]:
    """The drive that is given, and what it drives."""
    if motion.travel is not None:
        return motion.travel, driver
    if isinstance(motion.samples, Target):
        return motion.samples.crank, Driver.CRANK
    return None, driver


# -- side by side ----------------------------------------------------------------------------------------------------


Rank = tuple[bool, int, int]
"""Of layers, less is better: whether none are free, fixed pivots over which something passes, layers."""


class Measures(NamedTuple):
    """What linkages of several kinds are compared by; less is better."""

    error: float
    """J, at least the tolerance: below it all are exact."""
    size: float
    loss: float
    """The transmission angle, negative."""
    driver: str
    layers: Rank = (False, 0, 0)
    """Where they are preferred."""

    def beats(self, other: Measures) -> bool:
        """Whether it is as good in everything, better in something, and driven alike."""
        pairs: list[tuple[Any, Any]] = [*zip(self[:3], other[:3]), (self.layers, other.layers)]
        return self.driver == other.driver and all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)

    def same_as(self, other: Measures) -> bool:
        """Whether nobody could tell both apart by them."""
        return all(abs(a - b) <= _SAME * max(abs(a), abs(b)) for a, b in zip(self[:3], other[:3]))


def measures_of(one: Found, samples: Samples, tolerance: float, layers: Rank = (False, 0, 0)) -> Measures:
    """The measures of a linkage."""
    error = max(one.errors.objective, tolerance)
    if isinstance(one, guided.GuidedSolution):
        size, driver = guided.size_of(one, samples), one.linkage.driver.value
    else:
        size, driver = size_of(one.linkage, samples), Driver.CRANK.value
    return Measures(error, np.inf if size is None else size, -one.transmission_angle_min, driver, layers)


def smaller_first(found: Sequence[One], samples: Samples) -> list[One]:
    """Answers by their errors; of those that have the same but for rounding, as cognates do, the best proportioned first."""
    ranked, ends = sorted(found, key=lambda one: one.errors.objective), 0
    for k, one in enumerate(ranked):
        if k == ends:  # the first of those that are alike
            most = (1 + _ROUNDING) * one.errors.objective
            ends = next((j for j in range(k, len(ranked)) if ranked[j].errors.objective > most), len(ranked))
            ranked[k:ends] = sorted(ranked[k:ends], key=lambda other: proportion_of(other, samples))
    return ranked


def exact_below(samples: Samples, tolerance: float) -> float:
    """J below which a linkage is exact: the tolerance, or what the rounding of positions far from the origin leaves."""
    if samples.position is None:
        return tolerance
    return max(tolerance, 2 * float(np.finfo(float).eps * np.abs(samples.position).max() / samples.length_scale))


def proportionate(found: Sequence[One], samples: Samples, tolerance: float, fair: float = FAIR) -> list[One]:
    """Answers in the order in which they are shown, see `by_proportion`."""
    if not found:
        return []
    ranked = smaller_first(found, samples)
    objective = np.array([one.errors.objective for one in ranked])
    times = np.array([proportion_of(one, samples) for one in ranked])
    return [ranked[k] for k in by_proportion(objective, times, exact_below(samples, tolerance), fair).tolist()]


def _staying(found: Sequence[Found], samples: Samples, tolerance: float) -> list[Found]:
    """Return those whose body stays between samples; all if none of these is near."""
    if not isinstance(samples, Poses) or samples.position is None:
        return list(found)
    strays = strays_between(found, samples)
    groups = behind(np.array([one.errors.objective for one in found]), strays, tolerance)
    left_out = strays & np.where(groups == 1, np.any(groups == 0), np.any((groups == 0) | (groups == 2)))
    return [one for one, out in zip(found, left_out) if not out]


def strays_between(found: Sequence[Found], poses: Poses) -> Flags:
    """Check for each linkage whether the body goes elsewhere between samples, (n,)."""
    strays = np.zeros(len(found), dtype=bool)
    four_bars = [k for k, one in enumerate(found) if isinstance(one, fourbar.Solution)]
    some: list[Any] = [found[k] for k in four_bars]
    strays[four_bars] = go_astray(some, poses)
    for k, one in enumerate(found):
        if isinstance(one, guided.GuidedSolution):
            strays[k] = guided.goes_astray(one, poses)
    return strays


def front(
    found: Sequence[Found],
    motion: Motion,
    limits: Limits,
    prefer: str,
    tolerance: float,
    top: int,
    ranks: Mapping[int, Rank] | None = None,
) -> list[Found]:
    """The Pareto front of linkages of several kinds, at most ``top``, in the order of what is preferred.

    Law: none of them beats another. Where there are more, the best of each kind and drive come before further ones. Within
    the practical limits those that stray between samples are left out where others are near.

    ``ranks``: of their layers, by id, where these are preferred; without them none is left out for being beaten.
    """
    samples = motion.samples
    if limits.practical:
        found = _staying(found, samples, tolerance)
    poor = max(_NO_ANSWER, _TIMES_LESS * min((one.errors.objective for one in found), default=0.0))
    unranked, rank_of = prefer == "layers" and ranks is None, ranks or {}
    known = [
        (measures_of(one, samples, tolerance, rank_of.get(id(one), UNRANKED)), one)
        for one in found
        if one.errors.objective <= poor
    ]
    kept: list[tuple[Measures, Found]] = []
    for mine, one in known:
        if (unranked or not any(other.beats(mine) for other, _ in known)) and not any(
            _sort(one) == _sort(before) and mine.same_as(other) for other, before in kept
        ):
            kept.append((mine, one))
    if not kept:
        return []
    near = near_enough(motion, min(mine.error for mine, _ in kept))

    def place(pair: tuple[Measures, Found]) -> tuple[Any, ...]:
        mine, one = pair
        by_error = (mine.error, np.floor(mine.loss / _STEP), mine.size)
        if prefer == "error":
            return False, *by_error
        if not near(one):
            return True, *by_error
        if prefer == "layers":
            return False, mine.layers, *by_error
        if prefer == "crank_span":
            return False, span_of(one), *by_error
        return False, mine.size if prefer == "size" else mine.loss, *by_error

    kept.sort(key=place)
    rank = {id(one): number for number, (_, one) in enumerate(kept)}
    apart: list[Found] = []
    for kind in {_sort(one) for _, one in kept}:
        alike: list[Any] = [one for _, one in kept if _sort(one) == kind]
        apart += distinct(alike, top, APART, order=lambda one: rank[id(one)], exact=tolerance)
    apart.sort(key=lambda one: rank[id(one)])
    first = {sort: one for one in reversed(apart) if (sort := _sort(one))}
    chosen = sorted(first.values(), key=lambda one: rank[id(one)])[:top]
    chosen += [one for one in apart if id(one) not in {id(two) for two in chosen}][: top - len(chosen)]
    return sorted(chosen, key=lambda one: rank[id(one)])


def target_of(one: Found, motion: Motion) -> Target:
    """The motion with the travel of the linkage's own drive."""
    if isinstance(one, guided.GuidedSolution):
        return guided.as_target(motion.samples, one.linkage, one.travel)
    return motion.one_of(motion.with_angles([one.linkage], [one.crank]), 0).target


def near_enough(motion: Motion, least: float) -> Callable[[Found], bool]:
    """Whether a linkage is inside the tolerances at every sample; without tolerances, whether J is near the least."""
    allowed = motion.tolerances
    if allowed is None:
        return lambda one: one.errors.objective <= _NEAR_ENOUGH * least
    return lambda one: bool(np.all(allowed.shares(target_of(one, motion), one.linkage) <= 1))


def layers_of(
    found: Sequence[Found], motion: Motion, least: float, asked: AskedAssembly, work: Work
) -> tuple[dict[int, Rank], dict[int, Assembly], int]:
    """Layers of linkages that are near enough, in their order.

    Returns how all of these rank, by id; the assemblies made, by id of the `linkage`; and how many the time did not reach.
    """
    near = list(filter(near_enough(motion, least), found))
    ranks: dict[int, Rank] = {id(one): UNRANKED for one in near}
    made: dict[int, Assembly] = {}
    for place, one in enumerate(near):
        try:
            work.go_on()
            layers = assembled(one.linkage, asked, target_of(one, motion).interval, motion.radian, work)
        except OutOfTime:
            return ranks, made, len(near) - place
        except FieldError:
            continue
        made[id(one.linkage)] = layers
        crossed = sum(not shaft.both_sides for shaft in layers.shaft.values())
        ranks[id(one)] = not layers.free, crossed, layers.count
    return ranks, made, 0


def span_of(one: Found) -> float:
    """How far its crank or hinge turns; infinite for other drives."""
    if not isinstance(one, guided.GuidedSolution):
        assert one.crank is not None
        return float(np.ptp(one.crank))
    return float(np.ptp(one.travel)) if one.linkage.driver.turns else np.inf


def _sort(one: Found) -> tuple[str, str]:
    if isinstance(one, guided.GuidedSolution):
        return one.linkage.kind.value, one.linkage.driver.value
    return Kind.FOUR_BAR.value, Driver.CRANK.value


def finished_kinds(
    chosen: Sequence[Found], motion: Motion, limits: Limits, tolerance: float, studies: Studies, work: Work
) -> list[AnySolution]:
    """Linkages of several kinds as a user reads them, in their order but for verdicts."""
    rank = {id(one): number for number, one in enumerate(chosen)}
    others = [one for one in chosen if isinstance(one, guided.GuidedSolution)]
    four_bars = [one for one in chosen if isinstance(one, fourbar.Solution)]
    solutions: list[AnySolution] = []
    for sliders in dict.fromkeys(
        isinstance(one, guided.GuidedSolution) for one in chosen
    ):  # the best one's sort first
        if solutions and work.expired():
            break
        if sliders:
            solutions += finished_guided(others, motion, limits, studies, work)
        else:
            solutions += finished(four_bars, motion, limits, tolerance, studies, None, work, by_error=False)

    solutions.sort(key=lambda one: (*merit(one), rank[id(one.origin.found)]))
    return [replace(one, rank=number) for number, one in enumerate(solutions, 1)]
