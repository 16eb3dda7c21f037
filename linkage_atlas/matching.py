"""Rows of an atlas whose rotation is nearest to a motion: `match`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.ma  # which `numpy.unique` imports when it is first called: here before the processes fork
from numpy.typing import ArrayLike

from linkage_atlas.arguments import check_above_zero, check_top, kinds_among
from linkage_atlas.atlases import MECHANISMS, SLIDER_CRANK, Atlas, as_atlas, default_atlas, default_slider_cranks
from linkage_atlas.constructors import FourBar
from linkage_atlas.linkages import Linkage
from linkage_atlas.motions import Motion
from linkage_atlas.notes import counted, sentences
from linkage_atlas.results import Features, Match, Matches, MatchReport
from linkage_atlas.solutions import FINISHING
from synthesis.arrays import Floats
from synthesis.atlas.haar import features as haar_features
from synthesis.atlas.haar import resample
from synthesis.atlas.scan import Scan
from synthesis.atlas.windows import TIE, ScanReport
from synthesis.errors import FieldError
from synthesis.four_bar import principal
from synthesis.guided.by_crank import BY_CRANK
from synthesis.guides import Kind
from synthesis.linkage import as_lengths
from synthesis.target import HOW_TURNED, Target
from synthesis.work import Work


def match(
    rotation: ArrayLike,
    crank_span: float | None = None,
    *,
    crank_angle: ArrayLike | None = None,
    degrees: bool = True,
    atlas: Atlas | str | Path | None = None,
    curve: Literal["coupler", "rocker"] = "coupler",
    mechanisms: Sequence[str] | Literal["all"] = (MECHANISMS[0],),
    top: int = 10,
    features: bool = False,
    budget: float | None = None,
    work: Callable[[float | None], Work] = Work,
) -> Matches:
    """Return the best rows of an atlas by rotation: all types, both branches, every whole degree of start.

    With several kinds of mechanisms they are the best of all, each in its own atlas.

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
        folder, which is built there when it is first needed (some seconds). Slider-cranks have an atlas of their own, computed in
        memory when first needed (some seconds); an atlas of slider-cranks only answers for them.
    curve : {"coupler", "rocker"}
        Link that turns like the body. The first match of rockers prepares the atlas for them, which takes some seconds.
    mechanisms : sequence of {"four_bar", "slider_crank"}, or "all"
        Kinds whose rows are matched: the coupler of a four-bar, the rod of a slider-crank.
    top : int
        Maximum number of rows.
    features : bool
        Also give the Haar features of the request and of each match.
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
    if curve not in ("coupler", "rocker"):
        raise FieldError("/curve", f"must be 'coupler' or 'rocker'; it is {curve!r}")
    kinds = kinds_among(mechanisms, MECHANISMS)
    if curve == "rocker" and SLIDER_CRANK in kinds:
        raise FieldError("/curve", "a slider-crank has no rocker; set `mechanisms` to ['four_bar']")
    if crank_span is None and crank_angle is None:
        raise FieldError("/crank_span", HOW_TURNED)
    atlas = None if atlas is None else as_atlas(atlas)
    atlases = [_atlas_of(kind, atlas) for kind in kinds]
    scans = [source.scan if curve == "coupler" else source.rocker_scan for source in atlases]
    watch = work(budget)
    motion = Motion(rotation, crank_span=crank_span, crank_angle=crank_angle, degrees=degrees)
    target, radian = motion.target, motion.radian
    rotation_target = target.rotation
    assert rotation_target is not None
    rows: list[_Row] = []
    reports = []
    for source, scan in zip(atlases, scans):
        windows, report = scan.best(target, top, work=watch)
        reports.append(report)
        for k, angle in enumerate(scan.angles(target, windows)):
            number, at, side = (int(column[k]) for column in windows[:3])
            rows.append(_Row(source, scan, number, at, side, float(windows.error[k]), angle))
    report = ScanReport(
        sum(each.windows for each in reports),
        sum(each.evaluated for each in reports),
        all(each.exhaustive for each in reports),
    )
    rows.sort(key=lambda row: np.round(row.error / TIE))  # of the same error in the order of the kinds
    rows = rows[:top]
    screened, finishing = watch.elapsed, watch.extended(FINISHING)
    matches: list[Match] = []
    sides: tuple[Literal[-1, 1], ...] = (-1, 1)
    for row in rows:
        if matches and finishing.expired():
            break
        angle = principal(row.angle)
        kind, branch = row.atlas.type_of(row.number), sides[row.branch > 0]
        start = row.start * (360 / row.scan.starts) * (np.pi / 180 / radian)
        offset = float(np.mean(rotation_target - angle) / radian)
        linkage: Linkage
        if row.atlas.kind == SLIDER_CRANK:
            linkage = _slider_crank(kind.lengths, branch, start * radian, offset * radian, radian, target)
        else:
            body = offset if curve == "coupler" else None
            linkage = FourBar(*as_lengths(kind.lengths), branch, start_angle=start, body_offset=body, degrees=degrees)
        own = _features(target.crank, angle, radian) if features else None
        matches.append(
            Match(
                rank=len(matches) + 1,
                kind=row.atlas.kind,
                type=kind,
                start_angle=start,
                branch=branch,
                offset=offset,
                rotation_rms=row.error / radian,
                features=own,
                linkage=linkage,
            )
        )
    features_of_target = _features(target.crank, rotation_target, radian) if features else None
    total = watch.elapsed
    stages = {"screen": screened, "rest": total - screened, "total": total}
    elapsed = {name: 1000 * seconds for name, seconds in stages.items()}
    notes = motion.notes()
    if len(matches) < len(rows):
        notes.append(f"The time was up: only the best {len(matches)} of {counted(len(rows), 'row')} are reported.")
    if not report.exhaustive:
        notes.append("The time was up before all rows of the atlas were examined: others may be better.")
    notes = sentences(notes)
    return Matches(
        matches, MatchReport(elapsed, report.windows, report.evaluated, report.exhaustive, notes, features_of_target)
    )


class _Row(NamedTuple):
    """A window of one of the atlases, and how its body turns over the samples."""

    atlas: Atlas
    scan: Scan
    number: int
    """Row of the type, from 0."""
    start: int
    branch: int
    error: float
    angle: Floats


def _atlas_of(kind: str, atlas: Atlas | None) -> Atlas:
    if atlas is not None:
        return atlas.of(kind)
    return default_slider_cranks() if kind == SLIDER_CRANK else default_atlas()


def _slider_crank(
    lengths: list[int], branch: int, start: float, offset: float, radian: float, target: Target
) -> Linkage:
    """Return the linkage of a row, with its rail along the x axis and the body point in the crank pin; angles in radians."""
    crank, rod, beside = lengths
    signed = np.array([[crank, rod, branch * beside]], dtype=float)
    (linkage,) = BY_CRANK[Kind.SLIDER_CRANK].posed(signed, np.ones(1), np.array([start]), None)
    return Linkage.of(linkage.turned_body(offset), radian, target)


def _features(crank: Floats, curve: Floats, radian: float) -> Features:
    resampled = resample(crank, curve)[1]
    average, details = haar_features(resampled)
    return Features(resampled.size, resampled is not curve, float(average / radian), (details / radian).tolist())
