"""The requested motion: crank angles, and the rotation or the positions, or both, that belong to them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.errors import FieldError

TURN = 2 * np.pi
MIN_SAMPLES, MAX_SAMPLES = 3, 1024
MIN_SPAN = np.deg2rad(0.1)
"""Smallest crank span: below it a curve has no shape that double precision could tell from a line."""
MAX_SPAN = np.deg2rad(3600.0)
MIN_STEP = 1e-9
"""Smallest step of the crank between samples, as part of the span."""
MAX_ROTATION = 1e6
"""Largest rotation in radians: beyond it double precision keeps fewer than ten digits behind the point."""
MIN_LENGTH, MAX_LENGTH = 1e-50, 1e50
"""Lengths and coordinates lie between: squares, and quotients of squares, neither over- nor underflow."""


CURVE_STEP, CURVE_LEAST = np.deg2rad(1.0), 24
"""Largest step of a curve over an interval, in radians, and the fewest steps, however short the interval is."""


class Interval(NamedTuple):
    """A part of the crank's turn in radians, between two crank angles in either order; arrays are one interval each."""

    first: Any
    last: Any

    def after(self, start: Any) -> Interval:
        """The interval moved so that what was crank angle 0 is ``start``."""
        return Interval(start + self.first, start + self.last)

    def by_degrees(self) -> Floats:
        """Angles from end to end in even steps of at most a degree, at least `CURVE_LEAST` of them."""
        steps = max(CURVE_LEAST, int(np.ceil(abs(self.last - self.first) / CURVE_STEP * (1 - 1e-12))))
        return np.linspace(self.first, self.last, steps + 1)


