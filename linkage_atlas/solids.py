"""Solid parts of a linkage: materials, masses, and files for CAD and printers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from linkage_atlas.arguments import Fields, check_names, flag, millimetres_in, one_of, read_fields
from linkage_atlas.assemblies import ASSEMBLY, Assembly, assembled, read_assembly
from linkage_atlas.formats import OF_PARTS, kind_of
from linkage_atlas.records import PYTHON_ONLY, Record, xy
from synthesis.assembly.parts import Heights
from synthesis.errors import FieldError
from synthesis.link_motion import Mass
from synthesis.linkage import Linkage
from synthesis.sheet import csv_text
from synthesis.solids.solid import DENSITIES, FITS, Fit, Manufacture, Solids, masses_of_links, parts_list, solids_of
from synthesis.target import Interval
from synthesis.work import Work

SOLIDS: dict[str, Callable[[str, Any], Any]] = {
    "fit": partial(one_of, known=FITS),
    **dict.fromkeys(("material", "pins"), partial(one_of, known=DENSITIES)),
    "layout": partial(one_of, known=("assembled", "bed")),
    "allow_collisions": flag,
}
"""Fields of a request for solids, with the functions that check them."""
MATERIALS = {"H7": ("aluminium", "steel"), "print": ("PLA", "PLA")}
"""Default materials of plates and pins, by fit."""
LEAST_MM, LARGEST_MM = 0.01, 1e6
"""Smallest pin and largest plate, in millimetres, that readers of the files can represent."""
NAME = "linkage"


class AskedSolids(NamedTuple):
    """Checked request for solids."""

    fit: Fit
    material: str
    pins: str
    layout: str | None = None
    allow_collisions: bool = False


def read_solids(request: Fields | None, where: str = "solids/") -> AskedSolids:
    """Check a request for solids, a mapping with some of `SOLIDS`; ``where``: path of the fields in error messages."""
    read = read_fields(where, {} if request is None else request, SOLIDS)
    fit = read.pop("fit", "H7")
    plates, pins = MATERIALS[fit]
    return AskedSolids(FITS[fit], **{"material": plates, "pins": pins, **read})


class Weight(NamedTuple):
    """Mass of a moving link with everything that it carries, as an argument of `Linkage.analysis`; it is not scaled."""

    link: str
    mass: float
    """Mass in kilograms."""
    centre: tuple[float, float]
    """Centre of mass in the frame of the link, in the unit of the lengths."""
    inertia: float
    """Moment of inertia about the centre, in kilograms times the unit of length squared."""

    def as_mass(self) -> Mass:
        """Return the mass for the numerics."""
        return Mass(self.link, self.mass, complex(*self.centre), self.inertia)


class Wall(NamedTuple):
    """Thinnest wall of all parts, over thicknesses and walls around holes; necks of a body's outline are not considered."""

    value: float
    """Thickness in millimetres."""
    part: str


@dataclass(frozen=True)
class SolidPart(Record):
    """Part as it is made, in millimetres and kilograms."""

    name: str
    kind: Annotated[str, Literal["plate", "pin", "post", "head", "board", "washer"]]
    link: str
    """Link that carries the part."""
    material: str
    volume: float
    mass: float
    centre: tuple[float, float, float]
    """Centre of mass in the frame of its link; z is measured from the lower face of layer 1."""


