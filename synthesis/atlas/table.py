"""Curves of many types of one mechanism as Haar features: how they are computed, and what an atlas holds of them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.atlas import haar
from synthesis.errors import FieldError
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, count_types, enumerate_types
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.mechanism import Turning
from synthesis.slider import SLIDER_CRANK_TYPES, SliderTypeRule, count_slider_types, enumerate_slider_types
from synthesis.target import TURN

SCHEMA = 1
MIN_SAMPLES, MAX_SAMPLES = 16, 4096
COLUMNS = {"lengths": "<u2", "average": "<f8", "details": "<f4", "winding": "|i1", "curve_error": "<f4"}
"""Arrays of an atlas with their stored types."""
UNITS = {
    "lengths": "whole numbers L1 crank, L2 coupler, L3 rocker, L4 ground; type number n is row n - 1",
    "average": "radians: Haar average of the periodic part of the coupler angle over one turn of the crank",
    "details": "radians: Haar details, (mean of first half - mean of second half) / 2 of each block, coarse to fine: "
    "level n, block l (from 0) is column 2^n - 1 + l",
    "winding": "turns of the coupler in one turn of the crank; coupler angle = winding * crank angle + periodic part",
    "curve_error": "radians: bound of the error, at any crank angle, of the stored curve's band-limited interpolation "
    "(all harmonics below samples / 2)",
}
CURVE = (
    "coupler angle theta2 (measured from the ground line A->B, branch +1: C left of D->B) at crank angles "
    "2 pi k / samples, k = 0 .. samples - 1, the end not repeated; branch -1: theta2(x) = -theta2_plus(-x)"
)


class AtlasKind(NamedTuple):
    """A kind of mechanism that an atlas may be of."""

    mechanism: Turning
    rule: Callable[..., TypeRule | SliderTypeRule]
    """Its rule of types, from what `own` names."""
    own: tuple[str, ...]
    """What the rule says, as it is written to the file."""
    count: Callable[[Any], int]
    enumerate: Callable[..., NDArray[np.int32]]
    """``enumerate(rule, begin, end) -> lengths``"""
    columns: int
    """Lengths of a type."""
    lengths: str
    """What they are, in words,"""
    curve: str
    """and what is sampled."""


KINDS = {
    "four_bar": AtlasKind(
        FOURBAR,
        TypeRule,
        ("perimeter", "smallest", "order"),
        count_types,
        enumerate_types,
        4,
        UNITS["lengths"],
        CURVE,
    ),
    "slider_crank": AtlasKind(
        SLIDER_CRANK_TYPES,
        SliderTypeRule,
        ("perimeter", "smallest"),
        count_slider_types,
        enumerate_slider_types,
        3,
        "whole numbers r crank, l rod, e offset of the rail from the crank's pivot; type number n is row n - 1",
        "rod angle theta2 (measured from the rail, branch +1: sin theta2 = (e - r sin theta1) / l) at crank angles "
        "2 pi k / samples, k = 0 .. samples - 1, the end not repeated; branch -1, the offset negated: "
        "theta2(x) = -theta2_plus(-x)",
    ),
}
"""Kinds of atlases by their names."""


@dataclass(frozen=True, kw_only=True)
class Types:
    """Dimension types of a mechanism, whose crank turns fully: what a scan tells its windows by.

    ``lengths`` (T, d). ``winding`` (T,): turns of the body in one turn of the crank.
    """

    mechanism: Turning = FOURBAR
    lengths: NDArray[Any]
    winding: NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.lengths)


@dataclass(frozen=True, kw_only=True)
class Table(Types):
    """Types with the rotation of their body over a whole turn of the crank.

    ``average`` (T,). ``details`` (T, samples - 1): of the periodic part of the rotation, in the *mean* normalisation of
    `haar`. ``curve_error`` (T,): bound of the error of the stored curve, see `compute_rows`.
    """

    average: NDArray[np.float64]
    details: NDArray[np.float32]
    curve_error: NDArray[np.float32]

    @property
    def samples(self) -> int:
        """Samples of a curve."""
        return self.details.shape[1] + 1

    def curves(self, rows: Any = slice(None)) -> NDArray[np.float64]:
        """Periodic part of theta2 of some rows, shape (rows, samples): the inverse transform of what is stored."""
        return haar.curve_from_features(self.average[rows], self.details[rows])


def make_table(mechanism: Turning, lengths: NDArray[Any], samples: int) -> Table:
    """The table of a mechanism's types, (T, d); ``samples`` is a power of two."""
    return Table(mechanism=mechanism, lengths=lengths, **compute_rows(lengths, samples, mechanism)._asdict())


