"""The page at the service's root: static files from memory, with a Content-Security-Policy that allows no other host.

Every file is read once, when the routes are made, and found by its exact name: a request cannot reach the file system.
"""

from __future__ import annotations

import asyncio
import gzip
import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from app.bodies import Held, Reply
from app.computed import Question
from app.problems import NotFound
from app.query import RequestModel, Resources
from app.scenes import SCENES, queries_of

MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}
"""Endings of the files that are served; others (README, licences) are not."""
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
    "Vary": "Accept-Encoding",
}
"""``no-cache``: kept by the browser and asked for again with its ETag, so that modules never are of two versions."""
DOCS_POLICY = HEADERS["Content-Security-Policy"].replace(
    "style-src 'self'; img-src 'self'", "style-src 'self' 'unsafe-inline'; img-src 'self' data:"
)
"""Of the page that shows the routes: its library writes styles and pictures into the page."""
SCENE_TITLES = {"lift": "Lift", "chain": "Chain slide", "knotter": "Knotter"}


@dataclass(frozen=True)
class StaticFile:
    """A file of the page; compressed when it is first sent so, which takes longer than reading all files."""

    content: bytes
    media_type: str

    @cached_property
    def compressed(self) -> bytes:
        return gzip.compress(self.content, mtime=0)

    @cached_property
    def etag(self) -> str:
        return f'"{hashlib.sha256(self.content).hexdigest()[:32]}"'

    def reply(self, request: Request, **more: str) -> Response:
        """The file, or 304 where the browser has it already; with ``more`` headers."""
        headers = {**HEADERS, **more, "ETag": self.etag}
        known = [tag.strip().removeprefix("W/") for tag in request.headers.get("if-none-match", "").split(",")]
        if self.etag in known or known == ["*"]:
            return Response(status_code=304, headers=headers)
        content = self.content
        if accepts_gzip(request.headers.get("accept-encoding", "")):
            content = self.compressed
            headers["Content-Encoding"] = "gzip"
        return Reply(content, self.media_type, headers, held=Held(0))


def accepts_gzip(accept: str) -> bool:
    """Whether an Accept-Encoding header lets gzip in (RFC 9110, 12.5.3)."""
    for entry in accept.lower().split(","):
        coding, *parameters = (part.strip() for part in entry.split(";"))
        if coding in ("gzip", "*"):
            return not any(p.startswith("q=0") and not p.strip("q=0.") for p in parameters)
    return False


def _walk(folder: Traversable, prefix: str = "") -> Iterator[tuple[str, bytes]]:
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.is_dir():
            yield from _walk(entry, f"{prefix}{entry.name}/")
        elif any(entry.name.endswith(ending) for ending in MEDIA_TYPES):
            yield prefix + entry.name, entry.read_bytes()


def static_files(folder: str = "static") -> dict[str, StaticFile]:
    """The files of a folder of the package by their name in it: of the page, or of the one that shows the routes."""
    stored = _walk(files("app").joinpath(folder))
    return {name: StaticFile(content, MEDIA_TYPES[name[name.rindex(".") :]]) for name, content in stored}


def scenes() -> dict[str, str]:
    return {name: SCENE_TITLES.get(name, name.capitalize()) for name in SCENES}


def json_file(content: Any) -> StaticFile:
    """A reply in JSON that depends on no request."""
    return StaticFile(json.dumps(content, ensure_ascii=False, separators=(",", ":")).encode(), MEDIA_TYPES[".json"])


async def sent(file: StaticFile, request: Request, **headers: str) -> Response:
    """A file, compressed on a thread before it is first sent; no thread is needed from then on."""
    if "compressed" not in vars(file):
        await run_in_threadpool(lambda: file.compressed)
    return file.reply(request, **headers)


class Nothing(RequestModel):
    """The body of a question that asks for the same each time."""


class MadeOnce:
    """A reply in JSON that depends on no request, made when it is first asked for, where answers are computed."""

    def __init__(self, app: FastAPI, path: str, make: Callable[[Resources], Any], long: bool = False) -> None:
        answer = lambda _, resources: Reply(json_file(make(resources)).content)  # noqa: E731
        self._question = Question(path, Nothing, answer, lambda _: long)
        app.state.questions[path] = self._question
        self._computing, self._lock = app.state.computing, asyncio.Lock()
        self._file: StaticFile | None = None

    async def reply(self, request: Request) -> Response:
        """The reply; others that ask for it meanwhile wait."""
        async with self._lock:
            if self._file is None:
                made = await self._computing.answer(request, self._question, b"{}")
                if made.status_code != 200:
                    return made
                self._file = StaticFile(b"".join(made.pieces), MEDIA_TYPES[".json"])
        return await sent(self._file, request)


def scene_details(name: str) -> dict[str, Any]:
    """What a scene's page is made from: its queries with the schema of their requests and their examples."""
    queries = [
        {
            "path": query.path,
            "command": query.command,
            "summary": query.summary,
            "schema": query.request.model_json_schema(),
            "examples": dict(query.examples),
            "exports": list(query.exports),
        }
        for query in queries_of(name)
    ]
    return {"name": name, "title": scenes()[name], "queries": queries}


def install(app: FastAPI) -> None:
    """The routes ``/``, ``/function``, ``/static/...``, one page a scene, and what those pages are made from."""
    stored, shown = static_files(), static_files("docs")
    titles = scenes()
    details = {
        name: MadeOnce(app, f"/scenes/{name}/queries", lambda _, name=name: scene_details(name)) for name in titles
    }

    def page(path: str, file: StaticFile, **headers: str) -> None:
        async def reply(request: Request) -> Response:
            return await sent(file, request, **headers)

        app.add_route(path, reply, ["GET", "HEAD"])

    def folder(path: str, files: dict[str, StaticFile]) -> None:
        async def reply(request: Request) -> Response:
            name = request.path_params["name"]
            if name not in files or name.endswith(".html"):
                raise NotFound("the page has no such file")
            return await sent(files[name], request)

        app.add_route(path, reply, ["GET", "HEAD"])

    def scene_of(request: Request) -> str:
        name: str = request.path_params["name"]
        if name not in titles:
            raise NotFound("there is no such scene")
        return name

    async def scene_page(request: Request) -> Response:
        scene_of(request)
        return await sent(stored["scene.html"], request)

    async def scene_queries(request: Request) -> Response:
        return await details[scene_of(request)].reply(request)

    page("/", stored["index.html"])
    page("/function", stored["function.html"])
    page("/favicon.ico", stored["icon.svg"])
    for path in ("/docs", "/redoc"):
        page(path, shown["index.html"], **{"Content-Security-Policy": DOCS_POLICY})
    page("/scenes", json_file([{"name": name, "title": title} for name, title in titles.items()]))
    folder("/static/{name:path}", stored)
    folder("/docs/{name}", shown)
    app.add_route("/scenes/{name}", scene_page, ["GET", "HEAD"])
    app.add_route("/scenes/{name}/queries", scene_queries, ["GET", "HEAD"])
