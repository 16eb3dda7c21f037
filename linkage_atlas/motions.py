"""A requested motion: plain arrays in degrees or radians, checked by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkage_atlas.arguments import build, column, number, radians_in, read_length_unit, sequence
from linkage_atlas.cells import decoded
from linkage_atlas.heads import POSES
from linkage_atlas.plotting import plot_curves, plot_poses
from linkage_atlas.records import plane
from linkage_atlas.tables import read_table
from linkage_atlas.two_points import poses_of_points
from synthesis.arrays import Complexes, Floats
from synthesis.errors import FieldError
from synthesis.linkage import Linkage
from synthesis.poses import MIN_POSES, Poses, make_poses
from synthesis.simple_motions import hinge_of, straight_guide_error
from synthesis.solution import target_of
from synthesis.target import (
    HOW_TURNED,
    MAX_LENGTH,
    MAX_SAMPLES,
    MIN_LENGTH,
    MIN_SAMPLES,
    TURN,
    Samples,
    Target,
    make_target,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

__all__ = ["MAX_LENGTH", "MAX_SAMPLES", "MIN_LENGTH", "MIN_POSES", "MIN_SAMPLES", "MOST_STOCK", "Motion"]

_TURNS, _RADIANS = 2.0, 0.25
"""Largest range in turns, and smallest range in radians, of angles in degrees whose unit is questioned."""

_WRAPPED = 0.75
"""Fraction of a turn above which a jump between two samples comes from angles that are written within a turn."""
MOST_STOCK = 1000
"""Maximum number of lengths in stock."""
OR_PLACED = "; with `position` its angles may stay unknown, and are found with the linkage"
N = TypeVar("N", np.float64, np.complex128)


@dataclass(frozen=True)
class Tolerances:
    """Largest allowed errors at the samples, (N,) each, in radians and in the user's unit of length; None: not limited."""

    rotation: Floats | None
    position: Floats | None

    def objective(self, samples: Samples) -> float:
        """Return the objective of a motion with the largest allowed error at every sample."""
        square = 0.0
        if self.rotation is not None:
            square += float(np.mean(self.rotation**2))
        if self.position is not None:
            square += float(np.mean((self.position / samples.length_scale) ** 2))
        return float(np.sqrt(square))

    def shares(self, target: Target, linkage: Linkage) -> Floats:
        """Return the largest ratio of an error to its tolerance at each sample, (N,); missing values have no error."""
        body, share = linkage.body(linkage.start + target.crank), np.zeros(target.samples)
        if self.rotation is not None and target.rotation is not None:
            off = target.rotation - body.rotation
            if target.found:  # whole turns do not count
                off -= TURN * np.round(off / TURN)
            gap = target.rotation_mean.zero_missing(np.abs(off))
            share = np.maximum(share, gap / self.rotation)
        if self.position is not None and target.position is not None:
            gap = target.position_mean.zero_missing(np.abs(target.position - body.position))
            share = np.maximum(share, gap / self.position)
        return share


