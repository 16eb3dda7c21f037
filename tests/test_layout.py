"""The floors of the code: who may import whom, and which scene costs what."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from app.scenes import SCENES

ROOT = Path(__file__).parents[1]
FLOORS = {
    "synthesis": {"synthesis"},
    "data_build": {"synthesis", "data_build"},
    "linkage_atlas": {"synthesis", "data_build", "linkage_atlas"},
    "app": {"linkage_atlas", "app"},
    "app/scenes": {"synthesis", "linkage_atlas", "app"},
}
SOLE_IMPORTERS = {"h5py": "synthesis/atlas/file.py", "pywt": "synthesis/atlas/haar.py"}


def imported_names(path: Path) -> set[str]:
    """Top-level names of everything that a file imports, also inside functions."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add((node.module or "").split(".")[0])
    return names


def sources(*folders: str) -> list[Path]:
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


def test_floors_import_only_from_below() -> None:
    for floor, allowed in FLOORS.items():
        upper = [ROOT / other for other in FLOORS if other.startswith(f"{floor}/")]
        for path in sources(floor):
            if any(path.is_relative_to(folder) for folder in upper):
                continue
            own = imported_names(path) & set(FLOORS)
            assert own <= allowed, f"{path} imports {own - allowed}"


def test_each_heavy_library_has_one_importer() -> None:
    for path in sources(*FLOORS):
        for library, owner in SOLE_IMPORTERS.items():
            if path != ROOT / owner:
                assert library not in imported_names(path), f"{path} imports {library}"
        if not path.is_relative_to(ROOT / "app"):
            assert not imported_names(path) & {"fastapi", "starlette", "uvicorn", "pydantic"}, path


def test_there_is_no_drawer_for_everything() -> None:
    for path in sources(*FLOORS):
        assert path.stem not in {"utils", "util", "helpers", "misc", "common"}, path


@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_costs_only_itself(scene: str) -> None:
    code = (
        f"import sys, synthesis.{scene}\n"
        "heavy = {'h5py', 'pywt', 'fastapi', 'pydantic', 'scipy', 'ezdxf', 'matplotlib'} & set(sys.modules)\n"
        "sys.exit(f'imports {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
