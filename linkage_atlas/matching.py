"""Rows of an atlas whose rotation is nearest to a motion: `match`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.ma  # which `numpy.unique` imports when it is first called: here before the processes fork
from numpy.typing import ArrayLike

from linkage_atlas.arguments import check_above_zero, check_top
from linkage_atlas.atlases import Atlas, as_atlas, default_atlas
from linkage_atlas.constructors import FourBar
from linkage_atlas.motions import Motion
from linkage_atlas.notes import counted, sentences
from linkage_atlas.results import Match, Matches, MatchReport
from linkage_atlas.solutions import FINISHING
from synthesis.errors import FieldError
from synthesis.four_bar import principal
from synthesis.linkage import as_lengths
from synthesis.target import HOW_TURNED
from synthesis.work import Work


def match(
    rotation: ArrayLike,
    crank_span: float | None = None,
    *,
    crank_angle: ArrayLike | None = None,
    degrees: bool = True,
    atlas: Atlas | str | Path | None = None,
    top: int = 10,
    budget: float | None = None,
    work: Callable[[float | None], Work] = Work,
) -> Matches:
    """Return the best rows of an atlas by rotation: all types, both branches, every whole degree of start.

    The source of the atlas (Sun, Liu, Chu) calls this step *fuzzy recognition*: the types whose Haar detail coefficients
    differ least from those of the request are recognised, ten by default. Here the difference is computed exactly, as the rms
    rotation error after the best constant offset. For 2^j even samples that is the Euclidean norm of the difference of the
    orthonormal details over sqrt(2^j) (Parseval); unlike the details it is also defined for other numbers of samples, uneven
    ones, and weights.

    Parameters
    ----------
    rotation : array_like, shape (N,)
        Rotation of the body at the samples, continuous and without jumps by whole turns.
    crank_span : float, optional
        Crank angle from the first sample to the last, evenly spaced; negative: clockwise.
    crank_angle : array_like, shape (N,), optional
        Crank angles in place of ``crank_span``; only the increments from the first angle count.
    degrees : bool
        Unit of every angle: degrees, or radians if it is False.
    atlas : Atlas, str or Path, optional
        An atlas, or the path of its file. Default: ``atlas.h5`` in this folder, or else the default atlas in the user's cache
        folder, which is built there when it is first needed (some seconds).
    top : int
        Maximum number of rows.
    budget : float, optional
        Time limit in seconds; the best rows found by then are returned, and the report is not exhaustive.
    work : callable
        Function that makes the object that watches time and cancellation from a budget in seconds.

    Returns
    -------
    Matches
        The best rows. If the report is exhaustive, they are exactly the best rows, as if every window had been evaluated.
        No pose is computed.

    Raises
    ------
    FieldError
        If an argument is wrong; the error names it.

    Examples
    --------
    >>> import tempfile, numpy as np, linkage_atlas as la
    >>> rotation = la.FourBar(5, 9, 12, 14, start_angle=30).joints(np.linspace(0, 70, 16)).rotation
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     atlas = la.build_atlas(f"{folder}/small.h5", perimeter=40, samples=16, jobs=1)
    >>> la.match(rotation, 70, atlas=atlas)[0].type.lengths
    [5, 9, 12, 14]
    """
    check_top(top)
    check_above_zero(budget=budget)
    if crank_span is None and crank_angle is None:
        raise FieldError("/crank_span", HOW_TURNED)
    source = default_atlas() if atlas is None else as_atlas(atlas)
    scan, watch = source.scan, work(budget)
    motion = Motion(rotation, crank_span=crank_span, crank_angle=crank_angle, degrees=degrees)
    target, radian = motion.target, motion.radian
    assert target.rotation is not None
    windows, report = scan.best(target, top, work=watch)
    screened, finishing = watch.elapsed, watch.extended(FINISHING)
    matches: list[Match] = []
    sides: tuple[Literal[-1, 1], ...] = (-1, 1)
    curves = scan.angles(target, windows)
    for k, curve in enumerate(curves):
        if matches and finishing.expired():
            break
        row, at, side = (int(column[k]) for column in windows[:3])
        kind, branch = source.type_of(row), sides[side > 0]
        start = at * (360 / scan.starts) * (np.pi / 180 / radian)
        offset = float(np.mean(target.rotation - principal(curve)) / radian)
        lengths = as_lengths(kind.lengths)
        linkage = FourBar(*lengths, branch, start_angle=start, body_offset=offset, degrees=degrees)
        error = float(windows.error[k]) / radian
        matches.append(Match(k + 1, kind, start, branch, offset, error, linkage))
    total = watch.elapsed
    stages = {"screen": screened, "rest": total - screened, "total": total}
    elapsed = {name: 1000 * seconds for name, seconds in stages.items()}
    notes = motion.notes()
    if len(matches) < len(curves):
        notes.append(f"The time was up: only the best {len(matches)} of {counted(len(curves), 'row')} are reported.")
    if not report.exhaustive:
        notes.append("The time was up before all rows of the atlas were examined: others may be better.")
    described = MatchReport(elapsed, report.windows, report.evaluated, report.exhaustive, sentences(notes))
    return Matches(matches, described)