class Motion:
    """Required motion of a body: its rotation, its positions or both, at samples of the crank's turn.

    Parameters
    ----------
    rotation : array_like, shape (N,), optional
        Rotation of the body at the samples, continuous and without jumps by whole turns; with free crank angles whole turns do
        not count. In angles written within 0 to 360 or -180 to 180, such as 350, 10, a jump that is less than a quarter turn
        in the other direction is taken as that smaller turn. None: missing at this sample.
    position : array_like, shape (N, 2), or complex, shape (N,), optional
        Positions [x, y] of a point of the body at the samples, in any unit. Rotation, position or both are required, at 3 to
        1,024 samples (at least 2 with free crank angles). None: missing at this sample.
    crank_span : float, optional
        Crank angle from the first sample to the last, evenly spaced; negative: clockwise.
    crank_angle : array_like, shape (N,), optional
        Crank angles in place of ``crank_span``; only the increments from the first angle count.
    timing : {"free"}, optional
        "free": the crank angles are unknown, and each solution has its own; leave out ``crank_span`` and ``crank_angle``. This is
        the default if ``position`` or ``points`` is given, but neither crank angles nor a travel are.
    order : {"given", "any"}
        With free crank angles: "given" if the crank passes the samples in their order, in either direction of rotation; "any" if
        their order does not matter.
    closed : bool
        With free crank angles: True if the motion continues from the last sample to the first.
    travel : array_like, shape (N,), optional
        For linkages with sliders, in place of crank angles: travel of the slider, or extension of the cylinder, at each sample;
        only the increments from the first value count. A cylinder with positive travel extends.
    travel_span : float, optional
        Travel from the first sample to the last, evenly spaced; negative: a cylinder retracts.
    start_angle : float, optional
        Crank angle at the first sample from the ground line A->B, counter-clockwise, for example of a motor with a given rest
        position; the crank angles are then absolute. Only for four-bars with given crank angles. Default: the best angle.
    points : array_like, shape (N, 4), optional
        In place of ``rotation`` and ``position``: two points [x1, y1, x2, y2] of the body at the samples. The first point is the
        body point, and the rotation is the direction to the second. Their distance may vary by 0.5 %.
    crank_span_max : float, optional
        With free crank angles: largest crank angle from the first sample to the last.
    weights : mapping, optional
        Weights ``rotation`` and ``position`` of at least 0 for the samples, (N,) each. Default: equal weights.
    tolerances : mapping, optional
        Largest allowed errors ``rotation`` and ``position``, a number or (N,) each. The status is then "reached" if the errors of
        all samples are within them, and such solutions come first.
    length_scale : float, optional
        Length that weighs position errors against rotation errors in radians. Default: the largest distance from the mean
        position.
    degrees : bool
        Unit of every angle, in and out: degrees, or radians if it is False.
    length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
        Unit of the positions, for solutions and their files. Default: unknown; files are in millimetres.

    Raises
    ------
    FieldError
        If an argument is wrong; the error names it and the sample.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> la.Motion([0, 12, 27, 45], crank_span=60).free
    False
    """

    samples: Target | Poses
    """The motion in radians: a `Target` with crank angles, or `Poses` with free crank angles."""
    degrees: bool
    tolerances: Tolerances | None = None
    travel: Floats | None = None
    """(N,): travel of a slider or cylinder from the first sample, if it is given."""
    length_unit: str | None = None
    """Unit of the positions; None if it is unknown."""
    _wraps: Sequence[str] = ()
    _table_notes: Sequence[str] = ()

    def __init__(
        self,
        rotation: ArrayLike | None = None,
        position: ArrayLike | None = None,
        crank_span: float | None = None,
        *,
        crank_angle: ArrayLike | None = None,
        timing: str | None = None,
        order: str = "given",
        closed: bool = False,
        travel: ArrayLike | None = None,
        travel_span: float | None = None,
        start_angle: float | None = None,
        points: ArrayLike | None = None,
        crank_span_max: float | None = None,
        weights: Mapping[str, ArrayLike] | None = None,
        tolerances: Mapping[str, ArrayLike] | None = None,
        length_scale: float | None = None,
        degrees: bool = True,
        length_unit: str | None = None,
    ) -> None:
        self.degrees, radian = degrees, radians_in(degrees)
        self.length_unit = read_length_unit(length_unit)
        if points is not None:
            if rotation is not None or position is not None:
                raise FieldError("/points", "give either `points`, or `rotation` and `position`")
            rotation, position, self._table_notes = poses_of_points(points, degrees)
        weights = dict(weights or {})
        if unknown := weights.keys() - {"rotation", "position"}:
            raise FieldError(f"/weights/{min(unknown)}", "must be removed: only rotation and position have weights")
        is_timed = any(value is not None for value in (crank_span, crank_angle, travel, travel_span))
        if timing is None and position is not None and not is_timed:
            timing = "free"
        untimed = timing is not None or travel is not None or travel_span is not None  # whole turns do not count
        with np.errstate(over="ignore"):
            wound, self._wraps = (rotation, []) if untimed else unwound("rotation", rotation, degrees)
            crank_angle, said = unwound("crank angle", crank_angle, degrees)
            self._wraps = [*self._wraps, *said]
            turns, turn_weights = _present("rotation", wound, weights, 0.0, partial(column, "rotation"))
            points_read, point_weights = _present("position", position, weights, (0.0, 0.0), _points)
            part: dict[str, Any] = {
                "rotation": None if turns is None else turns * radian,
                "position": points_read,
                "length_scale": None if length_scale is None else number("length_scale", length_scale),
                "rotation_weights": turn_weights,
                "position_weights": point_weights,
            }
            span = None if crank_span is None else number("crank_span", crank_span) * radian
            angles = None if crank_angle is None else column("crank_angle", crank_angle) * radian
            if travel is not None or travel_span is not None:
                _check_travel(timing, span is not None or angles is not None)
                _check_given("travel is", order, closed, crank_span_max)
                self.samples = make_poses(**part)
                self.travel = _travel(travel, travel_span, self.samples)
            elif timing is None:
                _check_given("crank angles are", order, closed, crank_span_max)
                if not is_timed and turns is not None:
                    raise FieldError("/crank_span", HOW_TURNED + OR_PLACED)
                target = make_target(**part, crank_span=span, crank_angle=angles)
                start = None if start_angle is None else number("start_angle", start_angle) * radian
                self.samples = replace(target, start=start)
            else:
                _check_free(timing, order, span is not None, angles is not None)
                span_max = None if crank_span_max is None else number("crank_span_max", crank_span_max) * radian
                self.samples = make_poses(**part, ordered=order == "given", closed=closed, span_max=span_max)
        if start_angle is not None and not isinstance(self.samples, Target):
            raise FieldError(
                "/start_angle", "applies only to given crank angles; with free timing or travel it is a result"
            )
        self.tolerances = _tolerances(tolerances, self.requested, radian)

    def __repr__(self) -> str:
        samples = self.requested
        parts = " and ".join(name for name in ("rotation", "position") if getattr(samples, name) is not None)
        timing = "given travel" if self.travel is not None else f"{'free' if self.free else 'given'} crank angles"
        return f"Motion({samples.samples} samples of {parts}, {timing})"

    @classmethod
    def of(
        cls,
        samples: Target | Poses,
        degrees: bool,
        tolerances: Tolerances | None = None,
        length_unit: str | None = None,
    ) -> Motion:
        """Return a motion of samples that are checked and in radians."""
        motion = object.__new__(cls)
        motion.samples, motion.degrees, motion.tolerances = samples, degrees, tolerances
        motion.length_unit = length_unit
        return motion

    @classmethod
    def from_table(
        cls,
        table: str | Path | IO[str] | IO[bytes] | DataFrame,
        unwrap: bool = False,
        columns: Mapping[str, str] | None = None,
        **arguments: object,
    ) -> Motion:
        r"""Read the motion in a table of samples: CSV, cells pasted from a spreadsheet, or a pandas table.

        Parameters
        ----------
        table : str, Path, file object or pandas.DataFrame
            Path of a file, an open file or buffer of text or bytes, or a table whose columns are named as in a file.
        unwrap : bool
            Move each angle by whole turns to within half a turn of the angle before: 350, 10, 30 becomes 350, 370, 390.
        columns : mapping, optional
            Head of the column to read for each field, ``{"x": "TX", "y": "TY", "angle": "RZ"}``; see
            `linkage_atlas.tables.read_table`. Default: columns are recognised by their heads.
        **arguments
            Further arguments of `Motion`, which take precedence over the table. Angles and lengths are converted to the units
            of these: ``degrees`` (True) and ``length_unit`` (that of the table). Without crank angles the timing is free.

        Raises
        ------
        FieldError
            If the table cannot be read; the error names the line.

        Examples
        --------
        >>> import io, linkage_atlas as la
        >>> motion = la.Motion.from_table(io.StringIO("x [mm],y [mm],phi\n0,0,0\n40,8,15\n75,30,40"))
        >>> motion, motion.length_unit
        (Motion(3 samples of rotation and position, free crank angles), 'mm')
        """
        unit = {"angle_unit": "deg" if arguments.get("degrees", True) else "rad"}
        length_unit = read_length_unit(arguments.pop("length_unit", None))
        read = read_table(_text_of(table), POSES, arguments | unit, unwrap, columns, length_unit)
        fields = {name: value for name, value in read.fields.items() if name != "angle_unit"}
        motion = build(cls, {**fields, "length_unit": read.length_unit})
        motion._table_notes = [read.note]
        return motion

    def __len__(self) -> int:
        return self.requested.samples

    @property
    def rotation(self) -> Floats | None:
        """Requested rotation at the samples, shape (N,), NaN if it is missing there; None if no rotation is requested."""
        return None if self.requested.rotation is None else self.requested.rotation / self.radian

    @property
    def position(self) -> Floats | None:
        """Requested positions at the samples, shape (N, 2), NaN if missing there; None if no position is requested."""
        return None if self.requested.position is None else plane(self.requested.position)

    def plot(self, ax: Axes | None = None, arrow: float | None = None) -> Axes:
        """Draw the requested poses with matplotlib (extra ``plot``); a motion without positions as rotation over the sample.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; default: the current axes.
        arrow : float, optional
            Length of the arrows along the x axis of the body; default: a tenth of the extent of the positions.

        Returns
        -------
        matplotlib.axes.Axes
        """
        if self.position is None:
            angle = "rotation (degrees)" if self.degrees else "rotation (radians)"
            return plot_curves(np.arange(len(self)), {"requested": np.asarray(self.rotation)}, ax, "sample", angle)
        return plot_poses(self.position, self.requested.rotation, ax, arrow)

    @property
    def free(self) -> bool:
        """True if the crank angles are unknown."""
        return isinstance(self.samples, Poses)

    @property
    def target(self) -> Target:
        """The motion with its crank angles; FieldError if they are free."""
        if isinstance(self.samples, Target):
            return self.samples
        raise FieldError("/timing", "the crank angles are free, so that only a solution has crank angles")

    def over(self, linkage: Linkage, travel: Floats) -> Motion:
        """Return the motion over travel (N,) of the drive of a linkage; unchanged if its crank angles are given."""
        if isinstance(self.samples, Target):
            return self
        target = target_of(self.samples, linkage, travel)
        return Motion.of(target, self.degrees, self.tolerances, self.length_unit)

    @property
    def radian(self) -> float:
        """Radians in a unit of angle."""
        return radians_in(self.degrees)

    @property
    def requested(self) -> Samples:
        """The samples of the request."""
        samples = self.samples
        return samples.requested if isinstance(samples, Poses) and samples.requested is not None else samples

    def notes(self) -> list[str]:
        """Return remarks for the user: reading of a table, units, wrapped rotation, and a hinge or guide that suffices."""
        on_reading = [*self._table_notes, *self._wraps]
        return [*on_reading, *self._unit_notes(), *self._jump_notes(), *self._simpler_machine_notes()]

    def _unit_notes(self) -> list[str]:
        notes: list[str] = []
        if isinstance(self.samples, Target):
            notes = unit_notes("crank", self.samples.crank[[0, -1]] / self.radian, self.degrees)
        if self.requested.rotation is None:
            return notes
        weights = self.requested.rotation_weights
        angles = self.requested.rotation if weights is None else self.requested.rotation[weights > 0]
        return notes + unit_notes("rotation", angles / self.radian, self.degrees)

    def _simpler_machine_notes(self) -> list[str]:
        """Return a note if the body only turns about a fixed point, or only shifts along a line."""
        tolerances = None if self.tolerances is None else self.tolerances.position
        allowed = None if tolerances is None else float(np.min(tolerances))
        samples = self.requested
        shift_error = straight_guide_error(samples, allowed)
        if shift_error is not None:
            off = f"to within {max(shift_error, 1e-9 * samples.extent):.2g}"
            return [
                f"the body only shifts along a straight line, {off}: use a straight guide, which needs no linkage"
            ]
        found = hinge_of(samples, allowed)
        if found is None:
            return []
        # rounding of the positions is no part of a coordinate
        size = max(abs(found.centre), found.radius, samples.extent)
        digits = 7 - math.ceil(math.log10(size))
        x, y = (round(value, digits) + 0.0 for value in (found.centre.real, found.centre.imag))
        centre, off = f"({x:.9g}, {y:.9g})", f"to within {max(found.error, 1e-9 * size):.2g}"
        if samples.rotation is None:
            return [
                f"the positions lie on a circle about the point {centre}, {off}: use a hinge there with a link of length "
                f"{found.radius:.6g}, which needs no linkage"
            ]
        return [f"the body only turns about the point {centre}, {off}: use a hinge there, which needs no linkage"]

    def _jump_notes(self) -> list[str]:
        if self.free or self.samples.rotation is None:
            return []
        jump = np.abs(np.diff(self.samples.rotation))
        if jump.max() <= np.pi:
            return []
        index = int(np.argmax(jump))
        return [
            f"rotation jumps by more than half a turn from sample {index + 1} to {index + 2}; it is taken as continuous, "
            "so if that is a wrap at 180 or 360 degrees, write it without: 350, 10, 30 as 350, 370, 390"
        ]


