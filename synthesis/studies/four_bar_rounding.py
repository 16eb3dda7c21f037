"""Available link lengths, on a grid or from a list of stock lengths, with start, pose and offset fitted again.

The best combination of stock lengths is a closest-point problem: near a solution the squared objective is a quadratic form of
the four logarithms, whose triangular factor bounds the cost of each choice from below, link by link (Fincke and Pohst,
Mathematics of Computation 44 (1985), 463-471). So combinations come in the order of that estimate, and each is then fitted.

With the start of the crank chosen, all directions of the links against the ground line are known, and the position error is
a complex least-squares problem in A and z, with a rotation w of modulus 1 beside them::

    P_m = A + w (L1 e^{i theta1_m} + z e^{i theta2_m}),    w = e^{i theta4}

Both free columns are projected out; then the best w is the direction of an inner product. So a single unknown remains, the
start, which is scanned over the whole turn: no basin wider than a step is missed. The results of the scan are refined in
all six unknowns by least squares, with an augmented Lagrangian if limits are active (Nocedal and Wright, 17.4).
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
from synthesis.constraints import Constraints, keeps
from synthesis.four_bar import close_loop, wrap
from synthesis.fourbar.determination import derivative_matrix, residuals
from synthesis.kernels import codes
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
"""Number of steps to each side if the nearest lengths of a grid violate a limit, and if they only increase the error."""
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
"""Ratio of the squared objective in the scan to the best refined value above which a combination is discarded."""
_NEARER = 1e-3
"""Weight of a length's own change beside the estimate: of lengths that the motion does not fix the nearest come first."""
# the best place of given lengths
_STARTS = 48
"""Starts of the scan in a turn."""
_SAMPLES = 16
"""Approximate number of samples in the scan."""
_HALVINGS = 8
"""Smallest step around the best start of the scan, relative to a step of the scan."""
_VALLEYS = 3
"""Number of basins of the scan that are refined."""
_STEPS = 200
"""Largest number of steps of the refinement; within limits a quarter of it in each round."""
_ROUNDS = 7
"""Number of updates of the multipliers."""
_WEIGHT, _GROWTH = 1.0, 10.0
"""Weight of a violated limit against the square of the objective, and its growth in each round."""
NONE_CLOSES = "none of the lengths tried closes at all crank angles of this solution within the limits of shape"
NO_PLACE = "none of the lengths tried has a place within the limits at the crank angles of this solution"
NO_TIME = "the time was up before a linkage of lengths that can be had was in its place"
_MARGIN = 1e-8
"""Margin from the limits at which the refinement aims, so that the result satisfies them after rounding."""


@dataclass(frozen=True)
class Rounding:
    """Result of a search for available lengths.

    ``solution``: the best solution; None if no examined combination can be fitted within the limits. ``tried``: number of fitted
    combinations. ``combinations``: number of all combinations; None for a grid, which has no end. ``exhaustive``: True if the
    choice is the best of all combinations, each of which was scanned over the whole turn of the start, and refined unless the
    scan shows that it is worse; None for a grid. ``reason``: reason for an empty result.
    """

    solution: Solution | None
    tried: int
    combinations: int | None = None
    exhaustive: bool | None = None
    reason: str | None = None


