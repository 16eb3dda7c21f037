"""Available link lengths, on a grid or from a list of stock lengths, with start, pose and offset fitted again.

Near a solution the squared objective is a quadratic form of the four logarithms of the lengths. Combinations of the nearest
available lengths come in the order of that estimate, and each is then fitted.

With the start of the crank chosen, all directions of the links against the ground line are known, and the position error is
a complex least-squares problem in A and z, with a rotation w of modulus 1 beside them::

    P_m = A + w (L1 e^{i theta1_m} + z e^{i theta2_m}),    w = e^{i theta4}

Both free columns are projected out; then the best w is the direction of an inner product. So a single unknown remains, the
start, which is scanned over the whole turn: no basin wider than a step is missed. The results of the scan are refined by
repeated grids. If the best pose violates limits, a descent within the limits with given lengths leads into them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.constraints import keeps
from synthesis.descents import Stage
from synthesis.errors import FieldError
from synthesis.four_bar import close_loop, wrap
from synthesis.fourbar.determination import derivative_matrix, residuals
from synthesis.limits import Limits
from synthesis.linkage import Linkage, as_lengths, four_bar, with_links
from synthesis.local_refinement import NearbyOptions, nearby_motion
from synthesis.mechanism import Placed
from synthesis.one_variable import closer_looks
from synthesis.pose import rotation_residual
from synthesis.solution import Solution, assess
from synthesis.target import TURN, Target
from synthesis.violations import within
from synthesis.work import Work


@dataclass(frozen=True)
class FourBarRoundingOptions:
    """Options of the search for the lengths of a four-bar."""

    grid_tries: int = 300
    """Largest number of combinations around the nearest; they come in the order of their estimate."""
    steps_around: int = 3
    """Number of steps to each side that are tried if the nearest lengths of a grid violate a limit."""
    sufficient_ratio: float = 1.01
    """Ratio of the objectives of the nearest lengths and of the solution up to which no other lengths are tried."""
    exact: float = 1e-12
    """Objective of the nearest lengths that is only rounding."""
    choices: int = 12
    """Largest number of available lengths, the nearest, that are combined for each link."""
    batch: int = 64
    """Number of combinations that are scanned at once."""
    fitted_batch: int = 8
    """Number of combinations that are fitted at once."""
    max_fitted: int = 64
    """Largest number of combinations that are fitted."""
    scans_per_fit: int = 16
    """Number of scans that take as long as a fit; of few combinations fewer are fitted."""
    discard_ratio: float = 2.0
    """Ratio of the squared objective in the scan to the best fitted value above which a combination is discarded."""
    change_weight: float = 1e-3
    """Weight of a length's own change beside the estimate: of lengths that the motion does not fix the nearest come first."""
    starts: int = 48
    """Number of starts of the scan in a turn."""
    samples: int = 16
    """Approximate number of samples in the scan."""
    halvings: int = 8
    """Number of halvings of the step around the best start of the scan."""
    basins: int = 3
    """Number of basins of the scan that are refined."""
    refinements: tuple[int, ...] = (9,) * 20
    """Number of starts in each refinement of a basin."""