def _text_of(table: str | Path | IO[str] | IO[bytes] | DataFrame) -> str:
    """Return the text of a table in a file, in a buffer or of pandas."""
    if isinstance(table, str | Path):
        return decoded(Path(table).read_bytes())
    content: str | bytes = table.to_csv(index=False) if hasattr(table, "to_csv") else table.read()
    return decoded(content) if isinstance(content, bytes) else content


def unit_notes(what: str, values: Floats, degrees: bool) -> list[str]:
    """Ask whether angles are in the other unit, if their values suggest it."""
    span = float(np.ptp(values)) if values.size else 0.0
    if not degrees and span > _TURNS * TURN:
        return [
            f"the {what} goes through {span / TURN:.3g} turns: is it in degrees? It was taken in radians (see `angle_unit`)"
        ]
    if degrees and looks_like_radians(values):
        return [
            f"the {what} goes through {span:.3g} degrees only: is it in radians? It was taken in degrees (see `angle_unit`)"
        ]
    return []


def looks_like_radians(values: ArrayLike) -> bool:
    """Return whether angles are likely to be in radians: within a turn, over more than a little, not in tenths."""
    angles = np.array(
        [value for value in np.atleast_1d(np.asarray(values, dtype=object)) if value is not None], dtype=float
    )
    if angles.size < 2 or not np.abs(angles).max() <= TURN + 1e-9:
        return False
    return bool(np.ptp(angles) >= _RADIANS and np.any(np.abs(10 * angles - np.round(10 * angles)) > 1e-6))