def round_to_grid(
    target: Target, solution: Solution, grid: float, limits: Limits, tries: int, work: Work
) -> Rounding:
    """Return the solution with its links on a grid and all other dimensions fitted again, within the limits.

    ``target``: with positions, since lengths are actual only then. ``grid``: step of the lengths, in the user's unit; a link is
    at least one step long. ``tries``: largest number of combinations beside the nearest. ``work``: when it has expired, only the
    first few combinations are tried.

    The nearest lengths are returned if they are exact or increase the error only slightly, otherwise the best of them and of
    their neighbours. Only given lengths may lie off the grid. The choice is not worse than the nearest lengths or lengths within
    a step of them; if these cannot satisfy a limit, within `AROUND` steps.
    """
    old, prescribed = solution.linkage, given_lengths(limits)
    steps = np.maximum(np.round(np.array(old.links) / grid), 1.0)
    links = np.where(np.isnan(prescribed), multiples(steps, grid), prescribed)[None]
    starts = scan(target, links, old.branch, limits)[1]
    found = fitted_poses(target, links, old.branch, starts, old, limits, work)[0]
    if found is not None and found.errors.objective <= max(_HARDLY * solution.errors.objective, _EXACT):
        return Rounding(found, 1)
    if work.expired():
        return Rounding(None, 0, reason=NO_TIME) if found is None else Rounding(found, 1)
    around, max_tries = (AROUND, GRID_TRIES) if found is None else (1, _TOGETHER)
    choices = [multiples(np.arange(max(1.0, step - around), step + around + 1), grid) for step in steps]
    choices = [values if np.isnan(length) else np.array([length]) for values, length in zip(choices, prescribed)]
    best = _best_of(target, solution, choices, limits, min(tries, max_tries), work)
    if found is None or (best.solution is not None and best.solution.errors.objective < found.errors.objective):
        return Rounding(best.solution, best.tried, reason=best.reason)
    return Rounding(found, max(best.tried, 1))


def best_from_stock(
    target: Target, solution: Solution, stock: Sequence[float], limits: Limits, tries: int, work: Work
) -> Rounding:
    """Return the solution with links of stock lengths and everything else fitted again, within the limits; see `round_to_grid`.

    If the search is exhaustive, no combination is better.
    """
    choices = [np.unique(stock) if np.isnan(length) else np.array([length]) for length in given_lengths(limits)]
    return _best_of(target, solution, choices, limits, tries, work)


def multiples(steps: Floats, grid: float) -> Floats:
    """Return whole numbers of steps of a grid as decimal numbers: three tenths are exactly 0.3."""
    return np.array([float(f"{length:.15g}") for length in (steps * grid).tolist()])


def given_lengths(limits: Limits) -> Floats:
    """Lengths that the limits give, which are no choice, (4,); NaN for the others."""
    lengths = np.array([np.nan if length is None else length for length in limits.links])
    if limits.pivot_a is not None and limits.pivot_b is not None:
        lengths[3] = abs(limits.pivot_b - limits.pivot_a)
    return lengths


def _best_of(
    target: Target, solution: Solution, choices: Sequence[Floats], limits: Limits, tries: int, work: Work
) -> Rounding:
    """The best combination of lengths, one of each of four lists."""
    old = solution.linkage
    total = int(np.prod([float(values.size) for values in choices]))
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
        chunk = ranked[first : first + _PLACED]
        for one in fitted_poses(target, links[chunk], old.branch, starts[chunk], old, limits, work):
            if one is not None and (best is None or one.errors.objective < best.errors.objective):
                best = one
        if work.expired():  # possibly before the last combination was fitted
            tried, refined_all = tried if best is not None else 0, False
            break
    why = NONE_CLOSES if not ranked.size else NO_TIME if work.expired() else NO_PLACE
    return Rounding(best, tried, total, tried == total and refined_all, None if best is not None else why)


def _nearest_first(target: Target, solution: Solution, choices: Sequence[Floats]) -> Iterator[Floats]:
    """Combinations of lengths, one of each rising list, by their estimated objective; best first."""
    old = solution.linkage
    triangle, right = response_to_lengths(target, old)
    size = _NEARER * max(float(np.abs(triangle).max()), np.finfo(float).tiny)
    stack = np.concatenate([np.column_stack([triangle, right]), size * np.eye(4, 5)])
    upper: Any = np.linalg.qr(stack, mode="r")
    moved = [np.log(values / length) for values, length in zip(choices, old.links)]
    for chosen in nearest_of(upper, [column.tolist() for column in moved]):
        yield np.array([values[index] for values, index in zip(choices, chosen)])


