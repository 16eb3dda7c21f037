"""What is let in and how replies leave: hosts, origins, framing of bodies, and the headers that every reply carries."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.problems import HEADERS, problem

LOOPBACK = ("localhost", "127.0.0.1", "::1")
"""Hosts of a service that only its own machine reaches."""


def host_of(value: str) -> str:
    """The host in a Host header, without its port; empty where it is none."""
    if set(value) & set("@/?#\\"):
        return ""
    try:
        return urlsplit(f"//{value}").hostname or ""
    except ValueError:
        return ""


class Admission:
    """Refuses requests not under one of the names ``hosts`` (DNS rebinding), from a foreign page, and of ambiguous length."""

    def __init__(self, app: ASGIApp, hosts: Sequence[str]) -> None:
        self.app = app
        self._hosts = None if "*" in hosts else {name.lower().strip("[]") for name in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if scope["path"].lower().startswith(("http://", "https://")):  # a target in absolute form
            host, path = _parts_of(scope["path"])
            _, raw_path = _parts_of(scope["raw_path"].decode())
            scope = {**scope, "path": path, "raw_path": raw_path.encode()}
        refused = self._refused(scope["method"], headers, host)
        if refused is None:
            await self.app(scope, receive, send_guarded)
        else:
            status, detail = refused
            await problem(status, detail, headers={"Connection": "close"})(scope, receive, send_guarded)

    def _refused(self, method: str, headers: Headers, host: str) -> tuple[int, str] | None:
        if self._hosts is not None and host_of(host) not in self._hosts:
            return 421, "the service is not known under this host name"
        if "transfer-encoding" in headers and "content-length" in headers:
            return 400, "a body has either Content-Length or Transfer-Encoding"
        origin = headers.get("origin")
        if origin is not None and method not in ("GET", "HEAD", "OPTIONS") and not _same(origin, host):
            return 403, "requests from pages of other origins are not answered"
        return None


def _parts_of(target: str) -> tuple[str, str]:
    """Host, which counts in place of the Host header (RFC 9112, 3.2.2), and path of a target in absolute form."""
    host, _, path = target.partition("://")[2].partition("/")
    return host, "/" + path


def _same(origin: str, host: str) -> bool:
    """Whether a page's origin is the host that it asks."""
    scheme, _, rest = origin.lower().partition("://")
    default = {"http": ":80", "https": ":443"}.get(scheme, "")
    return bool(default) and rest.removesuffix(default) == host.lower().removesuffix(default)
