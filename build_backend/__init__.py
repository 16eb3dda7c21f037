"""Build backend: setuptools, and a C compiler from the package index (ziglang) if the machine has no compiler."""

from __future__ import annotations

import os
import shutil
import sysconfig

from setuptools.build_meta import *  # noqa: F403


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
