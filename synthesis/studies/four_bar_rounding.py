"""Link lengths that can be had: on a grid or from a list of stock lengths, with start, pose and offset fitted anew.

Which combination of stock lengths is best is a closest-point problem: near a solution the squared objective is a square form of
the four logarithms, whose triangle says how much each choice costs at least, link by link (Fincke and Pohst, Mathematics of
Computation 44 (1985), 463-471). So combinations come in the order of that estimate; each is then put in its best place.

With the start of the crank chosen, all directions of the links against the ground line are known, and the position error is
that of a complex least-squares problem in A and z, with a rotation w of modulus one beside them::

    P_m = A + w (L1 e^{i theta1_m} + z e^{i theta2_m}),    w = e^{i theta4}

Both columns that are free are projected out; then the best w is the direction of an inner product. So one unknown is left, the
start, which is scanned over the whole turn: no valley is missed that is wider than a step. What the scan finds is refined in
all six unknowns by least squares, with an augmented Lagrangian where limits are in the way (Nocedal and Wright, 17.4).
"""

from __future__ import annotations

import bisect
import heapq
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.constraints import BEGIN, COUPLER, END, PIVOT, TURNED, Constraints, keeps
from synthesis.four_bar import close_loop, wrap
from synthesis.fourbar.determination import derivative_matrix, residuals
from synthesis.least_squares import Evaluation, Minima, minimise
from synthesis.limits import Limits
from synthesis.linkage import Linkage, as_lengths, four_bar
from synthesis.mechanism import Placed
from synthesis.pose import rotation_residual
from synthesis.solution import Solution, assess
from synthesis.target import TURN, Target
from synthesis.violations import within
from synthesis.work import Work

# the choice of lengths
GRID_TRIES = 300
"""Combinations around the nearest that are tried at most; they come in the order of their estimate."""
AROUND = 3
"""Where the nearest lengths of a grid break a limit, so many steps to each side are looked at; where they only lose, one."""
_HARDLY = 1.01
"""Times the objective of the solution that the nearest lengths may have, for others not to be looked at."""
_EXACT = 1e-12
"""Objective of the nearest lengths that is only rounding."""
MOST_OPEN = 1 << 17
"""Choices of some links whose others are not chosen yet: about 50 MB."""
_TOGETHER = 64
"""Combinations that are scanned at once."""
_PLACED = 8
"""Combinations that are refined at once."""
_MOST_PLACED = 64
"""Combinations that are refined at most."""
_SCANS_OF_PLACING = 16
"""Within limits a place is found in the time of more scans than this: of few tries fewer are refined, at least `_PLACED`."""
_WORSE = 2.0
"""A combination whose squared objective in the scan, over fewer samples, is so many times the best one refined is given up."""
_NEARER = 1e-3
"""Weight of a length's own change beside the estimate: of lengths that the motion does not fix the nearest come first."""
# the best place of given lengths
_STARTS = 48
"""Starts of the scan in a turn."""
_SAMPLES = 16
"""The scan looks at about so many samples."""
_HALVINGS = 8
"""Of a step of the scan around its best start."""
_VALLEYS = 3
"""So many of the best valleys of the scan are refined."""
_STEPS = 200
"""Of the refinement at most; within limits a quarter of it in each round."""
_ROUNDS = 7
"""Of the multipliers."""
_WEIGHT, _GROWTH = 1.0, 10.0
"""Of a broken limit against the square of the objective, and its growth with each round."""
NONE_CLOSES = "none of the lengths tried closes at all crank angles of this solution within the limits of shape"
NO_PLACE = "none of the lengths tried has a place within the limits at the crank angles of this solution"
NO_TIME = "the time was up before a linkage of lengths that can be had was in its place"
_MARGIN = 1e-8
"""How far inside the limits the refinement aims: what rounding leaves of it is inside too."""


