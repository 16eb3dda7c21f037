"""Whether a mesh is a closed surface, by counting its edges."""

from __future__ import annotations

import numpy as np

from synthesis.solids.mesh import Mesh


def open_edges(mesh: Mesh) -> int:
    """How many edges have no counterpart in the other direction, or more than one; 0 for a closed surface."""
    ways = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    there = ways[:, 0] * len(mesh.corners) + ways[:, 1]
    back = ways[:, 1] * len(mesh.corners) + ways[:, 0]
    return int(len(there) - len(np.unique(there)) + len(np.setdiff1d(there, back)))


def euler_characteristic(mesh: Mesh) -> int:
    """Corners less edges plus triangles: 2 less two for each hole through the part."""
    return len(mesh.corners) - 3 * len(mesh.triangles) // 2 + len(mesh.triangles)