def nearest_of(upper: Floats, moved: Sequence[Sequence[float]]) -> Iterator[tuple[int, ...]]:
    """Yield indices into each list of numbers d_k in increasing order of ``|upper[:4, :4] @ d + upper[:4, 4]|^2``.

    If more than `MOST_OPEN` choices are open because the lengths are poorly determined, further neighbours are omitted.

    ``upper`` (5, 5): upper triangular without zeros on its diagonal. ``moved``: increasing lists.
    """
    rows = [[float(value) for value in row] for row in upper]
    # A node is a choice for the last links; its children choose the link before, the nearest first. Along a rising list that is
    # from the nearest outward, so an open node is two places in it: there may be a hundred thousand of them.
    heap: list[tuple[float, tuple[int, ...], int, int, float, float]] = []

    def push(chosen: tuple[int, ...], below: int, above: int, bound: float, remaining: float) -> None:
        link = 3 - len(chosen)
        column, slope = moved[link], rows[link][link]
        costs = [
            bound + (gap := slope * column[index] + remaining) * gap if 0 <= index < len(column) else math.inf
            for index in (below, above)
        ]
        if costs[0] <= costs[1] and below >= 0:
            heapq.heappush(heap, (costs[0], (below, *chosen), below - 1, above, bound, remaining))
        elif above < len(column):
            heapq.heappush(heap, (costs[1], (above, *chosen), below, above + 1, bound, remaining))

    def open_node(bound: float, chosen: tuple[int, ...]) -> None:
        link = 3 - len(chosen)
        row = rows[link]
        remaining = row[4] + sum(row[link + 1 + k] * moved[link + 1 + k][index] for k, index in enumerate(chosen))
        above = bisect.bisect_left(moved[link], -remaining / row[link])
        push(chosen, above - 1, above, bound, remaining)

    open_node(0.0, ())
    while heap:
        bound, chosen, below, above, before, remaining = heapq.heappop(heap)
        if len(heap) < MOST_OPEN:
            push(chosen[1:], below, above, before, remaining)
        if len(chosen) == 4:
            yield chosen
        else:
            open_node(bound, chosen)


class StartsAndPoses(NamedTuple):
    """Starts and poses of n linkages; the body point is given in the frame of the coupler, from the crank pin."""

    start: Floats
    turn: Floats
    """Ground angles."""
    pivot: Complexes
    point: Complexes

    def unknowns(self, target: Target) -> Floats:
        """Return the unknowns of the refinement, of order one, (n, 6)."""
        size = target.length_scale
        moved = (self.pivot - _middle(target)) / size, self.point / size
        return np.stack([self.start, self.turn, *(part for z in moved for part in (z.real, z.imag))], axis=-1)

    def snapped(self, limits: Limits, ground: Floats) -> StartsAndPoses:
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
    def of_linkage(cls, linkage: Linkage, count: int) -> StartsAndPoses:
        """Repeat the start and pose of a linkage."""
        own = (linkage.start, linkage.ground_angle, linkage.pivot_a, linkage.arm)
        return cls(*(np.full(count, value) for value in own))

    @classmethod
    def of(cls, target: Target, unknowns: Floats) -> StartsAndPoses:
        """The inverse of `unknowns`."""
        size = target.length_scale
        start, turn, ax, ay, zx, zy = unknowns.T
        return cls(start, turn, _middle(target) + size * (ax + 1j * ay), size * (zx + 1j * zy))


