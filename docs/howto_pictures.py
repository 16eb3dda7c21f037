"""Pictures of the how-to pages in docs/img, of the described files and replies: ``python -m docs.howto_pictures``."""

from __future__ import annotations

import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import ezdxf.path
import numpy as np
from matplotlib.colors import to_rgb
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

import linkage_atlas as la
from benchmarks.figures import BLUE, GREEN, GREY, INK, ORANGE, bare, figure
from synthesis.fourbar.dimension_types import TypeRule, count_types

CASEMENT = Path(__file__).parents[1] / "app" / "examples" / "casement.csv"


def window() -> la.Linkage:
    """Return the linkage of the casement window."""
    motion = la.Motion.from_table(CASEMENT, length_unit="mm")
    limits = la.Limits(pivot_box=[-100, -250, 400, 150], link_min=60, link_max=500)
    return la.synthesize(motion, limits, top=1).linkage


def plates(folder: Path) -> None:
    """Draw the contours to cut, with the names that mark them."""
    window().save(folder / "window.plates.dxf", kerf=0.2, hole=6, width=20)
    with figure("howto_plates.png", size=(9, 4.6)) as (_, (axes,)):
        for entity in ezdxf.readfile(folder / "window.plates.dxf").modelspace():
            if entity.dxftype() == "TEXT":
                axes.text(*entity.dxf.insert.vec2, entity.dxf.text, fontsize=7, color=INK)
            else:
                points = np.array([point.vec2 for point in ezdxf.path.make_path(entity).flattening(0.05)])
                axes.plot(*points.T, color=BLUE, linewidth=1.2)
        bare(axes)


def bed(folder: Path) -> None:
    """Draw the parts of the printed model as they lie on the bed."""
    window().save(folder / "model.3mf", fit="print", scale=0.5)
    with figure("howto_bed.png", size=(9, 6), subplot_kw={"projection": "3d"}) as (_, (axes,)):
        parts = parts_on_bed(folder / "model.3mf")
        for number, (corners, triangles) in enumerate(parts):
            faces = corners[triangles]
            normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
            heights = normals[:, 2] / np.linalg.norm(normals, axis=1)
            seen = heights > -0.5  # without the faces on the bed
            brightness = 0.7 + 0.3 * heights[seen, None]
            colours = brightness * to_rgb((BLUE, GREEN, ORANGE, GREY)[min(number, 3)])
            axes.add_collection3d(Poly3DCollection(faces[seen], facecolors=colours, antialiaseds=False))
        every_corner = np.concatenate([corners for corners, _ in parts])
        low, high = every_corner.min(axis=0), every_corner.max(axis=0)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(0, high[2]))
        axes.set_box_aspect(high - low, zoom=1.1)
        axes.view_init(elev=45, azim=-65)
        axes.set_axis_off()


def parts_on_bed(file: Path) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Read the corners (n, 3) and triangles (m, 3) of each part of a 3MF file, at its position on the bed."""
    with zipfile.ZipFile(file) as archive:
        model = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    space = {"m": model.tag[1:].partition("}")[0]}
    parts = []
    for item in model.iterfind(".//m:item", space):
        shift = np.array(item.attrib["transform"].split()[9:], float)
        mesh = model.find(f".//m:object[@id='{item.attrib['objectid']}']", space)
        assert mesh is not None
        corners = [[float(vertex.attrib[axis]) for axis in "xyz"] for vertex in mesh.iterfind(".//m:vertex", space)]
        triangles = [
            [int(face.attrib[v]) for v in ("v1", "v2", "v3")] for face in mesh.iterfind(".//m:triangle", space)
        ]
        parts.append((shift + np.array(corners), np.array(triangles)))
    return parts


def study() -> None:
    """Draw the results of a study: lids that open by an angle, with pivots in a box of a given height."""
    openings, heights = np.linspace(20, 137, 40), np.linspace(4, 100, 25)
    requests = [lid(opening, height) for height in heights for opening in openings]
    results = [la.synthesize(**request) for request in requests]
    sizes = [result.best.size if result else np.nan for result in results]
    with figure("howto_study.png", size=(7, 4)) as (drawing, (axes,)):
        mesh = axes.pcolormesh(openings, heights, np.reshape(sizes, (len(heights), -1)), cmap="viridis_r", vmax=3)
        drawing.colorbar(mesh, label="size of the best linkage")
        axes.set(xlabel="the lid opens by (degrees)", ylabel="height of the box of the pivots")
        axes.grid(visible=False)


def lid(opening: float, height: float) -> dict[str, object]:
    """Return the request for a lid of length 100 that moves back and up while it opens."""
    return {
        "rotation": [0, opening],
        "position": [[0, 0], [-45, 30]],
        "limits": {"pivot_box": [0, -height, 100, 0]},
        "top": 1,
    }


def atlas_sizes() -> None:
    """Draw the number of types of an atlas over its perimeter."""
    perimeters = np.arange(100, 1001, 20)
    types = [count_types(TypeRule(perimeter=int(perimeter))) for perimeter in perimeters]
    with figure("howto_atlas.svg", size=(6, 3.4)) as (_, (axes,)):
        axes.plot(perimeters, types)
        axes.plot([400], [count_types(TypeRule())], "o", color=ORANGE)
        axes.annotate("the default atlas", (400, count_types(TypeRule())), (8, -12), textcoords="offset points")
        axes.set(xlabel="perimeter", ylabel="types", xscale="log", yscale="log")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        plates(Path(temporary))
        bed(Path(temporary))
    atlas_sizes()
    study()