def _present(
    name: str, values: object, weights: Mapping[str, ArrayLike], blank: object, read: Callable[[object], NDArray[N]]
) -> tuple[NDArray[N] | None, Floats | None]:
    """Return a column as numbers and its weights.

    An entry None gets the weight 0 and a value between its neighbours, which nothing reads. ``blank`` is a value of the right
    form, which is read in its place.
    """
    own = weights.get(name)
    sample_weights = None if own is None else column(f"weights/{name}", own)
    if values is None:
        return None, sample_weights
    entries = sequence(values) if not isinstance(values, np.ndarray) or values.dtype == object else ()
    missing = np.array([entry is None for entry in entries], dtype=bool)
    if not missing.any():
        return read(values), sample_weights
    numbers = read([blank if entry is None else entry for entry in entries])
    if missing.all():
        raise FieldError(f"/{name}", "must have at least one entry that is not null")
    if sample_weights is None or sample_weights.shape == numbers.shape:
        sample_weights = np.where(missing, 0.0, 1.0 if sample_weights is None else sample_weights)
    index = np.arange(numbers.size)
    filled: NDArray[N] = np.interp(index, index[~missing], numbers[~missing])
    return filled, sample_weights


def unwound(name: str, angles: ArrayLike | None, degrees: bool) -> tuple[ArrayLike | None, list[str]]:
    """Return continuous angles for angles written within a turn, such as 340, 350, 360 for 340, 350, 0, and notes on changes.

    Angles change only if all of them lie within 0 to 360 or -180 to 180 degrees, and a jump between samples is less than a
    quarter turn in the other direction. Law: small steps that are wrapped and unwound are the same again.
    """
    turn = 360.0 if degrees else TURN
    try:
        values: Floats = np.array([np.nan if angle is None else angle for angle in sequence(angles)], dtype=float)
    except (TypeError, ValueError):  # a later check names the wrong angle
        return angles, []
    if values.ndim != 1:
        return angles, []
    indices = np.flatnonzero(~np.isnan(values))
    own = values[indices]
    low, high = own.min(initial=np.inf), own.max(initial=-np.inf)
    within = any(-start <= low and high <= turn - start for start in (0.0, turn / 2))
    jumps = np.diff(own)
    if not within or not np.any(np.abs(jumps) > _WRAPPED * turn):
        return angles, []
    back = np.where(np.abs(jumps) > _WRAPPED * turn, np.sign(jumps), 0.0)
    values[indices[1:]] -= turn * np.cumsum(back)
    k = int(np.argmax(back != 0))
    unit, step = ("degrees" if degrees else "radians"), jumps[k] - turn * back[k]
    note = (
        f"the {name} from sample {indices[k] + 1} ({own[k]:.6g}) to {indices[k + 1] + 1} ({own[k + 1]:.6g}) is taken as a turn "
        f"of {step:.4g} {unit}, the short way; for {jumps[k]:.4g} write it beyond {turn:.6g}"
    )
    if np.isnan(values).any():
        return np.array([None if np.isnan(value) else value for value in values.tolist()], dtype=object), [note]
    return values, [note]


