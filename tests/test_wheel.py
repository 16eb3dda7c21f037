"""A wheel occupies the names linkage_atlas and synthesis only.

Otherwise a module app.py of a user would break the command, or ours would hide a package of that name.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("app", "data_build", "linkage_atlas", "synthesis")
USER = """
import runpy, sys
sys.argv = ["linkage-atlas", *sys.argv[1:]]
runpy.run_module("linkage_atlas.app.start", run_name="__main__")
"""


def test_a_user_may_have_modules_of_the_same_names(tmp_path: Path) -> None:
    import build_backend  # here: every process of the tests reads this file

    wheel, installed = tmp_path / "some.whl", tmp_path / "installed"
    with zipfile.ZipFile(wheel, "w") as archive:
        for path in (path for name in PACKAGES for path in (ROOT / name).rglob("*")):
            if path.is_file() and path.suffix not in (".c", ".pyc"):
                archive.write(path, path.relative_to(ROOT))
        archive.writestr("some.dist-info/entry_points.txt", "[console_scripts]\nlinkage-atlas = app.start:main\n")
        archive.writestr("some.dist-info/RECORD", "")
    build_backend.nest_packages(wheel)
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(installed)
    assert {path.name for path in installed.iterdir()} == {"linkage_atlas", "synthesis", "some.dist-info"}
    assert "= linkage_atlas.app.start:main" in (installed / "some.dist-info" / "entry_points.txt").read_text()
    with (installed / "some.dist-info" / "RECORD").open(newline="") as lines:
        names = [name for name, *_ in csv.reader(lines)]
    assert sorted(names) == sorted(str(p.relative_to(installed)) for p in installed.rglob("*") if p.is_file())

    for name in ("app", "data_build"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a module of the user was imported')")
    (tmp_path / "user.py").write_text(USER)
    for command in ("synthesize --example casement --set top=1", "build --perimeter 40 --jobs 1", "info atlas.h5"):
        words = [sys.executable, "user.py", *command.split()]
        done = subprocess.run(words, cwd=tmp_path, env={"PYTHONPATH": str(installed)}, capture_output=True, text=True)
        assert done.returncode == 0 and done.stdout, done.stderr