def scan(target: Target, links: Floats, branch: int, limits: Limits) -> tuple[Floats, Floats]:
    """Return the squared objective of links in their best pose, and the starts of the best poses; pivots are not limited.

    ``target``: with positions. ``links`` (n, 4): actual lengths. ``limits``: starts and links that violate a limit on lengths,
    angles or the family are omitted; limits on positions are ignored.

    Returns
    -------
    cost : ndarray, shape (n,)
        Over about 16 samples; infinite if no start remains.
    start : ndarray, shape (n, 3)
        Starts in the best basins, best first; NaN if there are fewer basins.
    """
    few = target.thinned(_SAMPLES)
    starts = np.broadcast_to(np.linspace(0, TURN, _STARTS, endpoint=False), (len(links), _STARTS))
    cost = _scanned(target, few, links, branch, starts, limits)
    lowest = (cost < np.roll(cost, 1, axis=1)) & (cost <= np.roll(cost, -1, axis=1))
    cost = np.where(lowest, cost, np.inf)
    valleys = np.argsort(cost, axis=1)[:, :_VALLEYS]
    best, smallest = np.take_along_axis(starts, valleys, axis=1), np.take_along_axis(cost, valleys, axis=1)
    step = TURN / _STARTS
    for _ in range(_HALVINGS):
        step /= 2
        trial = best[:, :1] + np.array([-step, 0.0, step])
        beside = _scanned(target, few, links, branch, trial[:, ::2], limits)
        found = np.insert(beside, 1, smallest[:, 0], axis=1)
        nearest = np.argmin(found, axis=1)[:, None]
        best[:, :1], smallest[:, :1] = (np.take_along_axis(column, nearest, axis=1) for column in (trial, found))
    return smallest[:, 0], np.where(np.isfinite(smallest), best, np.nan)


def _scanned(target: Target, few: Target, links: Floats, branch: int, start: Floats, limits: Limits) -> Floats:
    """Squared objectives (n, starts) over a few samples, of links (n, 4) in their best pose at starts (n, starts)."""
    count, starts = start.shape
    wide = np.repeat(links, starts, axis=0)
    flat = start.reshape(-1)
    cost = np.full(flat.size, np.inf)
    shape = Placed(wide, np.full(flat.size, float(branch)), target.interval.after(flat))
    inside = keeps(target, limits.of_shape, shape)
    inside &= (wide.min(axis=1) >= (limits.link_min or 0.0)) & (wide.max(axis=1) <= (limits.link_max or np.inf))
    indices = np.flatnonzero(inside)
    if indices.size:
        cost[indices] = _best_pose(few, wide[indices], branch, flat[indices])[0]
    return cost.reshape(count, starts)


def _best_pose(target: Target, links: Floats, branch: int, start: Floats) -> tuple[Floats, StartsAndPoses]:
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

    def deviation(values: Any) -> Complexes:
        return values - np.expand_dims(mean(values), -1) - share(values)[:, None] * centred

    left, moved = deviation(wanted), deviation(own)
    inner = mean(np.conj(moved) * left)
    turn = np.angle(inner)
    direction = np.exp(1j * turn)
    cost = mean(np.abs(left - direction[:, None] * moved) ** 2)
    if target.rotation is not None:
        cost = cost + target.rotation_mean(rotation_residual(target, angle)[1] ** 2)
    vector = share(wanted) - direction * share(own)
    pivot = mean(wanted) - direction * mean(own) - vector * mean(arm)
    with np.errstate(invalid="ignore"):  # NaN if the loop opens
        poses = StartsAndPoses(start, turn, _middle(target) + scale * pivot, scale * vector / direction)
    return np.where(np.isnan(cost), np.inf, cost), poses


def fitted_poses(
    target: Target, links: Floats, branch: int, starts: Floats, old: Linkage, limits: Limits, work: Work
) -> list[Solution | None]:
    """Fit links in their best pose within the limits, or in a good pose once the work has expired.

    ``target``: with positions. ``links`` (n, 4). ``starts`` (n, m): initial starts; NaN for none. ``old``: a similar linkage,
    whose pose is tried too.

    The result is None if no pose within the limits was found. Results satisfy the limits with their own dimensions, and no
    small change of their pose within the limits is better.
    """
    rows, columns = np.nonzero(np.isfinite(starts))
    tried = np.concatenate([rows, np.arange(len(links))])
    begin = np.concatenate([starts[rows, columns], np.full(len(links), old.start)])
    own, around = links[tried], _best_pose(target, links[tried], branch, begin)[1]
    best: list[Solution | None] = [None] * len(links)
    refined, cost = _refined(target, own, branch, around.unknowns(target), work)
    is_within = _offer(best, target, own, branch, tried, StartsAndPoses.of(target, refined), limits)
    known = np.array([np.inf if solution is None else solution.errors.objective**2 for solution in best])
    open_rows = np.flatnonzero(~is_within & (cost < known[tried]))  # limits make none of them better
    lacking = np.union1d(np.flatnonzero(np.isinf(known)), tried[open_rows])
    if lacking.size and not limits.only_family:
        same = StartsAndPoses.of_linkage(old, len(lacking))
        unknowns = np.concatenate([refined[open_rows], same.unknowns(target)])
        tried = np.concatenate([tried[open_rows], lacking])
        limited = StartsAndPoses.of(target, _held_back(target, links[tried], branch, unknowns, limits, work))
        _offer(best, target, links[tried], branch, tried, limited.snapped(limits, links[tried, 3]), limits)
    return best