class Mean:
    """The mean over the samples of a motion, weighted where the request weighs its samples.

    ``weights`` (N,): at least 0, at least one above; a sample of weight 0 is missing. Default: all alike.
    """

    def __init__(self, samples: int, weights: Floats | None = None) -> None:
        self.samples = samples
        self.weights = None if weights is None else weights / weights.sum()
        self.total: float = samples if self.weights is None else 1.0
        # the square root of a sample's part of the mean: squares of rows times it add up to a mean square
        self.root: Any = 1 / np.sqrt(samples) if self.weights is None else np.sqrt(self.weights)

    def __call__(self, values: NDArray[Any]) -> Any:
        """The mean over the last axis."""
        return values.mean(axis=-1) if self.weights is None else values @ self.weights

    def weighted(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values (..., N) such that their sum over ``total`` is the mean."""
        return values if self.weights is None else values * self.weights

    def product(self, values: NDArray[Any], column: NDArray[Any]) -> Any:
        """The mean of rows (..., N) times a column (N,)."""
        return values @ self.weighted(column) / self.total

    def spread(self, values: NDArray[Any]) -> Any:
        """Root mean square of values less their mean, over the last axis."""
        rest = values - np.expand_dims(self(values), -1)
        return np.sqrt(self(np.abs(rest) ** 2))

    def reach(self, values: NDArray[Any]) -> float:
        """Largest distance of a given sample (N,) from the mean."""
        return float(np.max(self.given(np.abs(values - self(values)))))

    def given(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values (..., N) with zeros where a sample is missing."""
        return values if self.weights is None else np.where(self.weights > 0, values, 0.0)


@dataclass(frozen=True)
class Samples:
    """What a body must do at the samples of a motion, in radians and the user's unit of length.

    ``rotation`` (N,): rotation of the body. ``position`` (N,): a point of the body, x + i y. ``length_scale``: l of the
    objective; 1 without positions. ``rotation_weights``, ``position_weights`` (N,): weight of each sample, 0 for one
    that is missing; None: all alike.
    """

    rotation: Floats | None
    position: Complexes | None
    length_scale: float = 1.0
    rotation_weights: Floats | None = None
    position_weights: Floats | None = None

    @property
    def samples(self) -> int:
        """How many samples there are."""
        return (self.rotation if self.position is None else self.position).shape[-1]  # type: ignore[union-attr]

    @cached_property
    def rotation_mean(self) -> Mean:
        """The mean over the samples by which rotations are compared."""
        return Mean(self.samples, self.rotation_weights)

    @cached_property
    def position_mean(self) -> Mean:
        """The mean over the samples by which positions are compared."""
        return Mean(self.samples, self.position_weights)

    @cached_property
    def extent(self) -> float:
        """Largest distance of a position from the mean position."""
        assert self.position is not None
        return self.position_mean.reach(self.position)

    @cached_property
    def middle(self) -> complex:
        """Mean position."""
        return 0j if self.position is None else complex(self.position_mean(self.position))

    def spread(self, most: int) -> NDArray[np.intp]:
        """Places of about ``most`` samples at most, both ends among them; evenly among those that count for each part."""
        kept = [np.array([0, self.samples - 1])]
        for values, weights in self._parts().values():
            if values is not None:
                given = np.arange(self.samples) if weights is None else np.flatnonzero(weights)
                kept.append(given[np.round(np.linspace(0, given.size - 1, min(most, given.size))).astype(int)])
        return np.unique(np.concatenate(kept))

    def _parts(self) -> dict[str, tuple[NDArray[Any] | None, Floats | None]]:
        return {
            "rotation": (self.rotation, self.rotation_weights),
            "position": (self.position, self.position_weights),
        }

    def off(self, some: Samples) -> complex:
        """Mean position of some of the samples, from that of all, over the length scale: places count from their own mean."""
        return (some.middle - self.middle) / self.length_scale

    def error_at_rest(self, modulo_turn: bool) -> float:
        """Return the objective of a body at rest in its best pose.

        ``modulo_turn``: whether rotations count modulo a turn, as they do if the crank angles are free. The best angle is then
        the mean of the sorted angles with a turn added to the first k, for the best k.
        """
        square = 0.0
        if self.position is not None:
            square = float(self.position_mean.spread(self.position / self.length_scale)) ** 2
        if self.rotation is None:
            return float(np.sqrt(square))
        if not modulo_turn:
            return float(np.sqrt(square + self.rotation_mean.spread(self.rotation) ** 2))
        angles = self.rotation % TURN
        order = np.argsort(angles)
        angles, weights = angles[order], self.rotation_mean.weighted(np.ones(self.samples))[order]
        weights = weights / self.rotation_mean.total
        raised = np.concatenate([[0.0], np.cumsum(weights)[:-1]]) * TURN
        moment = np.concatenate([[0.0], np.cumsum(weights * (2 * angles + TURN))[:-1]]) * TURN
        variance = weights @ angles**2 + moment - (weights @ angles + raised) ** 2
        return float(np.sqrt(square + max(0.0, variance.min())))

    @cached_property
    def scaled(self) -> Complexes:
        """Positions from their mean over the length scale; zeros where there is none."""
        if self.position is None:
            return np.zeros(self.samples, dtype=complex)
        return self.position_mean.given((self.position - self.middle) / self.length_scale)


class Asked(NamedTuple):
    """A motion as it was asked for, NaN where a sample is missing; ``moved`` (N,): whole turns that rotations were moved by."""

    rotation: Floats | None
    position: Complexes | None
    moved: Floats


@dataclass(frozen=True, kw_only=True)
class Target(Samples):
    """A requested motion: samples with the crank angle that belongs to each. Rotations are continuous as they are given.

    ``crank`` (N,): crank angle from the first sample on; ``crank[0] == 0``, strictly rising or strictly falling
    (clockwise). Where they were found and not given, the samples may be passed in another order. ``start``: theta1 at
    the first sample, where it is given. ``offset``: what is added to theta2 to give the rotation, where it is given;
    whole turns do not count. ``found``: whether the crank angles were found together with a linkage; then crank and
    rotation may have leading axes, one linkage each. ``closed``: whether the crank turns on from the last sample to the
    first, so that the motion uses a whole turn. ``moved``: whole turns by which each rotation differs from what was asked.
    """

    crank: Floats
    start: float | None = None
    offset: float | None = None
    found: bool = False
    closed: bool = False
    moved: Any = 0.0

    @property
    def samples(self) -> int:
        """How many samples there are."""
        return self.crank.shape[-1]

    @property
    def asked(self) -> Asked:
        """What was asked for, as it was."""
        rotation, position = self.rotation, self.position
        moved = np.broadcast_to(np.asarray(self.moved, dtype=float), (self.samples,))
        if rotation is not None:
            given = np.ones(self.samples, dtype=bool) if self.rotation_weights is None else self.rotation_weights > 0
            # at a missing sample the turns of the one before it, and before the first that is there those of that one
            last = np.maximum.accumulate(np.where(given, np.arange(self.samples), 0))
            moved = moved[np.maximum(last, int(np.argmax(given)))]
            rotation = np.where(given, rotation - moved, np.nan)
        if position is not None and self.position_weights is not None:
            position = np.where(self.position_weights > 0, position, complex(np.nan, np.nan))
        return Asked(rotation, position, moved)

    @property
    def interval(self) -> Interval:
        """The crank angles that the motion uses, from the first sample on; where that is at neither end, from the least."""
        if not self.found:
            return Interval(0.0, float(self.crank[-1]))
        low, high = self.crank.min(axis=-1), self.crank.max(axis=-1)
        down = self.crank[..., 0] >= high
        first = np.where(down, high, low)[()]
        if self.closed:
            return Interval(first, first + np.where(down, -TURN, TURN))
        return Interval(first, np.where(down, low, high)[()])

    @property
    def way(self) -> Floats:
        """Crank angles (n,) that the crank passes: those of the samples, and of a closed way that of the first, a turn on."""
        return np.append(self.crank, self.interval.last) if self.closed else self.crank

    def one_of(self, place: int) -> Target:
        """The target of one linkage, where each has crank angles of its own."""
        if not self.found or self.crank.ndim == 1:
            return self
        if self.rotation is None:
            return replace(self, crank=self.crank[place])
        return replace(self, crank=self.crank[place], rotation=self.rotation[place], moved=self.moved[place])

    @cached_property
    def repeats_one_crank_angle(self) -> bool:
        """Whether all rotations that count are wanted at one crank angle, whole turns apart."""
        return _whole_turns(self.rotation_mean, self.crank)

    @property
    def clockwise(self) -> bool:
        """Whether the crank turns clockwise."""
        return bool(self.crank[-1] < 0)

    def mirrored(self) -> Target:
        """The target in a mirror (the x axis): the crank turns the other way, and so does the body."""
        return replace(
            self,
            crank=-self.crank,
            start=None if self.start is None else -self.start,
            offset=None if self.offset is None else -self.offset,
            moved=-self.moved,
            rotation=None if self.rotation is None else -self.rotation,
            position=None if self.position is None else np.conj(self.position),
        )

    def thinned(self, most: int) -> Target:
        """The target at about ``most`` samples at most, each with its own weight."""
        if self.samples <= most:
            return self
        keep = self.spread(most)
        columns: dict[str, Any] = {name: getattr(self, name) for name in _COLUMNS}
        columns = {name: None if values is None else values[keep] for name, values in columns.items()}
        return replace(self, **columns)

    def condensed(self, most: int) -> Target:
        """The target at about ``most`` samples at most, each with the weight of all that it is the nearest to."""
        if self.samples <= most:
            return self
        keep = self.spread(most)
        columns: dict[str, Any] = {"crank": self.crank[keep]}
        for name, (values, weights) in self._parts().items():
            if values is None:
                continue
            own = np.ones(self.samples) if weights is None else weights
            given = np.flatnonzero(own)
            left = np.flatnonzero(own[keep])
            nearest = left[np.abs(given[:, None] - keep[left]).argmin(axis=1)]
            columns[name] = values[keep]
            columns[f"{name}_weights"] = np.bincount(nearest, weights=own[given], minlength=keep.size)
        return replace(self, **columns)


def _whole_turns(mean: Mean, crank: Floats) -> bool:
    """Whether the crank angles of the samples that count are the same but for whole turns, to their rounding."""
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
) -> Target:
    """A checked `Target`.

    Raises `FieldError`: naming the field and the sample.

    Parameters
    ----------
    rotation, position : ndarray, shape (N,), optional
        At least one; 3 to 1,024 samples.
    crank_span : float, optional
        Evenly spaced crank angles from 0 to this, both ends included; negative for a clockwise crank.
    crank_angle : ndarray, shape (N,), optional
        In place of ``crank_span``: angles from any zero; what counts is the increment from the first.
    length_scale : float, optional
        Default: the largest distance of a position from the mean position.
    rotation_weights, position_weights : ndarray, shape (N,), optional
        At least 0 and somewhere above it; a sample of weight 0 is missing, whatever its value. Default: all alike.
    """
    part, given = read_samples(
        rotation, position, length_scale, rotation_weights, position_weights, crank_angle=crank_angle
    )
    target = Target(**part, crank=_crank(crank_span, given.get("crank_angle"), next(iter(given.values())).size))
    if target.position is not None and _whole_turns(target.position_mean, target.crank):
        field = "/crank_span" if crank_angle is None else "/crank_angle"
        raise FieldError(field, "all positions are wanted at one crank angle, whole turns apart: they fix no linkage")
    return target


