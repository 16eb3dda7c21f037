"""Serve the application with uvicorn."""

from __future__ import annotations

import signal
import sys

import uvicorn

from app.main import create_app
from app.settings import Settings

LOOPBACK = ("localhost", "127.0.0.1", "::1", "[::1]")
"""Host names of a service that is reachable only from its own machine."""
ENDING_SECONDS = 2
"""Time for requests to end after SIGTERM or SIGINT; unfinished requests are then answered with 503."""
KEEP_ALIVE_SECONDS = 75
"""Time after which an idle connection is closed; longer than the timeout of nginx, so that nginx does not use a connection
that is being closed."""


def serve(settings: Settings, host: str, port: int) -> None:
    """Answer until SIGINT or SIGTERM."""
    if host in LOOPBACK and "allowed_hosts" not in settings.model_fields_set:
        settings = settings.model_copy(update={"allowed_hosts": LOOPBACK})
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # uvicorn raises the signal again after a clean end
    uvicorn.run(
        create_app(settings),
        host=host,
        port=port,
        ws="none",
        server_header=False,
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
        timeout_graceful_shutdown=ENDING_SECONDS,
    )
