"""How four-bars pass the samples of a motion: in order or not, on which branch and circuit, driven from which side, how straight.

A linkage that reaches every sample may still fail as a machine: the crank must turn back between two samples (order defect),
pass a dead position where coupler and rocker lie on a line (branch defect), or the linkage must be taken apart and assembled
the other way round (circuit defect). The words are those of Chase and Mirth, "Circuits and branches of single-degree-of-freedom
planar linkages", ASME Journal of Mechanical Design 115 (1993), 223-230. And a path may meet every sample and make a loop between
two: its excursion says how far it goes there.

A configuration is given by theta1 and the side of C (+1: left of D->B), which is the sign of sin(theta3 - theta2). With X and Y
of `kinematics` the loop closes where both are at least 0; X is smallest at theta1 = pi, where it is
(L2+L3)^2 - (L1+L4)^2, and Y at theta1 = 0, where it is (L4-L1)^2 - (L3-L2)^2. So two signs tell everything about circuits:

* Neither is negative: the crank turns fully, it is or the ground is the shortest link. sin(theta3 - theta2) vanishes only where
  X Y = 0, so never: the side cannot change, and the two sides are the two circuits.
* One is negative (not a Grashof linkage): the crank swings about the other place. Both sides meet at both ends of the swing: one
  circuit.
* Both are negative (a Grashof linkage; coupler or rocker is the shortest link): theta1 reaches neither 0 nor pi, so the sign of
  sin(theta1) cannot change: the two circuits, mirror images. Within each both sides meet at both ends of the swing.

What is said of the crank holds for the rocker after both have changed places: lengths (L3, L2, L1, L4), crank angle pi - theta3,
side the sign of sin(theta1 - theta2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.four_bar import Closure, close_loop, grashof_excesses
from synthesis.fourbar.limits import (
    LINK_RATIO,
    REACH,
    ROOM,
    SHORTEST,
    TRANSMISSION_ANGLE,
    TRANSMISSION_ANGLE_TURN,
    Limits,
    placed_by,
)
from synthesis.linkage import Linkage
from synthesis.target import TURN, Samples, Target

TIE = 1e-9
"""Crank angles closer than this, in radians, are the same place: they are in order either way round."""
DEAD = 1e-7
"""Below this transmission angle, in radians, both sides are the same place to within the rounding of theta1."""
NEAR_CHANGE_POINT = 1e-6
"""Of the perimeter: where |s + l - p - q| is smaller, circuits all but meet and manufacture decides which of them it is on."""
# what is said
NAMED = 3
"""A reason names as many samples, or pairs of neighbours, and counts the rest."""
_ROUNDED = 1e-9
"""Part by which a limit may seem broken that is kept to rounding."""
_ONE_POSITION, _ALIKE = 1e-5, 1e-3
"""Part of a drive's way below which two of its positions are one, and of the motion's extent, or radians, from which on what
is asked at two samples differs."""
# ways between samples
LEAVES_SAMPLES = 2.5
"""Above this excursion the curve leaves the samples in between."""
SHORTEST_CHORD = 0.05
"""Of the length scale: shorter chords count as this long."""
PANEL = np.deg2rad(15.0)
"""Longest panel of the rule for arc lengths, in the coordinate round the circuit."""
HALVINGS = 14
"""A panel is halved so often at most; a cusp of the curve needs it."""
_GROWN = 50
"""Times as many panels at most: where more would be rough, it is the rounding of the positions that is."""
ACCURACY = 1e-8
"""Estimated error of a panel, of the whole way between two samples, above which it is halved."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
# of values at the nodes, the last two coefficients of their Legendre series
TAIL = (np.polynomial.legendre.legvander(NODES, 7) * WEIGHTS[:, None] * (np.arange(8) + 0.5))[:, 6:]


