"""Linkages take arrays of any shape, and lengths that cannot be assembled are refused.

This catches an error inside numpy for a table of crank angles, and a linkage all of whose joints are NaN.
"""

import numpy as np
import pytest

import linkage_atlas as la

CRANK = {"guide": "circle", "pivot": [0, 0], "radius": 1, "body_point": [0, 0]}
RAIL = {"guide": "rail", "point": [0, 0.3], "direction": 0, "body_point": [2, 0]}


@pytest.mark.parametrize(
    "linkage",
    [la.FourBar(19, 72, 144, 165, coupler_point=(20, 60)), la.GuidedLinkage([CRANK, RAIL], "crank")],
    ids=["four_bar", "guided"],
)
def test_joints_have_the_shape_of_the_crank_angles(linkage) -> None:
    turned = np.linspace(0, 350, 24)
    flat = linkage.joints(turned)
    for shape in ((4, 6), (2, 3, 4), (24, 1)):
        found = linkage.joints(turned.reshape(shape))
        assert found.rotation.shape == found.transmission_angle.shape == shape
        assert found.body_point.shape == (*shape, 2)
        assert np.array_equal(found.rotation.ravel(), flat.rotation, equal_nan=True)
        assert np.array_equal(found.body_point.reshape(-1, 2), flat.body_point, equal_nan=True)
    assert linkage.joints(5).rotation.shape == (1,)


@pytest.mark.parametrize(
    ("lengths", "longest"), [((1, 2, 3, 100), "ground"), ((7, 2, 3, 1), "crank"), ((1, 1, 3.5, 1), "rocker")]
)
def test_lengths_that_cannot_be_assembled_are_refused(lengths, longest) -> None:
    with pytest.raises(la.FieldError, match=f"{longest}: the linkage cannot be assembled: {longest}"):
        la.FourBar(*lengths)


def test_lengths_that_lie_flat_are_a_linkage() -> None:
    assert la.FourBar(1, 2, 3, 6).family
