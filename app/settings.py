"""The service's settings: each a named limit or path, read from the environment when the service is made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

from app.query import invalid

MOST_LOGGED = 500
"""Characters of an address in the log."""


class Settings(BaseSettings):
    """Settings of the service; the environment variable is ``LINKAGE_ATLAS_`` + the name in capitals."""

    model_config = SettingsConfigDict(env_prefix="LINKAGE_ATLAS_", frozen=True, extra="ignore")

    atlas: Path = Field(Path("atlas.h5"), description="The atlas file that is loaded at start.")
    with_atlas: bool = Field(
        True,
        description="Whether an atlas is loaded; without one the service is ready at once, and what needs one says so.",
    )
    atlas_max_bytes: int = Field(
        1_000_000_000,
        gt=0,
        description="Largest atlas file that is loaded; a larger one is refused at start.",
    )
    atlas_max_types: int = Field(
        1_500_000,
        gt=0,
        description="Largest number of dimension types of an atlas that is loaded; each takes about 0.4 kB of memory.",
    )
    max_body_bytes: int = Field(
        1_000_000, gt=0, description="Largest request body; a larger one is answered with 413."
    )
    workers: int | None = Field(
        None,
        gt=0,
        description="Processes of `serve` that compute, a request each at a time; further ones wait. One (of two or more) is "
        "never given a request that may take long. None: one for each core, at least two and at most four.",
    )
    request_memory_bytes: int = Field(
        300_000_000,
        gt=0,
        description="Memory that a request may take in a process of `serve`; one that takes more is answered with 503.",
    )
    max_concurrent: int = Field(
        3,
        gt=0,
        description="The same as `workers` for threads, where processes cannot be forked.",
    )
    max_waiting: int = Field(
        64,
        ge=0,
        description="Requests that may wait for their turn, at most half of them such as may take long; beyond that the "
        "answer is 503.",
    )
    max_budget_ms: float = Field(
        30_000,
        gt=0,
        description="Longest budget of one request, whatever its `budget_ms` says; in a worker a budget is four fifths of it at "
        "most. A search takes nine tenths of its budget, the rest is for finishing its answers.",
    )
    max_connections: int = Field(
        800,
        gt=0,
        description="Connections at the same time, as far as the limit of open files allows; for one more the connection "
        "that has said nothing for the longest time is closed.",
    )
    header_seconds: float = Field(10.0, gt=0, description="Time of a client for the header of a request.")
    body_seconds: float = Field(20.0, gt=0, description="Time of a client for the body of a request.")
    reply_seconds: float = Field(
        20.0,
        gt=0,
        description="Time of a client for taking each MB of a reply, and as much once; one that takes longer is cut off.",
    )
    reply_memory_bytes: int = Field(
        64_000_000,
        gt=0,
        description="What replies that their clients have not yet taken may hold together; for one more the answer is 503.",
    )
    log_json: bool = Field(
        False, description="Whether each request leaves a line of JSON in the log, in place of plain text."
    )
    metrics: bool = Field(
        False, description="Whether `GET /metrics` tells Prometheus of requests, times and processes."
    )
    ending_seconds: float = Field(
        5.0,
        gt=1,
        description="Time in which the service ends after SIGTERM, SIGINT or SIGHUP, whatever is being computed.",
    )
    allowed_hosts: tuple[str, ...] = Field(
        ("*",),
        description="Host names under which the service is reached, as a JSON list; `*`: any. `serve` on a loopback address "
        "allows `localhost`, `127.0.0.1` and `::1` unless this is set.",
    )
    trusted_proxies: str = Field(
        "",
        description="Addresses of proxies, separated by commas, whose `X-Forwarded-For` and `X-Forwarded-Proto` are believed.",
    )


def atlas_of(settings: Settings) -> Path:
    """The atlas that is set, or that of this folder, or else the default one, which is built first if it must be.

    One that is set or named is not built: a wrong name is told, not filled.
    """
    from linkage_atlas.atlases import find_atlas

    return settings.atlas if "atlas" in settings.model_fields_set else find_atlas(settings.atlas)


def settings_of(options: Any) -> Settings:
    atlas = getattr(options, "atlas", None)
    try:
        return Settings(atlas=atlas) if atlas else Settings()
    except ValidationError as error:
        raise invalid(error, Settings) from None