OPTIONS = FourBarRoundingOptions()
_NEARBY = NearbyOptions((Stage(20, weight=3.0), Stage(20, weight=10.0), Stage(80, weight=30.0)), 1e-3)
"""Options of a descent of given lengths to its end."""
NONE_CLOSES = (
    "none of the lengths that were tried closes at all crank angles of this solution within the limits of shape"
)
NO_PLACE = "none of the lengths that were tried fits within the limits at the crank angles of this solution"
NO_TIME = "the time was up before a linkage with available lengths was found"


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
    a step of them; if these cannot satisfy a limit, within `FourBarRoundingOptions.steps_around` steps.
    """
    old, prescribed = solution.linkage, given_lengths(limits)
    steps = np.maximum(np.round(np.array(old.links) / grid), 1.0)
    links = np.where(np.isnan(prescribed), multiples(steps, grid), prescribed)[None]
    starts = scan(target, links, old.branch, limits)[1]
    found = fitted_poses(target, links, old.branch, starts, old, limits, work)[0]
    if found is not None and found.errors.objective <= max(
        OPTIONS.sufficient_ratio * solution.errors.objective, OPTIONS.exact
    ):
        return Rounding(found, 1)
    if work.expired():
        return Rounding(None, 0, reason=NO_TIME) if found is None else Rounding(found, 1)
    around, max_tries = (OPTIONS.steps_around, OPTIONS.grid_tries) if found is None else (1, OPTIONS.batch)
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
    nearest, tried = _nearest_first(target, solution, choices)[:tries], 0
    found: list[tuple[Floats, Floats, Floats]] = []
    while tried < len(nearest) and not (found and work.expired()):
        links = nearest[tried : tried + OPTIONS.batch]
        found.append((links, *scan(target, links, old.branch, limits)))
        tried += len(links)
    links, cost, starts = (np.concatenate(columns) for columns in zip(*found))
    best: Solution | None = None
    refined_all = True
    ranked = np.flatnonzero(np.isfinite(cost))[np.argsort(cost[np.isfinite(cost)], kind="stable")]
    for first in range(0, ranked.size, OPTIONS.fitted_batch):
        if best is not None and cost[ranked[first]] > OPTIONS.discard_ratio * best.errors.objective**2:
            break
        if first >= min(OPTIONS.max_fitted, max(OPTIONS.fitted_batch, tries // OPTIONS.scans_per_fit)):
            refined_all = False
            break
        chunk = ranked[first : first + OPTIONS.fitted_batch]
        for fitted in fitted_poses(target, links[chunk], old.branch, starts[chunk], old, limits, work):
            if fitted is not None and (best is None or fitted.errors.objective < best.errors.objective):
                best = fitted
        if work.expired():  # possibly before the last combination was fitted
            tried, refined_all = tried if best is not None else 0, False
            break
    why = NONE_CLOSES if not ranked.size else NO_TIME if work.expired() else NO_PLACE
    return Rounding(best, tried, total, tried == total and refined_all, None if best is not None else why)


def _nearest_first(target: Target, solution: Solution, choices: Sequence[Floats]) -> Floats:
    """Return combinations (n, 4) of lengths, one of each list, by their estimated objective; best first."""
    own = np.array(solution.linkage.links)
    triangle, right = response_to_lengths(target, solution.linkage)
    weight = OPTIONS.change_weight * max(float(np.abs(triangle).max()), np.finfo(float).tiny)
    nearest = [
        values[np.argsort(np.abs(np.log(values / length)), kind="stable")[: OPTIONS.choices]]
        for values, length in zip(choices, own)
    ]
    links = np.stack([axis.ravel() for axis in np.meshgrid(*nearest, indexing="ij")], axis=1)
    change = np.log(links / own)
    estimate = np.sum((change @ triangle.T + right) ** 2, axis=1) + np.sum((weight * change) ** 2, axis=1)
    return links[np.argsort(estimate, kind="stable")]


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
    few = target.thinned(OPTIONS.samples)
    starts = np.broadcast_to(np.linspace(0, TURN, OPTIONS.starts, endpoint=False), (len(links), OPTIONS.starts))
    cost = _scanned(target, few, links, branch, starts, limits)
    lowest = (cost < np.roll(cost, 1, axis=1)) & (cost <= np.roll(cost, -1, axis=1))
    cost = np.where(lowest, cost, np.inf)
    valleys = np.argsort(cost, axis=1)[:, : OPTIONS.basins]
    best, smallest = np.take_along_axis(starts, valleys, axis=1), np.take_along_axis(cost, valleys, axis=1)
    step = TURN / OPTIONS.starts
    for _ in range(OPTIONS.halvings):
        step /= 2
        trial = best[:, :1] + np.array([-step, 0.0, step])
        beside = _scanned(target, few, links, branch, trial[:, ::2], limits)
        found = np.insert(beside, 1, smallest[:, 0], axis=1)
        nearest = np.argmin(found, axis=1)[:, None]
        best[:, :1], smallest[:, :1] = (np.take_along_axis(column, nearest, axis=1) for column in (trial, found))
    return smallest[:, 0], np.where(np.isfinite(smallest), best, np.nan)


def _scanned(target: Target, few: Target, links: Floats, branch: int, start: Any, limits: Limits) -> Floats:
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


class _Poses(NamedTuple):
    """Best poses of n linkages."""

    turn: Floats
    """Ground angles."""
    pivot: Complexes
    point: Complexes
    """Body points in the frame of the coupler, from the crank pin."""


def _best_pose(target: Target, links: Floats, branch: int, start: Any) -> tuple[Floats, _Poses]:
    """Return the squared objectives (n,) of links at starts, infinite if a sample is not reached, and their poses."""
    assert target.position is not None
    mean, scale = target.position_mean, target.length_scale
    middle = complex(mean(target.position))
    crank = start[:, None] + target.crank
    angle = close_loop(links, crank).coupler_angle(np.array(branch))
    target_path = (target.position - middle) / scale
    arm, own = np.exp(1j * angle), (links[:, :1] / scale) * np.exp(1j * crank)
    centred = arm - mean(arm)[:, None]
    square = mean(np.abs(centred) ** 2)
    independent = square > 1e-28

    def share(values: Any) -> Complexes:
        found: Any = np.where(independent, mean(np.conj(centred) * values), 0.0)
        return found / np.where(independent, square, 1.0)

    def deviation(values: Any) -> Complexes:
        return values - np.expand_dims(mean(values), -1) - share(values)[:, None] * centred

    left, moved = deviation(target_path), deviation(own)
    turn = np.angle(mean(np.conj(moved) * left))
    direction = np.exp(1j * turn)
    cost = mean(np.abs(left - direction[:, None] * moved) ** 2)
    if target.rotation is not None:
        cost = cost + target.rotation_mean(rotation_residual(target, angle)[1] ** 2)
    vector = share(target_path) - direction * share(own)
    pivot = mean(target_path) - direction * mean(own) - vector * mean(arm)
    with np.errstate(invalid="ignore"):  # NaN if the loop opens
        poses = _Poses(turn, middle + scale * pivot, scale * vector / direction)
    return np.where(np.isnan(cost), np.inf, cost), poses


def fitted_poses(
    target: Target, links: Floats, branch: int, starts: Floats, old: Linkage, limits: Limits, work: Work
) -> list[Solution | None]:
    """Fit links in their best pose within the limits, or in a good pose once the work has expired.

    ``target``: with positions. ``links`` (n, 4). ``starts`` (n, m): initial starts; NaN for none. ``old``: a similar linkage,
    whose start is tried too.

    The result is None if no pose within the limits was found. Results satisfy the limits with their own dimensions.
    """
    rows, columns = np.nonzero(np.isfinite(starts))
    tried = np.concatenate([rows, np.arange(len(links))])
    begin = np.concatenate([starts[rows, columns], np.full(len(links), old.start)])
    own, step = links[tried], TURN / OPTIONS.starts
    _, begin = closer_looks(
        lambda trial: _scanned(target, target, own, branch, trial, limits),
        begin - step,
        begin + step,
        OPTIONS.refinements,
    )
    cost, poses = _best_pose(target, own, branch, begin)
    order = np.flatnonzero(np.isfinite(cost))[np.argsort(cost[np.isfinite(cost)], kind="stable")]
    placed = {int(k): _linkage(own[k], branch, float(begin[k]), poses, k) for k in order}
    best: list[Solution | None] = [None] * len(links)
    first: dict[int, Linkage] = {}
    for k, linkage in placed.items():
        row = int(tried[k])
        if best[row] is None:
            best[row] = _better(None, within(target, limits, assess(target, [linkage])))
            first.setdefault(row, linkage)
    if limits.only_family:
        return best
    for row, lengths in enumerate(links):
        nearest = first.get(row)
        known = best[row]
        if (known is not None and nearest is known.linkage) or work.expired():
            continue
        try:
            given = replace(limits, links=tuple(lengths.tolist()))
        except FieldError:  # the lengths themselves violate a limit
            continue
        for start in (nearest, with_links(old, tuple(lengths.tolist()))):
            if start is not None:
                found = nearby_motion(target, given, start, 0.0, work, _NEARBY)
                exact = [with_links(solution.linkage, tuple(lengths.tolist())) for solution in found]
                best[row] = _better(best[row], within(target, limits, assess(target, exact)))
    return best


def _better(known: Solution | None, found: Sequence[Solution]) -> Solution | None:
    """Return the solution with the smallest objective."""
    return min([*([known] if known else []), *found], key=lambda solution: solution.errors.objective, default=None)


def _linkage(links: Floats, branch: int, start: float, poses: _Poses, k: int) -> Linkage:
    """Return links in their best pose."""
    point = complex(poses.point[k])
    polar = (abs(point), wrap(float(np.angle(point))))
    turn = wrap(float(poses.turn[k]))
    return four_bar(as_lengths(links), branch, start % TURN, complex(poses.pivot[k]), turn, polar)


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
