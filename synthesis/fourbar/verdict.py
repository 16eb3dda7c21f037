"""How a four-bar passes the samples of a motion: in order or not, on one branch, on one circuit, and driven from which side.

A linkage that reaches every sample may still fail as a machine: the crank must turn back between two samples (order defect),
pass a dead position where coupler and rocker lie on a line (branch defect), or the linkage must be taken apart and assembled
the other way round (circuit defect). The words are those of Chase and Mirth, "Circuits and branches of single-degree-of-freedom
planar linkages", ASME Journal of Mechanical Design 115 (1993), 223-230.

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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.fourbar.kinematics import close_loop, grashof_excesses
from synthesis.fourbar.linkage import Linkage
from synthesis.target import TURN

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

TIE = 1e-9
"""Crank angles closer than this, in radians, are the same place: they are in order either way round."""
DEAD = 1e-7
"""Below this transmission angle, in radians, both sides are the same place to within the rounding of theta1."""
NEAR_CHANGE_POINT = 1e-6
"""Of the perimeter: where |s + l - p - q| is smaller, circuits all but meet and manufacture decides which of them it is on."""
NAMED = 3
"""A reason names as many samples, or pairs of neighbours, and counts the rest."""


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
        Nearer to a change point than `NEAR_CHANGE_POINT`.
    reasons : tuple of str
        A sentence for each defect; samples count from 1.
    """

    order: bool
    branch: bool
    circuit: bool
    driver: str | None
    uncertain: bool
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Circuits:
    """Where the crank of linkages can be.

    Attributes
    ----------
    turns, at_zero, at_pi : ndarray of bool, shape (n, 1)
        The loop closes at every crank angle; at theta1 = 0; at theta1 = pi.
    """

    turns: Flags
    at_zero: Flags
    at_pi: Flags

    @classmethod
    def of(cls, lengths: Floats) -> Circuits:
        """Those of linkages with lengths (n, 4), by the signs of Y at theta1 = 0, a b, and of X at pi, c times the perimeter."""
        a, b, c = grashof_excesses(lengths)
        at_zero, at_pi = (np.sign(a) * np.sign(b) >= 0)[:, None], (c >= 0)[:, None]
        return cls(at_zero & at_pi, at_zero, at_pi)

    def swing(self, angle: Floats) -> tuple[Floats, Floats]:
        """Angles (n, N) less whole turns, cut where the crank cannot be, and the number of the swing: one more after each cut."""
        shift = np.where(self.at_zero, np.pi, 0.0)
        swings = np.where(self.at_zero | self.at_pi, 1.0, 2.0)  # in a turn
        number = np.floor((angle + shift) * swings / TURN)
        return angle - TURN * np.floor(number / swings), number


@dataclass(frozen=True)
class Passage:
    """How the crank passes samples; a flag of neighbours, shape (n, N - 1), is that of samples k and k + 1.

    Attributes
    ----------
    closes : ndarray of bool, shape (n, N)
        The four lengths reach the crank angle.
    turns : ndarray of bool, shape (n,)
        The crank turns fully.
    other_branch, other_circuit, open_between, out_of_order : ndarray of bool, shape (n, N - 1)
        Defects between neighbours; ``open_between``: the loop does not close everywhere on the prescribed way.
    no_return : ndarray of bool, shape (n,)
        The way must lead on from the last sample to the first, and the crank does not turn fully.
    """

    closes: Flags
    turns: Flags
    other_branch: Flags
    other_circuit: Flags
    open_between: Flags
    out_of_order: Flags
    no_return: Flags

    @property
    def order(self) -> Flags:
        """Shape (n,)."""
        broken = np.any(self.out_of_order | self.open_between, axis=-1)
        return np.all(self.closes, axis=-1) & ~broken & ~self.no_return

    @property
    def branch(self) -> Flags:
        """Shape (n,)."""
        return ~np.any(self.other_branch, axis=-1)

    @property
    def circuit(self) -> Flags:
        """Shape (n,)."""
        return np.all(self.closes, axis=-1) & ~np.any(self.other_circuit | self.open_between, axis=-1)

    @property
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

    Returns
    -------
    Passage
        Law: ``driven`` and its parts are the same for reversed samples, ``k * lengths`` and the mirror image (-theta1, -side).
    """
    lengths, angle = np.asarray(lengths, dtype=float), np.asarray(crank_angle, dtype=float)
    closure = close_loop(lengths, angle)
    where = Circuits.of(lengths)
    turns = where.turns
    # a sample at a dead position lies on both branches: it is given that of the sample farthest from one
    transmission = np.nan_to_num(closure.transmission_angle)
    clearest = np.take_along_axis(np.asarray(side), np.argmax(transmission, axis=-1)[:, None], axis=-1)
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
        turns[:, 0],
        other_branch,
        np.where(turns, other_branch, mirror_image),
        open_between,
        out_of_order & both_closed,
        closed & ~turns[:, 0],
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
    excess = np.min(np.abs(grashof_excesses(lengths)), axis=0)
    uncertain = excess < NEAR_CHANGE_POINT * lengths.sum(axis=-1)
    rest = np.flatnonzero(crank.circuit & ~crank.driven)
    by_rocker = np.zeros(len(lengths), dtype=bool)
    if rest.size:
        other = from_the_rocker(lengths[rest], angle[rest], side[rest])
        by_rocker[rest] = passage(*other, ordered=ordered, closed=closed).driven
    found = []
    for k, (order, branch, circuit, driven) in enumerate(zip(crank.order, crank.branch, crank.circuit, crank.driven)):
        driver = "crank" if driven else "rocker" if by_rocker[k] else None
        reasons = _reasons(crank, k, driver, bool(uncertain[k]))
        found.append(Verdict(bool(order), bool(branch), bool(circuit), driver, bool(uncertain[k]), reasons))
    return found


def _reasons(crank: Passage, k: int, driver: str | None, uncertain: bool) -> tuple[str, ...]:
    """A sentence for each defect of linkage ``k``."""
    reasons = []
    if not np.all(crank.closes[k]):
        numbers = [str(place + 1) for place in np.flatnonzero(~crank.closes[k])]
        reasons.append(f"the linkage does not close at {_listed(numbers)}")
    if np.any(flags := crank.open_between[k]):
        reasons.append(f"the linkage does not close everywhere between {_named(flags)}")
    if np.any(flags := crank.other_branch[k]):
        reasons.append(f"{_named(flags)} lie on different branches")
    if np.any(flags := crank.other_circuit[k]):
        reasons.append(
            f"{_named(flags)} lie on different circuits: the linkage would have to be taken apart between them"
        )
    if np.any(flags := crank.out_of_order[k] & ~crank.other_circuit[k]):
        first = int(np.argmax(flags)) + 1
        reasons.append(f"a crank that turns one way does not pass samples {first} and {first + 1} in this order")
    if crank.no_return[k]:
        reasons.append("the crank only swings: turning one way it does not come from the last sample to the first")
    if driver == "rocker":
        reasons.append("only the rocker can drive the linkage through the samples, not the crank")
    elif driver is None:
        reasons.append("neither crank nor rocker can drive the linkage through the samples, turning one way")
    if uncertain:
        reasons.append("the linkage is so near a change point that it may pass from one circuit to the other")
    return tuple(reasons)


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
