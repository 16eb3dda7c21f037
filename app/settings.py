"""The service's settings: each a named limit or path, read from the environment when the service is made."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


class Settings(BaseSettings):
    """Settings of the service; the environment variable is ``LINKAGE_ATLAS_`` + the name in capitals."""

    model_config = SettingsConfigDict(env_prefix="LINKAGE_ATLAS_", frozen=True, extra="ignore")

    atlas: Path = Field(Path("atlas.h5"), description="The atlas file that is loaded at start.")
    atlas_max_bytes: int = Field(
        1_000_000_000,
        gt=0,
        description="Largest atlas file that is loaded; a larger one is refused at start.",
    )
    atlas_max_types: int = Field(
        1_500_000,
        gt=0,
        description="Most dimension types of an atlas that is loaded (a scan takes about 2.2 kB a type).",
    )
    prepare_positions: bool = Field(
        True,
        description="Whether a background thread makes the series that only atlas requests with positions need (about "
        "1.2 kB a type) once the service is ready; otherwise the first such request makes them.",
    )
    max_body_bytes: int = Field(
        1_000_000, gt=0, description="Largest request body; a larger one is answered with 413."
    )
    max_concurrent: int = Field(2, gt=0, description="Requests that compute at the same time; further ones wait.")
    max_waiting: int = Field(
        64, ge=0, description="Requests that may wait for their turn; beyond that the answer is 503."
    )
    max_budget_ms: float = Field(
        30_000, gt=0, description="Longest search of one request, whatever its `budget_ms` says."
    )