BLOCK = 256
"""Linkages worked on at a time: their samples fit a core's cache, which is twice as fast as all at once."""
BETWEEN = 1.5
"""Error anywhere over error at the samples and midway: sqrt(2) for a trigonometric polynomial of these harmonics (Ehlich and
Zeller, 1964: 1 / cos(pi n / M) for degree n at M points), and a little for what the samples do not resolve."""


class AtlasRows(NamedTuple):
    """Columns of a table for some types; see `Table`."""

    average: NDArray[np.float64]
    details: NDArray[np.float32]
    winding: NDArray[np.int8]
    curve_error: NDArray[np.float32]


def compute_rows(lengths: ArrayLike, samples: int, mechanism: Turning = FOURBAR) -> AtlasRows:
    """What the atlas stores of each type.

    ``lengths`` (T, d): types whose crank turns fully. ``samples``: power of two.

    Law: the rows of a part are the part of the rows, bit for bit, if parts begin at multiples of `BLOCK`.
    """
    lengths = np.atleast_2d(np.asarray(lengths, dtype=float))
    blocks = [
        _compute_block(mechanism, lengths[k : k + BLOCK], samples) for k in range(0, max(len(lengths), 1), BLOCK)
    ]
    return AtlasRows(*(np.concatenate(columns) for columns in zip(*blocks)))


def _compute_block(mechanism: Turning, lengths: NDArray[np.float64], samples: int) -> AtlasRows:
    step = TURN / samples
    crank = np.arange(samples) * step
    winding: NDArray[Any] = mechanism.winding(lengths).astype(np.int8)

    def periodic(angle: NDArray[Any]) -> NDArray[np.float64]:
        return mechanism.body_angle(lengths, np.ones(len(lengths)), angle) - winding[:, None] * angle

    curve = periodic(crank)
    average, details = haar.features(curve)
    stored = details.astype("<f4")
    read_back = haar.curve_from_features(average, stored)
    at, midway = interpolate(read_back)
    error = np.maximum(np.abs(at - curve), np.abs(midway - periodic(crank + step / 2))).max(axis=-1)
    return AtlasRows(average, stored, winding, np.nextafter((BETWEEN * error).astype("<f4"), np.float32(np.inf)))


