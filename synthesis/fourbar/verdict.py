"""How a four-bar passes the samples of a motion: in order or not, on one branch, on one circuit, and driven from which side.

A linkage that reaches every sample may still fail as a machine: the crank must turn back between two samples (order defect),
pass a dead position where coupler and rocker lie on a line (branch defect), or the linkage must be taken apart and assembled
the other way round (circuit defect). The words are those of Chase and Mirth, "Circuits and branches of single-degree-of-freedom
planar linkages", ASME Journal of Mechanical Design 115 (1993), 223-230.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.passage import Flags, Passage, from_the_rocker, passage

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
        reasons = _reasons(crank, k, driver) if uncertain or not driven else ()
        found.append(Verdict(order, branch, circuit, driver, uncertain, reasons))
    return found


def _reasons(crank: Passage, k: int, driver: str | None) -> tuple[str, ...]:
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
    if np.all(crank.closes[k]) and np.any(flags := crank.out_of_order[k] & ~crank.other_circuit[k]):
        first = int(np.argmax(flags)) + 1
        reasons.append(f"a crank that turns one way does not pass samples {first} and {first + 1} in this order")
    if crank.no_return[k]:
        reasons.append("the crank only swings: turning one way it does not come from the last sample to the first")
    if driver == "rocker":
        reasons.append("only the rocker can drive the linkage through the samples, not the crank")
    elif driver is None:
        reasons.append("neither crank nor rocker can drive the linkage through the samples, turning one way")
    if crank.uncertain[k]:
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