def _offer(
    best: list[Solution | None],
    target: Target,
    links: Floats,
    branch: int,
    tried: NDArray[np.intp],
    poses: StartsAndPoses,
    limits: Limits,
) -> NDArray[np.bool_]:
    """Add better candidates within the limits to ``best``, and return flags of the candidates within the limits."""
    is_within = np.zeros(len(tried), dtype=bool)
    good = np.all(np.isfinite(np.stack([np.abs(column) for column in poses])), axis=0)
    crank = poses.start[:, None] + target.crank
    good &= np.all(close_loop(links, crank).closed, axis=1)
    indices = np.flatnonzero(good)
    linkages = [
        four_bar(
            as_lengths(links[k]),
            branch,
            float(poses.start[k] % TURN),
            complex(poses.pivot[k]),
            wrap(float(poses.turn[k])),
            (float(abs(poses.point[k])), wrap(float(np.angle(poses.point[k])))),
        )
        for k in indices
    ]
    found = assess(target, linkages)
    inside = set(map(id, within(target, limits, found)))
    for k, solution in zip(indices, found):
        if id(solution) not in inside:
            continue
        is_within[k] = True
        now = best[tried[k]]
        if now is None or solution.errors.objective < now.errors.objective:
            best[tried[k]] = solution
    return is_within


def _refined(target: Target, links: Floats, branch: int, unknowns: Floats, work: Work) -> Minima:
    def evaluate(points: Floats, which: Floats) -> Evaluation:
        return _evaluation(_rows(target, links[which.astype(int)], branch, points))

    which = np.arange(len(links), dtype=float)
    return minimise(evaluate, unknowns, which, _STEPS, work=work, stall=1e-12, damping=1e-6)


def _held_back(target: Target, links: Floats, branch: int, unknowns: Floats, limits: Limits, work: Work) -> Floats:
    """Candidates (n, 6) after a descent that limits hold back, by the method of multipliers."""
    constraints = Constraints(limits, _middle(target), target.length_scale, exact=False)
    values, _, equal = _constrained(constraints, target, links, branch, unknowns)
    shift, weight = np.zeros_like(values), _WEIGHT
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)

        def evaluate(points: Floats, which: Floats, root: float = root, shift: Floats = shift) -> Evaluation:
            rows = which.astype(int)
            own, slopes, _ = _constrained(constraints, target, links[rows], branch, points)
            gap = shift[rows] - own
            broken = (gap > 0) | np.isnan(gap) | equal
            stack = np.concatenate([-np.moveaxis(slopes, -1, 1), gap[:, None]], axis=1)
            stack = root * np.where(broken[:, None], stack, 0.0)
            return _evaluation(np.concatenate([_rows(target, links[rows], branch, points), stack], axis=2))

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
    """Return the limits and the margin of candidates (n, C), their derivatives (n, C, 6), and flags of equations."""
    poses, size = StartsAndPoses.of(target, unknowns), target.length_scale
    turned = np.exp(1j * poses.turn)
    coupler = poses.point / size * turned
    found = constraints(
        Placed(
            links / size,
            np.full(len(links), float(branch)),
            target.interval.after(poses.start),
            (poses.pivot - _middle(target)) / size,
            poses.turn,
            coupler,
        )
    )
    slopes = found.slopes
    by_coupler = slopes[..., codes.BY_BODY] - 1j * slopes[..., codes.BY_BODY + 1]
    derivatives = np.stack(
        [
            slopes[..., codes.BY_FIRST] + slopes[..., codes.BY_LAST],
            slopes[..., codes.BY_TURNED] + (by_coupler * (1j * coupler)[:, None]).real,
            slopes[..., codes.BY_PIVOT],
            slopes[..., codes.BY_PIVOT + 1],
            (by_coupler * turned[:, None]).real,
            (by_coupler * (1j * turned)[:, None]).real,
        ],
        axis=-1,
    )
    return found.values - np.where(found.equal, 0.0, _MARGIN), derivatives, found.equal


