"""STEP files have closed shells, and Open CASCADE reads back the same parts.

A face that is turned over, or a lost hole, would show here.
"""

import re

import numpy as np
import pytest

from synthesis.assembly.shapes import Shape, disc
from synthesis.solids.prism import Prism
from synthesis.solids.solid import Posed, Solid
from synthesis.solids.step import to_step
from tests.oracles.solids import built, step_shells
from tests.synthesis.solids.test_solid import CASES as ARRANGED

CASES = [*ARRANGED, ("E2", "both", True, ()), ("E4", "below", False, ())]
ODD = [Solid("Bügel – 'L' \\ 漢 𝄞", "plate", 0, "ground", Prism.disc(5, 3, 2), 0j, 0.0, "steel", "#2563eb")]
SLITTED = Prism(Shape((0j, 70 + 0j, 30 + 40j), 14), 1.5, (Shape((23 - 3j, 47 + 7j), 3.0), disc(0j, 3.0)))


@pytest.mark.parametrize(("name", "boards", "heads", "body"), CASES)
def test_every_solid_is_a_closed_shell_with_its_holes(name, boards, heads, body) -> None:
    solids = built(name, boards, heads, "print", body)
    text = to_step(solids.parts, solids.posed(), "linkage")
    shells = step_shells(text)
    assert [shell["name"] for shell in shells] == [part.name for part in solids.parts]
    for shell, part in zip(shells, solids.parts):
        assert shell["closed"], part.name
        # a seam runs through each hole, so that its cylinder is a single face: Euler and Poincare's 2 (1 - holes)
        assert shell["euler"] == 2 - 2 * len(part.prism.holes), part.name
    assert text.count("NEXT_ASSEMBLY_USAGE_OCCURRENCE(") == len(solids.parts)
    assert text.count("STYLED_ITEM(") == len(solids.parts)
    prisms = [part.prism for part in solids.parts]
    arcs = [arc for prism in prisms for sides in prism.contours for _, arc in sides if arc is not None]
    assert text.count("CYLINDRICAL_SURFACE(") == len(arcs)
    # only the walls of holes are turned over: their axis lies outside of the material
    turned = re.findall(r"=ADVANCED_FACE\('',\([#\d,]+\),#(\d+),\.F\.\);", text)
    assert len(turned) == sum(len(part.prism.holes) for part in solids.parts)
    for surface in turned:
        assert re.search(rf"^#{surface}=CYLINDRICAL_SURFACE\(", text, re.M)
    assert text == to_step(solids.parts, solids.posed(), "linkage")


# -- reopened ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def occt():
    pytest.importorskip("OCP", reason="the extra [solids] is not installed")
    from tests.oracles import occt

    return occt


def check(found, part: Solid, position: Posed) -> None:
    prism = part.prism
    assert found.valid and found.solids == 1
    assert found.volume == pytest.approx(prism.volume, rel=1e-12)
    middle = prism.moments.centre * position.turn + position.shift
    expected = (middle.real, middle.imag, position.up + prism.height / 2)
    assert found.centre == pytest.approx(expected, abs=1e-9)
    assert found.heights == pytest.approx((position.up, position.up + prism.height), abs=1e-6)
    holes = [_seen(hole, position) for hole in prism.holes if len(hole.core) == 1]
    ends = [
        _seen(disc(end, hole.radius), position) for hole in prism.holes if len(hole.core) > 1 for end in hole.core
    ]
    for expected, reported in ((holes, found.holes), (ends, found.halves)):
        reported, expected = (np.array(sorted(circles)).reshape(-1, 3) for circles in (reported, expected))
        assert reported == pytest.approx(expected, abs=1e-9)
    rounds = [] if prism.diameter is None else [_seen(prism.shape, position)]
    assert np.array(found.rounds).reshape(-1, 3) == pytest.approx(np.array(rounds).reshape(-1, 3), abs=1e-9)
    # Open CASCADE keeps colours as light, files have them as a screen does
    shown = [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in found.colour]
    assert shown == pytest.approx([int(part.colour[k : k + 2], 16) / 255 for k in (1, 3, 5)], abs=1e-3)


def _seen(hole: Shape, position: Posed) -> tuple[float, float, float]:
    centre = hole.core[0] * position.turn + position.shift
    return centre.real, centre.imag, 2 * hole.radius


def test_reopened_odd_names_and_hollows(occt, tmp_path) -> None:
    parts = [*ODD, Solid("hollow", "plate", 0, "ground", SLITTED, 0j, 0.0, "steel", "#000000")]
    positions = [Posed(1 + 0j, 0j, 0.0), Posed(np.exp(1j), 3 + 9j, -7.0)]
    title, found = occt.reopened(to_step(parts, positions, "Fenster – groß"), tmp_path)
    assert title == "Fenster – groß"
    assert [part.name for part in found] == [part.name for part in parts]
    for reopened, part, position in zip(found, parts, positions, strict=True):
        check(reopened, part, position)
