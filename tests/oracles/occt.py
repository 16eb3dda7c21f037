"""A STEP file as Open CASCADE reads it: names, places, colours, volumes and round holes. Needs the extra `solids`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from OCP.Bnd import Bnd_Box
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.collections import Sequence_TDF_Label
from OCP.GeomAbs import GeomAbs_Cylinder
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.Quantity import Quantity_Color
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool


@dataclass
class Reopened:
    """A part as the program sees it in the assembly; millimetres."""

    name: str
    valid: bool
    solids: int
    volume: float
    centre: tuple[float, float, float]
    colour: tuple[float, float, float] | None
    holes: list[tuple[float, float, float]]
    """x, y, diameter of each whole cylinder around a hollow."""
    rounds: list[tuple[float, float, float]]
    """Add the same figures of each whole cylinder around material."""
    heights: tuple[float, float]
    halves: list[tuple[float, float, float]]
    """Add the same figures of each half cylinder around a hollow: the ends of slits."""


def reopened(text: str, folder: Path) -> tuple[str, list[Reopened]]:
    """Name of the assembly and its parts."""
    path = folder / "reopened.step"
    path.write_text(text, encoding="ascii")
    document = TDocStd_Document(TCollection_ExtendedString("reopened"))
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    assert reader.ReadFile(str(path)) == IFSelect_RetDone
    assert reader.Transfer(document)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    roots = Sequence_TDF_Label()
    shapes.GetFreeShapes(roots)
    assert roots.Length() == 1
    root = roots.Value(1)
    parts = Sequence_TDF_Label()
    XCAFDoc_ShapeTool.GetComponents_s(root, parts)
    found = []
    for k in range(1, parts.Length() + 1):
        label, referred = parts.Value(k), TDF_Label()
        assert XCAFDoc_ShapeTool.GetReferredShape_s(label, referred)
        assert _name(label) == _name(referred)
        shape = XCAFDoc_ShapeTool.GetShape_s(label)
        colour = Quantity_Color()
        bare = XCAFDoc_ShapeTool.GetShape_s(referred)
        seen = colours.GetColor(bare, XCAFDoc_ColorType.XCAFDoc_ColorSurf, colour)
        found.append(_seen(_name(label), shape, (colour.Red(), colour.Green(), colour.Blue()) if seen else None))
    return _name(root), found


def _name(label: TDF_Label) -> str:
    name = TDataStd_Name()
    return name.Get().ToExtString() if label.FindAttribute(TDataStd_Name.GetID_s(), name) else ""


def _seen(name, shape, colour) -> Reopened:
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    middle = properties.CentreOfMass()
    solids, faces = TopExp_Explorer(shape, TopAbs_SOLID), TopExp_Explorer(shape, TopAbs_FACE)
    count = 0
    while solids.More():
        count += 1
        solids.Next()
    holes, rounds, halves = [], [], []
    while faces.More():
        face = TopoDS.Face(faces.Current()) if hasattr(TopoDS, "Face") else TopoDS.Face_s(faces.Current())
        surface = BRepAdaptor_Surface(face)
        if surface.GetType() == GeomAbs_Cylinder:
            turned = surface.LastUParameter() - surface.FirstUParameter()
            axis = surface.Cylinder().Axis().Location()
            if math.isclose(turned, 2 * math.pi, rel_tol=1e-9):
                into = holes if face.Orientation() == TopAbs_REVERSED else rounds
                into.append((axis.X(), axis.Y(), 2 * surface.Cylinder().Radius()))
            elif face.Orientation() == TopAbs_REVERSED and math.isclose(turned, math.pi, rel_tol=1e-9):
                halves.append((axis.X(), axis.Y(), 2 * surface.Cylinder().Radius()))
        faces.Next()
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    low, high = box.CornerMin().Z(), box.CornerMax().Z()
    centre = (middle.X(), middle.Y(), middle.Z())
    valid = BRepCheck_Analyzer(shape).IsValid()
    return Reopened(name, valid, count, properties.Mass(), centre, colour, holes, rounds, (low, high), halves)
