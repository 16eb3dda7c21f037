"""Parts as a STEP file (ISO 10303-21, AP214): exact planes and cylinders, named and coloured, placed in one assembly.

Each part is written in its own frame and placed by a NEXT_ASSEMBLY_USAGE_OCCURRENCE. Holes and pins are whole cylinders with a
single seam, so that a CAD program offers their axes and edges. STEP does not transfer joints: see docs/export.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from synthesis.solids.prism import Prism, Side
from synthesis.solids.solid import Posed, Solid

UNCERTAINTY = 1e-7
"""Distance in millimetres within which points coincide."""
Triple = tuple[float, float, float]
_UP = (0.0, 0.0, 1.0)
_DOWN = (0.0, 0.0, -1.0)
_EAST = (1.0, 0.0, 0.0)


def to_step(parts: Sequence[Solid], poses: Sequence[Posed], name: str) -> str:
    """Write an assembly in millimetres with a product for each part.

    ``poses`` contains the pose of each part's frame.
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
    frames = [data.frame((shift.real, shift.imag, up), (turn.real, turn.imag, 0.0)) for turn, shift, up in poses]
    assembly, shape_property = data.product(name, contexts)
    whole_shape = data.add(f"SHAPE_REPRESENTATION({quoted(name)},{_list([origin, *frames])},{units})")
    data.add(f"SHAPE_DEFINITION_REPRESENTATION({shape_property},{whole_shape})")
    styled = []
    for number, (part, frame) in enumerate(zip(parts, frames, strict=True), 1):
        product, definition = data.product(part.name, contexts, part.material)
        own = data.frame((0.0, 0.0, 0.0))
        solid = data.solid(part.prism, part.name)
        shape = data.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION({quoted(part.name)},{_list([own, solid])},{units})")
        data.add(f"SHAPE_DEFINITION_REPRESENTATION({definition},{shape})")
        data.add_instance(number, part.name, (assembly, whole_shape, origin), (product, shape, own), frame)
        styled.append(data.coloured(solid, part.colour))
    data.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{_list(styled)},{units})")
    return data.text(name)


def quoted(words: str) -> str:
    """Encode a string for Part 21: double apostrophes and backslashes, write other than ASCII characters in UTF-16."""
    out = []
    for sign in words:
        if " " <= sign <= "~":
            out.append(sign * 2 if sign in "'\\" else sign)
        else:
            code = sign.encode("utf-16-be", "replace").hex().upper()
            out.append(f"\\X2\\{code}\\X0\\")
    return "'" + "".join(out) + "'"


def real(value: float) -> str:
    """Encode a number for Part 21 with a decimal point and all digits."""
    digits, exponent, power = repr(float(value) + 0.0).partition("e")
    return (digits if "." in digits else digits + ".") + ("E" + power if exponent else "")


def _list(items: Iterable[str]) -> str:
    return "(" + ",".join(items) + ")"


def _triple(values: Iterable[float]) -> str:
    return _list(map(real, values))