@dataclass(frozen=True)
class SolidParts(Record):
    """Parts of a linkage, in millimetres and kilograms.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> parts = la.FourBar(30, 60, 70, 50).solids(material="plywood", thickness=6)
    >>> [part.name for part in parts.parts][:4], len(parts.parts)
    (['crank', 'coupler', 'rocker', 'pin_A'], 16)
    >>> round(1000 * parts.mass, 1)  # grams
    11.7
    """

    fit: str
    scale: float
    parts: list[SolidPart]
    mass: float
    """Mass of all parts."""
    masses: list[Weight]
    """Masses of the moving links, for an analysis."""
    thinnest_wall: Wall
    solids: Solids = field(metadata=PYTHON_ONLY, repr=False)
    request: AskedSolids = field(metadata=PYTHON_ONLY, repr=False)
    assembly: Assembly = field(metadata=PYTHON_ONLY, repr=False)
    unit: float = field(metadata=PYTHON_ONLY, repr=False)
    """Millimetres in the unit of the linkage."""

    def file(self, kind: str) -> bytes:
        """Return the content of a file: step, 3mf, stl (a zip file), parts (CSV) or plates (DXF of all flat parts).

        By default parts in a 3MF file lie on the bed of the printer, and parts in a STEP file are assembled.
        """
        one_of("kind", kind, (*OF_PARTS, "plates"))
        solids, parts = self.solids, self.solids.parts
        if kind == "plates":
            from synthesis.solids.plates import to_plates

            return to_plates(solids, self.assembly.settings.kerf * self.unit).encode()
        if kind == "parts":
            columns = parts_list(solids, self.request.fit)
            if self.assembly.driven_hinge:
                row = {"name": "drive", "kind": "rotary drive", "link": self.assembly.driven_hinge}
                columns = {name: [*column, row.get(name)] for name, column in columns.items()}
            return csv_text(columns).encode()
        from synthesis.solids.mesh import on_bed, to_3mf, to_stl_zip

        if kind == "stl":
            return to_stl_zip(parts)
        on_print_bed = kind == "3mf" if self.request.layout is None else self.request.layout == "bed"
        poses = on_bed(parts) if on_print_bed else solids.posed()
        if kind == "3mf":
            return to_3mf(parts, poses, NAME)
        from synthesis.solids.step import to_step

        return to_step(parts, poses, NAME).encode("ascii")

    def save(self, path: str | Path) -> None:
        """Write a file of the kind of its ending: .step, .3mf, .stl.zip or .parts.csv."""
        path = Path(path)
        path.write_bytes(self.file(kind_of(path.name)))


def masses_of_parts(linkage: Linkage, used: Interval, length_unit: str) -> list[Weight]:
    """Return the masses of the moving links with parts of default sizes, even if parts collide."""
    assembly = assembled(linkage, read_assembly({"length_unit": length_unit}), used, 1.0, Work())
    return solids_in(assembly, read_solids({"allow_collisions": True}), length_unit).masses


def split(request: Fields) -> tuple[dict[str, object], dict[str, object]]:
    """Split arguments between an assembly and its solids."""
    check_names("", request, (*ASSEMBLY, *SOLIDS))
    of_assembly = {name: value for name, value in request.items() if name in ASSEMBLY}
    return of_assembly, {name: value for name, value in request.items() if name in SOLIDS}


def solids_in(assembly: Assembly, request: AskedSolids, length_unit: str) -> SolidParts:
    """Return the parts of an assembly, with the sizes that were checked for collisions.

    Raises `FieldError` if parts collide, unless the request sets ``allow_collisions``.
    """
    unit, settings, fit = millimetres_in(length_unit), assembly.settings, request.fit
    built = unit * settings.scale
    if assembly.status == "blocked" and not request.allow_collisions:
        why = "; ".join(list(dict.fromkeys(assembly.reasons))[:3])
        raise FieldError(
            "/assembly", f"parts would collide: {why}. Set `allow_collisions` in `solids` to write them anyway"
        )
    machine, stack = assembly.machine, assembly.arrangement.stack
    pin, plate = machine.hole * built, (machine.size + machine.width) * built
    if not (LEAST_MM <= pin and plate <= LARGEST_MM):
        raise FieldError(
            "/length_unit",
            f"must give pins of at least {LEAST_MM:g} mm and plates of at most {LARGEST_MM:g} mm, "
            f"found {pin:g} and {plate:g}",
        )
    # defaults are at least what a fit needs
    thickness, washer = assembly.sizes.thickness, assembly.sizes.washer
    heights = Heights(
        thickness if settings.thickness is not None else max(thickness, fit.plate / built),
        washer if settings.washer is not None else max(washer, fit.washer / built),
    )
    materials = Manufacture(fit, request.material, request.pins, heights)
    solids = solids_of(machine, stack, materials, built)
    full = solids if settings.scale == 1 else solids_of(machine, stack, materials, unit)
    parts = []
    for part in solids.parts:
        mass, centre = part.mass.mass, tuple(part.mass.centre.tolist())
        parts.append(SolidPart(part.name, part.kind, part.link, part.material, part.volume, mass, centre))
    return SolidParts(
        fit.name,
        settings.scale,
        parts,
        sum(part.mass for part in parts),
        [Weight(part.link, part.mass, xy(part.at), part.inertia) for part in masses_of_links(full)],
        Wall(*solids.thinnest_wall),
        solids,
        request,
        assembly,
        unit,
    )
