"""Linkages for a required motion: ``import linkage_atlas as la``.

Ask with `synthesize` (any linkage for a `Motion`, within `Limits`, refined to machine precision), `function` (whose rocker
turns as a function of its crank) or `match` (which rows of an atlas, exactly); move, draw and save what comes back, a `Linkage`.
Plain arrays in and out; angles in degrees unless ``degrees=False``. Names are loaded on first use, so that the
import itself does not load numpy or scipy.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from argparse import ArgumentParser, _SubParsersAction

    from linkage_atlas.assemblies import Assembly
    from linkage_atlas.atlases import Atlas, build_atlas, load_atlas
    from linkage_atlas.batch import study
    from linkage_atlas.constructors import FourBar, SliderCrank
    from linkage_atlas.drive_design.design import drives
    from linkage_atlas.drive_design.records import Drives
    from linkage_atlas.drive_design.six_bars import SixBarJoints, SixBarLinkage
    from linkage_atlas.functions.generation import function
    from linkage_atlas.functions.results import FunctionResult, FunctionSolution
    from linkage_atlas.geometry import Joints
    from linkage_atlas.limits import Limits
    from linkage_atlas.linkages import Linkage, assembly
    from linkage_atlas.matching import match
    from linkage_atlas.motion_errors import objective, residuals
    from linkage_atlas.motions import Motion
    from linkage_atlas.pipeline import synthesize
    from linkage_atlas.results import Match, Matches, Result
    from linkage_atlas.solids import SolidParts
    from linkage_atlas.solutions import Solution
    from linkage_atlas.task import prepare
    from synthesis.atlas import haar
    from synthesis.errors import AtlasError, AtlasFault, FieldError
    from synthesis.work import Cancelled, OutOfTime, Work

__version__ = "0.1.0"

BATCH_COMMANDS = {
    "build": "Build an atlas file.",
    "verify": "Check all contents of an atlas file.",
    "info": "Describe an atlas file.",
}
"""Commands of the batch job, which `data_build` runs, with their help."""

_HOMES = {
    "linkage_atlas.pipeline": ("synthesize",),
    "linkage_atlas.task": ("prepare",),
    "linkage_atlas.matching": ("match",),
    "linkage_atlas.drive_design.design": ("drives",),
    "linkage_atlas.drive_design.records": ("Drives",),
    "linkage_atlas.functions.results": ("FunctionResult", "FunctionSolution"),
    "linkage_atlas.functions.generation": ("function",),
    "linkage_atlas.limits": ("Limits",),
    "linkage_atlas.linkages": ("Linkage", "assembly"),
    "linkage_atlas.constructors": ("FourBar", "SliderCrank"),
    "linkage_atlas.geometry": ("Joints",),
    "linkage_atlas.motions": ("Motion",),
    "linkage_atlas.motion_errors": ("objective", "residuals"),
    "synthesis.atlas": ("haar",),
    "linkage_atlas.drive_design.six_bars": ("SixBarLinkage", "SixBarJoints"),
    "linkage_atlas.solids": ("SolidParts",),
    "linkage_atlas.assemblies": ("Assembly",),
    "linkage_atlas.results": ("Result", "Matches", "Match"),
    "linkage_atlas.solutions": ("Solution",),
    "linkage_atlas.atlases": ("Atlas", "load_atlas", "build_atlas"),
    "linkage_atlas.batch": ("study",),
    "synthesis.errors": ("FieldError", "AtlasError", "AtlasFault"),
    "synthesis.work": ("Work", "Cancelled", "OutOfTime"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "BATCH_COMMANDS",
    "Assembly",
    "Atlas",
    "AtlasError",
    "AtlasFault",
    "Cancelled",
    "Drives",
    "FieldError",
    "FourBar",
    "FunctionResult",
    "FunctionSolution",
    "Joints",
    "Limits",
    "Linkage",
    "Match",
    "Matches",
    "Motion",
    "OutOfTime",
    "Result",
    "SixBarJoints",
    "SixBarLinkage",
    "SliderCrank",
    "SolidParts",
    "Solution",
    "Work",
    "__version__",
    "add_batch_commands",
    "assembly",
    "build_atlas",
    "drives",
    "function",
    "haar",
    "load_atlas",
    "match",
    "objective",
    "prepare",
    "residuals",
    "run_batch",
    "study",
    "synthesize",
]


def run_batch(arguments: Sequence[str]) -> int:
    """Run a batch command.

    Parameters
    ----------
    arguments : sequence of str
        Words of the command line, beginning with the name of the command.

    Returns
    -------
    int
        Exit code of the command.
    """
    from data_build.batch import main

    return main(arguments)


def add_batch_commands(commands: _SubParsersAction[ArgumentParser]) -> None:
    """Add the commands that build, check and describe an atlas file, with all their options, to a parser.

    Parameters
    ----------
    commands : argparse subparsers
        Result of ``parser.add_subparsers()``.
    """
    from data_build.batch import add_commands

    add_commands(commands)


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