def _tolerances(tolerances: Mapping[str, ArrayLike] | None, samples: Samples, radian: float) -> Tolerances | None:
    named = {name: value for name, value in (tolerances or {}).items() if value is not None}
    found = {}
    for name, value in named.items():
        if name not in ("rotation", "position"):
            raise FieldError(f"/tolerances/{name}", "must be removed: only rotation and position have tolerances")
        if getattr(samples, name) is None:
            raise FieldError(f"/tolerances/{name}", f"limits errors of `{name}`, but the request has no `{name}`")
        numbers = column(f"tolerances/{name}", value)
        if numbers.ndim and numbers.shape != (samples.samples,):
            raise FieldError(
                f"/tolerances/{name}",
                f"must be a number, or a list of {samples.samples} numbers; it has {numbers.size}",
            )
        if np.any(bad := ~(np.isfinite(numbers) & (numbers > 0))):
            index = f"/{int(np.argmax(bad))}" if numbers.ndim else ""
            raise FieldError(f"/tolerances/{name}{index}", "must be a number above 0")
        found[name] = np.broadcast_to(numbers, samples.samples) * (radian if name == "rotation" else 1.0)
    return Tolerances(found.get("rotation"), found.get("position")) if found else None


def _check_free(timing: str, order: str, span: bool, angles: bool) -> None:
    """Raise FieldError for arguments that free crank angles exclude."""
    if timing != "free":
        raise FieldError("/timing", f"must be 'free', or be left out; it is {timing!r}")
    if span or angles:
        field = "crank_angle" if angles else "crank_span"
        raise FieldError(f"/{field}", "give either this or `timing`: with free timing the crank angles are unknown")
    if order not in ("given", "any"):
        raise FieldError("/order", f"must be 'given' or 'any'; it is {order!r}")


