"""Recognise the published example in an atlas file, with h5py and pywt alone.

``python docs/examples/atlas_and_wavelets.py [atlas.h5]``

The source (Sun, Liu, Chu) samples the rotation of a coupler at 16 crank angles from 30 to 100 degrees, computes its Haar
details, and recognises the types whose details differ least ("fuzzy recognition"). `linkage_atlas.match` computes the same
difference exactly.
"""

import sys

import h5py
import numpy as np
import pywt

CRANK = np.deg2rad(np.linspace(30, 100, 16))
ROWS_AT_ONCE = 8192


def details_of(curves: np.ndarray) -> np.ndarray:
    """Return Haar details, coarse to fine: (mean of first half - mean of second half) / 2 of each block."""
    samples = curves.shape[-1]
    levels = pywt.wavedec(curves, "haar", mode="periodization", axis=-1)[1:]
    blocks = [samples >> level for level in range(len(levels))]
    return np.concatenate([detail / np.sqrt(block) for detail, block in zip(levels, blocks)], axis=-1)


def curves_of(average: np.ndarray, details: np.ndarray, winding: np.ndarray, crank: np.ndarray) -> np.ndarray:
    """Return stored curves at other crank angles: inverse Haar transform, then Fourier interpolation."""
    samples = details.shape[-1] + 1
    parts = [average[:, None] * np.sqrt(samples)]
    for level in range(samples.bit_length() - 1):
        parts.append(details[:, 2**level - 1 : 2 ** (level + 1) - 1] * np.sqrt(samples >> level))
    whole_turn = pywt.waverec(parts, "haar", mode="periodization", axis=-1)
    spectrum = np.fft.rfft(whole_turn, axis=-1) / samples
    waves = np.exp(1j * np.outer(np.arange(1, samples // 2), crank))
    return spectrum[:, :1].real + 2 * (spectrum[:, 1:-1] @ waves).real + winding[:, None] * crank


def main(path: str = "atlas.h5") -> None:
    """Print the details of the published type, and the ten types whose details differ least from them."""
    with h5py.File(path) as file:
        lengths = file["lengths"][...]
        published = int(np.flatnonzero((lengths == [19, 72, 144, 165]).all(axis=1))[0])
        own = [file[name][published : published + 1] for name in ("average", "details", "winding")]
        curve = curves_of(*own, CRANK)
        request = details_of(curve)[0]
        print(
            f"type {published + 1}: average {curve.mean():.4f}, details",
            " ".join(f"{value:.4f}" for value in request[:7]),
        )

        differences = []
        for first in range(0, len(lengths), ROWS_AT_ONCE):
            rows = slice(first, first + ROWS_AT_ONCE)
            curves = curves_of(file["average"][rows], file["details"][rows], file["winding"][rows], CRANK)
            differences.append(np.linalg.norm(details_of(curves) - request, axis=1))
    difference = np.concatenate(differences)
    print("recognised, all at the start 30 degrees and on branch +1:")
    for row in np.argsort(difference, kind="stable")[:10]:
        print(f"  type {row + 1:6d}  {lengths[row]}  difference of details {difference[row]:.2e}")


if __name__ == "__main__":
    main(*sys.argv[1:])
