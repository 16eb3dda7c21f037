"""Names in backquotes of docstrings lead to something that exists.

A reference to a function that was renamed or deleted sends a reader to the wrong place, and no other check notices it.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("synthesis", "linkage_atlas", "app", "data_build")
REFERENCE = re.compile(r"(?<!`)`([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+)`(?!`)")
FILE_SUFFIXES = {"csv", "dxf", "h5", "json", "md", "pxd", "py", "svg"}


def modules() -> list[str]:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py") if path.stem != "__main__"]
    return sorted(".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in files)


def has_field(kind: Any, name: str) -> bool:
    """Check if a class has an attribute, a field, or a variable that it assigns to its instances."""
    if hasattr(kind, name):
        return True
    if not isinstance(kind, type):
        return False
    if any(name in getattr(base, "__annotations__", {}) for base in kind.__mro__):
        return True
    return f"self.{name} =" in inspect.getsource(kind)


def leads_on(start: Any, parts: list[str]) -> bool:
    """Follow the attributes of an object; modules are imported."""
    for k, part in enumerate(parts):
        if inspect.ismodule(start) and not hasattr(start, part):
            try:
                importlib.import_module(f"{start.__name__}.{part}")
            except ImportError:
                return False
        if not hasattr(start, part):
            return k == len(parts) - 1 and has_field(start, part)
        start = getattr(start, part)
    return True


def resolves(reference: str, module: str) -> bool:
    """Look for a reference in the module, the packages above it, and the packages of the project."""
    first, *parts = reference.split(".")
    if parts[-1] in FILE_SUFFIXES:
        return True
    above = module.split(".")
    homes = [".".join(above[:k]) for k in range(len(above), 0, -1)] + ["linkage_atlas", "synthesis"]
    for home in homes:
        if leads_on(importlib.import_module(home), [first, *parts]):
            return True
    try:
        return leads_on(importlib.import_module(first), parts)
    except ImportError:
        return False


@pytest.mark.parametrize("module", modules())
def test_names_in_backquotes_resolve(module) -> None:
    folder = ROOT / Path(*module.split("."))
    source = folder.with_suffix(".py") if folder.with_suffix(".py").exists() else folder / "__init__.py"
    docstrings = [
        statement.value.value
        for statement in ast.walk(ast.parse(source.read_text()))
        if isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    ]
    missing = [name for text in docstrings for name in REFERENCE.findall(text) if not resolves(name, module)]
    assert not missing, f"{module}: {missing} lead nowhere"
