"""Who is let in: hosts, origins, framing; and the headers that every reply carries."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.admission import HEADERS, LOOPBACK, host_of
from app.main import create_app
from app.page import static_files
from app.settings import Settings

EVERYTHING = "/ /docs /redoc /livez /readyz /openapi.json /v1/atlas /v1/types/1 /nowhere /scenes".split()


@pytest.fixture(scope="module")
def local() -> Iterator[TestClient]:
    """A service that its own machine alone reaches."""
    with TestClient(create_app(Settings(atlas=Path("none"), allowed_hosts=LOOPBACK))) as client:
        yield client


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:8000", "[::1]:8000", "LOCALHOST:80"])
def test_the_machine_itself_is_let_in(host, local) -> None:
    assert local.get("/livez", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", "localhost.", "", "[", "a@localhost:b"]
)
def test_foreign_names_are_refused_on_every_route(host, local) -> None:
    for path in EVERYTHING:
        reply = local.get(path, headers={"host": host})
        assert reply.status_code == 421 and reply.headers["content-type"] == "application/problem+json"


OWN = ["https://localhost", "http://localhost:80", "https://localhost:443"]
OTHERS = ["http://evil.example", "http://localhost:8001", "http://localhost.evil.example:8000", "null", "", "file://"]
ORIGINS = [("http://localhost:8000", "localhost:8000", 200), *((origin, "localhost", 200) for origin in OWN)]
ORIGINS += [(origin, "localhost:8000", 403) for origin in OTHERS]


@pytest.mark.parametrize(("origin", "host", "status"), ORIGINS)
def test_pages_of_other_origins_are_refused(origin, host, status, local) -> None:
    reply = local.post("/v1/knotter/needle", json={}, headers={"origin": origin, "host": host})
    assert reply.status_code == status
    assert local.get("/livez", headers={"origin": origin, "host": host}).status_code == 200


HOSTS = {"http://localhost:99": 200, "HTTP://LOCALHOST": 200, "http://evil.example": 421, "http://a@localhost": 421}


@pytest.mark.parametrize(
    ("target", "status"), [(f"{host}/livez", status) for host, status in (HOSTS | {"http://": 421}).items()]
)
def test_the_host_of_an_address_in_absolute_form_counts(target, status, local) -> None:
    """RFC 9112, 3.2.2: whatever the Host header says."""
    sent: list[Any] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {"type": "http", "method": "GET", "path": target, "raw_path": target.encode(), "query_string": b""}
    scope |= {"headers": [(b"host", b"localhost")], "http_version": "1.1", "scheme": "http", "root_path": ""}
    asyncio.run(local.app(scope, receive, send))
    assert sent[0]["status"] == status


@pytest.mark.parametrize("path", EVERYTHING)
def test_every_reply_says_how_it_may_be_used(path, local) -> None:
    reply = local.get(path, headers={"host": "localhost"})
    for name in HEADERS:
        assert reply.headers[name]
    assert "frame-ancestors 'none'" in reply.headers["content-security-policy"]
    assert "http" not in reply.headers["content-security-policy"]


def test_the_routes_are_shown_from_local_files(local) -> None:
    for path in ("/docs", "/redoc"):
        page = local.get(path, headers={"host": "localhost"})
        assert page.status_code == 200 and "://" not in page.text
    for name in ("swagger-ui-bundle.js", "swagger-ui.css", "docs.js"):
        assert f'"/docs/{name}"' in page.text and name in static_files("docs")
        assert local.get(f"/docs/{name}", headers={"host": "localhost"}).status_code == 200
    for name in ("index.html", "README.md", "nothing.js", "%2e%2e"):
        assert local.get(f"/docs/{name}", headers={"host": "localhost"}).status_code == 404


def test_a_type_has_one_name(local) -> None:
    for name in ("1_0", "+1", "1.0", "%201", "1%20", "1_000", "01"):
        assert local.get(f"/v1/types/{name}", headers={"host": "localhost"}).status_code == 404
    reply = local.get("/v1/types/1?kin=slider_crank", headers={"host": "localhost"})
    assert reply.status_code == 422 and reply.json()["errors"][0]["pointer"] == "#/kin"
    assert reply.json()["detail"] == "kin: there is no such parameter"


def test_hosts_are_read_as_a_browser_does() -> None:
    assert host_of("Localhost:1") == "localhost" and host_of("[::1]:80") == "::1" and host_of("[") == ""
