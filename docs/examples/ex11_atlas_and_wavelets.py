"""
11. Read the atlas with h5py and pywt
=====================================

The atlas file stores the coupler rotation of 101,408 four-bars as Haar wavelet details.
This script reads it with h5py and pywt only.
It then repeats the "fuzzy recognition" of the paper: it selects the types whose details differ least from the requested details.
Each detail is weighted by the length of its block, so that the difference is the rms error of the rotation.
`linkage_atlas.match` computes the same difference over all starts and both branches.
"""

import sys

import h5py
import matplotlib.pyplot as plt
import numpy as np
import pywt

from linkage_atlas.atlases import find_atlas

CRANK = np.deg2rad(np.linspace(30, 100, 16))
ROWS_AT_ONCE = 8192


def details_of(curves: np.ndarray) -> np.ndarray:
    """Return Haar details, coarse to fine: (mean of first half - mean of second half) / 2 of each block."""
    samples = curves.shape[-1]
    levels = pywt.wavedec(curves, "haar", mode="periodization", axis=-1)[1:]
    blocks = [samples >> level for level in range(len(levels))]
    return np.concatenate([detail / np.sqrt(block) for detail, block in zip(levels, blocks)], axis=-1)


def difference_of(details: np.ndarray, request: np.ndarray) -> np.ndarray:
    """Return the rms difference of curves in radians after the best constant offset, from their details."""
    samples = len(request) + 1
    lengths = np.concatenate([np.full(2**level, samples >> level) for level in range(samples.bit_length() - 1)])
    return np.sqrt((details - request) ** 2 @ lengths / samples)


def curves_of(average: np.ndarray, details: np.ndarray, winding: np.ndarray, crank: np.ndarray) -> np.ndarray:
    """Return stored curves at other crank angles: inverse Haar transform, then Fourier interpolation."""
    samples = details.shape[-1] + 1
    coefficients = [average[:, None] * np.sqrt(samples)]
    for level in range(samples.bit_length() - 1):
        coefficients.append(details[:, 2**level - 1 : 2 ** (level + 1) - 1] * np.sqrt(samples >> level))
    whole_turn = pywt.waverec(coefficients, "haar", mode="periodization", axis=-1)
    spectrum = np.fft.rfft(whole_turn, axis=-1) / samples
    waves = np.exp(1j * np.outer(np.arange(1, samples // 2), crank))
    return spectrum[:, :1].real + 2 * (spectrum[:, 1:-1] @ waves).real + winding[:, None] * crank


# %%
# The source samples the rotation of a coupler at 16 crank angles from 30 to 100 degrees.
# The default atlas is built in the cache folder of the user if there is none.
path = sys.argv[1] if len(sys.argv) > 1 else find_atlas(jobs=1)
with h5py.File(path) as file:
    lengths = file["lengths"][...]
    published = int(np.flatnonzero((lengths == [19, 72, 144, 165]).all(axis=1))[0])
    row = [file[name][published : published + 1] for name in ("average", "details", "winding")]
    curve = curves_of(*row, CRANK)
    request = details_of(curve)[0]
    print(
        f"type {published + 1}: average {curve.mean():.4f}, details",
        " ".join(f"{value:.4f}" for value in request[:7]),
    )

    differences = []
    for first in range(0, len(lengths), ROWS_AT_ONCE):
        rows = slice(first, first + ROWS_AT_ONCE)
        curves = curves_of(file["average"][rows], file["details"][rows], file["winding"][rows], CRANK)
        differences.append(difference_of(details_of(curves), request))

# %%
# Ten types whose details differ least, all at the start 30 degrees and on branch +1:
difference = np.concatenate(differences)
best = np.argsort(difference, kind="stable")[:10]
for number in best:
    print(f"  type {number + 1:6d}  {lengths[number]}  rms {difference[number]:.2e} rad")
assert best[0] == published

figure, ax = plt.subplots()
ax.hist(np.log10(difference[difference > 0]), bins=80)
ax.set(xlabel="log10 of the rms difference in rad", ylabel="number of types")