def _check_travel(timing: str | None, turned: bool) -> None:
    """Raise FieldError for arguments that travel excludes."""
    if timing is not None:
        raise FieldError("/timing", "give either this or `travel`: with given travel the timing is not free")
    if turned:
        raise FieldError("/travel", "a motion is driven by crank angles or by travel, not by both")


def _travel(travel: ArrayLike | None, span: float | None, samples: Poses) -> Floats:
    """Return the checked travel (N,) from the first sample."""
    if travel is None:
        end = number("travel_span", span)
        if not MIN_LENGTH <= abs(end) <= MAX_LENGTH:
            raise FieldError("/travel_span", f"must be a length from {MIN_LENGTH:g} to {MAX_LENGTH:g} in size")
        even: Floats = np.linspace(0.0, end, samples.samples)
        return even
    if span is not None:
        raise FieldError("/travel_span", "give either this or `travel`")
    found: Floats = column("travel", travel)
    if found.shape != (samples.samples,):
        raise FieldError("/travel", f"must have {samples.samples} numbers; it has {found.size}")
    if not np.all(np.abs(found) <= MAX_LENGTH):
        raise FieldError("/travel", f"must be finite numbers of at most {MAX_LENGTH:g} in size")
    steps = np.diff(found)
    if not (np.all(steps > 0) or np.all(steps < 0)):
        wrong = int(np.argmax(steps * np.sign(found[-1] - found[0]) <= 0)) + 1
        raise FieldError(f"/travel/{wrong}", "travel rises or falls from sample to sample")
    return found - found[0]


def _check_given(what: str, order: str, closed: bool, crank_span_max: float | None) -> None:
    """Raise FieldError for arguments that need free crank angles."""
    needing = {"order": order != "given", "closed": closed, "crank_span_max": crank_span_max is not None}
    for name, is_set in needing.items():
        if is_set:
            raise FieldError(f"/{name}", f"needs `timing` 'free': here the {what} given")


def _points(position: object) -> Complexes:
    points = np.asarray(position)
    if not np.iscomplexobj(points):
        points = column("position", position)
        if points.ndim != 2 or points.shape[1] != 2:
            raise FieldError("/position", f"must have the shape (N, 2); it has {points.shape}")
        # not x + 1j y: with an infinite y that would make x a NaN
        points = np.ascontiguousarray(points).view(complex)[:, 0]
    return points
