"""Which rows of an atlas turn most like a motion: `match`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import numpy.ma  # which `numpy.unique` imports when it is first called: here before the processes fork
from numpy.typing import ArrayLike

from linkage_atlas.answers import FINISHING, Features, Match, Matches, MatchReport
from linkage_atlas.atlases import Atlas
from linkage_atlas.cache import default_atlas
from linkage_atlas.linkages import FourBar
from linkage_atlas.motions import Motion, check_above_zero, check_top
from synthesis.atlas.haar import features as haar_features
from synthesis.atlas.haar import resample
from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import principal
from synthesis.fourbar.solution import four
from synthesis.target import HOW_TURNED
from synthesis.work import Work


def match(
    rotation: ArrayLike,
    crank_span: float | None = None,
    *,
    atlas: Atlas | None = None,
    crank_angle: ArrayLike | None = None,
    curve: Literal["coupler", "rocker"] = "coupler",
    degrees: bool = True,
    top: int = 10,
    features: bool = False,
    budget: float | None = None,
    work: Callable[[float | None], Work] = Work,
) -> Matches:
    """The best rows of an atlas by rotation alone: all types, both branches, every whole degree of start.

    Parameters
    ----------
    rotation : array_like, shape (N,)
    crank_span, crank_angle, degrees
        As for `synthesize`.
    atlas : Atlas, optional
        Default: that of ``atlas.h5`` in this folder, or else the default one in the user's cache folder, which is built there
        when it is first needed (some seconds).
    curve : {"coupler", "rocker"}
        Which link is to turn like this. The first match of rockers prepares the atlas for them, some seconds.
    top : int
    features : bool
        Also give the Haar features of the request and of each match.
    budget : float, optional
        Seconds; the best rows of those looked at by then are returned, and the report is not exhaustive.
    work : callable
        As for `synthesize`.

    Returns
    -------
    Matches
        Exactly the best, as if every window had been evaluated, where the report is exhaustive. No pose is computed.

    Raises
    ------
    FieldError
        Naming the argument.
    """
    check_top(top)
    check_above_zero(budget=budget)
    if curve not in ("coupler", "rocker"):
        raise FieldError("/curve", f"wanted 'coupler' or 'rocker', found {curve!r}")
    if crank_span is None and crank_angle is None:
        raise FieldError("/crank_span", HOW_TURNED)
    if atlas is None:
        atlas = default_atlas()
    scan = atlas.scan if curve == "coupler" else atlas.rocker_scan
    watch = work(budget)
    motion = Motion(rotation, crank_span=crank_span, crank_angle=crank_angle, degrees=degrees)
    target, radian = motion.target, motion.radian
    wanted = target.rotation
    assert wanted is not None
    windows, report = scan.best(target, top, work=watch)
    screened, finishing = watch.elapsed, watch.extended(FINISHING)
    matches: list[Match] = []
    for k, angle in enumerate(scan.angles(target, windows)):
        if matches and finishing.expired():
            break
        angle = principal(angle)
        kind, branch = atlas.type_of(int(windows.row[k])), _side(windows.branch[k])
        start = float(windows.start[k]) * (360 / scan.starts) * (np.pi / 180 / radian)
        offset = float(np.mean(wanted - angle) / radian)
        body = offset if curve == "coupler" else None
        linkage = FourBar(*four(kind.lengths), branch, start_angle=start, body_offset=body, degrees=degrees)
        error = float(windows.error[k] / radian)
        own = _features(target.crank, angle, radian) if features else None
        matches.append(
            Match(
                rank=k + 1,
                type=kind,
                start_angle=start,
                branch=branch,
                offset=offset,
                similarity=error,
                features=own,
                linkage=linkage,
            )
        )
    asked = _features(target.crank, wanted, radian) if features else None
    total = watch.elapsed
    stages = {"screen": screened, "rest": total - screened, "total": total}
    elapsed = {name: 1000 * seconds for name, seconds in stages.items()}
    notes = motion.notes()
    if len(matches) < windows.row.size:
        notes.append(f"the time was up: of {windows.row.size} rows the best {len(matches)} are reported")
    if not report.exhaustive:
        notes.append("the scan was cut short: rows that it did not come to may be better")
    return Matches(matches, MatchReport(elapsed, report.windows, report.evaluated, report.exhaustive, notes, asked))


def _side(branch: float) -> Literal[-1, 1]:
    return 1 if branch > 0 else -1


def _features(crank: Any, curve: Any, radian: float) -> Features:
    resampled = resample(crank, curve)[1]
    average, details = haar_features(resampled)
    return Features(resampled.size, resampled is not curve, float(average / radian), (details / radian).tolist())
