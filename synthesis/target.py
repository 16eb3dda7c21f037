"""The requested motion: crank angles, and the rotation or the position of a body, or both, at each of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.errors import FieldError

TURN = 2 * np.pi
MIN_SAMPLES = 3
"""Smallest number of samples of a motion."""
MAX_SAMPLES = 1024
"""Largest number of samples of a motion."""
MIN_SPAN = np.deg2rad(0.1)
"""Smallest crank span (rad), below which double precision cannot distinguish a curve from a straight line."""
MAX_SPAN = np.deg2rad(3600.0)
"""Largest crank span (rad)."""
MIN_STEP = 1e-9
"""Smallest step of the crank between samples, as a fraction of the span."""
MAX_ROTATION = 1e6
"""Largest rotation (rad), above which double precision has fewer than ten decimal places."""
MIN_LENGTH = 1e-50
"""Smallest length, so that squares and quotients of squares do not underflow."""
MAX_LENGTH = 1e50
"""Largest length or coordinate, so that squares and quotients of squares do not overflow."""
CURVE_STEP = np.deg2rad(1.0)
"""Largest step of a curve over an interval, rad."""
CURVE_MIN_STEPS = 24
"""Smallest number of steps of a curve over an interval."""


class Interval(NamedTuple):
    """Interval between two crank angles (rad) in either order; arrays hold several intervals."""

    first: Any
    last: Any

    def after(self, start: Any) -> Interval:
        """Return the interval shifted by ``start`` (rad)."""
        return Interval(start + self.first, start + self.last)

    def by_degrees(self) -> Floats:
        """Return angles from end to end in at least `CURVE_MIN_STEPS` even steps of at most `CURVE_STEP`."""
        steps = max(CURVE_MIN_STEPS, int(np.ceil(abs(self.last - self.first) / CURVE_STEP * (1 - 1e-12))))
        return np.linspace(self.first, self.last, steps + 1)


class Mean:
    """The mean over the samples of a motion, weighted if the request has weights.

    Parameters
    ----------
    samples : int
        Number of samples N.
    weights : ndarray, shape (N,), optional
        Weights of at least 0, not all 0; a sample of weight 0 is missing. Without them all samples have equal weight.
    """

    def __init__(self, samples: int, weights: Floats | None = None) -> None:
        self.samples = samples
        self.weights = None if weights is None else weights / weights.sum()
        self.total: float = samples if self.weights is None else 1.0
        # Square root of the weight of each sample in the mean: the squares of rows times this sum up to a mean square.
        self.root: Any = 1 / np.sqrt(samples) if self.weights is None else np.sqrt(self.weights)

    def __call__(self, values: NDArray[Any]) -> Any:
        """Return the mean over the last axis."""
        return values.mean(axis=-1) if self.weights is None else values @ self.weights

    def weighted(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return weighted values (..., N), whose sum divided by ``total`` is the mean."""
        return values if self.weights is None else values * self.weights

    def product(self, values: NDArray[Any], column: NDArray[Any]) -> Any:
        """Return the mean of the products of rows (..., N) and a column (N,)."""
        return values @ self.weighted(column) / self.total

    def spread(self, values: NDArray[Any]) -> Any:
        """Return the root mean square deviation of values from their mean, over the last axis."""
        deviations = values - np.expand_dims(self(values), -1)
        return np.sqrt(self(np.abs(deviations) ** 2))

    def reach(self, values: NDArray[Any]) -> float:
        """Return the largest distance from the mean of the samples (N,) that are not missing."""
        return float(np.max(self.zero_missing(np.abs(values - self(values)))))

    def zero_missing(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values (..., N) with zeros for missing samples."""
        return values if self.weights is None else np.where(self.weights > 0, values, 0.0)


@dataclass(frozen=True)
class Samples:
    """Requested rotation and position of a body at the samples of a motion."""

    rotation: Floats | None
    """Rotation of the body (rad), shape (N,)."""
    position: Complexes | None
    """Position x + i y of a point of the body, in the user's unit of length, shape (N,)."""
    length_scale: float = 1.0
    """Length l of the objective; 1 without positions."""
    rotation_weights: Floats | None = None
    """Weight of each rotation, 0 for a missing sample, shape (N,); None for equal weights."""
    position_weights: Floats | None = None
    """Weight of each position, 0 for a missing sample, shape (N,); None for equal weights."""

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return (self.rotation if self.position is None else self.position).shape[-1]  # type: ignore[union-attr]

    @cached_property
    def rotation_mean(self) -> Mean:
        """Mean over the samples that is used for rotations."""
        return Mean(self.samples, self.rotation_weights)

    @cached_property
    def position_mean(self) -> Mean:
        """Mean over the samples that is used for positions."""
        return Mean(self.samples, self.position_weights)

    @cached_property
    def extent(self) -> float:
        """Largest distance of a position from the mean position."""
        assert self.position is not None
        return self.position_mean.reach(self.position)

    @cached_property
    def middle(self) -> complex:
        """Mean position; 0 without positions."""
        return 0j if self.position is None else complex(self.position_mean(self.position))

    def spread(self, max_samples: int) -> NDArray[np.intp]:
        """Return the indices of about ``max_samples`` samples, including both ends.

        They are spread evenly over the rotations and over the positions that are not missing.
        """
        chosen = [np.array([0, self.samples - 1])]
        for values, weights in self._parts().values():
            if values is not None:
                present = np.arange(self.samples) if weights is None else np.flatnonzero(weights)
                evenly = np.linspace(0, present.size - 1, min(max_samples, present.size))
                chosen.append(present[np.round(evenly).astype(int)])
        return np.unique(np.concatenate(chosen))

    def _parts(self) -> dict[str, tuple[NDArray[Any] | None, Floats | None]]:
        return {
            "rotation": (self.rotation, self.rotation_weights),
            "position": (self.position, self.position_weights),
        }

    def off(self, subset: Samples) -> complex:
        """Return the mean position of a subset of the samples, relative to the mean of all, over the length scale."""
        return (subset.middle - self.middle) / self.length_scale

    def error_at_rest(self, modulo_turn: bool) -> float:
        """Return the objective of a body at rest in its best pose.

        ``modulo_turn``: whether rotations count modulo a turn, as they do if the crank angles are free; each then counts within
        half a turn of their mean direction.
        """
        moved = 0.0 if self.position is None else self.position_mean.spread(self.position / self.length_scale)
        if self.rotation is None:
            return float(moved)
        turned = self.rotation
        if modulo_turn and (middle := self.rotation_mean(np.exp(1j * turned))):
            turned = np.angle(np.exp(1j * turned) / middle)
        return float(np.hypot(moved, self.rotation_mean.spread(turned)))

    @cached_property
    def scaled(self) -> Complexes:
        """Positions relative to their mean, over the length scale, shape (N,); zeros for missing positions."""
        if self.position is None:
            return np.zeros(self.samples, dtype=complex)
        return self.position_mean.zero_missing((self.position - self.middle) / self.length_scale)


class RequestedMotion(NamedTuple):
    """A motion as it was requested."""

    rotation: Floats | None
    """Requested rotation (rad), NaN for a missing sample, shape (N,)."""
    position: Complexes | None
    """Requested position, NaN for a missing sample, shape (N,)."""
    moved: Floats
    """Whole turns (rad) that were added to each requested rotation, shape (N,)."""


@dataclass(frozen=True, kw_only=True)
class Target(Samples):
    """A requested motion: samples, each with its crank angle.

    The rotations are continuous: no whole turns are added to or removed from the given values.
    """

    crank: Floats
    """Crank angle relative to the first sample (rad), shape (N,). It increases strictly, or decreases strictly for a
    clockwise crank. If the crank angles were found and not given, the crank may pass the samples in another order."""
    start: float | None = None
    """Crank angle theta1 at the first sample (rad), if it is prescribed."""
    offset: float | None = None
    """Angle that is added to theta2 to give the rotation (rad, up to whole turns), if it is prescribed."""
    found: bool = False
    """True if the crank angles were found together with a linkage.
    Then ``crank`` and ``rotation`` may have a leading axis over the linkages."""
    closed: bool = False
    """True if the crank continues from the last sample to the first, so that the motion uses a whole turn."""
    moved: Any = 0.0
    """Whole turns (rad) by which each rotation differs from the requested value."""

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return self.crank.shape[-1]

    @property
    def requested(self) -> RequestedMotion:
        """The motion as it was requested."""
        rotation, position = self.rotation, self.position
        moved = np.broadcast_to(np.asarray(self.moved, dtype=float), (self.samples,))
        if rotation is not None:
            present = (
                np.ones(self.samples, dtype=bool) if self.rotation_weights is None else self.rotation_weights > 0
            )
            # A missing sample takes the turns of the previous sample that is present, or else of the first.
            previous = np.maximum.accumulate(np.where(present, np.arange(self.samples), 0))
            moved = moved[np.maximum(previous, int(np.argmax(present)))]
            rotation = np.where(present, rotation - moved, np.nan)
        if position is not None and self.position_weights is not None:
            position = np.where(self.position_weights > 0, position, complex(np.nan, np.nan))
        return RequestedMotion(rotation, position, moved)

    @property
    def interval(self) -> Interval:
        """Crank angles that the motion uses.

        The interval begins at the first sample, or at the smallest angle if the first sample is at neither end.
        """
        if not self.found:
            return Interval(0.0, float(self.crank[-1]))
        low, high = self.crank.min(axis=-1), self.crank.max(axis=-1)
        decreasing = self.crank[..., 0] >= high
        first = np.where(decreasing, high, low)[()]
        if self.closed:
            return Interval(first, first + np.where(decreasing, -TURN, TURN))
        return Interval(first, np.where(decreasing, low, high)[()])

    @property
    def way(self) -> Floats:
        """Crank angles of the samples, followed by the first sample one turn later if the motion is closed, shape (n,)."""
        return np.append(self.crank, self.interval.last) if self.closed else self.crank

    def one_of(self, index: int) -> Target:
        """Return the target of a single linkage, if each linkage has its own crank angles."""
        if not self.found or self.crank.ndim == 1:
            return self
        if self.rotation is None:
            return replace(self, crank=self.crank[index])
        return replace(self, crank=self.crank[index], rotation=self.rotation[index], moved=self.moved[index])

    @cached_property
    def repeats_one_crank_angle(self) -> bool:
        """True if all rotations that are not missing are requested at the same crank angle, up to whole turns."""
        return _whole_turns(self.rotation_mean, self.crank)

    @property
    def clockwise(self) -> bool:
        """True if the crank turns clockwise."""
        return bool(self.crank[-1] < 0)

    def mirrored(self) -> Target:
        """Return the target reflected in the x axis, in which crank and body turn in the opposite sense."""
        return replace(
            self,
            crank=-self.crank,
            start=None if self.start is None else -self.start,
            offset=None if self.offset is None else -self.offset,
            moved=-self.moved,
            rotation=None if self.rotation is None else -self.rotation,
            position=None if self.position is None else np.conj(self.position),
        )

    def thinned(self, max_samples: int) -> Target:
        """Return the target with about ``max_samples`` samples, each with its own weight."""
        if self.samples <= max_samples:
            return self
        chosen = self.spread(max_samples)
        columns: dict[str, Any] = {name: getattr(self, name) for name in _COLUMNS}
        columns = {name: None if values is None else values[chosen] for name, values in columns.items()}
        return replace(self, **columns)

    def condensed(self, max_samples: int) -> Target:
        """Return the target with about ``max_samples`` samples.

        The weight of each omitted sample is added to the nearest sample that remains.
        """
        if self.samples <= max_samples:
            return self
        chosen = self.spread(max_samples)
        columns: dict[str, Any] = {"crank": self.crank[chosen]}
        for name, (values, weights) in self._parts().items():
            if values is None:
                continue
            own_weights = np.ones(self.samples) if weights is None else weights
            present = np.flatnonzero(own_weights)
            remaining = np.flatnonzero(own_weights[chosen])
            nearest = remaining[np.abs(present[:, None] - chosen[remaining]).argmin(axis=1)]
            columns[name] = values[chosen]
            columns[f"{name}_weights"] = np.bincount(nearest, weights=own_weights[present], minlength=chosen.size)
        return replace(self, **columns)


def _whole_turns(mean: Mean, crank: Floats) -> bool:
    """Check whether the crank angles of the samples that are not missing differ only by whole turns, to rounding."""
    turns = crank if mean.weights is None else crank[mean.weights > 0]
    turns = (turns - turns[0]) / TURN
    return bool(np.all(np.abs(turns - np.round(turns)) <= 8 * np.finfo(float).eps * np.abs(crank).max()))


_COLUMNS = ("crank", "rotation", "position", "rotation_weights", "position_weights")


def make_target(
    rotation: Floats | None = None,
    position: NDArray[np.complex128] | None = None,
    crank_span: float | None = None,
    crank_angle: Floats | None = None,
    length_scale: float | None = None,
    rotation_weights: Floats | None = None,
    position_weights: Floats | None = None,
    min_samples: int = MIN_SAMPLES,
) -> Target:
    """Check the values of a request and build its `Target`.

    Parameters
    ----------
    rotation : ndarray, shape (N,), optional
        Rotation of the body (rad), for 3 to 1024 samples. Rotation, position or both are required.
    position : ndarray of complex, shape (N,), optional
        Position x + i y of a point of the body, in the user's unit of length.
    crank_span : float, optional
        Crank rotation from the first to the last sample (rad), for evenly spaced crank angles.
        Negative for a clockwise crank.
    crank_angle : ndarray, shape (N,), optional
        Crank angles (rad), instead of ``crank_span``; only the increments from the first sample are used.
    length_scale : float, optional
        Length l of the objective; by default the largest distance of a position from the mean position.
    rotation_weights, position_weights : ndarray, shape (N,), optional
        Weights of at least 0, not all 0; a sample of weight 0 is missing, regardless of its value.
        By default all samples have equal weight.
    min_samples : int
        Minimum number of samples.

    Returns
    -------
    Target
        The requested motion.

    Raises
    ------
    FieldError
        A value is missing or not allowed; the error names the field and the sample.
    """
    fields, columns = read_samples(
        rotation, position, length_scale, rotation_weights, position_weights, min_samples, crank_angle=crank_angle
    )
    samples = next(iter(columns.values())).size
    target = Target(**fields, crank=_crank(crank_span, columns.get("crank_angle"), samples))
    if target.position is not None and _whole_turns(target.position_mean, target.crank):
        field = "/crank_span" if crank_angle is None else "/crank_angle"
        raise FieldError(
            field, "all positions have the same crank angle, up to whole turns; give different crank angles"
        )
    return target


def read_samples(
    rotation: Floats | None,
    position: NDArray[np.complex128] | None,
    length_scale: float | None,
    rotation_weights: Floats | None,
    position_weights: Floats | None,
    min_samples: int = MIN_SAMPLES,
    **further_columns: Floats | None,
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Check the samples of a request.

    Parameters
    ----------
    rotation, position, length_scale, rotation_weights, position_weights
        Values of the request, see `make_target`.
    min_samples : int, optional
        Smallest number of samples.
    **further_columns : ndarray, shape (N,), optional
        Further columns with a value for each sample.

    Returns
    -------
    fields : dict
        Fields of `Samples`.
    columns : dict
        All given columns, by name, including the further columns.

    Raises
    ------
    FieldError
        A value is missing or not allowed; the error names the field and the sample.
    """
    optional_columns = {"rotation": rotation, "position": position, **further_columns}
    if position is not None:
        optional_columns["position"] = np.asarray(position, dtype=complex)
    columns: dict[str, NDArray[Any]] = {
        name: np.asarray(values) for name, values in optional_columns.items() if values is not None
    }
    if rotation is None and position is None:
        raise FieldError("", "give `rotation`, `position` or both")
    _check_columns(columns, min_samples)
    if rotation is not None and np.any(too_large := np.abs(columns["rotation"]) > MAX_ROTATION):
        index = int(np.argmax(too_large))
        raise FieldError(f"/rotation/{index}", f"give a rotation of at most {MAX_ROTATION:g} radians in either sense")
    weights = {
        f"{name}_weights": _weights(name, columns, values)
        for name, values in (("rotation", rotation_weights), ("position", position_weights))
    }
    scale = 1.0
    if position is not None:
        mean = Mean(columns["position"].size, weights["position_weights"])
        scale = _length_scale(columns["position"], mean, length_scale)
    elif length_scale is not None:
        raise FieldError(
            "/length_scale", "the length scale applies to positions, but the request has none; leave it out"
        )
    fields = {
        "rotation": columns["rotation"].astype(float) if rotation is not None else None,
        "position": columns["position"].astype(complex) if position is not None else None,
        "length_scale": scale,
        **weights,
    }
    return fields, columns


def _check_columns(columns: dict[str, NDArray[Any]], min_samples: int) -> None:
    """Check that all columns are finite and have the same allowed number of samples."""
    for name, values in columns.items():
        if values.ndim != 1 or not min_samples <= values.size <= MAX_SAMPLES:
            raise FieldError(f"/{name}", f"give {min_samples} to {MAX_SAMPLES} samples, not {values.size}")
        if not np.all(np.isfinite(values)):
            raise FieldError(f"/{name}/{int(np.argmin(np.isfinite(values)))}", "give a finite number")
    sizes = {name: values.size for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        counts = ", ".join(f"{name} has {size}" for name, size in sizes.items())
        raise FieldError(f"/{list(sizes)[-1]}", f"give the same number of samples in every column; {counts}")


def _weights(name: str, columns: dict[str, Any], weights: Floats | None) -> Floats | None:
    """Check the weights of a column; return None if they are all equal."""
    if weights is None:
        return None
    if name not in columns:
        raise FieldError(f"/weights/{name}", f"the request has no `{name}` that these weights could apply to")
    values = np.asarray(weights, dtype=float)
    if values.shape != columns[name].shape:
        raise FieldError(f"/weights/{name}", f"give {columns[name].size} weights, not {values.size}")
    if np.any(invalid := ~((values >= 0) & np.isfinite(values))):
        raise FieldError(f"/weights/{name}/{int(np.argmax(invalid))}", "give a finite weight of at least 0")
    if not np.any(values > 0):
        raise FieldError(f"/weights/{name}", "give at least one weight above 0")
    return None if np.all(values == values[0]) else values


HOW_TURNED = (
    "state how the crank turns: `crank_span` (its even rotation from the first sample to the last), "
    "or `crank_angle` (its angle at each sample)"
)
"""Message for a request with neither `crank_span` nor `crank_angle`."""


def _crank(crank_span: float | None, crank_angle: Floats | None, samples: int) -> Floats:
    if crank_span is None and crank_angle is None:
        raise FieldError("/crank_span", HOW_TURNED)
    if crank_span is not None and crank_angle is not None:
        raise FieldError("/crank_span", "give either `crank_span` or `crank_angle`, not both")
    if crank_angle is None:
        assert crank_span is not None
        if not np.isfinite(crank_span):
            raise FieldError("/crank_span", "give a finite number")
        field, crank = "/crank_span", np.linspace(0.0, float(crank_span), samples)
    else:
        field, crank = "/crank_angle", crank_angle.astype(float) - float(crank_angle[0])
    span = abs(crank[-1])
    if not MIN_SPAN <= span <= MAX_SPAN:
        low, high, found = np.rad2deg([MIN_SPAN, MAX_SPAN, crank[-1]])
        raise FieldError(
            field, f"the crank must turn by {low:g} to {high:g} degrees in either sense, not by {found:g}"
        )
    steps = np.diff(crank) * np.sign(crank[-1])
    too_short = steps <= MIN_STEP * span
    if np.any(too_short):
        index = int(np.argmax(too_short)) + 1
        message = "the crank must turn in one sense, but this angle does not continue from the previous angle"
        raise FieldError(f"{field}/{index}", message)
    return crank


def _length_scale(position: Complexes, mean: Mean, length_scale: float | None) -> float:
    position = mean.zero_missing(position)
    largest = float(max(np.max(np.abs(position.real)), np.max(np.abs(position.imag))))
    for field, length in (("/position", largest or None), ("/length_scale", length_scale)):
        if length is not None and not MIN_LENGTH <= length <= MAX_LENGTH:
            raise FieldError(field, f"give lengths between {MIN_LENGTH:g} and {MAX_LENGTH:g}")
    spread = mean.reach(position)
    if spread <= 64 * np.finfo(float).eps * largest:
        raise FieldError(
            "/position",
            "all positions are the same point, and a motion without extent determines no linkage; "
            "for a body that only rotates, use a hinge at that point",
        )
    return float(length_scale) if length_scale is not None else spread
