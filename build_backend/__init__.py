"""Build backend: setuptools, a C compiler from the package index (ziglang) if there is none, and wheels of a single package.

The packages ``app`` and ``data_build`` of the source tree become ``linkage_atlas.app`` and ``linkage_atlas.data_build`` in a
wheel, because an installed package must not occupy such common names.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import os
import re
import shutil
import sysconfig
import zipfile
from pathlib import Path

from setuptools import build_meta

# `prepare_metadata_for_build_wheel` is left out: installers then read the metadata from the finished wheel.
build_sdist = build_meta.build_sdist
build_editable = build_meta.build_editable
prepare_metadata_for_build_editable = build_meta.prepare_metadata_for_build_editable

PARENT, NESTED = "linkage_atlas", ("app", "data_build")
_NAMES = "|".join(NESTED)
_IMPORT = re.compile(rf"^(\s*(?:from|import) )(?=(?:{_NAMES})\b)", re.MULTILINE)
_ENTRY_POINT = re.compile(rf"(= ?)(?=(?:{_NAMES})\.)")


def compiler() -> str | None:
    """Return the command of the C compiler: $CC, the compiler of Python, or cc; None if there is none."""
    if "CC" in os.environ:
        return os.environ["CC"]
    commands = (sysconfig.get_config_var("CC") or "cc", "cc")
    return next((command for command in commands if shutil.which(command.split()[0])), None)


def get_requires_for_build_wheel(config_settings: object = None) -> list[str]:
    """Return the build requirements that pyproject.toml does not list."""
    return [] if compiler() else ["ziglang"]


get_requires_for_build_editable = get_requires_for_build_wheel


def build_wheel(
    wheel_directory: str, config_settings: dict[str, str] | None = None, metadata_directory: str | None = None
) -> str:
    """Build a wheel whose packages ``app`` and ``data_build`` lie in ``linkage_atlas``; return its file name."""
    name: str = build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)
    nest_packages(Path(wheel_directory) / name)
    return name


def nest_packages(wheel: Path) -> None:
    """Move the nested packages of a wheel into their parent, and adapt imports, entry points and the list of files."""
    with zipfile.ZipFile(wheel) as archive:
        members = [(info, archive.read(info)) for info in archive.infolist()]
    record: list[tuple[str, str, str | int]] = []
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for info, content in members:
            if info.filename.endswith(".dist-info/RECORD"):
                continue
            if info.filename.partition("/")[0] in NESTED:
                info.filename = f"{PARENT}/{info.filename}"
            if info.filename.endswith(".py"):
                content = _IMPORT.sub(rf"\1{PARENT}.", content.decode()).encode()
            elif info.filename.endswith(".dist-info/entry_points.txt"):
                content = _ENTRY_POINT.sub(rf"\1{PARENT}.", content.decode()).encode()
            elif info.filename.endswith(".dist-info/top_level.txt"):
                content = "".join(f"{name}\n" for name in content.decode().split() if name not in NESTED).encode()
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            record.append((info.filename, f"sha256={digest}", len(content)))
            archive.writestr(info, content)
        (name,) = (info.filename for info, _ in members if info.filename.endswith(".dist-info/RECORD"))
        lines = io.StringIO()
        csv.writer(lines, lineterminator="\n").writerows([*record, (name, "", "")])
        archive.writestr(name, lines.getvalue())
