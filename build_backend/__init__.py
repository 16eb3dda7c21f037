"""Build backend: setuptools, and a C compiler from the package index (ziglang) where the machine has none."""

from __future__ import annotations

import os
import shutil
import sysconfig

from setuptools.build_meta import *  # noqa: F403


def compiler() -> str | None:
    """Command of the machine's C compiler: $CC, the one that compiled Python, or cc; None where there is none."""
    if "CC" in os.environ:
        return os.environ["CC"]
    commands = (sysconfig.get_config_var("CC") or "cc", "cc")
    return next((command for command in commands if shutil.which(command.split()[0])), None)


def get_requires_for_build_wheel(config_settings: object = None) -> list[str]:
    """Return the build requirements beyond those of pyproject.toml."""
    return [] if compiler() else ["ziglang"]


get_requires_for_build_editable = get_requires_for_build_wheel