@dataclass(frozen=True)
class Rounding:
    """What came of looking for lengths that can be had.

    ``solution``: the best; None where no combination that was tried has a place within the limits. ``tried``: how many
    combinations were fitted. ``combinations``: how many there are; None for a grid, which has no end. ``exhaustive``:
    whether the choice is the best of all combinations: every one was scanned over the whole turn of the start, and
    refined unless the scan shows it to be worse. None for a grid. ``reason``: why there is no solution.
    """

    solution: Solution | None
    tried: int
    combinations: int | None = None
    exhaustive: bool | None = None
    reason: str | None = None


def round_to_grid(
    target: Target, solution: Solution, grid: float, limits: Limits, tries: int, work: Work
) -> Rounding:
    """The solution with its links on a grid and everything else fitted anew, within the limits.

    ``target``: with positions: only then are lengths actual. ``grid``: step of the lengths, in the user's unit; a link
    is at least one step long. ``tries``: at most so many combinations beside the nearest. ``work``:
    once it has expired no further combinations are tried than the first few.

    The nearest lengths where these hardly lose or are exact, otherwise the best of them and of some around them.
    Law: no length is off the grid but those that the limits give; the choice is no worse than the nearest lengths, and of
    lengths within one step of these; where they break a limit in every place, within `AROUND` steps.
    """
    old, given = solution.linkage, given_lengths(limits)
    steps = np.maximum(np.round(np.array(old.links) / grid), 1.0)
    links = np.where(np.isnan(given), multiples(steps, grid), given)[None]
    starts = scan(target, links, old.branch, limits)[1]
    found = place(target, links, old.branch, starts, old, limits, work)[0]
    if found is not None and found.errors.objective <= max(_HARDLY * solution.errors.objective, _EXACT):
        return Rounding(found, 1)
    if work.expired():
        return Rounding(None, 0, reason=NO_TIME) if found is None else Rounding(found, 1)
    around, most = (AROUND, GRID_TRIES) if found is None else (1, _TOGETHER)
    near = [multiples(np.arange(max(1.0, step - around), step + around + 1), grid) for step in steps]
    near = [values if np.isnan(length) else np.array([length]) for values, length in zip(near, given)]
    best = _best_of(target, solution, near, limits, min(tries, most), work)
    if found is None or (best.solution is not None and best.solution.errors.objective < found.errors.objective):
        return Rounding(best.solution, best.tried, reason=best.reason)
    return Rounding(found, max(best.tried, 1))


def best_from_stock(
    target: Target, solution: Solution, stock: Sequence[float], limits: Limits, tries: int, work: Work
) -> Rounding:
    """The solution with each link of a stock length and everything else fitted anew, within the limits; arguments as above.

    Law: each length is one of the stock; where it is exhaustive no combination is better.
    """
    choices = [np.unique(stock) if np.isnan(length) else np.array([length]) for length in given_lengths(limits)]
    return _best_of(target, solution, choices, limits, tries, work)


def multiples(steps: Floats, grid: float) -> Floats:
    """Whole numbers of steps of a grid as one writes them: three tenths are 0.3, and no more."""
    return np.array([float(f"{length:.15g}") for length in (steps * grid).tolist()])


def given_lengths(limits: Limits) -> Floats:
    """Lengths that the limits give, which are no choice, (4,); NaN for the others."""
    given = np.array([np.nan if length is None else length for length in limits.links])
    if limits.pivot_a is not None and limits.pivot_b is not None:
        given[3] = abs(limits.pivot_b - limits.pivot_a)
    return given