@dataclass(frozen=True)
class Circuits:
    """Where the crank of linkages can be.

    ``turns``, ``at_zero``, ``at_pi`` (n, 1): the loop closes at every crank angle; at theta1 = 0; at theta1 = pi.
    ``uncertain`` (n,): nearer to a change point than `NEAR_CHANGE_POINT`.
    """

    turns: Flags
    at_zero: Flags
    at_pi: Flags
    uncertain: Flags

    @classmethod
    def of(cls, lengths: Floats) -> Circuits:
        """Those of linkages with lengths (n, 4), by the signs of Y at theta1 = 0, a b, and of X at pi, c times the perimeter."""
        a, b, c = grashof_excesses(lengths)
        at_zero, at_pi = (np.sign(a) * np.sign(b) >= 0)[:, None], (c >= 0)[:, None]
        # of the three pairings of the links s + l against p + q is the nearest to equality
        least = np.minimum(np.minimum(np.abs(a), np.abs(b)), np.abs(c))
        return cls(at_zero & at_pi, at_zero, at_pi, least < NEAR_CHANGE_POINT * lengths.sum(axis=-1))

    def swing(self, angle: Floats) -> tuple[Floats, Floats]:
        """Angles (n, N) less whole turns, cut where the crank cannot be, and the number of the swing: one more after each cut."""
        shift = np.where(self.at_zero, np.pi, 0.0)
        swings = np.where(self.at_zero | self.at_pi, 1.0, 2.0)  # in a turn
        number = np.floor((angle + shift) * swings / TURN)
        return angle - TURN * np.floor(number / swings), number


@dataclass(frozen=True)
class Passage:
    """How the crank passes samples; a flag of neighbours, shape (n, N - 1), is that of samples k and k + 1.

    ``closes`` (n, N): the four lengths reach the crank angle. ``other_branch``, ``other_circuit``, ``open_between``,
    ``out_of_order`` (n, N - 1): defects between neighbours; ``open_between``: the loop does not close everywhere on the
    prescribed way. ``no_return`` (n,): the way must lead on from the last sample to the first, and the crank does not
    turn fully. ``uncertain`` (n,): as of `Circuits`.
    """

    closes: Flags
    other_branch: Flags
    other_circuit: Flags
    open_between: Flags
    out_of_order: Flags
    no_return: Flags
    uncertain: Flags

    @cached_property
    def order(self) -> Flags:
        """Shape (n,)."""
        broken = np.any(self.out_of_order | self.open_between, axis=-1)
        return np.all(self.closes, axis=-1) & ~broken & ~self.no_return

    @cached_property
    def branch(self) -> Flags:
        """Shape (n,)."""
        return ~np.any(self.other_branch, axis=-1)

    @cached_property
    def circuit(self) -> Flags:
        """Shape (n,)."""
        return np.all(self.closes, axis=-1) & ~np.any(self.other_circuit | self.open_between, axis=-1)

    @cached_property
    def driven(self) -> Flags:
        """Whether the crank drives the linkage through all samples in order, turning one way; shape (n,)."""
        return self.order & self.branch & self.circuit


def one_way(steps: Floats) -> tuple[Floats, Floats]:
    """Steps (n, m) modulo a turn, all taken the same way round, and that way, +1 or -1, shape (n, 1).

    It is the way of fewer turns in total; where they are equal, that of most steps. Ties may lie just behind, not a turn ahead.
    """
    ahead, back = ((way * steps + TIE) % TURN - TIE for way in (1.0, -1.0))
    fewer = [np.ceil(np.sum(one, axis=-1, keepdims=True) / TURN - TIE) for one in (ahead, back)]
    most = np.sum(np.sign(back - ahead), axis=-1, keepdims=True) >= 0
    forward = (fewer[0] < fewer[1]) | ((fewer[0] == fewer[1]) & most)
    return np.where(forward, ahead, back), np.where(forward, 1.0, -1.0)


