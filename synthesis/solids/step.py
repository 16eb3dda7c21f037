"""Parts as a STEP file (ISO 10303-21, AP214): exact planes and cylinders, named and coloured, placed in one assembly.

A part is written in its own frame and placed by a NEXT_ASSEMBLY_USAGE_OCCURRENCE. A hole, and a pin, is one cylinder with one
seam, so a CAD program offers its axis and its edges as a whole. Joints do not travel in STEP: see docs/export.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from synthesis.solids.prism import Hole, Prism
from synthesis.solids.solid import Posed, Solid

UNCERTAINTY = 1e-7
"""Millimetres within which points of the file are one point."""
_UP = (0.0, 0.0, 1.0)
_DOWN = (0.0, 0.0, -1.0)
_EAST = (1.0, 0.0, 0.0)
_ENDS = ((0, _DOWN), (1, _UP))


def to_step(parts: Sequence[Solid], places: Sequence[Posed], name: str) -> str:
    """The file: an assembly of that name, a product a part; lengths in millimetres.

    ``places``: where the frames of the parts stand.

    Law: reopened, every part has its name and colour, its exact volume, and its holes where they are.
    """
    data = _Data()
    units = data.units()
    application = data.add("APPLICATION_CONTEXT('core data for automotive mechanical design processes')")
    data.add("APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000," + application + ")")
    contexts = (
        data.add(f"PRODUCT_CONTEXT('',{application},'mechanical')"),
        data.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')"),
    )
    origin = data.frame((0.0, 0.0, 0.0))
    frames = [data.frame((shift.real, shift.imag, up), (turn.real, turn.imag, 0.0)) for turn, shift, up in places]
    assembly, whole = data.product(name, contexts)
    whole_shape = data.add(f"SHAPE_REPRESENTATION({quoted(name)},{_list([origin, *frames])},{units})")
    data.add(f"SHAPE_DEFINITION_REPRESENTATION({whole},{whole_shape})")
    styled = []
    for number, (part, place) in enumerate(zip(parts, frames, strict=True), 1):
        product, definition = data.product(part.name, contexts, part.material)
        own = data.frame((0.0, 0.0, 0.0))
        solid = data.solid(part.prism, part.name)
        shape = data.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION({quoted(part.name)},{_list([own, solid])},{units})")
        data.add(f"SHAPE_DEFINITION_REPRESENTATION({definition},{shape})")
        data.place(number, part.name, (assembly, whole_shape, origin), (product, shape, own), place)
        styled.append(data.coloured(solid, part.colour))
    data.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{_list(styled)},{units})")
    return data.text(name)


def quoted(words: str) -> str:
    """A string as Part 21 writes it: apostrophes and backslashes doubled, what is not ASCII by its UTF-16 code."""
    out = []
    for sign in words:
        if " " <= sign <= "~":
            out.append(sign * 2 if sign in "'\\" else sign)
        else:
            code = sign.encode("utf-16-be", "replace").hex().upper()
            out.append(f"\\X2\\{code}\\X0\\")
    return "'" + "".join(out) + "'"


def real(value: float) -> str:
    """A number as Part 21 writes it: with a point, every digit kept."""
    digits, exponent, power = repr(float(value) + 0.0).partition("e")
    return (digits if "." in digits else digits + ".") + ("E" + power if exponent else "")


def _list(items: Iterable[str]) -> str:
    return "(" + ",".join(items) + ")"


def _triple(values: Iterable[float]) -> str:
    return _list(map(real, values))


class _Data:
    """The numbered entities of a file."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.directions: dict[tuple[float, float, float], str] = {}

    def add(self, entity: str) -> str:
        self.lines.append(entity)
        return f"#{len(self.lines)}"

    def text(self, name: str) -> str:
        body = "\n".join(f"#{number}={entity};" for number, entity in enumerate(self.lines, 1))
        return (
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
            f"FILE_NAME({quoted(name)},'',(''),(''),'linkage-atlas','linkage-atlas','');\n"
            "FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\nENDSEC;\n"
            f"DATA;\n{body}\nENDSEC;\nEND-ISO-10303-21;\n"
        )

    # -- what the file is about ---------------------------------------------------------------------------------------

    def units(self) -> str:
        length = self.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
        angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
        solid_angle = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
        near = self.add(
            f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({real(UNCERTAINTY)}),{length},'distance_accuracy_value','')"
        )
        return self.add(
            f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({near}))"
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid_angle}))REPRESENTATION_CONTEXT('',''))"
        )

    def product(self, name: str, contexts: tuple[str, str], words: str = "") -> tuple[str, str]:
        """A product: its definition, and the property that its shape is."""
        mechanical, design = contexts
        product = self.add(f"PRODUCT({quoted(name)},{quoted(name)},{quoted(words)},({mechanical}))")
        self.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))")
        formation = self.add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        definition = self.add(f"PRODUCT_DEFINITION('design','',{formation},{design})")
        return definition, self.add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")

    def place(self, number: int, name: str, whole: tuple[str, ...], part: tuple[str, ...], place: str) -> None:
        """A part in the assembly: both by definition, shape and frame."""
        use = self.add(
            f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{number}',{quoted(name)},{quoted(name)},{whole[0]},{part[0]},$)"
        )
        used = self.add(f"PRODUCT_DEFINITION_SHAPE('','',{use})")
        way = self.add(f"ITEM_DEFINED_TRANSFORMATION('','',{part[2]},{place})")
        relation = self.add(
            f"(REPRESENTATION_RELATIONSHIP('','',{part[1]},{whole[1]})"
            f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION({way})SHAPE_REPRESENTATION_RELATIONSHIP())"
        )
        self.add(f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION({relation},{used})")

    def coloured(self, solid: str, colour: str) -> str:
        parts = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
        rgb = self.add(f"COLOUR_RGB('',{','.join(map(real, parts))})")
        fill = self.add(f"FILL_AREA_STYLE_COLOUR('',{rgb})")
        fill = self.add(f"FILL_AREA_STYLE('',({fill}))")
        fill = self.add(f"SURFACE_STYLE_FILL_AREA({fill})")
        side = self.add(f"SURFACE_SIDE_STYLE('',({fill}))")
        side = self.add(f"SURFACE_STYLE_USAGE(.BOTH.,{side})")
        style = self.add(f"PRESENTATION_STYLE_ASSIGNMENT(({side}))")
        return self.add(f"STYLED_ITEM('',({style}),{solid})")

    # -- geometry -----------------------------------------------------------------------------------------------------

    def point(self, place: tuple[float, float, float]) -> str:
        return self.add(f"CARTESIAN_POINT('',{_triple(place)})")

    def direction(self, way: tuple[float, float, float]) -> str:
        if way not in self.directions:
            self.directions[way] = self.add(f"DIRECTION('',{_triple(way)})")
        return self.directions[way]

    def frame(
        self,
        place: tuple[float, float, float],
        x: tuple[float, float, float] = _EAST,
        z: tuple[float, float, float] = _UP,
    ) -> str:
        return self.add(
            f"AXIS2_PLACEMENT_3D('',{self.point(place)},{self.direction(z)},{self.direction(x)})",
        )

    def vertex(self, place: complex, height: float) -> str:
        return self.add(f"VERTEX_POINT('',{self.point((place.real, place.imag, height))})")

    def edge(self, first: str, last: str, curve: str) -> str:
        return self.add(f"EDGE_CURVE('',{first},{last},{curve},.T.)")

    def line(self, place: complex, height: float, way: tuple[float, float, float]) -> str:
        along = self.add(f"VECTOR('',{self.direction(way)},1.)")
        return self.add(f"LINE('',{self.point((place.real, place.imag, height))},{along})")

    def bound(self, kind: str, edges: Iterable[tuple[str, bool]]) -> str:
        ways = [self.add(f"ORIENTED_EDGE('',*,*,{edge},{'.T.' if on else '.F.'})") for edge, on in edges]
        loop = self.add(f"EDGE_LOOP('',{_list(ways)})")
        return self.add(f"{kind}('',{loop},.T.)")

    def face(self, bounds: Iterable[str], surface: str, outward: bool = True) -> str:
        return self.add(f"ADVANCED_FACE('',{_list(bounds)},{surface},{'.T.' if outward else '.F.'})")

    def plane(
        self, place: tuple[float, float, float], x: tuple[float, float, float], normal: tuple[float, float, float]
    ) -> str:
        return self.add(f"PLANE('',{self.frame(place, x, normal)})")

    def cylinder(self, centre: complex, radius: float, low: float) -> str:
        return self.add(f"CYLINDRICAL_SURFACE('',{self.frame((centre.real, centre.imag, low))},{real(radius)})")

    def solid(self, prism: Prism, name: str) -> str:
        faces: list[str] = []
        # edges of each contour below and above, along their faces: the part lies to the left above
        contours: list[tuple[tuple[list[str], list[str]], bool]] = []
        for circle in (prism.circle, *prism.holes):
            if circle is None:
                contours.append((self.sides(prism, faces), True))
            elif circle.reach:
                slit = Prism(circle.outline, prism.low, prism.high)
                contours.append((self.sides(slit, faces), True))
            else:
                hollow = circle is not prism.circle
                ends, face = self.round(circle, prism, hollow)
                faces.append(face)
                contours.append((([ends[0]], [ends[1]]), not hollow))
        heights = (prism.low, prism.high)
        for end, normal in _ENDS:
            bounds = []
            for k, (contour, along) in enumerate(contours):
                edges = contour[end] if end else contour[end][::-1]
                bounds.append(
                    self.bound(
                        "FACE_BOUND" if k else "FACE_OUTER_BOUND", [(edge, bool(end) == along) for edge in edges]
                    )
                )
            faces.append(self.face(bounds, self.plane((0.0, 0.0, heights[end]), _EAST, normal)))
        shell = self.add(f"CLOSED_SHELL('',{_list(faces)})")
        return self.add(f"MANIFOLD_SOLID_BREP({quoted(name)},{shell})")

    def round(self, circle: Hole, prism: Prism, hollow: bool) -> tuple[tuple[str, str], str]:
        """A whole cylinder: its two circles, below and above, and its face."""
        east = circle.centre + circle.radius
        heights = (prism.low, prism.high)
        corners = [self.vertex(east, height) for height in heights]
        frames = [self.frame((circle.centre.real, circle.centre.imag, height)) for height in heights]
        below, above = (
            self.edge(corner, corner, self.add(f"CIRCLE('',{frame},{real(circle.radius)})"))
            for corner, frame in zip(corners, frames, strict=True)
        )
        seam = self.edge(corners[0], corners[1], self.line(east, prism.low, _UP))
        loop = [(below, not hollow), (seam, True), (above, hollow), (seam, False)]
        surface = self.cylinder(circle.centre, circle.radius, prism.low)
        return (below, above), self.face([self.bound("FACE_OUTER_BOUND", loop)], surface, not hollow)

    def sides(self, prism: Prism, faces: list[str]) -> tuple[list[str], list[str]]:
        """The faces around an outline; returns its edges, below and above."""
        heights = (prism.low, prism.high)
        places = [complex(corner) for corner in prism.corners]
        corners = [[self.vertex(place, height) for place in places] for height in heights]
        uprights = [
            self.edge(corners[0][k], corners[1][k], self.line(place, prism.low, _UP))
            for k, place in enumerate(places)
        ]
        edges: tuple[list[str], list[str]] = ([], [])
        for k, (place, arc) in enumerate(zip(places, prism.arcs, strict=True)):
            after = (k + 1) % len(places)
            way = places[after] - place
            way /= abs(way)
            along = (way.real, way.imag, 0.0)
            for end, height in enumerate(heights):
                if arc is None:
                    curve = self.line(place, height, along)
                else:
                    # a circle runs counter-clockwise about its axis, which is turned over for the arc of a hollow
                    axis = _UP if arc.angle > 0 else _DOWN
                    frame = self.frame((arc.centre.real, arc.centre.imag, height), z=axis)
                    curve = self.add(f"CIRCLE('',{frame},{real(arc.radius)})")
                edges[end].append(self.edge(corners[end][k], corners[end][after], curve))
            if arc is None:
                normal = (way.imag, -way.real, 0.0)
                surface = self.plane((place.real, place.imag, prism.low), along, normal)
            else:
                surface = self.cylinder(arc.centre, arc.radius, prism.low)
            loop = [(edges[0][k], True), (uprights[after], True), (edges[1][k], False), (uprights[k], False)]
            faces.append(self.face([self.bound("FACE_OUTER_BOUND", loop)], surface, arc is None or arc.angle > 0))
        return edges
