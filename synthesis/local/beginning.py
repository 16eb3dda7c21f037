"""The four-bar that a refinement begins with: where its crank has to turn fully and does not, one near it whose crank does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from synthesis.fourbar.kinematics import grashof_excesses
from synthesis.fourbar.limits import in_family
from synthesis.fourbar.linkage import Linkage
from synthesis.ranking import Answer, Status
from synthesis.search.search import SearchReport, StoppedBy
from synthesis.work import Work

_EXCESS = 1e-2
"""Least Grashof excess over the sum of the lengths of a linkage made to turn fully: next to a change point a descent sticks."""
_APART = 1e-3
"""Part by which crank and ground are then moved apart where they stand in the wrong order."""


def turning_fully(linkage: Linkage, family: str) -> Linkage:
    """The linkage where it is of a family of full cranks; else one near it that is, in the same place.

    Parameters
    ----------
    linkage : Linkage
    family : str
        One of `limits.FAMILIES`; of ``any`` the full cranks.
    """
    family = "full_crank" if family == "any" else family
    if in_family(family, np.array([linkage.links]))[0]:
        return linkage
    crank, coupler, rocker, ground = linkage.links
    rocks = {"crank_rocker": True, "double_crank": False}.get(family, crank <= ground)
    # a double-crank's lengths are those of a crank-rocker with crank and ground, coupler and rocker exchanged
    shortest, first, second, fourth = (crank, coupler, rocker, ground) if rocks else (ground, rocker, coupler, crank)
    if fourth < (1 + 2 * _APART) * shortest:
        middle = (shortest + fourth) / 2
        shortest, fourth = (1 - _APART) * middle, (1 + _APART) * middle
    least = _EXCESS * (shortest + first + second + fourth)
    a, b, c = (max(float(one), least) for one in grashof_excesses([shortest, first, second, fourth]))
    first, second, fourth = shortest + (a + c) / 2, shortest + (b + c) / 2, shortest + (a + b) / 2
    links = (shortest, first, second, fourth) if rocks else (fourth, second, first, shortest)
    return replace(linkage, links=links)


def report_of(
    found: Sequence[Answer], begin: Sequence[Answer], seconds: float, tolerance: float, work: Work
) -> SearchReport:
    """How a refinement went: from the error of the given linkage, where it keeps the limits, to that of what was found."""
    trace = [(seconds, min(one.errors.objective for one in begin))] if begin else []
    if found and (not trace or found[0].errors.objective < trace[-1][1]):
        trace.append((work.elapsed, found[0].errors.objective))
    reached = Status.of(found, tolerance) is Status.REACHED
    stopped = StoppedBy.TOLERANCE if reached else StoppedBy.BUDGET if work.expired() else StoppedBy.CONVERGED
    return SearchReport(stopped, trace, 0.0, 1)