def response_to_lengths(target: Target, linkage: Linkage) -> tuple[Floats, Floats]:
    """Return the response of the objective to the lengths of a linkage, to first order and with its pose fitted again.

    Returns
    -------
    upper : ndarray, shape (4, 4)
        Upper triangular.
    right : ndarray, shape (4,)
        With the lengths multiplied by ``exp(d)`` the squared objective is ``|upper @ d + right|^2`` plus a constant, up to
        third order in d if the residual is small.
    """
    target = replace(target, found=False)
    matrix, free = derivative_matrix(target, [linkage])
    residual = residuals(target, [linkage])[0]
    derivatives = matrix[0, : residual.size]
    rows = np.concatenate([derivatives[:, free:], -derivatives[:, :free], residual[:, None]], axis=1)
    triangle: Any = np.linalg.qr(np.nan_to_num(rows), mode="r")
    triangle = np.concatenate([triangle, np.zeros((max(0, rows.shape[1] - len(triangle)), rows.shape[1]))])
    return triangle[-5:-1, -5:-1], triangle[-5:-1, -1]


def _rows(target: Target, links: Floats, branch: int, unknowns: Floats) -> Floats:
    """The residual of the objective and its derivatives by the six unknowns, (n, 7, rows), the residual last."""
    assert target.position is not None
    poses, scale = StartsAndPoses.of(target, unknowns), target.length_scale
    crank = poses.start[:, None] + target.crank
    closure = close_loop(links, crank)
    angle = closure.coupler_angle(np.array(branch))
    slope = closure.coupler_angle_gradient(np.array(branch))[..., 4]
    parts = []
    if target.rotation is not None:
        turned = np.zeros((len(links), 7, target.samples))
        turned[:, -1] = rotation_residual(target, angle)[1]
        turned[:, 0] = -(slope - np.expand_dims(target.rotation_mean(slope), -1))
        parts.append(turned * target.rotation_mean.root)
    direction = np.exp(1j * poses.turn)[:, None]
    first = direction * links[:, :1] * np.exp(1j * crank)
    arm = direction * np.exp(1j * angle)
    second = poses.point[:, None] * arm
    gap = np.empty((len(links), 7, target.samples), dtype=complex)
    gap[:, -1] = (target.position - poses.pivot[:, None] - first - second) / scale
    gap[:, 0] = -1j * (first + slope * second) / scale
    gap[:, 1] = -1j * (first + second) / scale
    gap[:, 2], gap[:, 3] = -1.0, -1j
    gap[:, 4], gap[:, 5] = -arm, -1j * arm
    gap = gap * target.position_mean.root
    return np.concatenate([*parts, gap.real, gap.imag], axis=2)


def _evaluation(stack: Floats) -> Evaluation:
    """Return the model of the descent; a point next to an open loop has no derivatives and is no result."""
    cost = np.einsum("nm,nm->n", stack[:, 6], stack[:, 6])
    return Evaluation(np.where(np.isnan(stack).any(axis=(1, 2)), np.inf, cost), np.nan_to_num(stack))


def _middle(target: Target) -> complex:
    assert target.position is not None
    return complex(target.position_mean(target.position))