def read_samples(
    rotation: Floats | None,
    position: NDArray[np.complex128] | None,
    length_scale: float | None,
    rotation_weights: Floats | None,
    position_weights: Floats | None,
    least: int = MIN_SAMPLES,
    **more: Floats | None,
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """The checked fields of `Samples`, and all columns that were given, ``more`` ones included; see `make_target`."""
    named = {"rotation": rotation, "position": position, **more}
    if position is not None:
        named["position"] = np.asarray(position, dtype=complex)
    given: dict[str, NDArray[Any]] = {
        name: np.asarray(values) for name, values in named.items() if values is not None
    }
    if rotation is None and position is None:
        raise FieldError("", "give `rotation`, `position` or both")
    for name, values in given.items():
        if values.ndim != 1 or not least <= values.size <= MAX_SAMPLES:
            raise FieldError(f"/{name}", f"wanted {least} to {MAX_SAMPLES} samples, found {values.size}")
        if not np.all(np.isfinite(values)):
            raise FieldError(f"/{name}/{int(np.argmin(np.isfinite(values)))}", "wanted a finite number")
    if len(sizes := {name: values.size for name, values in given.items()}) > 1 and len(set(sizes.values())) > 1:
        counted = ", ".join(f"{name} has {size}" for name, size in sizes.items())
        raise FieldError(f"/{list(sizes)[-1]}", f"wanted the same number of samples everywhere, but {counted}")
    if rotation is not None and np.any(large := np.abs(given["rotation"]) > MAX_ROTATION):
        raise FieldError(f"/rotation/{int(np.argmax(large))}", f"wanted at most {MAX_ROTATION:g} radians either way")
    weights = {
        f"{name}_weights": _weights(name, given, values)
        for name, values in (("rotation", rotation_weights), ("position", position_weights))
    }
    scale = 1.0
    if position is not None:
        mean = Mean(given["position"].size, weights["position_weights"])
        scale = _length_scale(given["position"], mean, length_scale)
    elif length_scale is not None:
        raise FieldError("/length_scale", "weighs positions, but there are none")
    part = {
        "rotation": given["rotation"].astype(float) if rotation is not None else None,
        "position": given["position"].astype(complex) if position is not None else None,
        "length_scale": scale,
        **weights,
    }
    return part, given


def _weights(name: str, given: dict[str, Any], weights: Floats | None) -> Floats | None:
    """Checked weights of a part of the motion; None where all are alike."""
    if weights is None:
        return None
    if name not in given:
        raise FieldError(f"/weights/{name}", f"weighs `{name}`, but there is none")
    values = np.asarray(weights, dtype=float)
    if values.shape != given[name].shape:
        raise FieldError(f"/weights/{name}", f"wanted {given[name].size} weights, found {values.size}")
    if np.any(bad := ~((values >= 0) & np.isfinite(values))):
        raise FieldError(f"/weights/{name}/{int(np.argmax(bad))}", "wanted a finite weight of at least 0")
    if not np.any(values > 0):
        raise FieldError(f"/weights/{name}", "wanted at least one weight above 0")
    return None if np.all(values == values[0]) else values


HOW_TURNED = (
    "say how the crank turns: `crank_span` (by so much from the first sample to the last, evenly), "
    "or `crank_angle` (its angle at each sample)"
)
"""What is said where neither is given."""


def _crank(crank_span: float | None, crank_angle: Floats | None, samples: int) -> Floats:
    if crank_span is None and crank_angle is None:
        raise FieldError("/crank_span", HOW_TURNED)
    if crank_span is not None and crank_angle is not None:
        raise FieldError("/crank_span", "give either `crank_span` or `crank_angle`, not both")
    if crank_angle is None:
        assert crank_span is not None
        if not np.isfinite(crank_span):
            raise FieldError("/crank_span", "wanted a finite number")
        field, crank = "/crank_span", np.linspace(0.0, float(crank_span), samples)
    else:
        field, crank = "/crank_angle", crank_angle.astype(float) - float(crank_angle[0])
    span = abs(crank[-1])
    if not MIN_SPAN <= span <= MAX_SPAN:
        low, high, found = np.rad2deg([MIN_SPAN, MAX_SPAN, crank[-1]])
        raise FieldError(field, f"the crank must turn by {low:g} to {high:g} degrees either way, found {found:g}")
    steps = np.diff(crank) * np.sign(crank[-1])
    short = steps <= MIN_STEP * span
    if np.any(short):
        place = int(np.argmax(short)) + 1
        raise FieldError(
            f"{field}/{place}", "the crank must turn one way: this angle does not go on from the one before"
        )
    return crank


def _length_scale(position: Complexes, mean: Mean, length_scale: float | None) -> float:
    position = mean.given(position)
    largest = float(max(np.max(np.abs(position.real)), np.max(np.abs(position.imag))))
    for field, length in (("/position", largest or None), ("/length_scale", length_scale)):
        if length is not None and not MIN_LENGTH <= length <= MAX_LENGTH:
            raise FieldError(field, f"wanted lengths between {MIN_LENGTH:g} and {MAX_LENGTH:g}")
    spread = mean.reach(position)
    if spread <= 64 * np.finfo(float).eps * largest:
        raise FieldError(
            "/position",
            "all positions are the same point: a motion without extent fixes no linkage; "
            "a body that only turns needs a hinge there",
        )
    return float(length_scale) if length_scale is not None else spread
