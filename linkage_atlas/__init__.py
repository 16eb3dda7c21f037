"""Linkages for a required motion: ``import linkage_atlas as la``.

Ask with `synthesize` (any linkage for a `Motion`, within `Limits`, refined to machine precision), `function` (whose rocker
turns as a function of its crank) or `match` (which rows of an atlas, exactly); move, draw and save what comes back, a `Linkage`.
Plain arrays in and out; angles in degrees unless ``degrees=False``. Names are loaded on first use, so that the
import itself does not load numpy or scipy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from linkage_atlas.assemblies import Assembly as Assembly
    from linkage_atlas.atlases import Atlas as Atlas
    from linkage_atlas.atlases import build_atlas as build_atlas
    from linkage_atlas.atlases import load_atlas as load_atlas
    from linkage_atlas.constructors import FourBar as FourBar
    from linkage_atlas.constructors import SliderCrank as SliderCrank
    from linkage_atlas.drive_design.design import drives as drives
    from linkage_atlas.drive_design.records import Drives as Drives
    from linkage_atlas.functions.generation import function as function
    from linkage_atlas.functions.results import FunctionResult as FunctionResult
    from linkage_atlas.functions.results import FunctionSolution as FunctionSolution
    from linkage_atlas.geometry import Joints as Joints
    from linkage_atlas.limits import Limits as Limits
    from linkage_atlas.linkages import Linkage as Linkage
    from linkage_atlas.matching import match as match
    from linkage_atlas.motion_errors import objective as objective
    from linkage_atlas.motion_errors import residuals as residuals
    from linkage_atlas.motions import Motion as Motion
    from linkage_atlas.pipeline import synthesize as synthesize
    from linkage_atlas.results import Match as Match
    from linkage_atlas.results import Matches as Matches
    from linkage_atlas.results import Result as Result
    from linkage_atlas.solids import SolidParts as SolidParts
    from linkage_atlas.solutions import Solution as Solution
    from linkage_atlas.task import prepare as prepare
    from synthesis.atlas import haar as haar
    from synthesis.errors import AtlasError as AtlasError
    from synthesis.errors import AtlasFault as AtlasFault
    from synthesis.errors import FieldError as FieldError
    from synthesis.work import Cancelled as Cancelled
    from synthesis.work import OutOfTime as OutOfTime
    from synthesis.work import Work as Work

__version__ = "0.1.0"

_HOMES = {
    "linkage_atlas.pipeline": ("synthesize",),
    "linkage_atlas.task": ("prepare",),
    "linkage_atlas.matching": ("match",),
    "linkage_atlas.drive_design.design": ("drives",),
    "linkage_atlas.drive_design.records": ("Drives",),
    "linkage_atlas.functions.results": ("FunctionResult", "FunctionSolution"),
    "linkage_atlas.functions.generation": ("function",),
    "linkage_atlas.limits": ("Limits",),
    "linkage_atlas.linkages": ("Linkage",),
    "linkage_atlas.constructors": ("FourBar", "SliderCrank"),
    "linkage_atlas.geometry": ("Joints",),
    "linkage_atlas.motions": ("Motion",),
    "linkage_atlas.motion_errors": ("objective", "residuals"),
    "synthesis.atlas": ("haar",),
    "linkage_atlas.solids": ("SolidParts",),
    "linkage_atlas.assemblies": ("Assembly",),
    "linkage_atlas.results": ("Result", "Matches", "Match"),
    "linkage_atlas.solutions": ("Solution",),
    "linkage_atlas.atlases": ("Atlas", "load_atlas", "build_atlas"),
    "synthesis.errors": ("FieldError", "AtlasError", "AtlasFault"),
    "synthesis.work": ("Work", "Cancelled", "OutOfTime"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = ["__version__", *sorted(_HOME_OF)]


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = import_module("synthesis.atlas.haar") if name == "haar" else getattr(import_module(_HOME_OF[name]), name)
    if hasattr(value, "__dataclass_fields__") or hasattr(value, "_fields"):  # a record, whose module imports numpy
        import_module("linkage_atlas.records").describe_fields(value)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