class _Data:
    """Numbered entities of a file."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.directions: dict[Triple, str] = {}

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

    # -- products and units ---------------------------------------------------------------------------------------

    def units(self) -> str:
        length = self.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
        angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
        solid_angle = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
        uncertainty = self.add(
            f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({real(UNCERTAINTY)}),{length},'distance_accuracy_value','')"
        )
        return self.add(
            f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({uncertainty}))"
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid_angle}))REPRESENTATION_CONTEXT('',''))"
        )

    def product(self, name: str, contexts: tuple[str, str], words: str = "") -> tuple[str, str]:
        """Add a product. Return its definition and its shape property."""
        mechanical, design = contexts
        product = self.add(f"PRODUCT({quoted(name)},{quoted(name)},{quoted(words)},({mechanical}))")
        self.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))")
        formation = self.add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        definition = self.add(f"PRODUCT_DEFINITION('design','',{formation},{design})")
        return definition, self.add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")

    def add_instance(
        self, number: int, name: str, assembly: tuple[str, ...], part: tuple[str, ...], frame: str
    ) -> None:
        """Place a part in the assembly; both are given by definition, shape and frame."""
        use = self.add(
            f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{number}',{quoted(name)},{quoted(name)},{assembly[0]},{part[0]},$)"
        )
        used = self.add(f"PRODUCT_DEFINITION_SHAPE('','',{use})")
        transform = self.add(f"ITEM_DEFINED_TRANSFORMATION('','',{part[2]},{frame})")
        relation = self.add(
            f"(REPRESENTATION_RELATIONSHIP('','',{part[1]},{assembly[1]})"
            f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION({transform})SHAPE_REPRESENTATION_RELATIONSHIP())"
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

    def point(self, position: Triple) -> str:
        return self.add(f"CARTESIAN_POINT('',{_triple(position)})")

    def direction(self, direction: Triple) -> str:
        if direction not in self.directions:
            self.directions[direction] = self.add(f"DIRECTION('',{_triple(direction)})")
        return self.directions[direction]

    def frame(self, position: Triple, x: Triple = _EAST, z: Triple = _UP) -> str:
        return self.add(f"AXIS2_PLACEMENT_3D('',{self.point(position)},{self.direction(z)},{self.direction(x)})")

    def vertex(self, position: complex, height: float) -> str:
        return self.add(f"VERTEX_POINT('',{self.point((position.real, position.imag, height))})")

    def edge(self, first: str, last: str, curve: str) -> str:
        return self.add(f"EDGE_CURVE('',{first},{last},{curve},.T.)")

    def line(self, position: complex, height: float, direction: Triple) -> str:
        along = self.add(f"VECTOR('',{self.direction(direction)},1.)")
        return self.add(f"LINE('',{self.point((position.real, position.imag, height))},{along})")

    def bound(self, kind: str, edges: Iterable[tuple[str, bool]]) -> str:
        oriented = [self.add(f"ORIENTED_EDGE('',*,*,{edge},{'.T.' if on else '.F.'})") for edge, on in edges]
        loop = self.add(f"EDGE_LOOP('',{_list(oriented)})")
        return self.add(f"{kind}('',{loop},.T.)")

    def face(self, bounds: Iterable[str], surface: str, outward: bool = True) -> str:
        return self.add(f"ADVANCED_FACE('',{_list(bounds)},{surface},{'.T.' if outward else '.F.'})")

    def plane(self, position: Triple, x: Triple, normal: Triple) -> str:
        return self.add(f"PLANE('',{self.frame(position, x, normal)})")

    def cylinder(self, centre: complex, radius: float) -> str:
        return self.add(f"CYLINDRICAL_SURFACE('',{self.frame((centre.real, centre.imag, 0.0))},{real(radius)})")

    def solid(self, prism: Prism, name: str) -> str:
        faces: list[str] = []
        # edges of each contour, below and above; at the top the part lies to the left
        contours = [self.around(sides, prism.height, faces) for sides in prism.contours]
        for end, normal, height in ((0, _DOWN, 0.0), (1, _UP, prism.height)):
            bounds = []
            for k, contour in enumerate(contours):
                edges = [(edge, bool(end)) for edge in (contour[end] if end else contour[end][::-1])]
                bounds.append(self.bound("FACE_BOUND" if k else "FACE_OUTER_BOUND", edges))
            faces.append(self.face(bounds, self.plane((0.0, 0.0, height), _EAST, normal)))
        shell = self.add(f"CLOSED_SHELL('',{_list(faces)})")
        return self.add(f"MANIFOLD_SOLID_BREP({quoted(name)},{shell})")

    def around(self, sides: Sequence[Side], tall: float, faces: list[str]) -> tuple[list[str], list[str]]:
        """Add the faces along a contour. Return its edges, below and above.

        A circle is a single cylinder with a seam.
        """
        heights = (0.0, tall)
        corners = [[self.vertex(side.start, height) for side in sides] for height in heights]
        uprights = [
            self.edge(corners[0][k], corners[1][k], self.line(side.start, 0.0, _UP)) for k, side in enumerate(sides)
        ]
        edges: tuple[list[str], list[str]] = ([], [])
        for k, (start, arc) in enumerate(sides):
            after = (k + 1) % len(sides)
            if arc is None:
                direction = sides[after].start - start
                direction /= abs(direction)
                along = (direction.real, direction.imag, 0.0)
                surface = self.plane((start.real, start.imag, 0.0), along, (direction.imag, -direction.real, 0.0))
            else:
                surface = self.cylinder(arc.centre, arc.radius)
            for end, height in enumerate(heights):
                if arc is None:
                    curve = self.line(start, height, along)
                else:
                    # a circle runs counter-clockwise about its axis, which is reversed for a hole
                    axis = _UP if arc.angle > 0 else _DOWN
                    frame = self.frame((arc.centre.real, arc.centre.imag, height), z=axis)
                    curve = self.add(f"CIRCLE('',{frame},{real(arc.radius)})")
                edges[end].append(self.edge(corners[end][k], corners[end][after], curve))
            loop = [(edges[0][k], True), (uprights[after], True), (edges[1][k], False), (uprights[k], False)]
            faces.append(self.face([self.bound("FACE_OUTER_BOUND", loop)], surface, arc is None or arc.angle > 0))
        return edges
