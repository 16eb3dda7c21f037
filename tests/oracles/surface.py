"""Count the edges of a mesh: a closed surface has no open edge."""

from __future__ import annotations

import numpy as np

from synthesis.solids.mesh import Mesh


def open_edges(mesh: Mesh) -> int:
    """Count the edges without exactly one counterpart in the opposite direction; 0 for a closed surface."""
    directions = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    there = directions[:, 0] * len(mesh.corners) + directions[:, 1]
    back = directions[:, 1] * len(mesh.corners) + directions[:, 0]
    return int(len(there) - len(np.unique(there)) + len(np.setdiff1d(there, back)))


def euler_characteristic(mesh: Mesh) -> int:
    """Corners less edges plus triangles: 2 less two for each hole through the part."""
    return len(mesh.corners) - 3 * len(mesh.triangles) // 2 + len(mesh.triangles)