def _best_of(
    target: Target, solution: Solution, choices: Sequence[Floats], limits: Limits, tries: int, work: Work
) -> Rounding:
    """The best combination of lengths, one of each of four lists."""
    old = solution.linkage
    every = int(np.prod([float(values.size) for values in choices]))
    order = _nearest_first(target, solution, choices)
    tried = 0
    found: list[tuple[Floats, Floats, Floats]] = []
    while tried < tries and (links := np.array(list(itertools.islice(order, min(_TOGETHER, tries - tried))))).size:
        if found and work.expired():
            break
        found.append((links, *scan(target, links, old.branch, limits)))
        tried += len(links)
    links, cost, starts = (np.concatenate(columns) for columns in zip(*found))
    best: Solution | None = None
    refined_all = True
    ranked = np.flatnonzero(np.isfinite(cost))[np.argsort(cost[np.isfinite(cost)], kind="stable")]
    for first in range(0, ranked.size, _PLACED):
        if best is not None and cost[ranked[first]] > _WORSE * best.errors.objective**2:
            break
        if first >= min(_MOST_PLACED, max(_PLACED, tries // _SCANS_OF_PLACING)):
            refined_all = False
            break
        some = ranked[first : first + _PLACED]
        for one in place(target, links[some], old.branch, starts[some], old, limits, work):
            if one is not None and (best is None or one.errors.objective < best.errors.objective):
                best = one
        if work.expired():  # perhaps before the last was in its place
            tried, refined_all = tried if best is not None else 0, False
            break
    why = NONE_CLOSES if not ranked.size else NO_TIME if work.expired() else NO_PLACE
    return Rounding(best, tried, every, tried == every and refined_all, None if best is not None else why)


def _nearest_first(target: Target, solution: Solution, choices: Sequence[Floats]) -> Iterator[Floats]:
    """Combinations of lengths, one of each rising list, by their estimated objective; best first."""
    old = solution.linkage
    triangle, right = response_to_lengths(target, old)
    size = _NEARER * max(float(np.abs(triangle).max()), np.finfo(float).tiny)
    stack = np.concatenate([np.column_stack([triangle, right]), size * np.eye(4, 5)])
    upper: Any = np.linalg.qr(stack, mode="r")
    moved = [np.log(values / length) for values, length in zip(choices, old.links)]
    for chosen in nearest_of(upper, [column.tolist() for column in moved]):
        yield np.array([values[place] for values, place in zip(choices, chosen)])


def nearest_of(upper: Floats, moved: Sequence[Sequence[float]]) -> Iterator[tuple[int, ...]]:
    """Places in lists of numbers d_k, one in each, by ``|upper[:4, :4] @ d + upper[:4, 4]|^2``; the least first.

    Where lengths are so badly determined that more than `MOST_OPEN` choices are open, those are left out that stand beside the
    ones looked at from then on.

    ``upper`` (5, 5): upper triangular, no zero on its diagonal. ``moved``: each rising.
    """
    rows = [[float(value) for value in row] for row in upper]
    # A node is a choice for the last links; its children choose the link before, the nearest first. Along a rising list that is
    # from the nearest outward, so an open node is two places in it: there may be a hundred thousand of them.
    heap: list[tuple[float, tuple[int, ...], int, int, float, float]] = []

    def push(chosen: tuple[int, ...], below: int, above: int, bound: float, rest: float) -> None:
        link = 3 - len(chosen)
        column, slope = moved[link], rows[link][link]
        costs = [
            bound + (gap := slope * column[place] + rest) * gap if 0 <= place < len(column) else math.inf
            for place in (below, above)
        ]
        if costs[0] <= costs[1] and below >= 0:
            heapq.heappush(heap, (costs[0], (below, *chosen), below - 1, above, bound, rest))
        elif above < len(column):
            heapq.heappush(heap, (costs[1], (above, *chosen), below, above + 1, bound, rest))

    def open_node(bound: float, chosen: tuple[int, ...]) -> None:
        link = 3 - len(chosen)
        row = rows[link]
        rest = row[4] + sum(row[link + 1 + k] * moved[link + 1 + k][place] for k, place in enumerate(chosen))
        above = bisect.bisect_left(moved[link], -rest / row[link])
        push(chosen, above - 1, above, bound, rest)

    open_node(0.0, ())
    while heap:
        bound, chosen, below, above, before, rest = heapq.heappop(heap)
        if len(heap) < MOST_OPEN:
            push(chosen[1:], below, above, before, rest)
        if len(chosen) == 4:
            yield chosen
        else:
            open_node(bound, chosen)


class Places(NamedTuple):
    """Starts and poses of n linkages; the body point is that of the coupler's frame, from the crank pin."""

    start: Floats
    turn: Floats
    """Ground angles."""
    pivot: Complexes
    point: Complexes

    def unknowns(self, target: Target) -> Floats:
        """As the refinement sees them: of order one, (n, 6)."""
        size = target.length_scale
        moved = (self.pivot - _middle(target)) / size, self.point / size
        return np.stack([self.start, self.turn, *(part for z in moved for part in (z.real, z.imag))], axis=-1)

    def snapped(self, limits: Limits, ground: Floats) -> Places:
        """Moved onto fixed pivots that are given, which a descent reaches to a few digits less; with the ground's lengths."""
        turn, pivot = self.turn, self.pivot
        if limits.pivot_a is not None:
            pivot = np.full_like(pivot, limits.pivot_a)
            if limits.pivot_b is not None:
                turn = np.full_like(turn, np.angle(limits.pivot_b - limits.pivot_a))
        elif limits.pivot_b is not None:
            pivot = limits.pivot_b - ground * np.exp(1j * turn)
        return self._replace(turn=turn, pivot=pivot)

    @classmethod
    def of_linkage(cls, linkage: Linkage, count: int) -> Places:
        """Where a linkage stands, so many times."""
        own = (linkage.start, linkage.ground_angle, linkage.pivot_a, linkage.arm)
        return cls(*(np.full(count, value) for value in own))

    @classmethod
    def of(cls, target: Target, unknowns: Floats) -> Places:
        """The inverse of `unknowns`."""
        size = target.length_scale
        start, turn, ax, ay, zx, zy = unknowns.T
        return cls(start, turn, _middle(target) + size * (ax + 1j * ay), size * (zx + 1j * zy))


def scan(target: Target, links: Floats, branch: int, limits: Limits) -> tuple[Floats, Floats]:
    """The squared objective of links in their best place, and the starts it is reached from, pivots not limited.

    ``target``: with positions. ``links`` (n, 4): actual lengths. ``limits``: starts and links that break one of the
    lengths, the angles or the family are left out; those of places are not looked at.

    Returns
    -------
    cost : ndarray, shape (n,)
        Over about 16 samples; infinite where no start is left.
    start : ndarray, shape (n, 3)
        In the best valleys, the best first; NaN for valleys that there are not.
    """
    few = target.thinned(_SAMPLES)
    starts = np.broadcast_to(np.linspace(0, TURN, _STARTS, endpoint=False), (len(links), _STARTS))
    cost = _scanned(target, few, links, branch, starts, limits)
    lowest = (cost < np.roll(cost, 1, axis=1)) & (cost <= np.roll(cost, -1, axis=1))
    cost = np.where(lowest, cost, np.inf)
    valleys = np.argsort(cost, axis=1)[:, :_VALLEYS]
    best, least = np.take_along_axis(starts, valleys, axis=1), np.take_along_axis(cost, valleys, axis=1)
    step = TURN / _STARTS
    for _ in range(_HALVINGS):
        step /= 2
        trial = best[:, :1] + np.array([-step, 0.0, step])
        beside = _scanned(target, few, links, branch, trial[:, ::2], limits)
        found = np.insert(beside, 1, least[:, 0], axis=1)
        nearest = np.argmin(found, axis=1)[:, None]
        best[:, :1], least[:, :1] = (np.take_along_axis(column, nearest, axis=1) for column in (trial, found))
    return least[:, 0], np.where(np.isfinite(least), best, np.nan)


def _scanned(target: Target, few: Target, links: Floats, branch: int, start: Floats, limits: Limits) -> Floats:
    """Squared objectives (n, starts) over a few samples, of links (n, 4) in their best pose at starts (n, starts)."""
    count, starts = start.shape
    wide = np.repeat(links, starts, axis=0)
    flat = start.reshape(-1)
    cost = np.full(flat.size, np.inf)
    shape = Placed(wide, np.full(flat.size, float(branch)), target.interval.after(flat))
    inside = keeps(target, limits.of_shape, shape)
    inside &= (wide.min(axis=1) >= (limits.link_min or 0.0)) & (wide.max(axis=1) <= (limits.link_max or np.inf))
    places = np.flatnonzero(inside)
    if places.size:
        cost[places] = _best_pose(few, wide[places], branch, flat[places])[0]
    return cost.reshape(count, starts)


def _best_pose(target: Target, links: Floats, branch: int, start: Floats) -> tuple[Floats, Places]:
    """Squared objectives (n,) of links at starts, and the poses that have them; infinite where a sample is not reached."""
    assert target.position is not None
    mean, scale = target.position_mean, target.length_scale
    crank = start[:, None] + target.crank
    angle = close_loop(links, crank).coupler_angle(np.array(branch))
    wanted = (target.position - _middle(target)) / scale
    arm, own = np.exp(1j * angle), (links[:, :1] / scale) * np.exp(1j * crank)
    centred = arm - mean(arm)[:, None]
    square = mean(np.abs(centred) ** 2)
    independent = square > 1e-28

    def share(values: Any) -> Complexes:
        found: Any = np.where(independent, mean(np.conj(centred) * values), 0.0)
        return found / np.where(independent, square, 1.0)

    def rest(values: Any) -> Complexes:
        return values - np.expand_dims(mean(values), -1) - share(values)[:, None] * centred

    left, moved = rest(wanted), rest(own)
    inner = mean(np.conj(moved) * left)
    turn = np.angle(inner)
    way = np.exp(1j * turn)
    cost = mean(np.abs(left - way[:, None] * moved) ** 2)
    if target.rotation is not None:
        cost = cost + target.rotation_mean(rotation_residual(target, angle)[1] ** 2)
    vector = share(wanted) - way * share(own)
    pivot = mean(wanted) - way * mean(own) - vector * mean(arm)
    with np.errstate(invalid="ignore"):  # NaN where it opens
        places = Places(start, turn, _middle(target) + scale * pivot, scale * vector / way)
    return np.where(np.isnan(cost), np.inf, cost), places


def place(
    target: Target, links: Floats, branch: int, starts: Floats, old: Linkage, limits: Limits, work: Work
) -> list[Solution | None]:
    """Links in their best place within the limits, or once the work has expired in a good one.

    ``target``: with positions. ``links`` (n, 4). ``starts`` (n, m): where to begin; NaN: nowhere. ``old``: a linkage
    nearby, whose place is tried as well.

    None where no place within the limits was found. Law: what is returned keeps the limits by its own numbers, and no
    small change of its place that keeps them is better.
    """
    rows, columns = np.nonzero(np.isfinite(starts))
    tried = np.concatenate([rows, np.arange(len(links))])
    begin = np.concatenate([starts[rows, columns], np.full(len(links), old.start)])
    own, around = links[tried], _best_pose(target, links[tried], branch, begin)[1]
    best: list[Solution | None] = [None] * len(links)
    refined, cost = _refined(target, own, branch, around.unknowns(target), work)
    kept = _offer(best, target, own, branch, tried, Places.of(target, refined), limits)
    known = np.array([np.inf if one is None else one.errors.objective**2 for one in best])
    open_rows = np.flatnonzero(~kept & (cost < known[tried]))  # limits make none of them better
    lacking = np.union1d(np.flatnonzero(np.isinf(known)), tried[open_rows])
    if lacking.size and not limits.only_family:
        same = Places.of_linkage(old, len(lacking))
        unknowns = np.concatenate([refined[open_rows], same.unknowns(target)])
        tried = np.concatenate([tried[open_rows], lacking])
        limited = Places.of(target, _held_back(target, links[tried], branch, unknowns, limits, work))
        _offer(best, target, links[tried], branch, tried, limited.snapped(limits, links[tried, 3]), limits)
    return best


def _offer(
    best: list[Solution | None],
    target: Target,
    links: Floats,
    branch: int,
    tried: NDArray[np.intp],
    places: Places,
    limits: Limits,
) -> NDArray[np.bool_]:
    """Put into ``best`` what is better and within the limits; returns which candidates are."""
    kept = np.zeros(len(tried), dtype=bool)
    good = np.all(np.isfinite(np.stack([np.abs(column) for column in places])), axis=0)
    crank = places.start[:, None] + target.crank
    good &= np.all(close_loop(links, crank).closed, axis=1)
    some = np.flatnonzero(good)
    linkages = [
        four_bar(
            as_lengths(links[k]),
            branch,
            float(places.start[k] % TURN),
            complex(places.pivot[k]),
            wrap(float(places.turn[k])),
            (float(abs(places.point[k])), wrap(float(np.angle(places.point[k])))),
        )
        for k in some
    ]
    found = assess(target, linkages)
    inside = set(map(id, within(target, limits, found)))
    for k, one in zip(some, found):
        if id(one) not in inside:
            continue
        kept[k] = True
        now = best[tried[k]]
        if now is None or one.errors.objective < now.errors.objective:
            best[tried[k]] = one
    return kept


def _refined(target: Target, links: Floats, branch: int, unknowns: Floats, work: Work) -> Minima:
    def evaluate(some: Floats, which: Floats) -> Evaluation:
        return _evaluation(_rows(target, links[which.astype(int)], branch, some))

    which = np.arange(len(links), dtype=float)
    return minimise(evaluate, unknowns, which, _STEPS, work=work, stall=1e-12, damping=1e-6)


def _held_back(target: Target, links: Floats, branch: int, unknowns: Floats, limits: Limits, work: Work) -> Floats:
    """Candidates (n, 6) after a descent that limits hold back, by the method of multipliers."""
    constraints = Constraints(limits, _middle(target), target.length_scale, exact=False)
    values, _, equal = _constrained(constraints, target, links, branch, unknowns)
    shift, weight = np.zeros_like(values), _WEIGHT
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)

        def evaluate(some: Floats, which: Floats, root: float = root, shift: Floats = shift) -> Evaluation:
            rows = which.astype(int)
            own, slopes, _ = _constrained(constraints, target, links[rows], branch, some)
            gap = shift[rows] - own
            broken = (gap > 0) | np.isnan(gap) | equal
            stack = np.concatenate([-np.moveaxis(slopes, -1, 1), gap[:, None]], axis=1)
            stack = root * np.where(broken[:, None], stack, 0.0)
            return _evaluation(np.concatenate([_rows(target, links[rows], branch, some), stack], axis=2))

        if work.expired():
            break
        which = np.arange(len(links), dtype=float)
        unknowns = minimise(evaluate, unknowns, which, _STEPS // 4, work=work, stall=1e-8).unknowns
        gap = np.nan_to_num(shift - _constrained(constraints, target, links, branch, unknowns)[0])
        shift = np.where(equal, gap, np.maximum(gap, 0.0)) / _GROWTH
        weight *= _GROWTH
    return unknowns


def _constrained(
    constraints: Constraints, target: Target, links: Floats, branch: int, unknowns: Floats
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """How far inside the limits, and the margin, candidates are (n, C), its derivatives (n, C, 6), and which are equations."""
    places, size = Places.of(target, unknowns), target.length_scale
    turned = np.exp(1j * places.turn)
    coupler = places.point / size * turned
    found = constraints(
        Placed(
            links / size,
            np.full(len(links), float(branch)),
            target.interval.after(places.start),
            (places.pivot - _middle(target)) / size,
            places.turn,
            coupler,
        )
    )
    slopes = found.slopes
    by_coupler = slopes[..., COUPLER] - 1j * slopes[..., COUPLER + 1]
    derivatives = np.stack(
        [
            slopes[..., BEGIN] + slopes[..., END],
            slopes[..., TURNED] + (by_coupler * (1j * coupler)[:, None]).real,
            slopes[..., PIVOT],
            slopes[..., PIVOT + 1],
            (by_coupler * turned[:, None]).real,
            (by_coupler * (1j * turned)[:, None]).real,
        ],
        axis=-1,
    )
    return found.values - np.where(found.equal, 0.0, _MARGIN), derivatives, found.equal


def response_to_lengths(target: Target, linkage: Linkage) -> tuple[Floats, Floats]:
    """How the objective answers to the lengths of a linkage, to first order and with its place refitted.

    Returns
    -------
    upper : ndarray, shape (4, 4)
        Upper triangular.
    right : ndarray, shape (4,)
        Law: with the lengths multiplied by ``exp(d)`` the squared objective is ``|upper @ d + right|^2`` and a constant, up to
        third order in d where the residual is small.
    """
    target = replace(target, found=False)
    matrix, free = derivative_matrix(target, [linkage])
    rest = residuals(target, [linkage])[0]
    derivatives = matrix[0, : rest.size]
    rows = np.concatenate([derivatives[:, free:], -derivatives[:, :free], rest[:, None]], axis=1)
    triangle: Any = np.linalg.qr(np.nan_to_num(rows), mode="r")
    triangle = np.concatenate([triangle, np.zeros((max(0, rows.shape[1] - len(triangle)), rows.shape[1]))])
    return triangle[-5:-1, -5:-1], triangle[-5:-1, -1]


def _rows(target: Target, links: Floats, branch: int, unknowns: Floats) -> Floats:
    """The residual of the objective and its derivatives by the six unknowns, (n, 7, rows), the residual last."""
    assert target.position is not None
    places, scale = Places.of(target, unknowns), target.length_scale
    crank = places.start[:, None] + target.crank
    closure = close_loop(links, crank)
    angle = closure.coupler_angle(np.array(branch))
    slope = closure.coupler_angle_gradient(np.array(branch))[..., 4]
    parts = []
    if target.rotation is not None:
        turned = np.zeros((len(links), 7, target.samples))
        turned[:, -1] = rotation_residual(target, angle)[1]
        turned[:, 0] = -(slope - np.expand_dims(target.rotation_mean(slope), -1))
        parts.append(turned * target.rotation_mean.root)
    way = np.exp(1j * places.turn)[:, None]
    first = way * links[:, :1] * np.exp(1j * crank)
    arm = way * np.exp(1j * angle)
    second = places.point[:, None] * arm
    gap = np.empty((len(links), 7, target.samples), dtype=complex)
    gap[:, -1] = (target.position - places.pivot[:, None] - first - second) / scale
    gap[:, 0] = -1j * (first + slope * second) / scale
    gap[:, 1] = -1j * (first + second) / scale
    gap[:, 2], gap[:, 3] = -1.0, -1j
    gap[:, 4], gap[:, 5] = -arm, -1j * arm
    gap = gap * target.position_mean.root
    return np.concatenate([*parts, gap.real, gap.imag], axis=2)


def _evaluation(stack: Floats) -> Evaluation:
    """What the descent reads; a place next to where it opens has no derivatives, and is no answer."""
    cost = np.einsum("nm,nm->n", stack[:, 6], stack[:, 6])
    return Evaluation(np.where(np.isnan(stack).any(axis=(1, 2)), np.inf, cost), np.nan_to_num(stack))


def _middle(target: Target) -> complex:
    assert target.position is not None
    return complex(target.position_mean(target.position))