def interpolate(curve: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Band-limited interpolation of periodic samples, at each and midway to its next, both shaped as ``curve``.

    It is the trigonometric polynomial of all harmonics below the highest, whose phase the samples do not tell; so it does
    not pass through them.
    """
    samples = curve.shape[-1]
    spectrum = np.fft.rfft(curve, axis=-1)
    spectrum[..., -1] = 0
    shift = np.exp(1j * np.pi / samples * np.arange(samples // 2 + 1))
    return np.fft.irfft(spectrum, samples, axis=-1), np.fft.irfft(spectrum * shift, samples, axis=-1)


# -- an atlas ----------------------------------------------------------------------------------------------------------

Parts = Callable[[str], Iterable[NDArray[Any]]]
"""``parts(name)``: a column of `COLUMNS` in parts, one behind the other."""


@dataclass(frozen=True)
class AtlasRule:
    """What an atlas holds: its dimension types and the samples of each curve.

    ``samples``: samples of a curve over the whole turn; a power of two from 16 to 4,096.
    """

    types: TypeRule | SliderTypeRule = field(default_factory=TypeRule)
    samples: int = 256

    def __post_init__(self) -> None:
        in_range = MIN_SAMPLES <= self.samples <= MAX_SAMPLES
        if not in_range or self.samples & (self.samples - 1):
            raise FieldError(
                "/samples", f"must be a power of two from {MIN_SAMPLES} to {MAX_SAMPLES}, found {self.samples}"
            )

    @classmethod
    def from_json(cls, values: Any) -> AtlasRule:
        """The rule of such values. Raises ValueError, KeyError or TypeError where they are none."""
        kind = KINDS[values.get("kind", TypeRule.kind)]
        own = {name: OrderRule(values[name]) if name == "order" else int(values[name]) for name in kind.own}
        return cls(kind.rule(**own), int(values["samples"]))

    @classmethod
    def of(
        cls,
        kind: str = TypeRule.kind,
        perimeter: int | None = None,
        smallest: int | None = None,
        order: str | None = None,
        samples: int | None = None,
    ) -> AtlasRule:
        """The rule of a kind, with its own defaults where nothing is given.

        Raises `FieldError`.
        """
        if kind not in KINDS:
            raise FieldError("/kind", f"wanted one of {', '.join(KINDS)}, found {kind!r}")
        given = {"perimeter": perimeter, "smallest": smallest, "order": order}
        given = {name: value for name, value in given.items() if value is not None}
        if foreign := given.keys() - set(KINDS[kind].own):
            raise FieldError(f"/{min(foreign)}", f"belongs to an atlas of four-bars, not of kind {kind}")
        orders = [one.value for one in OrderRule]
        if order is not None and order not in orders:
            raise FieldError("/order", f"wanted one of {', '.join(orders)}, found {order!r}")
        types = KINDS[kind].rule(**given)
        return cls(types) if samples is None else cls(types, samples)

    @property
    def kind(self) -> AtlasKind:
        """What its types are of."""
        return KINDS[self.types.kind]

    @property
    def count(self) -> int:
        """How many types it has."""
        return self.kind.count(self.types)

    def lengths(self, begin: int = 0, end: int | None = None) -> NDArray[np.int32]:
        """The types of some rows, as of a slice, (types, d)."""
        return self.kind.enumerate(self.types, begin, end)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each column."""
        types, columns = self.count, self.kind.columns
        shapes: dict[str, tuple[int, ...]] = {name: (types,) for name in COLUMNS}
        return shapes | {"lengths": (types, columns), "details": (types, self.samples - 1)}

    def as_json(self) -> dict[str, Any]:
        """The rule as plain JSON values. The kind is told of others than four-bars, whose files were first."""
        kind = {} if self.types.kind == TypeRule.kind else {"kind": self.types.kind}
        own = {name: getattr(self.types, name) for name in self.kind.own}
        return {**kind, **own, "samples": self.samples}


@dataclass(frozen=True, kw_only=True)
class AtlasTypes(Types):
    """The types of a rule, without their rotations.

    ``generator``: versions of what wrote the atlas. ``known_hash``: its content hash, where that has been computed.
    """

    rule: AtlasRule
    generator: dict[str, str]
    schema: int = SCHEMA
    known_hash: str | None = None

    @classmethod
    def from_json(cls, values: dict[str, Any], **columns: Any) -> AtlasTypes:
        """From plain JSON values, and the arrays."""
        known = {name: values[name] for name in ("generator", "schema", "known_hash")}
        rule = AtlasRule.from_json(values["rule"])
        return cls(rule=rule, mechanism=rule.kind.mechanism, **known, **columns)

    def as_json(self) -> dict[str, Any]:
        """What there is to know of them beside the arrays, as plain JSON values."""
        facts = {"generator": self.generator, "schema": self.schema, "known_hash": self.known_hash}
        return {**facts, "rule": self.rule.as_json()}


@dataclass(frozen=True, kw_only=True)
class Atlas(AtlasTypes, Table):
    """The table of all types of a rule, arrays read-only: what an atlas file holds."""

    def content_hash(self) -> str:
        """SHA-256 over the raw little-endian arrays and the rule: the same for equal content, however it is packed."""
        if self.known_hash is not None:
            return self.known_hash
        return content_hash(self.rule, lambda name: [getattr(self, name)])


def types_of_rule(rule: AtlasRule) -> AtlasTypes:
    """The types of a rule alone, which takes no time."""
    lengths = rule.lengths()
    winding = rule.kind.mechanism.winding(lengths.astype(float)).astype(np.int8)
    return AtlasTypes(mechanism=rule.kind.mechanism, rule=rule, generator={}, lengths=lengths, winding=winding)


def atlas_of_rule(rule: AtlasRule) -> Atlas:
    """The atlas of a rule, computed here and now."""
    lengths, mechanism = rule.lengths(), rule.kind.mechanism
    rows = compute_rows(lengths, rule.samples, mechanism)._asdict()
    return Atlas(mechanism=mechanism, rule=rule, generator={}, lengths=lengths, **rows)


def content_hash(rule: AtlasRule, parts: Parts) -> str:
    """The hash of `Atlas.content_hash` from columns in parts. Law: the same however they are divided."""
    digest = hashlib.sha256(json.dumps(rule.as_json(), sort_keys=True).encode())
    for name, dtype in COLUMNS.items():
        for part in parts(name):
            digest.update(np.ascontiguousarray(part, dtype=dtype).data)
    return digest.hexdigest()
