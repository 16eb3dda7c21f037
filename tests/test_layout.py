"""The floors of the code: who may import whom, how long a module may be, and which package costs what."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from app.scenes import SCENES
from docs import map as layout

ROOT = layout.ROOT
PRODUCT = layout.sources(*layout.FLOORS)
SOLE_IMPORTERS = {
    "cython": (
        "synthesis/atlas/tree_kernel.py",
        *(f"synthesis/kernels/{name}.py" for name in ("crank_descent", "crank_loops", "damped_steps", "distinct")),
        *(f"synthesis/kernels/{name}.py" for name in ("four_bar_limits", "guide", "pair_rows", "quadratic_program")),
    ),
    "h5py": ("synthesis/atlas/file.py",),
    "mapbox_earcut": ("synthesis/solids/mesh.py",),
    "pywt": ("synthesis/atlas/haar.py",),
}
WEB = {"fastapi", "starlette", "uvicorn", "pydantic", "pydantic_settings"}


def tops(path: Path) -> set[str]:
    """Top-level names of everything that a file imports."""
    return {name.partition(".")[0] for name in layout.imported(path)}


def test_no_arrow_goes_up_and_there_is_no_circle() -> None:
    assert layout.faults() == []


def test_the_service_calls_the_front_door_and_each_scene_its_own_machine() -> None:
    for module, remaining in layout.module_graph().items():
        if module.startswith("app"):
            scene = module.removeprefix("app.scenes.").partition(".")[0]
            allowed = ("app", "linkage_atlas", f"synthesis.scenes.{scene}", "synthesis.sheet")
            own = allowed if scene in SCENES else allowed[:2]
            wrong = {second for second in remaining - {"synthesis"} if not second.startswith(own)}
            assert not wrong, f"{module} imports {wrong}"


def test_each_heavy_library_has_its_importer() -> None:
    for path in PRODUCT:
        found = tops(path)
        for library, owners in SOLE_IMPORTERS.items():
            allowed = path in [ROOT / owner for owner in owners]
            assert library not in found or allowed, f"{path}: only {owners} import {library}"
        assert path.is_relative_to(ROOT / "app") or not found & WEB, f"{path}: only app knows the web framework"
        assert not found & {"benchmarks", "tests", "docs"}, f"{path}: the product stands without them"


def test_a_module_says_what_it_is_for() -> None:
    for path in [*PRODUCT, *layout.sources("benchmarks")]:
        first = re.match(r'(?:#.*\n|\n)*(?:r?"""(.*?)(?:"""|\n))?', path.read_text())[1] or ""
        assert first.endswith((".", "?", "::", ":")) and len(first) > 20, (
            f"{path}: the first line says what it is for"
        )
        assert path.stem not in {"utils", "util", "helpers", "misc", "common"}, f"{path}: name it by what it does"


def test_only_the_tests_of_benchmarks_import_them() -> None:
    for path in layout.sources("tests"):
        assert path.parent.name == "benchmarks" or not (
            "benchmarks" in path.read_text() and "benchmarks" in tops(path)
        ), path


@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_costs_only_itself(scene: str) -> None:
    code = (
        f"import sys, pkgutil, importlib, synthesis.scenes.{scene} as scene\n"
        "for module in pkgutil.iter_modules(scene.__path__):\n"
        f"    importlib.import_module('synthesis.scenes.{scene}.' + module.name)\n"
        "far = {'h5py', 'pywt', 'fastapi', 'pydantic', 'scipy', 'ezdxf', 'matplotlib', 'synthesis.fourbar'}\n"
        "heavy = far & set(sys.modules)\n"
        "sys.exit(f'imports {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_no_module_hides_a_public_name() -> None:
    """An import of a module sets its name on the package, which would then no longer be the function."""
    import linkage_atlas

    modules = {path.stem for path in Path(linkage_atlas.__file__).parent.iterdir()}
    assert not modules & set(linkage_atlas.__all__)


@pytest.mark.parametrize("path", PRODUCT, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_documented_parameters_are_those_of_the_signature(path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef) and (not node.args.kwarg or node.args.kwarg.annotation is None):
            section = re.search(r"Parameters\n-{10}\n(.*?)(\n\w+\n---|$)", ast.get_docstring(node) or "", re.DOTALL)
            documented = re.findall(r"^\*{0,2}(\w.*?)(?: :.*)?$", section[1] if section else "", re.MULTILINE)
            arguments = {argument.arg for argument in ast.walk(node.args) if isinstance(argument, ast.arg)}
            unknown = {name.strip(" *") for names in documented for name in names.split(",")} - arguments
            assert not unknown, f"{node.name} documents {unknown}"
