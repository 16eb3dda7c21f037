"""Dimension types of a rule with the Haar features and the Fourier series of their rotation curves."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.arrays import Floats
from synthesis.atlas import haar
from synthesis.errors import FieldError
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, count_types, enumerate_types
from synthesis.fourbar.mechanism import coupler_turns
from synthesis.target import TURN

SCHEMA = 2
"""Number of the layout of an atlas file."""
MIN_SAMPLES, MAX_SAMPLES = 16, 4096
FEATURES = {"lengths": "<u2", "average": "<f8", "details": "<f4", "winding": "|i1"}
"""Arrays with a row for each type, and their stored data types."""
UNITS = {
    "lengths": "whole numbers L1 crank, L2 coupler, L3 rocker, L4 ground; type number n is row n - 1",
    "average": "radians: Haar average of the periodic part of the coupler angle over one turn of the crank",
    "details": "radians: Haar details, (mean of first half - mean of second half) / 2 of each block, coarse to fine: "
    "level n, block l (from 0) is column 2^n - 1 + l",
    "winding": "turns of the coupler in one turn of the crank; coupler angle = winding * crank angle + periodic part",
}


CURVE = (
    "coupler angle theta2 (measured from the ground line A->B, branch +1: C left of D->B) at crank angles "
    "2 pi k / samples, k = 0 .. samples - 1, the end not repeated; branch -1: theta2(x) = -theta2_plus(-x)"
)
"""Description of the stored curves in words."""


# -- curves of types -----------------------------------------------------------------------------------------------------

BLOCK = 256
"""Number of types computed at a time: their samples fit into the cache of a processor core."""
HARMONICS = 31
"""Harmonics of a series."""
COLUMNS = 2 + 2 * HARMONICS
"""Columns of a series: winding, an unused column, then cosine and sine of each harmonic."""
_GRIDS = (128, 512, 2048)
"""Samples over the turn from which a series is computed: the first grid that resolves the curve."""
_RESOLVED = 1e-10
"""Largest sum of the amplitudes in the highest quarter of the spectrum of a resolved curve, in radians."""


class Features(NamedTuple):
    """Haar features of types: ``average`` (T,), ``details`` (T, samples - 1) and ``winding`` (T,), see `UNITS`."""

    average: NDArray[np.float64]
    details: NDArray[np.float32]
    winding: NDArray[np.int8]


class Series(NamedTuple):
    """Fourier series of body angles.

    ``coefficients`` (T, COLUMNS): theta2(x) = c0 x + sum over h of c[2h] cos hx + c[2h + 1] sin hx, up to a constant. ``errors``
    (T, 2): bounds, at any crank angle, of what the series leaves out of theta2 and of its derivative.
    """

    coefficients: Floats
    errors: Floats


def _periodic(lengths: Floats, samples: int) -> tuple[Floats, NDArray[np.int8]]:
    """Return the periodic part of theta2 at even samples over the turn, and the winding."""
    crank = np.arange(samples, dtype=float) * (TURN / samples)
    winding: NDArray[Any] = coupler_turns(lengths)
    return coupler_angle(lengths, np.ones(len(lengths)), crank) - winding[:, None] * crank, winding


def _in_blocks(lengths: ArrayLike, compute: Callable[[Floats], tuple[Any, ...]]) -> list[NDArray[Any]]:
    lengths = np.atleast_2d(np.asarray(lengths, dtype=float))
    blocks = [compute(lengths[k : k + BLOCK]) for k in range(0, max(len(lengths), 1), BLOCK)]
    return [np.concatenate(columns) for columns in zip(*blocks)]


def compute_features(lengths: ArrayLike, samples: int) -> Features:
    """Compute the Haar features of types (T, d) whose crank turns fully.

    Law: the features of a part are that part of the features, bit for bit, if parts begin at multiples of `BLOCK`.
    """

    def compute(block: Floats) -> tuple[Any, ...]:
        curve, winding = _periodic(block, samples)
        average, details = haar.features(curve)
        return average, details.astype("<f4"), winding

    return Features(*_in_blocks(lengths, compute))


def compute_series(lengths: ArrayLike) -> Series:
    """Compute the series of types (T, d) whose crank turns fully, from the lengths."""

    def compute(block: Floats) -> tuple[Any, ...]:
        coefficients, errors = np.zeros((len(block), COLUMNS)), np.zeros((len(block), 2))
        left = np.arange(len(block))
        for samples in _GRIDS:
            curve, coefficients[left, 0] = _periodic(block[left], samples)
            spectrum = 2 * np.fft.rfft(curve, axis=1) / samples
            size, harmonic = np.abs(spectrum), np.arange(spectrum.shape[1])
            own = np.conj(spectrum[:, 1 : HARMONICS + 1])
            coefficients[left, 2:] = np.ascontiguousarray(own).view(float)
            # aliases, and harmonics beyond the spectrum, together count at most twice the highest quarter of the spectrum
            tail = size[:, 3 * samples // 8 :].sum(axis=1)
            beyond, order = size[:, HARMONICS + 1 :], harmonic[HARMONICS + 1 :]
            errors[left, 0] = beyond.sum(axis=1) + 2 * tail + 1e-14
            errors[left, 1] = beyond @ order + 2 * samples * tail + 1e-13
            left = left[tail > _RESOLVED]
            if not left.size:
                break
        return coefficients, errors

    return Series(*_in_blocks(lengths, compute))


# -- an atlas ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AtlasRule:
    """Contents of an atlas: the rule of its dimension types, and the number of samples of a curve over the whole turn.

    ``samples``: a power of two from 16 to 4,096.
    """

    types: TypeRule = field(default_factory=TypeRule)
    samples: int = 256

    def __post_init__(self) -> None:
        in_range = MIN_SAMPLES <= self.samples <= MAX_SAMPLES
        if not in_range or self.samples & (self.samples - 1):
            raise FieldError(
                "/samples", f"must be a power of two from {MIN_SAMPLES} to {MAX_SAMPLES}, found {self.samples}"
            )

    @classmethod
    def from_json(cls, values: Any) -> AtlasRule:
        """Read a rule from plain JSON values. Raises ValueError, KeyError or TypeError if they describe none."""
        if "kind" in values:
            raise ValueError(f"an atlas of kind {values['kind']!r}, not of four-bars")
        types = TypeRule(int(values["perimeter"]), int(values["smallest"]), OrderRule(values["order"]))
        return cls(types, int(values["samples"]))

    @classmethod
    def of(
        cls,
        perimeter: int | None = None,
        smallest: int | None = None,
        order: str | None = None,
        samples: int | None = None,
    ) -> AtlasRule:
        """Make a rule with the defaults for arguments that are None. Raises `FieldError`."""
        orders = [known.value for known in OrderRule]
        if order is not None and order not in orders:
            raise FieldError("/order", f"must be one of {', '.join(orders)}, found {order!r}")
        options: dict[str, Any] = {"perimeter": perimeter, "smallest": smallest, "order": order}
        types = TypeRule(**{name: value for name, value in options.items() if value is not None})
        return cls(types) if samples is None else cls(types, samples)

    @property
    def count(self) -> int:
        """Number of types."""
        return count_types(self.types)

    def lengths(self, begin: int = 0, end: int | None = None) -> NDArray[np.int32]:
        """Return the types of the rows from ``begin`` to ``end``, (types, 4)."""
        return enumerate_types(self.types, begin, end)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each array of `FEATURES`."""
        shapes: dict[str, tuple[int, ...]] = {name: (self.count,) for name in FEATURES}
        return shapes | {"lengths": (self.count, 4), "details": (self.count, self.samples - 1)}

    def as_json(self) -> dict[str, Any]:
        """Return the rule as plain JSON values."""
        own = {name: getattr(self.types, name) for name in ("perimeter", "smallest", "order")}
        return {**own, "samples": self.samples}


def content_hash(rule: AtlasRule, features: dict[str, NDArray[Any]]) -> str:
    """Compute the SHA-256 of the rule and the arrays of `FEATURES`: equal for equal content, however it is packed."""
    digest = hashlib.sha256(json.dumps(rule.as_json(), sort_keys=True).encode())
    for name, dtype in FEATURES.items():
        digest.update(np.ascontiguousarray(features[name], dtype=dtype).data)
    return digest.hexdigest()
