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
    [la.FourBar(19, 72, 144, 165, coupler_point_polar=(20, 60)), la.Linkage([CRANK, RAIL], "crank")],
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
    with pytest.raises(la.FieldError, match=f"{longest}: the linkage cannot be assembled; {longest}"):
        la.FourBar(*lengths)


def test_lengths_that_lie_flat_are_a_linkage() -> None:
    assert la.FourBar(1, 2, 3, 6).family


@pytest.mark.parametrize("branch", [1, -1])
def test_a_linkage_from_its_joints_is_the_one_that_they_belong_to(branch) -> None:
    known = la.FourBar(
        19,
        72,
        144,
        165,
        branch,
        start_angle=30,
        pivot_a=(7, -3),
        ground_angle=200,
        coupler_point_polar=(40, 65),
        body_offset=12,
    )
    at = known.joints(0)
    points = at.pivot_a, at.crank_pin[0], at.coupler_pin[0], at.pivot_b, at.body_point[0]
    found = la.Linkage.from_points(*points, rotation=at.rotation[0])
    turned = np.linspace(0, 360, 37)
    for first, second in zip(found.joints(turned), known.joints(turned)):
        difference = np.asarray(first) - second
        assert np.abs(difference - 360 * np.round(difference / 360)).max() < 1e-9
    assert found.family == known.family and found.branch == branch
    with pytest.raises(la.FieldError, match="C: must differ from D"):
        la.Linkage.from_points((0, 0), (1, 0), (1, 0), (3, 0))


def test_a_slider_crank_follows_its_closed_form() -> None:
    crank, rod, offset, turn = 20.0, 70.0, 5.0, np.deg2rad(25)
    turned = np.linspace(0, 360, 37)
    for branch in (1, -1):
        linkage = la.SliderCrank(crank, rod, offset, branch, pivot=(3, 4), rail_angle=25)
        angle = np.deg2rad(turned)
        along = crank * np.cos(angle) + branch * np.sqrt(rod**2 - (offset - crank * np.sin(angle)) ** 2)
        position = 3 + 4j + (along + 1j * offset) * np.exp(1j * turn)
        assert np.abs(linkage.joints(turned).coupler_pin @ [1, 1j] - position).max() < 1e-9
        assert linkage.crank == crank and linkage.kind == "slider_crank"
    with pytest.raises(AttributeError, match="a slider_crank has no rocker"):
        _ = linkage.rocker