def passage(
    lengths: ArrayLike,
    crank_angle: ArrayLike,
    side: ArrayLike,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
) -> Passage:
    """How the crank of linkages passes samples.

    Order by crank angles, modulo a turn: a crank that turns fully passes them in order if the steps from sample to sample, all
    taken forwards or all backwards, add up to a turn at most; one that swings, if its angles rise or fall throughout.

    Law: ``driven`` and its parts are the same for reversed samples, ``k * lengths`` and the mirror image (-theta1,
    -side).

    Parameters
    ----------
    lengths : array_like, shape (n, 4)
        L1, L2, L3, L4 in any unit.
    crank_angle : array_like, shape (n, N)
        theta1 at the samples in radians.
    side : array_like of +1 or -1, shape (n, N)
        The branch that each sample lies on.
    ordered : bool
        The samples are to be passed in the order given; otherwise in any order, within a turn.
    closed : bool
        After the last sample the way leads on to the first.
    timed : bool
        The crank angles are prescribed: they, and the way between them, are taken as they are, over several turns too. Otherwise
        they count modulo a turn.
    """
    lengths, angle, side = np.asarray(lengths, dtype=float), np.asarray(crank_angle, dtype=float), np.asarray(side)
    closure = close_loop(lengths, angle)
    where = Circuits.of(lengths)
    turns = where.turns
    if np.any(side != side[..., :1]):
        # a sample at a dead position lies on both branches: it is given that of the sample farthest from one
        transmission = np.nan_to_num(closure.transmission_angle)
        clearest = np.take_along_axis(side, np.argmax(transmission, axis=-1)[:, None], axis=-1)
        side = np.where(transmission < DEAD, clearest, side)
    other_branch = np.diff(side, axis=-1) != 0
    angle = np.where(closure.closed, angle, 0.0)
    within, number = where.swing(angle)
    both_closed = closure.closed[:, 1:] & closure.closed[:, :-1]
    leaves = ~turns & both_closed & (np.diff(number, axis=-1) != 0)
    mirror_image = ~(where.at_zero | where.at_pi) & both_closed & (np.diff(number, axis=-1) % 2 != 0)
    open_between = leaves if timed else np.zeros_like(leaves)
    if timed:
        steps = np.diff(angle, axis=-1)
        out_of_order = steps * np.sign(angle[:, -1:] - angle[:, :1]) <= 0
    elif ordered:
        travelled = np.cumsum(one_way(np.diff(angle, axis=-1))[0], axis=-1)
        steps = np.diff(within, axis=-1)
        rises, falls = steps > TIE, steps < -TIE
        turns_back = np.where(np.sum(rises, axis=-1) >= np.sum(falls, axis=-1), falls.T, rises.T).T
        out_of_order = np.where(turns, travelled > TURN + TIE, turns_back) | mirror_image
    else:
        out_of_order = mirror_image
    return Passage(
        closure.closed,
        other_branch,
        np.where(turns, other_branch, mirror_image),
        open_between,
        out_of_order & both_closed,
        closed & ~turns[:, 0],
        where.uncertain,
    )


