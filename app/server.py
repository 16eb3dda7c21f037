"""The process of the service: uvicorn with the service's limits, and an end in a stated time."""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

import uvicorn

from app.connections import BACKLOG, protocol_of
from app.doors import LOOPBACK
from app.main import create_app
from app.resources import ServiceResources

SWITCH_SECONDS = 0.001
"""Between two turns of threads in the interpreter: so long a short answer waits whenever a long one computes."""
_LAST_SECOND = 1.0
"""Before the end: what still computes is told to stop, and its client that the service ends."""


class _Server(uvicorn.Server):
    """Ends in a stated time, whatever is being computed."""

    seconds: float

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if not self.should_exit:
            turnstile = getattr(self.config.app.state, "turnstile", None)
            steps = [(self.seconds, lambda: os._exit(0))]
            if turnstile is not None:
                steps.append((self.seconds - 2 * _LAST_SECOND, turnstile.stop))
            for seconds, step in steps:
                timer = threading.Timer(max(0.0, seconds), step)
                timer.daemon = True
                timer.start()
        super().handle_exit(sig, frame)
        self._captured_signals.clear()  # ending so is no failure: not handed on


def serve(resources: ServiceResources, host: str, port: int) -> None:
    """Answer on an address until SIGINT or SIGTERM."""
    settings = resources.settings
    if host in LOOPBACK and "allowed_hosts" not in settings.model_fields_set:
        settings = settings.model_copy(update={"allowed_hosts": LOOPBACK})
    sys.setswitchinterval(SWITCH_SECONDS)
    config = uvicorn.Config(
        create_app(settings, resources),
        host=host,
        port=port,
        log_level="info",
        http=protocol_of(settings),
        ws="none",
        backlog=BACKLOG,
        server_header=False,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies or None,
        timeout_graceful_shutdown=max(1, int(settings.ending_seconds - _LAST_SECOND)),
    )
    server = _Server(config)
    server.seconds = settings.ending_seconds
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))  # until the server takes over: nothing has begun
    try:
        server.run()
    except KeyboardInterrupt:
        pass
