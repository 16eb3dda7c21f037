"""Curves of many types of one mechanism as Haar features: in memory, whether they come from a file or not."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas import haar
from synthesis.atlas.rows import compute_rows
from synthesis.errors import FieldError
from synthesis.fourbar.dimension_types import TypeRule, count_types
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.mechanism import Mechanism

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


@dataclass(frozen=True, kw_only=True)
class Table:
    """Body rotations of types over a whole turn of the crank.

    Attributes
    ----------
    mechanism : Mechanism
    lengths : ndarray, shape (T, d)
        Types whose crank turns fully.
    average : ndarray of float64, shape (T,)
    details : ndarray of float32, shape (T, samples - 1)
        Of the periodic part of the rotation, in the *mean* normalisation of `haar`.
    winding : ndarray of int8, shape (T,)
        Turns of the body in one turn of the crank.
    curve_error : ndarray of float32, shape (T,)
        Bound of the error of the stored curve, see `rows`.
    """

    mechanism: Mechanism = FOURBAR
    lengths: NDArray[Any]
    average: NDArray[np.float64]
    details: NDArray[np.float32]
    winding: NDArray[np.int8]
    curve_error: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.lengths)

    @property
    def samples(self) -> int:
        """Samples of a curve."""
        return self.details.shape[1] + 1

    def curves(self, rows: Any = slice(None)) -> NDArray[np.float64]:
        """Periodic part of theta2 of some rows, shape (rows, samples): the inverse transform of what is stored."""
        return haar.curve_from_features(self.average[rows], self.details[rows])


def make_table(mechanism: Mechanism, lengths: NDArray[Any], samples: int) -> Table:
    """The table of a mechanism's types, (T, d); ``samples`` is a power of two."""
    return Table(mechanism=mechanism, lengths=lengths, **compute_rows(lengths, samples, mechanism)._asdict())


Parts = Callable[[str], Iterable[NDArray[Any]]]
"""``parts(name)``: a column of `COLUMNS` in parts, one behind the other."""


@dataclass(frozen=True)
class AtlasRule:
    """What an atlas holds: its dimension types and the samples of each curve.

    Parameters
    ----------
    types : TypeRule
    samples : int
        Samples of a curve over the whole turn; a power of two from 16 to 4,096.
    """

    types: TypeRule = field(default_factory=TypeRule)
    samples: int = 256

    def __post_init__(self) -> None:
        in_range = MIN_SAMPLES <= self.samples <= MAX_SAMPLES
        if not in_range or self.samples & (self.samples - 1):
            raise FieldError(
                "/samples", f"must be a power of two from {MIN_SAMPLES} to {MAX_SAMPLES}, found {self.samples}"
            )

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each column."""
        types = count_types(self.types)
        return {name: (types,) for name in COLUMNS} | {"lengths": (types, 4), "details": (types, self.samples - 1)}

    def as_json(self) -> dict[str, Any]:
        """The rule as plain JSON values."""
        return {
            "perimeter": self.types.perimeter,
            "smallest": self.types.smallest,
            "order": self.types.order.value,
            "samples": self.samples,
        }


@dataclass(frozen=True, kw_only=True)
class Atlas(Table):
    """The table of all four-bars of a rule, arrays read-only: what an atlas file holds.

    Attributes
    ----------
    rule : AtlasRule
    generator : dict
        Versions of what wrote it.
    known_hash : str, optional
        Its content hash, where that has been computed.
    """

    rule: AtlasRule
    generator: dict[str, str]
    schema: int = SCHEMA
    known_hash: str | None = None

    def content_hash(self) -> str:
        """SHA-256 over the raw little-endian arrays and the rule: the same for equal content, however it is packed."""
        if self.known_hash is not None:
            return self.known_hash
        return content_hash(self.rule, lambda name: [getattr(self, name)])


def content_hash(rule: AtlasRule, parts: Parts) -> str:
    """The hash of `Atlas.content_hash` from columns in parts. Law: the same however they are divided."""
    digest = hashlib.sha256(json.dumps(rule.as_json(), sort_keys=True).encode())
    for name, dtype in COLUMNS.items():
        for part in parts(name):
            digest.update(np.ascontiguousarray(part, dtype=dtype).data)
    return digest.hexdigest()
