"""The page at the root, a page for each scene, and the documentation of the API; their files are static."""

from __future__ import annotations

import mimetypes
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.staticfiles import StaticFiles

from app.problems import Problem, problem
from app.scenes import SCENES, queries_of

NO_SCENE = f"there is no such scene; the scenes are {', '.join(SCENES)}"
PAGES = {"/": "index.html", "/favicon.ico": "icon.svg"}

mimetypes.add_type("text/javascript", ".js")  # before Python 3.12 another type


def install(app: FastAPI) -> None:
    """Add the routes of the pages."""
    page, docs = (StaticFiles(directory=Path(str(files(__package__) / name))) for name in ("static", "docs"))

    def shown(path: str, files: StaticFiles, name: str) -> None:
        async def reply(request: Request) -> Response:
            return await files.get_response(name, request.scope)

        app.add_route(path, reply, ["GET"], include_in_schema=False)

    for path, name in PAGES.items():
        shown(path, page, name)
    app.add_route("/function", lambda _: RedirectResponse("/#function"), ["GET"], include_in_schema=False)
    for path in ("/docs", "/redoc"):
        shown(path, docs, "index.html")
    app.mount("/static", page)
    app.mount("/docs", docs)

    @app.get("/scenes", include_in_schema=False)
    def scenes() -> list[dict[str, str]]:
        return [{"name": name, "title": title} for name, title in SCENES.items()]

    @app.get("/scenes/{name}", include_in_schema=False, response_class=Response)
    async def scene(name: str, request: Request) -> Response:
        if name not in SCENES:
            raise Problem(problem(404, NO_SCENE))
        return await page.get_response("scene.html", request.scope)

    @app.get("/scenes/{name}/queries", include_in_schema=False)
    def queries(name: str) -> dict[str, Any]:
        if name not in SCENES:
            raise Problem(problem(404, NO_SCENE))
        return scene_details(name)


@cache
def scene_details(name: str) -> dict[str, Any]:
    """Return the data for the page of a scene: its queries with the schemas and examples of their requests."""
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
    return {"name": name, "title": SCENES[name], "queries": queries}
