"""Named solid parts in place."""

from __future__ import annotations

from dataclasses import dataclass

from synthesis.solids.prism import Prism


@dataclass(frozen=True, eq=False)
class Part:
    """A solid part in its own frame, and where that frame stands at the first sample; lengths in millimetres."""

    name: str
    body: str
    kind: str
    prism: Prism
    material: str
    density: float
    colour: str
    shift: complex = 0j
    turn: complex = 1.0 + 0j
    up: float = 0.0

    @property
    def origin(self) -> tuple[float, float, float]:
        """Where its frame stands."""
        return self.shift.real, self.shift.imag, self.up
