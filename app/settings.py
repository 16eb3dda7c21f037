"""Settings of the service, read from the environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.query import invalid


class Settings(BaseSettings):
    """Settings of the service; the environment variable is ``LINKAGE_ATLAS_`` + the name in capitals."""

    model_config = SettingsConfigDict(
        env_prefix="LINKAGE_ATLAS_", frozen=True, extra="ignore", use_attribute_docstrings=True
    )

    atlas: Path = Path("atlas.h5")
    """Atlas file that is loaded at the start."""
    with_atlas: bool = True
    """Load an atlas. Without an atlas, requests that need it are answered with 503."""
    max_body_bytes: int = Field(1_000_000, gt=0)
    """Size of the largest request body; larger bodies are answered with 413."""
    workers: int | None = Field(None, gt=0)
    """Number of processes that compute answers. None: the number of cores, at least two and at most four."""
    max_waiting: int = Field(64, ge=0)
    """Number of requests that may wait for a worker, at most half of them long; more requests are answered with 503."""
    max_budget_ms: float = Field(30_000, gt=0)
    """Longest time limit of a request, even if its `budget_ms` is longer. After 1.2 times this limit, its worker is replaced."""
    allowed_hosts: tuple[str, ...] = ("*",)
    """Host names that clients may use for the service, as a JSON list; `*` allows any name."""
    metrics: bool = False
    """Answer `GET /metrics` with metrics for Prometheus."""


def atlas_of(settings: Settings) -> Path:
    """Return the configured atlas, or the default atlas, which is built if it does not exist.

    A configured atlas is never built: a wrong file name is an error.
    """
    from linkage_atlas.atlases import find_atlas

    return settings.atlas if "atlas" in settings.model_fields_set else find_atlas(settings.atlas)


def settings_of(options: Any) -> Settings:
    """Return the settings of the environment, with the atlas that the command line names, if any."""
    atlas = getattr(options, "atlas", None)
    try:
        return Settings(atlas=atlas) if atlas else Settings()
    except ValidationError as error:
        raise invalid(error, Settings) from None
