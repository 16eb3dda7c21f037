"""Haar features agree with explicit block means.

A wrong order or scale of the details would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.atlas import haar
from tests.oracles import naive
from tests.oracles.conditions import feature_distance

laws = settings(derandomize=True, max_examples=40, deadline=None)
curves = st.builds(
    lambda j, seed, size: np.random.default_rng(seed).normal(scale=size, size=2**j),
    st.integers(1, 9),
    st.integers(0, 2**32),
    st.sampled_from([1e-9, 1.0, 1e9]),
)


@laws
@given(curves)
def test_features_are_block_means(curve) -> None:
    average, details = haar.features(curve)
    plain_average, plain_details = naive.haar(curve)
    size = np.abs(curve).max()
    assert average == pytest.approx(plain_average, abs=1e-14 * size)
    assert np.allclose(details, plain_details, rtol=0, atol=1e-14 * size)


@laws
@given(curves)
def test_inverse_gives_the_curve_back(curve) -> None:
    back = haar.curve_from_features(*haar.features(curve))
    assert np.allclose(back, curve, rtol=0, atol=1e-14 * np.abs(curve).max())


@laws
@given(curves, st.floats(-10, 10))
def test_the_distance_of_features_is_the_rms_after_the_best_offset(curve, constant) -> None:
    second = constant + np.cos(np.arange(curve.size)) * np.abs(curve).max()
    roots = haar.block_roots(curve.size)
    found = feature_distance(*(roots * haar.features(values)[1] for values in (curve, second)))
    assert found == pytest.approx(np.std(curve - second), rel=1e-9)


@pytest.mark.parametrize("samples", [3, 5, 8, 16, 33])
@pytest.mark.parametrize("sign", [1, -1])
def test_resampling_keeps_cubics(samples, sign) -> None:
    uneven = sign * np.cumsum(np.random.default_rng(samples).uniform(0.5, 1.5, samples))
    cubics = np.array([uneven**power for power in range(4 if samples > 3 else 3)])
    even, curve = haar.resample(uneven, cubics)
    size = 2 ** int(np.ceil(np.log2(samples)))
    assert even.size == size and curve.shape == (len(cubics), size)
    assert even[[0, -1]] == pytest.approx(uneven[[0, -1]])
    for power, row in enumerate(curve):
        assert row == pytest.approx(even**power, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("samples", [0, 1, 3, 12])
def test_lengths_that_are_no_power_of_two_are_refused(samples) -> None:
    with pytest.raises(ValueError, match=f"samples: wanted a power of two .* found {samples}"):
        haar.features(np.zeros(samples))
