"""Files of the lift that a question exports."""

from __future__ import annotations

from collections.abc import Callable

from synthesis.scenes.lift.files import design_dxf, design_svg
from synthesis.scenes.lift.pose import Design


def drawings(design_of: Callable[..., tuple[Design, float]]) -> dict[str, Callable[..., bytes]]:
    """Return the exports that draw the lift at its start and its top.

    Parameters
    ----------
    design_of : callable
        ``design_of(request, resources)`` returns the design and the angle of the platform's triangle at the start, rad.
    """
    return {
        "svg": lambda request, resources: design_svg(*design_of(request, resources)).encode(),
        "dxf": lambda request, resources: design_dxf(*design_of(request, resources)).encode(),
    }