def from_the_rocker(lengths: ArrayLike, crank_angle: ArrayLike, side: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """The same configurations with crank and rocker exchanged, as lengths, crank angle and side; shapes as of `passage`.

    Law: doing it twice gives the configurations back, crank angles modulo a turn.
    """
    lengths, side = np.asarray(lengths, dtype=float), np.asarray(side)
    closure = close_loop(lengths, crank_angle)
    theta3 = np.where(side > 0, closure.rocker_angle(1), closure.rocker_angle(-1))
    theta2 = np.where(side > 0, closure.coupler_angle(1), closure.coupler_angle(-1))
    across = np.sin(closure.crank_angle - theta2)
    return lengths[:, [2, 1, 0, 3]], np.pi - theta3, np.where(across >= 0, 1.0, -1.0)


@dataclass(frozen=True)
class Verdict:
    """How a linkage passes the samples of its motion.

    Attributes
    ----------
    order : bool
        Judged by the crank angles alone: a crank that turns one way passes them in the order asked for.
    branch : bool
        The sign of sin(theta2 - theta3) is the same at all samples.
    circuit : bool
        All samples, and all between, lie on one circuit.
    driver : str or None
        "crank": it drives the linkage through all samples in order, turning one way (order, branch and circuit are true);
        "rocker": the crank cannot, but the rocker can; None: neither can.
    uncertain : bool
        Nearer to a change point than `passage.NEAR_CHANGE_POINT`.
    reasons : tuple of str
        A sentence for each defect; samples count from 1.
    """

    order: bool
    branch: bool
    circuit: bool
    driver: str | None
    uncertain: bool
    reasons: tuple[str, ...]


def verdicts(
    linkages: Sequence[Linkage],
    crank_angle: ArrayLike,
    side: ArrayLike,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
) -> list[Verdict]:
    """The `Verdict` of each linkage; arguments as of `passage`, one row a linkage."""
    if not linkages:
        return []
    lengths = np.array([one.links for one in linkages])
    angle, side = np.asarray(crank_angle, dtype=float), np.asarray(side)
    crank = passage(lengths, angle, side, ordered=ordered, closed=closed, timed=timed)
    rest = np.flatnonzero(crank.circuit & ~crank.driven)
    by_rocker = np.zeros(len(lengths), dtype=bool)
    if rest.size:
        other = from_the_rocker(lengths[rest], angle[rest], side[rest])
        by_rocker[rest] = passage(*other, ordered=ordered, closed=closed).driven
    found = []
    columns = (crank.order, crank.branch, crank.circuit, crank.uncertain, crank.driven, by_rocker)
    for k, (order, branch, circuit, uncertain, driven, otherwise) in enumerate(
        zip(*(one.tolist() for one in columns))
    ):
        driver = "crank" if driven else "rocker" if otherwise else None
        reasons = reasons_of(crank, k, driver, "crank", ("rocker",)) if uncertain or not driven else ()
        found.append(Verdict(order, branch, circuit, driver, uncertain, reasons))
    return found


def reasons_of(
    passed: Passage, k: int, driver: str | None, drive: str, others: Sequence[str], turns: bool = True
) -> tuple[str, ...]:
    """A sentence for each defect of one linkage of a passage by ``drive``, which turns, or moves on a line.

    ``driver``: what can drive it instead, one of ``others``, if anything.
    """
    moves, moving = ("turns", "turning") if turns else ("moves", "moving")
    reasons = []
    if not np.all(passed.closes[k]):
        numbers = [str(place + 1) for place in np.flatnonzero(~passed.closes[k])]
        reasons.append(f"the linkage does not close at {_listed(numbers)}")
    if np.any(flags := passed.open_between[k]):
        reasons.append(f"the linkage does not close everywhere between {_named(flags)}")
    if np.any(flags := passed.other_branch[k]):
        reasons.append(f"{_named(flags)} lie on different branches")
    if np.any(flags := passed.other_circuit[k]):
        reasons.append(
            f"{_named(flags)} lie on different circuits: the linkage would have to be taken apart between them"
        )
    if np.all(passed.closes[k]) and np.any(flags := passed.out_of_order[k] & ~passed.other_circuit[k]):
        first = int(np.argmax(flags)) + 1
        reasons.append(f"a {drive} that {moves} one way does not pass samples {first} and {first + 1} in this order")
    if passed.no_return[k]:
        only = f"the {drive} only swings" if turns else f"the {drive} only goes to and fro"
        reasons.append(f"{only}: {moving} one way it does not come from the last sample to the first")
    if driver is not None and driver != drive:
        reasons.append(f"only the {driver} can drive the linkage through the samples, not the {drive}")
    elif driver is None:
        every = [drive, *others]
        named = f"{', '.join(every[:-1])} nor {every[-1]}"
        reasons.append(
            f"neither {named} can drive the linkage through the samples, {moving} one way"
            if others
            else f"the {drive} cannot drive the linkage through the samples, {moving} one way"
        )
    if passed.uncertain[k]:
        reasons.append("the linkage is so near a change point that it may pass from one circuit to the other")
    return tuple(reasons)


def shared_positions(motion: Target, turns: bool = True) -> list[str]:
    """A sentence where samples of which different things are asked lie at one position of the drive, to rounding.

    A drive that keeps their order only so passes them as one; so it does both ends of an open way, a whole turn apart.

    ``motion``: with the drive's positions. ``turns``: these are angles, and count modulo a turn.
    """
    least = _ONE_POSITION * np.ptp(motion.crank)
    place = motion.crank % TURN if turns else motion.crank
    order = np.argsort(place, kind="stable")
    step = np.diff(place[order], append=place[order[0]] + TURN if turns else np.inf)
    pairs = np.sort(np.stack([order, np.roll(order, -1)]), axis=0)[:, step <= least]
    differ = np.zeros(pairs.shape[1], dtype=bool)
    for asked, weights, same in (
        (motion.position, motion.position_weights, _ALIKE * motion.extent if motion.position is not None else 0.0),
        (None if motion.rotation is None else np.exp(1j * motion.rotation), motion.rotation_weights, _ALIKE),
    ):
        if asked is not None:
            first, second = pairs
            both = True if weights is None else (weights[first] > 0) & (weights[second] > 0)
            differ |= (np.abs(asked[first] - asked[second]) > same) & both
    if not differ.any():
        return []
    named = sorted((pairs[:, differ] + 1).T.tolist())
    names = [str(one) for one in named[0]] if len(named) == 1 else [f"{one}/{other}" for one, other in named]
    what, near = ("crank position", "rounding or a whole turn") if turns else ("position of the drive", "rounding")
    return [f"{_listed(names)} share one {what}, to {near}, though they differ"]


def _named(flags: Flags) -> str:
    """The pairs of neighbours (N - 1,) that are flagged: "samples 2 and 3", "samples 2/3, 7/8"."""
    first = np.flatnonzero(flags) + 1
    return _listed(f"{first[0]} {first[0] + 1}".split() if first.size == 1 else [f"{k}/{k + 1}" for k in first])


def _listed(names: list[str]) -> str:
    """Samples by name, the first few: "sample 2", "samples 2 and 3", "samples 2, 3, 4 and 5 more"."""
    if len(names) == 1:
        return f"sample {names[0]}"
    rest = len(names) - NAMED
    named, last = (names[:NAMED], f"{rest} more") if rest > 0 else (names[:-1], names[-1])
    return f"samples {', '.join(named)} and {last}"


class _Built(Protocol):
    @property
    def linkage(self) -> Linkage: ...

    @property
    def transmission_angle_min(self) -> float: ...

    @property
    def transmission_angle_min_turn(self) -> float | None: ...


def practical_faults(solution: _Built, samples: Samples, limits: Limits, excursion: float | None = None) -> list[str]:
    """`faults_of` a four-bar."""
    linkage = solution.linkage
    pivots = {"pivot_a": linkage.pivot_a, "pivot_b": linkage.pivot_b}
    angles = solution.transmission_angle_min, solution.transmission_angle_min_turn
    arm = max(abs(linkage.arm), abs(linkage.arm - linkage.links[1])) if linkage.mounted else 0.0
    return faults_of(angles, linkage.links, pivots, samples, limits, excursion, arm)


def faults_of(
    angles: tuple[float, float | None],
    links: Sequence[float],
    pivots: Mapping[str, complex],
    samples: Samples | None,
    limits: Limits,
    excursion: float | None = None,
    arm: float = 0.0,
) -> list[str]:
    """Return a sentence for each practical limit that a linkage violates; a limit of the request replaces the practical one.

    Parameters
    ----------
    angles : tuple
        Smallest transmission angles over the used interval, and over the turn if that counts.
    links : sequence of float
        Lengths of the links.
    pivots : mapping
        Fixed pivots by the names of their limits.
    samples : Samples or None
        The motion. Without positions lengths are ratios, and only those are judged.
    limits : Limits
        Of the request.
    excursion : float, optional
        Of the body point between samples, see `excursions`.
    arm : float
        Largest distance of the body point from a joint of the body, which is bounded like a link.
    """
    faults = []
    least = limits.transmission_angle_min or TRANSMISSION_ANGLE
    rows = [(angles[0], least, "over the used interval")]
    if angles[1] is not None:
        rows.append((angles[1], limits.transmission_angle_min_turn or TRANSMISSION_ANGLE_TURN, "over the whole turn"))
    for found, wanted, where in rows:
        if found < wanted - _ROUNDED:
            degrees = np.rad2deg([found, wanted])
            faults.append(f"transmission angle {degrees[0]:.3g} degrees {where}, below {degrees[1]:.3g}")
    longest, shortest, most = max(links, default=0.0), min(links, default=0.0), limits.link_ratio_max or LINK_RATIO
    if longest > most * shortest * (1 + _ROUNDED):
        ratio = longest / shortest if shortest > 0 else np.inf
        faults.append(f"longest link {ratio:.3g} times the shortest, above {most:g}")
    if samples is not None and samples.position is not None:
        extent, middle = samples.extent, complex(samples.position_mean(samples.position))
        reach = max(REACH, ROOM * (limits.link_min or 0.0) / extent)
        if limits.link_max is None and longest > reach * extent:
            faults.append(f"longest link {longest / extent:.3g} times the motion's extent, above {reach:.4g}")
        arm_max = reach * extent if limits.link_max is None else limits.link_max
        if limits.coupler_radius_max is None and arm > arm_max * (1 + _ROUNDED):
            faults.append(
                f"the body point lies {arm:.4g} from a joint of its link, above {arm_max:.4g}, the longest link"
            )
        link_min = SHORTEST * extent if limits.link_min is None else limits.link_min
        if links and shortest < link_min * (1 - _ROUNDED):
            faults.append(
                f"shortest link {shortest / extent:.3g} times the motion's extent, below {link_min / extent:.3g}"
            )
        far = [abs(place - middle) / extent for name, place in pivots.items() if not placed_by(limits, name)]
        if far and max(far) > reach * (1 + _ROUNDED):
            faults.append(f"a fixed pivot {max(far):.3g} extents from the motion's middle, above {reach:.4g}")
    if excursion is not None and excursion > LEAVES_SAMPLES:
        faults.append(
            f"the body point goes {excursion:.3g} times as far between two samples as they are apart, above {LEAVES_SAMPLES:g}"
        )
    return faults


def size_of(linkage: Linkage, samples: Samples) -> float | None:
    """Largest of the links, the coupler point's radius and the pivots' distances from the motion's middle, over its extent.

    None without positions.
    """
    if samples.position is None or linkage.coupler_point is None:
        return None
    middle = complex(samples.position_mean(samples.position))
    reach = (abs(linkage.pivot_a - middle), abs(linkage.pivot_b - middle))
    return float(max(*linkage.links, linkage.coupler_point[0], *reach)) / samples.extent


def proportion(linkage: Linkage, samples: Samples) -> float:
    """How many extents of the motion, or shortest links, the longest part is, whichever are more."""
    return max(linkage.link_ratio, size_of(linkage, samples) or 0.0)


@dataclass(frozen=True)
class RoundCircuit:
    """A coordinate that runs once round each circuit, 0 to 2 pi; arrays of shape (n, 1).

    It is theta1 where the crank turns fully. A crank that swings between theta1 = ``low`` and ``low + width`` moves as
    ``low + width sin^2(t/2)``, out on side +1 (0 < t < pi) and back on side -1: where the sides meet, at the ends of the
    swing, theta2 is infinitely fast in theta1 and smooth in t.
    """

    lengths: Floats
    turns: NDArray[np.bool_]
    low: Floats
    width: Floats
    side: Floats

    @classmethod
    def through(cls, lengths: Floats, crank_angle: Floats, side: Floats) -> tuple[RoundCircuit, Floats]:
        """The coordinate on the circuit of the first sample, and where samples (n, N) are in it."""
        where = Circuits.of(lengths)
        within, _ = where.swing(crank_angle)
        a, b, c = grashof_excesses(lengths)
        product = 4 * lengths[:, 0] * lengths[:, 3]
        # Y = 0 and X = 0 of `kinematics`; zero where the crank can be in line with the ground
        nearest = 2 * np.arcsin(np.sqrt(np.clip(-a * b / product, 0, 1)))[:, None]
        farthest = 2 * np.arccos(np.sqrt(np.clip(-c * lengths.sum(axis=-1) / product, 0, 1)))[:, None]
        low, high = np.where(where.at_zero, -farthest, nearest), np.where(where.at_pi, TURN - nearest, farthest)
        beyond = ~(where.at_zero | where.at_pi) & (within[:, :1] > np.pi)
        low, high = np.where(beyond, TURN - high, low), np.where(beyond, TURN - low, high)
        half = np.arctan2(np.sqrt(np.maximum(within - low, 0)), np.sqrt(np.maximum(high - within, 0)))
        return cls(lengths, where.turns, low, high - low, side[:, :1]), np.where(
            where.turns, crank_angle, 2 * side * half
        )

    def of_rows(self, row: NDArray[np.intp]) -> RoundCircuit:
        """Those of some linkages, also repeated."""
        return RoundCircuit(self.lengths[row], self.turns[row], self.low[row], self.width[row], self.side[row])

    def closure(self, place: Floats) -> tuple[Closure, Floats, Floats]:
        """The loop at places (n, m), the sides, and theta2."""
        angle = np.where(self.turns, place, self.low + self.width * np.sin(place / 2) ** 2)
        side = np.where(self.turns, self.side, np.where(np.sin(place) >= 0, 1.0, -1.0))
        closure = close_loop(self.lengths, angle)
        return closure, side, closure.diagonal_angle + side * 2 * np.arctan2(*closure.coupler_half_angle)

    def speed(self, place: Floats, point: Complexes) -> Floats:
        """|dP/dt| at places (n, m); ``point`` (n, 1) is P - D in the coupler's frame."""
        closure, side, theta2 = self.closure(place)
        angle = closure.crank_angle
        rate = np.where(self.turns, 1.0, self.width / 2 * np.sin(place))
        l1, l2, _, l4 = (closure.lengths[..., k] for k in range(4))
        # the loop's derivative, times e^{-i theta3}: theta2' = -L1 sin(t1 - t3) / (L2 sin(t2 - t3)), both over L3
        root = np.sqrt(closure.excess_x * closure.excess_y)
        slope = -2 * l1 * side * (l2 * np.sin(theta2 - angle) + l4 * np.sin(angle)) / np.where(root > 0, root, np.nan)
        crank = self.lengths[:, :1] * np.exp(1j * angle)
        # at the very end of a swing 0 / 0 in double precision; the panel's other nodes stand for it
        return np.nan_to_num(np.abs(rate * (crank + point * slope * np.exp(1j * theta2))))

    def body_point(self, place: Floats, point: Complexes) -> Complexes:
        """P at places (n, m), in the ground frame."""
        closure, _, theta2 = self.closure(place)
        return self.lengths[:, :1] * np.exp(1j * closure.crank_angle) + point * np.exp(1j * theta2)


def excursions(
    linkages: Sequence[Linkage],
    crank_angle: ArrayLike,
    side: ArrayLike,
    length_scale: float,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
    carried: ArrayLike | None = None,
) -> list[float | None]:
    """The excursion of each linkage's body point.

    It is the largest, over neighbouring samples in the order in which they are passed, of the length of the curve between them
    over their distance; a distance below `SHORTEST_CHORD` of the length scale counts as that. Above `LEAVES_SAMPLES` the curve
    goes somewhere between two samples that nobody asked for. Where order is not required, the widest gap is left out.

    Accurate to 1e-6 of its value, or to rounding of the positions near a change point.

    ``linkages``: mounted ones. ``crank_angle``, ``side``, ``ordered``, ``closed``, ``timed``: as of `passage.passage`,
    one row a linkage. ``length_scale``: l of the objective, in the linkages' unit. ``carried`` (n,): whether one
    circuit carries all samples, `Passage.circuit`, where that is known already.

    At least 1 where no distance is below the shortest; None without a body point, and where no circuit carries all
    samples. Law: the same for reversed samples, and for linkages and length scale times k.
    """
    found: list[float | None] = [None] * len(linkages)
    crank_angle, side = np.asarray(crank_angle, dtype=float), np.asarray(side)
    mounted = [k for k, one in enumerate(linkages) if one.mounted]
    if not mounted:
        return found
    lengths = np.array([linkages[k].links for k in mounted])
    angle, side = crank_angle[mounted], side[mounted]
    if carried is None:
        carried = passage(lengths, angle, side, ordered=ordered, closed=closed, timed=timed).circuit
    else:
        carried = np.asarray(carried)[mounted]
    rows = np.array(mounted)[carried]
    if not rows.size:
        return found
    lengths, angle, side = lengths[carried], angle[carried], side[carried]
    radius, direction = np.array([linkages[k].coupler_point for k in rows]).T
    point = (radius * np.exp(1j * direction))[:, None]
    circuit, place = RoundCircuit.through(lengths, angle, side)
    first, step = _ways(place, circuit.turns, ordered, closed, timed)
    arc = _arcs(circuit, point, first, step)
    ends = circuit.body_point(np.concatenate([first, first + step], axis=-1), point)
    chord = np.abs(np.subtract(*np.split(ends, 2, axis=-1)))
    ratio = np.max(arc / np.maximum(chord, SHORTEST_CHORD * length_scale), axis=-1)
    for k, value in zip(rows, ratio):
        found[k] = float(value)
    return found


def _arcs(circuit: RoundCircuit, point: Complexes, first: Floats, step: Floats) -> Floats:
    """Lengths of the curve between places ``first`` and ``first + step``, shape (n, m).

    Gauss-Legendre sums of |dP/dt| with eight nodes to a panel of 15 degrees at most, halved where needed. With values that are
    analytic the coefficients of their Legendre series fall geometrically, those of degree 6 and 7 by a factor q and the
    error of the sum, of degree 16, by about q^(16/7); Trefethen, Approximation Theory and Approximation Practice, chapter 19.
    """
    panels = np.maximum(np.ceil(np.abs(step) / PANEL), 1).astype(int).ravel()
    gap = np.repeat(np.arange(panels.size), panels)
    width = (step.ravel() / panels)[gap]
    begin = first.ravel()[gap] + (np.arange(gap.size) - (np.cumsum(panels) - panels)[gap]) * width
    arc: Floats = np.zeros(step.size)
    allowed: Floats = np.zeros(step.size)
    most = _GROWN * gap.size
    for halved in range(HALVINGS + 1):
        row = gap // step.shape[1]
        nodes = begin[:, None] + width[:, None] * ((NODES + 1) / 2)
        speed = circuit.of_rows(row).speed(nodes, point[row])
        mean = speed @ WEIGHTS / 2
        part = np.abs(width) * mean
        if not halved:
            allowed[:] = ACCURACY * np.bincount(gap, part, minlength=arc.size)
        tail = np.max(np.abs(speed @ TAIL), axis=-1) / np.where(mean > 0, mean, 1.0)
        rough = part * tail ** (16 / 7) > allowed[gap]
        if halved == HALVINGS or 2 * np.count_nonzero(rough) > most:
            rough[:] = False
        arc += np.bincount(gap[~rough], part[~rough], minlength=arc.size)
        gap, begin, width = gap[rough].repeat(2), begin[rough].repeat(2), width[rough].repeat(2) / 2
        begin[1::2] += width[1::2]
        if not gap.size:
            break
    return arc.reshape(step.shape)


def _ways(place: Floats, turns: NDArray[np.bool_], ordered: bool, closed: bool, timed: bool) -> tuple[Floats, Floats]:
    """Where the ways between neighbours begin, and how far they lead, (n, N - 1), or (n, N) where closed."""
    if not ordered:
        place = np.sort(place % TURN, axis=-1)
        step = np.diff(place, axis=-1, append=place[:, :1] + TURN)
        if not closed:
            widest = np.argmax(step, axis=-1)[:, None]
            rest = (widest + 1 + np.arange(place.shape[-1] - 1)) % place.shape[-1]
            place, step = np.take_along_axis(place, rest, axis=-1), np.take_along_axis(step, rest, axis=-1)
        return place, step
    steps, way = one_way(np.diff(place, axis=-1))
    step = way * steps
    if timed:
        step = np.where(turns, np.diff(place, axis=-1), step)
    if not closed:
        return place[:, :-1], step
    return place, np.concatenate([step, way * ((way * (place[:, :1] - place[:, -1:])) % TURN)], axis=-1)
